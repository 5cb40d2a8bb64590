use num_complex::Complex64;
use portable_numerics::fourier::{ComplexPlane, PlaneScratch};

use crate::scan::{Candidates, Template};
use crate::source::LANES;
use crate::{QuiltParams, Source};

/// Compares a template with all positions of one source by Fourier transforms:
/// Σ m (s - t)² = Σ m t² - 2 (s ⋆ m t) + (s² ⋆ m), where ⋆ is a correlation.
#[derive(Debug, Clone)]
pub(crate) struct Spectral {
    /// Size of the transform: that of the source, rounded up.
    grid: [usize; 2],
    /// Mean of the source, subtracted from source and template to reduce cancellation errors.
    mean: f64,
    /// Transforms of s and s², column-major.
    plain: Vec<Complex64>,
    squared: Vec<Complex64>,
    plan: ComplexPlane<f64, 8>,
}

impl Spectral {
    /// Estimates whether Fourier transforms are faster than the scan for a source. The scan computes one difference for
    /// each candidate and overlap pixel, the transforms log N steps for each of N grid pixels.
    pub(crate) fn is_faster(source: &Source, candidates: &Candidates, params: &QuiltParams) -> bool {
        /// Measured on one core of a Zen 4 machine; only their ratio matters.
        const DIFFERENCE_NS: f64 = 0.035;
        const STEP_NS: f64 = 1.0;
        let overlaps = params.overlap_px * (2 * params.patch_px - params.overlap_px);
        let pixels: usize = Self::grid(source).iter().product();
        #[expect(clippy::cast_precision_loss, reason = "an estimate")]
        {
            let scan = DIFFERENCE_NS * (candidates.slots * overlaps) as f64;
            scan > STEP_NS * pixels as f64 * f64::from(pixels.ilog2() + 1)
        }
    }

    pub(crate) fn new(source: &Source) -> Self {
        let grid = Self::grid(source);
        let known = || (0..).zip(&source.known).filter(|&(_, &known)| known).map(|(i, _): (usize, _)| i);
        let [x, y] = [|i: usize, w: usize| i % w, |i: usize, w: usize| i / w];
        let value = |i| {
            let place = y(i, source.width) * source.stride() + x(i, source.width);
            f64::from(source.pixels[place])
        };
        #[expect(clippy::cast_precision_loss, reason = "far below 2^53 pixels")]
        let mean = known().map(value).sum::<f64>() / source.count as f64;
        let mut spectral =
            Self { grid, mean, plain: Vec::new(), squared: Vec::new(), plan: ComplexPlane::new(grid[0], grid[1]) };
        let transform = |of: &dyn Fn(f64) -> f64| {
            let mut image = vec![Complex64::ZERO; grid[0] * grid[1]];
            for i in known() {
                image[y(i, source.width) * grid[0] + x(i, source.width)].re = of(value(i) - mean);
            }
            spectral.forward(&image, &mut PlaneScratch::default())
        };
        let (plain, squared) = (transform(&|v| v), transform(&|v| v * v));
        spectral.plain = plain;
        spectral.squared = squared;
        spectral
    }

    /// Returns the size of the transform of a source.
    pub(crate) fn grid(source: &Source) -> [usize; 2] {
        [source.width, source.height].map(fast_length)
    }

    /// Writes the same costs as [`scan`](crate::scan::scan), without early rejection.
    pub(crate) fn costs(
        &self,
        source: &Source,
        candidates: &Candidates,
        patch: usize,
        template: &Template,
        least: &mut f32,
        costs: &mut [f32],
    ) {
        let squares = self.squares(template);
        let stride = source.stride();
        let centre = (patch / 2) * (stride + 1);
        costs.fill(f32::INFINITY);
        for run in &candidates.runs {
            for (i, cost) in costs[run.slot..][..run.blocks * LANES].iter_mut().enumerate() {
                let place = run.place + i;
                if candidates.barrier[place] > 0.0 {
                    continue;
                }
                let away = source.centrality[place + centre] - template.centrality;
                let sum = squares[place / stride * self.grid[0] + place % stride].max(0.0);
                #[expect(clippy::cast_possible_truncation, reason = "costs are single precision")]
                {
                    *cost = template.weight * (away * away) + sum as f32;
                }
                *least = least.min(*cost);
            }
        }
    }

    /// Returns Σ m (s - t)² with the upper left corner of the template at each pixel of the grid.
    fn squares(&self, template: &Template) -> Vec<f64> {
        let [width, height] = self.grid;
        let mut constant = 0.0;
        // m t and m are real, so one complex transform computes both.
        let mut image = vec![Complex64::ZERO; width * height];
        for &([x, y], v) in &template.pixels {
            let t = f64::from(v) - self.mean;
            image[y * width + x] = Complex64::new(t, 1.0);
            constant += t * t;
        }
        let mut scratch = PlaneScratch::default();
        let both = self.forward(&image, &mut scratch);
        let mut product = vec![Complex64::ZERO; width * height];
        for kx in 0..width {
            for ky in 0..height {
                let k = kx * height + ky;
                let z = both[k];
                let mirrored = both[(width - kx) % width * height + (height - ky) % height].conj();
                let values = 0.5 * (z + mirrored);
                let mask = Complex64::new(0.0, -0.5) * (z - mirrored);
                product[k] = self.squared[k] * mask.conj() - 2.0 * self.plain[k] * values.conj();
            }
        }
        #[expect(clippy::cast_precision_loss, reason = "far below 2^53 pixels")]
        let scale = 1.0 / (width * height) as f64;
        self.plan.inverse(&product, |_| false, &mut image, &mut scratch);
        image.iter().map(|z| constant + scale * z.re).collect()
    }

    fn forward(&self, image: &[Complex64], scratch: &mut PlaneScratch<f64, 8>) -> Vec<Complex64> {
        let mut spectrum = vec![Complex64::ZERO; image.len()];
        self.plan.forward(image, &mut spectrum, scratch);
        spectrum
    }
}

/// Returns the next length of the form 2^a 3^b.
fn fast_length(least: usize) -> usize {
    let mut best = least.next_power_of_two();
    let mut threes = 3;
    while threes < best {
        best = best.min(threes * least.div_ceil(threes).next_power_of_two());
        threes *= 3;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::tests::{disc, reference_cost, template};
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    const SEED: u64 = 0xff7;

    #[test]
    fn costs_equal_brute_force() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        for (width, height, patch, overlap) in [(50, 34, 8, 3), (40, 40, 7, 2), (61, 23, 9, 3), (7, 7, 3, 1)] {
            let source = disc(width, height, &mut rng);
            let candidates = Candidates::new(&source, patch);
            let template = template(patch, overlap, &mut rng);
            let mut costs = vec![f32::NAN; candidates.slots];
            let mut least = f32::INFINITY;
            Spectral::new(&source).costs(&source, &candidates, patch, &template, &mut least, &mut costs);
            assert_eq!(least, costs.iter().copied().fold(f32::INFINITY, f32::min));
            for (slot, &cost) in costs.iter().enumerate() {
                let place = candidates.place_of_slot(slot);
                if candidates.barrier[place] > 0.0 {
                    assert_eq!(cost, f32::INFINITY);
                } else {
                    let reference = reference_cost(&source, patch, &template, place);
                    // Rounded to single precision.
                    assert!((f64::from(cost) / reference - 1.0).abs() < 2e-7);
                }
            }
        }
    }
}
