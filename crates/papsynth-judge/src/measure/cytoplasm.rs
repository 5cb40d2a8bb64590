//! Texture of cytoplasm: windows that lie inside cells, outside nuclei.

use std::f64::consts::TAU;

use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlannerScalar};

use super::maps::Maps;
use crate::filter::blur;
use crate::number::single;
use crate::statistics::quantile;

/// Side of a window, pixels.
const SIDE: usize = 64;

/// Distance between windows, pixels.
const STEP: usize = 32;

/// Distance of a window from nuclei, pixels.
const MARGIN: usize = 8;

/// Range of the absorbance of cytoplasm after a Gaussian of [`SMOOTHING`] pixels.
const CYTOPLASM: [f32; 2] = [0.035, 0.45];

/// Smoothing of the absorbance that is compared with [`CYTOPLASM`], pixels.
const SMOOTHING: f64 = 3.0;

/// Grey level of the empty slide in spectra.
const EMPTY: f64 = 229.0;

/// Frequency bands of the power spectrum, cycles per pixel.
const BANDS: [[f64; 2]; 8] =
    [[0.005, 0.02], [0.02, 0.04], [0.04, 0.08], [0.08, 0.12], [0.12, 0.18], [0.18, 0.25], [0.25, 0.35], [0.35, 0.5]];

/// Number of band-pass images whose responses are measured, at 1, 2 and 4 pixels.
const SCALES: usize = 3;

/// Number of measurements of a window.
pub const TEXTURE: usize = BANDS.len() + 2 * SCALES + SCALES - 1;

/// Identifiers of the values of [`Statistics::cytoplasm`](super::Statistics::cytoplasm).
pub const NAMES: [&str; TEXTURE] = [
    "cytoplasm power at 0.005-0.02 cycles/px",
    "cytoplasm power at 0.02-0.04 cycles/px",
    "cytoplasm power at 0.04-0.08 cycles/px",
    "cytoplasm power at 0.08-0.12 cycles/px",
    "cytoplasm power at 0.12-0.18 cycles/px",
    "cytoplasm power at 0.18-0.25 cycles/px",
    "cytoplasm power at 0.25-0.35 cycles/px",
    "cytoplasm power at 0.35-0.5 cycles/px",
    "cytoplasm skewness at 1 px",
    "cytoplasm skewness at 2 px",
    "cytoplasm skewness at 4 px",
    "cytoplasm kurtosis at 1 px",
    "cytoplasm kurtosis at 2 px",
    "cytoplasm kurtosis at 4 px",
    "cytoplasm correlation of 1 with 2 px",
    "cytoplasm correlation of 2 with 4 px",
];

/// A window inside cells.
pub(crate) struct Window {
    /// Column and row of the centre, pixels.
    pub(super) centre: [usize; 2],
    /// Natural logarithms of the mean power in [`BANDS`], of grey levels relative to an empty slide of [`EMPTY`], after
    /// a Hann window; then skewness and kurtosis of the band-pass responses, and correlations of their magnitudes
    /// between neighbouring scales.
    values: [f64; TEXTURE],
}

/// Returns the windows of a field. `ids` are the numbers of nuclei, 0 elsewhere.
pub(crate) fn windows(maps: &Maps, ids: &[u32]) -> Vec<Window> {
    let width = maps.width;
    let spectrum = Spectrum::new();
    // Variances add: `smoother` has a Gaussian of 2 pixels.
    let smooth = blur(&maps.smoother, width, (SMOOTHING * SMOOTHING - 4.0).sqrt());
    let starts = |length: usize| (0..(length + 1).saturating_sub(SIDE)).step_by(STEP);
    let places = starts(maps.height).flat_map(|top| starts(width).map(move |left| [left, top]));
    let inside = |[left, top]: &[usize; 2]| {
        let rows = |margin: usize| top.saturating_sub(margin)..(top + SIDE + margin).min(maps.height);
        let row = |y: usize, margin: usize| {
            y * width + left.saturating_sub(margin)..y * width + (left + SIDE + margin).min(width)
        };
        rows(0).all(|y| smooth[row(y, 0)].iter().all(|a| (CYTOPLASM[0]..=CYTOPLASM[1]).contains(a)))
            && rows(MARGIN).all(|y| ids[row(y, MARGIN)].iter().all(|id| *id == 0))
    };
    let measured = |place: [usize; 2]| Window {
        centre: place.map(|at| at + SIDE / 2),
        values: std::array::from_fn({
            let power = spectrum.of(maps, place);
            let shape = shape(maps, place);
            move |i| if i < BANDS.len() { power[i] } else { shape[i - BANDS.len()] }
        }),
    };
    places.filter(inside).map(measured).collect()
}

