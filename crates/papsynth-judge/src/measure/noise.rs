//! Noise and its correlation between pixels.

use crate::background::Surface;

/// Size of the blocks in which noise is measured, pixels.
pub(crate) const BLOCK: usize = 32;

/// Noise of a block after subtraction of a quadratic surface, or the mean over blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Noise {
    /// Variance, squared grey levels of 255.
    pub(crate) variance: f64,
    /// Covariances at [`LAGS`](Self::LAGS).
    pub(crate) products: [f64; 5],
}

/// Returns the upper left corners of the blocks in a part of an image.
pub(crate) fn blocks([left, top]: [usize; 2], [wide, high]: [usize; 2]) -> impl Iterator<Item = [usize; 2]> {
    let along = |from: usize, length: usize| (from..(from + length).saturating_sub(BLOCK - 1)).step_by(BLOCK);
    along(top, high).flat_map(move |y| along(left, wide).map(move |x| [x, y]))
}

impl Noise {
    /// Lags: name, horizontal and vertical step.
    pub(crate) const LAGS: [(&'static str, [usize; 2]); 5] =
        [("1 across", [1, 0]), ("1 down", [0, 1]), ("1 diagonally", [1, 1]), ("2 across", [2, 0]), ("2 down", [0, 2])];

    /// Terms of the subtracted surface.
    const TERMS: f64 = 6.0;

    pub(crate) fn of(grey: &[f32], width: usize, [left, top]: [usize; 2]) -> Self {
        let place = |i: usize| 2.0 * (i as f64 + 0.5) / BLOCK as f64 - 1.0;
        let cells = || (0..BLOCK).flat_map(|y| (0..BLOCK).map(move |x| (x, y)));
        let value = |x: usize, y: usize| f64::from(grey[(top + y) * width + left + x]);
        let points: Vec<([f64; 2], f64)> = cells().map(|(x, y)| ([place(x), place(y)], value(x, y))).collect();
        let surface = Surface::fit(&points, 0.0);
        let rests: Vec<f64> = points.iter().map(|(p, v)| v - surface.at(*p)).collect();
        let n = rests.len() as f64;
        let product = |(_, [dx, dy]): (&str, [usize; 2])| {
            let pairs = cells().filter(|(x, y)| x + dx < BLOCK && y + dy < BLOCK);
            let products = pairs.map(|(x, y)| rests[y * BLOCK + x] * rests[(y + dy) * BLOCK + x + dx]);
            products.sum::<f64>() / ((BLOCK - dx) * (BLOCK - dy)) as f64
        };
        Self {
            variance: rests.iter().map(|r| r * r).sum::<f64>() / (n - Self::TERMS),
            products: Self::LAGS.map(product),
        }
    }

    /// Returns the mean over blocks without the noisiest fifth, which may contain objects. None for no blocks.
    pub(crate) fn mean(blocks: &mut Vec<Self>) -> Option<Self> {
        blocks.sort_by(|a, b| a.variance.total_cmp(&b.variance));
        blocks.truncate((blocks.len() * 4).div_ceil(5));
        let n = blocks.len() as f64;
        let mean = |f: &dyn Fn(&Self) -> f64| blocks.iter().map(f).sum::<f64>() / n;
        (n > 0.0).then(|| Self {
            variance: mean(&|b| b.variance),
            products: std::array::from_fn(|i| mean(&|b| b.products[i])),
        })
    }

    /// Returns the correlation at a lag. The subtracted surface reduces it by up to 6/32² = 0.006.
    pub(crate) fn correlation(&self, lag: usize) -> f64 {
        self.products[lag] / self.variance.max(1e-6)
    }
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use portable_numerics::random::below;

    #[test]
    fn variance_and_correlation_of_noise_are_measured() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
        let (width, height) = (256, 256);
        // Uniform over ±3: variance 3.
        let white: Vec<f64> = (0..width * height).map(|_| below(600_001, &mut rng) as f64 / 1e5 - 3.0).collect();
        let measured = |of: &dyn Fn(usize, usize) -> f64| {
            let grey: Vec<f32> = (0..width * height)
                .map(|i| crate::number::single(200.0 + 0.01 * (i % width) as f64 + of(i % width, i / width)))
                .collect();
            let mut blocks: Vec<Noise> =
                blocks([0, 0], [width, height]).map(|at| Noise::of(&grey, width, at)).collect();
            Noise::mean(&mut blocks).unwrap()
        };
        let plain = measured(&|x, y| white[y * width + x]);
        // Exclusion of the noisiest fifth reduces the variance of blocks of 1024 pixels by 1 %.
        assert!((plain.variance - 3.0).abs() < 0.1, "{plain:?}");
        assert!((0..5).all(|lag| plain.correlation(lag).abs() < 0.015), "{plain:?}");
        // Plus half of the pixel below: vertical correlation 0.5/1.25 = 0.4, no horizontal one.
        let smeared = measured(&|x, y| white[y * width + x] + 0.5 * white[((y + 1) % height) * width + x]);
        assert!((smeared.variance - 3.75).abs() < 0.15, "{smeared:?}");
        let wanted = [0.0, 0.4, 0.0, 0.0, 0.0];
        assert!((0..5).all(|lag| (smeared.correlation(lag) - wanted[lag]).abs() < 0.02), "{smeared:?}");
        assert!(Noise::mean(&mut Vec::new()).is_none());
    }
}
