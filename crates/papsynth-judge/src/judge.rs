//! The judge: everything that is compared, and what follows from it.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::crops::{Sheet, sheets};
use crate::error::Error;
use crate::measure::{Field, GaugeParams, HISTOGRAM, HISTOGRAM_FROM, HISTOGRAM_STEP, PROFILE, Statistics, frequencies};
use crate::moments::{self, Moments};
use crate::statistics::{of_sorted, quantile, sorted};
use crate::table::Table;
use crate::two_sample::{TwoSample, TwoSampleParams, two_sample};

/// How fields are judged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JudgeParams {
    /// The classifier two-sample test.
    pub two_sample: TwoSampleParams,
    /// Nuclei of each side in the smaller Q-Q plots, 8 to 100000. Default 30: the paper's.
    pub paper_nuclei: usize,
    /// Draws of nuclei for Q-Q slopes, 20 to 100000. Default 400.
    pub draws: usize,
    /// Seed of all that is drawn. Default 0.
    pub seed: u64,
}

impl JudgeParams {
    /// About five times as quick, for a first look: fewer trees, halvings and draws of fields.
    #[must_use]
    pub fn quick() -> Self {
        let two_sample = TwoSampleParams { folds: 3, trees: 60, halvings: 5, bootstrap: 200, shuffled: 20 };
        Self { two_sample, ..Self::default() }
    }
}

impl Default for JudgeParams {
    fn default() -> Self {
        Self { two_sample: TwoSampleParams::default(), paper_nuclei: 30, draws: 400, seed: 0 }
    }
}

/// Compares two sets of fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Judge {
    params: JudgeParams,
}

/// What a test says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The sides differ by more than real fields do among each other.
    ToldApart,
    /// They do not, as far as so many fields can tell.
    NotToldApart,
}

impl Verdict {
    fn of(told_apart: bool) -> Self {
        if told_apart { Self::ToldApart } else { Self::NotToldApart }
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Self::ToldApart => "told apart",
            Self::NotToldApart => "not told apart",
        })
    }
}

/// A test and its verdict.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Test<T> {
    /// What is compared: "nuclei", "nuclei of group N", ….
    pub name: String,
    /// What it says.
    pub verdict: Verdict,
    /// The numbers.
    pub result: T,
}

/// All that the judge found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of the report's format: 1. The first field, so that a file tells what it is.
    pub judge_report: u32,
    /// How the pictures were measured.
    pub gauge: GaugeParams,
    /// How they were judged.
    pub judge: JudgeParams,
    /// Names of the real fields and of the synthetic ones.
    pub fields: [Vec<String>; 2],
    /// What should be known when the numbers are read.
    pub notes: Vec<String>,
    /// Told apart if any test tells the sides apart. Each errs about once in twenty, so that this does about once in eight.
    pub verdict: Verdict,
    /// The classifier on nuclei, cells and patches, then on nuclei of each group that both sides have.
    pub two_sample: Vec<Test<TwoSample>>,
    /// The paper's Q-Q slopes, at its number of nuclei and at as many as there are.
    pub moments: Vec<Test<Moments>>,
    /// Field statistics beside each other.
    pub beside: Beside,
    /// Statistics of every real field and of every synthetic one.
    pub statistics: [Vec<Statistics>; 2],
    /// What the classifier was most and least sure of, for the page.
    #[serde(skip)]
    pub(crate) crops: Vec<Sheet>,
}

/// Version of the report's format.
const VERSION: u32 = 1;

/// Fewest fields of a side: one to learn from, one to try.
const LEAST_FIELDS: usize = 2;

impl Judge {
    /// Checks the parameters.
    ///
    /// # Errors
    /// If one is outside its range.
    pub fn new(params: &JudgeParams) -> Result<Self, Error> {
        let t = &params.two_sample;
        Error::check(&[
            ("two_sample.folds", t.folds as f64, [2.0, 20.0], "2 to 20"),
            ("two_sample.trees", t.trees as f64, [20.0, 1e4], "20 to 10000"),
            ("two_sample.halvings", t.halvings as f64, [1.0, 1e3], "1 to 1000"),
            ("two_sample.bootstrap", t.bootstrap as f64, [10.0, 1e5], "10 to 100000"),
            ("two_sample.shuffled", t.shuffled as f64, [0.0, 1e3], "0 to 1000"),
            ("paper_nuclei", params.paper_nuclei as f64, [8.0, 1e5], "8 to 100000"),
            ("draws", params.draws as f64, [20.0, 1e5], "20 to 100000"),
        ])?;
        Ok(Self { params: params.clone() })
    }

