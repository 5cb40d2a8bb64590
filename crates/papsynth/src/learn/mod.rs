//! Learns a model from real cells: from outlines and nucleus images to statistics and, optionally, donor textures.
//!
//! This module reads no files: images are slices, outlines are lists of points.

mod chromatin;
mod cytoplasm;
mod nucleus;

use fsd_shape::{CovarianceModel, ShapeModel, ShapeModelParams};

use crate::error::{Error, ErrorKind};
use crate::model::{CellClass, Donor, LogNormal, Model, Normal, Provenance, Shapes};

pub use cytoplasm::{CytoplasmImage, CytoplasmParams, learn_cytoplasm};
use nucleus::NucleusMeasurement;
pub use nucleus::{NucleusImage, Point};

/// Input for learning a class. Properties without material are copied from the base model.
#[derive(Debug, Clone, Copy, Default)]
pub struct Material<'a> {
    /// Images of nuclei, with masks.
    pub nuclei: &'a [NucleusImage],
    /// Outlines of nuclei, px; taken from the masks of `nuclei` if empty.
    pub nucleus_outlines: &'a [Vec<Point>],
    /// Outlines of complete cells, px.
    pub cytoplasm_outlines: &'a [Vec<Point>],
}

/// Whether the model contains textures of real nuclei.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Donors {
    /// The textures of all nuclei become donors: the model contains pixels of real cells.
    Keep,
    /// Only statistics are kept (means, covariances, spectra): the model contains no pixels of real cells.
    NumbersOnly,
}

/// Parameters for learning a class.
#[derive(Debug, Clone)]
pub struct LearnParams {
    /// Name of the class to add or to replace.
    pub class: String,
    /// Class of the base model that supplies all properties without material.
    pub like: String,
    /// Category of the Bethesda system; the category of the base class if empty.
    pub bethesda: String,
    /// Pixel size of the material, µm.
    pub pixel_um: f64,
    /// Source of the material, for the provenance record.
    pub source: String,
    /// Whether the model contains textures of real nuclei.
    pub donors: Donors,
}

/// Harmonics of a cell outline: enough for its corners.
const CYTOPLASM_HARMONICS: usize = 40;
/// Harmonics of a nucleus outline.
const NUCLEUS_HARMONICS: usize = 10;
/// Minimum number of outlines for a covariance.
const MIN_OUTLINES: usize = 3;
/// Significant digits of numbers in a model.
const DIGITS: usize = 5;

/// Learns a class and returns the model with this class.
///
/// # Errors
/// If there is too little material, an image or outline is invalid, or the base model has no class `like`.
pub fn learn(base: &Model, material: &Material, params: &LearnParams) -> Result<Model, Error> {
    learned(base, material, params).map_err(|cause| Error::Learn { class: params.class.clone(), cause })
}

fn learned(base: &Model, material: &Material, params: &LearnParams) -> Result<Model, ErrorKind> {
    if !(params.pixel_um.is_finite() && (0.05..=4.0).contains(&params.pixel_um)) {
        return Err(ErrorKind::PixelSize(params.pixel_um));
    }
    let mut class = base.class(&params.like)?.clone();
    let mut provenance = Vec::new();
    let mut note = |what: &str, count: usize| {
        provenance.push(Provenance {
            class: params.class.clone(),
            what: what.to_owned(),
            count,
            pixel_um: params.pixel_um,
            source: params.source.clone(),
        });
    };
    if !params.bethesda.is_empty() {
        class.bethesda.clone_from(&params.bethesda);
    }
    if !material.cytoplasm_outlines.is_empty() {
        let (shapes, radius) = shapes(material.cytoplasm_outlines, CYTOPLASM_HARMONICS, params.pixel_um, "cell")?;
        class.cytoplasm.shapes = shapes;
        class.cytoplasm.radius_um = radius;
        note("outlines of cells", material.cytoplasm_outlines.len());
    }
    let measured: Vec<NucleusMeasurement> =
        material.nuclei.iter().map(NucleusImage::measure).collect::<Result<_, _>>()?;
    let traced: Vec<Vec<Point>> = measured.iter().map(|m| m.outline.clone()).collect();
    let outlines = if material.nucleus_outlines.is_empty() { &traced } else { material.nucleus_outlines };
    if !outlines.is_empty() {
        let (shapes, radius) = shapes(outlines, NUCLEUS_HARMONICS, params.pixel_um, "nucleus")?;
        class.nucleus.shapes = shapes;
        class.nucleus.radius_um = radius;
        note("outlines of nuclei", outlines.len());
    }
    if !measured.is_empty() {
        learn_texture(&mut class, &measured, params);
        note("images of nuclei", measured.len());
    }
    let mut model = base.clone();
    model.provenance.retain(|p| p.class != params.class);
    model.provenance.extend(provenance);
    model.classes.insert(params.class.clone(), class);
    model.checked()?;
    Ok(model)
}

