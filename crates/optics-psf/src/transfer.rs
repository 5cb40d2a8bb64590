use core::f64::consts::{PI, TAU};
use std::sync::Arc;

use multiversion::multiversion;

use crate::error::Error;
use crate::microscope::{Microscope, distance};
use crate::overlap::OverlapIntegral;
use crate::pupil::Pupil;

/// Samples from frequency 0 to the cutoff; the error of linear interpolation is below 6e-4.
pub(crate) const SAMPLES: usize = 401;
/// Samples per direction, and directions, for asymmetric pupils.
pub(crate) const ASYMMETRIC_SAMPLES: usize = 129;
const DIRECTIONS: usize = 64;

/// Weak-object transfer functions: the transfer of detail from a frequency and depth to the image.
///
/// An object of small absorbance A and phase delay φ in radians gives the intensity 1 − ln 10 · H_A ⊗ A − 2 H_P ⊗ φ,
/// with
///
/// H_A(f) = 1/S₀ ∫ circ(|s + f|) cos 2π[W(s + f) − W(s)] ds and
/// H_P(f) = 1/S₀ ∫ circ(|s + f|) sin 2π[W(s + f) − W(s)] ds.
///
/// The integrals cover the part of the condenser's disc inside the objective's, of area S₀; circ is the objective's
/// aperture NA/λ (slices of Streibl's three-dimensional transfer functions, DOI 10.1364/JOSAA.2.000121). With coma or
/// astigmatism they depend on the direction; with coma they are complex. They are averaged over the wavelength band.
#[derive(Debug, Clone, PartialEq)]
pub struct Transfer {
    /// Frequency step of the table, in cycles/µm.
    pub(crate) step: f64,
    pub(crate) table: TransferTable,
}

/// (H_A, H_P) at multiples of a frequency step.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum TransferTable {
    /// Real values of a round pupil.
    Round(Vec<[f32; 2]>),
    /// Complex values, one row per direction.
    Sided(Vec<[[f32; 2]; 2]>),
}

impl TransferTable {
    /// Returns the number of frequencies.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Round(table) => table.len(),
            Self::Sided(table) => table.len(),
        }
    }
}

impl Microscope {
    /// Computes the transfer functions at a depth and stage position: see [`Transfer`].
    ///
    /// `depth_um` is the depth in the mountant relative to the focal plane with the stage at rest, positive towards the
    /// objective. `stage_um` is the distance by which the stage was lowered from the objective, in the immersion
    /// medium. The two differ: to focus on an object d closer to a dry objective, lower the stage by about d /
    /// `mount_index`.
    ///
    /// # Errors
    ///
    /// If a number is not finite or beyond ±1000 µm.
    pub fn transfer(&self, depth_um: f64, stage_um: f64) -> Result<Transfer, Error> {
        Ok(Transfer::new(self, distance("depth_um", depth_um)?, distance("stage_um", stage_um)?))
    }
}

impl Transfer {
    #[expect(clippy::cast_possible_truncation, reason = "tables use single precision")]
    pub(crate) fn new(microscope: &Microscope, depth_um: f64, stage_um: f64) -> Self {
        let step = Self::step_of(microscope);
        let pupil = |wavelength| Pupil::new(microscope.params(), wavelength, depth_um, stage_um);
        let bands = microscope.bands().into_iter();
        let pupils: Vec<(Pupil, f64)> = bands.map(|(wavelength, weight)| (pupil(wavelength), weight)).collect();
        let mut overlap = OverlapIntegral::default();
        let is_far = microscope.defocus_um(depth_um, stage_um).abs() > FAR_UM;
        let mut row = |direction: [f64; 2], samples: usize| {
            let mut mean = vec![[0.0; 2]; samples];
            for (pupil, weight) in &pupils {
                profile(&mut overlap, pupil, direction, step, *weight, negligible_from(pupil, is_far), &mut mean);
            }
            // Frequency 0 is transferred fully, without rounding errors of the quadrature.
            mean[0] = [1.0, 0.0];
            mean
        };
        if microscope.params().zernike.is_round() {
            let row = row([1.0, 0.0], SAMPLES).into_iter();
            return Self {
                step,
                table: TransferTable::Round(row.map(|pair| pair.map(|value| value as f32)).collect()),
            };
        }
        let rows: Vec<Vec<[f64; 2]>> = (0..DIRECTIONS).map(|k| row(direction(k), ASYMMETRIC_SAMPLES)).collect();
        // H_A = (E(f) + E*(−f))/2, H_P = (E(f) − E*(−f))/2i
        let pair = |k: usize, i: usize| {
            let ([a, b], [c, d]) = (rows[k][i], rows[(k + DIRECTIONS / 2) % DIRECTIONS][i]);
            let pair = [[0.5 * (a + c), 0.5 * (b - d)], [0.5 * (b + d), 0.5 * (c - a)]];
            pair.map(|complex| complex.map(|part| part as f32))
        };
        let table = (0..DIRECTIONS).flat_map(|k| (0..ASYMMETRIC_SAMPLES).map(move |i| (k, i))).map(|(k, i)| pair(k, i));
        Self { step, table: TransferTable::Sided(table.collect()) }
    }

