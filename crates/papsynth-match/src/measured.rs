//! What a statistic of real fields says by itself: light, noise, bits.

use papsynth_judge::{Control, FieldImage, NucleiFrom};
use rayon::prelude::*;

use crate::error::Error;
use crate::noise::{Empty, pattern};
use crate::parameter::Parameter;
use crate::recipe::{FieldSd, LEVELS};
use crate::regression::{Estimate, min_max};
use crate::view::WindowSampler;
use portable_numerics::statistics::{deviation, mean, quantile};

/// A slide darker than this, of 255, is none.
const DARK: f64 = 20.0;

/// Neighbours that share more noise than this were fused.
const FUSED: f64 = 0.06;

/// Mean of x² over the grid that the judge takes the mean of a background on.
const MEAN_SQUARE: f64 = 0.3667;

/// What no statistic knows better than: dirt and unevenness of the slide add to noise, a part of it.
const NOISE_ERROR: f64 = 0.02;

/// To the part of noise that is a pattern, a part of it.
const PATTERN_ERROR: f64 = 0.06;

/// To a correlation.
const CORRELATION_ERROR: f64 = 0.012;

/// Variance that rounding and what lies on the slide add to noise, squares of levels of 8 bits.
const ADDED: f64 = 0.06;

/// To a correlation, over the added part of the variance: rounding shares nothing, and dirt shares all.
const ADDED_SHARE: f64 = 2.0;

/// To the level, a part of full scale; and where all is covered, and what is taken for empty is not.
const LEVEL_ERROR: f64 = 0.003;
const COVERED_ERROR: f64 = 0.025;

/// To a curvature.
const BOWL_ERROR: f64 = 0.003;

/// What real fields say of light and noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Columns and rows of a field.
    pub size_px: [usize; 2],
    /// Bits of a grey level.
    pub bits: u32,
    /// Whether neighbouring pixels share noise: the pictures were fused.
    pub extended: bool,
    /// How the nuclei of all fields are known.
    pub nuclei_from: NucleiFrom,
    /// Parameters with their 95 % intervals; not here is what could not be told.
    pub estimates: Vec<(Parameter, Estimate)>,
    /// Standard deviations between fields.
    pub field_sd: FieldSd,
}

impl Measured {
    /// The estimate of a parameter, if there is one.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> Option<Estimate> {
        self.estimates.iter().find(|(p, _)| *p == parameter).map(|(_, e)| *e)
    }
}

/// Light and noise of one field.
struct Light {
    level: f64,
    across: f64,
    down: f64,
    coverage: f64,
    empty: Empty,
}

/// Measures what a statistic determines by itself. `pixel_um` is the size of a pixel as far as it is known.
///
/// # Errors
/// If there is no field, one is black, or they are of different sizes.
pub fn measure(fields: &[FieldImage], pixel_um: f64) -> Result<Measured, Error> {
    measure_with(fields, pixel_um, &Control::NONE)
}

