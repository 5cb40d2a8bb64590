use crate::autocorrelation::count;
use crate::{Analyzer, Error, Moments, PyramidParams, TextureParams};

/// The joint statistics of a texture: plain numbers, of which images of any size can be synthesized.
///
/// All are means over pixels (or pairs of pixels), not correlation coefficients, so that their averages over several
/// regions are meaningful.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(remote = "Self", deny_unknown_fields))]
pub struct Statistics {
    /// The parameters of the measurement.
    pub params: TextureParams,
    /// Moments of the pixels.
    pub pixels: Moments,
    /// Smallest pixel.
    pub min: f64,
    /// Largest pixel.
    pub max: f64,
    /// Mean square of the high-pass residual.
    pub high_pass_variance: f64,
    /// The low-pass image of each scale, finest first, then the low-pass residual.
    pub low_pass: Vec<LowPassStatistics>,
    /// The oriented bands of each scale, finest first.
    pub scales: Vec<ScaleStatistics>,
}

/// Statistics of the low-pass image of a scale: all bands of this and of coarser scales together.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct LowPassStatistics {
    /// Moments of the pixels.
    pub moments: Moments,
    /// Autocovariances, for one of each pair of opposite displacements within the window: (0, 0), the rest of this row
    /// to the right, then each row below from left to right. (n² + 1) / 2 numbers for a window of n x n.
    pub autocovariance: Vec<f64>,
}

/// Statistics of the K oriented bands of a scale.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ScaleStatistics {
    /// Mean magnitude of each band.
    pub magnitude_means: Vec<f64>,
    /// Autocovariances of the magnitudes of each band, as [`LowPassStatistics::autocovariance`].
    pub magnitude_autocovariances: Vec<Vec<f64>>,
    /// Covariances of the magnitudes of this scale, K x K, row-major.
    pub magnitude_covariance: Vec<f64>,
    /// Covariances of the magnitudes (rows) with those of the next coarser scale (columns), K x K. Empty for the
    /// coarsest scale.
    pub magnitude_coarser: Vec<f64>,
    /// Covariances of the real parts of this scale, K x K.
    pub real_covariance: Vec<f64>,
    /// Covariances of the real parts (rows) with the bands of the next coarser scale at twice their phase (columns:
    /// K real parts, then K imaginary parts), K x 2K. Empty for the coarsest scale.
    pub real_coarser: Vec<f64>,
}

impl Statistics {
    /// Measures an image of any size, or its pixels under a mask of weights from 0 to 1.
    ///
    /// If a side is not a power of two of at least [`TextureParams::least_side`], the image is enlarged to the next by
    /// a smooth continuation with weight 0. Otherwise it counts as periodic. To measure many images of one size, use an
    /// [`Analyzer`].
    ///
    /// # Errors
    ///
    /// If parameters are out of range, the slices have different lengths, the mask is empty or out of range, or a pixel
    /// under the mask is NaN or out of the range −10⁶ to 10⁶.
    pub fn measure(image: &[f32], width: usize, mask: Option<&[f32]>, params: &TextureParams) -> Result<Self, Error> {
        params.check()?;
        crate::region::check(image, width, mask)?;
        let height = image.len() / width;
        let [to_width, to_height] = [width, height].map(|side| side.next_power_of_two().max(params.least_side()));
        let analyzer = Analyzer::new(to_width, to_height, params)?;
        if [to_width, to_height] == [width, height] {
            return analyzer.measure(image, mask);
        }
        let enlarged = |from: &dyn Fn(usize) -> f32| {
            let mut to = vec![0.0; to_width * to_height];
            for (i, to) in to.chunks_exact_mut(to_width).take(height).enumerate() {
                to[..width].iter_mut().enumerate().for_each(|(j, to)| *to = from(i * width + j));
            }
            to
        };
        let weights = enlarged(&|i| mask.map_or(1.0, |mask| mask[i]));
        analyzer.measure(&enlarged(&|i| image[i]), Some(&weights))
    }

    /// Returns the weighted mean of the statistics of several regions.
    ///
    /// # Errors
    ///
    /// If the list is empty, the parameters differ, statistics are invalid, or the weights are negative, not finite or
    /// all 0.
    pub fn mean(list: &[(&Self, f64)]) -> Result<Self, Error> {
        let total: f64 = list.iter().map(|(_, weight)| weight).sum();
        let (Some((first, _)), true) = (list.first(), total > 0.0 && total.is_finite()) else {
            return Err(Error::Weights);
        };
        let mut mean = (*first).clone();
        mean.numbers().for_each(|number| *number = 0.0);
        for (index, (statistics, weight)) in list.iter().enumerate() {
            if *weight < 0.0 {
                return Err(Error::Weights);
            }
            if statistics.params != first.params {
                return Err(first.params.mismatch(index));
            }
            statistics.check()?;
            let mut statistics = (*statistics).clone();
            let fraction = weight / total;
            mean.numbers().zip(statistics.numbers()).for_each(|(to, from)| *to += fraction * *from);
        }
        Ok(mean)
    }

