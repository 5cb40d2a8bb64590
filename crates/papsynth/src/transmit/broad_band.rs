//! Absorption of a broad band of light.
//!
//! Dyes absorb some of its wavelengths more than others. After the first objects, light of the other wavelengths is
//! left, so that later objects absorb less of it than alone. If the absorption coefficients have a gamma distribution
//! over the wavelengths, with mean 1 and coefficient of variation v, the Laplace transform of the distribution is the
//! transmitted fraction: T = (1 + v²A)^(−1/v²), where A is the sum of the absorbances, with natural logarithms.

use multiversion::multiversion;
use portable_numerics::elementary::{exp_f32, ln_f32};

/// Light of many wavelengths, which stains absorb differently.
#[derive(Debug, Clone, Copy)]
pub(super) struct BroadBand {
    /// Square of the coefficient of variation of the absorption.
    variance: f32,
}

impl BroadBand {
    /// Returns `None` for light of one wavelength.
    pub(super) fn new(absorption_variation: f64) -> Option<Self> {
        (absorption_variation > 0.0).then_some(Self { variance: (absorption_variation * absorption_variation) as f32 })
    }

    /// Converts fractions that light of one wavelength would transmit, with the mean absorption.
    pub(super) fn convert(self, transmitted: &mut [f32]) {
        convert(transmitted, self.variance);
    }

    /// Returns the absorbance of an object behind and before others, which together transmit this fraction in light of
    /// one wavelength. There it would have `absorbance`.
    pub(super) fn absorbance(self, absorbance: f64, transmitted: f64) -> f64 {
        let light = |transmitted: f64| f64::from(one(transmitted as f32, self.variance));
        libm::log10(light(transmitted * libm::exp10(absorbance)) / light(transmitted))
    }
}

#[multiversion(targets = "simd")]
fn convert(transmitted: &mut [f32], variance: f32) {
    transmitted.iter_mut().for_each(|transmitted| *transmitted = one(*transmitted, variance));
}

#[inline(always)]
fn one(transmitted: f32, variance: f32) -> f32 {
    let absorbance = -ln_f32(transmitted.max(f32::MIN_POSITIVE));
    let sum = 1.0 + variance * absorbance;
    // ln(1 + x)/x without the rounding error of the sum.
    let ratio = if sum == 1.0 { 1.0 } else { ln_f32(sum) / (sum - 1.0) };
    // Interference can make light brighter than on the empty slide.
    if absorbance > 0.0 { exp_f32(-absorbance * ratio) } else { transmitted }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_light_is_the_mean_over_wavelengths_with_gamma_distributed_absorption() {
        for variation in [0.02_f64, 0.3, 0.7, 1.0] {
            let band = BroadBand::new(variation).unwrap();
            // Midpoint rule over the gamma density, which has no pole at 0 for variations up to 1.
            let shape = 1.0 / (variation * variation);
            let mean_of = |f: &dyn Fn(f64) -> f64| {
                let (n, most) = (200_000, 1.0 + 12.0 * variation + 18.0 * variation * variation);
                let [mut sum, mut weights] = [0.0; 2];
                for i in 0..n {
                    let k = most * (f64::from(i) + 0.5) / f64::from(n);
                    let weight = libm::exp((shape - 1.0) * libm::log(k) - shape * (k - 1.0));
                    sum += weight * f(k);
                    weights += weight;
                }
                sum / weights
            };
            for absorbance in [0.0, 1e-3, 0.1, 0.8, 2.0, 5.0] {
                let mut light = [libm::exp(-absorbance) as f32];
                band.convert(&mut light);
                let expected = mean_of(&|k| libm::exp(-k * absorbance));
                let error = (f64::from(light[0]) / expected - 1.0).abs();
                assert!(error < 3e-6, "{variation} {absorbance}: {} {expected}", light[0]);
            }
        }
    }

    #[test]
    fn brighter_light_stays_and_darkness_is_finite() {
        let mut light = [1.0, 1.2, 0.0, -0.1];
        BroadBand::new(0.5).unwrap().convert(&mut light);
        assert_eq!(&light[..2], [1.0, 1.2]);
        assert!(light[2..].iter().all(|light| (0.0..1e-4).contains(light)), "{light:?}");
        assert!(BroadBand::new(0.0).is_none());
    }

    #[test]
    fn an_object_absorbs_less_where_others_absorb() {
        let band = BroadBand::new(0.7).unwrap();
        let alone = band.absorbance(0.2, libm::exp10(-0.2));
        let behind = band.absorbance(0.2, libm::exp10(-1.0));
        // d ln(1 + v²A)/v² is about 1/(1 + v²A).
        assert!((0.16..0.2).contains(&alone) && (0.08..0.11).contains(&behind), "{alone} {behind}");
    }
}
