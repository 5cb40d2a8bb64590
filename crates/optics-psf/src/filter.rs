use core::f64::consts::TAU;

use multiversion::multiversion;
use num_complex::Complex32;

use crate::Microscope;
use crate::spectrum::{LANES, Lanes, ZERO};
use crate::transfer::{ASYMMETRIC_SAMPLES, SAMPLES, Transfer, TransferTable, corners, fade};

/// Defocus in µm of mountant up to which the in-focus correction has full weight, and from which it has none. Its
/// effect is small at 1 µm.
pub(crate) const CORRECTED_UM: [f64; 2] = [1.0, 2.0];

/// Fraction of the correction lost at a full condenser aperture, where twice-scattered light interferes less. Fitted to
/// Abbe images of discs, specks and nuclei.
const SCATTERED_APART: f64 = 0.4;

/// Start of the taper of the correction's spectrum, as a fraction of the cutoff. A sharp cut would ring at edges.
const TAPER_FROM: f64 = 0.75;

/// Smallest divisor of the restoring filter. Weaker frequencies of an image are mostly noise.
const LEAST_TRANSFER: f32 = 0.1;

/// Filter of one depth and stage position.
#[derive(Debug, Clone)]
pub(crate) struct Filter {
    /// Weight of the in-focus correction, from 0 to 1.
    pub(crate) correction: f32,
    /// That weight in focus.
    pub(crate) full_correction: f32,
    response: Response,
    restores: bool,
}

/// (H_A, H_P, G), or (H_A, –, H_A in focus) for a restoring filter.
#[derive(Debug, Clone)]
enum Response {
    Round(Box<RoundResponses>),
    Sided(Vec<[Complex32; 3]>),
}

/// Real responses at multiples of a frequency, each with the difference to the next, padded with zeros.
#[derive(Debug, Clone)]
struct RoundResponses {
    /// H_A and H_P.
    transfer: [[f32; 4]; ENTRIES],
    /// The third response.
    last: Table,
}

/// Entries of a table. A power of two makes bounds checks unnecessary.
const ENTRIES: usize = 512;

/// Values at multiples of a frequency, each with the difference to the next, padded with zeros.
type Table = [[f32; 2]; ENTRIES];

