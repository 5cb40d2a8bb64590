//! The table of simulated recipes: what windows of recipes all over the ranges are like.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use papsynth::key::Key;
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::parameter::{PARAMETERS, Parameter, Values};
use crate::recipe::{Setting, recipe};
use crate::summary::{Summary, Window};
use crate::view::{MakeEngine, View};

/// How far the work is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// So many of so many recipes of the table are simulated.
    Simulated(usize, usize),
    /// So many of so many rounds of the search are done; the distance is now this.
    Searched(usize, usize, f64),
}

/// How a table is made.
#[derive(Debug, Clone, PartialEq)]
pub struct TableParams {
    /// Recipes, 30 to 100000. Default 300.
    pub recipes: usize,
    /// Windows of each recipe, each a field of its own, 1 to 1000. Default 8.
    pub windows: usize,
    /// Where the random numbers begin.
    pub seed: u64,
}

impl Default for TableParams {
    fn default() -> Self {
        Self { recipes: 300, windows: 8, seed: 0 }
    }
}

/// Simulated recipes and what their windows are like.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Table {
    /// The parameters that differ between its recipes.
    pub sought: Vec<Parameter>,
    /// Their places in their ranges, recipe by recipe.
    pub places: Vec<Vec<f64>>,
    /// What the windows of each recipe are like.
    #[serde(with = "rows")]
    pub statistics: Vec<Vec<f64>>,
    /// Names of those numbers.
    pub names: Vec<String>,
}

/// Tells how far the work is; false stops it.
pub(crate) type Tell<'a> = dyn Fn(Step) -> bool + Sync + 'a;

impl Table {
    /// Draws recipes from the ranges of `sought` parameters, the others as in `known`, and simulates their windows. The same for the same
    /// seed, whatever the threads.
    ///
    /// # Errors
    /// If more than a fifth of the recipes cannot be made, or `tell` says stop.
    pub fn simulate(
        setting: &Setting,
        known: &Values,
        sought: &[Parameter],
        view: &View,
        make: &MakeEngine<'_>,
        params: &TableParams,
        tell: &Tell<'_>,
    ) -> Result<Self, Error> {
        for (field, value, low, high, accepted) in [
            ("recipes", params.recipes, 30, 100_000, "30 to 100000"),
            ("windows", params.windows, 1, 1000, "1 to 1000"),
        ] {
            if value < low || value > high {
                return Err(Error::Parameter { field, value: value as f64, accepted });
            }
        }
        let draws = latin(params.recipes, sought.len(), params.seed);
        let done = AtomicUsize::new(0);
        let stopped = Mutex::new(false);
        let one = |row: usize| -> Result<Summary, Error> {
            let go_on = || !stopped.lock().map_or(true, |s| *s);
            if !go_on() {
                return Err(Error::Stopped);
            }
            let values = spread_out(known, sought, &draws[row]);
            let windows = simulate(setting, &values, |_| true, view, make, params.windows, key_of(params, row));
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            if !tell(Step::Simulated(count, params.recipes))
                && let Ok(mut stop) = stopped.lock()
            {
                *stop = true;
            }
            windows
        };
        let made: Vec<Result<Summary, Error>> = (0..params.recipes).into_par_iter().map(one).collect();
        let mut table = Self { sought: sought.to_vec(), places: Vec::new(), statistics: Vec::new(), names: Vec::new() };
        let mut reason = String::new();
        for (result, draw) in made.into_iter().zip(draws) {
            match result {
                Ok(summary) => {
                    table.names = summary.names;
                    table.statistics.push(summary.values);
                    table.places.push(draw);
                }
                Err(Error::Stopped) => return Err(Error::Stopped),
                Err(error) => reason = error.to_string(),
            }
        }
        /// Ranges meet in corners where there is no room for so many cells; more than that is a mistake.
        const MOST_FAILED: f64 = 0.2;
        if ((params.recipes - table.places.len()) as f64) > MOST_FAILED * params.recipes as f64 {
            return Err(Error::Table { made: table.places.len(), asked: params.recipes, reason });
        }
        Ok(table)
    }
}

