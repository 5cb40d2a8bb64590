//! A classifier two-sample test: can a random forest distinguish the two sides?

use std::collections::BTreeSet;

use portable_numerics::random::{below, shuffle};
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::control::{Control, Phase};
use crate::describe::describe;
use crate::error::Error;
use crate::forest::{Forest, Rows};
use crate::number::single;
use crate::statistics::{auc, deviation, mean, median, of_sorted, sorted, weighted_auc};
use crate::table::{Feature, FeatureKind, FeatureTable};

/// Parameters of the classifier test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TwoSampleParams {
    /// Cross-validation folds of the fields of each side, 2 to 20. Default 5; at most the number of fields.
    pub folds: usize,
    /// Trees of a forest, 20 to 10000. Default 200.
    pub trees: usize,
    /// Random splits of the real fields into halves, 1 to 1000. Default 10.
    pub half_splits: usize,
    /// Bootstrap draws of fields, 10 to 100000. Default 1000.
    pub bootstrap: usize,
    /// Features with a permutation importance, 0 to 1000. Default 40: those that the forests used most.
    pub permuted: usize,
}

impl Default for TwoSampleParams {
    fn default() -> Self {
        Self { folds: 5, trees: 200, half_splits: 10, bootstrap: 1000, permuted: 40 }
    }
}

/// Result of the classifier test, on fields that the classifier was not trained on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TwoSample {
    /// Rows of the real and of the synthetic side.
    pub rows: [usize; 2],
    /// Fields with rows, of the real and of the synthetic side.
    pub fields: [usize; 2],
    /// Area under the ROC curve: ½ at chance level, 1 if the classifier makes no error.
    pub auc: f64,
    /// Its 95 % interval, from bootstrap draws of fields.
    pub interval: [f64; 2],
    /// The AUC in words.
    pub meaning: String,
    /// AUC between random halves of the real fields.
    pub null: Vec<f64>,
    /// Median number of rows of a half.
    pub null_rows: usize,
    /// AUC with the features of one kind only, in descending order.
    pub kinds: Vec<KindAuc>,
    /// All features, by descending importance.
    pub distinguishing_features: Vec<DistinguishingFeature>,
    /// Score of each row of the real and of the synthetic side: 0 looks real, 1 looks synthetic.
    #[serde(skip)]
    pub scores: [Vec<f64>; 2],
}

impl TwoSample {
    /// Returns the median AUC between random halves of the real fields; none if there are too few fields to split.
    #[must_use]
    pub fn null_median(&self) -> Option<f64> {
        let known = sorted(self.null.iter().copied().filter(|v| v.is_finite()));
        (!known.is_empty()).then(|| of_sorted(&known, 0.5))
    }
}

/// AUC of a classifier with the features of one kind only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KindAuc {
    /// Kind of the features.
    pub kind: FeatureKind,
    /// Area under the ROC curve.
    pub auc: f64,
}

/// A feature and its difference between the sides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DistinguishingFeature {
    /// Stable identifier.
    pub feature: String,
    /// The feature in words, with its unit.
    pub description: String,
    /// Kind of the feature.
    pub kind: FeatureKind,
    /// Permutation importance as a fraction of that of all features, 0 to 1. All importances are 0 if the mean score of
    /// the synthetic side does not exceed that of the real side.
    pub importance: f64,
    /// AUC of this feature without the others: above ½ if it is larger on the synthetic side.
    pub single_auc: f64,
    /// 10th, 50th and 90th percentile of the real rows.
    pub real: [f64; 3],
    /// 10th, 50th and 90th percentile of the synthetic rows.
    pub synthetic: [f64; 3],
    /// Standard deviation of the medians of the fields, of the real and of the synthetic side.
    pub between_fields: [f64; 2],
}

/// With fewer fields on a side the AUC is uncertain, and can be below chance level.
const FEW_FIELDS: usize = 8;