    /// Returns a weighted sum of transfer functions of one microscope. Each has one weight for H_A and one for H_P.
    pub(crate) fn mixed(parts: &[(Arc<Self>, [f32; 2])]) -> Self {
        let (first, _) = &parts[0];
        let mut table = match &first.table {
            TransferTable::Round(table) => TransferTable::Round(vec![[0.0; 2]; table.len()]),
            TransferTable::Sided(table) => TransferTable::Sided(vec![[[0.0; 2]; 2]; table.len()]),
        };
        for (part, [a, p]) in parts {
            match (&mut table, &part.table) {
                (TransferTable::Round(sums), TransferTable::Round(values)) => {
                    add_scaled(sums.as_flattened_mut(), values.as_flattened(), &[*a, *p]);
                }
                (TransferTable::Sided(sums), TransferTable::Sided(values)) => {
                    let (sums, values) = (sums.as_flattened_mut(), values.as_flattened());
                    add_scaled(sums.as_flattened_mut(), values.as_flattened(), &[*a, *a, *p, *p]);
                }
                _ => unreachable!("transfer functions of one microscope have the same shape"),
            }
        }
        Self { step: first.step, table }
    }

    /// Returns the frequency step of a microscope's tables, in cycles/µm.
    pub(crate) fn step_of(microscope: &Microscope) -> f64 {
        let samples = if microscope.params().zernike.is_round() { SAMPLES } else { ASYMMETRIC_SAMPLES };
        microscope.cutoff() / (samples - 1) as f64
    }

    /// Returns H_A at a frequency in cycles/µm, as real and imaginary part. It is 1 at frequency 0, and 0 beyond the
    /// cutoff.
    #[must_use]
    pub fn absorption(&self, frequency: [f64; 2]) -> [f64; 2] {
        self.at(frequency)[0]
    }

    /// Returns H_P at a frequency in cycles/µm, as real and imaginary part. It is 0 at frequency 0, and 0 beyond the
    /// cutoff.
    #[must_use]
    pub fn phase(&self, frequency: [f64; 2]) -> [f64; 2] {
        self.at(frequency)[1]
    }

    /// Returns H_A and H_P.
    fn at(&self, [x, y]: [f64; 2]) -> [[f64; 2]; 2] {
        match &self.table {
            TransferTable::Round(table) => {
                let position = (x * x + y * y).sqrt() / self.step;
                if position >= (SAMPLES - 1) as f64 {
                    return [[0.0; 2]; 2];
                }
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to the last entry")]
                let i = position as usize;
                let t = position - i as f64;
                let value = |i: usize, k: usize| f64::from(table[i][k]);
                [0, 1].map(|k| [value(i, k) + t * (value(i + 1, k) - value(i, k)), 0.0])
            }
            TransferTable::Sided(table) => {
                let mut mixed = [[0.0; 2]; 2];
                for (place, weight) in corners([x / self.step, y / self.step]).into_iter().flatten() {
                    for (sum, value) in mixed.as_flattened_mut().iter_mut().zip(table[place].as_flattened()) {
                        *sum += weight * f64::from(*value);
                    }
                }
                mixed
            }
        }
    }
}

/// Adds values times periodic factors.
#[multiversion(targets = "simd")]
fn add_scaled<const N: usize>(sums: &mut [f32], values: &[f32], factors: &[f32; N]) {
    for (sums, values) in sums.as_chunks_mut::<N>().0.iter_mut().zip(values.as_chunks::<N>().0) {
        for i in 0..N {
            sums[i] += factors[i] * values[i];
        }
    }
}

/// Polynomial nodes of a section of a profile: a minimum, and the number per fringe.
const NODES: (usize, f64) = (14, 3.5);