/// The first window of a recipe of the table.
fn key_of(params: &TableParams, row: usize) -> Key {
    Key { seed: params.seed, index: (row * params.windows) as u64 }
}

/// The known values with other places of those that are sought.
pub(crate) fn spread_out(known: &Values, sought: &[Parameter], places: &[f64]) -> Values {
    let mut values = known.clone();
    for (parameter, place) in sought.iter().zip(places) {
        values.set(*parameter, parameter.prior().value(*place));
    }
    values
}

/// What windows of a recipe are like. `setting` is that of whole fields.
pub(crate) fn simulate(
    setting: &Setting,
    values: &Values,
    fitted: impl Fn(Parameter) -> bool,
    view: &View,
    make: &MakeEngine<'_>,
    windows: usize,
    first: Key,
) -> Result<Summary, Error> {
    let around = Setting { size_px: view.simulated_px(), ..setting.clone() };
    let engine = make(&recipe(&around, values, fitted)).map_err(|e| Error::Engine(e.to_string()))?;
    let mut names = Vec::new();
    let window = |i: usize| -> Result<(Window, Vec<String>), Error> {
        let key = Key { index: first.index + i as u64, ..first };
        let picture = view.simulate(&engine, key).map_err(|e| Error::Engine(e.to_string()))?;
        Window::new(&picture, view)
    };
    // What is the same everywhere, such as a field without anything on it, cannot be measured: it is left out.
    let mut made = Vec::with_capacity(windows);
    for i in 0..windows {
        let (window, of_window) = window(i)?;
        names = of_window;
        made.push(window);
    }
    Ok(Summary::new(&made, &names))
}

/// Places over 0 to 1 in so many dimensions: in each, every part of the range is met once (a Latin hypercube).
fn latin(rows: usize, columns: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x6c61_7469_6e00);
    let mut out = vec![vec![0.0; columns]; rows];
    for column in 0..columns {
        let mut order: Vec<usize> = (0..rows).collect();
        for i in (1..rows).rev() {
            order.swap(i, below(i + 1, &mut rng));
        }
        for (row, stratum) in out.iter_mut().zip(order) {
            row[column] = (stratum as f64 + unit(&mut rng)) / rows as f64;
        }
    }
    out
}

fn below<R: Rng + ?Sized>(bound: usize, rng: &mut R) -> usize {
    usize::try_from((u128::from(rng.next_u64()) * bound as u128) >> 64).unwrap_or(0)
}

/// 0 to 1, one excluded.
fn unit<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    /// 2⁻⁵³: as many bits as a number holds.
    const STEP: f64 = 1.0 / 9_007_199_254_740_992.0;
    (rng.next_u64() >> 11) as f64 * STEP
}

/// Unseen recipes for trials: places drawn evenly from the ranges of all parameters.
#[must_use]
pub fn unseen(count: usize, seed: u64) -> Vec<[f64; PARAMETERS.len()]> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    (0..count).map(|_| std::array::from_fn(|_| unit(&mut rng))).collect()
}

/// JSON has no NaN: it is written as null.
pub(crate) mod rows {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(rows: &[Vec<f64>], to: S) -> Result<S::Ok, S::Error> {
        rows.serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Vec<f64>>, D::Error> {
        let rows = Vec::<Vec<Option<f64>>>::deserialize(from)?;
        Ok(rows.into_iter().map(|r| r.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_every_range_is_met_once() {
        let draws = latin(50, 3, 4);
        for column in 0..3 {
            let mut strata: Vec<usize> = draws.iter().map(|d| crate::number::whole(d[column] * 50.0)).collect();
            strata.sort_unstable();
            assert_eq!(strata, (0..50).collect::<Vec<_>>());
        }
        assert_eq!(draws, latin(50, 3, 4));
        assert_ne!(draws, latin(50, 3, 5));
    }
}