/// Returns the medians of the measurements; NaN without windows.
pub(super) fn medians<'a>(windows: impl Iterator<Item = &'a Window>) -> [f64; TEXTURE] {
    let windows: Vec<&Window> = windows.collect();
    std::array::from_fn(|i| {
        let mut values: Vec<f64> = windows.iter().map(|w| w.values[i]).collect();
        if values.is_empty() { f64::NAN } else { quantile(&mut values, 0.5) }
    })
}

/// The power spectrum of a window.
struct Spectrum {
    fft: std::sync::Arc<dyn Fft<f32>>,
    hann: Vec<f32>,
    /// Band of each frequency, and the number of frequencies of each band.
    bands: Vec<Option<usize>>,
    counts: [f64; BANDS.len()],
}

impl Spectrum {
    fn new() -> Self {
        let hann = |i: usize| single(0.5 - 0.5 * libm::cos(TAU * i as f64 / (SIDE - 1) as f64));
        let frequency = |i: usize| i.min(SIDE - i) as f64 / SIDE as f64;
        let band = |i: usize| {
            let radius = libm::hypot(frequency(i % SIDE), frequency(i / SIDE));
            BANDS.iter().position(|[from, to]| radius >= *from && radius < *to)
        };
        let bands: Vec<Option<usize>> = (0..SIDE * SIDE).map(band).collect();
        let counts = std::array::from_fn(|band| bands.iter().filter(|b| **b == Some(band)).count() as f64);
        Self { fft: FftPlannerScalar::new().plan_fft_forward(SIDE), hann: (0..SIDE).map(hann).collect(), bands, counts }
    }

    /// Returns the logarithms of the mean power in the bands.
    fn of(&self, maps: &Maps, [left, top]: [usize; 2]) -> [f64; BANDS.len()] {
        let grey = |i: usize| {
            let absorbance = maps.absorbance[(top + i / SIDE) * maps.width + left + i % SIDE];
            single(EMPTY * libm::exp10(-f64::from(absorbance)))
        };
        let greys: Vec<f32> = (0..SIDE * SIDE).map(grey).collect();
        let mean = greys.iter().sum::<f32>() / (SIDE * SIDE) as f32;
        let weighted =
            |(i, grey): (usize, &f32)| Complex32::new((grey - mean) * self.hann[i % SIDE] * self.hann[i / SIDE], 0.0);
        let mut values: Vec<Complex32> = greys.iter().enumerate().map(weighted).collect();
        self.fft.process(&mut values);
        let mut columns: Vec<Complex32> = (0..SIDE * SIDE).map(|i| values[i % SIDE * SIDE + i / SIDE]).collect();
        self.fft.process(&mut columns);
        // The bands are isotropic, so the transposed spectrum serves as well.
        let mut sums = [0.0; BANDS.len()];
        for (value, band) in columns.iter().zip(&self.bands) {
            if let Some(band) = band {
                sums[*band] += f64::from(value.norm_sqr());
            }
        }
        std::array::from_fn(|band| libm::log((sums[band] / self.counts[band]).max(1e-9)))
    }
}

/// Returns skewness and kurtosis of the band-pass responses, then the correlations of their magnitudes.
fn shape(maps: &Maps, [left, top]: [usize; 2]) -> [f64; TEXTURE - BANDS.len()] {
    let response = |scale: usize| -> Vec<f64> {
        let (band, width) = &maps.bands[scale];
        let side = SIDE >> scale;
        let row = |y: usize| &band[((top >> scale) + y) * width + (left >> scale)..][..side];
        (0..side).flat_map(row).map(|v| f64::from(*v)).collect()
    };
    let responses: [Vec<f64>; SCALES] = std::array::from_fn(response);
    let mut found = [0.0; TEXTURE - BANDS.len()];
    for (scale, values) in responses.iter().enumerate() {
        let mean = |power: &dyn Fn(f64) -> f64| values.iter().map(|v| power(*v)).sum::<f64>() / values.len() as f64;
        let variance = mean(&|v| v * v).max(1e-18);
        found[scale] = mean(&|v| v * v * v) / (variance * variance.sqrt());
        found[SCALES + scale] = mean(&|v| v * v * v * v) / (variance * variance);
    }
    for scale in 1..SCALES {
        let (fine, coarse) = (&responses[scale - 1], &responses[scale]);
        let side = SIDE >> scale;
        let of_fine = |i: usize| {
            let at = 2 * (i / side) * 2 * side + 2 * (i % side);
            [at, at + 1, at + 2 * side, at + 2 * side + 1].iter().map(|i| fine[*i].abs()).sum::<f64>()
        };
        let fine: Vec<f64> = (0..side * side).map(of_fine).collect();
        let coarse: Vec<f64> = coarse.iter().map(|v| v.abs()).collect();
        found[2 * SCALES + scale - 1] = correlation(&fine, &coarse);
    }
    found
}

