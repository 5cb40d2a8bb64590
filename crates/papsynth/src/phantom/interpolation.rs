//! Interpolation of tiles to finer grids.

use multiversion::multiversion;

use super::tile::Tile;

impl Tile {
    /// Returns the tile on a grid `n` times as fine, by Catmull–Rom interpolation clipped at 0. Pixels outside are 0.
    pub(crate) fn refined(self, n: usize) -> Self {
        match n {
            1 => self,
            2 => self.refined_by::<2>(),
            3 => self.refined_by::<3>(),
            _ => self.refined_by::<4>(),
        }
    }

    fn refined_by<const N: usize>(self) -> Self {
        let (width, height) = (self.width, self.height());
        let kernels: [CubicWeights; N] = core::array::from_fn(|k| CubicWeights::new((k as f64 + 0.5) / N as f64 - 0.5));
        let mut values = Vec::with_capacity(self.values.len() * N * N);
        // One row with margins for the interpolation.
        let mut line = vec![0.0; width + 2 * RADIUS];
        let zeros = vec![0.0; width];
        let row = |y: usize| {
            let y = y.checked_sub(RADIUS).filter(|y| *y < height);
            y.map_or(&zeros[..], |y| &self.values[y * width..(y + 1) * width])
        };
        for y in 0..height {
            for CubicWeights { first, weights } in &kernels {
                let four = core::array::from_fn(|k| row(y + first + k));
                mix(&mut line[RADIUS..RADIUS + width], four, *weights);
                let start = values.len();
                values.resize(start + N * width, 0.0);
                refine_row(&mut values[start..], &line, &kernels);
            }
        }
        Self { origin: self.origin.map(|at| at * N as i64), width: width * N, values }
    }

    /// Returns the mean and the standard deviation of the `n` x `n` values that [`Tile::refined`] computes in each
    /// pixel. The deviation is that of a linear slope.
    pub(crate) fn moments_within_pixels(&self, n: usize) -> [Self; 2] {
        let kernels = (0..n).map(|k| CubicWeights::new((k as f64 + 0.5) / n as f64 - 0.5).padded());
        let mut weights = [0.0; 2 * RADIUS + 1];
        for kernel in kernels {
            weights.iter_mut().zip(kernel).for_each(|(sum, weight)| *sum += weight / n as f32);
        }
        // Of n equidistant points in a pixel.
        let variance = (1.0 - 1.0 / (n * n) as f64) / 12.0;
        let (width, zeros) = (self.width, vec![0.0; self.width]);
        let row = |y: usize| y.checked_sub(RADIUS).and_then(|y| self.values.get(y * width..(y + 1) * width));
        let [mut mean, mut deviation] = [self.blank(), self.blank()];
        // Rows with margins for the interpolation.
        let (mut line, mut centre) = (vec![0.0; width + 2 * RADIUS], vec![0.0; width + 2 * RADIUS]);
        let outs = mean.values.chunks_exact_mut(width).zip(deviation.values.chunks_exact_mut(width));
        for (y, (mean, deviation)) in outs.enumerate() {
            let rows = core::array::from_fn(|k| row(y + k).unwrap_or(&zeros));
            centre[RADIUS..RADIUS + width].copy_from_slice(rows[RADIUS]);
            mix_five(&mut line[RADIUS..RADIUS + width], rows, weights);
            moments(mean, deviation, &line, &centre, [rows[RADIUS - 1], rows[RADIUS + 1]], (weights, variance as f32));
        }
        [mean, deviation]
    }
}

/// Radius of the interpolation kernel, px.
const RADIUS: usize = 2;

/// Weights of the four neighbours of a position in cubic interpolation.
struct CubicWeights {
    /// Index of the first neighbour, relative to [`RADIUS`] before the pixel.
    first: usize,
    weights: [f32; 4],
}

impl CubicWeights {
    /// Computes the weights for an offset from the pixel centre, −½ to ½.
    fn new(offset: f64) -> Self {
        let t = offset - offset.floor();
        let cubic = [
            ((-0.5 * t + 1.0) * t - 0.5) * t,
            (1.5 * t - 2.5) * t * t + 1.0,
            ((-1.5 * t + 2.0) * t + 0.5) * t,
            (0.5 * t - 0.5) * t * t,
        ];
        Self { first: if offset < 0.0 { 0 } else { 1 }, weights: cubic.map(|weight| weight as f32) }
    }

    /// Returns the weights of all neighbours up to [`RADIUS`]. Weights of 0 give all positions the same inputs, which
    /// allows vectorisation.
    fn padded(&self) -> [f32; 2 * RADIUS + 1] {
        let mut padded = [0.0; 2 * RADIUS + 1];
        padded[self.first..self.first + 4].copy_from_slice(&self.weights);
        padded
    }
}

#[multiversion(targets = "simd")]
fn mix_five(out: &mut [f32], [a, b, c, d, e]: [&[f32]; 5], w: [f32; 5]) {
    for (((((out, a), b), c), d), e) in out.iter_mut().zip(a).zip(b).zip(c).zip(d).zip(e) {
        *out = w[0] * a + w[1] * b + w[2] * c + w[3] * d + w[4] * e;
    }
}

