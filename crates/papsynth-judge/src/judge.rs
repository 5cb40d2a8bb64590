//! The comparison of two sets of fields, and its report.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::control::Control;
use crate::crops::{Sheet, sheets};
use crate::describe::describe;
use crate::error::Error;
use crate::measure::{
    Field, HISTOGRAM, HISTOGRAM_FROM, HISTOGRAM_STEP, MeasurerParams, PROFILE, Statistics, frequencies,
};
use crate::moments::{self, Moments};
use crate::statistics::{of_sorted, quantile, sorted};
use crate::table::{FeatureKind, FeatureTable};
use crate::two_sample::{TwoSample, TwoSampleParams, two_sample};

/// Features that the classifiers use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Default)]
pub enum FeatureSet {
    /// The features of version 0.1, so that results stay comparable.
    #[serde(rename = "1")]
    First,
    /// Also the texture of cytoplasm in windows inside cells.
    #[default]
    #[serde(rename = "2")]
    Second,
}

impl FeatureSet {
    /// All sets, the oldest first.
    pub const ALL: [Self; 2] = [Self::First, Self::Second];

    /// Returns the name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::First => "1",
            Self::Second => "2",
        }
    }

    /// Returns the columns of a table that the set has.
    fn of(self, table: &FeatureTable) -> FeatureTable {
        match self {
            Self::First => table.without(FeatureKind::Cytoplasm),
            Self::Second => table.clone(),
        }
    }
}

/// Parameters of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JudgeParams {
    /// Features that the classifiers use. Default: the second set.
    pub features: FeatureSet,
    /// The classifier two-sample test.
    pub two_sample: TwoSampleParams,
    /// Nuclei of each side in the smaller Q-Q plots, 8 to 100000. Default 30, as in the paper.
    pub paper_nuclei: usize,
    /// Random draws of nuclei for Q-Q slopes, 20 to 100000. Default 400.
    pub draws: usize,
    /// Seed of all random draws. Default 0.
    pub seed: u64,
}

impl JudgeParams {
    /// Returns parameters for a first look, about five times faster: fewer trees, half splits and bootstrap draws.
    #[must_use]
    pub fn quick() -> Self {
        let two_sample = TwoSampleParams { folds: 3, trees: 60, half_splits: 5, bootstrap: 200, permuted: 20 };
        Self { two_sample, ..Self::default() }
    }
}

impl Default for JudgeParams {
    fn default() -> Self {
        let (features, two_sample) = (FeatureSet::default(), TwoSampleParams::default());
        Self { features, two_sample, paper_nuclei: 30, draws: 400, seed: 0 }
    }
}

/// A comparison of two sets of fields.
#[derive(Debug, Clone, PartialEq)]
pub struct Judge {
    params: JudgeParams,
}

/// Conclusion of a test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Conclusion {
    /// The sides differ by more than real fields differ among each other.
    Distinguishable,
    /// The sides do not differ by more than that, with this number of fields.
    NotDistinguishable,
}

impl Conclusion {
    fn new(distinguishable: bool) -> Self {
        if distinguishable { Self::Distinguishable } else { Self::NotDistinguishable }
    }
}

impl std::fmt::Display for Conclusion {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Self::Distinguishable => "distinguishable",
            // A test that finds no difference does not show that there is none.
            Self::NotDistinguishable => "no difference found",
        })
    }
}

/// A test with its conclusion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Test<T> {
    /// Objects of the comparison: "nuclei", "nuclei of group N", ….
    pub name: String,
    /// Conclusion.
    pub conclusion: Conclusion,
    /// Measured values of the test.
    pub result: T,
}

/// Result of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of the format: 1. The first field of the JSON, which identifies the file.
    pub judge_report: u32,
    /// Parameters of the measurements.
    pub measurement: MeasurerParams,
    /// Parameters of the comparison.
    pub judge: JudgeParams,
    /// Names of the real fields and of the synthetic ones.
    pub fields: [Vec<String>; 2],
    /// Warnings: the same image on both sides, too few objects, ….
    pub warnings: Vec<String>,
    /// Distinguishable if the conclusion of any test is "distinguishable". If both sides are real fields, one test is
    /// wrongly "distinguishable" in about 1 of 20 comparisons, and this conclusion in about 1 of 8.
    pub conclusion: Conclusion,
    /// Classifier tests on nuclei, cells and patches, then on the nuclei of each group that both sides have.
    pub two_sample: Vec<Test<TwoSample>>,
    /// Q-Q slopes of the paper, with its number of nuclei and with all nuclei.
    pub moments: Vec<Test<Moments>>,
    /// Field statistics of both sides.
    pub field_comparison: FieldComparison,
    /// Statistics of each real and of each synthetic field.
    pub statistics: [Vec<Statistics>; 2],
    /// Image crops with the highest and lowest scores, for the HTML page.
    #[serde(skip)]
    pub(crate) crops: Vec<Sheet>,
}

