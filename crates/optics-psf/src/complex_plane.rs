use std::sync::Arc;

use rustfft::num_complex::Complex64;
use rustfft::{Fft as Transform, FftDirection};

use crate::fft::{Fft, transpose};

/// A complex image and its spectrum, in double precision. The spectrum lies column after column.
pub(crate) struct ComplexPlane {
    width: usize,
    height: usize,
    /// Forward and inverse.
    rows: [Arc<dyn Transform<f64>>; 2],
    columns: [Arc<dyn Transform<f64>>; 2],
    pub(crate) field: Vec<Complex64>,
    pub(crate) spectrum: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

impl ComplexPlane {
    pub(crate) fn new(width: usize, height: usize, fft: Fft) -> Self {
        let plan = |len| [FftDirection::Forward, FftDirection::Inverse].map(|direction| fft.plan(len, direction));
        let (rows, columns) = (plan(width), plan(height));
        let longest = rows.iter().chain(&columns).map(|t| t.get_inplace_scratch_len()).max();
        let blank = vec![Complex64::ZERO; width * height];
        let scratch = vec![Complex64::ZERO; longest.unwrap_or(0)];
        Self { width, height, rows, columns, field: blank.clone(), spectrum: blank, scratch }
    }

    /// Spectrum of the field, which is lost.
    pub(crate) fn forward(&mut self) {
        self.rows[0].process_with_scratch(&mut self.field, &mut self.scratch);
        transpose(&self.field, self.width, &mut self.spectrum);
        self.columns[0].process_with_scratch(&mut self.spectrum, &mut self.scratch);
    }

    /// Field of the spectrum, which is lost, times the number of samples. Columns for which
    /// `is_dark` are taken for empty.
    pub(crate) fn inverse(&mut self, is_dark: impl Fn(usize) -> bool) {
        for (x, column) in self.spectrum.chunks_exact_mut(self.height).enumerate() {
            if is_dark(x) {
                column.fill(Complex64::ZERO);
            } else {
                self.columns[1].process_with_scratch(column, &mut self.scratch);
            }
        }
        transpose(&self.spectrum, self.height, &mut self.field);
        self.rows[1].process_with_scratch(&mut self.field, &mut self.scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_undoes_forward_and_frequencies_are_where_they_should_be() {
        for fft in [Fft::Fastest, Fft::Portable] {
            let (width, height) = (12, 10);
            let mut plane = ComplexPlane::new(width, height, fft);
            let wave = |i: usize| {
                let phase = 3.0 * (i % width) as f64 / 12.0 - 2.0 * (i / width) as f64 / 10.0;
                let (re, im) = crate::pupil::turn(phase);
                Complex64::new(re, im)
            };
            let field: Vec<Complex64> = (0..width * height).map(wave).collect();
            plane.field.copy_from_slice(&field);
            plane.forward();
            for (i, value) in plane.spectrum.iter().enumerate() {
                let expected = if i == 3 * height + 8 { 120.0 } else { 0.0 };
                assert!((value - expected).norm() < 1e-8);
            }
            plane.inverse(|x| x != 3);
            assert!(plane.field.iter().zip(&field).all(|(a, b)| (a / 120.0 - b).norm() < 1e-10));
        }
    }
}
