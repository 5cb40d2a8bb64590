//! Photon transfer: measures the parameters of a camera from its flat frames.

mod level;

pub use level::{Level, LightLevel, Shading};

use crate::camera::ROUNDING;
use crate::error::{Error, require, within};
use crate::{CameraParams, ReadNoise};
use level::measure;

/// Parameters of a photon transfer measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationParams {
    /// Bit depth of the frames, 8 to 16. Default 16, ours.
    pub bit_depth: u32,
    /// Treatment of uneven illumination. Default: removed with squares of 15 pixels, ours, because few microscopes
    /// light evenly.
    pub shading: Shading,
    /// Fraction of saturation up to which gain and responsivity are fitted, above 0, at most 1. Default 0.7, that of
    /// EMVA 1288.
    pub fit_to: f64,
}

impl Default for CalibrationParams {
    fn default() -> Self {
        Self { bit_depth: 16, shading: Shading::Removed { side_px: 15 }, fit_to: 0.7 }
    }
}

/// Collects levels of light, including dark ones, and computes the parameters of the camera.
///
/// EMVA 1288, release 4.0 linear. Temporal noise comes from differences of frames, which cancel the fixed pattern. The
/// fixed pattern is the spatial variance of the mean frame; the remaining temporal noise is subtracted. Only the frames
/// of one level are in memory at a time.
#[derive(Debug, Clone)]
pub struct PhotonTransfer {
    params: CalibrationParams,
    size: Option<[usize; 2]>,
    levels: Vec<Level>,
}

/// The saturation point of EMVA 1288: the level of maximum temporal variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Saturation {
    /// The saturation point was measured.
    Reached {
        /// Mean grey level above dark.
        dn: f64,
        /// Saturation capacity in electrons, dark signal excluded.
        e: f64,
    },
    /// Saturation was not reached. The brightest level is a lower bound.
    NotReached {
        /// Mean grey level of the brightest level above dark.
        dn: f64,
        /// The same in electrons, dark signal excluded.
        e: f64,
    },
}

/// Results of photon transfer.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Overall system gain K in grey levels per electron: the slope of variance against mean, both above dark.
    pub gain_dn_per_e: f64,
    /// Mean dark grey level.
    pub offset_dn: f64,
    /// Dark noise σ_d in electrons: read noise and shot noise of the dark current, without quantisation noise.
    pub dark_noise_e: f64,
    /// DSNU: standard deviation of the pixels' offsets in electrons.
    pub dsnu_e: f64,
    /// PRNU: standard deviation of the pixels' responses as a fraction of their mean.
    pub prnu: f64,
    /// Saturation point.
    pub saturation: Saturation,
    /// Electrons per photon, if the photons of the levels are known.
    pub quantum_efficiency: Option<f64>,
    /// Largest relative deviation from a straight line, if the light of at least three levels is known. The fit covers
    /// 5 % to 95 % of saturation, or up to the brightest level if saturation is not reached.
    pub linearity_error: Option<f64>,
    /// Bit depth of the frames.
    pub bit_depth: u32,
    /// Measured levels: the dark level, then the others from dark to bright.
    pub levels: Vec<Level>,
}

/// A flat is saturated if more than this fraction of pixels is at the highest level (EMVA 1288: 0.1 to 0.2 %).
const SATURATED: f64 = 0.002;

/// Saturation is reached if the brightest level's variance is below this fraction of the maximum. Measurement noise is
/// smaller.
const FALLEN: f64 = 0.8;

/// A dark frame is clipped if more than this fraction of pixels is at level 0 (EMVA 1288: 0.5 %).
const DARK_CLIPPED: f64 = 0.005;

impl PhotonTransfer {
    /// Creates an empty measurement from validated parameters.
    ///
    /// # Errors
    ///
    /// If a field is out of range.
    pub fn new(params: &CalibrationParams) -> Result<Self, Error> {
        within("bit_depth", params.bit_depth.into(), 8.0..=16.0, "from 8 to 16")?;
        require("fit_to", params.fit_to, params.fit_to > 0.0 && params.fit_to <= 1.0, "above 0 and at most 1")?;
        if let Shading::Removed { side_px } = params.shading {
            let odd = side_px >= 3 && !side_px.is_multiple_of(2);
            require("shading.side_px", side_px as f64, odd, "an odd number of at least 3")?;
        }
        Ok(Self { params: params.clone(), size: None, levels: Vec::new() })
    }

