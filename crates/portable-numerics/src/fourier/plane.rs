use multiversion::multiversion;
use num_complex::Complex;

use super::{LaneFft, Lanes, Real};

/// Fourier transforms of complex images of one size, `N` rows or columns at a time.
///
/// Images are row-major, spectra column-major: frequency (kx, ky) has the index kx · height + ky.
#[derive(Debug, Clone)]
pub struct ComplexPlane<T, const N: usize> {
    width: usize,
    height: usize,
    along_x: LaneFft<T>,
    along_y: LaneFft<T>,
}

/// Working memory of [`ComplexPlane`].
#[derive(Debug, Clone)]
pub struct PlaneScratch<T, const N: usize> {
    /// Transposed lines, in blocks of `N`.
    transposed: Vec<Lanes<T, N>>,
    line: Vec<Lanes<T, N>>,
    spare: Vec<Lanes<T, N>>,
}

impl<T, const N: usize> Default for PlaneScratch<T, N> {
    fn default() -> Self {
        Self { transposed: Vec::new(), line: Vec::new(), spare: Vec::new() }
    }
}

impl<T: Real, const N: usize> PlaneScratch<T, N> {
    fn set_line(&mut self, len: usize) {
        self.line.resize(len, [[T::default(); N]; 2]);
        self.spare.resize(len, [[T::default(); N]; 2]);
    }
}

impl<T: Real, const N: usize> ComplexPlane<T, N> {
    /// Plans the transforms of images of `width` x `height`.
    #[must_use]
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, along_x: LaneFft::new(width), along_y: LaneFft::new(height) }
    }

    /// Computes the spectrum Σ image · exp −2πi (kx x/width + ky y/height).
    ///
    /// # Panics
    ///
    /// If the length of `image` or `spectrum` is not width x height.
    pub fn forward(&self, image: &[Complex<T>], spectrum: &mut [Complex<T>], scratch: &mut PlaneScratch<T, N>) {
        let [width, height] = self.checked(image, spectrum);
        scratch.transposed.resize(width.div_ceil(N) * height, [[T::default(); N]; 2]);
        scratch.set_line(width);
        for (block, rows) in image.chunks(N * width).enumerate() {
            gather(rows, width, false, &mut scratch.line);
            self.along_x.process(&mut scratch.line, &mut scratch.spare);
            transpose_block(&scratch.line, &mut scratch.transposed, height, block * N);
        }
        scratch.set_line(height);
        for (columns, transposed) in spectrum.chunks_mut(N * height).zip(scratch.transposed.chunks_exact(height)) {
            scratch.line.copy_from_slice(transposed);
            self.along_y.process(&mut scratch.line, &mut scratch.spare);
            scatter(&scratch.line, columns, height);
        }
    }

    /// Computes the image of a spectrum, times the number of pixels. Columns for which `is_zero` returns true count as
    /// zero.
    ///
    /// # Panics
    ///
    /// If the length of `image` or `spectrum` is not width x height.
    pub fn inverse(
        &self,
        spectrum: &[Complex<T>],
        is_zero: impl Fn(usize) -> bool,
        image: &mut [Complex<T>],
        scratch: &mut PlaneScratch<T, N>,
    ) {
        let [width, height] = self.checked(image, spectrum);
        scratch.transposed.resize(height.div_ceil(N) * width, [[T::default(); N]; 2]);
        scratch.set_line(height);
        for (block, columns) in spectrum.chunks(N * height).enumerate() {
            let zero: [bool; N] = core::array::from_fn(|l| is_zero(block * N + l));
            if zero.iter().all(|&zero| zero) {
                scratch.line.fill([[T::default(); N]; 2]);
            } else {
                gather(columns, height, true, &mut scratch.line);
                for l in (0..N).filter(|&l| zero[l]) {
                    scratch.line.iter_mut().for_each(|v| (v[0][l], v[1][l]) = (T::default(), T::default()));
                }
                self.along_y.process(&mut scratch.line, &mut scratch.spare);
            }
            transpose_block(&scratch.line, &mut scratch.transposed, width, block * N);
        }
        scratch.set_line(width);
        for (rows, transposed) in image.chunks_mut(N * width).zip(scratch.transposed.chunks_exact(width)) {
            // The inverse transform is the forward one of the reversed sequence.
            scratch.line[0] = transposed[0];
            for (to, from) in scratch.line[1..].iter_mut().zip(transposed[1..].iter().rev()) {
                *to = *from;
            }
            self.along_x.process(&mut scratch.line, &mut scratch.spare);
            scatter(&scratch.line, rows, width);
        }
    }

    fn checked(&self, image: &[Complex<T>], spectrum: &[Complex<T>]) -> [usize; 2] {
        let len = self.width * self.height;
        let lens = [image.len(), spectrum.len()];
        assert!(
            lens == [len; 2],
            "expected {len} numbers, found {} of the image and {} of the spectrum",
            lens[0],
            lens[1]
        );
        [self.width, self.height]
    }
}

