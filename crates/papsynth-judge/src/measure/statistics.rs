//! Statistics of a complete field.

use std::f64::consts::PI;
use std::sync::Arc;

use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlannerScalar};
use serde::{Deserialize, Serialize};

use super::cell::{COVERED, Cell, PROFILE};
use super::cytoplasm::{NAMES, TEXTURE, Window, medians};
use super::maps::{Maps, width_at};
use super::noise::{BLOCK, Noise, blocks};
use crate::number::{nearest, single, whole};
use crate::region::{Region, distance};
use crate::statistics::{line_slope, median, of_sorted, sorted};

/// Radii of Ripley's K, µm: 50, 100, 200 and 300 pixels of 0.33 µm.
pub const RADII_UM: [f64; 4] = [16.5, 33.0, 66.0, 99.0];

/// Bins of the histogram of absorbance.
pub const HISTOGRAM: usize = 60;

/// Lower limit of the first bin, which also counts all values below.
pub const HISTOGRAM_FROM: f64 = -0.05;

/// Width of a bin, absorbance. The last bin also counts all values above.
pub const HISTOGRAM_STEP: f64 = 0.02;

/// A pixel counts as overlap if its absorbance exceeds the median of the covered area by this factor.
const OVERLAP: f64 = 1.6;

/// Maximum deviation from the background in blocks of empty slide, absorbance after a Gaussian of 1 pixel.
const EMPTY: f32 = 0.02;

