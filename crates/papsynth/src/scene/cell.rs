//! An epithelial cell of a scene, with drawn numbers.

use dye_spectra::Amounts;
use serde::{Deserialize, Serialize};

pub use crate::recipe::specimen::CellDetail;
use crate::words::words;

/// An epithelial cell, with drawn numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellBody {
    /// Class in the model.
    pub class: String,
    /// Radius of the cell (of the circle of its first descriptor), µm.
    pub radius_um: f64,
    /// Mean absorbance of the cytoplasm.
    pub cytoplasm_absorbance: f64,
    /// Tint of the cytoplasm.
    pub tint: Tint,
    /// Dyes of the cytoplasm at staining strength 1.
    pub dyes: Amounts,
    /// Phase delay of the flat sheet, radians.
    pub phase_rad: f64,
    /// Detail of the cytoplasm.
    pub detail: CellDetail,
    /// Kinds of fine texture of the outer and of the inner cytoplasm, in the model.
    pub textures: [String; 2],
    /// Cleared space around the nucleus.
    pub halo: Option<Halo>,
    /// Fold.
    pub fold: Option<Fold>,
    /// Nucleus.
    pub nucleus: NucleusBody,
}

impl CellBody {
    /// Returns the maximum radius, µm.
    pub(crate) fn reach_um(&self) -> f64 {
        /// In radii. About one cell of the default model in a thousand exceeds 1.75.
        const REACH: f64 = 1.9;
        let elongation = self.detail.elongation;
        REACH * self.radius_um * elongation.max(1.0 / elongation).sqrt()
    }
}

/// Stretches a displacement along an axis, and shortens it across, so that areas stay the same.
pub(crate) fn stretched([x, y]: [f64; 2], elongation: f64, axis_rad: f64) -> [f64; 2] {
    if elongation == 1.0 {
        return [x, y];
    }
    let (sin, cos, factor) = (libm::sin(axis_rad), libm::cos(axis_rad), elongation.sqrt());
    let [along, across] = [factor * (x * cos + y * sin), (y * cos - x * sin) / factor];
    [along * cos - across * sin, along * sin + across * cos]
}

/// The cleared space around the nucleus of a koilocyte.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Halo {
    /// Radius of a disc of about the same area, µm.
    pub radius_um: f64,
    /// Fraction of the cytoplasm that is missing there.
    pub clearing: f64,
    /// Additional density of the cytoplasm at its edge, relative to the rest: the mean. One side is denser.
    pub rim: f64,
}

/// A fold: a part of a cell folded back on it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fold {
    /// Form of the fold.
    pub form: FoldForm,
    /// Direction from the centre of the cell to the crease, degrees.
    pub direction_deg: f64,
    /// Distance of the crease from the rim, as a fraction of the radius.
    pub depth: f64,
    /// Curvature of the crease times the radius of the cell; a positive one bends towards the rim.
    pub curvature: f64,
    /// Amplitude of the longer of two waves of the crease, as a fraction of the radius of the cell.
    pub waviness: f64,
    /// Bending radius, µm.
    pub radius_um: f64,
}

/// Form of a fold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FoldForm {
    /// A flap, flat on the cell.
    Flap,
    /// A rolled rim.
    Roll,
    /// Both sides folded to the centre.
    FoldedOver,
}

/// The nucleus of a cell, with drawn numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NucleusBody {
    /// Radius (of the circle of its first descriptor), µm.
    pub radius_um: f64,
    /// Place relative to the centre of the cell, as a fraction of the radius of the cell.
    pub off_centre: [f64; 2],
    /// Direction of the long axis relative to that of the cell, degrees.
    pub rotation_deg: f64,
    /// Mean absorbance in addition to the cytoplasm that it does not displace.
    pub absorbance: f64,
    /// Fraction of the cytoplasm of the cell that it displaces.
    pub displacement: f64,
    /// Dyes at staining strength 1.
    pub dyes: Amounts,
    /// Standard deviation of the absorbance.
    pub texture: f64,
    /// Absorbance of the rim relative to the nucleus.
    pub rim: f64,
    /// Fraction of the thickness that is domed: 0 is a plate, 1 an ellipsoid.
    pub dome: f64,
    /// Standard deviation of the falloff of the thickness at the outline, µm.
    pub edge_um: f64,
    /// Fraction of the variance of chromatin that is coarse.
    pub clumping: f64,
    /// Relative change of the thickness over a radius to the right and downwards.
    pub thickness_gradient: [f64; 2],
    /// Whether it is pyknotic: small, dark, without structure.
    pub pyknotic: bool,
    /// Amplitude of wrinkles, 0 if it has none.
    pub wrinkle: f64,
    /// Number of nucleoli.
    pub nucleoli: usize,
}

words! {
    /// Tint of cytoplasm.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Tint {
        /// Blue-green.
        Cyanophilic = "cyanophilic",
        /// Pink.
        Eosinophilic = "eosinophilic",
        /// Orange.
        Orangeophilic = "orangeophilic",
    }
}