    /// Checks statistics from a file or a computation.
    ///
    /// # Errors
    ///
    /// If a parameter is out of range, a list has the wrong length, a number is not finite, or a variance is negative.
    pub fn check(&self) -> Result<(), Error> {
        self.params.check()?;
        let PyramidParams { scales, orientations: k } = self.params.pyramid;
        let window = count(self.params.radius());
        let expect = |holds: bool, field, accepted: String| {
            if holds { Ok(()) } else { Err(Error::Statistics { field, accepted }) }
        };
        let list = |values: &[f64], field, len: usize| {
            expect(values.len() == len, field, format!("{len} numbers, found {}", values.len()))
        };
        expect(self.low_pass.len() == scales + 1, "low_pass", format!("{} entries", scales + 1))?;
        expect(self.scales.len() == scales, "scales", format!("{scales} entries"))?;
        for low_pass in &self.low_pass {
            list(&low_pass.autocovariance, "low_pass.autocovariance", window)?;
        }
        for (index, scale) in self.scales.iter().enumerate() {
            let parents = if index + 1 < scales { k } else { 0 };
            list(&scale.magnitude_means, "scales.magnitude_means", k)?;
            let field = "scales.magnitude_autocovariances";
            expect(scale.magnitude_autocovariances.len() == k, field, format!("{k} lists"))?;
            for values in &scale.magnitude_autocovariances {
                list(values, field, window)?;
            }
            list(&scale.magnitude_covariance, "scales.magnitude_covariance", k * k)?;
            list(&scale.magnitude_coarser, "scales.magnitude_coarser", k * parents)?;
            list(&scale.real_covariance, "scales.real_covariance", k * k)?;
            list(&scale.real_coarser, "scales.real_coarser", 2 * k * parents)?;
        }
        let is_finite = self.clone().numbers().all(|number| number.abs() <= 1e30);
        expect(is_finite, "a number", "finite numbers from -1e30 to 1e30".into())?;
        expect(self.min <= self.max, "min", format!("at most max, {}", self.max))?;
        let moments = self.low_pass.iter().map(|low_pass| &low_pass.moments).chain([&self.pixels]);
        let diagonals = self.scales.iter().flat_map(|scale| {
            let covariances = [&scale.magnitude_covariance, &scale.real_covariance];
            covariances.into_iter().flat_map(move |values| values.iter().step_by(k + 1))
        });
        let variances = moments.flat_map(|moments| [&moments.variance, &moments.fourth]).chain(diagonals);
        let is_positive = variances.chain([&self.high_pass_variance]).all(|&variance| variance >= 0.0);
        expect(is_positive, "a variance or fourth moment", "numbers of at least 0".into())
    }

    /// Returns the statistics with all numbers rounded to significant digits, for short files.
    #[must_use]
    pub fn rounded(&self, digits: usize) -> Self {
        let mut result = self.clone();
        for number in result.numbers().filter(|number| **number != 0.0) {
            let decimals = digits as f64 - 1.0 - libm::floor(libm::log10(number.abs()));
            let scale = libm::exp10(decimals);
            *number = libm::round(*number * scale) / scale;
        }
        result
    }

    /// Returns the statistics of (x − mean) / deviation.
    pub(crate) fn standardised(&self, deviation: f64) -> Self {
        let mean = self.pixels.mean;
        let by = 1.0 / deviation;
        let square = by * by;
        let mut result = self.clone();
        let moments = |moments: &mut Moments| {
            moments.mean = (moments.mean - mean) * by;
            moments.variance *= square;
            moments.third *= square * by;
            moments.fourth *= square * square;
        };
        moments(&mut result.pixels);
        result.min = (self.min - mean) * by;
        result.max = (self.max - mean) * by;
        result.high_pass_variance *= square;
        for low_pass in &mut result.low_pass {
            moments(&mut low_pass.moments);
            // The mean of a periodic image is that of its low-pass residual, which is subtracted.
            low_pass.moments.mean = 0.0;
            low_pass.autocovariance.iter_mut().for_each(|v| *v *= square);
        }
        for scale in &mut result.scales {
            scale.magnitude_means.iter_mut().for_each(|v| *v *= by);
            let lists = [
                &mut scale.magnitude_covariance,
                &mut scale.magnitude_coarser,
                &mut scale.real_covariance,
                &mut scale.real_coarser,
            ];
            lists.into_iter().chain(&mut scale.magnitude_autocovariances).flatten().for_each(|v| *v *= square);
        }
        result
    }

    /// Returns all numbers, in a fixed order.
    fn numbers(&mut self) -> impl Iterator<Item = &mut f64> {
        fn of(moments: &mut Moments) -> [&mut f64; 4] {
            let Moments { mean, variance, third, fourth } = moments;
            [mean, variance, third, fourth]
        }
        let pixels = of(&mut self.pixels).into_iter();
        let low_pass = self.low_pass.iter_mut();
        let low_pass =
            low_pass.flat_map(|low_pass| of(&mut low_pass.moments).into_iter().chain(&mut low_pass.autocovariance));
        let scales = self.scales.iter_mut().flat_map(|scale| {
            let ScaleStatistics {
                magnitude_means,
                magnitude_autocovariances,
                magnitude_covariance,
                magnitude_coarser,
                real_covariance,
                real_coarser,
            } = scale;
            let lists = magnitude_means.iter_mut().chain(magnitude_autocovariances.iter_mut().flatten());
            lists.chain(magnitude_covariance).chain(magnitude_coarser).chain(real_covariance).chain(real_coarser)
        });
        pixels.chain([&mut self.min, &mut self.max, &mut self.high_pass_variance]).chain(low_pass).chain(scales)
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Statistics {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

/// Reads and checks statistics.
#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for Statistics {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let statistics = Self::deserialize(deserializer)?;
        statistics.check().map_err(serde::de::Error::custom)?;
        Ok(statistics)
    }
}
