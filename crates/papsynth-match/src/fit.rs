//! The complete match: measurement, simulation, regression, search.

use papsynth::recipe::{self, Recipe};
use papsynth_judge::{Control, FieldImage, Phase};
use rayon::prelude::*;
use serde::Serialize;

use crate::error::Error;
use crate::measured::{Measured, measure_with};
use crate::parameter::{PARAMETERS, Parameter, Prior, Source, Values};
use crate::recipe::{Setting, recipe};
use crate::refine::{Forward, distance, propose};
use crate::regression::{Estimate, Regression, WIDEST};
use crate::summary::{Summary, Window};
use crate::table::{Plan, SIMULATING, TableParams};
use crate::view::{MakeEngine, WindowSampler};

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
    /// Windows to simulate before the search, 60 to 1000000. Default 2000.
    pub simulations: usize,
    /// Windows of each simulated recipe, 1 to 1000; at most the number of real fields. Default 8.
    pub windows: usize,
    /// Rounds of the search, 0 to 1000. Default 8.
    pub rounds: usize,
    /// Seed of all random draws. Default 0.
    pub seed: u64,
}

impl MatchParams {
    /// Returns parameters for a first look: a sixth of the simulations, wider intervals, fewer identified parameters.
    #[must_use]
    pub fn quick() -> Self {
        Self { simulations: 336, rounds: 3, ..Self::default() }
    }
}

impl Default for MatchParams {
    fn default() -> Self {
        Self { pixel: PixelSize::Known(0.33), simulations: 2000, windows: 8, rounds: 8, seed: 0 }
    }
}

/// Origin of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// A statistic of the real fields.
    Measured,
    /// Simulations: windows with this value are similar to the real ones.
    Simulated,
    /// The initial recipe, because the fields do not determine the value.
    NotIdentified,
}

/// Result for a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterFit {
    /// Parameter.
    pub parameter: Parameter,
    /// Fields of the recipe.
    pub path: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Origin of the value.
    pub origin: Origin,
    /// Value in the matched recipe.
    pub value: f64,
    /// 95 % interval.
    pub interval: [f64; 2],
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
        Self { parameter, path, unit, origin, value, interval: range, before: value, range, width: 1.0 }
    }
}

/// Root mean square of the differences between simulated and real statistics, in standard errors. For two sets of
/// windows of one recipe it is about 1.4.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distance {
    /// For the initial recipe.
    pub before: f64,
    /// For the values from measurement and regression.
    pub estimated: f64,
    /// After the search.
    pub after: f64,
}

/// A statistic of the real and of the simulated windows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statistic {
    /// Name.
    pub name: String,
    /// For the real windows.
    pub real: f64,
    /// For the initial recipe.
    pub before: f64,
    /// For the matched recipe.
    pub after: f64,
    /// Difference between matched recipe and real windows, in standard errors.
    pub standard_errors: f64,
}

/// Result of a match.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fit {
    /// Matched recipe.
    #[serde(skip)]
    pub recipe: Recipe,
    /// All parameters.
    pub parameters: Vec<ParameterFit>,
    /// Distance between simulated and real windows.
    pub distance: Distance,
    /// All statistics.
    pub statistics: Vec<Statistic>,
    /// Number of real fields.
    pub fields: usize,
    /// Number of windows in the real fields.
    pub windows: usize,
    /// Number of nuclei in the windows.
    pub nuclei: usize,
    /// Number of simulated recipes.
    pub simulated: usize,
    /// Whether the real fields are fused from several focal planes (extended depth of field).
    pub extended: bool,
}

/// A match of a recipe to real fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Match {
    params: MatchParams,
    base: Recipe,
}

/// Minimum number of recipes of the table.
const LEAST_RECIPES: usize = 30;

/// Minimum number of nuclei to estimate stain and sizes.
const LEAST_NUCLEI: usize = 8;

/// Differences between the seed of the table and those of the search and of the final comparison.
const SEARCH: u64 = 1 << 40;
const LAST: u64 = 1 << 41;

impl Match {
    /// Checks the parameters. `base` is the initial recipe.
    ///
    /// # Errors
    /// If a parameter is out of range.
    pub fn new(params: &MatchParams, base: &Recipe) -> Result<Self, Error> {
        papsynth_judge::Error::check(&[
            ("simulations", params.simulations as f64, [60.0, 1e6], "60 to 1000000"),
            ("windows", params.windows as f64, [1.0, 1e3], "1 to 1000"),
            ("rounds", params.rounds as f64, [0.0, 1e3], "0 to 1000"),
            ("pixel_um", params.pixel.um(), [0.05, 4.0], "0.05 to 4"),
        ])?;
        Ok(Self { params: params.clone(), base: base.clone() })
    }

