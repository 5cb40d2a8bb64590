use core::f64::consts::TAU;

use crate::Microscope;
use crate::lens::Lens;
use crate::pupil::Pupil;

/// Samples from frequency 0 to the cutoff: linear interpolation errs by less than 6e-4.
const SAMPLES: usize = 401;
/// The same where the pupil is not round, and directions around.
const SIDED_SAMPLES: usize = 129;
const DIRECTIONS: usize = 64;

/// Weak-object transfer functions: how detail of one frequency, at one depth, reaches the image.
///
/// An object that absorbs A and delays light by φ rad, both small, gives the intensity
/// 1 − ln 10 · H_A ⊗ A − 2 H_P ⊗ φ, with
///
/// H_A(f) = 1/S₀ ∫ circ(|s + f|) cos 2π[W(s + f) − W(s)] ds and
/// H_P(f) = 1/S₀ ∫ circ(|s + f|) sin 2π[W(s + f) − W(s)] ds,
///
/// the integrals over the part of the condenser's disc inside the objective's, whose area is S₀,
/// and circ the objective's aperture NA/λ (slices of Streibl's three-dimensional transfer
/// functions, DOI 10.1364/JOSAA.2.000121). With coma or astigmatism they depend on direction, and
/// with coma they are complex; they are averaged over the band of wavelengths.
#[derive(Debug, Clone, PartialEq)]
pub struct Transfer {
    step: f64,
    shape: Shape,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Shape {
    /// (H_A, H_P) at multiples of the step.
    Round(Vec<[f64; 2]>),
    /// The same, complex, one row of frequencies for each direction around the circle.
    Sided(Vec<[[f64; 2]; 2]>),
}

impl Transfer {
    pub(crate) fn new(microscope: &Microscope, depth_um: f64, stage_um: f64) -> Self {
        let mut lens = Lens::default();
        let pupils: Vec<(Pupil, f64)> = microscope
            .bands()
            .into_iter()
            .map(|(wavelength, weight)| (Pupil::new(microscope.params(), wavelength, depth_um, stage_um), weight))
            .collect();
        let mut at = |f: f64, direction: [f64; 2]| {
            let mut mean = [0.0; 2];
            for (pupil, weight) in &pupils {
                // Nothing is blurred that has no detail, whatever the rounding of the quadrature.
                let [re, im] = if f == 0.0 { [1.0, 0.0] } else { lens.integral(pupil, f, direction) };
                mean[0] += weight * re;
                mean[1] += weight * im;
            }
            mean
        };
        if microscope.params().zernike.is_round() {
            let step = Self::step_of(microscope);
            let table = (0..SAMPLES).map(|i| at(step * i as f64, [1.0, 0.0])).collect();
            return Self { step, shape: Shape::Round(table) };
        }
        let step = Self::step_of(microscope);
        let row = |k: usize| {
            let angle = TAU * k as f64 / DIRECTIONS as f64;
            let direction = [libm::cos(angle), libm::sin(angle)];
            (0..SIDED_SAMPLES).map(|i| at(step * i as f64, direction)).collect::<Vec<_>>()
        };
        let rows: Vec<Vec<[f64; 2]>> = (0..DIRECTIONS).map(row).collect();
        // H_A = (E(f) + E*(−f))/2, H_P = (E(f) − E*(−f))/2i
        let pair = |k: usize, i: usize| {
            let ([a, b], [c, d]) = (rows[k][i], rows[(k + DIRECTIONS / 2) % DIRECTIONS][i]);
            [[0.5 * (a + c), 0.5 * (b - d)], [0.5 * (b + d), 0.5 * (c - a)]]
        };
        let table = (0..DIRECTIONS).flat_map(|k| (0..SIDED_SAMPLES).map(move |i| (k, i))).map(|(k, i)| pair(k, i));
        Self { step, shape: Shape::Sided(table.collect()) }
    }

    /// The distance of a microscope's tables between their entries, cycles/µm.
    pub(crate) fn step_of(microscope: &Microscope) -> f64 {
        let samples = if microscope.params().zernike.is_round() { SAMPLES } else { SIDED_SAMPLES };
        microscope.cutoff() / (samples - 1) as f64
    }

    /// H_A at a frequency in cycles/µm: real and imaginary part. 1 at frequency 0, and 0 beyond
    /// the cutoff.
    #[must_use]
    pub fn absorption(&self, frequency: [f64; 2]) -> [f64; 2] {
        self.at(frequency)[0]
    }

    /// H_P at a frequency in cycles/µm: real and imaginary part. 0 at frequency 0, and beyond
    /// the cutoff.
    #[must_use]
    pub fn phase(&self, frequency: [f64; 2]) -> [f64; 2] {
        self.at(frequency)[1]
    }

    /// H_A and H_P.
    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> [[f64; 2]; 2] {
        let position = (x * x + y * y).sqrt() / self.step;
        match &self.shape {
            Shape::Round(table) => {
                let last = table.len() - 1;
                if position >= last as f64 {
                    return [[0.0; 2]; 2];
                }
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to the last entry")]
                let i = position as usize;
                let t = position - i as f64;
                let mix = |k: usize| [table[i][k] + t * (table[i + 1][k] - table[i][k]), 0.0];
                [mix(0), mix(1)]
            }
            Shape::Sided(table) => {
                if position >= (SIDED_SAMPLES - 1) as f64 {
                    return [[0.0; 2]; 2];
                }
                let turn = libm::atan2(y, x) / TAU;
                let angle = (turn - libm::floor(turn)) * DIRECTIONS as f64;
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to the last entry")]
                let (i, k) = (position as usize, angle as usize);
                let (t, u) = (position - i as f64, angle - k as f64);
                let entry = |k: usize, i: usize| table[(k % DIRECTIONS) * SIDED_SAMPLES + i];
                let corners = [entry(k, i), entry(k, i + 1), entry(k + 1, i), entry(k + 1, i + 1)];
                let weights = [(1.0 - u) * (1.0 - t), (1.0 - u) * t, u * (1.0 - t), u * t];
                let mut mixed = [[0.0; 2]; 2];
                for (corner, weight) in corners.iter().zip(weights) {
                    for (sum, value) in mixed.as_flattened_mut().iter_mut().zip(corner.as_flattened()) {
                        *sum += weight * value;
                    }
                }
                mixed
            }
        }
    }

    /// The frequency beyond which neither H_A nor H_P exceeds `size`, cycles/µm.
    pub(crate) fn extent(&self, size: f64) -> f64 {
        let large = |pair: &[f64; 2]| pair[0] * pair[0] + pair[1] * pair[1] > size * size;
        let last = match &self.shape {
            Shape::Round(table) => table.iter().rposition(large),
            Shape::Sided(table) => {
                let rows = table.chunks_exact(SIDED_SAMPLES);
                rows.filter_map(|row| row.iter().rposition(|pairs| pairs.iter().any(large))).max()
            }
        };
        last.map_or(0.0, |i| self.step * (i + 1) as f64)
    }

    /// Distance between the entries of the table, cycles/µm.
    pub(crate) fn step(&self) -> f64 {
        self.step
    }

    pub(crate) fn shape(&self) -> &Shape {
        &self.shape
    }
}
