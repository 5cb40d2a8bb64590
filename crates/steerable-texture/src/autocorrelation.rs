//! Autocovariances in a small window: measurement, and filters that impose them.

use crate::filters::frequency;
use crate::matrix::Matrix;
use crate::plane::{Number, Plane};
use crate::sums::{dot, single};

/// The directions of frequencies in which an image has less than this fraction of its mean power hardly change in one
/// iteration.
const RIDGE: f64 = 1e-4;

/// The range of the squared gain of a filter. Larger changes take several iterations.
const SQUARED_GAIN: [f32; 2] = [0.01, 100.0];

/// Returns one of each pair of opposite displacements of at most `radius` px in each direction: (0, 0), the rest of the
/// row to the right, then the rows below.
pub(crate) fn displacements(radius: usize) -> impl Iterator<Item = [isize; 2]> {
    let radius = radius.cast_signed();
    (0..=radius).flat_map(move |y| (if y == 0 { 0 } else { -radius }..=radius).map(move |x| [x, y]))
}

/// Returns the number of [`displacements`].
pub(crate) fn count(radius: usize) -> usize {
    let side = 2 * radius + 1;
    side * side / 2 + 1
}

/// Returns Σ aᵢ aⱼ over all pixels i, with the pixel j at each displacement from i; periodic.
pub(crate) fn sums(image: &[f32], width: usize, radius: usize) -> Vec<f64> {
    let height = image.len() / width;
    let row = |y: usize| &image[y * width..][..width];
    let of = |[x, y]: [isize; 2]| {
        let x = x.rem_euclid(width.cast_signed()).unsigned_abs();
        let rows = (0..height).map(|from| {
            let (a, b) = (row(from), row((from + y.unsigned_abs()) % height));
            dot(&a[..width - x], &b[x..]) + dot(&a[width - x..], &b[..x])
        });
        rows.sum()
    };
    displacements(radius).map(of).collect()
}

/// Changes of the autocovariance of images of one size by filters of the size of the window.
#[derive(Debug, Clone)]
pub(crate) struct Shaper {
    radius: usize,
    width: usize,
    height: usize,
    /// cos and sin of ky · y for y = 0 to twice the radius.
    along_y: Vec<[Vec<f32>; 2]>,
}

impl Shaper {
    pub(crate) fn new(plane: &Plane, radius: usize) -> Self {
        let of = |y: usize| {
            let angles = (0..plane.height).map(|ky| libm::sincos(frequency(ky, plane.height) * y as f64));
            let (sin, cos) = angles.map(|(sin, cos)| (single(sin), single(cos))).unzip();
            [cos, sin]
        };
        let along_y = (0..=2 * radius).map(of).collect();
        Self { radius, width: plane.width, height: plane.height, along_y }
    }

    /// Returns the autocovariance of an image, given by its spectrum, for all displacements up to `radius`.
    fn autocovariance(&self, spectrum: &[Number], radius: usize) -> Vec<f64> {
        let mut sums = vec![0.0; count(radius)];
        let mut power = vec![0.0; self.height];
        for kx in 0..=self.width / 2 {
            let column = &spectrum[kx * self.height..][..self.height];
            power.iter_mut().zip(column).for_each(|(power, z)| *power = z.norm_sqr());
            // The other columns have the same power as their opposites.
            let weight = if kx == 0 || 2 * kx == self.width { 1.0 } else { 2.0 };
            let parts = self.along_y[..=radius].iter().map(|table| [0, 1].map(|i| weight * dot(&power, &table[i])));
            let parts: Vec<_> = parts.collect();
            let across = across(frequency(kx, self.width), radius);
            for (sum, [x, y]) in sums.iter_mut().zip(displacements(radius)) {
                let ([cos, sin], [c, s]) = (across[x.unsigned_abs()], parts[y.unsigned_abs()]);
                let sin = if x < 0 { -sin } else { sin };
                *sum += c * cos - s * sin;
            }
        }
        sums
    }

    /// Filters an image, given by its spectrum, so that its autocovariance approaches `target`.
    ///
    /// The squared filter h ⋆ h has the size of the window, and C ⋆ (h ⋆ h) = `target` is a system of linear equations
    /// (the paper's "adjustment of the autocorrelation"). It is solved for the difference from no change, with a ridge:
    /// the matrix is a Toeplitz matrix of an autocovariance and therefore has no negative eigenvalues.
    pub(crate) fn shape(&self, spectrum: &mut [Number], target: &[f64]) {
        let wide = self.autocovariance(spectrum, 2 * self.radius);
        let variance = wide[0];
        if !(variance > 0.0 && variance.is_finite()) {
            return;
        }
        if target[0] <= 0.0 {
            spectrum.fill(Number::ZERO);
            return;
        }
        // The variance first: the rest then is the change of the shape.
        let factor = target[0] / variance;
        let at = |[x, y]: [isize; 2]| {
            let [x, y] = if y < 0 || (y == 0 && x < 0) { [-x, -y] } else { [x, y] };
            let row = 4 * self.radius.cast_signed() + 1;
            let index = if y == 0 { x } else { (row + 1) / 2 + (y - 1) * row + x + row / 2 };
            wide[index.unsigned_abs()] / variance
        };
        let places: Vec<_> = displacements(self.radius).collect();
        let n = places.len();
        let mut matrix = vec![0.0; n * n];
        let mut difference = vec![0.0; n];
        for (i, [x, y]) in places.iter().enumerate() {
            // Each place but the first stands for two opposite ones.
            let twice = if i == 0 { 1.0 } else { 2.0 };
            difference[i] = twice * (target[i] / target[0] - at([*x, *y]));
            for (j, [u, v]) in places.iter().enumerate() {
                let both = at([x - u, y - v]) + if j == 0 { 0.0 } else { at([x + u, y + v]) };
                matrix[i * n + j] = twice * both;
            }
            matrix[i * n + i] += twice * RIDGE;
        }
        let change = Matrix::new(n, n, matrix).solve(difference).unwrap_or_else(|| vec![0.0; n]);
        self.apply(spectrum, &change, single(factor));
    }

