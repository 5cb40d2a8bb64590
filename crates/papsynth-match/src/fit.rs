//! The complete match: measurement, simulation, regression, rounds around the result.

use papsynth::recipe::{self, Colour, LightSection, Recipe};
use papsynth_judge::{Control, Detail, FieldImage, Phase, Report};
use portable_numerics::random::normal;
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::Serialize;

use crate::compare::{LEAST_FIELDS as LEAST_REFINED, Refine, Refinement, report};
use crate::distance::{Distance, Statistic, statistics};
use crate::error::Error;
use crate::hues::correct;
use crate::measured::{Measured, measure_in, spread_around};
use crate::parameter::{PARAMETERS, Parameter, Prior, Source, Values};
use crate::posterior::{FUSED_SD, Knowledge, NEAR_SD, PRIOR_SD, Posterior, Response, Rows};
use crate::recipe::{Setting, matched, recipe, simulated};
use crate::sampler::{MakeEngine, Sampler};
use crate::simulate::{Simulator, latin, samples_of};
use crate::summary::{NUCLEAR_AREA, Summary};

/// Pixel size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PixelSize {
    /// A known pixel size, µm.
    Known(f64),
    /// An unknown pixel size with an initial value, µm. The match estimates it, and assumes the cell size of the
    /// initial recipe.
    Sought(f64),
}

impl PixelSize {
    fn um(self) -> f64 {
        match self {
            Self::Known(um) | Self::Sought(um) => um,
        }
    }
}

/// Parameters of a match.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchParams {
    /// Pixel size. Default: known, 0.33 µm.
    pub pixel: PixelSize,
    /// Fields to simulate with parameters from their complete ranges, 60 to 1000000. Default 150.
    pub simulations: usize,
    /// Rounds of simulations around the result, 0 to 100. Default 6.
    pub rounds: usize,
    /// Rounds of the search against classifiers that distinguish simulated from real fields, 0 to 10000. Default 0.
    pub refine: usize,
    /// Seed of all random draws. Default 0.
    pub seed: u64,
}

impl MatchParams {
    /// Returns parameters for a first look: a third of the simulations, wider intervals.
    #[must_use]
    pub fn quick() -> Self {
        Self { simulations: 100, rounds: 2, ..Self::default() }
    }
}

impl Default for MatchParams {
    fn default() -> Self {
        Self { pixel: PixelSize::Known(0.33), simulations: 150, rounds: 6, refine: 0, seed: 0 }
    }
}

/// Origin of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// A statistic of the real fields.
    Measured,
    /// Simulations: fields with this value are similar to the real ones.
    Simulated,
    /// The initial recipe, because the value has no visible influence on these fields.
    NotVisible,
}

/// Result for a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterFit {
    /// Parameter.
    pub parameter: Parameter,
    /// Numbers of the recipe.
    pub path: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Origin of the value.
    pub origin: Origin,
    /// Mean over the fields; of the logarithm for a logarithmic parameter.
    pub value: f64,
    /// 95 % interval of this mean.
    pub interval: [f64; 2],
    /// Standard deviation between fields; of the logarithm for a logarithmic parameter. 0 if all fields share one
    /// value.
    pub spread: f64,
    /// Value in each field; empty if all fields share one value.
    pub fields: Vec<f64>,
    /// Value in the initial recipe.
    pub before: f64,
    /// Range of the search.
    pub range: [f64; 2],
    /// Width of the interval over that of the range, on the scale of the parameter.
    pub width: f64,
}

impl ParameterFit {
    /// Returns a value whose interval is the complete range.
    pub(crate) fn new(parameter: Parameter, origin: Origin, value: f64) -> Self {
        let Prior { path, unit, low, high, .. } = parameter.prior();
        let range = [low, high];
        let (spread, fields) = (0.0, Vec::new());
        Self { parameter, path, unit, origin, value, interval: range, spread, fields, before: value, range, width: 1.0 }
    }
}

