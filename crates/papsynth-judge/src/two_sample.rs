//! Can a classifier tell the sides apart?

use std::collections::BTreeSet;

use portable_numerics::random::{below, shuffle};
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::forest::{Forest, Rows};
use crate::number::single;
use crate::statistics::{auc, deviation, mean, median, of_sorted, weighted_auc};
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
        crate::beside::Spread::of(self.null.iter().copied()).p50
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
    /// How much nearer the sides' mean scores come when the feature is shuffled among rows that the forest has not seen; parts of
    /// their distance.
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
struct Sample {
    rows: Rows,
    /// Field of each row, those of the synthetic side after those of the real one.
    fields: Vec<usize>,
    sides: Vec<bool>,
}

impl Sample {
    /// Unknown values become the median of all that are known.
    fn new(tables: &[(&Table, bool)]) -> Option<Self> {
        let first = tables.iter().map(|(t, _)| *t).find(|t| !t.is_empty())?;
        let width = first.features.len();
        let mut columns = vec![Vec::new(); width];
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
        Some(Self { rows: Rows { columns, synthetic }, fields, sides: tables.iter().map(|t| t.1).collect() })
    }

    /// Deals fields of each side into folds; those without rows too, which does no harm.
    fn folds(&self, count: usize, seed: u64) -> Vec<usize> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut folds = vec![0; self.sides.len()];
        for side in [false, true] {
            let mut fields: Vec<usize> =
                (0..self.sides.len()).filter(|f| self.sides[*f] == side && self.fields.contains(f)).collect();
            shuffle(&mut fields, &mut rng);
            for (i, field) in fields.into_iter().enumerate() {
                folds[field] = i % count;
            }
        }
        folds
    }

    /// Fields with rows, of either side.
    fn counts(&self) -> [usize; 2] {
        [false, true]
            .map(|side| (0..self.sides.len()).filter(|f| self.sides[*f] == side && self.fields.contains(f)).count())
    }
}

/// What a round over all folds gave.
struct Round {
    scores: Vec<f64>,
    /// How each column was used.
    used: Vec<f64>,
    /// Forests and the rows that they have not seen.
    folds: Vec<(Forest, Vec<usize>)>,
}

fn round(sample: &Sample, folds: usize, trees: usize, seed: u64) -> Option<Round> {
    let folds = folds.min(sample.counts()[0]).min(sample.counts()[1]);
    if folds < 2 {
        return None;
    }
    let of = sample.folds(folds, seed);
    let mut scores = vec![0.0; sample.rows.len()];
    let mut used = vec![0.0; sample.rows.columns.len()];
    let grown: Vec<Option<(Forest, Vec<usize>)>> = (0..folds)
        .into_par_iter()
        .map(|fold| {
            let (mut seen, mut unseen) = (Vec::new(), Vec::new());
            for row in 0..sample.rows.len() {
                if of[sample.fields[row]] == fold { unseen.push(row) } else { seen.push(row) }
            }
            // Fields may be scarce, so that a fold lacks a side; seeds of forests are far apart.
            let forest = Forest::grow(&sample.rows.only(&seen), trees, seed ^ ((fold as u64 + 1) << 48))?;
            Some((forest, unseen))
        })
        .collect();
    let grown: Vec<(Forest, Vec<usize>)> = grown.into_iter().collect::<Option<_>>()?;
    for (forest, unseen) in &grown {
        for (row, score) in unseen.iter().zip(forest.scores(&sample.rows.only(unseen))) {
            scores[*row] = score;
        }
        for (sum, part) in used.iter_mut().zip(forest.use_of_columns()) {
            *sum += part / folds as f64;
        }
    }
    Some(Round { scores, used, folds: grown })
}

fn area(sample: &Sample, scores: &[f64]) -> f64 {
    let of = |side: bool| -> Vec<f64> {
        scores.iter().zip(&sample.rows.synthetic).filter(|(_, s)| **s == side).map(|(v, _)| *v).collect()
    };
    auc(&of(false), &of(true))
}