    /// Multiplies a spectrum by √(factor · (1 + Σ changeₙ cos k·xₙ)).
    fn apply(&self, spectrum: &mut [Number], change: &[f64], factor: f32) {
        let mut gain = vec![0.0; self.height];
        for (kx, column) in spectrum.chunks_exact_mut(self.height).enumerate() {
            let across = across(frequency(kx, self.width), self.radius);
            let mut parts = vec![[0.0; 2]; self.radius + 1];
            for (i, (change, [x, y])) in change.iter().zip(displacements(self.radius)).enumerate() {
                let twice = if i == 0 { 1.0 } else { 2.0 };
                let [cos, sin] = across[x.unsigned_abs()];
                let part = &mut parts[y.unsigned_abs()];
                part[0] += twice * change * cos;
                part[1] += twice * change * if x < 0 { -sin } else { sin };
            }
            gain.fill(1.0);
            for ([cos, sin], part) in self.along_y.iter().zip(&parts) {
                let [c, s] = part.map(single);
                for ((gain, cos), sin) in gain.iter_mut().zip(cos).zip(sin) {
                    *gain += c * cos - s * sin;
                }
            }
            for (z, gain) in column.iter_mut().zip(&gain) {
                *z *= (factor * gain.clamp(SQUARED_GAIN[0], SQUARED_GAIN[1])).sqrt();
            }
        }
    }
}

/// Returns cos and sin of kx · x for x = 0 to `radius`.
fn across(kx: f64, radius: usize) -> Vec<[f64; 2]> {
    let angles = (0..=radius).map(|x| libm::sincos(kx * x as f64));
    angles.map(|(sin, cos)| [cos, sin]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Scratch;
    use portable_numerics::random::Ziggurat;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    const SIZE: [usize; 2] = [32, 64];

    fn noise(seed: u64) -> Vec<f32> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let ziggurat = Ziggurat::new();
        (0..SIZE[0] * SIZE[1] / 2).flat_map(|_| ziggurat.pair(&mut rng)).collect()
    }

    /// Returns the mean of a pixel and some of its neighbours.
    fn smooth(image: &[f32]) -> Vec<f32> {
        let at = |i: usize| image[i % image.len()];
        (0..image.len()).map(|i| at(i) + 0.8 * at(i + 1) + 0.5 * at(i + SIZE[0]) - 0.4 * at(i + SIZE[0] - 1)).collect()
    }

    /// The definition.
    fn slow(image: &[f32], radius: usize) -> Vec<f64> {
        let [width, height] = SIZE.map(usize::cast_signed);
        let at =
            |x: isize, y: isize| f64::from(image[(y.rem_euclid(height) * width + x.rem_euclid(width)).unsigned_abs()]);
        let places = |[dx, dy]: [isize; 2]| {
            let rows = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
            rows.map(|(x, y)| at(x, y) * at(x + dx, y + dy)).sum()
        };
        displacements(radius).map(places).collect()
    }

    #[test]
    fn fast_sums_match_the_definition() {
        let image = smooth(&noise(1));
        let plane = Plane::new(SIZE[0], SIZE[1]);
        let spectrum = plane.forward(&image, &mut Scratch::default());
        for radius in [1, 3, 7] {
            let expected = slow(&image, radius);
            assert_eq!(expected.len(), count(radius));
            let direct = sums(&image, SIZE[0], radius);
            let shaper = Shaper::new(&plane, radius);
            let spectral = shaper.autocovariance(&spectrum, radius);
            for ((expected, direct), spectral) in expected.iter().zip(direct).zip(spectral) {
                assert!((direct - expected).abs() < 1e-6 * image.len() as f64);
                assert!((spectral * image.len() as f64 - expected).abs() < 1e-5 * image.len() as f64);
            }
        }
    }

    #[test]
    fn autocovariances_are_imposed() {
        let plane = Plane::new(SIZE[0], SIZE[1]);
        let shaper = Shaper::new(&plane, 3);
        let mut scratch = Scratch::default();
        let target = shaper.autocovariance(&plane.forward(&smooth(&noise(2)), &mut scratch), 3);
        let mut spectrum = plane.forward(&noise(3), &mut scratch);
        for _ in 0..10 {
            shaper.shape(&mut spectrum, &target);
        }
        let found = shaper.autocovariance(&spectrum, 3);
        for (found, target) in found.iter().zip(&target) {
            assert!((found - target).abs() < 0.01, "{found}, {target}");
        }
    }

    #[test]
    fn impossible_autocovariances_stay_finite() {
        let plane = Plane::new(SIZE[0], SIZE[1]);
        let shaper = Shaper::new(&plane, 2);
        let mut scratch = Scratch::default();
        let n = count(2);
        for target in [vec![0.0; n], vec![1.0; n], (0..n).map(|i| if i == 0 { 1e-9 } else { 1e3 }).collect()] {
            for image in [noise(4), vec![0.0; SIZE[0] * SIZE[1]], vec![1.0; SIZE[0] * SIZE[1]]] {
                let mut spectrum = plane.forward(&image, &mut scratch);
                (0..4).for_each(|_| shaper.shape(&mut spectrum, &target));
                assert!(spectrum.iter().all(|z| z.re.is_finite() && z.im.is_finite()));
            }
        }
    }
}