/// Result of a match.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fit {
    /// Matched recipe, with one condition for each real field.
    #[serde(skip)]
    pub recipe: Recipe,
    /// All parameters.
    pub parameters: Vec<ParameterFit>,
    /// Distance between simulated and real fields.
    pub distance: Distance,
    /// All statistics.
    pub statistics: Vec<Statistic>,
    /// The search against classifiers, if there was one.
    pub refinement: Option<Refinement>,
    /// Names of the real fields.
    pub fields: Vec<String>,
    /// Number of nuclei in the real fields.
    pub nuclei: usize,
    /// Number of simulated fields.
    pub simulated: usize,
    /// Whether the real fields are fused from several focal planes (extended depth of field).
    pub extended: bool,
    /// Whether the real fields are colour images.
    pub colour: bool,
}

/// A match of a recipe to real fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Match {
    params: MatchParams,
    base: Recipe,
}

/// Minimum number of fields: one does not show the variation between fields.
const LEAST_FIELDS: usize = 2;

/// Minimum number of nuclei to estimate stain and sizes.
const LEAST_NUCLEI: usize = 8;

/// Fields to simulate in a round, at least.
const ROUND: usize = 32;

/// Standard deviations of the parameters in the first and in the last rounds, in standard errors: the first ones show
/// how statistics depend on the parameters, the last ones the statistics of the result.
const WIDE: f64 = 1.5;
const NARROW: f64 = 0.4;

/// Fields to simulate for the final comparison, of each recipe.
const COMPARED: usize = 16;

/// Fields to simulate for each correction of the hues of stains, and the corrections before and after the search.
const HUED: usize = 8;
const CORRECTIONS: [usize; 2] = [2, 1];

/// Number of pixel sizes that are tried.
const PIXELS: f64 = 12.0;

/// Indices of the first simulated fields of the search against classifiers, and of the comparison.
const REFINED: usize = 1 << 40;
const COMPARISON: usize = 1 << 41;

/// Name of the phase of simulations in progress reports.
const SIMULATING: &str = "simulating fields";

impl Match {
    /// Checks the parameters. `base` is the initial recipe.
    ///
    /// # Errors
    /// If a parameter is out of range.
    pub fn new(params: &MatchParams, base: &Recipe) -> Result<Self, Error> {
        papsynth_judge::Error::check(&[
            ("simulations", params.simulations as f64, [60.0, 1e6], "60 to 1000000"),
            ("rounds", params.rounds as f64, [0.0, 100.0], "0 to 100"),
            ("refine", params.refine as f64, [0.0, 1e4], "0 to 10000"),
            ("pixel_um", params.pixel.um(), [0.05, 4.0], "0.05 to 4"),
        ])?;
        Ok(Self { params: params.clone(), base: base.without_conditions() })
    }

    /// Returns the setting for real fields, and the known parameter values.
    fn setting(&self, measured: &Measured, colour: bool) -> (Setting, Values) {
        // Fused images differ from others by more than their noise.
        let fused = measured.extended && self.base.focus.output == recipe::FocusOutput::Planes;
        let mut base = if fused { self.base.clone().fused() } else { self.base.clone() };
        if colour && matches!(base.light, LightSection::Monochrome(_)) {
            base.light = LightSection::Colour(Colour::default());
        }
        let setting = Setting {
            base,
            size_px: measured.size_px,
            pixel_um: self.params.pixel.um(),
            bits: measured.bits,
            extended: measured.extended,
            seek_pixel: matches!(self.params.pixel, PixelSize::Sought(_)),
        };
        let mut known = setting.base_values();
        for (parameter, estimate) in &measured.estimates {
            known.set(*parameter, estimate.value);
        }
        known.set(Parameter::Pixel, self.params.pixel.um());
        (setting, known)
    }

    /// Returns the number of fields to simulate for real fields, without those of the search against classifiers.
    #[must_use]
    pub fn simulated(&self, fields: usize, colour: bool) -> usize {
        let MatchParams { simulations, rounds, .. } = self.params;
        simulations + rounds * per_round(fields) + 2 * COMPARED + corrected(colour).iter().sum::<usize>()
    }

