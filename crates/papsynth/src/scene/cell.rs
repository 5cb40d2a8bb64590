//! An epithelial cell of a scene, its numbers drawn.

use dye_spectra::Amounts;
use serde::{Deserialize, Serialize};

pub use crate::recipe::specimen::CellDetail;
use crate::words::words;

/// An epithelial cell, its numbers drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellBody {
    /// Class in the model.
    pub class: String,
    /// Radius of the cell (of the circle of its first descriptor), µm.
    pub radius_um: f64,
    /// Mean absorbance of its cytoplasm: the strength of its stain.
    pub cytoplasm_absorbance: f64,
    /// The tint of its cytoplasm.
    pub tint: Tint,
    /// Dyes of its cytoplasm where it is stained with strength 1.
    pub dyes: Amounts,
    /// How late light comes through its flat sheet, radians.
    pub phase_rad: f64,
    /// Strengths of the cytoplasm's detail.
    pub detail: CellDetail,
    /// The cleared space round its nucleus.
    pub halo: Option<Halo>,
    /// The part that lies doubled back.
    pub fold: Option<Fold>,
    /// Its nucleus.
    pub nucleus: NucleusBody,
}

impl CellBody {
    /// How far it may reach from its middle, µm.
    pub(crate) fn reach_um(&self) -> f64 {
        /// In radii; of cells of the default model hardly one in a thousand reaches 1.75.
        const REACH: f64 = 1.9;
        REACH * self.radius_um
    }
}

/// The cleared space round the nucleus of a koilocyte.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Halo {
    /// Its radius, µm.
    pub radius_um: f64,
    /// Share of the cytoplasm that is missing there.
    pub clearing: f64,
    /// How much denser the cytoplasm is at its edge.
    pub rim: f64,
}

/// A part of a cell that lies doubled back on it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fold {
    /// What becomes of the part beyond the crease.
    pub form: FoldForm,
    /// Direction from the cell's middle to the crease, degrees.
    pub direction_deg: f64,
    /// Distance of the crease from the rim, as a fraction of the radius.
    pub depth: f64,
    /// Radius of the bend, µm.
    pub radius_um: f64,
}

/// What becomes of the part of a cell beyond a crease.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FoldForm {
    /// It lies flat on the cell.
    Flap,
    /// It is rolled up.
    Roll,
    /// Both sides are folded to the middle.
    FoldedOver,
}

/// The nucleus of a cell, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NucleusBody {
    /// Radius (of the circle of its first descriptor), µm.
    pub radius_um: f64,
    /// Where it lies, as a fraction of the cell's radius from its middle.
    pub off_centre: [f64; 2],
    /// Direction of its long axis against the cell's, degrees.
    pub rotation_deg: f64,
    /// Mean absorbance above the cytoplasm: the strength of its stain.
    pub absorbance: f64,
    /// Its dyes where it is stained with strength 1.
    pub dyes: Amounts,
    /// Standard deviation of the absorbance inside.
    pub texture: f64,
    /// Absorbance of the rim relative to the nucleus.
    pub rim: f64,
    /// Share of its thickness that is domed: 0 of a plate, 1 of an ellipsoid.
    pub dome: f64,
    /// Standard deviation of the fall of its thickness about its outline, µm.
    pub edge_um: f64,
    /// Part of the variance of its chromatin that is coarse.
    pub clumping: f64,
    /// How much thicker it is at its rim than in its middle, to the right and below.
    pub thickness_gradient: [f64; 2],
    /// Small, dark, without structure.
    pub pyknotic: bool,
    /// Strength of wrinkles, 0 if it has none.
    pub wrinkle: f64,
    /// Nucleoli.
    pub nucleoli: usize,
}

words! {
    /// The tint that a cytoplasm has taken.
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
