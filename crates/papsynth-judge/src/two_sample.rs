//! Can a classifier tell the sides apart?

use std::collections::BTreeSet;

use portable_numerics::random::{below, shuffle};
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use smartcore::ensemble::random_forest_regressor::{RandomForestRegressor, RandomForestRegressorParameters};
use smartcore::linalg::basic::matrix::DenseMatrix;

use crate::number::{single, whole};
use crate::statistics::{auc, deviation, mean, median, of_sorted, sorted, weighted_auc};
use crate::table::{Family, Feature, Table};

/// How the classifier is tried.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TwoSampleParams {
    /// Parts that the fields of each side are dealt into, 2 to 20. Default 5; never more than there are fields.
    pub folds: usize,
    /// Trees of a forest, 20 to 10000. Default 200.
    pub trees: usize,
    /// Random halvings of the real fields, 1 to 1000. Default 10.
    pub halvings: usize,
    /// Draws of fields with replacement, 10 to 100000. Default 1000.
    pub bootstrap: usize,
    /// Features whose shuffling is tried, 0 to 1000. Default 40, those that the forests used most.
    pub shuffled: usize,
}

impl Default for TwoSampleParams {
    fn default() -> Self {
        Self { folds: 5, trees: 200, halvings: 10, bootstrap: 1000, shuffled: 40 }
    }
}

/// How well a classifier told the sides apart, on fields that it had not seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TwoSample {
    /// Rows of the real side and of the synthetic one.
    pub rows: [usize; 2],
    /// Fields with rows, of either side.
    pub fields: [usize; 2],
    /// Area under the ROC curve: ½ if the sides are alike, 1 if no row is ever mistaken.
    pub auc: f64,
    /// Its 95 % interval, by drawing fields with replacement.
    pub interval: [f64; 2],
    /// The same between random halves of the real fields.
    pub null: Vec<f64>,
    /// Rows of a half, at the median.
    pub null_rows: usize,
    /// The AUC with the features of one family alone, the most telling first: what would be left if all others were right.
    pub families: Vec<FamilyAlone>,
    /// What gives the synthetic side away, most telling first.
    pub giveaways: Vec<Giveaway>,
    /// How synthetic each row looked, real rows first, 0 to 1.
    #[serde(skip)]
    pub scores: [Vec<f64>; 2],
}

impl TwoSample {
    /// Median AUC between random halves of the real fields; none if there were too few fields to halve.
    #[must_use]
    pub fn null_median(&self) -> Option<f64> {
        let known = sorted(self.null.iter().copied().filter(|v| v.is_finite()));
        (!known.is_empty()).then(|| of_sorted(&known, 0.5))
    }
}

/// What the features of one family can tell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FamilyAlone {
    /// The family.
    pub family: Family,
    /// The AUC with its features alone.
    pub auc: f64,
}

/// A feature, and how it differs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Giveaway {
    /// The feature.
    pub feature: String,
    /// What it tells of.
    pub family: Family,
    /// How much nearer the sides' mean scores come when the feature is shuffled among unseen rows; a part of their distance.
    pub importance: f64,
    /// The AUC of this feature alone: above ½ if it is larger on the synthetic side.
    pub alone: f64,
    /// 10th, 50th and 90th percentile of the real rows.
    pub real: [f64; 3],
    /// And of the synthetic ones.
    pub synthetic: [f64; 3],
    /// Standard deviation of the fields' medians, of the real side and of the synthetic one: how much fields differ from each other.
    pub between_fields: [f64; 2],
}

/// Rows of both sides, each with its field.
struct Sample<'a> {
    features: &'a [Feature],
    rows: Rows,
    /// Field of each row, those of the synthetic side after those of the real one.
    fields: Vec<usize>,
    sides: Vec<bool>,
}