    /// Finds the recipe of real fields. The result does not depend on the number of threads.
    ///
    /// The phases of the progress reports are "measuring fields" and "simulating fields", which continue one count, and
    /// "refining, AUC …".
    ///
    /// # Errors
    /// If there are no fields, or too few nuclei in them, or recipes cannot be simulated; [`Error::Stopped`] if the
    /// stop flag is set.
    pub fn run(&self, fields: &[FieldImage], make: &MakeEngine<'_>, control: &Control) -> Result<Fit, Error> {
        if fields.is_empty() {
            return Err(Error::NoField);
        }
        if fields.len() < LEAST_FIELDS {
            return Err(Error::Fields { found: fields.len(), least: LEAST_FIELDS, what: "a match" });
        }
        if self.params.refine > 0 && fields.len() < LEAST_REFINED {
            return Err(Error::Fields {
                found: fields.len(),
                least: LEAST_REFINED,
                what: "a search against classifiers",
            });
        }
        let per_round = per_round(fields.len());
        let colour = fields.iter().all(|field| field.red_blue.is_some());
        let corrected = corrected(colour);
        let count = self.simulated(fields.len(), colour);
        let total = 2 * fields.len() + count;
        let phase = control.resume("measuring fields", 0, total);
        let measured = measure_in(fields, self.params.pixel.um(), &phase)?;
        let sampler = Sampler::new(measured.size_px, self.params.pixel.um(), measured.nuclei_from, Detail::Statistics)?
            .with_colour(colour);
        let (real, samples) = of_fields(fields, &sampler, &phase)?;
        check_magnification(fields, &real)?;
        let nuclei = real.iter().map(|field| field.nuclei).sum();
        if nuclei < LEAST_NUCLEI {
            let pixel_um = self.params.pixel.um();
            return Err(Error::Nuclei { found: nuclei, fields: fields.len(), least: LEAST_NUCLEI, pixel_um });
        }
        let (mut setting, known) = self.setting(&measured, colour);
        let initial = self.initial(&setting);
        let hues = Summary::mean(&real).hues();
        let mut done = 2 * fields.len();
        // Corrects the dyes for the hues of fields of a recipe.
        let correct_dyes = |recipe: &Recipe, base: &mut Recipe, done: &mut usize| -> Result<(), Error> {
            let phase = control.resume(SIMULATING, *done, total);
            // Real fields have mean hues as well.
            let mut recipe = recipe.clone();
            (recipe.stain.slide_balance, recipe.stain.field_balance) = (0.0.into(), 0.0.into());
            let measure = |image: &FieldImage| Summary::of(image, &sampler, control);
            let made = samples_of(&recipe, &sampler, make, [*done, HUED], &phase, self.params.seed, measure)?;
            if let (Some(real), Some(simulated)) = (&hues, &Summary::mean(&made).hues()) {
                correct(base, real, simulated);
            }
            *done = phase.done();
            Ok(())
        };
        for _ in 0..corrected[0] / HUED {
            let measured = recipe(&setting, &known, |parameter| parameter.prior().source == Source::Measured);
            correct_dyes(&measured, &mut setting.base, &mut done)?;
        }
        let simulator = Simulator { setting: &setting, sampler: &sampler, make, seed: self.params.seed };
        let sought = simulated(&setting);
        let mut search = Search { measured: &measured, real: &real, samples, known, sought, rows: Rows::default() };

        let mut rng = Xoshiro256PlusPlus::seed_from_u64(self.params.seed ^ 0x726f_756e_6473);
        let place = |p: &Parameter| p.prior().place(search.known.get(*p)).clamp(0.0, 1.0);
        let prior: Vec<f64> = search.sought.iter().map(place).collect();
        let mut posterior = Posterior::prior(&prior, fields.len());
        for round in 0..=self.params.rounds {
            let phase = control.resume(SIMULATING, done, total);
            let draws = match round {
                0 => search.table(self.params.simulations, self.params.seed),
                _ => {
                    let width = if 2 * round <= self.params.rounds { WIDE } else { NARROW };
                    search.around(&posterior, width, (round - 1) * per_round, per_round, &mut rng)
                }
            };
            search.simulate(&simulator, draws, done, &phase)?;
            posterior = search.posterior(&setting, &posterior, &prior, &phase)?;
            done = phase.done();
        }

        let mut refinement = None;
        if self.params.refine > 0 {
            let detailed =
                Sampler::new(measured.size_px, self.params.pixel.um(), measured.nuclei_from, Detail::Everything)?;
            let moving: Vec<bool> = (0..search.sought.len()).map(|c| posterior.is_visible(c)).collect();
            let recipe = |at: &Posterior| search.results(&setting, at).1;
            let (sampler, seed) = (&detailed, self.params.seed);
            let refine = Refine { sampler, make, seed, first: REFINED, recipe: &recipe, moving: &moving };
            let (found, result) = refine.run(fields, &posterior, self.params.refine, control)?;
            (posterior, refinement) = (found, Some(result));
        }

        for _ in 0..corrected[1] / HUED {
            let (_, found) = search.results(&setting, &posterior);
            correct_dyes(&found, &mut setting.base, &mut done)?;
        }
        let (parameters, recipe) = search.results(&setting, &posterior);
        let phase = control.resume(SIMULATING, done, total);
        let samples = |of: &Recipe, first: usize| {
            let measure = |image: &FieldImage| Summary::of(image, &sampler, control);
            samples_of(of, &sampler, make, [first, COMPARED], &phase, self.params.seed, measure)
        };
        let before = samples(&initial, done)?;
        let after = samples(&recipe, done + COMPARED)?;
        let (distance, statistics) = statistics(&real, &before, &after);
        Ok(Fit {
            recipe,
            parameters,
            distance,
            statistics,
            refinement,
            fields: fields.iter().map(|field| field.name.clone()).collect(),
            nuclei,
            simulated: count,
            extended: measured.extended,
            colour,
        })
    }

