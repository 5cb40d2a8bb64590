//! Areas of a field that show the texture of cytoplasm alone.

use super::maps::Maps;
use crate::filter::{blur, slope};
use crate::number::{single, whole};

/// The absorbance of a field, and the areas that show cytoplasm without nuclei, borders, folds and debris.
#[derive(Debug, Clone, PartialEq)]
pub struct BareCytoplasm {
    /// Absorbance relative to the empty slide, row by row.
    pub absorbance: Vec<f32>,
    /// Local mean of the absorbance of these areas: Gaussian weights with a standard deviation of 2.7 µm.
    pub mean: Vec<f32>,
    /// Columns.
    pub width: usize,
    /// 1 in these areas, 0 elsewhere.
    pub mask: Vec<f32>,
    /// 1 on the empty slide far from objects, 0 elsewhere.
    pub empty: Vec<f32>,
    /// Standard deviation of the noise of the empty slide, absorbance; NaN if unknown.
    pub noise: f64,
    /// Median blur of edges, standard deviation in pixels; NaN if unknown.
    pub blur_px: f64,
}

/// Range of the absorbance of cytoplasm.
const RANGE: [f32; 2] = [0.04, 0.5];

/// Smoothing of the local mean, µm.
const MEAN_UM: f64 = 2.7;

/// Smoothing of edges and dark objects, µm.
const EDGE_UM: f64 = 1.0;

/// Largest slope of the smoothed absorbance over the local mean, µm⁻¹: borders of cells and folds are steeper.
const STEEP: f32 = 0.18;

/// Largest deviation of the smoothed absorbance from the local mean, as a fraction of it: wrinkles and debris deviate
/// more.
const DEVIATION: f32 = 0.4;

/// Largest absorbance of the empty slide after smoothing.
const EMPTY: f32 = 0.012;

/// Distance of the empty slide from objects, µm.
const EMPTY_UM: f64 = 4.0;

/// Distance from borders of cells, from nuclei and from steep areas, µm.
const DISTANCES_UM: [f64; 3] = [2.0, 3.0, 1.6];

impl BareCytoplasm {
    /// Finds the areas. `ids` are the numbers of nuclei, 0 elsewhere.
    pub(super) fn new(maps: Maps, ids: &[u32], noise_dn: f64, blur_px: f64, pixel_um: f64) -> Self {
        let width = maps.width;
        let px = |um: f64| um / pixel_um;
        let mean = blur(&maps.absorbance, width, px(MEAN_UM));
        let edges = blur(&maps.absorbance, width, px(EDGE_UM));
        let steepness = slope(&edges, width);
        let outside: Vec<bool> = maps.smoother.iter().map(|a| !(RANGE[0]..=RANGE[1]).contains(a)).collect();
        let nuclei: Vec<bool> = ids.iter().map(|id| *id > 0).collect();
        let per_px = STEEP * single(pixel_um);
        let uneven = |i: usize| {
            let mean = mean[i].max(RANGE[0]);
            steepness[i] > per_px * mean || (edges[i] - mean).abs() > DEVIATION * mean
        };
        let uneven: Vec<bool> = (0..mean.len()).map(uneven).collect();
        let mut mask = vec![1.0; mean.len()];
        for (excluded, distance) in [outside, nuclei, uneven].iter().zip(DISTANCES_UM) {
            for (kept, near) in mask.iter_mut().zip(dilated(excluded, width, whole(px(distance)))) {
                *kept = if near { 0.0 } else { *kept };
            }
        }
        let objects: Vec<bool> = maps.smoother.iter().map(|a| a.abs() > EMPTY).collect();
        let near = dilated(&objects, width, whole(px(EMPTY_UM)));
        let empty = near.into_iter().map(|near| if near { 0.0 } else { 1.0 }).collect();
        // Grey levels of 255 to absorbance at the light of the empty slide.
        let level = 255.0 * maps.background.mean();
        let noise = noise_dn / (level.max(1.0) * std::f64::consts::LN_10);
        let inside = |values: &[f32]| blur(values, width, px(MEAN_UM));
        let weighted: Vec<f32> = maps.absorbance.iter().zip(&mask).map(|(a, m)| a * m).collect();
        let mean = inside(&weighted).iter().zip(inside(&mask)).map(|(sum, weight)| sum / weight.max(1e-6)).collect();
        Self { absorbance: maps.absorbance, mean, width, mask, empty, noise, blur_px }
    }
}

