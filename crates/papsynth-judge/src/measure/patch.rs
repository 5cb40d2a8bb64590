//! Features of patches of a field.

use multiversion::multiversion;

use super::cytoplasm::{self, medians};
use super::maps::{BANDS, Maps, width_at};
use super::noise::{Noise, blocks};
use crate::control::Control;
use crate::error::Error;
use crate::filter::{blur, gradient};
use crate::number::whole;
use crate::statistics::{of_sorted, sorted};
use crate::table::{FeatureKind, FeatureTable, Row};

/// Size of a patch, pixels. A smaller field is one patch.
pub(crate) const PATCH_PX: usize = 200;

/// Minimum absorbance of objects.
pub(crate) const OBJECT: f32 = 0.04;

/// Limits of the ranges of absorbance whose fractions are features.
const STEPS: [f32; 6] = [0.04, 0.1, 0.2, 0.3, 0.5, 0.8];

/// Quantiles of absorbance.
const QUANTILES: [f64; 7] = [0.01, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99];

/// Scales of ridges and blobs, pixels.
const HESSIANS: [f64; 3] = [1.5, 3.0, 6.0];

/// Scales of the gradient and of the window of structure tensors, pixels.
const TENSORS: [[f64; 2]; 2] = [[1.0, 3.0], [2.0, 6.0]];

/// Radius and smoothing of local binary patterns, pixels.
const PATTERNS: [(usize, f64); 3] = [(1, 0.0), (2, 1.0), (4, 2.0)];

/// Differences of absorbance below this count as zero in binary patterns.
const TOLERANCE: f32 = 0.004;

/// Classes of binary patterns: 0 to 8 darker neighbours with at most two changes around the pixel, and one for all
/// other patterns.
const CLASSES: usize = 10;

/// Fraction of the blocks of a patch that count as flat.
const FLAT: f64 = 0.2;

/// Maps that only patches use.
struct Fine<'a> {
    maps: &'a Maps,
    gradient: [Vec<f32>; 2],
    /// Larger and smaller eigenvalue of the second derivatives of absorbance; the smaller one is negative at a dark
    /// ridge.
    hessians: Vec<(Vec<f32>, Vec<f32>)>,
    /// Coherence and energy of structure tensors.
    tensors: Vec<(Vec<f32>, Vec<f32>)>,
    /// Class of the binary pattern around each pixel.
    patterns: Vec<Vec<u8>>,
}

/// Measures all patches of a field.
pub(crate) fn patches(maps: &Maps, windows: &[cytoplasm::Window], control: &Control) -> Result<FeatureTable, Error> {
    control.check()?;
    let fine = Fine {
        maps,
        gradient: gradient(&maps.smooth, maps.width),
        hessians: HESSIANS.iter().map(|s| hessian(&blur(&maps.absorbance, maps.width, *s), maps.width, *s)).collect(),
        tensors: TENSORS.iter().map(|[s, window]| tensor(maps, *s, *window)).collect(),
        patterns: PATTERNS.iter().map(|(radius, s)| pattern(maps, *radius, *s)).collect(),
    };
    let (wide, high) = (PATCH_PX.min(maps.width), PATCH_PX.min(maps.height));
    let starts = |length: usize, side: usize| (0..=length - side).step_by(side);
    let places = starts(maps.height, high).flat_map(|top| starts(maps.width, wide).map(move |left| [left, top]));
    let patch = |[left, top]: [usize; 2]| {
        let window = Window { left, top, wide, high };
        control.check()?;
        let mut row = features(&fine, window);
        let inside = medians(windows.iter().filter(|w| window.contains(w.centre)));
        for (name, value) in cytoplasm::NAMES.into_iter().zip(inside) {
            row.put(FeatureKind::Cytoplasm, name, value);
        }
        Ok((row, [(left + wide / 2) as f64, (top + high / 2) as f64]))
    };
    places.map(patch).collect()
}

#[derive(Clone, Copy)]
struct Window {
    left: usize,
    top: usize,
    wide: usize,
    high: usize,
}

impl Window {
    fn contains(self, [x, y]: [usize; 2]) -> bool {
        (self.left..self.left + self.wide).contains(&x) && (self.top..self.top + self.high).contains(&y)
    }

    /// Returns the values of the window in an image that is downsampled by `2^shift`.
    fn of<T: Copy>(self, image: &[T], width: usize, shift: usize) -> impl Iterator<Item = T> {
        let rows = (self.top >> shift)..((self.top + self.high) >> shift).max((self.top >> shift) + 1);
        let columns = (self.left >> shift)..((self.left + self.wide) >> shift).max((self.left >> shift) + 1);
        rows.flat_map(move |y| image[y * width..][columns.clone()].iter().copied())
    }
}