    /// Compares real fields with simulated fields of the result by the classifiers of `papsynth-judge`: a report with
    /// crops of both, those that differ most first.
    ///
    /// # Errors
    /// As [`run`](Self::run), and for fewer than two fields.
    pub fn compare(
        &self,
        fields: &[FieldImage],
        fit: &Fit,
        make: &MakeEngine<'_>,
        control: &Control,
    ) -> Result<Report, Error> {
        let (pixel_um, first) = (self.params.pixel.um(), fields.first().ok_or(Error::NoField)?);
        let from = crate::measured::nuclei_from(fields);
        let sampler = Sampler::new([first.width, first.height()], pixel_um, from, Detail::Everything)?;
        report(fields, &sampler, make, &fit.recipe, COMPARISON, self.params.seed, control)
    }

    /// Returns the initial recipe for images of the size of the real ones.
    fn initial(&self, setting: &Setting) -> Recipe {
        let mut initial = recipe(setting, &setting.base_values(), |_| false);
        initial.slide.fields_per_slide = 1;
        initial
    }
}

/// Returns the fields to simulate in a round.
fn per_round(fields: usize) -> usize {
    ROUND.max(fields.min(2 * ROUND))
}

/// Returns the fields to simulate for the corrections of the hues of stains, before and after the search.
fn corrected(colour: bool) -> [usize; 2] {
    if colour { CORRECTIONS.map(|rounds| rounds * HUED) } else { [0; 2] }
}

/// Returns the usual standard deviation of a parameter around the initial recipe.
fn near(setting: &Setting, parameter: Parameter) -> f64 {
    match parameter {
        Parameter::Pixel => PRIOR_SD,
        Parameter::Blur if setting.extended => FUSED_SD,
        _ => NEAR_SD,
    }
}

/// Measures real fields: the mean over the samples of each, and the number of samples of a field.
fn of_fields(fields: &[FieldImage], sampler: &Sampler, phase: &Phase) -> Result<(Vec<Summary>, usize), Error> {
    let one = |field: &FieldImage| -> Result<(Summary, usize), Error> {
        let samples = sampler.samples(field);
        let measured = samples.iter().map(|image| Summary::of(image, sampler, phase.control()));
        let measured: Vec<Summary> = measured.collect::<Result<_, _>>()?;
        phase.step()?;
        Ok((Summary::mean(&measured), samples.len()))
    };
    let all: Vec<Result<(Summary, usize), Error>> = fields.par_iter().map(one).collect();
    let all: Vec<(Summary, usize)> = all.into_iter().collect::<Result<_, _>>()?;
    let count = all.first().map_or(0, |(_, count)| *count);
    Ok((all.into_iter().map(|(summary, _)| summary).collect(), count))
}

