//! What was learned from real cells.
//!
//! A model holds what cells of each class are like: shapes, sizes, absorbances, chromatin. It is one JSON file,
//! readable and versioned, with the counts and the provenance of what it was learned from. The model that ships
//! holds numbers alone (means, covariances, spectra); one that you learn may hold donors, which are pixels.

mod class_file;

use std::collections::BTreeMap;

use fsd_shape::ShapeStatistics;
use serde::{Deserialize, Serialize};

use crate::error::{Cause, Error, within};

/// The version of models that this crate reads and writes.
pub const MODEL_VERSION: u32 = 1;

/// A model: what cells of each class are like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Version of this file's format.
    pub version: u32,
    /// What the model was learned from, newest last.
    pub provenance: Vec<Provenance>,
    /// The classes of cells by name.
    pub classes: BTreeMap<String, CellClass>,
}

/// One thing a model was learned from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// The class that was learned.
    pub class: String,
    /// What was learned: "cytoplasm outlines", "nucleus images", …
    pub what: String,
    /// How many of them.
    pub count: usize,
    /// Size of their pixels, µm.
    pub pixel_um: f64,
    /// Where they came from.
    pub source: String,
}

/// A quantity with a log-normal distribution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogNormal {
    /// Median.
    pub median: f64,
    /// Standard deviation of the natural logarithm.
    pub log_sd: f64,
}

/// A quantity with a normal distribution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Normal {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
}

/// What cells of one class are like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellClass {
    /// Category of the Bethesda system: "NILM", "LSIL", "HSIL", …
    pub bethesda: String,
    /// The cytoplasm.
    pub cytoplasm: CytoplasmStatistics,
    /// The nucleus.
    pub nucleus: NucleusStatistics,
}

/// What the cytoplasm of a class is like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CytoplasmStatistics {
    /// Radius of the circle of the first Fourier descriptor, |u₁|, µm.
    pub radius_um: LogNormal,
    /// Absorbance, the median over a cell.
    pub absorbance: LogNormal,
    /// Thickness from the rim to the middle in even steps of the distance from the rim, relative to its median.
    pub rim_to_centre: Vec<f64>,
    /// How its outlines differ from those that were learned.
    #[serde(default, skip_serializing_if = "Form::is_plain")]
    pub form: Form,
    /// How readily it folds, wrinkles and lies angular, 0 (a rounded, firm cell) to 1 (a thin sheet): a factor on what the
    /// recipe asks.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub pliability: f64,
    /// The cleared space round the nucleus, if the class has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub halo: Option<HaloStatistics>,
    /// Outlines.
    pub shapes: Shapes,
}

/// How outlines differ from those that were learned.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Form {
    /// Elongation |u₋₁|/|u₁| in the place of the learned one, 0 (round) to 0.9: an ellipse of half axes 1 ± this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elongation: Option<Normal>,
    /// How much wider one end is than the other, −0.3 to 0.3.
    #[serde(skip_serializing_if = "is_zero")]
    pub taper: f64,
    /// Factor on everything else about the outline, 0 (a smooth oval) to 3.
    #[serde(skip_serializing_if = "is_one")]
    pub unevenness: f64,
}

impl Default for Form {
    fn default() -> Self {
        Self { elongation: None, taper: 0.0, unevenness: 1.0 }
    }
}

impl Form {
    fn is_plain(&self) -> bool {
        *self == Self::default()
    }

    fn check(&self, path: &str) -> Result<(), Cause> {
        if let Some(elongation) = &self.elongation {
            elongation.check(&format!("{path}.elongation"), 0.0, 0.9)?;
        }
        within(&format!("{path}.taper"), self.taper, [-0.3, 0.3])?;
        within(&format!("{path}.unevenness"), self.unevenness, [0.0, 3.0])
    }
}

