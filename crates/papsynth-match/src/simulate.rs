//! Simulation of samples, each with parameter values of its own.

use std::collections::BTreeMap;

use papsynth::key::Key;
use papsynth::recipe::{Condition, Recipe};
use papsynth_judge::{FieldImage, Phase};
use portable_numerics::random::{shuffle, uniform};
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

use crate::error::Error;
use crate::parameter::{Parameter, Values};
use crate::recipe::{Setting, recipe};
use crate::sampler::{MakeEngine, Sampler};
use crate::summary::Summary;

/// Simulates samples and measures them.
pub(crate) struct Simulator<'a> {
    /// Setting of the recipes.
    pub setting: &'a Setting,
    /// Size and measurement of the samples.
    pub sampler: &'a Sampler,
    /// Engine of a recipe.
    pub make: &'a MakeEngine<'a>,
    /// Random seed.
    pub seed: u64,
}

/// Some combinations of parameters leave no space for all cells. A larger fraction of failures is an error.
const MOST_FAILED: f64 = 0.2;

impl Simulator<'_> {
    /// Simulates a sample of each of these values, and returns its statistics; nothing for values that cannot be
    /// simulated. Sample `i` has the index `first + i`, so the result does not depend on the number of threads.
    ///
    /// # Errors
    /// If more than a fifth of the samples cannot be simulated; [`Error::Stopped`] if the stop flag is set.
    pub(crate) fn simulate(
        &self,
        values: &[Values],
        first: usize,
        phase: &Phase,
    ) -> Result<Vec<Option<Summary>>, Error> {
        let setting = Setting { size_px: self.sampler.size_px, ..self.setting.clone() };
        // All images of an engine have one pixel size.
        let mut groups: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
        for (i, v) in values.iter().enumerate() {
            let pixel = if setting.seek_pixel { v.get(Parameter::Pixel) } else { setting.pixel_um };
            groups.entry(pixel.to_bits()).or_default().push(i);
        }
        let mut found: Vec<Option<Summary>> = vec![None; values.len()];
        let mut reason = None;
        for members in groups.values() {
            let recipes: Vec<Recipe> = members.iter().map(|i| recipe(&setting, &values[*i], |_| true)).collect();
            let mut base = recipes[0].clone();
            base.conditions =
                recipes.iter().map(|r| Condition { weight: 1.0, numbers: r.numbers_unlike(&recipes[0]) }).collect();
            let engine = (self.make)(&base)?;
            let made: Vec<Result<Summary, Error>> = (0..members.len())
                .into_par_iter()
                .map(|k| {
                    let key = Key { seed: self.seed, index: (first + members[k]) as u64 };
                    let image = self.sampler.simulate(&engine, Some(k), key, phase.control());
                    let summary = image.and_then(|image| Summary::of(&image, self.sampler, phase.control()));
                    phase.step()?;
                    summary
                })
                .collect();
            for (i, result) in members.iter().zip(made) {
                match result {
                    Ok(summary) => found[*i] = Some(summary),
                    Err(Error::Stopped) => return Err(Error::Stopped),
                    Err(error) => reason = Some(error.to_string()),
                }
            }
        }
        let (succeeded, total) = (found.iter().flatten().count(), values.len());
        match reason {
            Some(reason) if (total - succeeded) as f64 > MOST_FAILED * total as f64 => {
                Err(Error::Simulation { succeeded, total, reason })
            }
            _ => Ok(found),
        }
    }
}

/// Simulates samples of a recipe, with the keys from `first` on, and measures each with `measure`. The conditions of
/// the recipe come in turn: each is as frequent as the others.
///
/// # Errors
/// If the recipe cannot be simulated, or the error of `measure`.
pub(crate) fn samples_of<T: Send>(
    recipe: &Recipe,
    sampler: &Sampler,
    make: &MakeEngine<'_>,
    [first, count]: [usize; 2],
    phase: &Phase,
    seed: u64,
    measure: impl Fn(&FieldImage) -> Result<T, Error> + Sync,
) -> Result<Vec<T>, Error> {
    let mut recipe = recipe.clone();
    let [width, height] = sampler.size_px.map(|side| side as f64);
    (recipe.field.width_px, recipe.field.height_px) = (width.into(), height.into());
    let engine = make(&recipe)?;
    let conditions = recipe.conditions.len();
    let one = |i: usize| {
        let condition = (conditions > 0).then(|| i % conditions.max(1));
        let key = Key { seed, index: (first + i) as u64 };
        let found = sampler.simulate(&engine, condition, key, phase.control()).and_then(|image| measure(&image));
        phase.step()?;
        found
    };
    (0..count).into_par_iter().map(one).collect::<Vec<_>>().into_iter().collect()
}

/// Draws a Latin hypercube over 0 to 1.
pub(crate) fn latin(rows: usize, columns: usize, seed: u64) -> Vec<Vec<f64>> {
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
