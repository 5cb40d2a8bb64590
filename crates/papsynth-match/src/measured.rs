//! Parameters that statistics of real fields measure directly: light, noise, bits.

use papsynth::clipped_noise;
use papsynth_judge::{Control, Detail, FieldImage, NucleiFrom, Phase};
use rayon::prelude::*;

use crate::error::Error;
use crate::noise::{Empty, pattern};
use crate::parameter::Parameter;
use crate::posterior::Estimate;
use crate::recipe::LEVELS;
use crate::regression::min_max;
use crate::sampler::Sampler;
use portable_numerics::statistics::{deviation, mean, quantile};

/// Minimum grey level of an empty slide, of 255.
const DARK: f64 = 20.0;

/// Images with a higher correlation of noise are fused from several planes.
const FUSED: f64 = 0.06;

/// Mean of x² over the grid for the mean of the background in papsynth-judge.
const MEAN_SQUARE: f64 = 0.3667;

/// Systematic error of noise, relative: dirt and texture of the slide add to it.
const NOISE_ERROR: f64 = 0.02;

/// Systematic error of the pattern noise, relative.
const PATTERN_ERROR: f64 = 0.06;

/// Systematic error of a correlation.
const CORRELATION_ERROR: f64 = 0.012;

/// Variance that rounding and dirt add to noise, squared grey levels of 255.
const ADDED: f64 = 0.06;

/// Systematic error of a correlation, relative to the added fraction of the variance: rounding is uncorrelated, and
/// dirt is correlated.
const ADDED_CORRELATION: f64 = 2.0;

/// Systematic error of the level, fraction of full scale; the second one for a field without empty slide.
const LEVEL_ERROR: f64 = 0.003;
const COVERED_ERROR: f64 = 0.025;

/// Systematic error of a curvature.
const FALLOFF_ERROR: f64 = 0.003;

/// Light and noise of real fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Width and height of a field.
    pub size_px: [usize; 2],
    /// Bits per pixel.
    pub bits: u32,
    /// Whether noise is correlated between pixels: the images are fused from several planes.
    pub extended: bool,
    /// Source of the nuclei.
    pub nuclei_from: NucleiFrom,
    /// Measured parameters with 95 % intervals.
    pub estimates: Vec<(Parameter, Estimate)>,
    /// Measured parameters of each field; those of the mean where a field shows none.
    pub fields: Vec<Vec<(Parameter, f64)>>,
}

impl Measured {
    /// Returns the estimate of a parameter, if there is one.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> Option<Estimate> {
        self.estimates.iter().find(|(p, _)| *p == parameter).map(|(_, e)| *e)
    }

    /// Returns the standard deviation of a parameter between fields, as a difference of positions in its range.
    pub(crate) fn spread(&self, parameter: Parameter) -> f64 {
        let sd = deviation(&self.places(parameter));
        if sd.is_finite() { sd } else { 0.0 }
    }

    /// Returns the standard deviation of a parameter around each field, as a difference of positions in its range.
    pub(crate) fn spreads_around(&self, parameter: Parameter) -> Vec<f64> {
        let places = self.places(parameter);
        at_most_the_distance(&places, spread_around(0.0, self.spread(parameter), places.len()))
    }

    /// Returns the positions of the values of all fields in the range of a parameter.
    fn places(&self, parameter: Parameter) -> Vec<f64> {
        let of_parameter = self.fields.iter().flatten().filter(|(p, _)| *p == parameter);
        of_parameter.map(|(_, value)| parameter.prior().place(*value)).collect()
    }
}

/// Returns the standard deviation around each of `count` fields, given the error of its parameter and the standard
/// deviation between fields.
///
/// A further field has a variance of 1 + 1/n times that between fields around the mean of n fields, because this mean
/// has an error too; the n fields themselves have only 1 − 1/n.
pub(crate) fn spread_around(error: f64, between: f64, count: usize) -> f64 {
    (error * error + 2.0 * between * between / count as f64).sqrt()
}

/// Returns the standard deviation around each value: `usual`, but at most the distance to the nearest other value, so
/// that fields at the highest grey level stay there. Fields that do not show a value have the mean and count as equal.
fn at_most_the_distance(values: &[f64], usual: f64) -> Vec<f64> {
    let nearest = |(i, value): (usize, &f64)| {
        let others = values.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, other)| (other - value).abs()).fold(usual, f64::min)
    };
    values.iter().enumerate().map(nearest).collect()
}

/// Returns the source of nuclei that all fields have.
pub(crate) fn nuclei_from(fields: &[FieldImage]) -> NucleiFrom {
    fields.iter().map(|field| NucleiFrom::of(&field.nuclei)).min().unwrap_or_default()
}

