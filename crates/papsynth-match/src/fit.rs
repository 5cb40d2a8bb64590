//! The whole way: measure, simulate, regress, search.

use papsynth::recipe::{self, Recipe};
use papsynth_judge::Picture;
use rayon::prelude::*;
use serde::Serialize;

use crate::error::Error;
use crate::measured::{Measured, measure};
use crate::parameter::{PARAMETERS, Parameter, Prior, Source, Values};
use crate::recipe::{Setting, recipe};
use crate::refine::{Forward, distance, propose};
use crate::regression::{Estimate, Regression, WIDEST};
use crate::summary::{Summary, Window};
use crate::table::{Plan, Step, Table, TableParams, Tell};
use crate::view::{MakeEngine, View};

/// Whether the size of a pixel is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PixelSize {
    /// It is known, µm.
    Known(f64),
    /// It is sought, about this, µm: cells are taken to be as large as the recipe to begin with says.
    Sought(f64),
}

impl PixelSize {
    fn um(self) -> f64 {
        match self {
            Self::Known(um) | Self::Sought(um) => um,
        }
    }
}

/// How a microscope is matched.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchParams {
    /// Size of a pixel. Default: known, 0.33 µm.
    pub pixel: PixelSize,
    /// Simulated recipes and windows of each; of fewer real fields, as many windows as there are fields.
    pub table: TableParams,
    /// Rounds of the search, 0 to 1000. Default 6.
    pub rounds: usize,
}

impl Default for MatchParams {
    fn default() -> Self {
        Self { pixel: PixelSize::Known(0.33), table: TableParams::default(), rounds: 6 }
    }
}

/// Where a number of the recipe comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// A statistic of the real fields says it.
    Measured,
    /// Simulated windows with it are like the real ones.
    Simulated,
    /// The fields do not tell: the value is that of the recipe to begin with.
    NotIdentified,
}

/// What was found of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// Which.
    pub parameter: Parameter,
    /// Its fields in the recipe.
    pub path: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Where the value comes from.
    pub origin: Origin,
    /// What the recipe now says.
    pub value: f64,
    /// The 95 % interval.
    pub interval: [f64; 2],
    /// What the recipe to begin with says.
    pub before: f64,
    /// The range that was searched.
    pub range: [f64; 2],
    /// Width of the interval over that of the range, in steps or factors as the parameter counts.
    pub width: f64,
}

impl Answer {
    /// A value of which nothing more is known than its range.
    pub(crate) fn new(parameter: Parameter, origin: Origin, value: f64) -> Self {
        let Prior { path, unit, low, high, .. } = parameter.prior();
        let range = [low, high];
        Self { parameter, path, unit, origin, value, interval: range, before: value, range, width: 1.0 }
    }
}

/// Root mean square of standard errors between simulated and real windows. Two sets of windows of one recipe are some 1.4 apart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distance {
    /// Of the recipe to begin with.
    pub before: f64,
    /// Of what was measured and regressed.
    pub estimated: f64,
    /// After the search.
    pub after: f64,
}

/// A statistic of the real windows and of simulated ones.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statistic {
    /// What it is.
    pub name: String,
    /// Of the real windows.
    pub real: f64,
    /// Of the recipe to begin with.
    pub before: f64,
    /// Of the recipe that was found.
    pub after: f64,
    /// How many standard errors that is off.
    pub apart: f64,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fit {
    /// The recipe for fields like the real ones.
    #[serde(skip)]
    pub recipe: Recipe,
    /// Every parameter.
    pub answers: Vec<Answer>,
    /// How near it comes.
    pub distance: Distance,
    /// Every statistic.
    pub statistics: Vec<Statistic>,
    /// Real fields.
    pub fields: usize,
    /// Windows that they were cut into.
    pub windows: usize,
    /// Nuclei in these.
    pub nuclei: usize,
    /// Recipes of the table.
    pub simulated: usize,
    /// Whether the pictures were fused of several planes.
    pub extended: bool,
}

