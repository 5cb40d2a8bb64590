//! Noise beyond that of the empty slide: how it goes with light, what of it is the same in all fields, how uneven light is.

use crate::number::{mean, quantile, single};
use crate::small::blur;

/// Side of the blocks that noise is compared in, pixels.
const BLOCK: usize = 8;

/// Absorbances that blocks are sorted by: empty slide first.
const BINS: [[f64; 2]; 4] = [[-0.03, 0.02], [0.05, 0.12], [0.12, 0.25], [0.25, 0.6]];

/// The most even part of the blocks of a bin shows noise, the rest structure.
const EVENEST: f64 = 0.15;

/// Fewest blocks of a bin.
const LEAST_BLOCKS: usize = 12;

/// Numbers of [`law`].
pub(crate) const LAW: usize = BINS.len() - 1;

/// Logarithm of the noise of ever darker places over that of the empty slide; NaN where there are none.
pub(crate) fn law(grey: &[f32], width: usize, empty: f64) -> [f64; LAW] {
    let mut bins: [Vec<f64>; BINS.len()] = Default::default();
    let height = grey.len() / width;
    for top in (0..height.saturating_sub(BLOCK - 1)).step_by(BLOCK) {
        for left in (0..width.saturating_sub(BLOCK - 1)).step_by(BLOCK) {
            let at = |x: usize, y: usize| f64::from(grey[(top + y) * width + left + x]);
            let sum: f64 = (0..BLOCK).flat_map(|y| (0..BLOCK).map(move |x| (x, y))).map(|(x, y)| at(x, y)).sum();
            let absorbance = -libm::log10((sum / (BLOCK * BLOCK) as f64 / empty).max(1e-3));
            let Some(bin) = BINS.iter().position(|[from, to]| absorbance >= *from && absorbance < *to) else { continue };
            // A mask that planes and saddles vanish under (Immerkær, doi:10.1006/cviu.1996.0060).
            let mut energy = 0.0;
            for y in 1..BLOCK - 1 {
                for x in 1..BLOCK - 1 {
                    let line = |y: usize| at(x - 1, y) - 2.0 * at(x, y) + at(x + 1, y);
                    let value = line(y - 1) - 2.0 * line(y) + line(y + 1);
                    energy += value * value;
                }
            }
            bins[bin].push(energy);
        }
    }
    let levels = bins.map(|mut blocks| if blocks.len() < LEAST_BLOCKS { f64::NAN } else { quantile(&mut blocks, EVENEST).max(1e-3) });
    std::array::from_fn(|i| libm::log(levels[i + 1] / levels[0]))
}

/// Widths of the Gaussians between which the light's unevenness is looked for, pixels.
const UNEVEN_PX: [f64; 2] = [6.0, 24.0];

/// Empty slide is within this absorbance after the wider of them.
const EVEN: f32 = 0.012;

/// Logarithm of the unevenness of empty slide between two scales; NaN where nothing is empty.
pub(crate) fn unevenness(grey: &[f32], width: usize, empty: f64) -> f64 {
    let light: Vec<f32> = grey.iter().map(|g| g / single(empty)).collect();
    let [fine, coarse] = UNEVEN_PX.map(|sigma| blur(&light, width, sigma));
    // Whatever lies there is darker than the slide: the paler half is the slide.
    let mut rests: Vec<f64> =
        fine.iter().zip(&coarse).filter(|(_, c)| **c > 1.0 - 2.0 * EVEN).map(|(f, c)| f64::from((f - c).abs())).collect();
    if rests.len() < grey.len() / 50 { f64::NAN } else { libm::log(quantile(&mut rests, 0.5).max(1e-6)) }
}

/// Width of the Gaussian whose remainder is noise, pixels.
const NOISE_PX: f64 = 3.0;

/// A pixel is empty slide if a Gaussian of that width is within this part of the light of the slide.
const NEAR: f32 = 0.03;

/// The noise of a field where its slide is empty, over its light there; NaN elsewhere.
pub(crate) fn relative_noise(grey: &[f32], width: usize, empty: f64) -> Vec<f32> {
    let smooth = blur(grey, width, NOISE_PX);
    let wide = blur(grey, width, 4.0 * NOISE_PX);
    let empty = single(empty);
    grey.iter()
        .zip(smooth.iter().zip(&wide))
        .map(|(g, (s, w))| if *s > (1.0 - NEAR) * empty && (s - w).abs() < 0.004 * empty { (g - s) / s } else { f32::NAN })
        .collect()
}

/// Fewest pixels that two fields have empty in common.
const LEAST_PIXELS: usize = 5000;

/// What the noise of fields has in common: the mean over pairs of its relative variance, and the standard error; none where
/// fewer than two fields are empty at the same places.
pub(crate) fn pattern(fields: &[Vec<f32>]) -> Option<[f64; 2]> {
    let mut products = Vec::new();
    for (i, a) in fields.iter().enumerate() {
        for b in &fields[i + 1..] {
            let (mut sum, mut count) = (0.0, 0);
            for (x, y) in a.iter().zip(b) {
                let product = f64::from(x * y);
                if product.is_finite() {
                    sum += product;
                    count += 1;
                }
            }
            if count >= LEAST_PIXELS {
                products.push(sum / count as f64);
            }
        }
    }
    let pairs = products.len();
    // Pairs share fields: as many are independent as there are fields.
    let sd = if pairs > 1 { crate::number::deviation(&products) } else { mean(&products).abs() };
    (pairs > 0).then(|| [mean(&products), sd / (fields.len().min(pairs) as f64).sqrt()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};

    fn noise(seed: u64, count: usize, sd: f32) -> Vec<f32> {
        let mut rng = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut one = || (rng.next_u64() >> 40) as f32 / (1_u64 << 24) as f32 - 0.5;
        (0..count).map(|_| sd * 12.0_f32.sqrt() * 0.5 * (one() + one() + one() + one())).collect()
    }

    #[test]
    fn what_fields_share_is_found() {
        let (width, height) = (200, 150);
        let shared = noise(1, width * height, 0.01);
        let field = |seed: u64| {
            let own = noise(seed, width * height, 2.0);
            let grey: Vec<f32> = shared.iter().zip(own).map(|(s, o)| 220.0 * (1.0 + s) + o).collect();
            relative_noise(&grey, width, 220.0)
        };
        let [variance, error] = pattern(&[field(2), field(3), field(4)]).unwrap();
        // Three pairs of 3·10⁴ pixels: 4·10⁻⁷ of error; the Gaussian takes a hundredth.
        assert!((variance - 1e-4).abs() < 4e-6, "{variance} {error}");
        assert_eq!(pattern(&[field(2)]), None);
    }

    #[test]
    fn photons_are_told_from_reading() {
        let (width, height) = (160, 160);
        let own = noise(5, width * height, 1.0);
        let light = |i: usize| if (i % width) < 80 { 220.0_f32 } else { 150.0 };
        let of = |sd: &dyn Fn(f32) -> f32| {
            let grey: Vec<f32> = own.iter().enumerate().map(|(i, n)| light(i) + n * sd(light(i))).collect();
            law(&grey, width, 220.0)[1]
        };
        let (reading, photons) = (of(&|_| 2.0), of(&|l| (l / 55.0).sqrt()));
        assert!(reading.abs() < 0.1 && (photons - libm::log(150.0 / 220.0)).abs() < 0.1, "{reading} {photons}");
    }
}