/// Returns an AUC in words.
fn meaning(auc: f64, [low, high]: [f64; 2], [real, synthetic]: [usize; 2]) -> String {
    let mut text = if high < 0.5 {
        "below chance level (0.5): differences between the training fields do not recur in the other fields".to_owned()
    } else if low <= 0.5 {
        "not better than chance (0.5)".to_owned()
    } else {
        format!("in {:.0} % of pairs the synthetic one looks more synthetic than the real one", 100.0 * auc)
    };
    if real.min(synthetic) < FEW_FIELDS {
        text.push_str(&format!("; uncertain, because there are few fields ({real} real, {synthetic} synthetic)"));
    }
    text
}

/// Rows of both sides, each with its field.
struct Sample<'a> {
    features: &'a [Feature],
    rows: Rows,
    /// Field of each row; synthetic fields follow the real ones.
    fields: Vec<usize>,
    sides: Vec<bool>,
}

impl<'a> Sample<'a> {
    /// Joins tables. Unknown values become the median of the known ones.
    fn new(tables: &[(&'a FeatureTable, bool)]) -> Option<Self> {
        let features = tables.iter().find(|(t, _)| !t.is_empty()).map(|(t, _)| &t.features)?;
        let mut columns = vec![Vec::new(); features.len()];
        let (mut synthetic, mut fields) = (Vec::new(), Vec::new());
        for (field, (table, side)) in tables.iter().enumerate() {
            for row in 0..table.len() {
                for (column, value) in columns.iter_mut().zip(table.row(row)) {
                    column.push(*value);
                }
                synthetic.push(*side);
                fields.push(field);
            }
        }
        for column in &mut columns {
            let mut known: Vec<f64> = column.iter().filter(|v| v.is_finite()).map(|v| f64::from(*v)).collect();
            let middle = single(median(&mut known));
            column.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = middle);
        }
        let sides = tables.iter().map(|t| t.1).collect();
        Some(Self { features, rows: Rows { columns, synthetic }, fields, sides })
    }

    /// Returns the fields with rows, of the real and of the synthetic side.
    fn with_rows(&self) -> [Vec<usize>; 2] {
        let of = |side| (0..self.sides.len()).filter(|f| self.sides[*f] == side && self.fields.contains(f)).collect();
        [false, true].map(of)
    }

    /// Returns the number of folds: at most one for each field of the smaller side, and at least 2; none if that is
    /// impossible.
    fn fold_count(&self, folds: usize) -> Option<usize> {
        let folds = self.with_rows().iter().map(Vec::len).fold(folds, usize::min);
        (folds >= 2).then_some(folds)
    }

    /// Assigns the fields of each side to folds at random. Fields without rows are in fold 0.
    fn folds(&self, count: usize, seed: u64) -> Vec<usize> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut folds = vec![0; self.sides.len()];
        for mut fields in self.with_rows() {
            shuffle(&mut fields, &mut rng);
            for (i, field) in fields.into_iter().enumerate() {
                folds[field] = i % count;
            }
        }
        folds
    }
}

/// A forest and the rows that it was not trained on.
type Fold = (Forest, Vec<usize>);

/// The forests of all folds, and the score of each row by the forest that was not trained on it.
type CrossValidation = (Vec<Fold>, Vec<f64>);

fn cross_validate(
    sample: &Sample,
    folds: usize,
    trees: usize,
    seed: u64,
    phase: &Phase,
) -> Result<Option<CrossValidation>, Error> {
    let Some(folds) = sample.fold_count(folds) else { return Ok(None) };
    let of = sample.folds(folds, seed);
    let grow = |fold: usize| -> Result<Option<Fold>, Error> {
        let (unseen, seen): (Vec<usize>, Vec<usize>) =
            (0..sample.rows.len()).partition(|row| of[sample.fields[*row]] == fold);
        // The seeds of trees follow that of their forest, so the seeds of forests are far apart.
        let forest = Forest::grow(&sample.rows.only(&seen), trees, seed ^ ((fold as u64 + 1) << 48), phase)?;
        phase.step()?;
        Ok(forest.map(|forest| (forest, unseen)))
    };
    let grown: Vec<Option<Fold>> = (0..folds).into_par_iter().map(grow).collect::<Result<_, _>>()?;
    let Some(grown) = grown.into_iter().collect::<Option<Vec<Fold>>>() else { return Ok(None) };
    let scores = scores(&sample.rows, &grown, phase, |_| ())?;
    Ok(Some((grown, scores)))
}