/// Returns whether a marked pixel is within a square of this radius.
fn dilated(marked: &[bool], width: usize, radius: usize) -> Vec<bool> {
    let height = marked.len() / width.max(1);
    let mut rows = vec![false; marked.len()];
    for y in 0..height {
        spread(|x| y * width + x, width, radius, marked, &mut rows);
    }
    let mut square = vec![false; marked.len()];
    for x in 0..width {
        spread(|y| y * width + x, height, radius, &rows, &mut square);
    }
    square
}

/// Marks pixels of a line that are at most `radius` from a marked one. `at` returns the index of a pixel of the line.
fn spread(at: impl Fn(usize) -> usize, length: usize, radius: usize, marked: &[bool], out: &mut [bool]) {
    let mut within = (0..radius.min(length)).filter(|i| marked[at(*i)]).count();
    for i in 0..length {
        within += usize::from(i + radius < length && marked[at(i + radius)]);
        within -= usize::from(i > radius && marked[at(i - radius - 1)]);
        out[at(i)] |= within > 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_nuclei_and_folds_are_excluded() {
        let inside = |x: f64, y: f64| libm::hypot(x - 100.0, y - 100.0) < 80.0;
        let nucleus = |x: f64, y: f64| libm::hypot(x - 100.0, y - 100.0) < 10.0;
        let fold = |x: f64| (140.0..144.0).contains(&x);
        let maps = Maps::drawn(220, 200, |x, y| {
            let a = if nucleus(x, y) { 0.6 } else { 0.15 + if fold(x) { 0.15 } else { 0.0 } };
            240.0 * libm::exp10(-if inside(x, y) { a } else { 0.0 })
        });
        let ids: Vec<u32> =
            (0..220 * 200).map(|i| u32::from(nucleus(f64::from(i % 220), f64::from(i / 220)))).collect();
        let found = BareCytoplasm::new(maps, &ids, 1.0, 0.6, 0.33);
        assert!((found.noise - 1.0 / (240.0 * std::f64::consts::LN_10)).abs() < 1e-4, "{}", found.noise);
        let mut area = 0.0;
        for (i, kept) in found.mask.iter().enumerate() {
            let (x, y) = ((i % 220) as f64, (i / 220) as f64);
            assert!(found.empty[i] == 0.0 || libm::hypot(x - 100.0, y - 100.0) > 83.0, "{x} {y}");
            assert!(*kept == 0.0 || (inside(x, y) && !nucleus(x, y) && !fold(x)), "{x} {y}");
            assert!(*kept == 0.0 || (found.mean[i] - 0.15).abs() < 0.01, "{x} {y}: {}", found.mean[i]);
            area += kept;
        }
        assert!(area > 0.4 * 20_000.0, "{area}");
        assert!(found.empty.iter().sum::<f32>() > 10_000.0);
    }

    #[test]
    fn dilation_equals_a_search() {
        let marked: Vec<bool> = (0..40 * 30).map(|i| i * i % 97 == 4).collect();
        let dilated = dilated(&marked, 40, 3);
        for (i, found) in dilated.iter().enumerate() {
            let near = |j: usize| (i % 40).abs_diff(j % 40) <= 3 && (i / 40).abs_diff(j / 40) <= 3;
            assert_eq!(*found, (0..marked.len()).any(|j| marked[j] && near(j)), "{i}");
        }
    }
}
