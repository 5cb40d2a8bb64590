use core::f64::consts::TAU;

use multiversion::multiversion;
use num_complex::Complex32;

use crate::Microscope;
use crate::spectrum::{LANES, Lanes, ZERO};
use crate::transfer::{ASYMMETRIC_SAMPLES, SAMPLES, Transfer, corners, fade};

/// Defocus in µm of mountant up to which the in-focus correction has full weight, and from which it has none. Its
/// effect is small at 1 µm.
const CORRECTED_UM: [f64; 2] = [1.0, 2.0];

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
    #[expect(clippy::cast_possible_truncation, reason = "spectra use single precision")]
    pub(crate) fn new(microscope: &Microscope, depth_um: f64, stage_um: f64, transfer: &Transfer) -> Self {
        let params = microscope.params();
        let defocus = microscope.defocus_um(depth_um, stage_um).abs();
        let [whole, gone] = CORRECTED_UM;
        let coherent = 1.0 - SCATTERED_APART * incoherence(params.condenser_na / params.na);
        let weight = coherent * fade((defocus - whole) / (gone - whole));
        let (radius, cutoff) = (microscope.cone_radius_um(depth_um, stage_um), microscope.cutoff());
        let mut correction = [0.0; MOST_SAMPLES];
        if weight > 0.0 {
            pillboxes(TAU * transfer.step * radius, &mut correction);
            for (i, value) in correction.iter_mut().enumerate() {
                let f = transfer.step * i as f64;
                *value *= -weight * fade((f / cutoff - TAPER_FROM) / (1.0 - TAPER_FROM));
            }
        }
        let response = Response::new(transfer, &correction);
        Self { correction: weight as f32, response, restores: false }
    }

    /// Returns the filter of the in-focus transfer function, without correction.
    pub(crate) fn in_focus(microscope: &Microscope) -> Self {
        let response = Response::new(&Transfer::new(microscope, 0.0, 0.0), &[0.0; MOST_SAMPLES]);
        Self { correction: 0.0, response, restores: false }
    }

    pub(crate) fn is_corrected(&self) -> bool {
        self.correction > 0.0
    }

    /// Returns the response to absorption at a frequency in cycles/µm, or `None` if it depends on the direction.
    pub(crate) fn round_absorption(&self, frequency: f64, microscope: &Microscope) -> Option<f64> {
        let Response::Round(tables) = &self.response else { return None };
        let place = frequency / Transfer::step_of(microscope);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index of the table")]
        let [value, rise] = tables[0].get(place as usize).copied().unwrap_or_default();
        Some(f64::from(value) + (place - place.floor()) * f64::from(rise))
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
        (self.correction, self.restores) = (0.0, true);
    }

    /// Computes the image of a block: absorbed light as the real part, the effect of phase delay as the imaginary part.
    ///
    /// With responses W to absorption and H to phase delay, a spectrum F of absorbed light + i · phase delay becomes
    /// (W + H)/2 · F(k) + (W − H)/2 · F*(−k). The spectrum of a correction is added times −G.
    pub(crate) fn image(&self, at: Block<'_>, from: &BlockSpectrum<'_>, plus: &mut [Lanes], minus: &mut [Lanes]) {
        match &self.response {
            Response::Round(tables) => {
                let correction = from.correction.filter(|_| self.is_corrected());
                match (from.minus.is_empty(), correction) {
                    (true, None) => round::<true, false>(tables, self.restores, at, from, plus, minus),
                    (true, Some(_)) => round::<true, true>(tables, self.restores, at, from, plus, minus),
                    (false, None) => round::<false, false>(tables, self.restores, at, from, plus, minus),
                    (false, Some(_)) => round::<false, true>(tables, self.restores, at, from, plus, minus),
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
    [absorption, phase, last]: &[Table; 3],
    restores: bool,
    at: Block<'_>,
    from: &BlockSpectrum<'_>,
    plus: &mut [Lanes],
    minus: &mut [Lanes],
) {
    let y2 = at.y.map(|y| y * y);
    let reach = plus.len() / 2;
    for k in 0..=reach {
        let place = TablePlaces::new(k, at.step_x, &y2);
        let mut w = place.entries(absorption);
        let mut h = if REAL { [0.0; LANES] } else { place.entries(phase) };
        let g = if CORRECTED { place.entries(last) } else { [0.0; LANES] };
        if restores {
            let in_focus = place.entries(last);
            for l in 0..LANES {
                let divisor = (in_focus[l] * at.pixel_x[k] * at.pixel_y[l]).max(LEAST_TRANSFER);
                (w[l], h[l]) = (w[l] / divisor, h[l] / divisor);
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

/// Positions in the tables of the frequencies of a block.
struct TablePlaces {
    /// Signed integers convert faster.
    places: [i32; LANES],
    parts: [f32; LANES],
}

impl TablePlaces {
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "indices of the table")]
    fn new(k: usize, step_x: f32, y2: &[f32; LANES]) -> Self {
        let x = k as u32 as f32 * step_x;
        let x2 = x * x;
        let (mut places, mut parts) = ([0; LANES], [0.0; LANES]);
        for ((place, part), y2) in places.iter_mut().zip(&mut parts).zip(y2) {
            let position = (x2 + y2).sqrt().min((ENTRIES - 1) as f32);
            *place = position as i32;
            *part = position - *place as f32;
        }
        Self { places, parts }
    }

    /// Returns values of a table, by linear interpolation.
    #[inline(always)]
    #[expect(clippy::cast_sign_loss, reason = "indices of the table")]
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
    #[expect(clippy::cast_possible_truncation, reason = "spectra use single precision")]
    /// Tabulates responses; `correction` has values at the frequencies of the transfer functions.
    fn new(transfer: &Transfer, correction: &[f64; MOST_SAMPLES]) -> Self {
        let list = transfer.table.iter().enumerate();
        if transfer.is_round() {
            let mut tables = Box::new([[[0.0; 2]; ENTRIES]; 3]);
            for (i, &[absorption, phase]) in list {
                let values = [absorption[0], phase[0], correction[i]];
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
            let correction = correction[i % ASYMMETRIC_SAMPLES];
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
}
