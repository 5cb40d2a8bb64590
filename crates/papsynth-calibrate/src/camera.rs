//! Gain, noise and non-uniformity of a camera, by photon transfer.

use ccd_noise::Error as Noise;
use ccd_noise::calibrate::{self, Calibration, CalibrationParams, LightLevel, PhotonTransfer, Shading};
use serde::{Deserialize, Serialize};

use crate::error::Error;

/// Size of the averaging window of the shading correction, px; frames must be larger.
const SHADING_PX: usize = 15;

/// Smallest difference between the brightest flat and the dark level, as a fraction of full scale. Below it, noise
/// dominates the measured gain.
const MIN_LIGHT: f64 = 0.01;

/// The measured camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Bits of a grey level.
    pub bits: u32,
    /// Grey levels per electron.
    pub gain_dn_per_e: f64,
    /// Electrons of the largest grey level.
    pub full_scale_e: f64,
    /// Mean dark level, grey levels.
    pub offset_dn: f64,
    /// Temporal dark noise, electrons.
    pub dark_noise_e: f64,
    /// Dark signal non-uniformity (standard deviation), electrons.
    pub dsnu_e: f64,
    /// Photo response non-uniformity (relative standard deviation).
    pub prnu: f64,
    /// Saturation.
    pub saturation: Saturation,
    /// Light levels, from dark to bright.
    pub levels: Vec<Level>,
}

/// The level of largest variance, or the brightest level if the variance still increases.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Saturation {
    /// Whether the flats reach saturation.
    pub reached: bool,
    /// Grey levels above the dark.
    pub dn: f64,
    /// Electrons above the dark.
    pub e: f64,
}

/// Statistics of the frames of one light level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Level {
    /// Name of the light level.
    pub name: String,
    /// Whether the frames are dark frames.
    pub dark: bool,
    /// Number of frames.
    pub frames: usize,
    /// Mean, grey levels.
    pub mean_dn: f64,
    /// Temporal variance, squared grey levels.
    pub variance_dn2: f64,
    /// Spatial variance, squared grey levels.
    pub spatial_dn2: f64,
    /// Fraction of pixels at the highest level.
    pub at_highest: f64,
}

impl Level {
    fn new(name: &str, level: &calibrate::Level) -> Self {
        Self {
            name: name.to_owned(),
            dark: level.light == LightLevel::Dark,
            frames: level.frames,
            mean_dn: level.mean_dn,
            variance_dn2: level.variance_dn2,
            spatial_dn2: level.spatial_dn2,
            at_highest: level.at_highest,
        }
    }
}

/// A flat-field or dark frame.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// Name in errors.
    pub name: &'a str,
    /// Grey levels, row by row.
    pub grey: &'a [u16],
    /// Columns.
    pub width: usize,
}

/// A photon-transfer measurement. Frames of one light level at a time are in memory.
#[derive(Debug)]
pub struct Flats {
    transfer: PhotonTransfer,
    bits: u32,
    size: Option<[usize; 2]>,
    levels: Vec<Level>,
}

impl Flats {
    /// Starts a measurement of a camera with `bits` bits, 8 to 16.
    ///
    /// # Errors
    /// If the bits are out of range.
    pub fn new(bits: u32) -> Result<Self, Error> {
        let shading = Shading::Removed { side_px: SHADING_PX };
        let params = CalibrationParams { bit_depth: bits, shading, ..CalibrationParams::default() };
        let transfer = PhotonTransfer::new(&params).map_err(Error::Camera)?;
        Ok(Self { transfer, bits, size: None, levels: Vec::new() })
    }

    /// Adds two or more frames of one light level.
    ///
    /// # Errors
    /// If frames differ in size, are too small, have grey levels beyond the bits, or cannot be measured.
    pub fn add(&mut self, name: &str, frames: &[Frame<'_>], light: LightLevel) -> Result<(), Error> {
        for frame in frames {
            let found = [frame.width, frame.grey.len() / frame.width.max(1)];
            let expected = *self.size.get_or_insert(found);
            let name = || frame.name.to_owned();
            if found != expected {
                return Err(Error::Sizes { name: name(), found, expected });
            }
            if found[0].min(found[1]) <= SHADING_PX {
                return Err(Error::Small { name: name(), found, least: SHADING_PX });
            }
        }
        let slices: Vec<&[u16]> = frames.iter().map(|frame| frame.grey).collect();
        let width = self.size.map_or(1, |[width, _]| width);
        let level = self.transfer.add(&slices, width, light).map_err(|source| match source {
            Noise::OutOfRange { field: "frames", value, .. } => Error::Bits { name: name.to_owned(), value },
            source => Error::Level { name: name.to_owned(), source },
        })?;
        self.levels.push(Level::new(name, level));
        Ok(())
    }

    /// Returns the measured camera.
    ///
    /// # Errors
    /// If no level is dark, or the others are saturated, equal or too dark.
    pub fn camera(mut self) -> Result<Camera, Error> {
        let found = self.transfer.calibration().map_err(Error::Camera)?;
        let highest = f64::from(u16::MAX >> (u16::BITS - self.bits));
        let expected = MIN_LIGHT * (highest - found.offset_dn).max(0.0);
        let brightest = self.levels.iter().map(|level| level.mean_dn - found.offset_dn).fold(0.0, f64::max);
        if brightest < expected {
            return Err(Error::TooDark { found: brightest, expected });
        }
        self.levels.sort_by(|a, b| a.mean_dn.total_cmp(&b.mean_dn));
        let Calibration { gain_dn_per_e, offset_dn, dark_noise_e, dsnu_e, prnu, .. } = found;
        let saturation = match found.saturation {
            calibrate::Saturation::Reached { dn, e } => Saturation { reached: true, dn, e },
            calibrate::Saturation::NotReached { dn, e } => Saturation { reached: false, dn, e },
        };
        Ok(Camera {
            bits: self.bits,
            gain_dn_per_e,
            full_scale_e: (highest - offset_dn) / gain_dn_per_e,
            offset_dn,
            dark_noise_e,
            dsnu_e,
            prnu,
            saturation,
            levels: self.levels,
        })
    }
}