    /// Judges synthetic fields by real ones, all measured by one [`Gauge`](crate::Gauge).
    ///
    /// # Errors
    /// If a side has fewer than two fields, or they were measured with different parameters.
    pub fn compare(&self, real: &[Field], synthetic: &[Field]) -> Result<Report, Error> {
        for (side, fields) in [("real", real), ("synthetic", synthetic)] {
            if fields.len() < LEAST_FIELDS {
                return Err(Error::Fields { side, count: fields.len(), least: LEAST_FIELDS });
            }
        }
        let gauge = &real[0].params;
        if let Some(other) = real.iter().chain(synthetic).find(|f| f.params != *gauge) {
            return Err(Error::Gauge { name: other.name.clone() });
        }
        let mut notes = Vec::new();
        let two_sample = self.classify(real, synthetic, &mut notes);
        let moments = self.moments(real, synthetic, &mut notes);
        let mut verdicts = two_sample.iter().map(|t| t.verdict).chain(moments.iter().map(|t| t.verdict));
        let verdict = Verdict::of(verdicts.any(|v| v == Verdict::ToldApart));
        let crops =
            sheets(real, synthetic, |of| two_sample.iter().find(|test| test.name == of).map(|test| &test.result));
        let names = |fields: &[Field]| fields.iter().map(|f| f.name.clone()).collect();
        Ok(Report {
            judge_report: VERSION,
            gauge: gauge.clone(),
            judge: self.params.clone(),
            fields: [names(real), names(synthetic)],
            notes,
            verdict,
            two_sample,
            moments,
            beside: beside(real, synthetic),
            statistics: [real, synthetic].map(|fields| fields.iter().map(|f| f.statistics.clone()).collect()),
            crops,
        })
    }

    fn classify(&self, real: &[Field], synthetic: &[Field], notes: &mut Vec<String>) -> Vec<Test<TwoSample>> {
        let mut tests = Vec::new();
        let mut test = |name: String, of: fn(&Field) -> &Table, group: Option<&str>| {
            let tables = |fields: &[Field]| -> Vec<Table> {
                fields.iter().filter(|f| group.is_none_or(|g| f.group == g)).map(|f| of(f).clone()).collect()
            };
            match two_sample(&tables(real), &tables(synthetic), &self.params.two_sample, self.params.seed) {
                Some(result) => tests.push(Test { name, verdict: of_areas(&result), result }),
                None => {
                    notes.push(format!("{name}: fewer than two fields of a side have some, so nothing is said of them"))
                }
            }
        };
        test("nuclei".to_owned(), |f| &f.nuclei, None);
        test("cells".to_owned(), |f| &f.cells, None);
        test("patches".to_owned(), |f| &f.patches, None);
        for group in shared_groups(real, synthetic) {
            test(format!("nuclei of group {group}"), |f| &f.nuclei, Some(group));
        }
        tests
    }

    fn moments(&self, real: &[Field], synthetic: &[Field], notes: &mut Vec<String>) -> Vec<Test<Moments>> {
        let tables = |fields: &[Field]| fields.iter().map(|f| f.nuclei.clone()).collect::<Vec<Table>>();
        let (real, synthetic) = (tables(real), tables(synthetic));
        let mut tests = Vec::new();
        for (n, what) in [(self.params.paper_nuclei, "the paper's number"), (0, "as many as there are")] {
            match moments::compare(&real, &synthetic, n, self.params.draws, self.params.seed) {
                Some(result) => {
                    let verdict = Verdict::of(result.descriptors.iter().any(|d| !d.within));
                    tests.push(Test { name: format!("texture of {} nuclei, {what}", result.n), verdict, result });
                }
                None => notes
                    .push(format!("Q-Q plots of {what} of nuclei need more nuclei than half of the real fields have")),
            }
        }
        tests
    }
}

