//! The judge: everything that is compared, and what follows from it.

use serde::{Deserialize, Serialize};

use crate::beside::{Beside, beside};
use crate::crops::{Crop, crops};
use crate::error::Error;
use crate::measure::{Field, GaugeParams, Statistics};
use crate::moments::{self, Moments};
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
    pub(crate) crops: Vec<Crop>,
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
        let ranges: [(&'static str, usize, usize, usize, &'static str); 7] = [
            ("two_sample.folds", t.folds, 2, 20, "2 to 20"),
            ("two_sample.trees", t.trees, 20, 10_000, "20 to 10000"),
            ("two_sample.halvings", t.halvings, 1, 1000, "1 to 1000"),
            ("two_sample.bootstrap", t.bootstrap, 10, 100_000, "10 to 100000"),
            ("two_sample.shuffled", t.shuffled, 0, 1000, "0 to 1000"),
            ("paper_nuclei", params.paper_nuclei, 8, 100_000, "8 to 100000"),
            ("draws", params.draws, 20, 100_000, "20 to 100000"),
        ];
        for (field, value, least, most, accepted) in ranges {
            if value < least || value > most {
                return Err(Error::Parameter { field, value: value as f64, accepted });
            }
        }
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
        let told = two_sample
            .iter()
            .map(|t| t.verdict)
            .chain(moments.iter().map(|t| t.verdict))
            .any(|v| v == Verdict::ToldApart);
        let result = |name: &str| two_sample.iter().find(|test| test.name == name).map(|test| &test.result);
        let crops = crops(real, synthetic, result);
        let names = |fields: &[Field]| fields.iter().map(|f| f.name.clone()).collect();
        Ok(Report {
            judge_report: VERSION,
            gauge: gauge.clone(),
            judge: self.params.clone(),
            fields: [names(real), names(synthetic)],
            notes,
            verdict: if told { Verdict::ToldApart } else { Verdict::NotToldApart },
            two_sample,
            moments,
            beside: beside(real, synthetic),
            statistics: [real, synthetic].map(|fields| fields.iter().map(|f| f.statistics.clone()).collect()),
            crops,
        })
    }

    fn classify(&self, real: &[Field], synthetic: &[Field], notes: &mut Vec<String>) -> Vec<Test<TwoSample>> {
        let everything = |_: &&Field| true;
        let mut tests = Vec::new();
        let mut test = |name: String, of: fn(&Field) -> &Table, counts: &dyn Fn(&&Field) -> bool| {
            let tables =
                |fields: &'_ [Field]| fields.iter().filter(counts).map(|f| of(f).clone()).collect::<Vec<Table>>();
            match two_sample(&tables(real), &tables(synthetic), &self.params.two_sample, self.params.seed) {
                Some(result) => tests.push(Test { name, verdict: of_areas(&result), result }),
                None => {
                    notes.push(format!("{name}: fewer than two fields of a side have some, so nothing is said of them"))
                }
            }
        };
        test("nuclei".to_owned(), |f| &f.nuclei, &everything);
        test("cells".to_owned(), |f| &f.cells, &everything);
        test("patches".to_owned(), |f| &f.patches, &everything);
        for group in shared_groups(real, synthetic) {
            test(format!("nuclei of group {group}"), |f| &f.nuclei, &|f| f.group == group);
        }
        tests
    }

    fn moments(&self, real: &[Field], synthetic: &[Field], notes: &mut Vec<String>) -> Vec<Test<Moments>> {
        let tables = |fields: &[Field]| fields.iter().map(|f| f.nuclei.clone()).collect::<Vec<Table>>();
        let (real, synthetic) = (tables(real), tables(synthetic));
        let sizes = [(self.params.paper_nuclei, "the paper's number"), (0, "as many as there are")];
        let mut tests = Vec::new();
        for (n, what) in sizes {
            match moments::compare(&real, &synthetic, n, self.params.draws, self.params.seed) {
                Some(result) => {
                    let within = result.descriptors.iter().all(|d| d.within);
                    let verdict = if within { Verdict::NotToldApart } else { Verdict::ToldApart };
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
fn shared_groups(real: &[Field], synthetic: &[Field]) -> Vec<String> {
    let enough = |fields: &[Field], group: &str| fields.iter().filter(|f| f.group == group).count() >= LEAST_FIELDS;
    let names: std::collections::BTreeSet<&str> =
        real.iter().map(|f| f.group.as_str()).filter(|g| !g.is_empty()).collect();
    let shared: Vec<String> =
        names.into_iter().filter(|g| enough(real, g) && enough(synthetic, g)).map(str::to_owned).collect();
    // One group alone is the whole.
    if shared.len() == 1 && real.iter().chain(synthetic).all(|f| f.group == shared[0]) { Vec::new() } else { shared }
}

/// The sides are told apart if the AUC is larger than 95 of 100 between real halves, and its interval leaves out ½.
fn of_areas(result: &TwoSample) -> Verdict {
    let mut null = result.null.clone();
    let beyond_null = null.is_empty() || result.auc > crate::statistics::quantile(&mut null, 0.95);
    if beyond_null && result.interval[0] > 0.5 { Verdict::ToldApart } else { Verdict::NotToldApart }
}