impl<'a> Sample<'a> {
    /// Unknown values become the median of all that are known.
    fn new(tables: &[(&'a Table, bool)]) -> Option<Self> {
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

    /// Fields with rows, of either side.
    fn with_rows(&self) -> [Vec<usize>; 2] {
        let of = |side| (0..self.sides.len()).filter(|f| self.sides[*f] == side && self.fields.contains(f)).collect();
        [false, true].map(of)
    }

    /// Deals fields of each side into folds; those without rows too, which does no harm.
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

/// A forest and the rows that it has not seen.
type Fold = (Forest, Vec<usize>);

/// Forests of all folds, and how synthetic each row looks to the one that has not seen it.
type Round = (Vec<Fold>, Vec<f64>);

fn round(sample: &Sample, folds: usize, trees: usize, seed: u64) -> Option<Round> {
    let folds = sample.with_rows().iter().map(Vec::len).fold(folds, usize::min);
    if folds < 2 {
        return None;
    }
    let of = sample.folds(folds, seed);
    let grow = |fold: usize| {
        let (unseen, seen): (Vec<usize>, Vec<usize>) =
            (0..sample.rows.len()).partition(|row| of[sample.fields[*row]] == fold);
        // Fields may be scarce, so that a fold lacks a side; seeds of forests are far apart.
        let forest = Forest::grow(&sample.rows.only(&seen), trees, seed ^ ((fold as u64 + 1) << 48))?;
        Some((forest, unseen))
    };
    let grown: Vec<Fold> = (0..folds).into_par_iter().map(grow).collect::<Option<_>>()?;
    let scores = scores(&sample.rows, &grown, |_| ());
    Some((grown, scores))
}

/// How synthetic each row looks to the forest that has not seen it, after a change to the rows.
fn scores(rows: &Rows, folds: &[Fold], mut change: impl FnMut(&mut Rows)) -> Vec<f64> {
    let mut scores = vec![0.0; rows.len()];
    for (forest, unseen) in folds {
        let mut part = rows.only(unseen);
        change(&mut part);
        for (row, score) in unseen.iter().zip(forest.scores(&part)) {
            scores[*row] = score;
        }
    }
    scores
}

fn area(sample: &Sample, scores: &[f64]) -> f64 {
    let [real, synthetic] = sample.rows.by_side(scores.iter().copied());
    auc(&real, &synthetic)
}

/// Tries to tell two sets of fields apart by their tables; none if a side has fewer than two fields with rows.
pub fn two_sample(real: &[Table], synthetic: &[Table], params: &TwoSampleParams, seed: u64) -> Option<TwoSample> {
    let tables: Vec<(&Table, bool)> =
        real.iter().map(|t| (t, false)).chain(synthetic.iter().map(|t| (t, true))).collect();
    let sample = Sample::new(&tables)?;
    let round = round(&sample, params.folds, params.trees, seed)?;
    let halves: Vec<(f64, usize)> = (0..params.halvings as u64)
        .into_par_iter()
        .filter_map(|i| halving(real, params, seed.wrapping_add(i + 1)))
        .collect();
    let mut null_rows: Vec<f64> = halves.iter().map(|h| h.1 as f64).collect();
    let scores = sample.rows.by_side(round.1.iter().copied());
    Some(TwoSample {
        rows: scores.each_ref().map(Vec::len),
        fields: sample.with_rows().map(|fields| fields.len()),
        auc: auc(&scores[0], &scores[1]),
        interval: interval(&sample, &round.1, params.bootstrap, seed),
        null: halves.iter().map(|h| h.0).collect(),
        null_rows: crate::number::nearest(median(&mut null_rows)),
        families: families(&sample, params, seed),
        giveaways: giveaways(&sample, &round, params, seed),
        scores,
    })
}

/// The same test between two random halves of the real fields, and the rows of one.
fn halving(real: &[Table], params: &TwoSampleParams, seed: u64) -> Option<(f64, usize)> {
    let mut fields: Vec<&Table> = real.iter().filter(|t| !t.is_empty()).collect();
    shuffle(&mut fields, &mut Xoshiro256PlusPlus::seed_from_u64(seed));
    let half = fields.len() / 2;
    let tables: Vec<(&Table, bool)> = fields.iter().enumerate().map(|(i, t)| (*t, i < half)).collect();
    let sample = Sample::new(&tables)?;
    let (_, scores) = round(&sample, params.folds, params.trees, seed)?;
    Some((area(&sample, &scores), sample.rows.synthetic.iter().filter(|s| **s).count()))
}

/// The 95 % interval of the AUC, by drawing fields of each side with replacement.
fn interval(sample: &Sample, scores: &[f64], draws: usize, seed: u64) -> [f64; 2] {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x_b007);
    let sides = sample.with_rows();
    let mut all: Vec<(f64, bool, usize)> =
        scores.iter().zip(&sample.rows.synthetic).zip(&sample.fields).map(|((s, side), f)| (*s, *side, *f)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let areas = sorted((0..draws).map(|_| {
        let mut weights = vec![0.0; sample.sides.len()];
        for fields in &sides {
            for _ in fields {
                weights[fields[below(fields.len(), &mut rng)]] += 1.0;
            }
        }
        let mut weighted: Vec<(f64, bool, f64)> =
            all.iter().map(|(s, side, f)| (*s, *side, weights[*f])).filter(|s| s.2 > 0.0).collect();
        weighted_auc(&mut weighted)
    }));
    [0.025, 0.975].map(|q| of_sorted(&areas, q))
}

/// The test with the features of each family alone.
fn families(sample: &Sample, params: &TwoSampleParams, seed: u64) -> Vec<FamilyAlone> {
    let names: BTreeSet<Family> = sample.features.iter().map(|f| f.family).collect();
    let alone = |family: Family| {
        let own = sample.rows.columns.iter().zip(sample.features).filter(|(_, f)| f.family == family);
        let rows = Rows { columns: own.map(|(c, _)| c.clone()).collect(), synthetic: sample.rows.synthetic.clone() };
        let part = Sample { rows, fields: sample.fields.clone(), sides: sample.sides.clone(), ..*sample };
        round(&part, params.folds, params.trees, seed)
            .map(|(_, scores)| FamilyAlone { family, auc: area(&part, &scores) })
    };
    let mut areas: Vec<FamilyAlone> = names.into_par_iter().filter_map(alone).collect();
    areas.sort_by(|a, b| b.auc.total_cmp(&a.auc));
    areas
}

/// How far the sides' mean scores lie apart.
fn separation(rows: &Rows, scores: &[f64]) -> f64 {
    let [real, synthetic] = rows.by_side(scores.iter().copied());
    mean(&synthetic) - mean(&real)
}

fn giveaways(sample: &Sample, (folds, unchanged): &Round, params: &TwoSampleParams, seed: u64) -> Vec<Giveaway> {
    let rows = &sample.rows;
    let mut used = vec![0.0; rows.columns.len()];
    for (forest, _) in folds {
        used.iter_mut().zip(forest.use_of_columns()).for_each(|(sum, part)| *sum += part / folds.len() as f64);
    }
    let mut order: Vec<usize> = (0..used.len()).collect();
    order.sort_by(|a, b| used[*b].total_cmp(&used[*a]).then(a.cmp(b)));
    let whole = separation(rows, unchanged).max(1e-6);
    let shuffled = |column: usize| {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed ^ ((column as u64 + 1) << 20));
        let scores = scores(rows, folds, |part| shuffle(&mut part.columns[column], &mut rng));
        1.0 - separation(rows, &scores) / whole
    };
    let importances: Vec<f64> =
        order.par_iter().enumerate().map(|(i, c)| if i < params.shuffled { shuffled(*c) } else { 0.0 }).collect();
    let fields = sample.with_rows();
    let giveaway = |(&column, importance): (&usize, f64)| {
        let values = || rows.columns[column].iter().map(|v| f64::from(*v));
        let sides = rows.by_side(values()).map(sorted);
        let [real, synthetic] = sides.each_ref().map(|values| [0.1, 0.5, 0.9].map(|q| of_sorted(values, q)));
        let mut of_fields = vec![Vec::new(); sample.sides.len()];
        values().zip(&sample.fields).for_each(|(value, field)| of_fields[*field].push(value));
        let mut between =
            |fields: &Vec<usize>| deviation(&fields.iter().map(|f| median(&mut of_fields[*f])).collect::<Vec<_>>());
        let Feature { name, family } = &sample.features[column];
        Giveaway {
            feature: name.clone(),
            family: *family,
            importance,
            alone: auc(&sides[0], &sides[1]),
            real,
            synthetic,
            between_fields: [between(&fields[0]), between(&fields[1])],
        }
    };
    let mut list: Vec<Giveaway> = order.iter().zip(importances).map(giveaway).collect();
    list.sort_by(|a, b| {
        b.importance.total_cmp(&a.importance).then((b.alone - 0.5).abs().total_cmp(&(a.alone - 0.5).abs()))
    });
    list
}

type Block = RandomForestRegressor<f32, f32, DenseMatrix<f32>, Vec<f32>>;

/// Trees that are grown by one thread.
const BLOCK: usize = 20;

/// Seeds of blocks are so far apart: the library gives its trees the seeds that follow.
const APART: u64 = 1 << 32;

/// Fewest rows in a leaf.
const LEAF: usize = 3;

/// Rows of numbers, column by column, and the side of each row.
#[derive(Debug, Clone)]
struct Rows {
    columns: Vec<Vec<f32>>,
    synthetic: Vec<bool>,
}

impl Rows {
    /// The rows with these indices.
    fn only(&self, rows: &[usize]) -> Self {
        Self {
            columns: self.columns.iter().map(|c| rows.iter().map(|r| c[*r]).collect()).collect(),
            synthetic: rows.iter().map(|r| self.synthetic[*r]).collect(),
        }
    }

    /// Numbers of the rows, by their side: real, synthetic.
    fn by_side(&self, numbers: impl IntoIterator<Item = f64>) -> [Vec<f64>; 2] {
        let mut sides = [Vec::new(), Vec::new()];
        numbers.into_iter().zip(&self.synthetic).for_each(|(v, synthetic)| sides[usize::from(*synthetic)].push(v));
        sides
    }

    fn len(&self) -> usize {
        self.synthetic.len()
    }

    fn matrix(&self) -> Option<DenseMatrix<f32>> {
        DenseMatrix::new(self.len(), self.columns.len(), self.columns.concat(), true).ok()
    }
}

/// Trees that tell the sides apart.
///
/// They regress on 0 and 1: the split that leaves the least variance is that of the least Gini impurity, and the mean of a
/// leaf is a share, where a classifier's trees would vote.
struct Forest(Vec<Block>);

impl Forest {
    /// The same forest for the same seed, whatever the threads; none if there are no rows or columns.
    fn grow(rows: &Rows, trees: usize, seed: u64) -> Option<Self> {
        let x = rows.matrix()?;
        let y: Vec<f32> = rows.synthetic.iter().map(|s| f32::from(u8::from(*s))).collect();
        let blocks = (0..trees.div_ceil(BLOCK)).into_par_iter().map(|block| {
            let parameters = RandomForestRegressorParameters::default()
                .with_n_trees(BLOCK.min(trees - block * BLOCK))
                .with_min_samples_leaf(LEAF)
                .with_m(mtry(rows.columns.len()))
                .with_seed(seed.wrapping_add(APART.wrapping_mul(block as u64)));
            RandomForestRegressor::fit(&x, &y, parameters).ok()
        });
        blocks.collect::<Option<Vec<_>>>().map(Self)
    }

    /// How synthetic each row looks, 0 to 1.
    fn scores(&self, rows: &Rows) -> Vec<f64> {
        let mut sums = vec![0.0; rows.len()];
        let Some(x) = rows.matrix() else { return sums };
        let blocks: Vec<Vec<f32>> = self.0.par_iter().map(|block| block.predict(&x).unwrap_or_default()).collect();
        for block in &blocks {
            for (sum, score) in sums.iter_mut().zip(block) {
                *sum += f64::from(*score);
            }
        }
        sums.iter().map(|s| s / self.0.len() as f64).collect()
    }

    /// How much each column served to tell the sides apart in growing, summing to 1.
    fn use_of_columns(&self) -> Vec<f64> {
        let blocks: Vec<Vec<f64>> = self.0.iter().filter_map(|b| b.compute_feature_importances().ok()).collect();
        let columns = blocks.first().map_or(0, Vec::len);
        (0..columns).map(|c| blocks.iter().map(|b| b[c]).sum::<f64>() / blocks.len() as f64).collect()
    }
}

/// Columns that a split chooses from: twice the square root of them all, as many are alike.
fn mtry(columns: usize) -> usize {
    whole(2.0 * (columns as f64).sqrt()).clamp(1, columns.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Row;

    const COLUMNS: usize = 8;

    /// Fields with rows of numbers, of which the fourth is shifted, and every ninth unknown.
    fn tables(shift: f64, seed: u64) -> Vec<Table> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut uniform = move || below(1 << 30, &mut rng) as f64 / f64::from(1 << 30);
        let mut field = |_| {
            let own = 0.2 * uniform();
            let thing = |i: usize| {
                let mut row = Row::default();
                for c in 0..COLUMNS {
                    let value = uniform() + own + if c == 3 { shift } else { 0.0 };
                    row.put(
                        Family::Texture,
                        format!("column {c}"),
                        if (i + c).is_multiple_of(9) { f64::NAN } else { value },
                    );
                }
                (row, [0.0; 2])
            };
            (0..20).map(thing).collect()
        };
        (0..10).map(&mut field).collect()
    }

    fn params() -> TwoSampleParams {
        TwoSampleParams { trees: 60, halvings: 4, bootstrap: 200, shuffled: COLUMNS, ..TwoSampleParams::default() }
    }

    #[test]
    fn what_differs_is_named_first() {
        let result = two_sample(&tables(0.0, 1), &tables(0.6, 2), &params(), 5).unwrap();
        assert!(result.auc > 0.85 && result.interval[0] > 0.75, "{} {:?}", result.auc, result.interval);
        assert_eq!((result.rows, result.fields, result.null.len()), ([200, 200], [10, 10], 4));
        assert!(result.null.iter().all(|auc| (0.25..0.75).contains(auc)), "{:?}", result.null);
        let first = &result.giveaways[0];
        assert_eq!(first.feature, "column 3");
        assert!(first.importance > 0.5 && first.alone > 0.8 && first.synthetic[1] > first.real[1] + 0.3, "{first:?}");
        assert!(result.giveaways[1].importance < 0.1);
        // Fields differ by 0.2 of a uniform number, whose deviation is 1/√12, and by the error of a median of 20.
        assert!(first.between_fields.iter().all(|sd| (0.03..0.2).contains(sd)), "{first:?}");
        assert_eq!(result.families.len(), 1);
        assert!((result.families[0].auc - result.auc).abs() < 1e-12);
    }

    #[test]
    fn a_field_is_never_learnt_from_and_tried() {
        let real: Vec<Table> = tables(0.0, 1);
        let all: Vec<(&Table, bool)> = real.iter().enumerate().map(|(i, t)| (t, i >= 5)).collect();
        let sample = Sample::new(&all).unwrap();
        let of = sample.folds(3, 1);
        for side in [0..5, 5..10] {
            let mut counts = [0; 3];
            side.for_each(|f| counts[of[f]] += 1);
            assert!(counts.iter().all(|c| (1..=2).contains(c)), "{counts:?}");
        }
        let (folds, _) = round(&sample, 3, 20, 1).unwrap();
        for (fold, (_, unseen)) in folds.iter().enumerate() {
            assert!(unseen.iter().all(|row| of[sample.fields[*row]] == fold));
        }
        assert_eq!(folds.iter().map(|f| f.1.len()).sum::<usize>(), 200);
    }

    #[test]
    fn fields_without_rows_do_not_count() {
        let mut real = tables(0.0, 1);
        real.truncate(2);
        real.push(Table::default());
        let result = two_sample(&real, &tables(0.0, 2), &params(), 1).unwrap();
        assert_eq!((result.fields, result.null.len()), ([2, 10], 0));
        real.remove(0);
        assert!(two_sample(&real, &tables(0.0, 2), &params(), 1).is_none());
        assert!(two_sample(&[], &[], &params(), 1).is_none());
    }
}
