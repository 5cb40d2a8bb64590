use portable_numerics::fourier::{Complex, ComplexPlane, PlaneScratch};

/// A complex number of a spectrum or a band.
pub(crate) type Number = Complex<f32>;

/// Fourier transforms of images of one size. A spectrum is the mean of image · exp −2πi k·x over all pixels, so that
/// spectra of several resolutions have the same unit. Spectra are column-major.
#[derive(Debug, Clone)]
pub(crate) struct Plane {
    pub(crate) width: usize,
    pub(crate) height: usize,
    fft: ComplexPlane<f32, 16>,
}

/// Working memory of transforms.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    fft: PlaneScratch<f32, 16>,
    image: Vec<Number>,
    spectrum: Vec<Number>,
}

impl Plane {
    pub(crate) fn new(width: usize, height: usize) -> Self {
        Self { width, height, fft: ComplexPlane::new(width, height) }
    }

    pub(crate) fn len(&self) -> usize {
        self.width * self.height
    }

    /// Returns the spectrum of a real image.
    pub(crate) fn forward(&self, image: &[f32], scratch: &mut Scratch) -> Vec<Number> {
        let factor = 1.0 / self.len() as f32;
        scratch.image.clear();
        scratch.image.extend(image.iter().map(|&v| Number::new(factor * v, 0.0)));
        let mut spectrum = vec![Number::ZERO; self.len()];
        self.fft.forward(&scratch.image, &mut spectrum, &mut scratch.fft);
        spectrum
    }

    /// Returns the spectra of two real images by one transform.
    pub(crate) fn forward_pair(&self, images: [&[f32]; 2], scratch: &mut Scratch) -> [Vec<Number>; 2] {
        let factor = 0.5 / self.len() as f32;
        scratch.image.clear();
        scratch.image.extend(images[0].iter().zip(images[1]).map(|(&a, &b)| Number::new(factor * a, factor * b)));
        scratch.spectrum.resize(self.len(), Number::ZERO);
        self.fft.forward(&scratch.image, &mut scratch.spectrum, &mut scratch.fft);
        let mut pair = [0, 1].map(|_| Vec::with_capacity(self.len()));
        let height = self.height;
        for kx in 0..self.width {
            let column = &scratch.spectrum[kx * height..][..height];
            let opposite = &scratch.spectrum[(self.width - kx) % self.width * height..][..height];
            // Z(k) = A(k) + iB(k), and A and B have conjugate values at opposite frequencies.
            let mirrored = core::iter::once(&opposite[0]).chain(opposite[1..].iter().rev());
            let [first, second] = &mut pair;
            for (z, m) in column.iter().zip(mirrored) {
                first.push(Number::new(z.re + m.re, z.im - m.im));
                second.push(Number::new(z.im + m.im, m.re - z.re));
            }
        }
        pair
    }

    /// Returns the complex image of a spectrum whose columns are zero where `is_zero` returns true.
    pub(crate) fn inverse(
        &self,
        spectrum: &[Number],
        is_zero: impl Fn(usize) -> bool,
        scratch: &mut Scratch,
    ) -> Vec<Number> {
        let mut image = vec![Number::ZERO; self.len()];
        self.fft.inverse(spectrum, is_zero, &mut image, &mut scratch.fft);
        image
    }

    /// Returns the real image of a spectrum.
    pub(crate) fn inverse_real(&self, spectrum: &[Number], scratch: &mut Scratch) -> Vec<f32> {
        scratch.image.resize(self.len(), Number::ZERO);
        self.fft.inverse(spectrum, |_| false, &mut scratch.image, &mut scratch.fft);
        scratch.image.iter().map(|z| z.re).collect()
    }

    /// Overwrites two real images with those of two spectra, by one transform.
    pub(crate) fn inverse_pair(&self, spectra: [&[Number]; 2], images: [&mut [f32]; 2], scratch: &mut Scratch) {
        scratch.spectrum.clear();
        let sums = spectra[0].iter().zip(spectra[1]).map(|(a, b)| Number::new(a.re - b.im, a.im + b.re));
        scratch.spectrum.extend(sums);
        scratch.image.resize(self.len(), Number::ZERO);
        self.fft.inverse(&scratch.spectrum, |_| false, &mut scratch.image, &mut scratch.fft);
        let [first, second] = images;
        for ((z, a), b) in scratch.image.iter().zip(first).zip(second) {
            (*a, *b) = (z.re, z.im);
        }
    }
}

/// Calls `copy` with each pair of ranges of a fine and a coarse spectrum that hold the same frequencies. The coarse
/// grid has half the size, and its frequencies are the lower half of those of the fine grid. `[width, height]` is the
/// size of the fine grid; each range is a part of a column.
pub(crate) fn shared_columns(
    [width, height]: [usize; 2],
    mut copy: impl FnMut(core::ops::Range<usize>, core::ops::Range<usize>),
) {
    let (half_width, half_height) = (width / 2, height / 2);
    let quarter = height / 4;
    for kx in 0..half_width {
        let fine_kx = if 2 * kx < half_width { kx } else { kx + half_width };
        let (fine, coarse) = (fine_kx * height, kx * half_height);
        copy(fine..fine + quarter, coarse..coarse + quarter);
        copy(fine + height - quarter..fine + height, coarse + quarter..coarse + half_height);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_match_single_images_and_invert() {
        for (width, height) in [(16, 8), (8, 32)] {
            let plane = Plane::new(width, height);
            let mut scratch = Scratch::default();
            let images = [3, 5].map(|p| (0..width * height).map(|i| (i * i % (4 * p + 1)) as f32).collect::<Vec<_>>());
            let pair = plane.forward_pair([&images[0], &images[1]], &mut scratch);
            for (image, spectrum) in images.iter().zip(&pair) {
                let single = plane.forward(image, &mut scratch);
                assert!(single.iter().zip(spectrum).all(|(a, b)| (a - b).norm() < 1e-5));
                let back = plane.inverse_real(spectrum, &mut scratch);
                assert!(back.iter().zip(image).all(|(a, b)| (a - b).abs() < 1e-4));
            }
            let mut back = images.clone();
            back.iter_mut().for_each(|image| image.fill(0.0));
            let [first, second] = &mut back;
            plane.inverse_pair([&pair[0], &pair[1]], [first, second], &mut scratch);
            assert!(back.iter().flatten().zip(images.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-4));
        }
    }
}