/// Frequencies of a block of a spectrum, in steps of the filter's table, and the transfer of the pixel mean.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Block<'a> {
    /// Whether the image includes the pixel mean.
    pub(crate) is_mean: bool,
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
    #[expect(clippy::cast_possible_truncation, reason = "spectra use single precision")]
    pub(crate) fn new(microscope: &Microscope, depth_um: f64, stage_um: f64, transfer: &Transfer) -> Self {
        let params = microscope.params();
        let defocus = microscope.defocus_um(depth_um, stage_um).abs();
        let [whole, gone] = CORRECTED_UM;
        let coherent = 1.0 - SCATTERED_APART * incoherence(params.condenser_na / params.na);
        let weight = coherent * fade((defocus - whole) / (gone - whole));
        let (radius, cutoff) = (microscope.cone_radius_um(depth_um, stage_um), microscope.cutoff());
        let correction = (weight > 0.0).then(|| {
            let mut correction = [0.0; MOST_SAMPLES];
            pillboxes(TAU * transfer.step * radius, &mut correction);
            for (i, value) in correction.iter_mut().enumerate() {
                let f = transfer.step * i as f64;
                *value *= -weight * fade((f / cutoff - TAPER_FROM) / (1.0 - TAPER_FROM));
            }
            correction
        });
        let response = Response::new(transfer, correction.as_ref());
        Self { correction: weight as f32, full_correction: coherent as f32, response, restores: false }
    }

    /// Returns the filter of the in-focus transfer function, without correction.
    pub(crate) fn in_focus(microscope: &Microscope) -> Self {
        let response = Response::new(&Transfer::new(microscope, 0.0, 0.0), None);
        Self { correction: 0.0, full_correction: 0.0, response, restores: false }
    }

    pub(crate) fn is_corrected(&self) -> bool {
        self.correction > 0.0
    }

    /// Returns the response to absorption at a frequency in cycles/µm, or `None` if it depends on the direction.
    pub(crate) fn round_absorption(&self, frequency: f64, microscope: &Microscope) -> Option<f64> {
        let Response::Round(responses) = &self.response else { return None };
        let place = frequency / Transfer::step_of(microscope);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index of the table")]
        let [value, rise, ..] = responses.transfer.get(place as usize).copied().unwrap_or_default();
        Some(f64::from(value) + (place - place.floor()) * f64::from(rise))
    }

    /// Turns the filter into one for objects that were already imaged in focus, through `in_focus` and the camera
    /// pixels.
    pub(crate) fn restore(&mut self, in_focus: &Self) {
        match (&mut self.response, &in_focus.response) {
            (Response::Round(responses), Response::Round(focused)) => {
                for (last, [absorption, rise, ..]) in responses.last.iter_mut().zip(&focused.transfer) {
                    *last = [*absorption, *rise];
                }
            }
            (Response::Sided(table), Response::Sided(focused)) => {
                for (entry, focused) in table.iter_mut().zip(focused) {
                    entry[2] = focused[0];
                }
            }
            _ => unreachable!("filters of one microscope have the same shape"),
        }
        (self.correction, self.restores) = (0.0, true);
    }

    /// Computes the image of a block: absorbed light as the real part, the effect of phase delay as the imaginary part.
    ///
    /// With responses W to absorption and H to phase delay, a spectrum F of absorbed light + i · phase delay becomes
    /// (W + H)/2 · F(k) + (W − H)/2 · F*(−k). The spectrum of a correction is added times −G.
    pub(crate) fn image(&self, at: Block<'_>, from: &BlockSpectrum<'_>, plus: &mut [Lanes], minus: &mut [Lanes]) {
        match &self.response {
            Response::Round(responses) => {
                let correction = from.correction.filter(|_| self.is_corrected());
                match (from.minus.is_empty(), correction) {
                    (true, None) => round::<true, false>(responses, self.restores, at, from, plus, minus),
                    (true, Some(_)) => round::<true, true>(responses, self.restores, at, from, plus, minus),
                    (false, None) => round::<false, false>(responses, self.restores, at, from, plus, minus),
                    (false, Some(_)) => round::<false, true>(responses, self.restores, at, from, plus, minus),
                }
            }
            Response::Sided(table) => self.sided_image(table, at, from, plus, minus),
        }
    }

    fn sided_image(
        &self,
        table: &[[Complex32; 3]],
        at: Block<'_>,
        from: &BlockSpectrum<'_>,
        plus: &mut [Lanes],
        minus: &mut [Lanes],
    ) {
        let reach = plus.len() / 2;
        for i in 0..plus.len() {
            let k = i.abs_diff(reach);
            let x = k as f32 * at.step_x;
            for l in 0..LANES {
                let mut weights = sided(table, if i < reach { -x } else { x }, at.y[l]);
                if self.restores {
                    let in_focus = weights[2] * (at.pixel_x[k] * at.pixel_y[l]);
                    let size = in_focus.norm_sqr().sqrt();
                    let inverse = in_focus.conj() / (size * size.max(LEAST_TRANSFER)).max(f32::MIN_POSITIVE);
                    (weights[0], weights[1]) = (weights[0] * inverse, weights[1] * inverse);
                }
                if at.is_mean {
                    let mean = at.pixel_x[k] * at.pixel_y[l];
                    weights.iter_mut().for_each(|weight| *weight *= mean);
                }
                let complex = |lanes: &Lanes| Complex32::new(lanes[0][l], lanes[1][l]);
                let f = complex(&from.plus[i]);
                // F*(−k), which is F(k) for a real image.
                let mirrored = from.minus.get(i).map_or(f, |lanes| complex(lanes).conj());
                let [half_sum, half_difference] = [0.5 * (weights[0] + weights[1]), 0.5 * (weights[0] - weights[1])];
                let correction = match from.correction {
                    Some(correction) if self.is_corrected() => weights[2] * complex(&correction[i]),
                    _ => Complex32::ZERO,
                };
                let above = half_sum * f + half_difference * mirrored + correction;
                (plus[i][0][l], plus[i][1][l]) = (above.re, above.im);
                if !from.minus.is_empty() {
                    let below = (half_sum * mirrored + half_difference * f + correction).conj();
                    (minus[i][0][l], minus[i][1][l]) = (below.re, below.im);
                }
            }
        }
    }
}

/// A block of the spectrum of an object.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BlockSpectrum<'a> {
    /// F(kx, ky), for kx from −r to r.
    pub(crate) plus: &'a [Lanes],
    /// F(−kx, −ky); empty for a real image.
    pub(crate) minus: &'a [Lanes],
    /// Spectrum of a real image that is added times −G.
    pub(crate) correction: Option<&'a [Lanes]>,
}

