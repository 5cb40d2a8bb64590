//! Comparison of simulated with real fields by classifiers, and a search that lowers their success.

use papsynth::recipe::Recipe;
use papsynth_judge::{
    Control, FeatureTable, Field, FieldImage, Judge, JudgeParams, Report, TwoSampleParams, two_sample,
};
use portable_numerics::random::normal;
use portable_numerics::statistics::mean;
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;

use crate::error::Error;
use crate::posterior::Posterior;
use crate::sampler::{MakeEngine, Sampler};
use crate::simulate::samples_of;

/// Success of classifiers that distinguish simulated from real fields: area under the ROC curve (AUC), mean of nuclei
/// and patches. ½ is chance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Success {
    /// On the fields that the search used.
    pub used: f64,
    /// On the other fields.
    pub held_out: f64,
}

/// Result of a search against classifiers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Refinement {
    /// Rounds.
    pub rounds: usize,
    /// Success with the parameters before the search.
    pub before: Success,
    /// Success with the parameters after it.
    pub after: Success,
    /// Whether the parameters after it are those of the recipe: not if they are worse for the held-out fields.
    pub kept: bool,
}

/// Simulated fields of a comparison.
const SIMULATED: usize = 16;

/// Minimum number of real fields of a search: half of them are held out.
pub(crate) const LEAST_FIELDS: usize = 4;

/// Measures samples of real fields, patches included.
fn measured(fields: &[FieldImage], sampler: &Sampler, control: &Control) -> Result<Vec<Field>, Error> {
    let samples: Vec<FieldImage> = fields.iter().flat_map(|field| sampler.samples(field)).collect();
    sampler.measurer.measure_all(&samples, |image| Ok(image.clone()), control)
}

/// Simulates fields of a recipe and measures them, patches included.
fn simulated(
    recipe: &Recipe,
    sampler: &Sampler,
    make: &MakeEngine<'_>,
    first: usize,
    seed: u64,
    control: &Control,
) -> Result<Vec<Field>, Error> {
    let phase = control.phase("simulating fields to compare", SIMULATED);
    let measure = |image: &FieldImage| Ok(sampler.measurer.measure_with(image, control)?);
    samples_of(recipe, sampler, make, [first, SIMULATED], &phase, seed, measure)
}

/// Compares real fields with simulated fields of a recipe. `first` is the index of the first one.
pub(crate) fn report(
    fields: &[FieldImage],
    sampler: &Sampler,
    make: &MakeEngine<'_>,
    recipe: &Recipe,
    first: usize,
    seed: u64,
    control: &Control,
) -> Result<Report, Error> {
    let real = measured(fields, sampler, control)?;
    let synthetic = simulated(recipe, sampler, make, first, seed, control)?;
    let params = JudgeParams { seed, ..JudgeParams::quick() };
    Ok(Judge::new(&params)?.compare_with(&real, &synthetic, control)?)
}

/// A search for means of the parameters that lower the success of the classifiers.
pub(crate) struct Refine<'a> {
    pub(crate) sampler: &'a Sampler,
    pub(crate) make: &'a MakeEngine<'a>,
    pub(crate) seed: u64,
    /// Index of the first simulated field: each candidate uses the same random numbers.
    pub(crate) first: usize,
    /// Returns the recipe with these parameters.
    pub(crate) recipe: &'a dyn Fn(&Posterior) -> Recipe,
    /// Which parameters the search changes.
    pub(crate) moving: &'a [bool],
}

/// Size of the first step, in standard errors of the parameters.
const FIRST_STEP: f64 = 0.7;

/// Changes of the size of a step after a success and after a failure.
const LONGER: f64 = 1.2;
const SHORTER: f64 = 0.85;

/// Larger success on held-out fields than before the search, by this, is over-fitting.
const OVER_FITTING: f64 = 0.02;

impl Refine<'_> {
    /// Searches from `start`: a (1 + 2) evolution strategy with opposite steps. Every second field is held out.
    pub(crate) fn run(
        &self,
        fields: &[FieldImage],
        start: &Posterior,
        rounds: usize,
        control: &Control,
    ) -> Result<(Posterior, Refinement), Error> {
        let real = measured(fields, self.sampler, control)?;
        let per_field = real.len() / fields.len();
        let part = |which: usize| -> Vec<&Field> {
            (0..real.len()).filter(|i| (i / per_field) % 2 == which).map(|i| &real[i]).collect()
        };
        let halves = [part(0), part(1)];
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(self.seed ^ 0x7265_6669_6e65);
        let mut best = (start.clone(), self.success(start, &halves, control)?);
        let before = best.1;
        let mut step = FIRST_STEP;
        for round in 0..rounds {
            let name = format!("refining, AUC {:.3}", best.1.used);
            control.resume(&name, round, rounds).step()?;
            let shift: Vec<f64> = best.0.errors.iter().map(|error| step * error * normal(&mut rng)).collect();
            let mut better = None;
            for sign in [1.0, -1.0] {
                let shift: Vec<f64> =
                    shift.iter().zip(self.moving).map(|(s, on)| if *on { sign * s } else { 0.0 }).collect();
                let tried = best.0.shifted(&shift);
                // Some combinations of parameters leave no space for all cells.
                let success = match self.success(&tried, &halves, control) {
                    Err(Error::Engine(_)) => continue,
                    other => other?,
                };
                if success.used < better.as_ref().map_or(best.1.used, |(_, s): &(Posterior, Success)| s.used) {
                    better = Some((tried, success));
                }
            }
            step *= if better.is_some() { LONGER } else { SHORTER };
            best = better.unwrap_or(best);
        }
        let after = best.1;
        let kept = after.held_out <= before.held_out + OVER_FITTING;
        let found = if kept { best.0 } else { start.clone() };
        Ok((found, Refinement { rounds, before, after, kept }))
    }

    fn success(&self, at: &Posterior, halves: &[Vec<&Field>; 2], control: &Control) -> Result<Success, Error> {
        let silent = control.silent();
        let synthetic = simulated(&(self.recipe)(at), self.sampler, self.make, self.first, self.seed, &silent)?;
        let params = TwoSampleParams { folds: 3, trees: 100, half_splits: 1, bootstrap: 10, permuted: 0 };
        let of = |half: &[&Field]| -> Result<f64, Error> {
            let mut aucs = Vec::new();
            for table in [|f: &Field| f.nuclei.clone(), |f: &Field| f.patches.clone()] {
                let real: Vec<FeatureTable> = half.iter().map(|f| table(f)).collect();
                let synthetic: Vec<FeatureTable> = synthetic.iter().map(table).collect();
                let test = two_sample(&real, &synthetic, &params, self.seed, "classifying", &silent)?;
                aucs.extend(test.map(|test| test.auc));
            }
            Ok(if aucs.is_empty() { 1.0 } else { mean(&aucs) })
        };
        Ok(Success { used: of(&halves[0])?, held_out: of(&halves[1])? })
    }
}