fn features(fine: &Fine, window: Window) -> Row {
    let maps = fine.maps;
    let width = maps.width;
    let mut row = Row::default();
    let a: Vec<f32> = window.of(&maps.absorbance, width, 0).collect();
    let smooth: Vec<f32> = window.of(&maps.smooth, width, 0).collect();
    let part = |count: usize| count as f64 / a.len() as f64;

    let thinned = sorted(smooth.iter().step_by(THINNED).map(|v| f64::from(*v)));
    for q in QUANTILES {
        row.put(FeatureKind::Absorbance, format!("absorbance, quantile {q}"), of_sorted(&thinned, q));
    }
    for (i, from) in STEPS.iter().enumerate() {
        let to = STEPS.get(i + 1).copied().unwrap_or(f32::INFINITY);
        let count = smooth.iter().filter(|v| **v >= *from && **v < to).count();
        row.put(FeatureKind::Absorbance, format!("part of absorbance {from} and more"), part(count));
    }

    let mut powers = Vec::new();
    for (i, (band, wide)) in maps.bands.iter().enumerate() {
        let px = 1 << i;
        let values: Vec<f64> = window.of(band, *wide, i).map(f64::from).collect();
        let n = values.len() as f64;
        let square = values.iter().map(|v| v * v).sum::<f64>() / n;
        let fourth = values.iter().map(|v| v * v * v * v).sum::<f64>() / n;
        let power = libm::log10(square.max(1e-10));
        let sparseness = libm::log10(fourth / (square * square).max(1e-18));
        row.put(FeatureKind::Spectrum, format!("log power at {px} px"), power);
        row.put(FeatureKind::Spectrum, format!("sparseness at {px} px"), sparseness);
        powers.push(power);
    }
    for i in 1..BANDS {
        let (px, finer) = (1 << i, 1 << (i - 1));
        row.put(FeatureKind::Spectrum, format!("log power at {px} over {finer} px"), powers[i] - powers[i - 1]);
    }

    edges(&mut row, fine, window);
    noise(&mut row, maps, window);

    let object: Vec<bool> = smooth.iter().map(|v| *v > OBJECT).collect();
    let objects = object.iter().filter(|o| **o).count();
    let over = |image: &[f32], f: &dyn Fn(f32) -> f64| {
        let sum: f64 = window.of(image, width, 0).zip(&object).filter(|(_, o)| **o).map(|(v, _)| f(v)).sum();
        if objects < MIN_OBJECT { f64::NAN } else { sum / objects as f64 }
    };
    for ((high, low), sigma) in fine.hessians.iter().zip(HESSIANS) {
        let (valley, ridge) = (over(high, &|v| f64::from(v.max(0.0))), over(low, &|v| f64::from(-v.min(0.0))));
        let weak = over(high, &|v| f64::from(v.min(0.0).abs()));
        row.put(FeatureKind::Texture, format!("log dark ridges at {sigma} px"), libm::log10(ridge.max(1e-6)));
        row.put(FeatureKind::Texture, format!("pale over dark ridges at {sigma} px"), valley / ridge.max(1e-6));
        row.put(FeatureKind::Texture, format!("blobs over ridges at {sigma} px"), weak / ridge.max(1e-6));
    }
    for ((coherence, energy), [sigma, _]) in fine.tensors.iter().zip(TENSORS) {
        let total = over(energy, &f64::from);
        let product: Vec<f32> = coherence.iter().zip(energy).map(|(c, e)| c * e).collect();
        row.put(FeatureKind::Texture, format!("coherence at {sigma} px"), over(coherence, &f64::from));
        let of_edges = over(&product, &f64::from) / total.max(1e-9);
        row.put(FeatureKind::Texture, format!("coherence of edges at {sigma} px"), of_edges);
    }
    for (classes, (radius, _)) in fine.patterns.iter().zip(PATTERNS) {
        let mut counts = [0_usize; CLASSES];
        // The finest patterns measure noise, also on empty slide.
        let everywhere = radius == 1;
        for (class, o) in window.of(classes, width, 0).zip(&object) {
            if everywhere || *o {
                counts[usize::from(class)] += 1;
            }
        }
        let total = if everywhere { a.len() } else { objects };
        for (i, count) in counts.iter().enumerate() {
            let value = if total < MIN_OBJECT { f64::NAN } else { *count as f64 / total as f64 };
            row.put(FeatureKind::Texture, format!("pattern {i} at {radius} px"), value);
        }
    }
    row
}

/// Quantiles use every third pixel, because neighbours are correlated.
const THINNED: usize = 3;

/// Minimum number of object pixels in a patch for texture features.
const MIN_OBJECT: usize = 400;

