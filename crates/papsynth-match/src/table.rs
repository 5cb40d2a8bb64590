//! The table of simulated recipes, drawn from the ranges of all parameters, and the statistics of their windows.

use papsynth::Engine;
use papsynth::key::Key;
use papsynth_judge::{Control, Phase};
use portable_numerics::random::{shuffle, uniform};
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

use crate::error::Error;
use crate::parameter::{PARAMETERS, Parameter, Values};
use crate::recipe::{Setting, recipe, simulated};
use crate::summary::{Summary, Window};
use crate::view::{MakeEngine, WindowSampler};

/// Name of the phase of simulations in progress reports.
pub(crate) const SIMULATING: &str = "simulating fields";

/// Parameters of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct TableParams {
    /// Number of recipes, 30 to 1000000. Default 300.
    pub recipes: usize,
    /// Windows of each recipe, each of another field, 1 to 1000. Default 8.
    pub windows: usize,
    /// Random seed.
    pub seed: u64,
}

impl Default for TableParams {
    fn default() -> Self {
        Self { recipes: 300, windows: 8, seed: 0 }
    }
}

/// Simulated recipes and the statistics of their windows.
#[derive(Debug, Clone)]
pub struct SimulationTable {
    /// Positions of the sought parameters in their ranges, recipe by recipe.
    pub places: Vec<Vec<f64>>,
    /// Statistics of the windows of each recipe.
    pub statistics: Vec<Vec<f64>>,
    /// Names of the statistics.
    pub names: Vec<String>,
}

/// A table of recipes before its simulation.
pub struct Plan<'a> {
    pub(crate) setting: &'a Setting,
    known: &'a Values,
    sought: Vec<Parameter>,
    view: &'a WindowSampler,
    make: &'a MakeEngine<'a>,
    pub(crate) params: TableParams,
    draws: Vec<Vec<f64>>,
}

impl<'a> Plan<'a> {
    /// Draws recipes from the ranges of all parameters that are found by simulation. `known` gives the other
    /// parameters.
    ///
    /// # Errors
    /// If a parameter is out of range.
    pub fn new(
        setting: &'a Setting,
        known: &'a Values,
        view: &'a WindowSampler,
        make: &'a MakeEngine<'a>,
        params: &TableParams,
    ) -> Result<Self, Error> {
        papsynth_judge::Error::check(&[
            ("recipes", params.recipes as f64, [30.0, 1e6], "30 to 1000000"),
            ("windows", params.windows as f64, [1.0, 1e3], "1 to 1000"),
        ])?;
        let sought = simulated(setting);
        let draws = latin(params.recipes, sought.len(), params.seed);
        Ok(Self { setting, known, sought, view, make, params: params.clone(), draws })
    }

    /// Returns the parameters that differ between the recipes.
    #[must_use]
    pub fn sought(&self) -> &[Parameter] {
        &self.sought
    }

    /// Returns the known values, with the sought parameters at other positions.
    pub(crate) fn values(&self, places: &[f64]) -> Values {
        let mut values = self.known.clone();
        for (parameter, place) in self.sought.iter().zip(places) {
            values.set(*parameter, parameter.prior().value(*place));
        }
        values
    }

    /// Returns the engine for windows of a recipe.
    pub(crate) fn engine(&self, places: &[f64], fitted: impl Fn(Parameter) -> bool) -> Result<Engine, Error> {
        let around = Setting { size_px: self.view.simulated_px(), ..self.setting.clone() };
        Ok((self.make)(&recipe(&around, &self.values(places), fitted))?)
    }

    /// Simulates and measures one window.
    pub(crate) fn window(&self, engine: &Engine, seed: u64, index: usize, phase: &Phase) -> Result<Window, Error> {
        let key = Key { seed, index: index as u64 };
        let window = Window::new(&self.view.simulate(engine, key, phase.control())?, self.view, phase.control())?;
        phase.step()?;
        Ok(window)
    }

    /// Simulates one recipe: the positions of the sought parameters in their ranges, and the statistics of its windows.
    /// Repeated calls return the same values.
    ///
    /// # Errors
    /// If the recipe cannot be simulated.
    pub fn row(&self, row: usize) -> Result<(Vec<f64>, Summary), Error> {
        self.row_with(row, &Control::NONE.phase(SIMULATING, self.params.windows))
    }

    fn row_with(&self, row: usize, phase: &Phase) -> Result<(Vec<f64>, Summary), Error> {
        phase.check()?;
        let places = &self.draws[row % self.draws.len()];
        let engine = self.engine(places, |_| true)?;
        let indices = row * self.params.windows..(row + 1) * self.params.windows;
        let windows: Result<Vec<Window>, Error> =
            indices.map(|index| self.window(&engine, self.params.seed, index, phase)).collect();
        Ok((places.clone(), Summary::new(&windows?)))
    }

    /// Returns the number of windows of the table.
    pub(crate) fn windows(&self) -> usize {
        self.params.recipes * self.params.windows
    }

    /// Simulates all recipes. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// If more than a fifth of the recipes cannot be simulated; [`Error::Stopped`] if the stop flag is set.
    pub fn simulate(&self, control: &Control) -> Result<SimulationTable, Error> {
        self.simulate_in(&control.phase(SIMULATING, self.windows()))
    }

    pub(crate) fn simulate_in(&self, phase: &Phase) -> Result<SimulationTable, Error> {
        let recipes = self.params.recipes;
        let made: Vec<Result<(Vec<f64>, Summary), Error>> =
            (0..recipes).into_par_iter().map(|row| self.row_with(row, phase)).collect();
        phase.check()?;
        let reason = made.iter().rev().find_map(|row| row.as_ref().err()).map(ToString::to_string);
        let rows: Vec<(Vec<f64>, Summary)> = made.into_iter().flatten().collect();
        let made = rows.len();
        /// Some combinations of parameters leave no space for all cells. More failures than this are an error.
        const MOST_FAILED: f64 = 0.2;
        if (recipes - made) as f64 > MOST_FAILED * recipes as f64 {
            return Err(Error::Simulation { succeeded: made, total: recipes, reason: reason.unwrap_or_default() });
        }
        let names = rows.last().map(|row| row.1.names.clone()).unwrap_or_default();
        let (places, statistics) = rows.into_iter().map(|(places, summary)| (places, summary.values)).unzip();
        Ok(SimulationTable { places, statistics, names })
    }
}

/// Draws a Latin hypercube over 0 to 1.
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

/// Draws recipes for trials: uniform positions in the ranges of all parameters.
#[must_use]
pub fn unseen(count: usize, seed: u64) -> Vec<[f64; PARAMETERS.len()]> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    (0..count).map(|_| std::array::from_fn(|_| uniform(&mut rng))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_stratum_of_each_range_has_one_draw() {
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
