use core::f64::consts::TAU;

use multiversion::multiversion;
use num_complex::Complex32;

use crate::Microscope;
use crate::lane_plane::{LANES, Lanes};
use crate::transfer::{SIDED_SAMPLES, Transfer, corners, fade};

/// Up to this distance from focus, and from that one on, µm of mountant: the correction of the in-focus form is whole, and
/// gone. It gains little at 1 µm and nothing from 2 µm on, where the camera's lattice may serve.
const CORRECTED_UM: [f64; 2] = [1.0, 2.0];

/// The part of the correction that is lost under a full aperture. It says how light that is scattered twice interferes,
/// and there much of it does not; fitted to Abbe's images of discs, specks and nuclei.
const SCATTERED_APART: f64 = 0.4;

/// Where the spectrum of the correction begins to fade, as a part of the cutoff: a step would ring around sharp things.
const TAPER_FROM: f64 = 0.75;

/// The transfer that may be left of detail finer than pixels, on the camera's lattice.
const SMOOTH_TRANSFER: f64 = 0.05;

/// Least transfer that a restoring filter divides by: what an image has less of than that is more noise than detail.
const LEAST_TRANSFER: f32 = 0.1;

/// Which lattice a factor of the light is sampled on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Lattice {
    /// That of the object, [`oversampling`](crate::MicroscopeParams::oversampling) samples along the side of a pixel.
    Object,
    /// That of the camera, each value the mean over its pixel.
    #[default]
    Camera,
}

/// What the spectra of something at one depth are multiplied with for one plane.
#[derive(Debug, Clone)]
pub(crate) struct Filter {
    pub(crate) lattice: Lattice,
    /// Whether the correction of the in-focus form takes part.
    pub(crate) is_corrected: bool,
    response: Response,
    restores: bool,
}

/// (H_A, H_P, G), or of a restoring filter (H_A, –, H_A in focus).
#[derive(Debug, Clone)]
enum Response {
    Round(Box<[Table; 3]>),
    Sided(Vec<[Complex32; 3]>),
}

/// Entries of a table, a power of two: places in it then need no check.
const ENTRIES: usize = 512;

/// Values at multiples of a frequency, each with the difference to the next, and zeros after the last.
type Table = [[f32; 2]; ENTRIES];

/// The three responses of a filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// H_A, of the absorbed light.
    Absorption,
    /// H_P, of the phase.
    Phase,
    /// −G, of the correction of the in-focus form, which is light and not its lack.
    Correction,
}

/// Frequencies of a block of a spectrum, in steps of the filter's table, and what the mean over a pixel leaves of them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Block<'a> {
    /// From one frequency along x to the next.
    pub(crate) step_x: f32,
    /// Of the lanes.
    pub(crate) y: &'a [f32; LANES],
    /// From frequency 0 on.
    pub(crate) pixel_x: &'a [f32],
    pub(crate) pixel_y: &'a [f32; LANES],
}

impl Filter {
    /// `transfer` is that depth's.
    pub(crate) fn new(microscope: &Microscope, depth_um: f64, stage_um: f64, transfer: &Transfer) -> Self {
        let params = microscope.params();
        let defocus = microscope.defocus_um(depth_um, stage_um).abs();
        let [whole, gone] = CORRECTED_UM;
        let coherent = 1.0 - SCATTERED_APART * incoherence(params.condenser_na / params.na);
        let share = coherent * fade((defocus - whole) / (gone - whole));
        let (radius, cutoff) = (microscope.cone_radius_um(depth_um, stage_um), microscope.cutoff());
        let nyquist = 0.5 / params.pixel_um;
        let is_smooth = params.oversampling > 1 && defocus >= gone && transfer.extent(SMOOTH_TRANSFER) <= nyquist;
        let lattice = if is_smooth { Lattice::Camera } else { Lattice::Object };
        let correction =
            |f: f64| -share * pillbox(TAU * f * radius) * fade((f / cutoff - TAPER_FROM) / (1.0 - TAPER_FROM));
        let correction = |f: f64| if share > 0.0 { correction(f) } else { 0.0 };
        let response = Response::new(transfer, correction);
        Self { lattice, is_corrected: share > 0.0, response, restores: false }
    }