fn edges(row: &mut Row, fine: &Fine, window: Window) {
    let maps = fine.maps;
    let slopes = sorted(window.of(&maps.slope, maps.width, 0).step_by(THINNED).map(f64::from));
    for q in [0.5, 0.75, 0.9, 0.97, 0.995] {
        row.put(FeatureKind::Edges, format!("log slope, quantile {q}"), libm::log10(of_sorted(&slopes, q).max(1e-5)));
    }
    let sum = |image: &[f32]| window.of(image, maps.width, 0).map(|v| f64::from(v.abs())).sum::<f64>();
    let [across, down] = fine.gradient.each_ref().map(|image| sum(image).max(1e-9));
    row.put(FeatureKind::Edges, "log slope across over down", libm::log10(across / down));
    let within = |p: usize| window.contains([p % maps.width, p / maps.width]);
    let widths = sorted(maps.edges.iter().filter(|e| within(e.pixel)).map(|e| e.sigma));
    for q in [0.1, 0.5, 0.9] {
        row.put(FeatureKind::Edges, format!("edge sigma, px, quantile {q}"), width_at(&widths, q));
    }
}

/// Adds the noise of the flattest blocks: standard deviation and correlations.
fn noise(row: &mut Row, maps: &Maps, window: Window) {
    let places = blocks([window.left, window.top], [window.wide, window.high]);
    let mut blocks: Vec<Noise> = places.map(|at| Noise::of(&maps.grey, maps.width, at)).collect();
    blocks.sort_by(|a, b| a.variance.total_cmp(&b.variance));
    blocks.truncate(whole((FLAT * blocks.len() as f64).ceil()));
    let noise = Noise::mean(&mut blocks);
    let known = |f: &dyn Fn(&Noise) -> f64| noise.as_ref().map_or(f64::NAN, f);
    row.put(FeatureKind::Noise, "log noise, dn", known(&|n| 0.5 * libm::log10(n.variance.max(1e-4))));
    for (lag, (name, _)) in Noise::LAGS.iter().enumerate() {
        row.put(FeatureKind::Noise, format!("noise correlation {name}"), known(&|n| n.correlation(lag)));
    }
}

/// Returns the absorbance after a Gaussian of 0, 1 or 2 pixels.
fn smoothed(maps: &Maps, sigma: f64) -> &[f32] {
    match sigma {
        0.0 => &maps.absorbance,
        1.0 => &maps.smooth,
        _ => &maps.smoother,
    }
}

/// Returns both eigenvalues of the second derivatives, scaled to absorbance, the larger first.
fn hessian(image: &[f32], width: usize, sigma: f64) -> (Vec<f32>, Vec<f32>) {
    let [dx, dy] = gradient(image, width);
    let [dxx, dxy] = gradient(&dx, width);
    let [_, dyy] = gradient(&dy, width);
    let scale = crate::number::single(sigma * sigma);
    let of_pixel = |((xx, xy), yy): ((&f32, &f32), &f32)| {
        let half = 0.5 * (xx + yy);
        let root = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
        (scale * (half + root), scale * (half - root))
    };
    dxx.iter().zip(&dxy).zip(&dyy).map(of_pixel).unzip()
}

/// Returns coherence (λ₁ − λ₂)/(λ₁ + λ₂) and energy λ₁ + λ₂ of the structure tensor.
fn tensor(maps: &Maps, sigma: f64, window: f64) -> (Vec<f32>, Vec<f32>) {
    let [dx, dy] = gradient(smoothed(maps, sigma), maps.width);
    let product =
        |a: &[f32], b: &[f32]| blur(&a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<_>>(), maps.width, window);
    let (xx, xy, yy) = (product(&dx, &dx), product(&dx, &dy), product(&dy, &dy));
    let of_pixel = |((xx, xy), yy): ((&f32, &f32), &f32)| {
        let (sum, difference) = (xx + yy, ((xx - yy) * (xx - yy) + 4.0 * xy * xy).sqrt());
        (if sum > 1e-12 { difference / sum } else { 0.0 }, sum)
    };
    xx.iter().zip(&xy).zip(&yy).map(of_pixel).unzip()
}

