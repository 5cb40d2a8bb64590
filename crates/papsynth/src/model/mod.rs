//! Models: statistics of real cells.
//!
//! A model contains the shapes, sizes, absorbances and chromatin of each class of cells. It is one versioned JSON file
//! with the provenance of its data. The built-in model contains only statistics (means, covariances, spectra); a
//! learned model may also contain donors, which are pixels of real nuclei.

mod class_file;

use std::collections::BTreeMap;

use fsd_shape::ShapeStatistics;
use serde::{Deserialize, Serialize};

use crate::error::{Error, ErrorKind, within};
use crate::recipe::CellMix;

/// Version of the model format that this crate reads and writes.
pub const MODEL_VERSION: u32 = 1;

/// A model: statistics of each class of cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Version of the file format.
    pub version: u32,
    /// Sources of the model, newest last.
    pub provenance: Vec<Provenance>,
    /// Classes of cells by name.
    pub classes: BTreeMap<String, CellClass>,
    /// Texture of the cytoplasm of all classes; that of the built-in model if missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cytoplasm_texture: Option<CytoplasmTexture>,
}

/// Texture of cytoplasm: the relative deviation of the absorbance from its local mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CytoplasmTexture {
    /// Pixel size of the statistics, µm.
    pub pixel_um: f64,
    /// Standard deviation between fields of the logarithm of the strength, on small areas. A scene uses half of it
    /// times `stain.texture_variation`.
    pub field_log_sd: f64,
    /// Probability that a cell has the kind that its field has drawn, instead of a kind of its own.
    #[serde(default)]
    pub field_kind: f64,
    /// Kinds of texture.
    pub kinds: Vec<TextureKind>,
}

/// A kind of texture of cytoplasm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextureKind {
    /// Name: "granular", "fibrillar", …
    pub name: String,
    /// Relative frequency.
    pub weight: f64,
    /// Standard deviation of the texture relative to the absorbance of the cytoplasm, and its variation in a field.
    pub strength: LogNormal,
    /// Standard deviations of octaves in the object relative to the strength, from fine to coarse: the high-pass
    /// residual, each scale, the low-pass residual.
    pub octaves: Vec<f64>,
    /// Joint statistics of a steerable pyramid, as imaged.
    pub statistics: steerable_texture::Statistics,
}

/// One data source of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Class that was learned.
    pub class: String,
    /// Type of data: "outlines of cells", "images of nuclei", …
    pub what: String,
    /// Number of outlines or images.
    pub count: usize,
    /// Pixel size, µm.
    pub pixel_um: f64,
    /// Origin of the data.
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

/// Statistics of one class of cells.
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

/// Statistics of the cytoplasm of a class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CytoplasmStatistics {
    /// Radius of the circle of the first Fourier descriptor, |u₁|, µm: a median of 0.5 to 100 µm, and a standard
    /// deviation of the logarithm of 0 to 1. Drawn radii are at most 300 µm.
    pub radius_um: LogNormal,
    /// Median absorbance of a cell without its endoplasm.
    pub absorbance: LogNormal,
    /// Thickness from rim to centre in equal steps, relative to its median.
    pub rim_to_centre: Vec<f64>,
    /// Changes to the learned outlines.
    #[serde(default, skip_serializing_if = "OutlineForm::is_default")]
    pub form: OutlineForm,
    /// Factor on the recipe's folds, wrinkles and angularity, 0 (a rounded, firm cell) to 1 (a thin sheet).
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub pliability: f64,
    /// The cleared space around the nucleus, if the class has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub halo: Option<HaloStatistics>,
    /// Outlines.
    pub shapes: Shapes,
}

/// Changes to learned outlines.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OutlineForm {
    /// Elongation |u₋₁|/|u₁| that replaces the learned one, 0 (round) to 0.9: an ellipse with half axes 1 ± this value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elongation: Option<Normal>,
    /// Difference in width between the two ends, −0.3 to 0.3.
    #[serde(skip_serializing_if = "is_zero")]
    pub taper: f64,
    /// Factor on all other descriptors of the outline, 0 (a smooth oval) to 3.
    #[serde(skip_serializing_if = "is_one")]
    pub unevenness: f64,
    /// Spread of a factor on all descriptors but the radius, as the standard deviation of its logarithm, 0 to 1: some
    /// outlines are rounder and some more uneven than a normal distribution gives. The learned variances stay, except
    /// that it raises no elongation above 0.45: an ellipse 2.6 times as long as wide.
    #[serde(skip_serializing_if = "is_zero")]
    pub variation: f64,
}

impl Default for OutlineForm {
    fn default() -> Self {
        Self { elongation: None, taper: 0.0, unevenness: 1.0, variation: 0.0 }
    }
}