/// Light and noise of one field.
struct Light {
    level: f64,
    across: f64,
    down: f64,
    /// Mean grey level of the empty slide below the highest one, of 255.
    below: f64,
    coverage: f64,
    empty: Empty,
}

/// Measures light, noise and bits. `pixel_um` is the approximate pixel size.
///
/// # Errors
/// If there is no field, a field is black, or the sizes differ.
pub fn measure(fields: &[FieldImage], pixel_um: f64) -> Result<Measured, Error> {
    measure_with(fields, pixel_um, &Control::NONE)
}

/// As [`measure`], with progress reports and a stop flag. The phase is "measuring fields".
///
/// # Errors
/// As `measure`; [`Error::Stopped`] if the stop flag is set.
pub fn measure_with(fields: &[FieldImage], pixel_um: f64, control: &Control) -> Result<Measured, Error> {
    measure_in(fields, pixel_um, &control.phase("measuring fields", fields.len()))
}

/// As [`measure_with`], with one step of a phase per field.
pub(crate) fn measure_in(fields: &[FieldImage], pixel_um: f64, phase: &Phase) -> Result<Measured, Error> {
    let control = phase.control();
    let first = fields.first().ok_or(Error::NoField)?;
    let size_px = [first.width, first.height()];
    for field in fields {
        let refuse = |what: String| Err(Error::Field { name: field.name.clone(), what });
        let (width, height, [of_first, down]) = (field.width, field.height(), size_px);
        if [width, height] != size_px {
            return refuse(format!(
                "is {width} x {height} pixels; expected {of_first} x {down}, the size of the first field"
            ));
        }
        let mut some: Vec<f64> =
            field.grey.iter().step_by(17).map(|g| LEVELS * f64::from(g / field.full_scale)).collect();
        let level = quantile(&mut some, 0.98);
        if level.is_nan() || level < DARK {
            return refuse(format!(
                "is black: percentile 98 is {level:.1} of 255; expected {DARK:.0} or more, the light of an empty slide"
            ));
        }
    }
    let nuclei_from = nuclei_from(fields);
    let view = Sampler::new(size_px, pixel_um, nuclei_from, Detail::Statistics)?;
    let scale = f64::from(first.full_scale);
    let one = |field: &FieldImage| -> Result<Light, Error> {
        let light = light(field, &view, control)?;
        phase.step()?;
        Ok(light)
    };
    let lights: Vec<Result<Light, Error>> = fields.par_iter().map(one).collect();
    let lights: Vec<Light> = lights.into_iter().collect::<Result<_, _>>()?;
    let column = |f: &dyn Fn(&Light) -> f64| -> Vec<f64> { lights.iter().map(f).filter(|v| v.is_finite()).collect() };
    let correlations = [0, 1].map(|i| column(&|l| l.empty.correlation[i]));
    let extended =
        correlations.iter().all(|s| !s.is_empty()) && correlations.iter().map(|s| mean(s)).fold(0.0, f64::max) > FUSED;

    let mut estimates = Vec::new();
    // Level and noise of a field.
    let light_of = |l: &Light| {
        let noise = l.empty.deviation * LEVELS / scale;
        if !extended {
            return [l.level, noise];
        }
        let [below, noise] = before_clipping([l.below, noise]);
        [l.level * (LEVELS - below) / (LEVELS - l.below), noise]
    };
    let levels = column(&|l| light_of(l)[0]);
    let mut put = |parameter: Parameter, values: &[f64], floor: f64| {
        if !values.is_empty() {
            let (middle, half) = (mean(values), of_mean(deviation(values), values.len()));
            // One field does not determine the variation: the interval is the complete range.
            let half = if half.is_finite() { half + floor } else { f64::INFINITY };
            let prior = parameter.prior();
            let [low, high] = [middle - half, middle + half].map(|v| v.clamp(prior.low, prior.high));
            estimates.push((parameter, Estimate { value: middle, low: low.min(middle), high: high.max(middle) }));
        }
    };
    let covered = mean(&column(&|l| l.coverage));
    let level_error = LEVEL_ERROR + COVERED_ERROR * covered * covered;
    put(Parameter::Level, &levels, level_error);
    put(Parameter::FalloffX, &column(&|l| l.across.max(0.0)), FALLOFF_ERROR);
    put(Parameter::FalloffY, &column(&|l| l.down.max(0.0)), FALLOFF_ERROR);
    let variances = column(&|l| l.empty.deviation * l.empty.deviation);
    let added = ADDED * (scale / LEVELS) * (scale / LEVELS) / mean(&variances);
    // Dirt adds noise and changes its correlation. The range over fields estimates by how much.
    if extended {
        for (parameter, values) in
            [(Parameter::NoiseCorrelationX, &correlations[0]), (Parameter::NoiseCorrelationY, &correlations[1])]
        {
            let [low, high] = min_max(values.iter().copied());
            put(parameter, values, CORRELATION_ERROR + ADDED_CORRELATION * added + 0.25 * (high - low));
        }
    }
    let noise: Vec<f64> = column(&|l| light_of(l)[1]).into_iter().map(|n| libm::log(n.max(1e-3))).collect();
    if !noise.is_empty() {
        let half = of_mean(deviation(&noise), noise.len()) + NOISE_ERROR + added;
        let prior = Parameter::Noise.prior();
        let [value, mut low, high] = [0.0, -half, half].map(|d| libm::exp(mean(&noise) + d));
        low = low.min(libm::exp(min_max(noise.iter().copied())[0] - NOISE_ERROR));
        estimates.push((
            Parameter::Noise,
            Estimate { value, low: low.max(prior.low).min(value), high: high.min(prior.high).max(value) },
        ));
    }
    let squares = mean(&column(&|l| l.level * l.level)) * scale * scale;
    let restored = mean(&column(&|l| l.empty.restored()));
    let of_fields: Vec<Vec<(Parameter, f64)>> = lights
        .iter()
        .map(|l| {
            let [level, noise] = light_of(l);
            let mut values = vec![
                (Parameter::Level, level),
                (Parameter::FalloffX, l.across.max(0.0)),
                (Parameter::FalloffY, l.down.max(0.0)),
                (Parameter::Noise, noise),
            ];
            if extended {
                let [across, down] = l.empty.correlation;
                values.extend([(Parameter::NoiseCorrelationX, across), (Parameter::NoiseCorrelationY, down)]);
            }
            values
        })
        .collect();
    let relative: Vec<Vec<f32>> = lights.into_iter().map(|l| l.empty.relative).collect();
    if let Some([variance, error]) = pattern(&relative, control)?.map(|found| found.map(|v| v * restored)) {
        let per_noise = squares / mean(&variances);
        let half = (2.0 * error + PATTERN_ERROR * variance.abs()) * per_noise;
        let [value, low, mut high] = [0.0, -half, half].map(|d| (variance * per_noise + d).clamp(0.0, 1.0));
        // Relative to the noise of the cleanest field the pattern is larger.
        high = (high * (mean(&variances) / min_max(variances.iter().copied())[0] + added)).clamp(value, 1.0);
        estimates.push((Parameter::Pattern, Estimate { value, low, high }));
    }
    estimates.sort_by_key(|(parameter, _)| *parameter);
    let mean_of = |parameter: Parameter| estimates.iter().find(|(p, _)| *p == parameter).map(|(_, e)| e.value);
    let of_fields = of_fields
        .into_iter()
        .map(|values| {
            let known = |(p, value): (Parameter, f64)| {
                let value = if value.is_finite() { Some(value) } else { mean_of(p) };
                Some((p, value?.clamp(p.prior().low, p.prior().high)))
            };
            values.into_iter().filter_map(known).collect()
        })
        .collect();
    Ok(Measured { size_px, bits: bits(fields), extended, nuclei_from, estimates, fields: of_fields })
}