/// Returns rotation-invariant uniform local binary patterns (Ojala et al., doi:10.1109/TPAMI.2002.1017623). Border
/// pixels are replicated.
fn pattern(maps: &Maps, radius: usize, sigma: f64) -> Vec<u8> {
    let image = smoothed(maps, sigma);
    let (width, height) = (maps.width, maps.height);
    let wide = width + 2 * radius;
    let framed = |y: usize| {
        let row = &image[y.saturating_sub(radius).min(height - 1) * width..][..width];
        std::iter::repeat_n(row[0], radius)
            .chain(row.iter().copied())
            .chain(std::iter::repeat_n(row[width - 1], radius))
    };
    let padded: Vec<f32> = (0..height + 2 * radius).flat_map(framed).collect();
    // cos 45° ≈ 0.7; offsets from the upper left corner of the padded image.
    let near = (radius * 7 + 5) / 10;
    let (low, mid, high) = (radius - near, radius, radius + near);
    let ring =
        [[2 * radius, mid], [high, high], [mid, 2 * radius], [low, high], [0, mid], [low, low], [mid, 0], [high, low]];
    let classes = classes();
    let mut out = vec![0; image.len()];
    for (y, to) in out.chunks_exact_mut(width).enumerate() {
        let own = &image[y * width..][..width];
        for (bit, [x0, y0]) in ring.into_iter().enumerate() {
            compare(own, &padded[(y + y0) * wide + x0..][..width], 1 << bit, to);
        }
        to.iter_mut().for_each(|bits| *bits = classes[usize::from(*bits)]);
    }
    out
}

/// Sets a bit for each pixel with a darker neighbour.
#[multiversion(targets = "simd")]
fn compare(own: &[f32], neighbour: &[f32], bit: u8, to: &mut [u8]) {
    for ((bits, own), neighbour) in to.iter_mut().zip(own).zip(neighbour) {
        *bits |= if *neighbour > own + TOLERANCE { bit } else { 0 };
    }
}

/// Returns the class of each pattern of eight bits.
fn classes() -> Vec<u8> {
    let class = |bits: u8| if (bits ^ bits.rotate_left(1)).count_ones() <= 2 { bits.count_ones() } else { 9 };
    (0..=u8::MAX).map(|bits| u8::try_from(class(bits)).unwrap_or(9)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(maps: &Maps) -> FeatureTable {
        patches(maps, &[], &Control::NONE).unwrap()
    }

    #[test]
    fn patterns_equal_a_count_pixel_by_pixel() {
        let maps = Maps::drawn(41, 37, |x, y| 120.0 + (x * x * 7.0 + y * 13.0 + x * y) % 23.0);
        for (radius, sigma) in PATTERNS {
            let image = smoothed(&maps, sigma);
            let near = (radius * 7 + 5) / 10;
            let r = i64::try_from(radius).unwrap();
            let n = i64::try_from(near).unwrap();
            let ring = [[r, 0], [n, n], [0, r], [-n, n], [-r, 0], [-n, -n], [0, -r], [n, -n]];
            for (i, class) in pattern(&maps, radius, sigma).iter().enumerate() {
                let (x, y) = ((i % 41) as i64, (i / 41) as i64);
                let at = |x: i64, y: i64| image[usize::try_from(y.clamp(0, 36) * 41 + x.clamp(0, 40)).unwrap()];
                let darker: Vec<bool> = ring.iter().map(|[dx, dy]| at(x + dx, y + dy) > at(x, y) + TOLERANCE).collect();
                let changes = (0..8).filter(|k| darker[*k] != darker[(k + 1) % 8]).count();
                let slow = if changes <= 2 { darker.iter().filter(|d| **d).count() } else { 9 };
                assert_eq!(usize::from(*class), slow, "radius {radius}, pixel {i}");
            }
        }
    }

    #[test]
    fn stripes_are_coherent_and_dark_lines_are_ridges() {
        let lines = |x: f64, y: f64| if (x + 2.0 * y) % 24.0 < 3.0 { 150.0 } else { 170.0 };
        let spots = |x: f64, y: f64| if x % 16.0 < 4.0 && y % 16.0 < 4.0 { 150.0 } else { 170.0 };
        // The bright margin is empty slide.
        let field = |of: fn(f64, f64) -> f64| {
            measured(&Maps::drawn(200, 200, move |x, y| if x < 40.0 { 240.0 } else { of(x, y) }))
        };
        let (lines, spots) = (field(lines), field(spots));
        assert_eq!((lines.len(), spots.len()), (1, 1));
        let value = |table: &FeatureTable, name: &str| table.column(name).next().unwrap();
        assert!(value(&lines, "coherence at 1 px") > 0.8 && value(&spots, "coherence at 1 px") < 0.6);
        assert!(value(&lines, "blobs over ridges at 3 px") < value(&spots, "blobs over ridges at 3 px"));
    }

    #[test]
    fn patches_start_at_the_corner_of_the_field() {
        let table = measured(&Maps::drawn(430, 250, |x, y| 200.0 + x % 7.0 + y % 5.0));
        assert_eq!(table.places, [[100.0, 100.0], [300.0, 100.0]]);
        let names: std::collections::BTreeSet<&str> = table.features.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names.len(), table.features.len());
    }
}
