//! What was measured, as it is kept in `calibration.json`.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use optics_psf::MicroscopeParams;
use optics_psf::calibrate::{Line, Window};
use serde::{Deserialize, Serialize};

use crate::exit::{Complaint, Failure};

/// Version of the record's format.
const VERSION: u32 = 1;

/// The beginning of every record that was written.
pub(super) const BEGINS: &[u8] = b"{\n  \"calibration\":";

/// All that was measured into one folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Record {
    /// Version of the format; the first field, so that the file tells what it is.
    calibration: u32,
    /// What was said of the microscope, where lengths are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) microscope: Option<Instrument>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) focus: Option<FocusRecord>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) edge: Option<EdgeRecord>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) camera: Option<CameraRecord>,
}

/// What the user knows of the microscope.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Instrument {
    pub(super) na: f64,
    pub(super) wavelength_um: f64,
    pub(super) mount_index: f64,
    pub(super) immersion_index: f64,
    pub(super) pixel_um: f64,
}

/// σ against focus offset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FocusRecord {
    /// Travel of the stage from plane to plane, where it is known.
    pub(super) step_um: Option<f64>,
    pub(super) nuclei: Vec<NucleusRecord>,
    pub(super) offsets: Vec<OffsetRecord>,
    pub(super) before: Side,
    pub(super) after: Side,
    /// σ = k·|n|: pixels a plane, mean of both sides.
    pub(super) proportional_px: f64,
    /// Standard error of that: from nucleus to nucleus, or of the fit if there is one alone.
    pub(super) proportional_error_px: f64,
    /// How much the slopes of both sides differ, as a part of their mean.
    pub(super) asymmetry: f64,
    pub(super) condenser: Option<CondenserRecord>,
}

/// One nucleus.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NucleusRecord {
    /// Left, top, width, height, pixels.
    pub(super) window: [usize; 4],
    /// Its plane in focus, counted from 0.
    pub(super) focused: usize,
    /// σ in each plane, pixels.
    pub(super) sigma_px: Vec<f64>,
}

/// All nuclei, at one distance from focus.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OffsetRecord {
    /// Planes from focus.
    pub(super) planes: i64,
    /// Nuclei that have a plane there.
    pub(super) nuclei: usize,
    /// Median and quartiles of their σ, pixels.
    pub(super) sigma_px: f64,
    pub(super) quartiles_px: [f64; 2],
    /// Whether the lines go by it.
    pub(super) fitted: bool,
}

/// The line through the medians on one side of focus.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Side {
    pub(super) slope_px: f64,
    pub(super) intercept_px: f64,
    pub(super) proportional_px: f64,
    /// The part of the variance that the line explains.
    pub(super) r_squared: f64,
}

impl Side {
    pub(super) fn through(points: &[[f64; 2]]) -> Self {
        let Line { slope_px, intercept_px, proportional_px } = Line::through(points);
        let mean = points.iter().map(|p| p[1]).sum::<f64>() / points.len() as f64;
        let square = |f: &dyn Fn(&[f64; 2]) -> f64| points.iter().map(|p| f(p) * f(p)).sum::<f64>();
        let (rest, all) = (square(&|p| p[1] - intercept_px - slope_px * p[0]), square(&|p| p[1] - mean));
        let r_squared = if all > 0.0 { 1.0 - rest / all } else { 1.0 };
        Self { slope_px, intercept_px, proportional_px, r_squared }
    }

    /// σ that the line has at a number of planes from focus.
    pub(super) fn at(&self, planes: f64) -> f64 {
        self.intercept_px + self.slope_px * planes
    }
}

/// The condenser's aperture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CondenserRecord {
    pub(super) na: f64,
    /// Standard error, from nucleus to nucleus or from distance to distance, and of the search.
    pub(super) error: f64,
    /// Where the search ended at an end of what was tried.
    pub(super) bound: Bound,
}

/// What an estimate says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Bound {
    Inside,
    AtMost,
    AtLeast,
}

/// An edge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EdgeRecord {
    /// Left, top, width, height, pixels.
    pub(super) window: [usize; 4],
    pub(super) sigma_px: f64,
    /// Its standard error.
    pub(super) error_px: f64,
    pub(super) dark: f64,
    pub(super) light: f64,
    /// Towards the light, x right and y down.
    pub(super) normal: [f64; 2],
    /// Root mean square of what the fit leaves.
    pub(super) difference: f64,
}

/// The camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraRecord {
    pub(super) bits: u32,
    pub(super) gain_dn_per_e: f64,
    /// Electrons that the largest grey level stands for.
    pub(super) full_scale_e: f64,
    pub(super) offset_dn: f64,
    pub(super) dark_noise_e: f64,
    pub(super) dsnu_e: f64,
    pub(super) prnu: f64,
    pub(super) saturation: SaturationRecord,
    /// From dark to bright.
    pub(super) levels: Vec<LevelRecord>,
}

/// Where the variance is largest, or the brightest level where it still rises.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SaturationRecord {
    pub(super) reached: bool,
    /// Above the dark.
    pub(super) dn: f64,
    pub(super) e: f64,
}

/// Frames of one light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LevelRecord {
    pub(super) name: String,
    pub(super) dark: bool,
    pub(super) frames: usize,
    pub(super) mean_dn: f64,
    pub(super) variance_dn2: f64,
    pub(super) spatial_dn2: f64,
    /// The share of pixels at the highest level.
    pub(super) at_highest: f64,
}

impl Record {
    pub(super) fn new() -> Self {
        Self { calibration: VERSION, microscope: None, focus: None, edge: None, camera: None }
    }

    /// The record of a folder, if there is one.
    pub(super) fn load(path: &Path) -> Result<Option<Self>, Failure> {
        let text = match fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => return Ok(None),
            Err(error) => return Err(Failure::file("read", path, &error)),
        };
        let refuse = |what: String| {
            let help = "choose another folder with --out, or remove the file";
            Err(Failure::input(Complaint::new(format!("{}: {what}", path.display())).help(help)))
        };
        match serde_json::from_str::<Self>(&text) {
            Ok(record) if record.calibration == VERSION => Ok(Some(record)),
            Ok(record) => {
                refuse(format!("a calibration of version {}; this program knows {VERSION}", record.calibration))
            }
            Err(error) => refuse(format!("it is no calibration of this program: {error}")),
        }
    }

    /// Adds what the folder's record has and this one has not.
    pub(super) fn keep(&mut self, older: Self) {
        self.microscope = self.microscope.take().or(older.microscope);
        self.focus = self.focus.take().or(older.focus);
        self.edge = self.edge.take().or(older.edge);
        self.camera = self.camera.take().or(older.camera);
    }

    pub(super) fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }
}

impl Instrument {
    /// As the optics know it; the condenser's aperture is sought, or as given.
    pub(super) fn params(&self, condenser_na: f64) -> MicroscopeParams {
        let Self { na, wavelength_um, mount_index, immersion_index, pixel_um } = *self;
        MicroscopeParams {
            na,
            condenser_na,
            wavelength_um,
            mount_index,
            immersion_index,
            pixel_um,
            ..MicroscopeParams::default()
        }
    }
}

pub(super) fn numbers(window: Window) -> [usize; 4] {
    [window.left, window.top, window.width, window.height]
}
