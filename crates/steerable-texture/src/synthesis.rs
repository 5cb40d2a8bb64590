use portable_numerics::random::Ziggurat;
use rand_core::Rng;

use crate::autocorrelation::Shaper;
use crate::correlation;
use crate::measure::{magnitudes, phase_doubled};
use crate::moments;
use crate::plane::{Number, Scratch};
use crate::pyramid::times;
use crate::sums::{add_scaled, shift, single, sum};
use crate::{Error, Moments, Pyramid, ScaleStatistics, Statistics, SynthesisParams};

/// Low-pass images with less than this fraction of the variance of the image keep their skewness and kurtosis, which
/// would be those of rounding errors.
const NEGLIGIBLE: f64 = 1e-9;

/// The fraction of the previous change that is added before each iteration.
const MOMENTUM: f32 = 0.8;

/// A plan for the synthesis of images of one size.
#[derive(Debug, Clone)]
pub struct Synthesizer {
    params: SynthesisParams,
    pyramid: Pyramid,
    /// One for each scale, and one for the low-pass residual.
    shapers: Vec<Shaper>,
    ziggurat: Ziggurat,
}

impl Synthesizer {
    /// Plans the transforms and computes the filters.
    ///
    /// # Errors
    ///
    /// If a parameter is out of range, or a side is not a power of two of at least
    /// [`least_side`](crate::TextureParams::least_side) and at most 8192.
    pub fn new(width: usize, height: usize, params: &SynthesisParams) -> Result<Self, Error> {
        params.check()?;
        params.texture.pyramid.check_size(width, height, params.texture.neighbourhood)?;
        let pyramid = Pyramid::new(width, height, &params.texture.pyramid)?;
        let shapers = pyramid.planes.iter().map(|plane| Shaper::new(plane, params.texture.radius())).collect();
        Ok(Self { params: *params, pyramid, shapers, ziggurat: Ziggurat::new() })
    }