/// What the cleared space round the nucleus of a koilocyte is like.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HaloStatistics {
    /// Probability that a cell has one.
    pub probability: f64,
    /// Its radius relative to the nucleus's.
    pub radius: LogNormal,
    /// Share of the cytoplasm that is missing there, 0 to 1.
    pub clearing: Normal,
    /// How much denser the cytoplasm is at its edge.
    pub rim: Normal,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn one() -> f64 {
    1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

/// What the nucleus of a class is like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NucleusStatistics {
    /// Radius of the circle of the first Fourier descriptor, |u₁|, µm.
    pub radius_um: LogNormal,
    /// Correlation of the logarithms of the radii of nucleus and cell, −1 to 1.
    pub size_correlation: f64,
    /// Distance of its middle from the cell's, as a fraction of the cell's radius.
    pub off_centre: Normal,
    /// How strictly it is displaced towards one end of the cell, as in columnar cells: 0 (in any direction) to 1.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub polarity: f64,
    /// Absorbance above the cytoplasm, mean over a nucleus.
    pub absorbance: Normal,
    /// How its outlines differ from those that were learned.
    #[serde(default, skip_serializing_if = "Form::is_plain")]
    pub form: Form,
    /// Nucleoli, on average.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub nucleoli: f64,
    /// Chromatin.
    pub chromatin: ChromatinStatistics,
    /// Outlines.
    pub shapes: Shapes,
    /// Textures to take patches from; empty in a model of numbers, which makes its donors from the spectrum.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub donors: Vec<Donor>,
}

/// The texture inside nuclei: a Matérn field in the object plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChromatinStatistics {
    /// Smoothness ν of the Matérn covariance.
    pub nu: f64,
    /// Length of the Matérn covariance, µm.
    pub length_um: f64,
    /// Standard deviation of the absorbance inside a nucleus, as imaged.
    pub sd: Normal,
    /// Skewness of the absorbance.
    pub skewness: f64,
    /// Absorbance from the rim to the middle in even steps of the distance from the rim, relative to its mean.
    pub rim_to_centre: Vec<f64>,
}

/// The statistics of a population of outlines, for either way of drawing from them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shapes {
    /// Aligned, with what varies together.
    pub correlated: ShapeStatistics,
    /// The paper's: every descriptor on its own.
    pub independent: ShapeStatistics,
}

/// A texture to take patches from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Donor {
    /// Size of its pixels, µm.
    pub pixel_um: f64,
    /// Columns.
    pub width: usize,
    /// Absorbance above the surroundings in thousandths, row by row; −32768 outside the nucleus.
    pub absorbance_milli: Vec<i16>,
}

/// What stands for "outside the nucleus" in a donor.
pub const OUTSIDE: i16 = i16::MIN;

impl Model {
    /// Reads a model from its text.
    ///
    /// # Errors
    /// If the text is no model, one of another version, or one with numbers that cannot be: it says which.
    pub fn from_json(text: &str) -> Result<Self, Error> {
        #[derive(Deserialize)]
        struct Version {
            version: u32,
        }
        let read = || {
            let found = serde_json::from_str::<Version>(text).map_err(Cause::NotAModel)?.version;
            if found != MODEL_VERSION {
                return Err(Cause::ModelVersion(found.to_string(), MODEL_VERSION));
            }
            let model: Self = serde_json::from_str(text)?;
            model.checked().map(|()| model)
        };
        read().map_err(Error::Model)
    }

    /// The text of the model.
    ///
    /// # Panics
    /// Never: strings, numbers and lists can be written as JSON.
    #[must_use]
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string(self).expect("every model can be written as JSON");
        text.push('\n');
        text
    }

    /// What is wrong with the model, if anything.
    ///
    /// # Errors
    /// The first number that cannot be, by its path, with what would be accepted.
    pub fn check(&self) -> Result<(), Error> {
        self.checked().map_err(Error::Model)
    }

    pub(crate) fn checked(&self) -> Result<(), Cause> {
        for (name, class) in &self.classes {
            if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_') {
                return Err(Cause::ClassName(name.clone()));
            }
            class.check(&format!("classes.{name}"))?;
        }
        Ok(())
    }

    /// A class by its name.
    pub(crate) fn class(&self, name: &str) -> Result<&CellClass, Cause> {
        let known = || self.classes.keys().cloned().collect();
        self.classes.get(name).ok_or_else(|| Cause::UnknownClass(name.to_owned(), known()))
    }
}