/// [`Filter::image`] for a round pupil, whose responses are real and even.
#[multiversion(targets = "simd")]
fn round<const REAL: bool, const CORRECTED: bool>(
    responses: &RoundResponses,
    restores: bool,
    at: Block<'_>,
    from: &BlockSpectrum<'_>,
    plus: &mut [Lanes],
    minus: &mut [Lanes],
) {
    let RoundResponses { transfer, last } = responses;
    let y2 = at.y.map(|y| y * y);
    let reach = plus.len() / 2;
    let mut found = [FrequencyEntries::default(); BATCH];
    for first in (0..=reach).step_by(BATCH) {
        let batch = first..(first + BATCH).min(reach + 1);
        for (found, k) in found.iter_mut().zip(batch.clone()) {
            found.find(k, at.step_x, &y2, transfer);
        }
        for (found, k) in found.iter().zip(batch) {
            let [mut w, mut h] = found.transfer();
            let mut g = if CORRECTED { found.entries(last) } else { [0.0; LANES] };
            if restores {
                let in_focus = found.entries(last);
                for l in 0..LANES {
                    let divisor = (in_focus[l] * at.pixel_x[k] * at.pixel_y[l]).max(LEAST_TRANSFER);
                    (w[l], h[l]) = (w[l] / divisor, h[l] / divisor);
                }
            }
            if at.is_mean {
                for l in 0..LANES {
                    let mean = at.pixel_x[k] * at.pixel_y[l];
                    (w[l], h[l], g[l]) = (w[l] * mean, h[l] * mean, g[l] * mean);
                }
            }
            for i in [reach - k, reach + k] {
                let f = &from.plus[i];
                let c = from.correction.filter(|_| CORRECTED).map_or(&ZERO, |correction| &correction[i]);
                if REAL {
                    for l in 0..LANES {
                        plus[i][0][l] = w[l] * f[0][l] + g[l] * c[0][l];
                        plus[i][1][l] = w[l] * f[1][l] + g[l] * c[1][l];
                    }
                    continue;
                }
                let m = &from.minus[i];
                for l in 0..LANES {
                    let (sum, difference) = (0.5 * (w[l] + h[l]), 0.5 * (w[l] - h[l]));
                    plus[i][0][l] = sum * f[0][l] + difference * m[0][l] + g[l] * c[0][l];
                    plus[i][1][l] = sum * f[1][l] - difference * m[1][l] + g[l] * c[1][l];
                    minus[i][0][l] = sum * m[0][l] + difference * f[0][l] + g[l] * c[0][l];
                    minus[i][1][l] = sum * m[1][l] - difference * f[1][l] - g[l] * c[1][l];
                }
            }
        }
    }
}

/// Frequencies kx that are looked up in the tables before they are used: processors wait if they read wide what they
/// have just written in parts.
const BATCH: usize = 8;

/// Table entries at the frequencies of all lanes.
#[derive(Debug, Clone, Copy, Default)]
struct FrequencyEntries {
    places: [u32; LANES],
    /// Position between two entries, 0 to 1.
    parts: [f32; LANES],
    transfer: [[f32; 4]; LANES],
}

impl FrequencyEntries {
    /// Finds the entries of the frequencies with kx = `k` and the squares `y2` of ky.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "small numbers")]
    fn find(&mut self, k: usize, step_x: f32, y2: &[f32; LANES], transfer: &[[f32; 4]; ENTRIES]) {
        /// Numbers from 2²³ to 2²⁴ have no fraction, and their lowest bits are an integer.
        const WHOLE: f32 = 12_582_912.0;
        let x = k as u32 as f32 * step_x;
        let x2 = x * x;
        for ((place, part), y2) in self.places.iter_mut().zip(&mut self.parts).zip(y2) {
            let position = (x2 + y2).sqrt().min((ENTRIES - 1) as f32);
            let whole = (position - 0.5) + WHOLE;
            *place = whole.to_bits();
            *part = position - (whole - WHOLE);
        }
        for (entry, place) in self.transfer.iter_mut().zip(&self.places) {
            *entry = transfer[*place as usize % ENTRIES];
        }
    }