/// Groups that have two fields or more on both sides, in order.
fn shared_groups<'a>(real: &'a [Field], synthetic: &[Field]) -> Vec<&'a str> {
    let enough = |fields: &[Field], group: &str| fields.iter().filter(|f| f.group == group).count() >= LEAST_FIELDS;
    let names: BTreeSet<&str> = real.iter().map(|f| f.group.as_str()).filter(|g| !g.is_empty()).collect();
    let shared: Vec<&str> = names.into_iter().filter(|g| enough(real, g) && enough(synthetic, g)).collect();
    // One group alone is the whole.
    if shared.len() == 1 && real.iter().chain(synthetic).all(|f| f.group == shared[0]) { Vec::new() } else { shared }
}

/// The sides are told apart if the AUC is larger than 95 of 100 between real halves, and its interval leaves out ½.
fn of_areas(result: &TwoSample) -> Verdict {
    let mut null = result.null.clone();
    let beyond_null = null.is_empty() || result.auc > quantile(&mut null, 0.95);
    Verdict::of(beyond_null && result.interval[0] > 0.5)
}

/// 10th, 50th and 90th percentile over the fields of a side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// 10th percentile.
    pub p10: Option<f64>,
    /// Median.
    pub p50: Option<f64>,
    /// 90th percentile.
    pub p90: Option<f64>,
}

impl Spread {
    /// Of what is known.
    pub(crate) fn of(values: impl Iterator<Item = f64>) -> Self {
        let values = sorted(values.filter(|v| v.is_finite()));
        let at = |q: f64| (!values.is_empty()).then(|| of_sorted(&values, q));
        Self { p10: at(0.1), p50: at(0.5), p90: at(0.9) }
    }
}

/// A number for every field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scalar {
    /// Its name, with its unit where it has one.
    pub name: String,
    /// Over real fields.
    pub real: Spread,
    /// Over synthetic fields.
    pub synthetic: Spread,
    /// Whether the synthetic median lies between the real 10th and 90th percentile; false if either is unknown.
    pub within: bool,
}

/// A curve for every field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// What it shows.
    pub name: String,
    /// What runs along it.
    pub along: String,
    /// Where its points are.
    pub at: Vec<f64>,
    /// Over real fields, point by point.
    pub real: Vec<Spread>,
    /// Over synthetic fields.
    pub synthetic: Vec<Spread>,
}

/// Field statistics of both sides beside each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Beside {
    /// Single numbers.
    pub scalars: Vec<Scalar>,
    /// Absorbance's histogram and spectrum, cytoplasm from rim to centre.
    pub curves: Vec<Curve>,
}

/// Smaller parts of a field are drawn as this.
const RAREST: f64 = 1e-5;

fn beside(real: &[Field], synthetic: &[Field]) -> Beside {
    let names = real[0].statistics.scalars();
    let scalar = |(i, (name, _)): (usize, &(&str, f64))| {
        let of = |fields: &[Field]| Spread::of(fields.iter().map(|f| f.statistics.scalars()[i].1));
        let (real, synthetic) = (of(real), of(synthetic));
        let within = match (real.p10, real.p90, synthetic.p50) {
            (Some(low), Some(high), Some(middle)) => middle >= low && middle <= high,
            _ => false,
        };
        Scalar { name: (*name).to_owned(), real, synthetic, within }
    };
    let curve = |name: &str, along: &str, at: Vec<f64>, of: &dyn Fn(&Statistics) -> Vec<f64>| {
        let spreads =
            |fields: &[Field]| (0..at.len()).map(|i| Spread::of(fields.iter().map(|f| of(&f.statistics)[i]))).collect();
        Curve { name: name.to_owned(), along: along.to_owned(), real: spreads(real), synthetic: spreads(synthetic), at }
    };
    let bins = (0..HISTOGRAM).map(|i| HISTOGRAM_FROM + (i as f64 + 0.5) * HISTOGRAM_STEP).collect();
    let profile = (0..PROFILE).map(|i| i as f64 + 1.0).collect();
    let rings = frequencies().iter().map(|f| libm::log10(*f)).collect();
    Beside {
        scalars: names.iter().enumerate().map(scalar).collect(),
        curves: vec![
            curve("log10 of the part of the field", "absorbance", bins, &|s| {
                s.histogram.iter().map(|p| libm::log10(p.max(RAREST))).collect()
            }),
            curve("log10 of the power of absorbance", "log10 of cycles a pixel", rings, &|s| s.spectrum.to_vec()),
            curve("absorbance of free cells over their median", "bin from rim to centre", profile, &|s| {
                s.profile.to_vec()
            }),
        ],
    }
}