/// Tries to tell two sets of fields apart by their tables; none if a side has fewer than two fields with rows.
pub fn two_sample(real: &[Table], synthetic: &[Table], params: &TwoSampleParams, seed: u64) -> Option<TwoSample> {
    let tables: Vec<(&Table, bool)> =
        real.iter().map(|t| (t, false)).chain(synthetic.iter().map(|t| (t, true))).collect();
    let sample = Sample::new(&tables)?;
    let round = round(&sample, params.folds, params.trees, seed)?;
    let halves: Vec<Option<(f64, usize)>> =
        (0..params.halvings as u64).into_par_iter().map(|i| halving(real, params, seed.wrapping_add(i + 1))).collect();
    let halves: Vec<(f64, usize)> = halves.into_iter().flatten().collect();
    let mut null_rows: Vec<f64> = halves.iter().map(|h| h.1 as f64).collect();
    let count = |side: bool| sample.rows.synthetic.iter().filter(|s| **s == side).count();
    let of = |side: bool| {
        round.scores.iter().zip(&sample.rows.synthetic).filter(|(_, s)| **s == side).map(|(v, _)| *v).collect()
    };
    Some(TwoSample {
        rows: [count(false), count(true)],
        fields: sample.counts(),
        auc: area(&sample, &round.scores),
        interval: interval(&sample, &round.scores, params.bootstrap, seed),
        null: halves.iter().map(|h| h.0).collect(),
        null_rows: crate::number::nearest(median(&mut null_rows)),
        families: families(&sample, tables.iter().map(|t| t.0), params, seed),
        giveaways: giveaways(&sample, &round, tables.iter().map(|t| t.0), params, seed),
        scores: [of(false), of(true)],
    })
}

/// The same test between two random halves of the real fields, and the rows of one.
fn halving(real: &[Table], params: &TwoSampleParams, seed: u64) -> Option<(f64, usize)> {
    let mut fields: Vec<&Table> = real.iter().filter(|t| !t.is_empty()).collect();
    shuffle(&mut fields, &mut Xoshiro256PlusPlus::seed_from_u64(seed));
    let half = fields.len() / 2;
    let tables: Vec<(&Table, bool)> = fields.iter().enumerate().map(|(i, t)| (*t, i < half)).collect();
    let sample = Sample::new(&tables)?;
    let round = round(&sample, params.folds, params.trees, seed)?;
    Some((area(&sample, &round.scores), sample.rows.synthetic.iter().filter(|s| **s).count()))
}

/// The 95 % interval of the AUC, by drawing fields of each side with replacement.
fn interval(sample: &Sample, scores: &[f64], draws: usize, seed: u64) -> [f64; 2] {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x_b007);
    let sides = [false, true].map(|side| {
        (0..sample.sides.len()).filter(|f| sample.sides[*f] == side && sample.fields.contains(f)).collect::<Vec<_>>()
    });
    let mut all: Vec<(f64, bool, usize)> =
        scores.iter().zip(&sample.rows.synthetic).zip(&sample.fields).map(|((s, side), f)| (*s, *side, *f)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut areas: Vec<f64> = (0..draws)
        .map(|_| {
            let mut weights = vec![0.0; sample.sides.len()];
            for fields in &sides {
                for _ in fields {
                    weights[fields[below(fields.len(), &mut rng)]] += 1.0;
                }
            }
            let mut weighted: Vec<(f64, bool, f64)> =
                all.iter().map(|(s, side, f)| (*s, *side, weights[*f])).filter(|s| s.2 > 0.0).collect();
            weighted_auc(&mut weighted)
        })
        .collect();
    areas.sort_unstable_by(f64::total_cmp);
    [0.025, 0.975].map(|q| of_sorted(&areas, q))
}

/// The test with the features of each family alone.
fn families<'a>(
    sample: &Sample,
    mut tables: impl Iterator<Item = &'a Table>,
    params: &TwoSampleParams,
    seed: u64,
) -> Vec<FamilyAlone> {
    let Some(features) = tables.find(|t| !t.is_empty()).map(|t| &t.features) else { return Vec::new() };
    let names: BTreeSet<Family> = features.iter().map(|f| f.family).collect();
    let names: Vec<Family> = names.into_iter().collect();
    let alone = |family: Family| {
        let columns =
            sample.rows.columns.iter().zip(features).filter(|(_, f)| f.family == family).map(|(c, _)| c.clone());
        let rows = Rows { columns: columns.collect(), synthetic: sample.rows.synthetic.clone() };
        let part = Sample { rows, fields: sample.fields.clone(), sides: sample.sides.clone() };
        round(&part, params.folds, params.trees, seed).map(|r| FamilyAlone { family, auc: area(&part, &r.scores) })
    };
    let mut areas: Vec<FamilyAlone> =
        names.into_par_iter().map(alone).collect::<Vec<_>>().into_iter().flatten().collect();
    areas.sort_by(|a, b| b.auc.total_cmp(&a.auc));
    areas
}

/// How far the sides' mean scores lie apart.
fn separation(synthetic: &[bool], scores: &[f64]) -> f64 {
    let of = |side: bool| -> Vec<f64> {
        scores.iter().zip(synthetic).filter(|(_, s)| **s == side).map(|(v, _)| *v).collect()
    };
    mean(&of(true)) - mean(&of(false))
}