    /// Adds a level: two or more `frames` with the same `light`, in rows of `width` pixels.
    ///
    /// Two frames at many levels give the gain. Many frames, such as 64, of the dark level and of one level near half
    /// of saturation give the fixed pattern. Saturated levels give the saturation point.
    ///
    /// # Errors
    ///
    /// If there are fewer than two frames, frames differ in size, values exceed the bit depth, or dark frames are
    /// clipped at 0.
    pub fn add(&mut self, frames: &[&[u16]], width: usize, light: LightLevel) -> Result<&Level, Error> {
        if frames.len() < 2 {
            return Err(Error::TooFew { what: "frames in this level", found: frames.len(), needed: 2 });
        }
        if let LightLevel::Photons(amount) | LightLevel::Relative(amount) = light {
            require("light", amount, amount > 0.0, "above 0 (use LightLevel::Dark for dark frames)")?;
        }
        let size = |frame: &[u16]| [width, frame.len().checked_div(width).unwrap_or(0)];
        let expected = self.size.unwrap_or_else(|| size(frames[0]));
        for frame in frames {
            let found = size(frame);
            if found != expected || found[0] * found[1] != frame.len() || frame.is_empty() {
                return Err(Error::Size { expected, found, pixels: frame.len() });
            }
        }
        if let Shading::Removed { side_px } = self.params.shading {
            let smaller = side_px < expected[0] && side_px < expected[1];
            require("shading.side_px", side_px as f64, smaller, "less than the width and height of the frames")?;
        }
        let level = measure(frames, width, self.highest(), light, self.params.shading)?;
        if light == LightLevel::Dark && level.at_zero > DARK_CLIPPED {
            return Err(Error::DarkClipped { fraction: level.at_zero });
        }
        self.size = Some(expected);
        self.levels.push(level);
        Ok(&self.levels[self.levels.len() - 1])
    }

    /// Computes the parameters of the camera from the levels added so far.
    ///
    /// # Errors
    ///
    /// If there is no dark level, no other level, no unsaturated level, or no increase of mean and variance with light.
    pub fn calibration(&self) -> Result<Calibration, Error> {
        let dark = self.levels.iter().filter(|level| level.light == LightLevel::Dark).max_by_key(|level| level.frames);
        let dark = dark.ok_or(Error::NoDark)?;
        let mut flats: Vec<&Level> = self.levels.iter().filter(|level| level.light != LightLevel::Dark).collect();
        flats.sort_by(|a, b| a.mean_dn.total_cmp(&b.mean_dn));
        let Some(brightest) = flats.last() else {
            return Err(Error::TooFew { what: "levels with light", found: 0, needed: 1 });
        };
        let above = |level: &Level| level.mean_dn - dark.mean_dn;
        let (highest, clipped) = (self.highest(), |level: &Level| level.at_highest > SATURATED);
        let noisiest =
            flats.iter().copied().max_by(|a, b| a.variance_dn2.total_cmp(&b.variance_dn2)).unwrap_or(brightest);
        let reached = clipped(brightest) || brightest.variance_dn2 < FALLEN * noisiest.variance_dn2;
        let noisiest = above(noisiest);
        let limit = if reached { self.params.fit_to * noisiest } else { noisiest };
        let mut open: Vec<&Level> = flats.iter().copied().filter(|level| !clipped(level)).collect();
        if open.is_empty() {
            return Err(Error::Saturated { levels: flats.len(), highest });
        }
        let fitted: Vec<&Level> =
            open.iter().copied().filter(|level| above(level) > 0.0 && above(level) <= limit).collect();
        let transfer = fitted.iter().map(|level| (above(level), level.variance_dn2 - dark.variance_dn2));
        let gain = through_origin(transfer);
        if fitted.is_empty() && open.iter().any(|level| above(level) > 0.0) {
            return Err(Error::TooFew { what: "levels with light up to `fit_to` of saturation", found: 0, needed: 1 });
        }
        if !(gain.is_finite() && gain > 0.0) {
            return Err(Error::NoResponse { above_dark_dn: above(open[open.len() - 1]) });
        }
        let half = 0.5 * if reached { noisiest } else { f64::from(highest) - dark.mean_dn };
        let photons = amounts(&fitted, dark, photons);
        let straight = 0.05 * noisiest..=if reached { 0.95 * noisiest } else { above(brightest) };
        open.retain(|level| straight.contains(&above(level)));
        let saturation = if reached {
            Saturation::Reached { dn: noisiest, e: noisiest / gain }
        } else {
            Saturation::NotReached { dn: above(brightest), e: above(brightest) / gain }
        };
        Ok(Calibration {
            gain_dn_per_e: gain,
            offset_dn: dark.mean_dn,
            dark_noise_e: root(dark.variance_dn2 - ROUNDING) / gain,
            dsnu_e: root(dark.spatial_dn2) / gain,
            prnu: prnu(&fitted, dark, half),
            saturation,
            quantum_efficiency: photons.map(|points| through_origin(points) / gain),
            linearity_error: linearity_error(&open, dark),
            bit_depth: self.params.bit_depth,
            levels: core::iter::once(dark).chain(flats.iter().copied()).cloned().collect(),
        })
    }