    /// The in-focus transfer function alone.
    pub(crate) fn in_focus(microscope: &Microscope) -> Self {
        let response = Response::new(&Transfer::new(microscope, 0.0, 0.0), |_| 0.0);
        Self { lattice: Lattice::Object, is_corrected: false, response, restores: false }
    }

    /// Makes it the filter for what was seen in focus, through `in_focus` and the camera's pixels, already.
    pub(crate) fn restore(&mut self, in_focus: &Self) {
        match (&mut self.response, &in_focus.response) {
            (Response::Round(tables), Response::Round(focused)) => tables[2] = focused[0],
            (Response::Sided(table), Response::Sided(focused)) => {
                for (entry, focused) in table.iter_mut().zip(focused) {
                    entry[2] = focused[0];
                }
            }
            _ => unreachable!("filters of one microscope have one shape"),
        }
        (self.is_corrected, self.restores) = (false, true);
    }

    /// Adds a block of a spectrum, times a response, to `sum`: kx up to `reach`, of both signs, the negative ones at
    /// the end of either.
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
                            let seen = entry[2] * (pixel_x * at.pixel_y[l]);
                            let size = seen.norm_sqr().sqrt();
                            weight = weight * seen.conj() / (size * size.max(LEAST_TRANSFER)).max(f32::MIN_POSITIVE);
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

/// Divided by what the lens and the pixels left in focus.
#[multiversion(targets = "simd")]
fn add_restored(table: &Table, focused: &Table, at: Block<'_>, spectrum: &[Lanes], reach: usize, sum: &mut [Lanes]) {
    let y2 = at.y.map(|y| y * y);
    for k in 0..=reach {
        let mut weights = entries(table, k, at.step_x, &y2);
        let seen = entries(focused, k, at.step_x, &y2);
        for ((weight, seen), pixel_y) in weights.iter_mut().zip(&seen).zip(at.pixel_y) {
            *weight /= (seen * at.pixel_x[k] * pixel_y).max(LEAST_TRANSFER);
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

/// Values of a table in a block, linear between its entries.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "places in the table")]
fn entries(table: &Table, k: usize, step_x: f32, y2: &[f32; LANES]) -> [f32; LANES] {
    let x = k as u32 as f32 * step_x;
    let x2 = x * x;
    // Both are small whole numbers: signed ones are converted faster.
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

/// The responses at a frequency.
#[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 spectra")]
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
    #[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 spectra")]
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
            let correction = correction(transfer.step * (i % SIDED_SAMPLES) as f64);
            [complex(absorption), complex(phase), complex([correction, 0.0])]
        };
        Self::Sided(list.map(entry).collect())
    }
}

/// From 0 for a narrow condenser to 1 for one opened to the whole of the objective's aperture: 0.04 at 0.6 of it, 0.2
/// at 0.8.
pub(crate) fn incoherence(ratio: f64) -> f64 {
    let r = ratio.min(1.0);
    let cube = r * r * r;
    cube * cube * r
}

/// The spectrum of a disc, 2 J₁(q)/q.
pub(crate) fn pillbox(q: f64) -> f64 {
    /// Up to here the power series ∑ (−q²/4)ᵏ / k! (k + 1)! loses fewer than half of the digits, and its terms are
    /// enough.
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
    fn the_disc_is_bessels_function() {
        assert_eq!(pillbox(0.0), 1.0);
        for i in 1..2000 {
            let q = 0.01 * f64::from(i);
            assert!((pillbox(q) - 2.0 * libm::j1(q) / q).abs() < 1e-11, "{q}");
        }
    }
}