fn giveaways<'a>(
    sample: &Sample,
    round: &Round,
    mut tables: impl Iterator<Item = &'a Table>,
    params: &TwoSampleParams,
    seed: u64,
) -> Vec<Giveaway> {
    let Some(features) = tables.find(|t| !t.is_empty()).map(|t| &t.features) else { return Vec::new() };
    let rows = &sample.rows;
    let mut order: Vec<usize> = (0..features.len()).collect();
    order.sort_by(|a, b| round.used[*b].total_cmp(&round.used[*a]).then(a.cmp(b)));
    let whole = separation(&rows.synthetic, &round.scores).max(1e-6);
    let shuffled = |column: usize| {
        let mut scores = vec![0.0; rows.len()];
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed ^ ((column as u64 + 1) << 20));
        for (forest, unseen) in &round.folds {
            let mut part = rows.only(unseen);
            shuffle(&mut part.columns[column], &mut rng);
            for (row, score) in unseen.iter().zip(forest.scores(&part)) {
                scores[*row] = score;
            }
        }
        1.0 - separation(&rows.synthetic, &scores) / whole
    };
    let importances: Vec<f64> =
        order.par_iter().enumerate().map(|(i, c)| if i < params.shuffled { shuffled(*c) } else { 0.0 }).collect();
    let spread = |column: usize, side: bool| {
        let mut values: Vec<f64> = rows.columns[column]
            .iter()
            .zip(&rows.synthetic)
            .filter(|(_, s)| **s == side)
            .map(|(v, _)| f64::from(*v))
            .collect();
        values.sort_unstable_by(f64::total_cmp);
        ([0.1, 0.5, 0.9].map(|q| of_sorted(&values, q)), values)
    };
    let between = |column: usize, side: bool| {
        let mut fields = vec![Vec::new(); sample.sides.len()];
        for (value, field) in rows.columns[column].iter().zip(&sample.fields) {
            fields[*field].push(f64::from(*value));
        }
        let of_side = fields.iter_mut().zip(&sample.sides).filter(|(values, s)| **s == side && !values.is_empty());
        deviation(&of_side.map(|(values, _)| median(values)).collect::<Vec<_>>())
    };
    let mut list: Vec<Giveaway> = order
        .iter()
        .zip(importances)
        .map(|(&column, importance)| {
            let (real, low) = spread(column, false);
            let (synthetic, high) = spread(column, true);
            let Feature { name, family } = &features[column];
            Giveaway {
                feature: name.clone(),
                family: *family,
                importance,
                alone: auc(&low, &high),
                real,
                synthetic,
                between_fields: [between(column, false), between(column, true)],
            }
        })
        .collect();
    list.sort_by(|a, b| {
        b.importance.total_cmp(&a.importance).then((b.alone - 0.5).abs().total_cmp(&(a.alone - 0.5).abs()))
    });
    list
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
            let mut table = Table::default();
            let own = 0.2 * uniform();
            for i in 0..20 {
                let mut row = Row::default();
                for c in 0..COLUMNS {
                    let value = uniform() + own + if c == 3 { shift } else { 0.0 };
                    row.put(Family::Texture, format!("column {c}"), if (i + c) % 9 == 0 { f64::NAN } else { value });
                }
                table.push(row, [0.0; 2]);
            }
            table
        };
        (0..10).map(&mut field).collect()
    }

    fn params() -> TwoSampleParams {
        TwoSampleParams { trees: 60, halvings: 4, bootstrap: 200, shuffled: COLUMNS, ..TwoSampleParams::default() }
    }

    #[test]
    fn what_is_alike_is_not_told_apart() {
        let result = two_sample(&tables(0.0, 1), &tables(0.0, 2), &params(), 5).unwrap();
        assert!((0.3..0.65).contains(&result.auc), "{}", result.auc);
        assert_eq!((result.rows, result.fields, result.null.len()), ([200, 200], [10, 10], 4));
        assert!(result.interval[0] < 0.5);
    }

    #[test]
    fn what_differs_is_named_first() {
        let result = two_sample(&tables(0.0, 1), &tables(0.6, 2), &params(), 5).unwrap();
        assert!(result.auc > 0.85 && result.interval[0] > 0.75, "{} {:?}", result.auc, result.interval);
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
        let round = round(&sample, 3, 20, 1).unwrap();
        for (fold, (_, unseen)) in round.folds.iter().enumerate() {
            assert!(unseen.iter().all(|row| of[sample.fields[*row]] == fold));
        }
        assert_eq!(round.folds.iter().map(|f| f.1.len()).sum::<usize>(), 200);
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