    fn highest(&self) -> u16 {
        u16::MAX >> (16 - self.params.bit_depth)
    }
}

/// Returns the PRNU from the level with the most frames; of several, from the one nearest to `half` of saturation.
fn prnu(flats: &[&Level], dark: &Level, half: f64) -> f64 {
    let above = |level: &Level| level.mean_dn - dark.mean_dn;
    let from_half = |level: &Level| (above(level) - half).abs();
    let level = flats.iter().max_by(|a, b| a.frames.cmp(&b.frames).then(from_half(b).total_cmp(&from_half(a))));
    level.map_or(0.0, |level| root(level.spatial_dn2 - dark.spatial_dn2) / above(level))
}

/// Returns the linearity error if every level has an amount of light in the same unit.
fn linearity_error(flats: &[&Level], dark: &Level) -> Option<f64> {
    let relative = |light| if let LightLevel::Relative(amount) = light { Some(amount) } else { None };
    let points = amounts(flats, dark, photons).or_else(|| amounts(flats, dark, relative))?;
    largest_deviation(&points)
}

fn photons(light: LightLevel) -> Option<f64> {
    if let LightLevel::Photons(amount) = light { Some(amount) } else { None }
}

/// Returns (amount of light, mean above dark) of each level, or `None` if an amount is missing.
fn amounts(flats: &[&Level], dark: &Level, amount: impl Fn(LightLevel) -> Option<f64>) -> Option<Vec<(f64, f64)>> {
    flats.iter().map(|level| Some((amount(level.light)?, level.mean_dn - dark.mean_dn))).collect()
}

/// Returns the square root, or 0 if noise has made a variance negative.
fn root(variance: f64) -> f64 {
    variance.max(0.0).sqrt()
}

impl Calibration {
    /// Returns parameters of a camera with the measured values. `serial` selects its fixed pattern.
    ///
    /// Unmeasured values are those of [`CameraParams::default`]: the quantum efficiency without known photons, and a
    /// dark current of 0. Mean and noise of the dark current are part of the offset and the read noise. If the
    /// converter saturates first, or saturation was not reached, the full-well capacity is 2 % above the converter's
    /// range.
    #[must_use]
    pub fn camera(&self, serial: u64) -> CameraParams {
        /// Full-well capacity over converter range, if the full-well capacity was not reached.
        const HEADROOM: f64 = 1.02;
        let default = CameraParams::default();
        let highest = libm::exp2(f64::from(self.bit_depth)) - 1.0;
        let brightest = self.levels.iter().map(|level| level.mean_dn).fold(0.0, f64::max);
        let clipped = self.levels.iter().any(|level| level.at_highest > SATURATED);
        let full_dn = match self.saturation {
            Saturation::Reached { .. } if !clipped => brightest - self.offset_dn,
            _ => HEADROOM * (highest - self.offset_dn),
        };
        CameraParams {
            quantum_efficiency: self.quantum_efficiency.map_or(default.quantum_efficiency, |qe| qe.min(1.0)),
            prnu: self.prnu,
            dsnu_e: self.dsnu_e,
            serial,
            full_well_e: full_dn / self.gain_dn_per_e,
            read_noise: ReadNoise::Same { e: self.dark_noise_e },
            gain_dn_per_e: self.gain_dn_per_e,
            offset_dn: self.offset_dn,
            bit_depth: self.bit_depth,
            ..default
        }
    }
}

/// Returns the slope of the least-squares line through the origin.
fn through_origin(points: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    let [xy, xx] = points.into_iter().fold([0.0; 2], |[xy, xx], (x, y)| [xy + x * y, xx + x * x]);
    xy / xx
}

/// Returns the largest relative deviation from the line of least squared relative deviations, or `None` for fewer than
/// three points.
fn largest_deviation(points: &[(f64, f64)]) -> Option<f64> {
    if points.len() < 3 {
        return None;
    }
    // Weights 1/y², so that the squared deviations are relative.
    let [mut w, mut wx, mut wy, mut wxx, mut wxy] = [0.0; 5];
    for &(x, y) in points {
        let weight = 1.0 / (y * y);
        w += weight;
        wx += weight * x;
        wy += weight * y;
        wxx += weight * x * x;
        wxy += weight * x * y;
    }
    let slope = (w * wxy - wx * wy) / (w * wxx - wx * wx);
    let start = (wy - slope * wx) / w;
    let deviation = |&(x, y): &(f64, f64)| (y / (start + slope * x) - 1.0).abs();
    let largest = points.iter().map(deviation).fold(0.0, f64::max);
    slope.is_finite().then_some(largest)
}
