//! Photon transfer: what a camera is, from its flat frames.

mod level;

pub use level::{Level, Light, Shading};

use crate::camera::ROUNDING;
use crate::error::{Error, require, within};
use crate::{CameraParams, ReadNoise};
use level::measure;

/// How flat frames are judged.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationParams {
    /// Bits of the levels, 8 to 16. Default 16, ours.
    pub bit_depth: u32,
    /// Whether flats are lit evenly. Default removed with squares of 15 pixels, ours: few microscopes light evenly.
    pub shading: Shading,
    /// The share of saturation up to which gain and responsivity are fitted, above 0, at most 1. Default 0.7, that
    /// of EMVA 1288.
    pub fit_to: f64,
}

impl Default for CalibrationParams {
    fn default() -> Self {
        Self { bit_depth: 16, shading: Shading::Removed { side_px: 15 }, fit_to: 0.7 }
    }
}

/// Gathers levels of light, dark among them, and gives the camera that took them.
///
/// EMVA 1288, release 4.0 linear. The noise in time of a level comes from the differences of its frames, which are free of the
/// fixed pattern; of their mean image, whose spread is the pattern, the noise that remains is taken off. Frames are
/// needed for one level at a time.
#[derive(Debug, Clone)]
pub struct PhotonTransfer {
    params: CalibrationParams,
    size: Option<[usize; 2]>,
    levels: Vec<Level>,
}

/// Where the variance is largest, beyond which pixels or the converter saturate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Saturation {
    /// It was reached.
    Reached {
        /// Mean above the dark, in grey levels.
        dn: f64,
        /// The same in electrons.
        e: f64,
    },
    /// The brightest level was still below.
    Above {
        /// Its mean above the dark, in grey levels.
        dn: f64,
        /// The same in electrons.
        e: f64,
    },
}

/// What photon transfer measures.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Overall system gain K in grey levels per electron: the slope of variance over mean, both above the dark's.
    pub gain_dn_per_e: f64,
    /// Mean grey level in the dark.
    pub offset_dn: f64,
    /// Noise in the dark in electrons, σ_d: of reading and of the dark current's shots, without that of rounding.
    pub dark_noise_e: f64,
    /// Standard deviation of the pixels' offsets in electrons.
    pub dsnu_e: f64,
    /// Standard deviation of the pixels' responses as a share of their mean.
    pub prnu: f64,
    /// Where the camera saturates.
    pub saturation: Saturation,
    /// Electrons per photon, if the photons of the levels are known.
    pub quantum_efficiency: Option<f64>,
    /// The largest deviation from a straight line between 5 % and 95 % of saturation, or up to the brightest level where
    /// it is not reached, as a share, if the light of three such levels is known.
    pub linearity_error: Option<f64>,
    /// Bits of the levels.
    pub bit_depth: u32,
    /// The points it is measured on, the dark one first, then from dark to bright.
    pub levels: Vec<Level>,
}

/// Beyond this share of pixels at the highest level a flat is saturated (EMVA 1288: 0.1 to 0.2 %).
const SATURATED: f64 = 0.002;

/// Below this share of the largest variance, that of the brightest level has fallen: no noise of the measurement does that.
const FALLEN: f64 = 0.8;

/// Beyond this share of pixels at level 0 a dark frame is cut off (EMVA 1288: 0.5 %).
const CUT_OFF: f64 = 0.005;

impl PhotonTransfer {
    /// Checks the parameters.
    ///
    /// # Errors
    ///
    /// If a field lies outside its range.
    pub fn new(params: &CalibrationParams) -> Result<Self, Error> {
        within("bit_depth", params.bit_depth.into(), 8.0..=16.0, "from 8 to 16")?;
        require("fit_to", params.fit_to, params.fit_to > 0.0 && params.fit_to <= 1.0, "above 0 and at most 1")?;
        if let Shading::Removed { side_px } = params.shading {
            let odd = side_px >= 3 && !side_px.is_multiple_of(2);
            require("shading.side_px", side_px as f64, odd, "odd and 3 or more")?;
        }
        Ok(Self { params: params.clone(), size: None, levels: Vec::new() })
    }

    /// Adds a level: two or more `frames` under the same `light`, in rows of `width` pixels.
    ///
    /// Two frames of many levels give the gain; many frames, say 64, of the dark and of one level near half of saturation
    /// give the fixed pattern. Saturated levels are welcome, as they tell where saturation is.
    ///
    /// # Errors
    ///
    /// If there are fewer than two frames, they differ in size from others, hold numbers beyond the bit depth, or are
    /// dark ones cut off at 0.
    pub fn add(&mut self, frames: &[&[u16]], width: usize, light: Light) -> Result<&Level, Error> {
        if frames.len() < 2 {
            return Err(Error::TooFew { what: "frames of a level", found: frames.len(), needed: 2 });
        }
        if let Light::Photons(amount) | Light::Relative(amount) = light {
            require("light", amount, amount > 0.0, "above 0; darkness is a kind of its own")?;
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
            require("shading.side_px", side_px as f64, smaller, "below the width and height of the frames")?;
        }
        let level = measure(frames, width, self.highest(), light, self.params.shading)?;
        if light == Light::Dark && level.at_zero > CUT_OFF {
            return Err(Error::CutOff { share: level.at_zero });
        }
        self.size = Some(expected);
        self.levels.push(level);
        Ok(&self.levels[self.levels.len() - 1])
    }

