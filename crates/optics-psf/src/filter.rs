use core::f64::consts::TAU;

use multiversion::multiversion;
use num_complex::Complex32;

use crate::Microscope;
use crate::lane_plane::{LANES, Lanes};
use crate::transfer::{ASYMMETRIC_SAMPLES, Transfer, corners, fade};

/// Defocus in µm of mountant up to which the in-focus correction has full weight, and from which it has none. Its
/// effect is small at 1 µm and zero from 2 µm on, where the camera's lattice may be used.
const CORRECTED_UM: [f64; 2] = [1.0, 2.0];

/// Fraction of the correction lost at a full condenser aperture, where twice-scattered light interferes less. Fitted to
/// Abbe images of discs, specks and nuclei.
const SCATTERED_APART: f64 = 0.4;

/// Start of the taper of the correction's spectrum, as a fraction of the cutoff. A sharp cut would ring at edges.
const TAPER_FROM: f64 = 0.75;

/// Largest transfer at sub-pixel frequencies for which the camera's lattice is used.
const SMOOTH_TRANSFER: f64 = 0.05;

/// Smallest divisor of the restoring filter. Weaker frequencies of an image are mostly noise.
const LEAST_TRANSFER: f32 = 0.1;

/// Sampling lattice of a transmission factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Lattice {
    /// The object's lattice, with [`oversampling`](crate::MicroscopeParams::oversampling) samples per pixel side.
    Object,
    /// The camera's lattice; each value is the mean over a pixel.
    #[default]
    Camera,
}

/// Filter of one depth and stage position.
#[derive(Debug, Clone)]
pub(crate) struct Filter {
    pub(crate) lattice: Lattice,
    /// Whether the in-focus correction is applied.
    pub(crate) is_corrected: bool,
    response: Response,
    restores: bool,
}

/// (H_A, H_P, G), or (H_A, –, H_A in focus) for a restoring filter.
#[derive(Debug, Clone)]
enum Response {
    Round(Box<[Table; 3]>),
    Sided(Vec<[Complex32; 3]>),
}

/// Entries of a table. A power of two makes bounds checks unnecessary.
const ENTRIES: usize = 512;

/// Values at multiples of a frequency, each with the difference to the next, padded with zeros.
type Table = [[f32; 2]; ENTRIES];

/// The three responses of a filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// H_A, the response to absorption.
    Absorption,
    /// H_P, the response to phase delay.
    Phase,
    /// −G, the in-focus correction; the sign converts transmitted to absorbed light.
    Correction,
}

/// Frequencies of a block of a spectrum, in steps of the filter's table, and the transfer of the pixel mean.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Block<'a> {
    /// Frequency step along x.
    pub(crate) step_x: f32,
    /// Frequencies along y of the lanes.
    pub(crate) y: &'a [f32; LANES],
    /// Transfer of the pixel mean along x, from frequency 0.
    pub(crate) pixel_x: &'a [f32],
    pub(crate) pixel_y: &'a [f32; LANES],
}

impl Filter {
    /// Creates the filter of a depth and stage position. `transfer` belongs to the same depth.
    pub(crate) fn new(microscope: &Microscope, depth_um: f64, stage_um: f64, transfer: &Transfer) -> Self {
        let params = microscope.params();
        let defocus = microscope.defocus_um(depth_um, stage_um).abs();
        let [whole, gone] = CORRECTED_UM;
        let coherent = 1.0 - SCATTERED_APART * incoherence(params.condenser_na / params.na);
        let weight = coherent * fade((defocus - whole) / (gone - whole));
        let (radius, cutoff) = (microscope.cone_radius_um(depth_um, stage_um), microscope.cutoff());
        let nyquist = 0.5 / params.pixel_um;
        let is_smooth = params.oversampling > 1 && defocus >= gone && transfer.extent(SMOOTH_TRANSFER) <= nyquist;
        let lattice = if is_smooth { Lattice::Camera } else { Lattice::Object };
        let correction =
            |f: f64| -weight * pillbox(TAU * f * radius) * fade((f / cutoff - TAPER_FROM) / (1.0 - TAPER_FROM));
        let correction = |f: f64| if weight > 0.0 { correction(f) } else { 0.0 };
        let response = Response::new(transfer, correction);
        Self { lattice, is_corrected: weight > 0.0, response, restores: false }
    }

