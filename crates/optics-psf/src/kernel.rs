/// Largest sum of the taps omitted: half a unit in the last place of a single-precision 1.
pub(crate) const LOST_TAIL: f64 = 1e-7;

/// Largest radius for which taps follow from their neighbours; rounding errors accumulate beyond.
const FEW_TAPS: usize = 64;

/// Relative Newton step after which the next step, its square, is below rounding.
const SETTLED: f64 = 1e-9;

/// σ from which the kernel equals the sampled normal density.
const DENSITY_FROM: f64 = 1.0;

/// The discrete normal distribution of exact variance: wₙ ∝ exp(-t n²). It has the greatest entropy of all
/// distributions on the lattice with this variance.
///
/// t is solved for ∑ n² wₙ = σ² over the truncated taps.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Kernel {
    /// Weights w₀, w₁ … w_radius; w₋ₙ = wₙ.
    pub(crate) taps: Vec<f64>,
    /// Weights in single precision. The centre absorbs the rounding errors of the others, which preserves constants to
    /// the last bits.
    pub(crate) half: Vec<f32>,
}

impl Kernel {
    /// Creates a kernel of `sigma`, finite and >= 0. Its taps omit less than `lost_tail` of the sum.
    pub(crate) fn new(sigma: f64, lost_tail: f64) -> Self {
        let variance = sigma * sigma;
        // For smaller variances, the side taps underflow in double precision.
        if variance < f64::MIN_POSITIVE {
            return Self::from_taps(vec![1.0]);
        }
        let wide = ample_radius(sigma);
        // s = σ within 1e-8 is accurate enough for the radius.
        let t = if sigma > DENSITY_FROM { 0.5 / variance } else { exponent(variance, wide) };
        let radius = radius_of(&normalised(t, wide), lost_tail);
        Self::from_taps(normalised(exponent(variance, radius), radius))
    }

    /// Creates a kernel wider than a pixel with the given fourth cumulant: an Edgeworth series of one term, wₙ ∝ exp(-t
    /// n²) (1 + κ₄/24s⁴ · He₄(n/s)). Its variance is exact as well.
    pub(crate) fn with_fourth_cumulant(sigma: f64, fourth_cumulant: f64, lost_tail: f64) -> Self {
        let variance = sigma * sigma;
        let radius = radius_of(&normalised(0.5 / variance, ample_radius(sigma)), lost_tail);
        let excess = fourth_cumulant / (24.0 * variance * variance);
        let mut taps = Vec::with_capacity(radius + 1);
        let (mut t, mut mass) = (0.5 / variance, 0.0);
        // Converges in a few steps; the limit bounds the loop.
        for _ in 0..50 {
            taps.clear();
            mass = 0.0;
            let mut second = 0.0;
            each(t, radius, |n, w| {
                let square = n * n / variance;
                let tap = w * (1.0 + excess * ((square - 6.0) * square + 3.0));
                taps.push(tap);
                mass += if n > 0.0 { 2.0 * tap } else { tap };
                second += 2.0 * n * n * tap;
            });
            let ratio = second / (mass * variance);
            // The variance falls nearly as 1/t.
            t *= ratio;
            if (ratio - 1.0).abs() < SETTLED {
                break;
            }
        }
        taps.iter_mut().for_each(|tap| *tap /= mass);
        Self::from_taps(taps)
    }

    #[expect(clippy::cast_possible_truncation, reason = "convolution uses single precision")]
    fn from_taps(taps: Vec<f64>) -> Self {
        let mut half: Vec<f32> = taps.iter().map(|&w| w as f32).collect();
        let sides: f64 = half[1..].iter().map(|&w| 2.0 * f64::from(w)).sum();
        half[0] = (1.0 - sides) as f32;
        Self { taps, half }
    }

    pub(crate) fn radius(&self) -> usize {
        self.taps.len() - 1
    }
}

/// Returns a radius with a tail far below `LOST_TAIL`: eight standard deviations, plus two for narrow kernels.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "positive and, with the accepted widths, small"
)]
fn ample_radius(sigma: f64) -> usize {
    2 + (8.0 * sigma).ceil() as usize
}

/// Returns the smallest radius, at least 1, beyond which the taps sum to less than `lost_tail`.
fn radius_of(taps: &[f64], lost_tail: f64) -> usize {
    let mut tail = 0.0;
    let mut radius = taps.len() - 1;
    while radius > 1 && tail + 2.0 * taps[radius] < lost_tail {
        tail += 2.0 * taps[radius];
        radius -= 1;
    }
    radius
}

fn normalised(t: f64, radius: usize) -> Vec<f64> {
    let mut taps = Vec::with_capacity(radius + 1);
    each(t, radius, |_, tap| taps.push(tap));
    let sum = 1.0 + 2.0 * taps[1..].iter().rev().sum::<f64>();
    taps.iter_mut().for_each(|w| *w /= sum);
    taps
}

