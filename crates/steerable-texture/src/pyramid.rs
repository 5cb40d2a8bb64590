use crate::filters::{ScaleFilters, Split};
use crate::plane::{Number, Plane, Scratch, shared_columns};
use crate::{Error, PyramidParams};

/// A complex steerable pyramid for images of one size: a plan of its filters and transforms.
///
/// The image is split into a high-pass residual, `scales` octaves of `orientations` complex bands each, and a low-pass
/// residual (the paper's "steerable pyramid"). Band (s, k) contains the frequencies around π/2^(s+1) radians per pixel
/// in the direction πk/K, x right and y down: orientation 0 responds to changes along x. Its real part is the response
/// of a steerable filter, its imaginary part that of the filter in quadrature.
///
/// Bands have the unit of the image. With the mean square of the real parts, the mean squares of all bands and both
/// residuals sum to that of the image.
#[derive(Debug, Clone)]
pub struct Pyramid {
    pub(crate) params: PyramidParams,
    pub(crate) split: Split,
    /// The grids of all scales, finest first, then that of the low-pass residual.
    pub(crate) planes: Vec<Plane>,
    pub(crate) filters: Vec<ScaleFilters>,
}

/// The parts of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Bands {
    /// High-pass residual, as large as the image.
    pub high_pass: Vec<f32>,
    /// Bands of each scale, finest first, by orientation. Scale s has 2^s times fewer pixels in each direction.
    pub oriented: Vec<Vec<Band>>,
    /// Low-pass residual, with 2^scales times fewer pixels in each direction.
    pub low_pass: Vec<f32>,
}

/// A complex band, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// Real part.
    pub real: Vec<f32>,
    /// Imaginary part.
    pub imaginary: Vec<f32>,
}

impl Pyramid {
    /// Plans the transforms and computes the filters.
    ///
    /// # Errors
    ///
    /// If a parameter is out of range, or a side is not a power of two of at least 4 · 2^scales and at most 8192.
    pub fn new(width: usize, height: usize, params: &PyramidParams) -> Result<Self, Error> {
        params.check()?;
        params.check_size(width, height, 1)?;
        let planes: Vec<_> = (0..=params.scales).map(|scale| Plane::new(width >> scale, height >> scale)).collect();
        let filters = planes[..params.scales].iter();
        let filters = filters.map(|plane| ScaleFilters::new(plane.width, plane.height, params.orientations)).collect();
        Ok(Self { params: *params, split: Split::new(width, height), planes, filters })
    }

