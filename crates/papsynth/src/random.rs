//! The few samplers that a scene needs, with the same bits on every machine.

use rand_core::Rng;

/// Uniform in `[0, 1)` with 53 random bits.
pub(crate) fn uniform<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    /// 2⁻⁵³: one step of a 53-bit mantissa.
    const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
    (rng.next_u64() >> 11) as f64 * STEP
}

/// Uniform in `[low, high)`.
pub(crate) fn between<R: Rng + ?Sized>(low: f64, high: f64, rng: &mut R) -> f64 {
    low + (high - low) * uniform(rng)
}

/// Uniform integer in `0..count`; 0 when `count` is 0.
pub(crate) fn below<R: Rng + ?Sized>(count: usize, rng: &mut R) -> usize {
    let product = u128::from(rng.next_u64()) * count as u128;
    usize::try_from(product >> 64).unwrap_or(0)
}

/// Standard normal by Marsaglia's polar method (doi:10.1137/1006063).
pub(crate) fn normal<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    loop {
        let u = 2.0 * uniform(rng) - 1.0;
        let v = 2.0 * uniform(rng) - 1.0;
        let s = u * u + v * v;
        if s > 0.0 && s < 1.0 {
            return u * (-2.0 * libm::log(s) / s).sqrt();
        }
    }
}

/// True with the given probability.
pub(crate) fn chance<R: Rng + ?Sized>(probability: f64, rng: &mut R) -> bool {
    uniform(rng) < probability
}

/// A direction in radians, uniform on the circle.
pub(crate) fn direction<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    between(0.0, core::f64::consts::TAU, rng)
}

/// A number rounded to a count, at least 0.
pub(crate) fn count(value: f64) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the range of u32")]
    let count = libm::round(value).clamp(0.0, f64::from(u32::MAX)) as usize;
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;

    #[test]
    fn normals_have_mean_zero_and_variance_one() {
        let mut rng = Key { seed: 7, index: 0 }.stream("test", 0, "normal");
        let draws: Vec<f64> = (0..20_000).map(|_| normal(&mut rng)).collect();
        let mean = draws.iter().sum::<f64>() / draws.len() as f64;
        let variance = draws.iter().map(|x| x * x).sum::<f64>() / draws.len() as f64;
        let standard_error = 1.0 / (draws.len() as f64).sqrt();
        assert!(mean.abs() < 4.0 * standard_error, "{mean}");
        assert!((variance - 1.0).abs() < 4.0 * 2.0_f64.sqrt() * standard_error, "{variance}");
    }

    #[test]
    fn below_reaches_every_value_and_no_other() {
        let mut rng = Key { seed: 7, index: 0 }.stream("test", 0, "below");
        let mut seen = [0; 5];
        for _ in 0..1000 {
            seen[below(5, &mut rng)] += 1;
        }
        assert!(seen.iter().all(|&n| n > 100), "{seen:?}");
        assert_eq!(below(0, &mut rng), 0);
    }
}