/// Version of the report format.
const VERSION: u32 = 1;

/// Minimum number of fields of a side: one to train on, one to test on.
const LEAST_FIELDS: usize = 2;

impl Judge {
    /// Checks the parameters.
    ///
    /// # Errors
    /// If a parameter is out of range.
    pub fn new(params: &JudgeParams) -> Result<Self, Error> {
        let t = &params.two_sample;
        Error::check(&[
            ("two_sample.folds", t.folds as f64, [2.0, 20.0], "2 to 20"),
            ("two_sample.trees", t.trees as f64, [20.0, 1e4], "20 to 10000"),
            ("two_sample.half_splits", t.half_splits as f64, [1.0, 1e3], "1 to 1000"),
            ("two_sample.bootstrap", t.bootstrap as f64, [10.0, 1e5], "10 to 100000"),
            ("two_sample.permuted", t.permuted as f64, [0.0, 1e3], "0 to 1000"),
            ("paper_nuclei", params.paper_nuclei as f64, [8.0, 1e5], "8 to 100000"),
            ("draws", params.draws as f64, [20.0, 1e5], "20 to 100000"),
        ])?;
        Ok(Self { params: params.clone() })
    }

    /// Compares synthetic fields with real ones. One [`Measurer`](crate::Measurer) must have measured all of them.
    ///
    /// # Errors
    /// If a side has fewer than two fields, or they were measured with different parameters.
    pub fn compare(&self, real: &[Field], synthetic: &[Field]) -> Result<Report, Error> {
        self.compare_with(real, synthetic, &Control::NONE)
    }

    /// As [`compare`](Self::compare), with progress reports and a stop flag. The phases are "classifying nuclei",
    /// "classifying cells", "classifying patches", "classifying nuclei of group …" and twice "comparing nuclear
    /// texture".
    ///
    /// # Errors
    /// As `compare`; [`Error::Stopped`] if the stop flag is set.
    pub fn compare_with(&self, real: &[Field], synthetic: &[Field], control: &Control) -> Result<Report, Error> {
        for (side, fields) in [("real", real), ("synthetic", synthetic)] {
            if fields.len() < LEAST_FIELDS {
                return Err(Error::Fields { side, count: fields.len(), least: LEAST_FIELDS });
            }
        }
        let measurement = &real[0].params;
        if let Some(other) = real.iter().chain(synthetic).find(|f| f.params != *measurement) {
            return Err(Error::Measurer { name: other.name.clone() });
        }
        let mut warnings: Vec<String> = same_images(real, synthetic).into_iter().collect();
        let two_sample = self.classify(real, synthetic, &mut warnings, control)?;
        let moments = self.moments(real, synthetic, &mut warnings, control)?;
        let mut conclusions = two_sample.iter().map(|t| t.conclusion).chain(moments.iter().map(|t| t.conclusion));
        let conclusion = Conclusion::new(conclusions.any(|v| v == Conclusion::Distinguishable));
        let crops =
            sheets(real, synthetic, |of| two_sample.iter().find(|test| test.name == of).map(|test| &test.result));
        let names = |fields: &[Field]| fields.iter().map(|f| f.name.clone()).collect();
        Ok(Report {
            judge_report: VERSION,
            measurement: measurement.clone(),
            judge: self.params.clone(),
            fields: [names(real), names(synthetic)],
            warnings,
            conclusion,
            two_sample,
            moments,
            field_comparison: field_comparison(real, synthetic),
            statistics: [real, synthetic].map(|fields| fields.iter().map(|f| f.statistics.clone()).collect()),
            crops,
        })
    }