impl OutlineForm {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }

    fn check(&self, path: &str) -> Result<(), ErrorKind> {
        if let Some(elongation) = &self.elongation {
            elongation.check(&format!("{path}.elongation"), 0.0, 0.9)?;
        }
        within(&format!("{path}.taper"), self.taper, [-0.3, 0.3])?;
        within(&format!("{path}.unevenness"), self.unevenness, [0.0, 3.0])?;
        within(&format!("{path}.variation"), self.variation, [0.0, 1.0])
    }
}

/// Statistics of the cleared space around the nucleus of a koilocyte.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HaloStatistics {
    /// Probability that a cell has a halo.
    pub probability: f64,
    /// Radius relative to the radius of the nucleus.
    pub radius: LogNormal,
    /// Fraction of the cytoplasm that is missing in the halo, 0 to 1.
    pub clearing: Normal,
    /// Relative increase of density at its edge.
    pub rim: Normal,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde requires a reference")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn one() -> f64 {
    1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde requires a reference")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

/// Statistics of the nucleus of a class.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NucleusStatistics {
    /// Radius of the circle of the first Fourier descriptor, |u₁|, µm: a median of 0.2 to 50 µm, and a standard
    /// deviation of the logarithm of 0 to 1.
    pub radius_um: LogNormal,
    /// Correlation of the log radii of nucleus and cell, −1 to 1.
    pub size_correlation: f64,
    /// Distance between the centres of nucleus and cell, as a fraction of the cell radius.
    pub off_centre: Normal,
    /// Tendency to lie towards one end of the cell, as in columnar cells: 0 (any direction) to 1.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub polarity: f64,
    /// Mean absorbance of a nucleus, above that of the cytoplasm.
    pub absorbance: Normal,
    /// Changes to the learned outlines.
    #[serde(default, skip_serializing_if = "OutlineForm::is_default")]
    pub form: OutlineForm,
    /// Mean number of nucleoli.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub nucleoli: f64,
    /// Chromatin.
    pub chromatin: ChromatinStatistics,
    /// Outlines.
    pub shapes: Shapes,
    /// Textures for patches; empty in a model without pixels, for which donors are synthesised from the spectrum.
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
    /// Absorbance from rim to centre in equal steps, relative to its mean.
    pub rim_to_centre: Vec<f64>,
}

/// Statistics of a population of outlines, for both drawing methods.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shapes {
    /// Aligned outlines with correlated descriptors.
    pub correlated: ShapeStatistics,
    /// The paper's method: independent descriptors.
    pub independent: ShapeStatistics,
}

/// A texture that supplies patches.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Donor {
    /// Pixel size, µm.
    pub pixel_um: f64,
    /// Columns.
    pub width: usize,
    /// Absorbance relative to the surroundings, in thousandths, row by row; −32768 outside the nucleus.
    pub absorbance_milli: Vec<i16>,
}

/// Value of donor pixels outside the nucleus.
pub const OUTSIDE: i16 = i16::MIN;

impl Model {
    /// Parses a model from JSON.
    ///
    /// # Errors
    /// If the text is not a model, has another version, or contains an invalid number.
    pub fn from_json(text: &str) -> Result<Self, Error> {
        #[derive(Deserialize)]
        struct Version {
            version: u32,
        }
        let read = || {
            let model = serde_json::from_str::<Self>(text).map_err(ErrorKind::from);
            // A wrong version explains other errors.
            let found = match &model {
                Ok(model) => model.version,
                Err(_) => serde_json::from_str::<Version>(text).map_err(ErrorKind::NotAModel)?.version,
            };
            if found != MODEL_VERSION {
                return Err(ErrorKind::ModelVersion(found.to_string(), MODEL_VERSION));
            }
            let model = model?;
            model.checked().map(|()| model)
        };
        read().map_err(Error::Model)
    }

    /// Returns the model as JSON.
    ///
    /// # Panics
    /// Never: all fields can be written as JSON.
    #[must_use]
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string(self).expect("every model can be written as JSON");
        text.push('\n');
        text
    }

    /// Validates the model.
    ///
    /// # Errors
    /// The path and value of the first invalid number, and the accepted range.
    pub fn check(&self) -> Result<(), Error> {
        self.checked().map_err(Error::Model)
    }

    pub(crate) fn checked(&self) -> Result<(), ErrorKind> {
        for (name, class) in &self.classes {
            if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_') {
                return Err(ErrorKind::ClassName(name.clone()));
            }
            class.check(&format!("classes.{name}"))?;
        }
        self.cytoplasm_texture.as_ref().map_or(Ok(()), |texture| texture.check("cytoplasm_texture"))
    }

    /// Returns a class by name.
    pub(crate) fn class(&self, name: &str) -> Result<&CellClass, ErrorKind> {
        let known = || self.classes.keys().cloned().collect();
        self.classes.get(name).ok_or_else(|| ErrorKind::UnknownClass(name.to_owned(), known()))
    }
}