/// Returns the score of each row by the forest that was not trained on it, after a change to the rows.
fn scores(rows: &Rows, folds: &[Fold], phase: &Phase, mut change: impl FnMut(&mut Rows)) -> Result<Vec<f64>, Error> {
    let mut scores = vec![0.0; rows.len()];
    for (forest, unseen) in folds {
        let mut part = rows.only(unseen);
        change(&mut part);
        for (row, score) in unseen.iter().zip(forest.scores(&part, phase)?) {
            scores[*row] = score;
        }
    }
    Ok(scores)
}

fn area(sample: &Sample, scores: &[f64]) -> f64 {
    let [real, synthetic] = sample.rows.by_side(scores.iter().copied());
    auc(&real, &synthetic)
}

/// Tests whether a classifier can distinguish the rows of two sets of fields; none if a side has fewer than two fields
/// with rows. `name` is the name of the phase in progress reports.
///
/// # Errors
/// [`Error::Stopped`] if the stop flag of `control` is set.
pub fn two_sample(
    real: &[FeatureTable],
    synthetic: &[FeatureTable],
    params: &TwoSampleParams,
    seed: u64,
    name: &str,
    control: &Control,
) -> Result<Option<TwoSample>, Error> {
    let tables: Vec<(&FeatureTable, bool)> =
        real.iter().map(|t| (t, false)).chain(synthetic.iter().map(|t| (t, true))).collect();
    let Some(sample) = Sample::new(&tables) else { return Ok(None) };
    let Some(folds) = sample.fold_count(params.folds) else { return Ok(None) };
    let kinds: BTreeSet<FeatureKind> = sample.features.iter().map(|f| f.kind).collect();
    let half = sample.with_rows()[0].len() / 2;
    let of_halves = if half < 2 { 0 } else { params.half_splits * params.folds.min(half) };
    let steps = folds * (1 + kinds.len()) + of_halves + params.permuted.min(sample.rows.columns.len());
    let phase = &control.phase(name, steps);
    let Some(all) = cross_validate(&sample, params.folds, params.trees, seed, phase)? else { return Ok(None) };
    let halves: Vec<(f64, usize)> = (0..params.half_splits as u64)
        .into_par_iter()
        .map(|i| between_halves(real, params, seed.wrapping_add(i + 1), phase))
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .flatten()
        .collect();
    let mut null_rows: Vec<f64> = halves.iter().map(|h| h.1 as f64).collect();
    let scores = sample.rows.by_side(all.1.iter().copied());
    let auc = auc(&scores[0], &scores[1]);
    let interval = interval(&sample, &all.1, params.bootstrap, seed, phase)?;
    let fields = sample.with_rows().map(|fields| fields.len());
    Ok(Some(TwoSample {
        rows: scores.each_ref().map(Vec::len),
        fields,
        auc,
        interval,
        meaning: meaning(auc, interval, fields),
        null: halves.iter().map(|h| h.0).collect(),
        null_rows: crate::number::nearest(median(&mut null_rows)),
        kinds: auc_by_kind(&sample, kinds, params, seed, phase)?,
        distinguishing_features: distinguishing_features(&sample, &all, params, seed, phase)?,
        scores,
    }))
}

/// Returns the AUC between two random halves of the real fields, and the rows of one half.
fn between_halves(
    real: &[FeatureTable],
    params: &TwoSampleParams,
    seed: u64,
    phase: &Phase,
) -> Result<Option<(f64, usize)>, Error> {
    let mut fields: Vec<&FeatureTable> = real.iter().filter(|t| !t.is_empty()).collect();
    shuffle(&mut fields, &mut Xoshiro256PlusPlus::seed_from_u64(seed));
    let half = fields.len() / 2;
    let tables: Vec<(&FeatureTable, bool)> = fields.iter().enumerate().map(|(i, t)| (*t, i < half)).collect();
    let Some(sample) = Sample::new(&tables) else { return Ok(None) };
    let all = cross_validate(&sample, params.folds, params.trees, seed, phase)?;
    Ok(all.map(|(_, scores)| (area(&sample, &scores), sample.rows.synthetic.iter().filter(|s| **s).count())))
}