    /// Returns the setting for real fields, and the known parameter values.
    fn setting(&self, measured: &Measured) -> (Setting, Values) {
        // Fused images differ from others by more than their noise.
        let fused = measured.extended && self.base.focus.output == recipe::FocusOutput::Planes;
        let setting = Setting {
            base: if fused { self.base.clone().fused() } else { self.base.clone() },
            size_px: measured.size_px,
            pixel_um: self.params.pixel.um(),
            bits: measured.bits,
            extended: measured.extended,
            seek_pixel: matches!(self.params.pixel, PixelSize::Sought(_)),
            field_sd: measured.field_sd,
        };
        let mut known = setting.base_values();
        for (parameter, estimate) in &measured.estimates {
            known.set(*parameter, estimate.value);
        }
        (setting, known)
    }

    /// Finds the recipe of real fields. The result does not depend on the number of threads.
    ///
    /// The phases of the progress reports are "measuring fields", "measuring windows", "simulating fields", "fitting
    /// regressions" and "searching, distance …". The last one continues the count of "simulating fields", so the time
    /// of the first simulations gives the remaining time of the complete match, except for the seconds of "fitting
    /// regressions".
    ///
    /// # Errors
    /// If there are no fields, or too few nuclei in them, or recipes cannot be simulated; [`Error::Stopped`] if the
    /// stop flag is set.
    pub fn run(&self, fields: &[FieldImage], make: &MakeEngine<'_>, control: &Control) -> Result<Fit, Error> {
        let measured = measure_with(fields, self.params.pixel.um(), control)?;
        let view = WindowSampler::new(measured.size_px, self.params.pixel.um(), measured.nuclei_from)?;
        let pictures: Vec<FieldImage> = fields.iter().flat_map(|f| view.windows(f)).collect();
        let windows = Window::all(&pictures, &view, control)?;
        let nuclei = windows.iter().map(Window::nuclei).sum();
        if nuclei < LEAST_NUCLEI {
            let pixel_um = self.params.pixel.um();
            return Err(Error::Nuclei { found: nuclei, fields: fields.len(), least: LEAST_NUCLEI, pixel_um });
        }
        let real = Summary::new(&windows);

        let (setting, known) = self.setting(&measured);
        let per_recipe = self.params.windows.min(fields.len());
        let recipes = (self.params.simulations / per_recipe).max(LEAST_RECIPES);
        let params = TableParams { recipes, windows: per_recipe, seed: self.params.seed };
        let plan = Plan::new(&setting, &known, &view, make, &params)?;
        let total = plan.windows() + Search::simulations(&plan, self.params.rounds);
        let table = plan.simulate_in(&control.phase(SIMULATING, total))?;
        let regression = Regression::new_with(&table.statistics, &table.places, control)?;
        let estimates = regression.estimate(&real.values);
        let forward = Forward::new(&table, control)?;
        let search = Search { plan: &plan, measured: &measured, forward, estimates, control, total };
        let (places, distance, statistics) = search.run(&real, self.params.rounds)?;
        let parameters = search.parameters(&places);
        let fitted = |parameter: Parameter| {
            parameters.iter().any(|a| a.parameter == parameter && a.origin != Origin::NotIdentified)
        };
        Ok(Fit {
            recipe: recipe(&setting, &plan.values(&places), fitted),
            parameters,
            distance,
            statistics,
            fields: fields.len(),
            windows: pictures.len(),
            nuclei,
            simulated: table.places.len(),
            extended: measured.extended,
        })
    }
}

/// The search around the estimates.
struct Search<'a> {
    plan: &'a Plan<'a>,
    measured: &'a Measured,
    forward: Forward,
    estimates: Vec<Estimate>,
    control: &'a Control<'a>,
    /// Simulations of the table and of the search.
    total: usize,
}

/// Positions of all sought parameters, distance, and all statistics.
type Found = (Vec<f64>, Distance, Vec<Statistic>);