/// Returns the outline of a mask as points at equal distances along it.
///
/// # Errors
/// If the mask is empty, has several components, or its size is not a multiple of `width`.
pub fn outline(mask: &[f32], width: usize, points: usize) -> Result<Vec<Point>, ErrorKind> {
    Ok(nucleus::outline(mask, width, points)?)
}

/// Returns the statistics of outlines for both drawing methods, and the distribution of their radius.
fn shapes(
    outlines: &[Vec<Point>],
    harmonics: usize,
    pixel_um: f64,
    what: &'static str,
) -> Result<(Shapes, LogNormal), ErrorKind> {
    if outlines.len() < MIN_OUTLINES {
        return Err(ErrorKind::TooFewOutlines { found: outlines.len(), what, least: MIN_OUTLINES });
    }
    if let Some(index) = outlines.iter().position(|outline| fsd_shape::self_intersects(outline)) {
        return Err(ErrorKind::CrossedOutline(index, what));
    }
    let fit = |covariance: CovarianceModel| {
        let params = ShapeModelParams { harmonics, covariance };
        let model = ShapeModel::fit(outlines, &params);
        model.and_then(|model| model.statistics().rounded(DIGITS)).map_err(|error| ErrorKind::Outlines(what, error))
    };
    let correlated = fit(ShapeModelParams::default().covariance)?;
    let radius = LogNormal {
        median: rounded(libm::exp(correlated.ln_radius_mean) * pixel_um),
        log_sd: rounded(correlated.ln_radius_sd),
    };
    Ok((Shapes { correlated, independent: fit(CovarianceModel::Independent)? }, radius))
}

fn learn_texture(class: &mut CellClass, measured: &[NucleusMeasurement], params: &LearnParams) {
    let nucleus = &mut class.nucleus;
    nucleus.absorbance = normal(measured.iter().map(|m| m.mean));
    let chromatin = &mut nucleus.chromatin;
    chromatin.sd = normal(measured.iter().map(|m| m.sd));
    chromatin.skewness = rounded(normal(measured.iter().map(|m| m.skewness)).mean);
    chromatin.rim_to_centre = nucleus::mean_profile(measured).into_iter().map(rounded).collect();
    let pixels: usize = measured.iter().map(|m| m.absorbance.iter().filter(|a| !a.is_nan()).count()).sum();
    let area_um2 = pixels as f64 / measured.len() as f64 * params.pixel_um * params.pixel_um;
    let (nu, length_um) = chromatin::fit_matern(&chromatin::mean_autocorrelation(measured), params.pixel_um, area_um2);
    chromatin.nu = nu;
    chromatin.length_um = rounded(length_um);
    nucleus.donors = match params.donors {
        Donors::NumbersOnly => Vec::new(),
        Donors::Keep => measured.iter().map(|m| m.donor(params.pixel_um)).collect::<Vec<Donor>>(),
    };
}

fn normal(values: impl Iterator<Item = f64> + Clone) -> Normal {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    let variance = values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / (count - 1.0).max(1.0);
    Normal { mean: rounded(mean), sd: rounded(variance.sqrt()) }
}

/// Rounds a number to the significant digits of a model.
fn rounded(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let decimals = DIGITS as f64 - 1.0 - libm::floor(libm::log10(value.abs()));
    let scale = libm::exp10(decimals);
    libm::round(value * scale) / scale
}