/// Returns the 95 % interval of the AUC, from draws of the fields of each side with replacement.
fn interval(sample: &Sample, scores: &[f64], draws: usize, seed: u64, phase: &Phase) -> Result<[f64; 2], Error> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x_b007);
    let sides = sample.with_rows();
    let mut all: Vec<(f64, bool, usize)> =
        scores.iter().zip(&sample.rows.synthetic).zip(&sample.fields).map(|((s, side), f)| (*s, *side, *f)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let draw = |_| {
        phase.check()?;
        let mut weights = vec![0.0; sample.sides.len()];
        for fields in &sides {
            for _ in fields {
                weights[fields[below(fields.len(), &mut rng)]] += 1.0;
            }
        }
        let mut weighted: Vec<(f64, bool, f64)> =
            all.iter().map(|(s, side, f)| (*s, *side, weights[*f])).filter(|s| s.2 > 0.0).collect();
        Ok(weighted_auc(&mut weighted))
    };
    let areas = sorted((0..draws).map(draw).collect::<Result<Vec<f64>, Error>>()?);
    Ok([0.025, 0.975].map(|q| of_sorted(&areas, q)))
}

/// Repeats the test with the features of each kind only.
fn auc_by_kind(
    sample: &Sample,
    kinds: BTreeSet<FeatureKind>,
    params: &TwoSampleParams,
    seed: u64,
    phase: &Phase,
) -> Result<Vec<KindAuc>, Error> {
    let only = |kind: FeatureKind| {
        let own = sample.rows.columns.iter().zip(sample.features).filter(|(_, f)| f.kind == kind);
        let rows = Rows { columns: own.map(|(c, _)| c.clone()).collect(), synthetic: sample.rows.synthetic.clone() };
        let part = Sample { rows, fields: sample.fields.clone(), sides: sample.sides.clone(), ..*sample };
        let all = cross_validate(&part, params.folds, params.trees, seed, phase)?;
        Ok(all.map(|(_, scores)| KindAuc { kind, auc: area(&part, &scores) }))
    };
    let kinds: Vec<FeatureKind> = kinds.into_iter().collect();
    let areas: Vec<Option<KindAuc>> = kinds.into_par_iter().map(only).collect::<Result<_, Error>>()?;
    let mut areas: Vec<KindAuc> = areas.into_iter().flatten().collect();
    areas.sort_by(|a, b| b.auc.total_cmp(&a.auc));
    Ok(areas)
}

/// Returns the mean score of the synthetic rows less that of the real rows.
fn separation(rows: &Rows, scores: &[f64]) -> f64 {
    let [real, synthetic] = rows.by_side(scores.iter().copied());
    mean(&synthetic) - mean(&real)
}