/// Checks that no field has nuclei of another size than all others, as at another magnification.
fn check_magnification(fields: &[FieldImage], real: &[Summary]) -> Result<(), Error> {
    /// Largest ratio of median nuclear areas: fields with and without lesions differ less, magnifications of 20 and 40
    /// more.
    const LARGEST: f64 = 3.6;
    let column = real[0].names.iter().position(|name| name == NUCLEAR_AREA);
    let Some(column) = column else { return Ok(()) };
    let areas: Vec<f64> = real.iter().map(|field| field.values[column]).collect();
    let mut known: Vec<f64> = areas.iter().copied().filter(|area| area.is_finite()).collect();
    let middle = portable_numerics::statistics::quantile(&mut known, 0.5);
    match areas.iter().position(|area| (area - middle).abs() > libm::log(LARGEST)) {
        Some(i) => {
            let [own, all] = [areas[i], middle].map(|log| libm::exp(log).round());
            let what = format!(
                "has a median nuclear area of {own} µm², and all fields together {all} µm²; expected fields of one magnification"
            );
            Err(Error::Field { name: fields[i].name.clone(), what })
        }
        None => Ok(()),
    }
}

/// The simulations of a match.
struct Search<'a> {
    measured: &'a Measured,
    real: &'a [Summary],
    /// Number of samples of each real field.
    samples: usize,
    /// Values of the initial recipe, and measured ones.
    known: Values,
    sought: Vec<Parameter>,
    rows: Rows,
}

/// Positions of the sought parameters of a sample in their ranges, and the index of the field whose light it has.
type Draw = (Vec<f64>, Option<usize>);