impl CytoplasmTexture {
    fn check(&self, path: &str) -> Result<(), ErrorKind> {
        within(&format!("{path}.pixel_um"), self.pixel_um, [0.05, 2.0])?;
        within(&format!("{path}.field_log_sd"), self.field_log_sd, [0.0, 2.0])?;
        within(&format!("{path}.field_kind"), self.field_kind, [0.0, 1.0])?;
        if self.kinds.is_empty() {
            return Err(ErrorKind::NoTexture);
        }
        let mut total = 0.0;
        for (i, kind) in self.kinds.iter().enumerate() {
            let at = |field: &str| format!("{path}.kinds[{i}].{field}");
            total += kind.weight;
            within(&at("weight"), kind.weight, [0.0, 1e6])?;
            kind.strength.check(&at("strength"), 0.0, 2.0)?;
            kind.statistics.check().map_err(ErrorKind::CytoplasmTexture)?;
            let expected = kind.statistics.params.pyramid.scales + 2;
            if kind.octaves.len() != expected {
                return Err(ErrorKind::Octaves { field: at("octaves"), found: kind.octaves.len(), expected });
            }
            kind.octaves.iter().try_for_each(|octave| within(&at("octaves"), *octave, [0.0, 100.0]))?;
        }
        within(&format!("{path}.kinds: the sum of all weights"), total, [1e-6, 1e9])
    }
}

/// Largest radius of a drawn cell, µm. It limits time and memory; cells of smears have up to about 60 µm.
pub(crate) const MAX_RADIUS_UM: f64 = 300.0;

impl CellClass {
    /// Returns the size of cells of a mix relative to those of the built-in classes, for estimates of memory.
    #[must_use]
    pub fn relative_size(&self, mix: &CellMix) -> f64 {
        /// Upper bounds for the built-in classes: of the median, and of 2 standard deviations above it, µm.
        const MEDIAN_UM: f64 = 32.0;
        const LARGE_UM: f64 = 45.0;
        /// Radius of intermediate cells, µm.
        const USUAL_UM: f64 = 26.0;
        let [size, variation] = [&mix.size, &mix.size_variation].map(|number| number.bounds()[1]);
        let LogNormal { median, log_sd } = self.cytoplasm.radius_um;
        let large = median * libm::exp(2.0 * variation * log_sd);
        (size * (median / MEDIAN_UM).max(large / LARGE_UM).max(1.0)).min(MAX_RADIUS_UM / USUAL_UM)
    }

    fn check(&self, path: &str) -> Result<(), ErrorKind> {
        let at = |field: &str| format!("{path}.{field}");
        let (cytoplasm, nucleus) = (&self.cytoplasm, &self.nucleus);
        cytoplasm.radius_um.check_radius(&at("cytoplasm.radius_um"), 0.5, 100.0)?;
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
        nucleus.radius_um.check_radius(&at("nucleus.radius_um"), 0.2, 50.0)?;
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
    fn check(&self, path: &str) -> Result<(), ErrorKind> {
        for (name, statistics) in [("correlated", &self.correlated), ("independent", &self.independent)] {
            let valid = fsd_shape::ShapeModel::from_statistics(statistics.clone());
            valid.map_err(|error| ErrorKind::Shapes(format!("{path}.{name}"), error))?;
        }
        Ok(())
    }
}

impl Donor {
    fn check(&self, field: String) -> Result<(), ErrorKind> {
        /// Maximum width: twice a nucleus of 100 µm with pixels of 0.05 µm.
        const MAX_WIDTH: usize = 4096;
        within(&format!("{field}.pixel_um"), self.pixel_um, [0.05, 4.0])?;
        let pixels = self.absorbance_milli.len();
        if self.width == 0 || self.width > MAX_WIDTH || !pixels.is_multiple_of(self.width) {
            return Err(ErrorKind::DonorSize { field, width: self.width, pixels });
        }
        if self.absorbance_milli.iter().all(|&v| v == OUTSIDE) {
            return Err(ErrorKind::EmptyDonor(field));
        }
        Ok(())
    }
}

impl LogNormal {
    fn check(&self, path: &str, low: f64, high: f64) -> Result<(), ErrorKind> {
        within(&format!("{path}.median"), self.median, [low, high])?;
        within(&format!("{path}.log_sd"), self.log_sd, [0.0, 3.0])
    }

    /// Checks a radius, µm. The time and memory of a cell increase with its area.
    fn check_radius(&self, path: &str, low: f64, high: f64) -> Result<(), ErrorKind> {
        self.check(path, low, high)?;
        within(&format!("{path}.log_sd"), self.log_sd, [0.0, 1.0])
    }
}

impl Normal {
    fn check(&self, path: &str, low: f64, high: f64) -> Result<(), ErrorKind> {
        within(&format!("{path}.mean"), self.mean, [low, high])?;
        within(&format!("{path}.sd"), self.sd, [0.0, high])
    }
}

fn profile(path: &str, values: &[f64]) -> Result<(), ErrorKind> {
    if values.is_empty() {
        return Err(ErrorKind::EmptyProfile(path.to_owned()));
    }
    values.iter().try_for_each(|value| within(path, *value, [0.0, 100.0]))
}
