//! Measurements on the image of a nucleus.

use portable_numerics::rounding::round_to_count;

use crate::error::{ErrorKind, NucleusError};
use crate::model::{Donor, OUTSIDE};

/// A point in pixels: x right, y down.
pub type Point = [f64; 2];

/// The image of a nucleus, with its mask.
#[derive(Debug, Clone)]
pub struct NucleusImage {
    /// Name for messages, for example the file name.
    pub name: String,
    /// Transmitted light in any linear unit, row by row.
    pub light: Vec<f32>,
    /// 1 inside the nucleus, 0 outside.
    pub mask: Vec<f32>,
    /// Columns.
    pub width: usize,
}

/// Number of steps of the profile from rim to centre.
pub(super) const PROFILE_STEPS: usize = 5;

/// Measurements on the image of a nucleus.
#[derive(Debug, Clone)]
pub(super) struct NucleusMeasurement {
    pub(super) outline: Vec<Point>,
    pub(super) mean: f64,
    pub(super) sd: f64,
    pub(super) skewness: f64,
    /// Mean absorbance in steps from rim to centre.
    pub(super) profile: [f64; PROFILE_STEPS],
    /// Absorbance relative to the surroundings; NaN outside the nucleus.
    pub(super) absorbance: Vec<f64>,
    pub(super) width: usize,
}

impl NucleusImage {
    /// Measures absorbance inside the mask relative to the surroundings of the nucleus (Eq. 11): A = −log₁₀(I₁/I₀).
    pub(super) fn measure(&self) -> Result<NucleusMeasurement, ErrorKind> {
        self.measured().map_err(|cause| ErrorKind::Nucleus { name: self.name.clone(), cause })
    }

    fn measured(&self) -> Result<NucleusMeasurement, NucleusError> {
        /// Points of a traced outline.
        const POINTS: usize = 64;
        /// Distance from the outline at which the surroundings begin, beyond the blurred rim of the nucleus, px.
        const SURROUNDINGS_START: f64 = 2.5;
        /// Distance from the outline at which the surroundings end, px.
        const SURROUNDINGS_END: f64 = 9.0;
        /// Minimum number of pixels for a median.
        const MIN_PIXELS: usize = 12;
        /// Mean absorbance below which a nucleus is indistinguishable from noise.
        const MIN_MEAN: f64 = 0.01;
        if self.width == 0 || self.light.len() != self.mask.len() || !self.light.len().is_multiple_of(self.width) {
            return Err(NucleusError::Size { pixels: self.light.len(), mask: self.mask.len(), width: self.width });
        }
        if let Some(bad) = self.light.iter().position(|v| !v.is_finite() || *v < 0.0) {
            return Err(NucleusError::Pixel(bad % self.width, bad / self.width, self.light[bad]));
        }
        let outline = outline(&self.mask, self.width, POINTS).map_err(NucleusError::Mask)?;
        let distance = self.distances(&outline);
        let mut around: Vec<f64> = (0..self.light.len())
            .filter(|&i| self.mask[i] < 0.5 && (SURROUNDINGS_START..SURROUNDINGS_END).contains(&distance[i]))
            .map(|i| f64::from(self.light[i]))
            .collect();
        if around.len() < MIN_PIXELS {
            return Err(NucleusError::Crop(around.len(), MIN_PIXELS));
        }
        around.sort_by(f64::total_cmp);
        let surroundings = around[around.len() / 2];
        if surroundings <= 0.0 {
            return Err(NucleusError::Black);
        }
        // Eq. 11: A = −log₁₀(I₁/I₀) relative to the surroundings; black pixels count as 1/512 of these.
        let floor = surroundings / 512.0;
        let absorbance: Vec<f64> = (0..self.light.len())
            .map(|i| {
                let light = f64::from(self.light[i]).max(floor);
                if self.mask[i] >= 0.5 { -libm::log10(light / surroundings) } else { f64::NAN }
            })
            .collect();
        let inside: Vec<f64> = absorbance.iter().copied().filter(|a| !a.is_nan()).collect();
        let count = inside.len() as f64;
        if inside.len() < MIN_PIXELS {
            return Err(NucleusError::SmallMask(inside.len(), MIN_PIXELS));
        }
        let mean = inside.iter().sum::<f64>() / count;
        if mean < MIN_MEAN {
            return Err(NucleusError::Faint(mean, MIN_MEAN));
        }
        let moment = |power: i32| inside.iter().map(|a| libm::pow(a - mean, f64::from(power))).sum::<f64>() / count;
        let sd = moment(2).sqrt();
        let skewness = if sd > 0.0 { moment(3) / (sd * sd * sd) } else { 0.0 };
        let profile = profile(&absorbance, &distance, mean);
        Ok(NucleusMeasurement { outline, mean, sd, skewness, profile, absorbance, width: self.width })
    }

    /// Returns the distance of every pixel from the outline.
    fn distances(&self, outline: &[Point]) -> Vec<f64> {
        (0..self.light.len())
            .map(|i| {
                let (x, y) = ((i % self.width) as f64, (i / self.width) as f64);
                let square = outline.iter().map(|p| (p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y));
                square.fold(f64::INFINITY, f64::min).sqrt()
            })
            .collect()
    }
}

/// Returns the outline of a mask as points at equal distances along it.
pub(super) fn outline(mask: &[f32], width: usize, points: usize) -> Result<Vec<Point>, fsd_shape::Error> {
    Ok(fsd_shape::resample(&fsd_shape::trace(mask, width, crate::truth::COVERED)?, points))
}

/// Returns the mean absorbance in steps of the distance from the rim; the overall mean for steps without pixels.
fn profile(absorbance: &[f64], distance: &[f64], mean: f64) -> [f64; PROFILE_STEPS] {
    let inside = || absorbance.iter().zip(distance).filter(|(a, _)| !a.is_nan());
    let deepest = inside().fold(1.0_f64, |most, (_, d)| most.max(*d));
    let mut sums = [[0.0; 2]; PROFILE_STEPS];
    for (a, d) in inside() {
        let step = round_to_count((d / deepest * PROFILE_STEPS as f64).floor()).min(PROFILE_STEPS - 1);
        sums[step][0] += a;
        sums[step][1] += 1.0;
    }
    sums.map(|[sum, count]| if count > 0.0 { sum / count } else { mean })
}

/// Returns the mean profile, relative to the mean absorbance.
pub(super) fn mean_profile(measured: &[NucleusMeasurement]) -> Vec<f64> {
    let mean: f64 = measured.iter().map(|m| m.mean).sum();
    (0..PROFILE_STEPS)
        .map(|step| measured.iter().map(|m| m.profile[step]).sum::<f64>() / mean.max(1e-9))
        .map(|v| v.max(0.0))
        .collect()
}

impl NucleusMeasurement {
    /// Returns the texture as a donor.
    pub(super) fn donor(&self, pixel_um: f64) -> Donor {
        let milli = |a: &f64| {
            #[expect(clippy::cast_possible_truncation, reason = "clamped to the range of i16")]
            let value = libm::round(a * 1000.0).clamp(-32_767.0, 32_767.0) as i16;
            if a.is_nan() { OUTSIDE } else { value }
        };
        Donor { pixel_um, width: self.width, absorbance_milli: self.absorbance.iter().map(milli).collect() }
    }
}