impl Search<'_> {
    /// Draws samples from the complete ranges.
    fn table(&self, count: usize, seed: u64) -> Vec<Draw> {
        let mut draws = latin(count, self.sought.len(), seed);
        draws.iter_mut().for_each(|draw| self.on_grid(draw));
        draws.into_iter().map(|places| (places, None)).collect()
    }

    /// Draws samples around the values of the fields, within `width` standard errors.
    fn around(
        &self,
        found: &Posterior,
        width: f64,
        first: usize,
        count: usize,
        rng: &mut Xoshiro256PlusPlus,
    ) -> Vec<Draw> {
        const LEAST: f64 = 0.03;
        const MOST: f64 = 0.3;
        let draw = |i: usize| {
            let field = i % found.fields.len();
            let around = |(c, place): (usize, &f64)| {
                let error = libm::hypot(found.errors[c], found.difference_errors[c]);
                (place + (width * error).clamp(LEAST, MOST) * normal(rng)).clamp(0.0, 1.0)
            };
            let mut places: Vec<f64> = found.fields[field].iter().enumerate().map(around).collect();
            self.on_grid(&mut places);
            (places, Some(field))
        };
        (first..first + count).map(draw).collect()
    }

    /// Rounds the pixel size, because each pixel size needs an engine of its own.
    fn on_grid(&self, places: &mut [f64]) {
        if let Some(i) = self.sought.iter().position(|p| *p == Parameter::Pixel) {
            places[i] = (places[i] * PIXELS).round() / PIXELS;
        }
    }

    fn values(&self, places: &[f64], field: Option<usize>) -> Values {
        let mut values = self.known.clone();
        for (parameter, value) in field.map_or(&[][..], |i| &self.measured.fields[i]) {
            values.set(*parameter, *value);
        }
        for (parameter, place) in self.sought.iter().zip(places) {
            values.set(*parameter, parameter.prior().value(*place));
        }
        values
    }

    /// Simulates samples and adds them to the rows, as the next round.
    fn simulate(&mut self, simulator: &Simulator, draws: Vec<Draw>, first: usize, phase: &Phase) -> Result<(), Error> {
        let values: Vec<Values> = draws.iter().map(|(places, field)| self.values(places, *field)).collect();
        let made = simulator.simulate(&values, first, phase)?;
        let round = self.rows.rounds.last().map_or(0, |round| round + 1);
        for ((places, field), summary) in draws.into_iter().zip(made) {
            if let Some(summary) = summary {
                self.rows.statistics.push(summary.values);
                self.rows.places.push(places);
                self.rows.fields.push(field);
                self.rows.rounds.push(round);
            }
        }
        Ok(())
    }

    fn posterior(
        &self,
        setting: &Setting,
        start: &Posterior,
        prior: &[f64],
        phase: &Phase,
    ) -> Result<Posterior, Error> {
        let fields: Vec<Vec<f64>> = self.real.iter().map(|field| field.values.clone()).collect();
        let varies: Vec<bool> = self.sought.iter().map(|parameter| setting.varies(*parameter)).collect();
        let near: Vec<f64> = self.sought.iter().map(|parameter| near(setting, *parameter)).collect();
        let prior = Knowledge { means: prior, near: &near, varies: &varies };
        Ok(Response::new(&self.rows, phase)?.posterior(&fields, self.samples, start, &prior))
    }

    /// Returns the parameters of a field, with the spread of further fields of the same kind around them.
    fn field(&self, setting: &Setting, found: &Posterior, shared: &Values, field: usize) -> Values {
        let mut values = self.values(&found.fields[field], Some(field));
        for (c, parameter) in self.sought.iter().enumerate() {
            if setting.varies(*parameter) {
                let spread = spread_around(found.difference_errors[c], found.spreads[c], self.real.len());
                values.set_spread(*parameter, parameter.prior().difference(spread));
            } else {
                values.set(*parameter, shared.get(*parameter));
                values.set_spread(*parameter, shared.spread(*parameter));
            }
        }
        for (parameter, _) in &self.measured.fields[field] {
            let spread = self.measured.spreads_around(*parameter)[field];
            values.set_spread(*parameter, parameter.prior().difference(spread));
        }
        values
    }

    /// Returns all parameters and the recipe.
    fn results(&self, setting: &Setting, found: &Posterior) -> (Vec<ParameterFit>, Recipe) {
        let base = setting.base_values();
        let column = |parameter: Parameter| self.sought.iter().position(|p| *p == parameter);
        let fitted = |parameter: Parameter| match (parameter.prior().source, column(parameter)) {
            (Source::Measured, _) => self.measured.get(parameter).is_some(),
            (Source::Simulated, Some(c)) => found.is_visible(c),
            (Source::Simulated, None) => false,
        };
        let mut mean = self.values(&found.means, None);
        for (c, parameter) in self.sought.iter().enumerate().filter(|(_, parameter)| !setting.varies(**parameter)) {
            let spread = found.errors[c].min(near(setting, *parameter));
            mean.set_spread(*parameter, parameter.prior().difference(spread));
        }
        let fields: Vec<Values> = (0..self.real.len()).map(|i| self.field(setting, found, &mean, i)).collect();
        let one = |parameter: Parameter| {
            let prior = parameter.prior();
            let mut fit = ParameterFit::new(parameter, Origin::NotVisible, base.get(parameter));
            if !fitted(parameter) {
                return fit;
            }
            if setting.varies(parameter) {
                fit.fields = fields.iter().map(|values| values.get(parameter)).collect();
            }
            if let Some(c) = column(parameter) {
                let e = found.mean(c);
                fit.origin = Origin::Simulated;
                fit.value = prior.value(e.value);
                fit.interval = [e.low, e.high].map(|place| prior.value(place));
                fit.width = e.high - e.low;
                fit.spread = prior.difference(found.spreads[c]);
            } else if let Some(e) = self.measured.get(parameter) {
                fit.origin = Origin::Measured;
                fit.value = e.value;
                fit.interval = [e.low, e.high];
                fit.width = prior.place(e.high) - prior.place(e.low);
                fit.spread = prior.difference(self.measured.spread(parameter));
            }
            fit
        };
        let parameters = PARAMETERS.into_iter().filter(|p| setting.seeks(*p)).map(one).collect();
        (parameters, matched(setting, &mean, &fields, fitted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_of_another_magnification_is_an_error() {
        let fields = ["a", "b", "c"].map(|name| FieldImage { name: name.to_owned(), ..FieldImage::default() });
        let real = |areas: [f64; 3]| {
            areas.map(|area| Summary { names: vec![NUCLEAR_AREA.to_owned()], values: vec![libm::log(area)], nuclei: 9 })
        };
        // Lesions have larger nuclei.
        assert_eq!(check_magnification(&fields, &real([40.0, 45.0, 110.0])), Ok(()));
        assert_eq!(check_magnification(&fields, &real([40.0, f64::NAN, 45.0])), Ok(()));
        let message = check_magnification(&fields, &real([40.0, 180.0, 45.0])).unwrap_err().to_string();
        assert!(message.starts_with("field `b` has a median nuclear area of 180 µm²"), "{message}");
    }
}
