//! The table of simulated recipes: what windows of recipes all over the ranges are like.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use papsynth::Engine;
use papsynth::key::Key;
use portable_numerics::random::{shuffle, uniform};
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

use crate::error::Error;
use crate::parameter::{PARAMETERS, Parameter, Values};
use crate::recipe::{Setting, recipe, simulated};
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
#[derive(Debug, Clone)]
pub struct Table {
    /// Places of the sought parameters in their ranges, recipe by recipe.
    pub places: Vec<Vec<f64>>,
    /// What the windows of each recipe are like.
    pub statistics: Vec<Vec<f64>>,
    /// Names of those numbers.
    pub names: Vec<String>,
}

/// Tells how far the work is; false stops it.
pub(crate) type Tell<'a> = dyn Fn(Step) -> bool + Sync + 'a;

/// A table that is to be simulated: recipes from the ranges of sought parameters.
pub struct Plan<'a> {
    pub(crate) setting: &'a Setting,
    known: &'a Values,
    sought: Vec<Parameter>,
    view: &'a View,
    make: &'a MakeEngine<'a>,
    pub(crate) params: TableParams,
    draws: Vec<Vec<f64>>,
}

impl<'a> Plan<'a> {
    /// Draws recipes from the ranges of all parameters that are found by simulation; the others are as in `known`.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(
        setting: &'a Setting,
        known: &'a Values,
        view: &'a View,
        make: &'a MakeEngine<'a>,
        params: &TableParams,
    ) -> Result<Self, Error> {
        papsynth_judge::Error::check(&[
            ("recipes", params.recipes as f64, [30.0, 1e5], "30 to 100000"),
            ("windows", params.windows as f64, [1.0, 1e3], "1 to 1000"),
        ])?;
        let sought = simulated(setting);
        let draws = latin(params.recipes, sought.len(), params.seed);
        Ok(Self { setting, known, sought, view, make, params: params.clone(), draws })
    }

    /// The parameters that differ between the recipes.
    #[must_use]
    pub fn sought(&self) -> &[Parameter] {
        &self.sought
    }

    /// The known values with other places of those that are sought.
    pub(crate) fn values(&self, places: &[f64]) -> Values {
        let mut values = self.known.clone();
        for (parameter, place) in self.sought.iter().zip(places) {
            values.set(*parameter, parameter.prior().value(*place));
        }
        values
    }

    /// The engine of windows of a recipe.
    pub(crate) fn engine(&self, places: &[f64], fitted: impl Fn(Parameter) -> bool) -> Result<Engine, Error> {
        let around = Setting { size_px: self.view.simulated_px(), ..self.setting.clone() };
        Ok((self.make)(&recipe(&around, &self.values(places), fitted))?)
    }

    /// One of its windows.
    pub(crate) fn window(&self, engine: &Engine, seed: u64, index: usize) -> Result<Window, Error> {
        Window::new(&self.view.simulate(engine, Key { seed, index: index as u64 })?, self.view)
    }

    /// Simulates one of the recipes: its places in the ranges of the sought parameters, and what its windows are like. The same
    /// whenever it is asked for.
    ///
    /// # Errors
    /// If the recipe cannot be made.
    pub fn row(&self, row: usize) -> Result<(Vec<f64>, Summary), Error> {
        let places = &self.draws[row % self.draws.len()];
        let engine = self.engine(places, |_| true)?;
        let indices = row * self.params.windows..(row + 1) * self.params.windows;
        let windows: Result<Vec<Window>, Error> =
            indices.map(|index| self.window(&engine, self.params.seed, index)).collect();
        Ok((places.clone(), Summary::new(&windows?)))
    }

    /// Simulates all of them. The same for the same seed, whatever the threads.
    ///
    /// # Errors
    /// If more than a fifth of the recipes cannot be made, or `tell` says stop.
    pub fn simulate(&self, tell: &Tell<'_>) -> Result<Table, Error> {
        let recipes = self.params.recipes;
        let done = AtomicUsize::new(0);
        let stopped = AtomicBool::new(false);
        let one = |row: usize| -> Result<(Vec<f64>, Summary), Error> {
            if stopped.load(Ordering::Relaxed) {
                return Err(Error::Stopped);
            }
            let made = self.row(row);
            if !tell(Step::Simulated(done.fetch_add(1, Ordering::Relaxed) + 1, recipes)) {
                stopped.store(true, Ordering::Relaxed);
            }
            made
        };
        let made: Vec<Result<(Vec<f64>, Summary), Error>> = (0..recipes).into_par_iter().map(one).collect();
        if stopped.into_inner() {
            return Err(Error::Stopped);
        }
        let reason = made.iter().rev().find_map(|row| row.as_ref().err()).map(ToString::to_string);
        let rows: Vec<(Vec<f64>, Summary)> = made.into_iter().flatten().collect();
        let made = rows.len();
        /// Ranges meet in corners where there is no room for so many cells; more than that is a mistake.
        const MOST_FAILED: f64 = 0.2;
        if (recipes - made) as f64 > MOST_FAILED * recipes as f64 {
            return Err(Error::Table { made, asked: recipes, reason: reason.unwrap_or_default() });
        }
        let names = rows.last().map(|row| row.1.names.clone()).unwrap_or_default();
        let (places, statistics) = rows.into_iter().map(|(places, summary)| (places, summary.values)).unzip();
        Ok(Table { places, statistics, names })
    }
}

/// Places over 0 to 1 in so many dimensions: in each, every part of the range is met once (a Latin hypercube).
fn latin(rows: usize, columns: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x6c61_7469_6e00);
    let mut out = vec![vec![0.0; columns]; rows];
    for column in 0..columns {
        let mut order: Vec<usize> = (0..rows).collect();
        shuffle(&mut order, &mut rng);
        for (row, stratum) in out.iter_mut().zip(order) {
            row[column] = (stratum as f64 + uniform(&mut rng)) / rows as f64;
        }
    }
    out
}

/// Unseen recipes for trials: places drawn evenly from the ranges of all parameters.
#[must_use]
pub fn unseen(count: usize, seed: u64) -> Vec<[f64; PARAMETERS.len()]> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    (0..count).map(|_| std::array::from_fn(|_| uniform(&mut rng))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_every_range_is_met_once() {
        let draws = latin(50, 3, 4);
        for column in 0..3 {
            let mut strata: Vec<usize> =
                draws.iter().map(|d| papsynth_judge::number::whole(d[column] * 50.0)).collect();
            strata.sort_unstable();
            assert_eq!(strata, (0..50).collect::<Vec<_>>());
        }
        assert_eq!(draws, latin(50, 3, 4));
        assert_ne!(draws, latin(50, 3, 5));
    }
}