/// Defocus in µm of mountant from which negligible transfer is omitted.
pub(crate) const FAR_UM: f64 = 15.0;
/// Transfer functions at large defocus oscillate around 0 with decreasing amplitude in q = 2π f r, r the radius of the
/// condenser's cone. From this q on they stay below 0.01 and are omitted: no object has enough detail there, and their
/// fringes would dominate the computing time.
const NEGLIGIBLE_Q: f64 = 66.0;
/// Start of the fade-out, as a fraction of that frequency.
const FADES_FROM: f64 = 0.8;

/// Returns the frequency in cycles/µm from which on negligible transfer is omitted.
fn negligible_from(pupil: &Pupil, is_far: bool) -> f64 {
    if is_far { NEGLIGIBLE_Q / (TAU * pupil.cone_radius()).max(f64::MIN_POSITIVE) } else { f64::INFINITY }
}

/// Adds E at multiples of `step`, times a weight, to `sum`, up to the frequency `negligible_from`.
///
/// E is smooth between three points: frequency 0, the frequency where the condenser's disc begins to leave the
/// objective's, and the cutoff. A polynomial through few values of each section gives all others.
fn profile(
    overlap: &mut OverlapIntegral,
    pupil: &Pupil,
    direction: [f64; 2],
    step: f64,
    weight: f64,
    negligible_from: f64,
    sum: &mut [[f64; 2]],
) {
    let bend = pupil.objective - pupil.condenser;
    let steepest = pupil.steepest(pupil.objective);
    let cutoff = pupil.cutoff();
    let faded = |f: f64| {
        if negligible_from < cutoff {
            weight * fade((f / negligible_from - FADES_FROM) / (1.0 - FADES_FROM))
        } else {
            weight
        }
    };
    let (mut next, mut values) = (0, Vec::new());
    for [from, to] in [[0.0, bend.min(negligible_from)], [bend, cutoff.min(negligible_from)]] {
        if to < from {
            break;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "indices of the table")]
        let (end, nodes) = (
            ((to / step) as usize + 1).min(sum.len()),
            NODES.0 + (NODES.1 * steepest * (to - from)).min(sum.len() as f64) as usize,
        );
        values.clear();
        let mut integral = |f| overlap.integral(pupil, f, direction);
        if end <= next + nodes {
            values.extend((next..end).map(|i| integral(step * i as f64)));
        } else {
            values.resize(end - next, [0.0; 2]);
            interpolate(&chebyshev([from, to], nodes, integral), step, next, &mut values);
        }
        for ((i, sum), &[re, im]) in sum.iter_mut().enumerate().skip(next).zip(&values) {
            let weight = faded(step * i as f64);
            *sum = [sum[0] + weight * re, sum[1] + weight * im];
        }
        next = end.max(next);
    }
}

/// Samples a pair of smooth functions at Chebyshev points of an interval, including its ends: position, weight of the
/// barycentric formula, values.
fn chebyshev([from, to]: [f64; 2], nodes: usize, mut function: impl FnMut(f64) -> [f64; 2]) -> Vec<[f64; 4]> {
    let last = nodes - 1;
    let node = |i: usize| {
        let x = from + (to - from) * 0.5 * (1.0 - libm::cos(PI * i as f64 / last as f64));
        let end = if i == 0 || i == last { 0.5 } else { 1.0 };
        let [a, b] = function(x);
        [x, if i.is_multiple_of(2) { end } else { -end }, a, b]
    };
    (0..=last).map(node).collect()
}

/// Positions evaluated in parallel.
const LANES: usize = 8;

/// Evaluates the polynomials through Chebyshev points at `step` times `first`, `first` + 1, …: Berrut and Trefethen,
/// DOI 10.1137/S0036144502417715, Eq. 4.2.
#[multiversion(targets = "simd")]
fn interpolate(nodes: &[[f64; 4]], step: f64, first: usize, out: &mut [[f64; 2]]) {
    for (block, out) in out.chunks_mut(LANES).enumerate() {
        let mut x = [0.0; LANES];
        for (lane, x) in x.iter_mut().enumerate() {
            *x = step * (first + LANES * block + lane) as f64;
        }
        let mut sums = [[0.0; LANES]; 3];
        // The formula is singular at a node.
        let mut at_node = [[0.0; LANES]; 3];
        for &[node, weight, a, b] in nodes {
            for l in 0..LANES {
                let away = x[l] - node;
                let (is_node, quotient) = (away == 0.0, weight / away);
                sums[0][l] += quotient;
                sums[1][l] += quotient * a;
                sums[2][l] += quotient * b;
                at_node[0][l] = if is_node { 1.0 } else { at_node[0][l] };
                at_node[1][l] = if is_node { a } else { at_node[1][l] };
                at_node[2][l] = if is_node { b } else { at_node[2][l] };
            }
        }
        for (l, out) in out.iter_mut().enumerate() {
            *out = if at_node[0][l] > 0.0 {
                [at_node[1][l], at_node[2][l]]
            } else {
                [sums[1][l] / sums[0][l], sums[2][l] / sums[0][l]]
            };
        }
    }
}

