//! Distance between simulated and real fields.

use portable_numerics::statistics::{deviation, mean};
use serde::Serialize;

use crate::summary::Summary;

/// Root mean square of the differences between simulated and real fields, over all statistics, in standard deviations
/// between fields. Two sets of 8 and 16 fields of one recipe have a distance of about 0.4.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distance {
    /// For the initial recipe.
    pub before: f64,
    /// For the matched recipe.
    pub after: f64,
}

/// A statistic of the real and of the simulated fields.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statistic {
    /// Name.
    pub name: String,
    /// Mean over the real fields.
    pub real: f64,
    /// Mean over fields of the initial recipe.
    pub before: f64,
    /// Mean over fields of the matched recipe.
    pub after: f64,
    /// Difference between matched recipe and real fields, in standard deviations between fields.
    pub difference: f64,
}

/// Larger differences have a linear loss, so that a few statistics that no recipe can match have less weight.
const LINEAR_FROM: f64 = 3.0;

/// Compares real fields with fields of the initial and of the matched recipe.
pub(crate) fn statistics(real: &[Summary], before: &[Summary], after: &[Summary]) -> (Distance, Vec<Statistic>) {
    let names = real.first().map_or(&[][..], |field| &field.names);
    let column = |fields: &[Summary], c: usize| -> Vec<f64> {
        fields.iter().map(|field| field.values[c]).filter(|v| v.is_finite()).collect()
    };
    let (mut all, mut far) = (Vec::new(), [Vec::new(), Vec::new()]);
    for (c, name) in names.iter().enumerate() {
        let [of_real, of_before, of_after] = [real, before, after].map(|fields| column(fields, c));
        // One field has no standard deviation of its own.
        let squares = |values: &[f64]| match values.len() {
            0 | 1 => 0.0,
            n => deviation(values) * deviation(values) * (n - 1) as f64,
        };
        let sets = [&of_real, &of_before, &of_after];
        let freedom: usize = sets.iter().map(|values| values.len().saturating_sub(1)).sum();
        let sd = (sets.iter().map(|values| squares(values)).sum::<f64>() / freedom.max(1) as f64).sqrt();
        // A statistic that few fields have, such as that of free cells, is left out.
        let few =
            [(&of_real, real), (&of_before, before), (&of_after, after)].iter().any(|(v, f)| 2 * v.len() < f.len());
        let off = |values: &[f64]| if sd > 0.0 && !few { (mean(values) - mean(&of_real)) / sd } else { f64::NAN };
        far[0].push(off(&of_before));
        far[1].push(off(&of_after));
        all.push(Statistic {
            name: name.clone(),
            real: mean(&of_real),
            before: mean(&of_before),
            after: mean(&of_after),
            difference: off(&of_after),
        });
    }
    let [before, after] = far.map(|off| root_mean_square(&off));
    (Distance { before, after }, all)
}

fn root_mean_square(differences: &[f64]) -> f64 {
    let loss = |z: f64| {
        let a = z.abs();
        if a < LINEAR_FROM { z * z } else { LINEAR_FROM * (2.0 * a - LINEAR_FROM) }
    };
    mean(&differences.iter().filter(|z| z.is_finite()).map(|z| loss(*z)).collect::<Vec<f64>>()).sqrt()
}