    /// The camera behind the levels added so far.
    ///
    /// # Errors
    ///
    /// If there is no dark level, no other, none that is not saturated, or if they are all alike.
    pub fn calibration(&self) -> Result<Calibration, Error> {
        let dark = self.levels.iter().filter(|level| level.light == Light::Dark).max_by_key(|level| level.frames);
        let dark = dark.ok_or(Error::NoDark)?;
        let mut flats: Vec<&Level> = self.levels.iter().filter(|level| level.light != Light::Dark).collect();
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
            return Err(Error::TooFew { what: "levels with light below fit_to of saturation", found: 0, needed: 1 });
        }
        if !(gain.is_finite() && gain > 0.0) {
            return Err(Error::Alike { above_dark_dn: above(open[open.len() - 1]) });
        }
        let half = 0.5 * if reached { noisiest } else { f64::from(highest) - dark.mean_dn };
        let photons = amounts(&fitted, dark, photons);
        let straight = 0.05 * noisiest..=if reached { 0.95 * noisiest } else { above(brightest) };
        open.retain(|level| straight.contains(&above(level)));
        let saturation = if reached {
            Saturation::Reached { dn: noisiest, e: noisiest / gain }
        } else {
            Saturation::Above { dn: above(brightest), e: above(brightest) / gain }
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

/// The spread of responses, from the level with the most frames and of these the one nearest to `half` of saturation.
fn prnu(flats: &[&Level], dark: &Level, half: f64) -> f64 {
    let above = |level: &Level| level.mean_dn - dark.mean_dn;
    let from_half = |level: &Level| (above(level) - half).abs();
    let level = flats.iter().max_by(|a, b| a.frames.cmp(&b.frames).then(from_half(b).total_cmp(&from_half(a))));
    level.map_or(0.0, |level| root(level.spatial_dn2 - dark.spatial_dn2) / above(level))
}

/// How far levels of known light, all in photons or all in another unit, are from a straight line.
fn linearity_error(flats: &[&Level], dark: &Level) -> Option<f64> {
    let relative = |light| if let Light::Relative(amount) = light { Some(amount) } else { None };
    let points = amounts(flats, dark, photons).or_else(|| amounts(flats, dark, relative))?;
    largest_deviation(&points)
}

fn photons(light: Light) -> Option<f64> {
    if let Light::Photons(amount) = light { Some(amount) } else { None }
}

/// The mean above the dark over the amount of light, if every level has one.
fn amounts(flats: &[&Level], dark: &Level, amount: impl Fn(Light) -> Option<f64>) -> Option<Vec<(f64, f64)>> {
    flats.iter().map(|level| Some((amount(level.light)?, level.mean_dn - dark.mean_dn))).collect()
}

/// 0 where noise has made a variance negative.
fn root(variance: f64) -> f64 {
    variance.max(0.0).sqrt()
}

impl Calibration {
    /// A camera like the one measured, with a fixed pattern of its own that `serial` chooses.
    ///
    /// What is not measured is that of [`CameraParams::default`]: the quantum efficiency where no photons were given, and
    /// the dark current, 0, whose mean and noise are in the offset and the read noise. Where the converter saturates
    /// before the pixels, or nothing did, they are given 2 % more room than the converter.
    #[must_use]
    pub fn camera(&self, serial: u64) -> CameraParams {
        /// By how much a pixel that never was full may hold more than the converter shows.
        const ROOM: f64 = 1.02;
        let default = CameraParams::default();
        let highest = libm::exp2(f64::from(self.bit_depth)) - 1.0;
        let brightest = self.levels.iter().map(|level| level.mean_dn).fold(0.0, f64::max);
        let clipped = self.levels.iter().any(|level| level.at_highest > SATURATED);
        let full_dn = match self.saturation {
            Saturation::Reached { .. } if !clipped => brightest - self.offset_dn,
            _ => ROOM * (highest - self.offset_dn),
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

/// The slope of the line through the origin with the least sum of squares.
fn through_origin(points: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    let [xy, xx] = points.into_iter().fold([0.0; 2], |[xy, xx], (x, y)| [xy + x * y, xx + x * x]);
    xy / xx
}

/// The largest deviation, as a share of the line's value, from the line with the least sum of squares of such
/// deviations, of three points or more.
fn largest_deviation(points: &[(f64, f64)]) -> Option<f64> {
    if points.len() < 3 {
        return None;
    }
    // Weights 1/y², by which the sums of squares are of shares.
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