/// Matches microscopes.
#[derive(Debug, Clone, PartialEq)]
pub struct Match {
    params: MatchParams,
    base: Recipe,
}

/// Fewest nuclei that stain and sizes are learnt from.
const LEAST_NUCLEI: usize = 8;

/// Seeds of the search and of the last comparison, apart from that of the table.
const SEARCH: u64 = 1 << 40;
const LAST: u64 = 1 << 41;

impl Match {
    /// Begins with a recipe.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: &MatchParams, base: &Recipe) -> Result<Self, Error> {
        papsynth_judge::Error::check(&[
            ("rounds", params.rounds as f64, [0.0, 1e3], "0 to 1000"),
            ("pixel_um", params.pixel.um(), [0.05, 4.0], "0.05 to 4"),
        ])?;
        Ok(Self { params: params.clone(), base: base.clone() })
    }

    /// The setting of fields and what is known beforehand of their values.
    fn setting(&self, measured: &Measured) -> (Setting, Values) {
        // Pictures of extended focus have more than their noise in common.
        let fused = measured.extended && self.base.focus.output == recipe::FocusOutput::Planes;
        let setting = Setting {
            base: if fused { self.base.clone().fused() } else { self.base.clone() },
            size_px: measured.size_px,
            pixel_um: self.params.pixel.um(),
            bits: measured.bits,
            extended: measured.extended,
            seek_pixel: matches!(self.params.pixel, PixelSize::Sought(_)),
            spreads: measured.spreads,
        };
        let mut known = setting.base_values();
        for (parameter, estimate) in &measured.estimates {
            known.set(*parameter, estimate.value);
        }
        (setting, known)
    }

    /// Finds the recipe of fields. The same for the same seed, whatever the threads. `tell` hears how far the work is and stops it by
    /// false.
    ///
    /// # Errors
    /// If the fields are none or show nothing, recipes cannot be made, or `tell` says stop.
    pub fn run(&self, fields: &[Picture], make: &MakeEngine<'_>, tell: &Tell<'_>) -> Result<Fit, Error> {
        let measured = measure(fields, self.params.pixel.um())?;
        let view = View::new(measured.size_px, self.params.pixel.um(), measured.nuclei_from)?;
        let pictures: Vec<Picture> = fields.iter().flat_map(|f| view.windows(f)).collect();
        let windows = Window::all(&pictures, &view)?;
        let nuclei = windows.iter().map(Window::nuclei).sum();
        if nuclei < LEAST_NUCLEI {
            let pixel_um = self.params.pixel.um();
            return Err(Error::Nuclei { found: nuclei, fields: fields.len(), least: LEAST_NUCLEI, pixel_um });
        }
        let real = Summary::new(&windows);

        let (setting, known) = self.setting(&measured);
        let of_table =
            TableParams { windows: self.params.table.windows.min(fields.len()), ..self.params.table.clone() };
        let plan = Plan::new(&setting, &known, &view, make, &of_table)?;
        let table = plan.simulate(tell)?;
        let estimates = Regression::new(&table.statistics, &table.places).estimate(&real.values);
        let search = Search { plan: &plan, measured: &measured, table: &table, estimates };
        let (places, distance, statistics) = search.run(&real, self.params.rounds, tell)?;
        let answers = search.answers(&places);
        let fitted = |parameter: Parameter| {
            answers.iter().any(|a| a.parameter == parameter && a.origin != Origin::NotIdentified)
        };
        Ok(Fit {
            recipe: recipe(&setting, &plan.values(&places), fitted),
            answers,
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

/// The search about an estimate.
struct Search<'a> {
    plan: &'a Plan<'a>,
    measured: &'a Measured,
    table: &'a Table,
    estimates: Vec<Estimate>,
}

/// Places of all sought parameters, how near they come, and every statistic.
type Found = (Vec<f64>, Distance, Vec<Statistic>);

impl Search<'_> {
    fn identified(&self, parameter: Parameter) -> bool {
        match parameter.prior().source {
            Source::Measured => self.measured.get(parameter).is_some_and(|e| width_of_value(parameter, &e) <= WIDEST),
            Source::Simulated => {
                let place = self.plan.sought().iter().position(|p| *p == parameter);
                place.is_some_and(|i| self.estimates[i].high - self.estimates[i].low <= WIDEST)
            }
        }
    }

    fn simulate(&self, places: &[f64], fitted: impl Fn(Parameter) -> bool + Sync, seed: u64) -> Result<Summary, Error> {
        let engine = self.plan.engine(places, fitted)?;
        let count = self.plan.params.windows.max(2);
        let made = (0..count).into_par_iter().map(|index| self.plan.window(&engine, seed, index));
        Ok(Summary::new(&made.collect::<Vec<_>>().into_iter().collect::<Result<Vec<_>, _>>()?))
    }

    fn run(&self, real: &Summary, rounds: usize, tell: &Tell<'_>) -> Result<Found, Error> {
        let (sought, seed) = (self.plan.sought(), self.plan.params.seed);
        let forward = Forward::new(self.table);
        let base = self.plan.setting.base_values();
        let fitted = |parameter: Parameter| self.identified(parameter);
        let all = sought.iter().zip(self.estimates.iter().copied());
        let moving: Vec<(usize, Estimate)> =
            all.clone().enumerate().filter(|(_, (p, _))| fitted(**p)).map(|(i, (_, e))| (i, e)).collect();
        // What is not identified stays where the recipe to begin with has it.
        let start: Vec<f64> = all
            .map(|(p, e)| if fitted(*p) { e.value } else { p.prior().place(base.get(*p)).clamp(0.0, 1.0) })
            .collect();
        let apart = |s: &Summary| forward.apart(&real.values, &s.values);
        let seen = self.simulate(&start, fitted, seed ^ SEARCH)?;
        let mut best = (start.clone(), distance(&apart(&seen)), seen);
        let mut towards: Option<Vec<f64>> = None;
        for round in 0..rounds {
            let next = match &towards {
                // A step that led away is halved.
                Some(failed) => failed.iter().zip(&best.0).map(|(a, b)| 0.5 * (a + b)).collect(),
                None => propose(&forward, [&real.values, &best.2.values], &best.0, &moving),
            };
            let seen = self.simulate(&next, fitted, seed ^ SEARCH)?;
            let found = distance(&apart(&seen));
            if found < best.1 {
                best = (next, found, seen);
                towards = None;
            } else {
                towards = Some(next);
            }
            if !tell(Step::Searched(round + 1, rounds, best.1)) {
                return Err(Error::Stopped);
            }
        }
        // The last comparison is on windows that the search has not seen.
        let before = self.simulate(&start, |_| false, seed ^ LAST)?;
        let estimated = distance(&apart(&self.simulate(&start, fitted, seed ^ LAST)?));
        let after = self.simulate(&best.0, fitted, seed ^ LAST)?;
        let off = apart(&after);
        let told = Distance { before: distance(&apart(&before)), estimated, after: distance(&off) };
        let statistic = |i: usize| Statistic {
            name: real.names[i].clone(),
            real: real.values[i],
            before: before.values[i],
            after: after.values[i],
            apart: off[i],
        };
        Ok((best.0, told, (0..real.names.len()).map(statistic).collect()))
    }

    fn answers(&self, places: &[f64]) -> Vec<Answer> {
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
            Answer { interval, before, width, ..Answer::new(parameter, origin, value) }
        };
        sought.map(one).collect()
    }
}

/// Width of an interval of values over that of the range.
fn width_of_value(parameter: Parameter, e: &Estimate) -> f64 {
    let prior = parameter.prior();
    prior.place(e.high) - prior.place(e.low)
}