    /// Returns the width of an image in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.planes[0].width
    }

    /// Returns the height of an image in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.planes[0].height
    }

    /// Returns the width of the bands of a scale in pixels, or of the low-pass residual for the scale after the last.
    #[must_use]
    pub fn band_width(&self, scale: usize) -> usize {
        self.width() >> scale
    }

    /// Splits an image. The image counts as periodic.
    ///
    /// # Panics
    ///
    /// If the image does not have `width` x `height` pixels.
    #[must_use]
    pub fn decompose(&self, image: &[f32]) -> Bands {
        let mut scratch = Scratch::default();
        let spectrum = self.spectrum(image, &mut scratch);
        let high_pass = self.planes[0].inverse_real(&times(&spectrum, &self.split.high), &mut scratch);
        let mut level = times(&spectrum, &self.split.low);
        let mut oriented = Vec::with_capacity(self.params.scales);
        for scale in 0..self.params.scales {
            let bands = (0..self.params.orientations).map(|k| {
                let band = self.band(&level, scale, k, &mut scratch);
                Band { real: band.iter().map(|z| z.re).collect(), imaginary: band.iter().map(|z| z.im).collect() }
            });
            oriented.push(bands.collect());
            level = self.coarser(&level, scale);
        }
        let low_pass = self.planes[self.params.scales].inverse_real(&level, &mut scratch);
        Bands { high_pass, oriented, low_pass }
    }

    /// Joins the parts of an image: the inverse of [`decompose`](Self::decompose). Imaginary parts are not used.
    ///
    /// # Panics
    ///
    /// If a band is missing or has another size than those of `decompose`.
    #[must_use]
    pub fn reconstruct(&self, bands: &Bands) -> Vec<f32> {
        let mut scratch = Scratch::default();
        let counts: Vec<usize> = bands.oriented.iter().map(Vec::len).collect();
        assert_eq!(
            counts,
            vec![self.params.orientations; self.params.scales],
            "the bands must be those of the pyramid"
        );
        let mut spectrum_of = |values: &[f32], scale: usize| {
            let len = self.planes[scale].len();
            assert_eq!(values.len(), len, "a band of scale {scale} must have {len} pixels");
            self.planes[scale].forward(values, &mut scratch)
        };
        let mut level = spectrum_of(&bands.low_pass, self.params.scales);
        for (scale, of_scale) in bands.oriented.iter().enumerate().rev() {
            level = self.finer(&level, scale);
            for (k, band) in of_scale.iter().enumerate() {
                self.add_band(&mut level, &spectrum_of(&band.real, scale), scale, k);
            }
        }
        let high_pass = spectrum_of(&bands.high_pass, 0);
        self.planes[0].inverse_real(&self.join(&level, &high_pass), &mut scratch)
    }

    pub(crate) fn spectrum(&self, image: &[f32], scratch: &mut Scratch) -> Vec<Number> {
        let [width, height] = [self.width(), self.height()];
        assert_eq!(image.len(), width * height, "the image must have {width} x {height} pixels");
        self.planes[0].forward(image, scratch)
    }

    /// Returns a complex band from the spectrum of the low-pass image of its scale.
    pub(crate) fn band(&self, level: &[Number], scale: usize, k: usize, scratch: &mut Scratch) -> Vec<Number> {
        let phase = self.phase();
        let filter = &self.filters[scale].oriented[k];
        // Twice the half plane: the real part is the response of the filter on the complete plane.
        let spectrum: Vec<_> = level.iter().zip(filter).map(|(z, &f)| z * phase * (2.0 * f.max(0.0))).collect();
        let plane = &self.planes[scale];
        let columns = filter.chunks_exact(plane.height);
        let is_zero: Vec<bool> = columns.map(|column| column.iter().all(|&f| f <= 0.0)).collect();
        // The transform has more lanes than small grids have columns.
        plane.inverse(&spectrum, |kx| is_zero.get(kx).is_none_or(|&is_zero| is_zero), scratch)
    }

    /// Returns the spectrum of the real part of a band from that of the low-pass image of its scale.
    pub(crate) fn real_spectrum(&self, level: &[Number], scale: usize, k: usize) -> Vec<Number> {
        let phase = self.phase();
        let is_even = self.is_even();
        let filter = self.filters[scale].oriented[k].iter();
        level.iter().zip(filter).map(|(z, &f)| z * phase * if is_even { f.abs() } else { f }).collect()
    }

    /// Adds the part of a band, given by the spectrum of its real part, to the spectrum of the low-pass image of its
    /// scale.
    pub(crate) fn add_band(&self, level: &mut [Number], real: &[Number], scale: usize, k: usize) {
        let back = self.phase().conj();
        let is_even = self.is_even();
        for ((to, z), &f) in level.iter_mut().zip(real).zip(&self.filters[scale].oriented[k]) {
            *to += z * back * if is_even { f.abs() } else { f };
        }
    }

    /// Returns the spectrum of the low-pass image of the next coarser scale.
    pub(crate) fn coarser(&self, level: &[Number], scale: usize) -> Vec<Number> {
        let plane = &self.planes[scale];
        let mut coarse = vec![Number::ZERO; self.planes[scale + 1].len()];
        let low = &self.filters[scale].low;
        shared_columns([plane.width, plane.height], |fine, to| {
            for ((to, z), &f) in coarse[to].iter_mut().zip(&level[fine.clone()]).zip(&low[fine]) {
                *to = z * f;
            }
        });
        coarse
    }

    /// Returns the part of the low-pass image of a scale that the next coarser scale contains.
    pub(crate) fn finer(&self, coarse: &[Number], scale: usize) -> Vec<Number> {
        let plane = &self.planes[scale];
        let mut level = vec![Number::ZERO; plane.len()];
        let low = &self.filters[scale].low;
        shared_columns([plane.width, plane.height], |fine, from| {
            for ((to, z), &f) in level[fine.clone()].iter_mut().zip(&coarse[from]).zip(&low[fine]) {
                *to = z * f;
            }
        });
        level
    }

    /// Returns the spectrum of an image from those of its finest low-pass image and its high-pass residual.
    pub(crate) fn join(&self, level: &[Number], high_pass: &[Number]) -> Vec<Number> {
        let Split { low, high } = &self.split;
        let parts = level.iter().zip(low).zip(high_pass.iter().zip(high));
        parts.map(|((z, &low), (h, &high))| z * low + h * high).collect()
    }

    /// Returns the complex band of the next coarser scale with the resolution of `scale`, from the spectrum of its real
    /// part.
    pub(crate) fn enlarged(&self, real: &[Number], scale: usize, k: usize, scratch: &mut Scratch) -> Vec<Number> {
        let plane = &self.planes[scale];
        let mut spectrum = vec![Number::ZERO; plane.len()];
        let filter = &self.filters[scale + 1].oriented[k];
        shared_columns([plane.width, plane.height], |fine, from| {
            for ((to, z), &f) in spectrum[fine].iter_mut().zip(&real[from.clone()]).zip(&filter[from]) {
                *to = if f > 0.0 { 2.0 * z } else { Number::ZERO };
            }
        });
        // The middle half of the columns is above the highest frequency of the coarser scale.
        let is_zero = |kx: usize| 4 * kx >= plane.width && 4 * kx < 3 * plane.width;
        plane.inverse(&spectrum, is_zero, scratch)
    }

    /// Returns whether the filters of the real parts are even functions of the frequency.
    fn is_even(&self) -> bool {
        !self.params.orientations.is_multiple_of(2)
    }

    /// Returns (−i)^(K−1): the factor that makes a filter real whose angular function has K − 1 sign changes in half a
    /// turn.
    fn phase(&self) -> Number {
        [Number::new(1.0, 0.0), Number::new(0.0, -1.0), Number::new(-1.0, 0.0), Number::new(0.0, 1.0)]
            [(self.params.orientations - 1) % 4]
    }
}

/// Multiplies a spectrum by a filter.
pub(crate) fn times(spectrum: &[Number], filter: &[f32]) -> Vec<Number> {
    spectrum.iter().zip(filter).map(|(z, &f)| z * f).collect()
}