/// As [`measure`], with progress reports and a stop flag. The phase is "measuring fields".
///
/// # Errors
/// As `measure`; [`Error::Stopped`] if the stop flag is set.
pub fn measure_with(fields: &[FieldImage], pixel_um: f64, control: &Control) -> Result<Measured, Error> {
    let first = fields.first().ok_or(Error::NoField)?;
    let size_px = [first.width, first.height()];
    for field in fields {
        let refuse = |what: String| Err(Error::Field { name: field.name.clone(), what });
        let (width, height, [of_first, down]) = (field.width, field.height(), size_px);
        if [width, height] != size_px {
            return refuse(format!(
                "is {width} x {height} pixels, the first is {of_first} x {down}; one microscope takes fields of one size"
            ));
        }
        let mut some: Vec<f64> =
            field.grey.iter().step_by(17).map(|g| LEVELS * f64::from(g / field.full_scale)).collect();
        let level = quantile(&mut some, 0.98);
        if level.is_nan() || level < DARK {
            return refuse(format!(
                "is black: its brightest pixels are at {level:.1} of 255, and an empty slide is expected to be brighter than {DARK:.0}"
            ));
        }
    }
    // Points are of those nuclei that somebody took an interest in: simulated windows know all of theirs.
    let masks = fields.iter().all(|field| NucleiFrom::of(&field.nuclei) == NucleiFrom::Masks);
    let nuclei_from = if masks { NucleiFrom::Masks } else { NucleiFrom::Search };
    let view = WindowSampler::new(size_px, pixel_um, nuclei_from)?;
    let scale = f64::from(first.full_scale);
    let phase = control.phase("measuring fields", fields.len());
    let one = |field: &FieldImage| -> Result<Light, Error> {
        let light = light(field, &view, control)?;
        phase.step()?;
        Ok(light)
    };
    let lights: Vec<Result<Light, Error>> = fields.par_iter().map(one).collect();
    let lights: Vec<Light> = lights.into_iter().collect::<Result<_, _>>()?;
    let column = |f: &dyn Fn(&Light) -> f64| -> Vec<f64> { lights.iter().map(f).filter(|v| v.is_finite()).collect() };
    let shared = [0, 1].map(|i| column(&|l| l.empty.shared[i]));
    let extended = shared.iter().all(|s| !s.is_empty()) && shared.iter().map(|s| mean(s)).fold(0.0, f64::max) > FUSED;

    let mut estimates = Vec::new();
    let levels = column(&|l| l.level);
    let mut put = |parameter: Parameter, values: &[f64], floor: f64| {
        if !values.is_empty() {
            let (middle, half) = (mean(values), of_mean(deviation(values), values.len()));
            // One field says nothing of others: the interval is as wide as the range.
            let half = if half.is_finite() { half + floor } else { f64::INFINITY };
            let prior = parameter.prior();
            let [low, high] = [middle - half, middle + half].map(|v| v.clamp(prior.low, prior.high));
            estimates.push((parameter, Estimate { value: middle, low: low.min(middle), high: high.max(middle) }));
        }
    };
    let covered = mean(&column(&|l| l.coverage));
    let level_error = LEVEL_ERROR + COVERED_ERROR * covered * covered;
    put(Parameter::Level, &levels, level_error);
    put(Parameter::BowlAcross, &column(&|l| l.across.max(0.0)), BOWL_ERROR);
    put(Parameter::BowlDown, &column(&|l| l.down.max(0.0)), BOWL_ERROR);
    let variances = column(&|l| l.empty.deviation * l.empty.deviation);
    let added = ADDED * (scale / LEVELS) * (scale / LEVELS) / mean(&variances);
    // What lies on a slide adds to its noise and changes what is shared: by how much is seen in how fields differ.
    if extended {
        for (parameter, values) in [(Parameter::Across, &shared[0]), (Parameter::Down, &shared[1])] {
            let [low, high] = min_max(values);
            put(parameter, values, CORRELATION_ERROR + ADDED_SHARE * added + 0.25 * (high - low));
        }
    }
    let noise: Vec<f64> =
        column(&|l| l.empty.deviation * LEVELS / scale).into_iter().map(|n| libm::log(n.max(1e-3))).collect();
    if !noise.is_empty() {
        let half = of_mean(deviation(&noise), noise.len()) + NOISE_ERROR + added;
        let prior = Parameter::Noise.prior();
        let [value, mut low, high] = [0.0, -half, half].map(|d| libm::exp(mean(&noise) + d));
        low = low.min(libm::exp(min_max(&noise)[0] - NOISE_ERROR));
        estimates.push((
            Parameter::Noise,
            Estimate { value, low: low.max(prior.low).min(value), high: high.min(prior.high).max(value) },
        ));
    }
    if levels.len() > 1 {
        let sd = deviation(&levels);
        let [low, high] = of_deviation(levels.len()).map(|factor| factor * sd);
        let most = Parameter::LevelSd.prior().high;
        estimates.push((
            Parameter::LevelSd,
            Estimate { value: sd, low: (low - level_error).max(0.0), high: (high + level_error).min(most.max(sd)) },
        ));
    }
    let [sd_across, sd_down] = [deviation(&column(&|l| l.across)), deviation(&column(&|l| l.down))];
    let squares = mean(&column(&|l| l.level * l.level)) * scale * scale;
    let restored = mean(&column(&|l| l.empty.restored()));
    let relative: Vec<Vec<f32>> = lights.into_iter().map(|l| l.empty.relative).collect();
    if let Some([variance, error]) = pattern(&relative, control)?.map(|found| found.map(|v| v * restored)) {
        let per_noise = squares / mean(&variances);
        let half = (2.0 * error + PATTERN_ERROR * variance.abs()) * per_noise;
        let [value, low, mut high] = [0.0, -half, half].map(|d| (variance * per_noise + d).clamp(0.0, 1.0));
        // Of the noise of the cleanest field it is a larger part.
        high = (high * (mean(&variances) / min_max(&variances)[0] + added)).clamp(value, 1.0);
        estimates.push((Parameter::Pattern, Estimate { value, low, high }));
    }
    estimates.sort_by_key(|(parameter, _)| *parameter);
    let or_default = |sd: f64, default: f64| if sd.is_finite() { sd } else { default };
    let usual = FieldSd::default();
    let field_sd = FieldSd {
        across: or_default(sd_across, usual.across),
        down: or_default(sd_down, usual.down),
        noise: or_default(deviation(&noise), usual.noise),
    };
    Ok(Measured { size_px, bits: bits(fields), extended, nuclei_from, estimates, field_sd })
}

