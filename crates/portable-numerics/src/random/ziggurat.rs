use rand_core::Rng;

const LAYERS: usize = 256;

/// Right end of the base layer, where the tail begins, for 256 layers.
const TAIL: f64 = 3.654_152_885_361_009;

/// Area of each layer; that of the base includes the tail.
const AREA: f64 = 0.004_928_673_233_974_655;

/// Standard normal deviates in single precision by Marsaglia and Tsang's ziggurat (doi:10.18637/jss.v005.i08).
///
/// Layer, sign and position come from disjoint bits of one word, which removes the correlation
/// Doornik found in the original.
#[derive(Debug, Clone)]
pub struct Ziggurat {
    /// Right ends of the layers from the base (a virtual end that includes the tail) up to 0.
    end: [f32; LAYERS + 1],
    /// exp(-x²/2) at those ends; at the base, the density at `TAIL`.
    density: [f32; LAYERS + 1],
}

impl Default for Ziggurat {
    fn default() -> Self {
        Self::new()
    }
}

impl Ziggurat {
    /// Computes the tables, for any number of draws.
    #[must_use]
    pub fn new() -> Self {
        let density_at = |x: f64| libm::exp(-0.5 * x * x);
        let mut end = [0.0; LAYERS + 1];
        let mut density = [1.0; LAYERS + 1];
        let mut x = TAIL;
        (end[0], density[0]) = (single(AREA / density_at(TAIL)), single(density_at(TAIL)));
        for layer in 1..LAYERS {
            (end[layer], density[layer]) = (single(x), single(density_at(x)));
            let top = (AREA / x + density_at(x)).min(1.0);
            x = (-2.0 * libm::log(top)).sqrt();
        }
        Self { end, density }
    }

    /// Returns two deviates, nearly always from one word of the generator.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "the two halves of a word")]
    pub fn pair<R: Rng + ?Sized>(&self, rng: &mut R) -> [f32; 2] {
        let word = rng.next_u64();
        [self.deviate(word as u32, rng), self.deviate((word >> 32) as u32, rng)]
    }

    #[inline]
    fn deviate<R: Rng + ?Sized>(&self, bits: u32, rng: &mut R) -> f32 {
        let layer = (bits & 0xff) as usize;
        let x = position(bits) * self.end[layer];
        if x < self.end[layer + 1] {
            return with_sign(x, bits);
        }
        self.edge(bits, rng)
    }

    /// Handles the 1.5 % of draws outside the part of a layer that is entirely under the curve.
    #[cold]
    #[inline(never)]
    fn edge<R: Rng + ?Sized>(&self, bits: u32, rng: &mut R) -> f32 {
        let layer = (bits & 0xff) as usize;
        if layer == 0 {
            return with_sign(tail(rng), bits);
        }
        let x = position(bits) * self.end[layer];
        let (low, high) = (self.density[layer], self.density[layer + 1]);
        let y = low + (high - low) * position(rng.next_u32());
        if y < libm::expf(-0.5 * x * x) {
            return with_sign(x, bits);
        }
        let bits = rng.next_u32();
        self.deviate(bits, rng)
    }
}

/// Returns a uniform deviate strictly between 0 and 1 from the upper 23 bits.
#[inline]
fn position(bits: u32) -> f32 {
    const STEP: f32 = 1.0 / (1 << 23) as f32;
    ((bits >> 9) as f32 + 0.5) * STEP
}

/// Returns `x` with the sign of bit 8, which neither layer nor position uses.
#[inline]
fn with_sign(x: f32, bits: u32) -> f32 {
    f32::from_bits(x.to_bits() | ((bits & 0x100) << 23))
}

#[expect(clippy::cast_possible_truncation, reason = "tables and deviates are single precision")]
fn single(value: f64) -> f32 {
    value as f32
}

/// Returns a deviate beyond `TAIL` (Marsaglia 1964).
fn tail<R: Rng + ?Sized>(rng: &mut R) -> f32 {
    loop {
        let x = -libm::log(f64::from(position(rng.next_u32()))) / TAIL;
        let y = -libm::log(f64::from(position(rng.next_u32())));
        if 2.0 * y > x * x {
            return single(TAIL + x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::assert_normal;
    use super::*;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    const SEED: u64 = 0x51_6617;

    fn sample(n: usize) -> Vec<f64> {
        let ziggurat = Ziggurat::new();
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        (0..n / 2).flat_map(|_| ziggurat.pair(&mut rng)).map(f64::from).collect()
    }

    #[test]
    fn the_top_layer_ends_at_zero() {
        let ziggurat = Ziggurat::new();
        assert_eq!(ziggurat.end[LAYERS], 0.0);
        let top = f64::from(ziggurat.end[LAYERS - 1]);
        let area = top * (1.0 - libm::exp(-0.5 * top * top));
        assert!((area / AREA - 1.0).abs() < 1e-5, "{area}");
    }

    #[test]
    fn moments_are_normal() {
        assert_normal(&sample(4_000_000));
    }

    #[test]
    fn distribution_is_normal() {
        let n = 1_000_000;
        let mut deviates = sample(n);
        deviates.sort_by(f64::total_cmp);
        let cdf = |x: f64| 0.5 * libm::erfc(-x / core::f64::consts::SQRT_2);
        let distance =
            deviates.iter().enumerate().map(|(i, &x)| (cdf(x) - (i as f64 + 0.5) / n as f64).abs()).fold(0.0, f64::max);
        // Kolmogorov-Smirnov, 0.1 % level: 1.95 / √n.
        assert!(distance < 1.95 / (n as f64).sqrt(), "{distance}");
        let tail = deviates.iter().filter(|x| x.abs() > TAIL).count() as f64;
        let expected = 2.0 * cdf(-TAIL) * n as f64;
        assert!((tail - expected).abs() < 4.0 * expected.sqrt(), "{tail} of {expected}");
    }

    #[test]
    fn neighbours_are_independent() {
        let deviates = sample(1_000_000);
        let covariance = deviates.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / 1e6;
        assert!(covariance.abs() < 4e-3, "{covariance}");
    }
}