/// Calls `visit` with n and exp(-t n²), for n from 0 to `radius`.
#[inline]
fn each(t: f64, radius: usize, mut visit: impl FnMut(f64, f64)) {
    if radius > FEW_TAPS {
        (0..=radius).map(|n| n as f64).for_each(|n| visit(n, libm::exp(-t * n * n)));
        return;
    }
    // The ratios of neighbours, exp(-t (2n + 1)), form a geometric series.
    let mut ratio = libm::exp(-t);
    let (mut tap, step) = (1.0, ratio * ratio);
    for n in 0..=radius {
        visit(n as f64, tap);
        tap *= ratio;
        ratio *= step;
    }
}

/// Returns the t for which the taps up to `radius` have this variance, by Newton's method on its logarithm.
fn exponent(variance: f64, radius: usize) -> f64 {
    // Initial values: t = 1/(2σ²) for a wide kernel; w₁ = exp(-t) = σ²/2 for a narrow one.
    let mut t = if variance > 0.36 { 0.5 / variance } else { libm::log(2.0 / variance) };
    // Converges in two to five steps; the limit bounds the loop.
    for _ in 0..50 {
        let (mut mass, mut second, mut fourth) = (1.0, 0.0, 0.0);
        each(t, radius, |n, w| {
            let square = n * n;
            mass += if n > 0.0 { 2.0 * w } else { 0.0 };
            second += 2.0 * square * w;
            fourth += 2.0 * square * square * w;
        });
        second /= mass;
        fourth /= mass;
        // d ln(variance) / dt = -(m₄ - m₂²) / m₂
        let step = libm::log(second / variance) * second / (fourth - second * second);
        t += step;
        if step.abs() <= SETTLED * t {
            break;
        }
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kernel(sigma: f64) -> Kernel {
        Kernel::new(sigma, LOST_TAIL)
    }

    fn variance(kernel: &Kernel) -> f64 {
        let side = |(n, w): (usize, &f64)| 2.0 * (n * n) as f64 * w;
        kernel.taps.iter().enumerate().rev().map(side).sum()
    }

    fn widths() -> impl Iterator<Item = f64> {
        (0..600).map(|i| 1e-6 * libm::exp(0.03 * f64::from(i))).filter(|s| *s < 300.0)
    }

    #[test]
    fn variance_is_exact_and_taps_are_positive_decreasing_and_normalised() {
        for sigma in [0.05, 0.2, 0.5, 0.6, 0.9, 1.0, 3.6, 20.0, 300.0].into_iter().chain(widths()) {
            let kernel = kernel(sigma);
            let error = variance(&kernel) / (sigma * sigma) - 1.0;
            assert!(error.abs() < 1e-12, "sigma {sigma}: {error}");
            let taps = &kernel.taps;
            assert!(taps.iter().all(|&w| w > 0.0));
            assert!(taps.windows(2).all(|w| w[0] > w[1]));
            let sum = taps[0] + 2.0 * taps[1..].iter().sum::<f64>();
            assert!((sum - 1.0).abs() < 1e-14, "sigma {sigma}: {sum}");
            let single: f64 = kernel.half.iter().skip(1).map(|&w| 2.0 * f64::from(w)).sum();
            assert!((single + f64::from(kernel.half[0]) - 1.0).abs() < 3.1e-8);
        }
        assert_eq!([0.0, 1e-200].map(|sigma| kernel(sigma).taps), [[1.0], [1.0]]);
    }

    #[test]
    fn wide_kernels_match_the_sampled_normal_density() {
        for sigma in [1.0, 1.5, 3.6, 20.0_f64] {
            let ratio = (0.5 / exponent(sigma * sigma, ample_radius(sigma))).sqrt() / sigma;
            let bound = if sigma > 1.0 { 1e-8 } else { 1.1e-7 };
            assert!((ratio - 1.0).abs() < bound, "sigma {sigma}: {ratio}");
            for (n, w) in kernel(sigma).taps.iter().enumerate() {
                let z = n as f64 / sigma;
                let density = 0.398_942_280_401_432_7 / sigma * libm::exp(-0.5 * z * z);
                assert!((w - density).abs() < 1e-6 / sigma, "sigma {sigma}, tap {n}");
            }
        }
    }

    #[test]
    fn kernel_is_continuous_in_sigma() {
        // Each tap changes by less than σ does, from in focus to far out of focus.
        let mut before = kernel(0.0);
        for i in 1..4000 {
            let now = kernel(0.002 * f64::from(i));
            for n in 0..=now.radius() {
                let tap = |k: &Kernel| k.taps.get(n).copied().unwrap_or(0.0);
                let moved = (tap(&now) - tap(&before)).abs();
                assert!(moved < 0.002, "sigma {}: tap {n} by {moved}", 0.002 * f64::from(i));
            }
            before = now;
        }
    }
}