/// Interleaves up to `N` sequences of length `len`, reversed if `is_reversed`; unused lanes are 0.
#[multiversion(targets = "simd")]
fn gather<T: Real, const N: usize>(from: &[Complex<T>], len: usize, is_reversed: bool, line: &mut [Lanes<T, N>]) {
    if from.len() < N * len {
        line.fill([[T::default(); N]; 2]);
    }
    for (l, from) in from.chunks_exact(len).enumerate() {
        let mut set = |i: usize, z: &Complex<T>| (line[i][0][l], line[i][1][l]) = (z.re, z.im);
        if is_reversed {
            set(0, &from[0]);
            from[1..].iter().rev().enumerate().for_each(|(i, z)| set(i + 1, z));
        } else {
            from.iter().enumerate().for_each(|(i, z)| set(i, z));
        }
    }
}

/// The inverse of [`gather`].
#[multiversion(targets = "simd")]
fn scatter<T: Real, const N: usize>(line: &[Lanes<T, N>], to: &mut [Complex<T>], len: usize) {
    for (l, to) in to.chunks_exact_mut(len).enumerate() {
        for (to, value) in to.iter_mut().zip(line) {
            *to = Complex::new(value[0][l], value[1][l]);
        }
    }
}

/// Transposes up to `N` sequences, the first of which has the index `first`, into blocks of `N` elements. A block holds
/// `len` sequences.
#[multiversion(targets = "simd")]
fn transpose_block<T: Real, const N: usize>(
    line: &[Lanes<T, N>],
    transposed: &mut [Lanes<T, N>],
    len: usize,
    first: usize,
) {
    let count = N.min(len - first);
    for (line, transposed) in line.chunks(N).zip(transposed.chunks_exact_mut(len)) {
        for (l, to) in transposed[first..first + count].iter_mut().enumerate() {
            for (i, from) in line.iter().enumerate() {
                (to[0][i], to[1][i]) = (from[0][l], from[1][l]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;
    use num_complex::Complex64;

    /// A wave plus irregular numbers.
    fn image(width: usize, height: usize) -> Vec<Complex64> {
        let wave = |i: usize| {
            let phase = 3.0 * (i % width) as f64 / width as f64 - 2.0 * (i / width) as f64 / height as f64;
            let (sin, cos) = libm::sincos(TAU * phase);
            Complex64::new(cos, sin) + Complex64::new((i * i % 7) as f64, (i * i % 11) as f64)
        };
        (0..width * height).map(wave).collect()
    }

    #[test]
    fn spectra_match_the_definition_and_invert() {
        for (width, height) in [(12, 10), (1, 5), (17, 8), (24, 31)] {
            let plane = ComplexPlane::<f64, 8>::new(width, height);
            let (image, mut scratch) = (image(width, height), PlaneScratch::default());
            let mut spectrum = image.clone();
            plane.forward(&image, &mut spectrum, &mut scratch);
            for kx in 0..width {
                for ky in 0..height {
                    let terms = image.iter().enumerate().map(|(i, z)| {
                        let turns =
                            (kx * (i % width)) as f64 / width as f64 + (ky * (i / width)) as f64 / height as f64;
                        let (sin, cos) = libm::sincos(TAU * turns);
                        z * Complex64::new(cos, -sin)
                    });
                    let sum: Complex64 = terms.sum();
                    assert!((sum - spectrum[kx * height + ky]).norm() < 1e-8, "{kx} {ky}");
                }
            }
            let mut back = spectrum.clone();
            plane.inverse(&spectrum, |_| false, &mut back, &mut scratch);
            let samples = (width * height) as f64;
            assert!(back.iter().zip(&image).all(|(a, b)| (a / samples - b).norm() < 1e-11));
            // Columns that are skipped count as zero.
            for is_zero in [|x: usize| x % 3 == 1, |x: usize| x < 9, |_: usize| true] {
                let mut emptied = spectrum.clone();
                for (_, column) in emptied.chunks_exact_mut(height).enumerate().filter(|(x, _)| is_zero(*x)) {
                    column.fill(Complex64::ZERO);
                }
                let mut expected = image.clone();
                plane.inverse(&emptied, |_| false, &mut expected, &mut scratch);
                plane.inverse(&spectrum, is_zero, &mut back, &mut scratch);
                assert_eq!(back, expected);
            }
        }
    }

    #[test]
    #[should_panic(expected = "expected 16 numbers")]
    fn a_wrong_size_is_reported() {
        let mut spectrum = image(4, 4);
        ComplexPlane::<f64, 8>::new(4, 4).forward(&image(4, 3), &mut spectrum, &mut PlaneScratch::default());
    }
}