/// Returns the direction of a table row. Rows are equidistant in y/(|x| + |y|), a substitute for the angle without its
/// arctangent.
fn direction(row: usize) -> [f64; 2] {
    let quarter = DIRECTIONS / 4;
    let t = (row % quarter) as f64 / quarter as f64;
    let length = ((1.0 - t) * (1.0 - t) + t * t).sqrt();
    let (c, s) = ((1.0 - t) / length, t / length);
    match row / quarter {
        0 => [c, s],
        1 => [-s, c],
        2 => [-c, -s],
        _ => [s, -c],
    }
}

/// Returns the table entries around a frequency, in table steps, and their weights, or `None` beyond the last entry.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "indices of the table")]
pub(crate) fn corners([x, y]: [f64; 2]) -> Option<[(usize, f64); 4]> {
    let position = (x * x + y * y).sqrt();
    if position >= (ASYMMETRIC_SAMPLES - 1) as f64 {
        return None;
    }
    let around = (y / (x.abs() + y.abs()).max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0);
    let quarters = match (x >= 0.0, y >= 0.0) {
        (true, true) => around,
        (false, _) => 2.0 - around,
        (true, false) => 4.0 + around,
    };
    let turn = quarters * (DIRECTIONS / 4) as f64;
    let (i, k) = (position as usize, turn as usize);
    let (t, u) = (position - i as f64, turn - k as f64);
    let place = |k: usize, i: usize| (k % DIRECTIONS) * ASYMMETRIC_SAMPLES + i;
    Some([
        (place(k, i), (1.0 - u) * (1.0 - t)),
        (place(k, i + 1), (1.0 - u) * t),
        (place(k + 1, i), u * (1.0 - t)),
        (place(k + 1, i + 1), u * t),
    ])
}

/// Falls smoothly from 1 at t = 0 to 0 at t = 1.
pub(crate) fn fade(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    1.0 - t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MicroscopeParams, Zernike};

    #[test]
    fn interpolated_profiles_match_the_integrals() {
        let mut overlap = OverlapIntegral::default();
        // Condenser NA, depth, stage position, excess cover glass thickness.
        let cases = [
            (0.95, 0.0, 0.0, 0.0),
            (0.9, 10.0, 0.0, 0.0),
            (0.6, 3.0, -4.0, 0.0),
            (0.41, 0.0, 7.0, 0.0),
            (0.41, -4.0, 0.0, 0.0),
            (0.41, 25.0, 0.0, 12.0),
            (0.1, 10.0, 0.0, 0.0),
            (1.2, 1.0, 0.0, 0.0),
        ];
        let mut worst = 0.0_f64;
        for (condenser_na, depth, stage, cover_error_um) in cases {
            let zernike = Zernike { coma: [0.1, 0.0], spherical: 0.05, ..Zernike::default() };
            for zernike in [Zernike::default(), zernike] {
                let params = MicroscopeParams { condenser_na, cover_error_um, zernike, ..MicroscopeParams::default() };
                let pupil = Pupil::new(&params, 0.57, depth, stage);
                let step = pupil.cutoff() / (SAMPLES - 1) as f64;
                let mut list = vec![[0.0; 2]; SAMPLES];
                profile(&mut overlap, &pupil, [0.6, 0.8], step, 1.0, negligible_from(&pupil, true), &mut list);
                for (i, [a, b]) in list.into_iter().enumerate() {
                    let [c, d] = overlap.integral(&pupil, step * i as f64, [0.6, 0.8]);
                    let error = (a - c).abs().max((b - d).abs());
                    let q = TAU * step * i as f64 * pupil.cone_radius();
                    if q < FADES_FROM * NEGLIGIBLE_Q {
                        worst = worst.max(error);
                    } else {
                        assert!(error < 0.01, "the omitted part is too large: {error}");
                    }
                }
            }
        }
        assert!(worst < 3e-4, "{worst}");
    }
}
