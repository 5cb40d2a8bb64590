use crate::autocorrelation::sums;
use crate::plane::{Number, Scratch};
use crate::pyramid::times;
use crate::region;
use crate::sums::{dot, products, shift, single, sum};
use crate::{Error, LowPassStatistics, Moments, Pyramid, ScaleStatistics, Statistics, TextureParams};

/// A plan for measurements of images of one size.
#[derive(Debug, Clone)]
pub struct Analyzer {
    params: TextureParams,
    pyramid: Pyramid,
}

impl Analyzer {
    /// Plans the transforms and computes the filters.
    ///
    /// # Errors
    ///
    /// If a parameter is out of range, or a side is not a power of two of at least [`TextureParams::least_side`] and at
    /// most 8192.
    pub fn new(width: usize, height: usize, params: &TextureParams) -> Result<Self, Error> {
        params.check()?;
        params.pyramid.check_size(width, height, params.neighbourhood)?;
        Ok(Self { params: *params, pyramid: Pyramid::new(width, height, &params.pyramid)? })
    }

    /// Measures an image, which counts as periodic, or its pixels under a mask of weights from 0 to 1.
    ///
    /// Means over pixels have these weights, means over pairs of pixels the products of two. Under a mask, a pixel with
    /// a weight w below 1 is replaced by w times its value and 1 − w times a smooth continuation of the region. The
    /// weight of a pixel of a band is w m⁴, where m is the mean weight of the 5 x 5 pixels around it. At the next
    /// coarser scale, w is the mean of the finer weights around a pixel.
    ///
    /// # Errors
    ///
    /// If a slice has the wrong length, the mask is empty or out of range, or a pixel under the mask is NaN or out of
    /// the range −10⁶ to 10⁶.
    pub fn measure(&self, image: &[f32], mask: Option<&[f32]>) -> Result<Statistics, Error> {
        let pyramid = &self.pyramid;
        let width = pyramid.width();
        region::check(image, width, mask)?;
        if image.len() != width * pyramid.height() {
            return Err(Error::Shape { pixels: image.len(), mask: mask.map_or(image.len(), <[f32]>::len), width });
        }
        let mut weights = mask.map_or_else(|| vec![1.0; image.len()], <[f32]>::to_vec);
        let mut image = image.to_vec();
        region::continue_smoothly(&mut image, &weights, width);

        let [min, max] = range(&image, &weights);
        let mean = mean(&image, &weights);
        let pixels = Moments::measure(&image, &weights, mean);
        // Without the mean, its rounding errors do not add to the bands.
        shift(&mut image, single(-mean));
        let mut scratch = Scratch::default();
        let spectrum = pyramid.spectrum(&image, &mut scratch);
        let high_pass = pyramid.planes[0].inverse_real(&times(&spectrum, &pyramid.split.high), &mut scratch);
        let high_pass_variance = Moments::measure(&high_pass, &region::inner(&weights, width), 0.0).variance;

        let mut level = times(&spectrum, &pyramid.split.low);
        let (mut low_pass, mut scales) = (Vec::new(), Vec::new());
        for scale in 0..=self.params.pyramid.scales {
            let width = pyramid.band_width(scale);
            if scale > 0 {
                weights = region::coarser(&weights, 2 * width);
            }
            let radius = self.params.radius();
            let inner = region::inner(&weights, width);
            let pairs = sums(&inner, width, radius);
            let region = Region { weights: &inner, width, radius, pairs: &pairs };
            let mut values = pyramid.planes[scale].inverse_real(&level, &mut scratch);
            let mean_of_level = mean + region.centre(&mut values);
            let moments = Moments { mean: mean_of_level, ..Moments::measure(&values, &inner, 0.0) };
            low_pass.push(LowPassStatistics { moments, autocovariance: region.autocovariance(&values) });
            if scale < self.params.pyramid.scales {
                let next = pyramid.coarser(&level, scale);
                scales.push(self.scale(&level, &next, scale, &region, &mut scratch));
                level = next;
            }
        }
        Ok(Statistics { params: self.params, pixels, min, max, high_pass_variance, low_pass, scales })
    }