    fn classify(
        &self,
        real: &[Field],
        synthetic: &[Field],
        warnings: &mut Vec<String>,
        control: &Control,
    ) -> Result<Vec<Test<TwoSample>>, Error> {
        let mut tests = Vec::new();
        let mut test = |name: String, of: fn(&Field) -> &FeatureTable, group: Option<&str>| -> Result<(), Error> {
            let tables = |fields: &[Field]| -> Vec<FeatureTable> {
                let chosen = fields.iter().filter(|f| group.is_none_or(|g| f.group == g));
                chosen.map(|f| self.params.features.of(of(f))).collect()
            };
            let (params, seed, phase) = (&self.params.two_sample, self.params.seed, format!("classifying {name}"));
            match two_sample(&tables(real), &tables(synthetic), params, seed, &phase, control)? {
                Some(result) => tests.push(Test { name, conclusion: of_areas(&result), result }),
                None => {
                    warnings.push(format!("{name}: not compared; expected at least 2 fields with {name} on each side"))
                }
            }
            Ok(())
        };
        test("nuclei".to_owned(), |f| &f.nuclei, None)?;
        test("cells".to_owned(), |f| &f.cells, None)?;
        test("patches".to_owned(), |f| &f.patches, None)?;
        for group in shared_groups(real, synthetic) {
            test(format!("nuclei of group {group}"), |f| &f.nuclei, Some(group))?;
        }
        Ok(tests)
    }

    fn moments(
        &self,
        real: &[Field],
        synthetic: &[Field],
        warnings: &mut Vec<String>,
        control: &Control,
    ) -> Result<Vec<Test<Moments>>, Error> {
        let tables = |fields: &[Field]| fields.iter().map(|f| f.nuclei.clone()).collect::<Vec<FeatureTable>>();
        let (real, synthetic) = (tables(real), tables(synthetic));
        let mut tests: Vec<Test<Moments>> = Vec::new();
        for (n, what) in [(self.params.paper_nuclei, "as many as in the paper"), (0, "all nuclei")] {
            match moments::compare(&real, &synthetic, n, self.params.draws, self.params.seed, control)? {
                // Already compared: there are as many nuclei as in the paper.
                Some(result) if tests.iter().any(|test| test.result.n == result.n) => {}
                Some(result) => {
                    let conclusion = Conclusion::new(result.descriptors.iter().any(|d| !d.within));
                    tests.push(Test { name: format!("texture of {} nuclei ({what})", result.n), conclusion, result });
                }
                None => warnings.push(format!(
                    "texture of nuclei ({what}): not compared, because half of the real fields have too few nuclei"
                )),
            }
        }
        Ok(tests)
    }
}

/// Returns a warning about images that both sides contain.
fn same_images(real: &[Field], synthetic: &[Field]) -> Option<String> {
    const NAMED: usize = 3;
    let other: BTreeSet<u64> = synthetic.iter().map(|f| f.fingerprint).collect();
    let same: Vec<&str> = real.iter().filter(|f| other.contains(&f.fingerprint)).map(|f| f.name.as_str()).collect();
    let names = same.iter().take(NAMED).copied().collect::<Vec<_>>().join(", ");
    let more = if same.len() > NAMED { ", …" } else { "" };
    match same.len() {
        0 => None,
        n if n == real.len() && n == synthetic.len() => Some(format!(
            "both sides are the same {n} images ({names}{more}): the comparison is meaningless; give two different folders"
        )),
        1 => Some(format!("1 image is on both sides ({names}): remove it from one side, because it biases the tests")),
        n => Some(format!(
            "{n} images are on both sides ({names}{more}): remove them from one side, because they bias the tests"
        )),
    }
}

/// Returns the groups with two or more fields on both sides, in order.
fn shared_groups<'a>(real: &'a [Field], synthetic: &[Field]) -> Vec<&'a str> {
    let enough = |fields: &[Field], group: &str| fields.iter().filter(|f| f.group == group).count() >= LEAST_FIELDS;
    let names: BTreeSet<&str> = real.iter().map(|f| f.group.as_str()).filter(|g| !g.is_empty()).collect();
    let shared: Vec<&str> = names.into_iter().filter(|g| enough(real, g) && enough(synthetic, g)).collect();
    // A single group of all fields repeats the test of all nuclei.
    if shared.len() == 1 && real.iter().chain(synthetic).all(|f| f.group == shared[0]) { Vec::new() } else { shared }
}