fn light(field: &FieldImage, view: &WindowSampler, control: &Control) -> Result<Light, Error> {
    let s = view.measurer.measure_with(field, control)?.statistics;
    control.check()?;
    let (across, down) = (-s.background_x2, -s.background_y2);
    let middle = s.background_dn / (1.0 - MEAN_SQUARE * (across + down));
    let grey = s.background_dn * f64::from(field.full_scale) / LEVELS;
    Ok(Light {
        level: middle / LEVELS,
        across,
        down,
        coverage: s.coverage,
        empty: Empty::new(&field.grey, field.width, grey),
    })
}

/// The fewest bits that hold all grey levels; 8 where pictures are fractions.
fn bits(fields: &[FieldImage]) -> u32 {
    let scale = fields.iter().map(|f| f.full_scale).fold(0.0_f32, f32::max);
    (8..16).find(|bits| f64::from(scale) <= libm::exp2(f64::from(*bits))).unwrap_or(16)
}

/// The deviate that 97.5 % of a standard normal lie below.
const NORMAL: f64 = 1.959_964;

/// The same of Student's t with 1, 2, … degrees of freedom.
const STUDENT: [f64; 10] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228];

/// Of Student's t: from the table, beyond it by the first terms of Fisher's expansion.
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

/// Half the width of the 95 % interval of the mean.
fn of_mean(sd: f64, count: usize) -> f64 {
    student(count.saturating_sub(1)) * sd / (count.max(1) as f64).sqrt()
}

/// The 95 % interval of a standard deviation that was estimated as 1, from the quantiles of χ² by Wilson and Hilferty
/// (doi:10.1073/pnas.17.12.684).
fn of_deviation(count: usize) -> [f64; 2] {
    let n = count.saturating_sub(1) as f64;
    if n < 1.0 {
        return [0.0, f64::INFINITY];
    }
    let chi2 = |z: f64| {
        let root = 1.0 - 2.0 / (9.0 * n) + z * (2.0 / (9.0 * n)).sqrt();
        n * (root * root * root).max(1e-3)
    };
    [NORMAL, -NORMAL].map(|z| (n / chi2(z)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_one_size_and_pixels_with_a_size_are_asked_for() {
        let two = [("a", 128), ("b", 96)].map(|(name, width)| {
            let grey = (0..width * 96).map(|i| 200.0 + (i % 3) as f32).collect();
            FieldImage { name: name.to_owned(), grey, width, ..FieldImage::default() }
        });
        let error = measure(&two, 0.33).unwrap_err().to_string();
        assert!(error.contains("field `b` is 96 x 96") && error.contains("128 x 96"), "{error}");
        assert!(measure(&two[..1], f64::NAN).is_err());
    }

    #[test]
    fn quantiles_are_those_of_tables() {
        assert!((student(30) - 2.042).abs() < 0.002, "{}", student(30));
        assert!((student(11) - 2.201).abs() < 0.003, "{}", student(11));
        // χ² with 7 degrees of freedom: 1.690 and 16.013.
        let [low, high] = of_deviation(8);
        assert!(
            (low - (7.0_f64 / 16.013).sqrt()).abs() < 0.01 && (high - (7.0_f64 / 1.690).sqrt()).abs() < 0.05,
            "{low} {high}"
        );
        assert_eq!(of_deviation(1)[1], f64::INFINITY);
    }
}