    /// Measures the bands of a scale, given by the spectra of its low-pass image and of the next coarser one.
    fn scale(
        &self,
        level: &[Number],
        next: &[Number],
        scale: usize,
        region: &Region<'_>,
        scratch: &mut Scratch,
    ) -> ScaleStatistics {
        let pyramid = &self.pyramid;
        let orientations = 0..self.params.pyramid.orientations;
        let bands = orientations.clone().map(|k| pyramid.band(level, scale, k, scratch));
        let (mut real, mut magnitude): (Vec<Vec<f32>>, Vec<Vec<f32>>) =
            bands.map(|band| (band.iter().map(|z| z.re).collect(), magnitudes(&band))).unzip();
        let magnitude_means = magnitude.iter_mut().map(|values| region.centre(values)).collect();
        real.iter_mut().for_each(|values| _ = region.centre(values));
        let magnitude_autocovariances = magnitude.iter().map(|values| region.autocovariance(values)).collect();

        let (mut coarse_magnitudes, mut coarse_phases) = (Vec::new(), Vec::new());
        if scale + 1 < self.params.pyramid.scales {
            let real = |k| pyramid.real_spectrum(next, scale + 1, k);
            let bands: Vec<_> = orientations.map(|k| pyramid.enlarged(&real(k), scale, k, scratch)).collect();
            coarse_magnitudes = bands.iter().map(|band| magnitudes(band)).collect();
            coarse_phases = phase_doubled(&bands);
            coarse_magnitudes.iter_mut().chain(&mut coarse_phases).for_each(|values| _ = region.centre(values));
        }
        ScaleStatistics {
            magnitude_means,
            magnitude_autocovariances,
            magnitude_covariance: region.covariance(&magnitude, &magnitude),
            magnitude_coarser: region.covariance(&magnitude, &coarse_magnitudes),
            real_covariance: region.covariance(&real, &real),
            real_coarser: region.covariance(&real, &coarse_phases),
        }
    }
}

/// The pixels of a scale that count.
struct Region<'a> {
    weights: &'a [f32],
    width: usize,
    /// Largest displacement within the window.
    radius: usize,
    /// Sums of the weights of pairs of pixels, for all displacements within the window.
    pairs: &'a [f64],
}

impl Region<'_> {
    /// Subtracts the mean and returns it.
    fn centre(&self, values: &mut [f32]) -> f64 {
        let mean = mean(values, self.weights);
        shift(values, single(-mean));
        mean
    }

    fn weighted(&self, values: &[f32]) -> Vec<f32> {
        values.iter().zip(self.weights).map(|(v, w)| v * w).collect()
    }

    /// Returns the autocovariance of centred values.
    fn autocovariance(&self, values: &[f32]) -> Vec<f64> {
        let products = sums(&self.weighted(values), self.width, self.radius);
        products.iter().zip(self.pairs).map(|(&product, &pairs)| ratio(product, pairs)).collect()
    }

    /// Returns the covariances of centred values.
    fn covariance(&self, rows: &[Vec<f32>], columns: &[Vec<f32>]) -> Vec<f64> {
        let total = sum(self.weights);
        let rows: Vec<_> = rows.iter().map(|row| self.weighted(row)).collect();
        products(&rows, columns).iter().map(|&product| ratio(product, total)).collect()
    }
}

/// Returns a / b, or 0 if nothing was summed.
fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 0.0 }
}

fn mean(values: &[f32], weights: &[f32]) -> f64 {
    ratio(dot(values, weights), sum(weights))
}

/// Returns the smallest and the largest value of the pixels with at least half of the largest weight.
fn range(values: &[f32], weights: &[f32]) -> [f64; 2] {
    let least = 0.5 * weights.iter().copied().fold(0.0, f32::max);
    let inside = values.iter().zip(weights).filter(|&(_, &weight)| weight >= least);
    let [min, max] = inside.fold([f32::INFINITY, f32::NEG_INFINITY], |[min, max], (&v, _)| [min.min(v), max.max(v)]);
    [min, max].map(f64::from)
}

/// Returns the magnitudes of a band.
pub(crate) fn magnitudes(band: &[Number]) -> Vec<f32> {
    band.iter().map(|z| z.norm_sqr().sqrt()).collect()
}

/// Returns bands at twice their phase and with the same magnitude, z² / |z|: all real parts, then all imaginary parts.
pub(crate) fn phase_doubled(bands: &[Vec<Number>]) -> Vec<Vec<f32>> {
    let doubled = |z: &Number, part: fn(&Number) -> f32| {
        let magnitude = z.norm_sqr().sqrt();
        if magnitude > 0.0 { part(&(z * z)) / magnitude } else { 0.0 }
    };
    let parts: [fn(&Number) -> f32; 2] = [|z| z.re, |z| z.im];
    let images = parts.into_iter().flat_map(|part| bands.iter().map(move |band| (band, part)));
    images.map(|(band, part)| band.iter().map(|z| doubled(z, part)).collect()).collect()
}