impl Search<'_> {
    /// Returns the number of simulations of a search: one start, its rounds and three final comparisons.
    fn simulations(plan: &Plan, rounds: usize) -> usize {
        (rounds + 4) * Self::windows(plan)
    }

    fn windows(plan: &Plan) -> usize {
        plan.params.windows.max(2)
    }

    fn identified(&self, parameter: Parameter) -> bool {
        match parameter.prior().source {
            Source::Measured => self.measured.get(parameter).is_some_and(|e| width_of_value(parameter, &e) <= WIDEST),
            Source::Simulated => {
                let place = self.plan.sought().iter().position(|p| *p == parameter);
                place.is_some_and(|i| self.estimates[i].high - self.estimates[i].low <= WIDEST)
            }
        }
    }

    fn simulate(
        &self,
        places: &[f64],
        fitted: impl Fn(Parameter) -> bool + Sync,
        seed: u64,
        phase: &Phase,
    ) -> Result<Summary, Error> {
        let engine = self.plan.engine(places, fitted)?;
        let indices = (0..Self::windows(self.plan)).into_par_iter();
        let made = indices.map(|index| self.plan.window(&engine, seed, index, phase));
        Ok(Summary::new(&made.collect::<Vec<_>>().into_iter().collect::<Result<Vec<_>, _>>()?))
    }

    fn run(&self, real: &Summary, rounds: usize) -> Result<Found, Error> {
        let (sought, seed) = (self.plan.sought(), self.plan.params.seed);
        let base = self.plan.setting.base_values();
        let fitted = |parameter: Parameter| self.identified(parameter);
        let all = sought.iter().zip(self.estimates.iter().copied());
        let moving: Vec<(usize, Estimate)> =
            all.clone().enumerate().filter(|(_, (p, _))| fitted(**p)).map(|(i, (_, e))| (i, e)).collect();
        // Parameters that are not identified keep the value of the initial recipe.
        let start: Vec<f64> = all
            .map(|(p, e)| if fitted(*p) { e.value } else { p.prior().place(base.get(*p)).clamp(0.0, 1.0) })
            .collect();
        let apart = |s: &Summary| self.forward.apart(&real.values, &s.values);
        let phase = self.control.resume("searching", self.plan.windows(), self.total);
        let seen = self.simulate(&start, fitted, seed ^ SEARCH, &phase)?;
        let mut done = phase.done();
        let mut best = (start.clone(), distance(&apart(&seen)), seen);
        let mut towards: Option<Vec<f64>> = None;
        for _ in 0..rounds {
            let next = match &towards {
                // A step that increased the distance is halved.
                Some(failed) => failed.iter().zip(&best.0).map(|(a, b)| 0.5 * (a + b)).collect(),
                None => propose(&self.forward, [&real.values, &best.2.values], &best.0, &moving),
            };
            let name = format!("searching, distance {:.2}", best.1);
            let phase = self.control.resume(&name, done, self.total);
            let seen = self.simulate(&next, fitted, seed ^ SEARCH, &phase)?;
            done = phase.done();
            let found = distance(&apart(&seen));
            if found < best.1 {
                best = (next, found, seen);
                towards = None;
            } else {
                towards = Some(next);
            }
        }
        // The final comparison uses windows that the search did not use.
        let name = format!("searching, distance {:.2}", best.1);
        let phase = self.control.resume(&name, done, self.total);
        let before = self.simulate(&start, |_| false, seed ^ LAST, &phase)?;
        let estimated = distance(&apart(&self.simulate(&start, fitted, seed ^ LAST, &phase)?));
        let after = self.simulate(&best.0, fitted, seed ^ LAST, &phase)?;
        let off = apart(&after);
        let distances = Distance { before: distance(&apart(&before)), estimated, after: distance(&off) };
        let statistic = |i: usize| Statistic {
            name: real.names[i].clone(),
            real: real.values[i],
            before: before.values[i],
            after: after.values[i],
            standard_errors: off[i],
        };
        Ok((best.0, distances, (0..real.names.len()).map(statistic).collect()))
    }

    fn parameters(&self, places: &[f64]) -> Vec<ParameterFit> {
        let base = self.plan.setting.base_values();
        let sought = PARAMETERS.into_iter().filter(|p| self.plan.setting.seeks(*p));
        let one = |parameter: Parameter| {
            let prior = parameter.prior();
            let place = self.plan.sought().iter().position(|p| *p == parameter);
            let (value, interval, width) = match (place, self.measured.get(parameter)) {
                (Some(i), _) => {
                    let e = self.estimates[i];
                    (prior.value(places[i]), [e.low, e.high].map(|p| prior.value(p)), e.high - e.low)
                }
                (None, Some(e)) => (e.value, [e.low, e.high], width_of_value(parameter, &e)),
                (None, None) => (base.get(parameter), [prior.low, prior.high], 1.0),
            };
            let origin = match (self.identified(parameter), prior.source) {
                (false, _) => Origin::NotIdentified,
                (true, Source::Measured) => Origin::Measured,
                (true, Source::Simulated) => Origin::Simulated,
            };
            let before = base.get(parameter);
            let value = if origin == Origin::NotIdentified { before } else { value };
            ParameterFit { interval, before, width, ..ParameterFit::new(parameter, origin, value) }
        };
        sought.map(one).collect()
    }
}

/// Returns the width of an interval of values over that of the range.
fn width_of_value(parameter: Parameter, e: &Estimate) -> f64 {
    let prior = parameter.prior();
    prior.place(e.high) - prior.place(e.low)
}