/// Mixes a row along x to its mean within pixels, and computes the deviation from the slopes of the rows around it.
#[multiversion(targets = "simd")]
fn moments(
    mean: &mut [f32],
    deviation: &mut [f32],
    line: &[f32],
    centre: &[f32],
    [above, below]: [&[f32]; 2],
    (w, variance): ([f32; 5], f32),
) {
    let out = mean.iter_mut().zip(deviation).zip(line.windows(5)).zip(centre.windows(5)).zip(above).zip(below);
    for (((((mean, deviation), near), centre), above), below) in out {
        let value = w[0] * near[0] + w[1] * near[1] + w[2] * near[2] + w[3] * near[3] + w[4] * near[4];
        *mean = if value > 0.0 { value } else { 0.0 };
        let slope = [0.5 * (centre[3] - centre[1]), 0.5 * (below - above)];
        let size = (variance * (slope[0] * slope[0] + slope[1] * slope[1])).sqrt();
        *deviation = if size < *mean { size } else { *mean };
    }
}

#[multiversion(targets = "simd")]
fn mix(out: &mut [f32], [a, b, c, d]: [&[f32]; 4], weights: [f32; 4]) {
    for ((((out, a), b), c), d) in out.iter_mut().zip(a).zip(b).zip(c).zip(d) {
        *out = weights[0] * a + weights[1] * b + weights[2] * c + weights[3] * d;
    }
}

/// Interpolates a row with margins of [`RADIUS`] to a grid `N` times as fine.
#[multiversion(targets = "simd")]
fn refine_row<const N: usize>(out: &mut [f32], line: &[f32], kernels: &[CubicWeights; N]) {
    let weights: [_; N] = core::array::from_fn(|k| kernels[k].padded());
    for (out, near) in out.as_chunks_mut::<N>().0.iter_mut().zip(line.windows(2 * RADIUS + 1)) {
        for (out, w) in out.iter_mut().zip(&weights) {
            let value = w[0] * near[0] + w[1] * near[1] + w[2] * near[2] + w[3] * near[3] + w[4] * near[4];
            *out = if value > 0.0 { value } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tile::tests::disc;
    use super::*;

    #[test]
    fn refined_reproduces_a_quadratic_and_preserves_the_total() {
        for n in 1..=4 {
            // Cubic interpolation reproduces quadratics away from the border of the tile.
            let shape = |x: f64, y: f64| 5.0 + 0.3 * x - 0.2 * y + 0.02 * x * x - 0.01 * x * y;
            let mut tile = Tile { origin: [-4, 3], width: 12, values: vec![0.0; 12 * 10] };
            tile.for_each(|p, value| *value = shape(p[0], p[1]) as f32);
            let mut fine = tile.clone().refined(n);
            assert_eq!((fine.width, fine.height(), fine.origin), (12 * n, 10 * n, [-4 * n as i64, 3 * n as i64]));
            let coarse = |at: f64| (at + 0.5) / n as f64 - 0.5;
            fine.for_each(|p, value| {
                let [x, y] = p.map(coarse);
                let inside = (-2.0..=5.0).contains(&x) && (5.0..=10.0).contains(&y);
                assert!(!inside || (f64::from(*value) - shape(x, y)).abs() < 1e-4, "{n}: {x} {y} {value}");
            });
            let repeated = tile.clone().repeated(n).coarsened(n);
            assert!(repeated.values.iter().zip(&tile.values).all(|(a, b)| (a - b).abs() < 1e-5));
            // Clipping the undershoot at 0 changes the total of a disc inside the tile by less than 2 %.
            let mut blob = tile.blank();
            blob.cover(&disc([1.2, 7.6], 2.7));
            let (sum, area) = (blob.sum(), blob.refined(n).sum() / (n * n) as f64);
            assert!((area / sum - 1.0).abs() < 0.02, "{n}: {area} {sum}");
        }
    }

    #[test]
    fn moments_within_pixels_match_the_refined_tile() {
        for n in 2..=4 {
            let mut tile = Tile { origin: [-4, 3], width: 40, values: vec![0.0; 40 * 30] };
            tile.cover(&disc([14.0, 17.0], 9.0));
            for (i, value) in tile.values.iter_mut().enumerate() {
                *value *= 1.0 + 0.2 * libm::sinf((i % 40) as f32 * 0.9) + 0.3 * libm::cosf((i / 40) as f32 * 0.4);
            }
            let [mean, deviation] = tile.moments_within_pixels(n);
            let fine = tile.clone().refined(n);
            let squares = Tile { values: fine.values.iter().map(|v| v * v).collect(), ..fine.clone() }.coarsened(n);
            for (i, expected) in fine.coarsened(n).values.iter().enumerate() {
                let spread = (squares.values[i] - expected * expected).max(0.0).sqrt();
                // Undershoots at the rim are clipped after the mean here, before it there.
                assert!((mean.values[i] - expected).abs() < 0.03, "{n} {i}: {} {expected}", mean.values[i]);
                assert!((deviation.values[i] - spread).abs() < 0.06, "{n} {i}: {} {spread}", deviation.values[i]);
            }
        }
    }
}