    /// Returns H_A and H_P, by linear interpolation.
    #[inline(always)]
    fn transfer(&self) -> [[f32; LANES]; 2] {
        let (mut w, mut h) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let entry = &self.transfer[l];
            w[l] = entry[0] + self.parts[l] * entry[1];
            h[l] = entry[2] + self.parts[l] * entry[3];
        }
        [w, h]
    }

    /// Returns values of another table, by linear interpolation.
    #[inline(always)]
    fn entries(&self, table: &Table) -> [f32; LANES] {
        let mut values = [0.0; LANES];
        for ((value, place), part) in values.iter_mut().zip(&self.places).zip(&self.parts) {
            let [from, rise] = table[*place as usize % ENTRIES];
            *value = from + part * rise;
        }
        values
    }
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
    /// Tabulates responses; `correction` has values at the frequencies of the transfer functions.
    #[expect(clippy::cast_possible_truncation, reason = "spectra use single precision")]
    fn new(transfer: &Transfer, correction: Option<&[f64; MOST_SAMPLES]>) -> Self {
        match &transfer.table {
            TransferTable::Round(table) => {
                let mut responses =
                    Box::new(RoundResponses { transfer: [[0.0; 4]; ENTRIES], last: [[0.0; 2]; ENTRIES] });
                for (to, [absorption, phase]) in responses.transfer.iter_mut().zip(table) {
                    (to[0], to[2]) = (*absorption, *phase);
                }
                for i in 0..table.len() {
                    let next = responses.transfer[i + 1];
                    let to = &mut responses.transfer[i];
                    (to[1], to[3]) = (next[0] - to[0], next[2] - to[2]);
                }
                if let Some(correction) = correction {
                    for (i, to) in responses.last.iter_mut().enumerate().take(table.len()) {
                        let value = |i: usize| correction.get(i).map_or(0.0, |value| *value as f32);
                        *to = [value(i), value(i + 1) - value(i)];
                    }
                }
                Self::Round(responses)
            }
            TransferTable::Sided(table) => {
                let complex = |[re, im]: [f32; 2]| Complex32::new(re, im);
                let entry = |(i, &[absorption, phase]): (usize, &[[f32; 2]; 2])| {
                    let correction = correction.map_or(0.0, |correction| correction[i % ASYMMETRIC_SAMPLES] as f32);
                    [complex(absorption), complex(phase), complex([correction, 0.0])]
                };
                Self::Sided(table.iter().enumerate().map(entry).collect())
            }
        }
    }
}

/// Rises from 0 for a narrow condenser to 1 for one opened to the objective's aperture: 0.04 at a ratio of 0.6, 0.2 at
/// 0.8.
pub(crate) fn incoherence(ratio: f64) -> f64 {
    let r = ratio.min(1.0);
    let cube = r * r * r;
    cube * cube * r
}

/// Largest number of samples of a transfer function along a direction.
const MOST_SAMPLES: usize = if SAMPLES > ASYMMETRIC_SAMPLES { SAMPLES } else { ASYMMETRIC_SAMPLES };

/// Writes the spectrum of a disc, 2 J₁(q)/q, at multiples of `step`.
#[multiversion(targets = "simd")]
fn pillboxes(step: f64, values: &mut [f64; MOST_SAMPLES]) {
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
    for (i, value) in values.iter_mut().enumerate() {
        let q = step * i as f64;
        let t = 0.25 * q * q;
        let mut sum = 0.0;
        for term in SERIES.iter().rev() {
            sum = sum * t + term;
        }
        *value = sum;
    }
    for (i, value) in values.iter_mut().enumerate().rev() {
        let q = step * i as f64;
        if q <= SERIES_TO {
            break;
        }
        *value = 2.0 * libm::j1(q) / q;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pillboxes_match_the_bessel_function() {
        let mut found = [0.0; MOST_SAMPLES];
        for step in [0.0, 0.001, 0.013, 0.05] {
            pillboxes(step, &mut found);
            assert_eq!(found[0], 1.0);
            for (i, found) in found.iter().enumerate().skip(1) {
                let q = step * i as f64;
                let expected = if q > 0.0 { 2.0 * libm::j1(q) / q } else { 1.0 };
                assert!((found - expected).abs() < 1e-11, "{q}");
            }
        }
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers")]
    fn tables_are_interpolated_between_entries() {
        let value = |i: usize| ((i * i) % 97) as f32;
        let mut transfer = [[0.0; 4]; ENTRIES];
        for (i, entry) in transfer.iter_mut().enumerate().take(400) {
            *entry = [value(i), value(i + 1) - value(i), -value(i), value(i) - value(i + 1)];
        }
        let last: Table = core::array::from_fn(|i| [transfer[i][0], transfer[i][1]]);
        let y2: [f32; LANES] = core::array::from_fn(|l| 1.69 * (l * l) as f32);
        let mut found = FrequencyEntries::default();
        for k in [0, 1, 7, 200, 700] {
            found.find(k, 1.5, &y2, &transfer);
            let ([w, h], g) = (found.transfer(), found.entries(&last));
            for l in 0..LANES {
                let position = (2.25 * (k * k) as f64 + f64::from(y2[l])).sqrt();
                let (i, t) = (position as usize, position.fract());
                let entry = transfer.get(i).copied().unwrap_or_default().map(f64::from);
                let expected = entry[0] + t * entry[1];
                let [w, h, g] = [w[l], h[l], g[l]].map(f64::from);
                assert!((w - expected).abs() < 4e-3 && w == g && h == -w, "{k} {l}: {w} {expected}");
            }
        }
    }
}
