//! Background light of the empty slide, and absorbance.

use crate::number::{nearest, single};
use crate::statistics::{median, quantile};

/// Size of the blocks whose medians the surface is fitted to, pixels.
const BLOCK: usize = 8;

/// Initial candidates for empty slide are within this fraction of the brightest block.
const FIRST_BAND: f64 = 0.08;

/// Narrowest band of levels of empty slide: two grey levels of 255.
const NARROWEST_BAND: f64 = 0.008;

/// Rounds of selection and fitting. More rounds do not change the result noticeably.
const ROUNDS: usize = 6;

/// Regularisation towards a flat surface, as a fraction of the number of blocks. It matters if only a corner of the
/// field is empty.
const STIFFNESS: f64 = 1e-4;

/// Minimum light, as a fraction of full scale: half a grey level of 8 bits.
const LEAST_LIGHT: f32 = 0.5 / 255.0;

/// Number of terms: 1, x, y, x², xy, y² over −1..1.
const TERMS: usize = 6;

/// A quadratic surface: coefficients of 1, x, y, x², xy and y².
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Surface(pub(crate) [f64; TERMS]);

impl Surface {
    /// Fits a surface to values at points of −1..1 by least squares. `stiffness` is a ridge penalty on all terms except
    /// the constant.
    pub(crate) fn fit(points: &[([f64; 2], f64)], stiffness: f64) -> Self {
        let mut normal = [[0.0; TERMS + 1]; TERMS];
        for ([x, y], level) in points {
            let row = [1.0, *x, *y, x * x, x * y, y * y, *level];
            for i in 0..TERMS {
                for j in 0..=TERMS {
                    normal[i][j] += row[i] * row[j];
                }
            }
        }
        for (i, row) in normal.iter_mut().enumerate().skip(1) {
            row[i] += stiffness;
        }
        Self(solve(normal))
    }

    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let [c, cx, cy, cxx, cxy, cyy] = self.0;
        c + cx * x + cy * y + cxx * x * x + cxy * x * y + cyy * y * y
    }
}

/// A quadratic surface through the empty slide of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Background {
    /// Surface over −1..1, fractions of full scale.
    pub(crate) surface: Surface,
    width: usize,
    height: usize,
}