    /// Returns the filter of the in-focus transfer function, without correction.
    pub(crate) fn in_focus(microscope: &Microscope) -> Self {
        let response = Response::new(&Transfer::new(microscope, 0.0, 0.0), |_| 0.0);
        Self { lattice: Lattice::Object, is_corrected: false, response, restores: false }
    }

    /// Turns the filter into one for objects that were already imaged in focus, through `in_focus` and the camera
    /// pixels.
    pub(crate) fn restore(&mut self, in_focus: &Self) {
        match (&mut self.response, &in_focus.response) {
            (Response::Round(tables), Response::Round(focused)) => tables[2] = focused[0],
            (Response::Sided(table), Response::Sided(focused)) => {
                for (entry, focused) in table.iter_mut().zip(focused) {
                    entry[2] = focused[0];
                }
            }
            _ => unreachable!("filters of one microscope have the same shape"),
        }
        (self.is_corrected, self.restores) = (false, true);
    }

    /// Adds a block of a spectrum times a response to `sum`, for kx from −`reach` to `reach`. Negative kx are at the
    /// end of both slices.
    pub(crate) fn add(&self, part: Part, at: Block<'_>, spectrum: &[Lanes], reach: usize, sum: &mut [Lanes]) {
        match &self.response {
            Response::Round(tables) if self.restores => {
                add_restored(&tables[part as usize], &tables[2], at, spectrum, reach, sum);
            }
            Response::Round(tables) => add_round(&tables[part as usize], at, spectrum, reach, sum),
            Response::Sided(table) => {
                let [from_end, to_end] = [spectrum.len(), sum.len()];
                let mut one = |from: usize, to: usize, x: f32, pixel_x: f32| {
                    for l in 0..LANES {
                        let entry = sided(table, x, at.y[l]);
                        let mut weight = entry[part as usize];
                        if self.restores {
                            let in_focus = entry[2] * (pixel_x * at.pixel_y[l]);
                            let size = in_focus.norm_sqr().sqrt();
                            weight =
                                weight * in_focus.conj() / (size * size.max(LEAST_TRANSFER)).max(f32::MIN_POSITIVE);
                        }
                        let value = Complex32::new(spectrum[from][0][l], spectrum[from][1][l]) * weight;
                        sum[to][0][l] += value.re;
                        sum[to][1][l] += value.im;
                    }
                };
                for k in 0..=reach {
                    let (x, pixel_x) = (k as f32 * at.step_x, at.pixel_x[k]);
                    one(k, k, x, pixel_x);
                    if k > 0 {
                        one(from_end - k, to_end - k, -x, pixel_x);
                    }
                }
            }
        }
    }
}

#[multiversion(targets = "simd")]
fn add_round(table: &Table, at: Block<'_>, spectrum: &[Lanes], reach: usize, sum: &mut [Lanes]) {
    let y2 = at.y.map(|y| y * y);
    for k in 0..=reach {
        accumulate(&entries(table, k, at.step_x, &y2), k, spectrum, sum);
    }
}

/// Divides by the in-focus transfer of lens and pixels.
#[multiversion(targets = "simd")]
fn add_restored(table: &Table, focused: &Table, at: Block<'_>, spectrum: &[Lanes], reach: usize, sum: &mut [Lanes]) {
    let y2 = at.y.map(|y| y * y);
    for k in 0..=reach {
        let mut weights = entries(table, k, at.step_x, &y2);
        let in_focus = entries(focused, k, at.step_x, &y2);
        for ((weight, in_focus), pixel_y) in weights.iter_mut().zip(&in_focus).zip(at.pixel_y) {
            *weight /= (in_focus * at.pixel_x[k] * pixel_y).max(LEAST_TRANSFER);
        }
        accumulate(&weights, k, spectrum, sum);
    }
}

#[inline(always)]
fn accumulate(weights: &[f32; LANES], k: usize, spectrum: &[Lanes], sum: &mut [Lanes]) {
    let [last_from, last_to] = [spectrum.len() - k, sum.len() - k];
    weigh(weights, &spectrum[k], &mut sum[k]);
    if k > 0 {
        weigh(weights, &spectrum[last_from], &mut sum[last_to]);
    }
}

