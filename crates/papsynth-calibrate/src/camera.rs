//! Gain, noise and non-uniformity of a camera, by photon transfer.

use ccd_noise::Error as Noise;
use ccd_noise::calibrate::{self, Calibration, CalibrationParams, LightLevel, PhotonTransfer, Shading};
use serde::{Deserialize, Serialize};

use crate::error::Error;

/// Side of the square whose mean is taken for shading, px; frames must be larger.
const SHADING_PX: usize = 15;

/// How much lighter than the dark the brightest flat must be, as a part of all grey levels: below it, noise of the
/// measurement would pass for a gain.
const LEAST_LIGHT: f64 = 0.01;

/// The camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Bits of the converter.
    pub bits: u32,
    /// Grey levels per electron.
    pub gain_dn_per_e: f64,
    /// Electrons that the largest grey level stands for.
    pub full_scale_e: f64,
    /// Mean in the dark, grey levels.
    pub offset_dn: f64,
    /// Noise in the dark, electrons.
    pub dark_noise_e: f64,
    /// Spread of the pixels' offsets, electrons.
    pub dsnu_e: f64,
    /// Spread of the pixels' responses, as a part.
    pub prnu: f64,
    /// Where the camera saturates.
    pub saturation: Saturation,
    /// From dark to bright.
    pub levels: Vec<Level>,
}

/// Where the variance is largest, or the brightest level where it still rises.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Saturation {
    /// Whether the flats reach it.
    pub reached: bool,
    /// Grey levels above the dark.
    pub dn: f64,
    /// Electrons above the dark.
    pub e: f64,
}

/// Frames of one light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Level {
    /// The name that it was given.
    pub name: String,
    /// Whether it was taken in the dark.
    pub dark: bool,
    /// Number of frames.
    pub frames: usize,
    /// Mean, grey levels.
    pub mean_dn: f64,
    /// Variance from frame to frame, squared grey levels.
    pub variance_dn2: f64,
    /// Variance from pixel to pixel, squared grey levels.
    pub spatial_dn2: f64,
    /// The share of pixels at the highest level.
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

/// A frame of an even field, or of the dark.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// What errors call it.
    pub name: &'a str,
    /// Grey levels, row after row.
    pub grey: &'a [u16],
    /// Columns.
    pub width: usize,
}

/// Flat frames, added a level of light at a time, so that not all lie in memory.
#[derive(Debug)]
pub struct Flats {
    transfer: PhotonTransfer,
    bits: u32,
    size: Option<[usize; 2]>,
    levels: Vec<Level>,
}

impl Flats {
    /// No frames yet, of a camera of `bits` bits, 8 to 16.
    ///
    /// # Errors
    /// If the bits are out of range.
    pub fn new(bits: u32) -> Result<Self, Error> {
        let shading = Shading::Removed { side_px: SHADING_PX };
        let params = CalibrationParams { bit_depth: bits, shading, ..CalibrationParams::default() };
        let transfer = PhotonTransfer::new(&params).map_err(Error::Camera)?;
        Ok(Self { transfer, bits, size: None, levels: Vec::new() })
    }

    /// Adds the frames of one light, two or more, all of one size.
    ///
    /// # Errors
    /// If frames differ in size or are too small, hold grey levels beyond the bits, or cannot be measured.
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

    /// The camera that the frames show.
    ///
    /// # Errors
    /// If no level is dark, or the others are saturated, alike or too dark.
    pub fn camera(mut self) -> Result<Camera, Error> {
        let found = self.transfer.calibration().map_err(Error::Camera)?;
        let highest = f64::from(u16::MAX >> (u16::BITS - self.bits));
        let expected = LEAST_LIGHT * (highest - found.offset_dn).max(0.0);
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