/// Returns the correlation of two series; 0 if one is constant.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let [mean_a, mean_b] = [a, b].map(|v| v.iter().sum::<f64>() / n);
    let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, b - mean_b);
        (aa, bb, ab) = (aa + a * a, bb + b * b, ab + a * b);
    }
    if aa > 0.0 && bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::whole;
    use portable_numerics::random::normal;
    use rand_xoshiro::Xoshiro256PlusPlus;
    use rand_xoshiro::rand_core::SeedableRng;

    /// Returns the maps of a cell of this absorbance with an empty margin.
    fn cell(mut absorbance: impl FnMut(f64, f64) -> f64) -> Maps {
        let absorbance: Vec<f64> = (0..320 * 256)
            .map(|i| (f64::from(i % 320), f64::from(i / 320)))
            .map(|(x, y)| if x < 90.0 { 0.0 } else { absorbance(x, y) })
            .collect();
        Maps::drawn(320, 256, |x, y| 240.0 * libm::exp10(-absorbance[whole(y) * 320 + whole(x)]))
    }

    #[test]
    fn windows_lie_inside_cells_and_outside_nuclei() {
        let maps = cell(|x, y| 0.2 + 0.01 * libm::sin(0.9 * x + 0.4 * y));
        let mut ids = vec![0; 320 * 256];
        let all = windows(&maps, &ids);
        assert!(!all.is_empty() && all.iter().all(|w| w.centre[0] >= 90 + SIDE / 2), "{}", all.len());
        ids[100 * 320 + 200] = 1;
        let clear = windows(&maps, &ids);
        let distance = |w: &Window| w.centre[0].abs_diff(200).max(w.centre[1].abs_diff(100));
        assert!(clear.len() < all.len() && clear.iter().all(|w| distance(w) >= SIDE / 2 + MARGIN - 1));
        assert_eq!(windows(&cell(|_, _| 0.9), &vec![0; 320 * 256]).len(), 0);
    }

    #[test]
    fn the_spectrum_equals_a_slow_transform() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        let maps = cell(|_, _| 0.2 + 0.02 * normal(&mut rng));
        let place = [140, 60];
        let grey = |x: usize, y: usize| {
            EMPTY * libm::exp10(-f64::from(maps.absorbance[(place[1] + y) * maps.width + place[0] + x]))
        };
        let mean = (0..SIDE * SIDE).map(|i| grey(i % SIDE, i / SIDE)).sum::<f64>() / (SIDE * SIDE) as f64;
        let hann = |i: usize| 0.5 - 0.5 * libm::cos(TAU * i as f64 / 63.0);
        let weighted: Vec<f64> =
            (0..SIDE * SIDE).map(|i| (grey(i % SIDE, i / SIDE) - mean) * hann(i % SIDE) * hann(i / SIDE)).collect();
        let power = |u: i32, v: i32| {
            let (mut re, mut im) = (0.0, 0.0);
            for (i, value) in weighted.iter().enumerate() {
                let angle = TAU * (f64::from(u) * (i % SIDE) as f64 + f64::from(v) * (i / SIDE) as f64) / 64.0;
                (re, im) = (re + value * libm::cos(angle), im + value * libm::sin(angle));
            }
            re * re + im * im
        };
        // The third band: 2.56 to 5.12 cycles per window.
        let mut slow = Vec::new();
        for u in -5_i32..=5 {
            for v in -5_i32..=5 {
                if (BANDS[2][0]..BANDS[2][1]).contains(&(libm::hypot(f64::from(u), f64::from(v)) / 64.0)) {
                    slow.push(power(u, v));
                }
            }
        }
        let expected = libm::log(slow.iter().sum::<f64>() / slow.len() as f64);
        let found = Spectrum::new().of(&maps, place)[2];
        assert!((found - expected).abs() < 1e-3, "{found} {expected}");
    }

    #[test]
    fn spots_are_sparse_and_coincide_across_scales() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
        let noise = cell(|_, _| 0.2 + 0.01 * normal(&mut rng));
        let spot = |x: f64, y: f64| libm::exp(-0.5 * (x * x + y * y) / 2.0);
        let spots = cell(|x, y| 0.1 + 0.1 * spot(x % 16.0 - 8.0, y % 16.0 - 8.0));
        let texture = |maps: &Maps| medians(windows(maps, &vec![0; 320 * 256]).iter());
        let (noise, spots) = (texture(&noise), texture(&spots));
        let at = |name: &str| NAMES.iter().position(|n| *n == name).unwrap();
        let (kurtosis, coincidence) = (at("cytoplasm kurtosis at 2 px"), at("cytoplasm correlation of 1 with 2 px"));
        assert!((noise[kurtosis] - 3.0).abs() < 0.3 && spots[kurtosis] > 5.0, "{noise:?} {spots:?}");
        assert!(noise[coincidence].abs() < 0.35 && spots[coincidence] > 0.6, "{noise:?} {spots:?}");
        assert!(spots[at("cytoplasm skewness at 2 px")] > 1.0);
    }
}