impl CellClass {
    fn check(&self, path: &str) -> Result<(), Cause> {
        let at = |field: &str| format!("{path}.{field}");
        let (cytoplasm, nucleus) = (&self.cytoplasm, &self.nucleus);
        cytoplasm.radius_um.check(&at("cytoplasm.radius_um"), 0.5, 500.0)?;
        cytoplasm.absorbance.check(&at("cytoplasm.absorbance"), 1e-4, 4.0)?;
        profile(&at("cytoplasm.rim_to_centre"), &cytoplasm.rim_to_centre)?;
        cytoplasm.form.check(&at("cytoplasm.form"))?;
        nucleus.form.check(&at("nucleus.form"))?;
        within(&at("nucleus.nucleoli"), nucleus.nucleoli, [0.0, 10.0])?;
        within(&at("cytoplasm.pliability"), cytoplasm.pliability, [0.0, 1.0])?;
        if let Some(halo) = &cytoplasm.halo {
            within(&at("cytoplasm.halo.probability"), halo.probability, [0.0, 1.0])?;
            halo.radius.check(&at("cytoplasm.halo.radius"), 1.0, 10.0)?;
            halo.clearing.check(&at("cytoplasm.halo.clearing"), 0.0, 1.0)?;
            halo.rim.check(&at("cytoplasm.halo.rim"), 0.0, 4.0)?;
        }
        cytoplasm.shapes.check(&at("cytoplasm.shapes"))?;
        nucleus.radius_um.check(&at("nucleus.radius_um"), 0.2, 200.0)?;
        within(&at("nucleus.size_correlation"), nucleus.size_correlation, [-1.0, 1.0])?;
        nucleus.off_centre.check(&at("nucleus.off_centre"), 0.0, 1.0)?;
        within(&at("nucleus.polarity"), nucleus.polarity, [0.0, 1.0])?;
        nucleus.absorbance.check(&at("nucleus.absorbance"), 0.0, 4.0)?;
        let chromatin = &nucleus.chromatin;
        within(&at("nucleus.chromatin.nu"), chromatin.nu, [0.05, 20.0])?;
        within(&at("nucleus.chromatin.length_um"), chromatin.length_um, [0.01, 50.0])?;
        chromatin.sd.check(&at("nucleus.chromatin.sd"), 0.0, 4.0)?;
        within(&at("nucleus.chromatin.skewness"), chromatin.skewness, [-3.0, 3.0])?;
        profile(&at("nucleus.chromatin.rim_to_centre"), &chromatin.rim_to_centre)?;
        nucleus.shapes.check(&at("nucleus.shapes"))?;
        for (index, donor) in nucleus.donors.iter().enumerate() {
            donor.check(at(&format!("nucleus.donors[{index}]")))?;
        }
        Ok(())
    }
}

impl Shapes {
    fn check(&self, path: &str) -> Result<(), Cause> {
        for (name, statistics) in [("correlated", &self.correlated), ("independent", &self.independent)] {
            let sound = fsd_shape::ShapeModel::from_statistics(statistics.clone());
            sound.map_err(|error| Cause::Shapes(format!("{path}.{name}"), error))?;
        }
        Ok(())
    }
}

impl Donor {
    fn check(&self, field: String) -> Result<(), Cause> {
        /// Widest donor: a nucleus of 100 µm at 0.05 µm a pixel, and then some.
        const WIDEST: usize = 4096;
        within(&format!("{field}.pixel_um"), self.pixel_um, [0.05, 4.0])?;
        let pixels = self.absorbance_milli.len();
        if self.width == 0 || self.width > WIDEST || !pixels.is_multiple_of(self.width) {
            return Err(Cause::DonorSize { field, width: self.width, pixels });
        }
        if self.absorbance_milli.iter().all(|&v| v == OUTSIDE) {
            return Err(Cause::EmptyDonor(field));
        }
        Ok(())
    }
}

impl LogNormal {
    fn check(&self, path: &str, low: f64, high: f64) -> Result<(), Cause> {
        within(&format!("{path}.median"), self.median, [low, high])?;
        within(&format!("{path}.log_sd"), self.log_sd, [0.0, 3.0])
    }
}

impl Normal {
    fn check(&self, path: &str, low: f64, high: f64) -> Result<(), Cause> {
        within(&format!("{path}.mean"), self.mean, [low, high])?;
        within(&format!("{path}.sd"), self.sd, [0.0, high])
    }
}

fn profile(path: &str, values: &[f64]) -> Result<(), Cause> {
    if values.is_empty() {
        return Err(Cause::EmptyProfile(path.to_owned()));
    }
    values.iter().try_for_each(|value| within(path, *value, [0.0, 100.0]))
}