#[inline(always)]
fn weigh(weights: &[f32; LANES], from: &Lanes, to: &mut Lanes) {
    for (to, from) in to.iter_mut().zip(from) {
        for ((to, from), weight) in to.iter_mut().zip(from).zip(weights) {
            *to += from * weight;
        }
    }
}

/// Returns table values for a block, by linear interpolation.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "indices of the table")]
fn entries(table: &Table, k: usize, step_x: f32, y2: &[f32; LANES]) -> [f32; LANES] {
    let x = k as u32 as f32 * step_x;
    let x2 = x * x;
    // Signed integers convert faster.
    let mut places = [0_i32; LANES];
    let mut parts = [0.0; LANES];
    for ((place, part), y2) in places.iter_mut().zip(&mut parts).zip(y2) {
        let position = (x2 + y2).sqrt().min((ENTRIES - 1) as f32);
        *place = position as i32;
        *part = position - *place as f32;
    }
    let mut values = [0.0; LANES];
    for ((value, place), part) in values.iter_mut().zip(&places).zip(&parts) {
        let [from, rise] = table[*place as usize % ENTRIES];
        *value = from + part * rise;
    }
    values
}

/// Returns the three responses at a frequency.
#[expect(clippy::cast_possible_truncation, reason = "spectra use single precision")]
fn sided(table: &[[Complex32; 3]], x: f32, y: f32) -> [Complex32; 3] {
    let mut mixed = [Complex32::ZERO; 3];
    for (place, weight) in corners([x, y].map(f64::from)).into_iter().flatten() {
        for (sum, value) in mixed.iter_mut().zip(&table[place]) {
            *sum += value * weight as f32;
        }
    }
    mixed
}

impl Response {
    #[expect(clippy::cast_possible_truncation, reason = "spectra use single precision")]
    fn new(transfer: &Transfer, correction: impl Fn(f64) -> f64) -> Self {
        let list = transfer.table.iter().enumerate();
        if transfer.is_round() {
            let mut tables = Box::new([[[0.0; 2]; ENTRIES]; 3]);
            for (i, &[absorption, phase]) in list {
                let values = [absorption[0], phase[0], correction(transfer.step * i as f64)];
                tables.iter_mut().zip(values).for_each(|(table, value)| table[i][0] = value as f32);
            }
            for table in tables.iter_mut() {
                for i in 0..transfer.table.len() {
                    table[i][1] = table[i + 1][0] - table[i][0];
                }
            }
            return Self::Round(tables);
        }
        let complex = |[re, im]: [f64; 2]| Complex32::new(re as f32, im as f32);
        let entry = |(i, &[absorption, phase]): (usize, &[[f64; 2]; 2])| {
            let correction = correction(transfer.step * (i % ASYMMETRIC_SAMPLES) as f64);
            [complex(absorption), complex(phase), complex([correction, 0.0])]
        };
        Self::Sided(list.map(entry).collect())
    }
}

/// Rises from 0 for a narrow condenser to 1 for one opened to the objective's aperture: 0.04 at a ratio of 0.6, 0.2 at
/// 0.8.
pub(crate) fn incoherence(ratio: f64) -> f64 {
    let r = ratio.min(1.0);
    let cube = r * r * r;
    cube * cube * r
}

/// Returns the spectrum of a disc, 2 J₁(q)/q.
pub(crate) fn pillbox(q: f64) -> f64 {
    /// Range of the power series ∑ (−q²/4)ᵏ / k! (k + 1)!: it loses less than half of the digits, and 20 terms suffice.
    const SERIES_TO: f64 = 8.0;
    const SERIES: [f64; 20] = {
        let mut terms = [1.0; 20];
        let mut k = 1;
        while k < terms.len() {
            terms[k] = -terms[k - 1] / (k * (k + 1)) as f64;
            k += 1;
        }
        terms
    };
    if q > SERIES_TO {
        return 2.0 * libm::j1(q) / q;
    }
    let t = 0.25 * q * q;
    SERIES.iter().rev().fold(0.0, |sum, term| sum * t + term)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pillbox_matches_the_bessel_function() {
        assert_eq!(pillbox(0.0), 1.0);
        for i in 1..2000 {
            let q = 0.01 * f64::from(i);
            assert!((pillbox(q) - 2.0 * libm::j1(q) / q).abs() < 1e-11, "{q}");
        }
    }
}