impl Background {
    /// Fits the surface to grey levels `0..=full_scale`.
    ///
    /// Empty slide is bright and even: the fit uses blocks of low variation in a band around the 98th percentile of the
    /// block medians. Each round narrows the band around the fitted surface.
    pub(crate) fn new(grey: &[f32], width: usize, full_scale: f32) -> Self {
        let height = grey.len() / width;
        let blocks = blocks(grey, width, full_scale);
        let mut levels: Vec<f64> = blocks.iter().map(|b| b.level).collect();
        let mut spreads: Vec<f64> = blocks.iter().map(|b| b.spread).collect();
        let brightest = quantile(&mut levels, 0.98).max(f64::from(LEAST_LIGHT));
        let bright: Vec<&Block> = blocks.iter().filter(|b| b.level > (1.0 - FIRST_BAND) * brightest).collect();
        let even = if bright.len() > 2 * TERMS {
            2.0 * quantile(&mut bright.iter().map(|b| b.spread).collect::<Vec<_>>(), 0.3)
        } else {
            quantile(&mut spreads, 0.5)
        };
        let mut surface = Surface([brightest, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let mut band = FIRST_BAND * brightest;
        for _ in 0..ROUNDS {
            let rest = |b: &Block| b.level - surface.at(b.place);
            let chosen: Vec<&Block> =
                blocks.iter().filter(|b| b.spread <= even.max(1e-4) && rest(b).abs() < band).collect();
            if chosen.len() < 2 * TERMS {
                break;
            }
            let mut rests: Vec<f64> = chosen.iter().map(|b| rest(b).abs()).collect();
            band = (4.0 * median(&mut rests)).clamp(NARROWEST_BAND * brightest, band);
            let points: Vec<([f64; 2], f64)> = chosen.iter().map(|b| (b.place, b.level)).collect();
            surface = Surface::fit(&points, STIFFNESS * blocks.len() as f64);
        }
        Self { surface, width, height }
    }

    /// Returns maximum minus minimum of the surface, over its mean.
    pub(crate) fn peak_to_valley(&self) -> f64 {
        let values = self.grid();
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        (high - low) / self.mean().max(f64::from(LEAST_LIGHT))
    }

    /// Returns the mean, as a fraction of full scale.
    pub(crate) fn mean(&self) -> f64 {
        let values = self.grid();
        values.iter().sum::<f64>() / values.len() as f64
    }

    fn grid(&self) -> Vec<f64> {
        let at = |i: i32| f64::from(i) / 10.0;
        (-10..=10).flat_map(|y| (-10..=10).map(move |x| [at(x), at(y)])).map(|p| self.surface.at(p)).collect()
    }

    /// Returns the absorbance A = −log₁₀(I/B) of each pixel.
    pub(crate) fn absorbance(&self, grey: &[f32], full_scale: f32) -> Vec<f32> {
        let mut out = Vec::with_capacity(grey.len());
        let [c, cx, cy, cxx, cxy, cyy] = self.surface.0;
        for (y, row) in grey.chunks_exact(self.width).enumerate() {
            let v = 2.0 * y as f64 / self.height as f64 - 1.0;
            let (level, tilt) = (c + cy * v + cyy * v * v, cx + cxy * v);
            out.extend(row.iter().enumerate().map(|(x, grey)| {
                let u = 2.0 * x as f64 / self.width as f64 - 1.0;
                let light = (grey / full_scale).max(LEAST_LIGHT);
                let lamp = single(level + tilt * u + cxx * u * u).max(LEAST_LIGHT);
                libm::log10f(lamp / light)
            }));
        }
        out
    }
}

struct Block {
    /// Centre, over −1..1.
    place: [f64; 2],
    /// Median, as a fraction of full scale.
    level: f64,
    /// 90th minus 10th percentile.
    spread: f64,
}

fn blocks(grey: &[f32], width: usize, full_scale: f32) -> Vec<Block> {
    let height = grey.len() / width;
    let mut blocks = Vec::new();
    let mut values: Vec<f32> = Vec::with_capacity(BLOCK * BLOCK);
    for y in (0..height + 1 - BLOCK.min(height)).step_by(BLOCK) {
        for x in (0..width + 1 - BLOCK.min(width)).step_by(BLOCK) {
            values.clear();
            for row in grey.chunks_exact(width).skip(y).take(BLOCK) {
                values.extend_from_slice(&row[x..(x + BLOCK).min(width)]);
            }
            values.sort_unstable_by(f32::total_cmp);
            let at = |q: f64| f64::from(values[nearest(q * (values.len() - 1) as f64)] / full_scale);
            let middle = |from: usize, length: usize| 2.0 * (from as f64 + BLOCK as f64 / 2.0) / length as f64 - 1.0;
            let place = [middle(x, width), middle(y, height)];
            blocks.push(Block { place, level: at(0.5), spread: at(0.9) - at(0.1) });
        }
    }
    blocks
}

/// Solves a symmetric, positive definite system by Gauss–Jordan elimination.
fn solve(mut rows: [[f64; TERMS + 1]; TERMS]) -> [f64; TERMS] {
    for i in 0..TERMS {
        let pivot = rows[i][i].max(1e-12);
        let of = rows[i];
        for (k, row) in rows.iter_mut().enumerate() {
            let part = if k == i { 1.0 - 1.0 / pivot } else { row[i] / pivot };
            for (value, v) in row.iter_mut().zip(of) {
                *value -= part * v;
            }
        }
    }
    rows.map(|row| row[TERMS])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surface_and_absorbance_are_recovered() {
        let (width, height) = (400, 300);
        let terms = [0.9, 0.004, -0.006, -0.03, 0.002, -0.012];
        let lamp = Surface(terms);
        let at =
            |i: usize| [2.0 * (i % width) as f64 / width as f64 - 1.0, 2.0 * (i / width) as f64 / height as f64 - 1.0];
        // Half of the field is covered: one layer, and two.
        let a = |i: usize| {
            if i % width < 120 {
                0.05
            } else if i % width < 200 && i / width > 60 {
                0.3
            } else {
                0.0
            }
        };
        let noise = |i: usize| ((i * 7919) % 101) as f64 / 100.0 - 0.5;
        let grey: Vec<f32> = (0..width * height)
            .map(|i| single((255.0 * lamp.at(at(i)) * libm::pow(10.0, -a(i)) + noise(i)).round()))
            .collect();
        let found = Background::new(&grey, width, 255.0);
        for (found, wanted) in found.surface.0.iter().zip(terms) {
            assert!((found - wanted).abs() < 0.002, "{found}, not {wanted}");
        }
        assert!((found.mean() - (0.9 - 0.042 / 3.0)).abs() < 0.002);
        let absorbance = found.absorbance(&grey, 255.0);
        for i in [50 * width + 60, 200 * width + 160, 20 * width + 300] {
            assert!((f64::from(absorbance[i]) - a(i)).abs() < 0.008, "{} {}", absorbance[i], a(i));
        }
    }

    #[test]
    fn six_points_determine_a_surface() {
        let wanted = Surface([1.0, 2.0, -3.0, 0.5, -0.25, 4.0]);
        let places = [[-1.0, -1.0], [1.0, -0.5], [0.3, 0.9], [-0.7, 0.4], [0.1, -0.2], [0.8, 0.6]];
        let found = Surface::fit(&places.map(|p| (p, wanted.at(p))), 0.0);
        for (a, b) in found.0.iter().zip(wanted.0) {
            assert!((a - b).abs() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn an_image_without_empty_slide_has_a_background() {
        let grey: Vec<f32> = (0..64 * 64).map(|i| f32::from(u8::try_from((i * 37) % 256).unwrap_or(0))).collect();
        let found = Background::new(&grey, 64, 255.0);
        assert!(found.surface.0.iter().all(|t| t.is_finite()) && found.mean() > 0.3);
        assert!(found.absorbance(&grey, 255.0).iter().all(|a| a.is_finite()));
    }
}