fn distinguishing_features(
    sample: &Sample,
    (folds, unchanged): &CrossValidation,
    params: &TwoSampleParams,
    seed: u64,
    phase: &Phase,
) -> Result<Vec<DistinguishingFeature>, Error> {
    let rows = &sample.rows;
    let mut used = vec![0.0; rows.columns.len()];
    for (forest, _) in folds {
        used.iter_mut().zip(forest.use_of_columns()).for_each(|(sum, part)| *sum += part / folds.len() as f64);
    }
    let mut order: Vec<usize> = (0..used.len()).collect();
    order.sort_by(|a, b| used[*b].total_cmp(&used[*a]).then(a.cmp(b)));
    let separated = separation(rows, unchanged);
    let loss = |(i, column): (usize, &usize)| {
        if i >= params.permuted {
            return Ok(0.0);
        }
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed ^ ((*column as u64 + 1) << 20));
        let scores = scores(rows, folds, phase, |part| shuffle(&mut part.columns[*column], &mut rng))?;
        phase.step()?;
        // Without a separation, differences are noise.
        Ok(if separated > 0.0 { (separated - separation(rows, &scores)).max(0.0) } else { 0.0 })
    };
    let losses: Vec<f64> = order.par_iter().enumerate().map(loss).collect::<Result<_, Error>>()?;
    let total = losses.iter().sum::<f64>();
    let fields = sample.with_rows();
    let feature = |(&column, loss): (&usize, f64)| {
        let values = || rows.columns[column].iter().map(|v| f64::from(*v));
        let sides = rows.by_side(values()).map(sorted);
        let [real, synthetic] = sides.each_ref().map(|values| [0.1, 0.5, 0.9].map(|q| of_sorted(values, q)));
        let mut of_fields = vec![Vec::new(); sample.sides.len()];
        values().zip(&sample.fields).for_each(|(value, field)| of_fields[*field].push(value));
        let mut between =
            |fields: &Vec<usize>| deviation(&fields.iter().map(|f| median(&mut of_fields[*f])).collect::<Vec<_>>());
        let Feature { name, kind } = &sample.features[column];
        DistinguishingFeature {
            feature: name.clone(),
            description: describe(name),
            kind: *kind,
            importance: if total > 0.0 { loss / total } else { 0.0 },
            single_auc: auc(&sides[0], &sides[1]),
            real,
            synthetic,
            between_fields: [between(&fields[0]), between(&fields[1])],
        }
    };
    let mut list: Vec<DistinguishingFeature> = order.iter().zip(losses).map(feature).collect();
    list.sort_by(|a, b| {
        b.importance.total_cmp(&a.importance).then((b.single_auc - 0.5).abs().total_cmp(&(a.single_auc - 0.5).abs()))
    });
    Ok(list)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Row;

    const COLUMNS: usize = 8;

    /// Fields with random features: the fourth is shifted, and every ninth value is unknown.
    fn tables(shift: f64, seed: u64) -> Vec<FeatureTable> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut uniform = move || below(1 << 30, &mut rng) as f64 / f64::from(1 << 30);
        let mut field = |_| {
            let own = 0.2 * uniform();
            let row = |i: usize| {
                let mut row = Row::default();
                for c in 0..COLUMNS {
                    let value = uniform() + own + if c == 3 { shift } else { 0.0 };
                    row.put(
                        FeatureKind::Texture,
                        format!("column {c}"),
                        if (i + c).is_multiple_of(9) { f64::NAN } else { value },
                    );
                }
                (row, [0.0; 2])
            };
            (0..20).map(row).collect()
        };
        (0..10).map(&mut field).collect()
    }

    fn params() -> TwoSampleParams {
        TwoSampleParams { trees: 60, half_splits: 4, bootstrap: 200, permuted: COLUMNS, ..TwoSampleParams::default() }
    }

    fn test(real: &[FeatureTable], synthetic: &[FeatureTable], seed: u64) -> Option<TwoSample> {
        two_sample(real, synthetic, &params(), seed, "", &Control::NONE).unwrap()
    }

    #[test]
    fn the_shifted_feature_is_the_most_important() {
        let result = test(&tables(0.0, 1), &tables(0.6, 2), 5).unwrap();
        assert!(result.auc > 0.85 && result.interval[0] > 0.75, "{} {:?}", result.auc, result.interval);
        assert_eq!((result.rows, result.fields, result.null.len()), ([200, 200], [10, 10], 4));
        assert!(result.null.iter().all(|auc| (0.25..0.75).contains(auc)), "{:?}", result.null);
        let first = &result.distinguishing_features[0];
        assert_eq!(first.feature, "column 3");
        assert!(
            first.importance > 0.5 && first.single_auc > 0.8 && first.synthetic[1] > first.real[1] + 0.3,
            "{first:?}"
        );
        assert!(result.distinguishing_features[1].importance < 0.1);
        // Standard deviation of the field offset, 0.2/√12, and standard error of a median of 20 rows.
        assert!(first.between_fields.iter().all(|sd| (0.03..0.2).contains(sd)), "{first:?}");
        assert_eq!(result.kinds.len(), 1);
        assert!((result.kinds[0].auc - result.auc).abs() < 1e-12);
    }

    #[test]
    fn a_field_is_never_in_training_and_test_data() {
        let real: Vec<FeatureTable> = tables(0.0, 1);
        let all: Vec<(&FeatureTable, bool)> = real.iter().enumerate().map(|(i, t)| (t, i >= 5)).collect();
        let sample = Sample::new(&all).unwrap();
        let of = sample.folds(3, 1);
        for side in [0..5, 5..10] {
            let mut counts = [0; 3];
            side.for_each(|f| counts[of[f]] += 1);
            assert!(counts.iter().all(|c| (1..=2).contains(c)), "{counts:?}");
        }
        let (folds, _) = cross_validate(&sample, 3, 20, 1, &Control::NONE.phase("", 3)).unwrap().unwrap();
        for (fold, (_, unseen)) in folds.iter().enumerate() {
            assert!(unseen.iter().all(|row| of[sample.fields[*row]] == fold));
        }
        assert_eq!(folds.iter().map(|f| f.1.len()).sum::<usize>(), 200);
    }

    #[test]
    fn fields_without_rows_are_ignored() {
        let mut real = tables(0.0, 1);
        real.truncate(2);
        real.push(FeatureTable::default());
        let result = test(&real, &tables(0.0, 2), 1).unwrap();
        assert_eq!((result.fields, result.null.len()), ([2, 10], 0));
        real.remove(0);
        assert!(test(&real, &tables(0.0, 2), 1).is_none());
        assert!(test(&[], &[], 1).is_none());
    }

    #[test]
    fn importances_are_fractions_even_if_the_sides_cannot_be_separated() {
        for seed in 0..4 {
            let tables = tables(0.0, seed);
            let result = test(&tables, &tables, seed).unwrap();
            let sum = result.distinguishing_features.iter().map(|f| f.importance).sum::<f64>();
            assert!(sum == 0.0 || (sum - 1.0).abs() < 1e-9, "{sum}");
            assert!(result.distinguishing_features.iter().all(|f| (0.0..=1.0).contains(&f.importance)));
            assert!(result.auc < 0.5 && result.meaning.contains("chance"), "{} {}", result.auc, result.meaning);
        }
    }

    #[test]
    fn an_auc_is_put_in_words() {
        assert!(meaning(0.83, [0.7, 0.9], [24, 20]).starts_with("in 83 % of pairs"));
        assert_eq!(meaning(0.45, [0.3, 0.6], [24, 20]), "not better than chance (0.5)");
        assert!(meaning(0.2, [0.1, 0.4], [24, 20]).starts_with("below chance level"));
        assert!(meaning(0.6, [0.4, 0.9], [3, 20]).ends_with("few fields (3 real, 20 synthetic)"));
    }

    #[test]
    fn the_stop_flag_ends_the_test_and_each_step_is_reported_once() {
        use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
        let (real, synthetic) = (tables(0.0, 1), tables(0.0, 2));
        let (stop, steps) = (AtomicBool::new(false), AtomicUsize::new(0));
        let count = |p: crate::Progress| {
            assert_eq!(p.phase, "classifying");
            assert!(p.done <= p.total);
            steps.fetch_add(1, Ordering::Relaxed);
            assert_eq!(p.total, 5 + 5 + 4 * 5 + COLUMNS);
        };
        let control = Control { stop: &stop, report: &count };
        two_sample(&real, &synthetic, &params(), 1, "classifying", &control).unwrap().unwrap();
        assert_eq!(steps.load(Ordering::Relaxed), 5 + 5 + 4 * 5 + COLUMNS);
        let control = Control { stop: &stop, report: &|_| stop.store(true, Ordering::Relaxed) };
        assert_eq!(two_sample(&real, &synthetic, &params(), 1, "classifying", &control), Err(Error::Stopped));
    }
}