fn light(field: &FieldImage, view: &Sampler, control: &Control) -> Result<Light, Error> {
    let s = view.measurer.measure_with(field, control)?.statistics;
    control.check()?;
    let (across, down) = (-s.background_x2, -s.background_y2);
    let middle = s.background_dn / (1.0 - MEAN_SQUARE * (across + down));
    let grey = s.background_dn * f64::from(field.full_scale) / LEVELS;
    Ok(Light {
        level: middle / LEVELS,
        across,
        down,
        below: LEVELS - s.background_dn,
        coverage: s.coverage,
        empty: Empty::new(&field.grey, field.width, grey),
    })
}

/// Returns the mean of an EDF image without clipping, in grey levels below the highest one, and the standard deviation
/// of its noise far below it, from the measured mean and standard deviation.
fn before_clipping([below, sd]: [f64; 2]) -> [f64; 2] {
    /// Largest factor on the standard deviation: at the highest level itself, clipping leaves 0.58 of it.
    const LARGEST: f64 = 2.0;
    /// Steps of the fixed-point iteration. Its error falls by a fifth or more in each.
    const STEPS: usize = 100;
    let mut found = [below, sd];
    for _ in 0..STEPS {
        let [clipped, remaining] = clipped_noise(found[0], found[1]);
        // An image cannot be brighter than the highest level.
        found = [(found[0] + below - clipped).max(0.0), (found[1] * sd / remaining).min(LARGEST * sd)];
    }
    found
}