/// Declares the statistics of a field: the arguments of the constructor, then each statistic with its value and, for
/// scalars, its identifier.
macro_rules! statistics {
    (
        ($($given:ident: $of:ty),*) { $($before:tt)* }
        $($(#[$meta:meta])* $field:ident: $type:ty = $value:expr $(, $name:literal)? $(, names $names:ident)?;)*
    ) => {
        /// Statistics of a complete field; NaN if unknown.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        pub struct Statistics {
            $(
                $(#[$meta])*
                $(#[doc = concat!("\n\nIdentifier: ", $name, ".")] #[serde(deserialize_with = "number")])?
                pub $field: $type,
            )*
        }

        impl Statistics {
            pub(super) fn new($($given: $of),*) -> Self {
                $($before)*
                Self { $($field: $value),* }
            }

            /// Returns all scalars with their identifiers.
            #[must_use]
            pub fn scalars(&self) -> Vec<Named> {
                let mut all = Vec::new();
                $(
                    $(all.extend([($name, self.$field)]);)?
                    $(all.extend($names.into_iter().zip(self.$field));)?
                )*
                all
            }
        }
    };
}

statistics! {
    (maps: &Maps, ids: &[u32], nuclei: &[Region], cells: &[Cell], windows: &[Window], pixel_um: f64) {
        let pixels = maps.absorbance.len() as f64;
        let noise = empty_noise(maps);
        let noise_of = |f: &dyn Fn(&Noise) -> f64| noise.as_ref().map_or(f64::NAN, f);
        let covered = maps.smooth.iter().filter(|a| **a > COVERED).count() as f64;
        let outside = maps.smooth.iter().zip(ids).filter(|(a, id)| **a > COVERED && **id == 0);
        let cytoplasm = sorted(outside.map(|(a, _)| f64::from(*a)));
        let middle = of_sorted(&cytoplasm, 0.5);
        let layered = cytoplasm.iter().filter(|a| **a > OVERLAP * middle).count() as f64 / cytoplasm.len() as f64;
        let sigmas = sorted(maps.edges.iter().map(|e| e.sigma));
        let centres: Vec<[f64; 2]> = nuclei.iter().map(|n| n.shape().centre).collect();
        let (width, height) = (maps.width as f64, maps.height as f64);
        let um2 = pixel_um * pixel_um;
        let spectrum = rings(&maps.absorbance, maps.width);
        let of_cells = |f: &dyn Fn(&Cell) -> f64| middle_of(cells.iter().map(f));
        let profiles: Vec<[f64; PROFILE]> = cells.iter().map(|c| c.profile(maps)).collect();
        let [level, _, _, x2, _, y2] = maps.background.surface.0;
    }

    /// Mean light of the empty slide, grey levels of 255.
    background_dn: f64 = 255.0 * maps.background.mean(), "background, dn";
    /// Maximum minus minimum of the light of the empty slide, over its mean.
    background_valley: f64 = maps.background.peak_to_valley(), "background, peak to valley";
    /// Horizontal curvature c of the light, relative to the centre: level × (1 + c x²), x from −1 to 1.
    background_x2: f64 = x2 / level, "background, curvature across";
    /// Vertical curvature of the light.
    background_y2: f64 = y2 / level, "background, curvature down";
    /// Standard deviation of noise on empty slide, grey levels of 255.
    noise_dn: f64 = noise_of(&|n| n.variance.sqrt()), "noise, dn";
    /// Correlation of noise with the pixel to the right.
    noise_across: f64 = noise_of(&|n| n.correlation(0)), "noise correlation across";
    /// Correlation of noise with the pixel below.
    noise_down: f64 = noise_of(&|n| n.correlation(1)), "noise correlation down";
    /// Correlation of noise with the pixel below right.
    noise_diagonal: f64 = noise_of(&|n| n.correlation(2)), "noise correlation diagonally";
    /// Fraction of the field that is covered by objects.
    coverage: f64 = covered / pixels, "coverage";
    /// Median absorbance of the covered area without nuclei.
    covered_a: f64 = if cytoplasm.is_empty() { f64::NAN } else { middle }, "absorbance of what is covered";
    /// 90th over 10th percentile of the absorbance of the covered area without nuclei.
    covered_range: f64 = of_sorted(&cytoplasm, 0.9) / of_sorted(&cytoplasm, 0.1), "its 90th over its 10th percentile";
    /// Fraction of the covered area without nuclei whose absorbance exceeds 1.6 times the median: folds and overlaps.
    layered: f64 = layered, "part of it in layers";
    /// Exponent of the power spectrum of absorbance.
    spectrum_slope: f64 = slope(&spectrum), "slope of the spectrum";
    /// 10th percentile of the blur of edges, pixels.
    edge_sigma_p10: f64 = width_at(&sigmas, 0.1), "edge sigma p10, px";
    /// Median of the blur of edges, pixels.
    edge_sigma_p50: f64 = width_at(&sigmas, 0.5), "edge sigma p50, px";
    /// Nuclei per mm².
    nuclei_mm2: f64 = nuclei.len() as f64 / (pixels * um2) * 1e6, "nuclei a mm2";
    /// Mean distance to the nearest nucleus over that of random points.
    clark_evans: f64 = clark_evans(&centres, width, height), "Clark-Evans";
    /// Ripley's K of nuclei over that of random points, at [`RADII_UM`].
    #[serde(deserialize_with = "numbers")]
    ripley: [f64; 4] = RADII_UM.map(|r| ripley(&centres, width, height, r / pixel_um)), names RIPLEY;
    /// Median area of nuclei, µm².
    nucleus_um2: f64 = middle_of(nuclei.iter().map(|n| n.pixels.len() as f64 * um2)), "area of nuclei, um2";
    /// Number of free cells with one nucleus.
    cells: usize = cells.len();
    /// Median area of free cells, µm².
    cell_um2: f64 = of_cells(&|c| c.shape.area * um2), "area of free cells, um2";
    /// Median circularity of free cells.
    circularity: f64 = of_cells(&|c| c.shape.circularity), "circularity of free cells";
    /// Median solidity of free cells.
    solidity: f64 = of_cells(&|c| c.shape.solidity), "solidity of free cells";
    /// Mean number of corners of free cells.
    corners: f64 = cells.iter().map(|c| c.outline.corners).sum::<f64>() / cells.len() as f64, "corners of free cells";
    /// Median straight fraction of the outlines of free cells.
    straight: f64 = of_cells(&|c| c.outline.straight), "straight part of their outline";
    /// Median over free cells of the absorbance in ten rings from border to centre, over the median of the cell.
    #[serde(deserialize_with = "numbers")]
    profile: [f64; PROFILE] = std::array::from_fn(|i| middle_of(profiles.iter().map(|p| p[i])));
    /// Texture of cytoplasm in windows of 64 x 64 pixels inside cells, medians: natural logarithm of the power in eight
    /// frequency bands, skewness, kurtosis and correlation of band-pass responses.
    #[serde(deserialize_with = "numbers")]
    cytoplasm: [f64; TEXTURE] = medians(windows.iter()), names NAMES;
    /// Fractions of the field in bins of absorbance, from [`HISTOGRAM_FROM`] in steps of [`HISTOGRAM_STEP`].
    histogram: Vec<f64> = histogram(&maps.absorbance);
    /// Logarithm to base 10 of the power of absorbance in rings of [`frequencies`].
    #[serde(deserialize_with = "numbers")]
    spectrum: [f64; RINGS] = spectrum;
}

/// Identifiers of the values of [`Statistics::ripley`].
const RIPLEY: [&str; 4] =
    ["K over Poisson at 16.5 um", "K over Poisson at 33 um", "K over Poisson at 66 um", "K over Poisson at 99 um"];

/// Identifier and value of a statistic.
pub type Named = (&'static str, f64);

/// Minimum number of points of a point pattern.
const LEAST_POINTS: usize = 5;

/// Returns the mean distance to the nearest neighbour over that of as many random points (Clark and Evans,
/// doi:10.2307/1931034), with Donnelly's border correction: below 1 clustered, above 1 regular. NaN for fewer than 5
/// points.
#[must_use]
pub fn clark_evans(points: &[[f64; 2]], width: f64, height: f64) -> f64 {
    if points.len() < LEAST_POINTS {
        return f64::NAN;
    }
    let n = points.len() as f64;
    let nearest = |i: usize| {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, p)| distance(points[i], *p)).fold(f64::INFINITY, f64::min)
    };
    let observed = (0..points.len()).map(nearest).sum::<f64>() / n;
    let (area, border) = (width * height, 2.0 * (width + height));
    observed / (0.5 * (area / n).sqrt() + (0.0514 + 0.041 / n.sqrt()) * border / n)
}

/// Returns Ripley's K over that of random points, πr², with the translation correction: above 1 clustered. NaN for
/// fewer than 5 points.
#[must_use]
pub fn ripley(points: &[[f64; 2]], width: f64, height: f64, radius: f64) -> f64 {
    if points.len() < LEAST_POINTS {
        return f64::NAN;
    }
    let area = width * height;
    let mut sum = 0.0;
    for (i, a) in points.iter().enumerate() {
        for b in &points[i + 1..] {
            if distance(*a, *b) <= radius {
                // Translation correction: the area of positions at which this pair fits into the field.
                let fits = (width - (a[0] - b[0]).abs()).max(1.0) * (height - (a[1] - b[1]).abs()).max(1.0);
                sum += 2.0 * area / fits;
            }
        }
    }
    let n = points.len() as f64;
    area / (n * (n - 1.0)) * sum / (PI * radius * radius)
}

/// Returns the median of the finite values; NaN for none.
fn middle_of(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    if values.is_empty() { f64::NAN } else { median(&mut values) }
}

fn histogram(absorbance: &[f32]) -> Vec<f64> {
    let mut counts = vec![0.0; HISTOGRAM];
    for a in absorbance {
        counts[whole((f64::from(*a) - HISTOGRAM_FROM) / HISTOGRAM_STEP).min(HISTOGRAM - 1)] += 1.0;
    }
    counts.iter().map(|c| c / absorbance.len() as f64).collect()
}

/// Returns the noise of the empty slide, or of the flattest 1/30 of the field if there is no empty slide.
pub(super) fn empty_noise(maps: &Maps) -> Option<Noise> {
    const LEAST: usize = 8;
    const FLATTEST: f64 = 1.0 / 30.0;
    let places: Vec<[usize; 2]> = blocks([0, 0], [maps.width, maps.height]).collect();
    let empty = |[x, y]: &&[usize; 2]| {
        (*y..y + BLOCK).all(|y| maps.smooth[y * maps.width + x..][..BLOCK].iter().all(|a| a.abs() < EMPTY))
    };
    let noise = |at: &[usize; 2]| Noise::of(&maps.grey, maps.width, *at);
    let mut blocks: Vec<Noise> = places.iter().filter(empty).map(noise).collect();
    if blocks.len() < LEAST {
        blocks = places.iter().map(noise).collect();
        blocks.sort_by(|a, b| a.variance.total_cmp(&b.variance));
        blocks.truncate(nearest(FLATTEST * places.len() as f64).max(1));
    }
    Noise::mean(&mut blocks)
}

/// Reads null as NaN, because JSON has no NaN.
fn number<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Option::<f64>::deserialize(from).map(|v| v.unwrap_or(f64::NAN))
}

fn numbers<'de, D: serde::Deserializer<'de>, const N: usize>(from: D) -> Result<[f64; N], D::Error> {
    let values = Vec::<Option<f64>>::deserialize(from)?;
    let values: Vec<f64> = values.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect();
    let count = values.len();
    values.try_into().map_err(|_| serde::de::Error::invalid_length(count, &"the length of the array in the report"))
}

/// Size of the windows whose spectra are averaged, pixels.
const SIDE: usize = 256;

/// Number of frequency rings, each half an octave wide.
const RINGS: usize = 12;

/// Lower limit of the lowest ring, cycles per pixel.
const LOWEST: f64 = 1.0 / 128.0;

/// Range of frequencies of the slope, cycles per pixel: between complete cells and noise.
const MEASURED: [f64; 2] = [0.02, 0.15];

/// Returns the centre of each ring, cycles per pixel.
#[must_use]
pub fn frequencies() -> [f64; RINGS] {
    std::array::from_fn(|i| LOWEST * libm::exp2((i as f64 + 0.5) / 2.0))
}

/// Returns the mean power in each ring, as a logarithm to base 10, over Hann windows; NaN if a ring contains no
/// frequency.
fn rings(image: &[f32], width: usize) -> [f64; RINGS] {
    let height = image.len() / width;
    // The largest power of two that fits. Windows do not overlap.
    let side = [SIDE, width, height].into_iter().min().unwrap_or(1);
    let side = if side.is_power_of_two() { side } else { side.next_power_of_two() / 2 };
    let transform = FftPlannerScalar::new().plan_fft_forward(side);
    let rim: Vec<f32> =
        (0..side).map(|i| single(0.5 - 0.5 * libm::cos(2.0 * PI * (i as f64 + 0.5) / side as f64))).collect();
    let (mut sums, mut counts) = ([0.0; RINGS], [0.0; RINGS]);
    for top in (0..=height - side).step_by(side) {
        for left in (0..=width - side).step_by(side) {
            let power = power(&|x, y| image[(top + y) * width + left + x], side, &rim, &transform);
            add(&power, side, &mut sums, &mut counts);
        }
    }
    std::array::from_fn(|i| if counts[i] > 0.0 { libm::log10((sums[i] / counts[i]).max(1e-12)) } else { f64::NAN })
}

/// Returns |F|² of a window, normalised so that the mean over all frequencies is the variance.
fn power(at: &dyn Fn(usize, usize) -> f32, side: usize, rim: &[f32], transform: &Arc<dyn Fft<f32>>) -> Vec<f32> {
    let mean = (0..side).flat_map(|y| (0..side).map(move |x| (x, y))).map(|(x, y)| f64::from(at(x, y))).sum::<f64>()
        / (side * side) as f64;
    let mut rows: Vec<Complex32> = (0..side)
        .flat_map(|y| (0..side).map(move |x| (x, y)))
        .map(|(x, y)| Complex32::new((at(x, y) - single(mean)) * rim[x] * rim[y], 0.0))
        .collect();
    transform.process(&mut rows);
    let mut columns: Vec<Complex32> = (0..side).flat_map(|x| rows[x..].iter().step_by(side).copied()).collect();
    transform.process(&mut columns);
    let weight: f32 = rim.iter().map(|r| r * r).sum();
    columns.iter().map(|c| c.norm_sqr() / (weight * weight)).collect()
}

fn add(power: &[f32], side: usize, sums: &mut [f64; RINGS], counts: &mut [f64; RINGS]) {
    let frequency = |i: usize| i.min(side - i) as f64 / side as f64;
    for (i, value) in power.iter().enumerate() {
        let (u, v) = (frequency(i % side), frequency(i / side));
        let ring = 2.0 * libm::log2((u * u + v * v).sqrt().max(1e-9) / LOWEST);
        if ring >= 0.0 && whole(ring) < RINGS {
            sums[whole(ring)] += f64::from(*value);
            counts[whole(ring)] += 1.0;
        }
    }
}

/// Returns the exponent of the power law through the rings in the range of the slope.
fn slope(rings: &[f64; RINGS]) -> f64 {
    let known = frequencies().into_iter().zip(*rings);
    let (x, y): (Vec<f64>, Vec<f64>) = known
        .filter(|(f, p)| *f >= MEASURED[0] && *f <= MEASURED[1] && p.is_finite())
        .map(|(f, p)| (libm::log10(f), p))
        .unzip();
    line_slope(&x, &y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::{deviation, mean};
    use portable_numerics::random::below;
    use rand_core::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    fn random(count: usize, rng: &mut Xoshiro256PlusPlus) -> Vec<[f64; 2]> {
        (0..count).map(|_| [below(128_000, rng) as f64 / 100.0, below(96_000, rng) as f64 / 100.0]).collect()
    }

    #[test]
    fn clark_evans_and_ripley_of_random_points_are_1() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
        let fields: Vec<Vec<[f64; 2]>> = (0..300).map(|_| random(29, &mut rng)).collect();
        let check = |values: Vec<f64>, what: &str| {
            let error = deviation(&values) / (values.len() as f64).sqrt();
            assert!((mean(&values) - 1.0).abs() < 3.5 * error + 0.005, "{what}: {} ± {error}", mean(&values));
        };
        check(fields.iter().map(|p| clark_evans(p, 1280.0, 960.0)).collect(), "Clark-Evans");
        for radius in [50.0, 100.0, 200.0, 300.0] {
            check(fields.iter().map(|p| ripley(p, 1280.0, 960.0, radius)).collect(), "K");
        }
    }

    #[test]
    fn lattices_are_regular_and_pairs_are_clustered() {
        let lattice: Vec<[f64; 2]> =
            (0..48).map(|i| [80.0 + 160.0 * f64::from(i % 8), 80.0 + 160.0 * f64::from(i / 8)]).collect();
        assert!(clark_evans(&lattice, 1280.0, 960.0) > 1.8);
        assert_eq!(ripley(&lattice, 1280.0, 960.0, 100.0), 0.0);
        let pairs: Vec<[f64; 2]> = lattice.iter().flat_map(|p| [*p, [p[0] + 5.0, p[1]]]).collect();
        assert!(clark_evans(&pairs, 1280.0, 960.0) < 0.1);
        assert!(ripley(&pairs, 1280.0, 960.0, 20.0) > 5.0);
        assert!(clark_evans(&lattice[..4], 1280.0, 960.0).is_nan() && ripley(&[], 1.0, 1.0, 1.0).is_nan());
    }

    #[test]
    fn the_spectrum_of_white_noise_is_its_variance() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
        // Uniform over ±1: variance 1/3.
        let image: Vec<f32> = (0..512 * 256).map(|_| single(below(200_001, &mut rng) as f64 / 1e5 - 1.0)).collect();
        let rings = rings(&image, 512);
        // These rings have 300 coefficients or more: a standard error of 6 % or less.
        for ring in &rings[6..] {
            assert!((ring - libm::log10(1.0 / 3.0)).abs() < 0.08, "{rings:?}");
        }
        assert!(slope(&rings).abs() < 0.15);
    }

    #[test]
    fn the_power_of_a_wave_is_in_the_ring_of_its_frequency() {
        let image: Vec<f32> =
            (0..256 * 256).map(|i| single(libm::sin(std::f64::consts::TAU * 0.11 * (i % 256) as f64))).collect();
        let rings = rings(&image, 256);
        let loudest = (0..RINGS).max_by(|a, b| rings[*a].total_cmp(&rings[*b])).unwrap();
        let middle = frequencies()[loudest];
        assert!(middle / 0.11 < libm::exp2(0.25) && 0.11 / middle < libm::exp2(0.25), "{middle}");
    }

    #[test]
    fn the_slope_of_a_power_law_is_its_exponent() {
        let rings = frequencies().map(|f| 1.5 - 3.2 * libm::log10(f));
        assert!((slope(&rings) + 3.2).abs() < 1e-9);
        assert!(slope(&[f64::NAN; RINGS]).is_nan());
    }
}