/// The sides are distinguishable if the AUC exceeds the 95th percentile between real halves, and its interval excludes
/// ½.
fn of_areas(result: &TwoSample) -> Conclusion {
    let mut null = result.null.clone();
    let beyond_null = null.is_empty() || result.auc > quantile(&mut null, 0.95);
    Conclusion::new(beyond_null && result.interval[0] > 0.5)
}

/// Percentiles over the fields of a side; none if no field has a value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Percentiles {
    /// 10th percentile.
    pub p10: Option<f64>,
    /// Median.
    pub p50: Option<f64>,
    /// 90th percentile.
    pub p90: Option<f64>,
}

impl Percentiles {
    /// Returns the percentiles of the finite values.
    pub(crate) fn of(values: impl Iterator<Item = f64>) -> Self {
        let values = sorted(values.filter(|v| v.is_finite()));
        let at = |q: f64| (!values.is_empty()).then(|| of_sorted(&values, q));
        Self { p10: at(0.1), p50: at(0.5), p90: at(0.9) }
    }
}

/// A field statistic of one number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scalar {
    /// Stable identifier.
    pub name: String,
    /// The statistic in words, with its unit.
    pub description: String,
    /// Percentiles over the real fields.
    pub real: Percentiles,
    /// Percentiles over the synthetic fields.
    pub synthetic: Percentiles,
    /// Whether the synthetic median is between the real 10th and 90th percentile; false if one of them is unknown.
    pub within: bool,
}

/// A field statistic that is a curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Name of the vertical axis.
    pub name: String,
    /// Name of the horizontal axis.
    pub along: String,
    /// Horizontal positions of the points.
    pub at: Vec<f64>,
    /// Percentiles over the real fields, for each point.
    pub real: Vec<Percentiles>,
    /// Percentiles over the synthetic fields, for each point.
    pub synthetic: Vec<Percentiles>,
}

/// Field statistics of both sides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FieldComparison {
    /// Single numbers.
    pub scalars: Vec<Scalar>,
    /// Histogram and power spectrum of absorbance, and absorbance of free cells from border to centre.
    pub curves: Vec<Curve>,
}

/// Lower limit of the histogram, for its logarithm.
const LEAST_FRACTION: f64 = 1e-5;

fn field_comparison(real: &[Field], synthetic: &[Field]) -> FieldComparison {
    let names = real[0].statistics.scalars();
    let scalar = |(i, (name, _)): (usize, &(&str, f64))| {
        let of = |fields: &[Field]| Percentiles::of(fields.iter().map(|f| f.statistics.scalars()[i].1));
        let (real, synthetic) = (of(real), of(synthetic));
        let within = match (real.p10, real.p90, synthetic.p50) {
            (Some(low), Some(high), Some(middle)) => middle >= low && middle <= high,
            _ => false,
        };
        Scalar { name: (*name).to_owned(), description: describe(name), real, synthetic, within }
    };
    let curve = |name: &str, along: &str, at: Vec<f64>, of: &dyn Fn(&Statistics) -> Vec<f64>| {
        let spreads = |fields: &[Field]| {
            (0..at.len()).map(|i| Percentiles::of(fields.iter().map(|f| of(&f.statistics)[i]))).collect()
        };
        Curve { name: name.to_owned(), along: along.to_owned(), real: spreads(real), synthetic: spreads(synthetic), at }
    };
    let bins = (0..HISTOGRAM).map(|i| HISTOGRAM_FROM + (i as f64 + 0.5) * HISTOGRAM_STEP).collect();
    let profile = (0..PROFILE).map(|i| i as f64 + 1.0).collect();
    let rings = frequencies().iter().map(|f| libm::log10(*f)).collect();
    FieldComparison {
        scalars: names.iter().enumerate().map(scalar).collect(),
        curves: vec![
            curve("fraction of the field, log10", "absorbance", bins, &|s| {
                s.histogram.iter().map(|p| libm::log10(p.max(LEAST_FRACTION))).collect()
            }),
            curve("power of absorbance, log10", "cycles per pixel, log10", rings, &|s| s.spectrum.to_vec()),
            curve("absorbance of free cells over their median", "ring from border to centre", profile, &|s| {
                s.profile.to_vec()
            }),
        ],
    }
}