/// Returns the bits for all grey levels; 8 if grey levels are fractions.
fn bits(fields: &[FieldImage]) -> u32 {
    let scale = fields.iter().map(|f| f.full_scale).fold(0.0_f32, f32::max);
    (8..16).find(|bits| f64::from(scale) <= libm::exp2(f64::from(*bits))).unwrap_or(16)
}

/// 97.5th percentile of the standard normal distribution.
const NORMAL: f64 = 1.959_964;

/// 97.5th percentile of Student's t with 1, 2, … degrees of freedom.
const STUDENT: [f64; 10] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228];

/// Returns the 97.5th percentile of Student's t, beyond the table from the first terms of Fisher's expansion.
fn student(freedom: usize) -> f64 {
    match STUDENT.get(freedom.wrapping_sub(1)) {
        Some(t) => *t,
        None if freedom == 0 => f64::INFINITY,
        None => {
            let (z, n) = (NORMAL, freedom as f64);
            let z3 = z * z * z;
            z + (z3 + z) / (4.0 * n) + (5.0 * z3 * z * z + 16.0 * z3 + 3.0 * z) / (96.0 * n * n)
        }
    }
}

/// Returns half the width of the 95 % interval of a mean.
fn of_mean(sd: f64, count: usize) -> f64 {
    student(count.saturating_sub(1)) * sd / (count.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use portable_numerics::random::{below, normal};
    use rand_core::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn fields_of_a_recipe_are_as_far_from_the_mean_of_the_real_ones_as_further_real_fields() {
        const TRIALS: u64 = 20_000;
        let square = |v: f64| v * v;
        let rng = &mut Xoshiro256PlusPlus::seed_from_u64(5);
        for count in [2, 4, 8] {
            let [mut further, mut simulated] = [0.0; 2];
            for _ in 0..TRIALS {
                let fields: Vec<f64> = (0..count).map(|_| normal(rng)).collect();
                let mean = fields.iter().sum::<f64>() / count as f64;
                further += square(normal(rng) - mean) / TRIALS as f64;
                let like = fields[below(count, rng)] + spread_around(0.0, 1.0, count) * normal(rng);
                simulated += square(like - mean) / TRIALS as f64;
            }
            // Both have a standard error of about 1.5 %.
            assert!((simulated / further - 1.0).abs() < 0.06, "{count}: {simulated} {further}");
        }
    }

    #[test]
    fn spreads_around_fields_are_at_most_the_distances_between_them() {
        let found = at_most_the_distance(&[0.2, 0.6, 0.99, 0.99, 0.95], 0.1);
        assert!(found[..4] == [0.1, 0.1, 0.0, 0.0] && (found[4] - 0.04).abs() < 1e-12, "{found:?}");
        assert_eq!(at_most_the_distance(&[0.3], 0.2), [0.2]);
        assert_eq!(at_most_the_distance(&[], 0.2), [0.0; 0]);
    }

    #[test]
    fn level_and_noise_are_restored_where_planes_are_clipped() {
        for sd in [0.8, 2.6, 5.0] {
            for below in [0.0, 1.5, 4.0, 20.0, 120.0] {
                let found = before_clipping(clipped_noise(below, sd));
                assert!((found[1] / sd - 1.0).abs() < 1e-6, "{sd} {below}: {found:?}");
                assert!((found[0] - below).abs() < 1e-6, "{sd} {below}: {found:?}");
            }
        }
        // Brighter and noisier than any clipped image, and without noise.
        let [below, sd] = before_clipping([0.5, 2.0]);
        assert!(below == 0.0 && sd > 2.0 && sd <= 4.0, "{below} {sd}");
        assert_eq!(before_clipping([3.0, 0.0]), [3.0, 0.0]);
        assert!(before_clipping([10.0, f64::NAN])[1].is_nan());
    }

    #[test]
    fn different_sizes_and_an_invalid_pixel_size_are_errors() {
        let two = [("a", 128), ("b", 96)].map(|(name, width)| {
            let grey = (0..width * 96).map(|i| 200.0 + (i % 3) as f32).collect();
            FieldImage { name: name.to_owned(), grey, width, ..FieldImage::default() }
        });
        let error = measure(&two, 0.33).unwrap_err().to_string();
        assert!(error.contains("field `b` is 96 x 96") && error.contains("128 x 96"), "{error}");
        assert!(measure(&two[..1], f64::NAN).is_err());
    }

    #[test]
    fn quantiles_equal_published_tables() {
        assert!((student(30) - 2.042).abs() < 0.002, "{}", student(30));
        assert!((student(11) - 2.201).abs() < 0.003, "{}", student(11));
    }
}