    /// Returns the width of an image in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.pyramid.width()
    }

    /// Returns the height of an image in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.pyramid.height()
    }

    /// Synthesizes a new periodic image with these statistics, in row-major order and in their unit. All values are
    /// from `min` to `max` of the statistics.
    ///
    /// # Errors
    ///
    /// If the statistics are invalid or have other parameters.
    pub fn synthesize<R: Rng + ?Sized>(&self, statistics: &Statistics, rng: &mut R) -> Result<Vec<f32>, Error> {
        statistics.check()?;
        if statistics.params != self.params.texture {
            return Err(self.params.texture.mismatch(0));
        }
        // Single precision suffices for any unit, because the computation has standard deviation 1.
        let deviation = statistics.pixels.variance.sqrt();
        let len = self.width() * self.height();
        let finish = |v: f64| single(v).clamp(single(statistics.min), single(statistics.max));
        if deviation <= 0.0 {
            return Ok(vec![finish(statistics.pixels.mean); len]);
        }
        let target = statistics.standardised(deviation);
        let mut image: Vec<f32> = (0..len / 2).flat_map(|_| self.ziggurat.pair(rng)).collect();
        moments::impose(&mut image, &Moments { fourth: 3.0, variance: 1.0, ..Moments::default() });
        let mut scratch = Scratch::default();
        let mut previous = Vec::new();
        for _ in 0..self.params.iterations {
            let start = image.clone();
            if !previous.is_empty() {
                add_scaled(&mut image, &start, MOMENTUM);
                add_scaled(&mut image, &previous, -MOMENTUM);
            }
            previous = start;
            self.impose(&mut image, &target, &mut scratch);
        }
        let mean = statistics.pixels.mean;
        Ok(image.into_iter().map(|v| finish(mean + deviation * f64::from(v))).collect())
    }

    /// Imposes all statistics once, from the coarsest scale to the pixels.
    fn impose(&self, image: &mut Vec<f32>, target: &Statistics, scratch: &mut Scratch) {
        let pyramid = &self.pyramid;
        let scales = self.params.texture.pyramid.scales;
        let spectrum = pyramid.spectrum(image, scratch);
        let mut high_pass = times(&spectrum, &pyramid.split.high);
        let mut levels = vec![times(&spectrum, &pyramid.split.low)];
        for scale in 0..scales {
            levels.push(pyramid.coarser(&levels[scale], scale));
        }
        let mut level = levels.pop().unwrap_or_default();
        level[0] = Number::ZERO;
        self.impose_low_pass(&mut level, target, scales, scratch);
        let mut coarser: Vec<Vec<Number>> = Vec::new();
        for (scale, old) in levels.iter().enumerate().rev() {
            coarser = self.impose_bands(old, &coarser, &target.scales[scale], scale, scratch);
            level = pyramid.finer(&level, scale);
            for (k, real) in coarser.iter().enumerate() {
                pyramid.add_band(&mut level, real, scale, k);
            }
            self.impose_low_pass(&mut level, target, scale, scratch);
        }
        let power: f64 = high_pass.iter().map(|z| f64::from(z.norm_sqr())).sum();
        let factor = if power > 0.0 { single((target.high_pass_variance / power).sqrt()) } else { 0.0 };
        high_pass.iter_mut().for_each(|z| *z *= factor);
        *image = pyramid.planes[0].inverse_real(&pyramid.join(&level, &high_pass), scratch);
        moments::impose(image, &target.pixels);
        let [min, max] = [target.min, target.max].map(single);
        image.iter_mut().for_each(|v| *v = v.clamp(min, max));
    }

    /// Imposes the statistics of the low-pass image of a scale, given by its spectrum.
    fn impose_low_pass(&self, level: &mut Vec<Number>, target: &Statistics, scale: usize, scratch: &mut Scratch) {
        let low_pass = &target.low_pass[scale];
        self.shapers[scale].shape(level, &low_pass.autocovariance);
        if low_pass.moments.variance > NEGLIGIBLE {
            let plane = &self.pyramid.planes[scale];
            let mut values = plane.inverse_real(level, scratch);
            moments::impose(&mut values, &low_pass.moments);
            *level = plane.forward(&values, scratch);
        }
    }

    /// Imposes the statistics of the bands of a scale. Returns the spectra of their real parts.
    fn impose_bands(
        &self,
        level: &[Number],
        coarser: &[Vec<Number>],
        target: &ScaleStatistics,
        scale: usize,
        scratch: &mut Scratch,
    ) -> Vec<Vec<Number>> {
        let pyramid = &self.pyramid;
        let plane = &pyramid.planes[scale];
        let parents: Vec<_> =
            coarser.iter().enumerate().map(|(k, real)| pyramid.enlarged(real, scale, k, scratch)).collect();
        let bands: Vec<_> = (0..target.magnitude_means.len()).map(|k| pyramid.band(level, scale, k, scratch)).collect();
        let old: Vec<_> = bands.iter().map(|band| magnitudes(band)).collect();

        let mut new = old.clone();
        let mut parent_magnitudes: Vec<_> = parents.iter().map(|band| magnitudes(band)).collect();
        new.iter_mut().chain(&mut parent_magnitudes).for_each(|values| centre(values));
        correlation::impose(&mut new, &parent_magnitudes, &target.magnitude_covariance, &target.magnitude_coarser);
        drop(parent_magnitudes);
        for (pair, targets) in new.chunks_mut(2).zip(target.magnitude_autocovariances.chunks(2)) {
            self.shape_pair(pair, targets, scale, scratch);
        }
        let mut real: Vec<Vec<f32>> = Vec::with_capacity(bands.len());
        for (((band, old), new), &mean) in bands.iter().zip(&old).zip(&new).zip(&target.magnitude_means) {
            let mean = single(mean);
            let scaled = |((z, old), new): ((&Number, &f32), &f32)| {
                if *old > 0.0 { z.re * ((mean + new).max(0.0) / old) } else { 0.0 }
            };
            real.push(band.iter().zip(old).zip(new).map(scaled).collect());
        }
        drop((bands, old, new));

        let mut phases = phase_doubled(&parents);
        real.iter_mut().chain(&mut phases).for_each(|values| centre(values));
        correlation::impose(&mut real, &phases, &target.real_covariance, &target.real_coarser);
        let mut spectra = Vec::with_capacity(real.len());
        for pair in real.chunks(2) {
            match pair {
                [a, b] => spectra.extend(plane.forward_pair([a, b], scratch)),
                rest => spectra.extend(rest.iter().map(|values| plane.forward(values, scratch))),
            }
        }
        spectra
    }

    /// Imposes the autocovariances of one or two images.
    fn shape_pair(&self, images: &mut [Vec<f32>], targets: &[Vec<f64>], scale: usize, scratch: &mut Scratch) {
        let plane = &self.pyramid.planes[scale];
        let shaper = &self.shapers[scale];
        match images {
            [a, b] => {
                let mut spectra = plane.forward_pair([a, b], scratch);
                spectra.iter_mut().zip(targets).for_each(|(spectrum, target)| shaper.shape(spectrum, target));
                plane.inverse_pair([&spectra[0], &spectra[1]], [a, b], scratch);
            }
            rest => {
                for (values, target) in rest.iter_mut().zip(targets) {
                    let mut spectrum = plane.forward(values, scratch);
                    shaper.shape(&mut spectrum, target);
                    *values = plane.inverse_real(&spectrum, scratch);
                }
            }
        }
    }
}

/// Subtracts the mean.
fn centre(values: &mut [f32]) {
    let mean = sum(values) / values.len() as f64;
    shift(values, single(-mean));
}
