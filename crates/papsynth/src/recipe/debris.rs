//! The section of a recipe about everything that is no epithelial cell ("Debris Object Generation").

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Number;

/// Everything that is no epithelial cell.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Debris {
    /// White blood cells, in clusters.
    pub leukocytes: Leukocytes,
    /// Rod-shaped bacteria, in clusters, on cells and between them.
    pub bacilli: Bacilli,
    /// Specks of dust and stain, anywhere.
    pub speckles: Speckles,
    /// Objects far outside the depth of the slide.
    pub out_of_focus: OutOfFocus,
}

/// How the nucleus of a leukocyte is shaped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NucleusForm {
    /// Two to four lobes, as neutrophils have.
    Lobed,
    /// The paper's: one perturbed circle (Eq. 7).
    Round,
}

/// White blood cells ("White blood cells", Eqs. 6, 7, Fig. 9).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Leukocytes {
    /// Number of clusters, 0 to 100000; drawn once a field.
    pub clusters: Number,
    /// Leukocytes of a cluster, 1 to 10000.
    pub per_cluster: Number,
    /// Radius (standard deviation) of a cluster, µm, 0 to 1000.
    pub cluster_um: Number,
    /// Share of the clusters that lie on a cell, 0 to 1.
    pub on_cells: Number,
    /// How the nucleus is shaped.
    pub form: NucleusForm,
    /// Radius of a leukocyte's nucleus, µm, 0.3 to 20 (s of Eq. 7).
    pub radius_um: Number,
    /// Range of the radial perturbation, 0 to 0.5 (α of Eq. 7).
    pub alpha: Number,
    /// Range of the angular perturbation, radians, 0 to 0.5 (β of Eq. 7).
    pub beta: Number,
    /// Absorbance, 0 to 4.
    pub absorbance: Number,
    /// Absorbance of the pale cytoplasm round the nucleus, 0 to 4.
    pub halo: Number,
}

impl Default for Leukocytes {
    fn default() -> Self {
        Self {
            clusters: Number::uniform(1.0, 9.0),
            per_cluster: Number::log_normal(2.2, 0.7).at_least(1.0),
            cluster_um: Number::uniform(2.5, 6.0),
            on_cells: 0.5.into(),
            form: NucleusForm::Lobed,
            radius_um: Number::normal(2.6, 0.25),
            alpha: 0.10.into(),
            beta: 0.10.into(),
            absorbance: Number::normal(0.42, 0.07),
            halo: Number::uniform(0.0, 0.12),
        }
    }
}

/// Rod-shaped bacteria ("Bacilli").
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Bacilli {
    /// Number of clusters, 0 to 100000; drawn once a field.
    pub clusters: Number,
    /// Bacilli of a cluster, 1 to 10000.
    pub per_cluster: Number,
    /// Radius (standard deviation) of a cluster, µm, 0 to 1000.
    pub cluster_um: Number,
    /// Share of the clusters that lie on a cell, 0 to 1.
    pub on_cells: Number,
    /// Length of a bacillus, µm, 0.3 to 50.
    pub length_um: Number,
    /// Width of a bacillus, µm, 0.1 to 5.
    pub width_um: Number,
    /// Bend of a bacillus, degrees between its ends, 0 to 120.
    pub bend_deg: Number,
    /// Absorbance, 0 to 4.
    pub absorbance: Number,
    /// How late light comes through a bacillus, radians of phase, -3 to 3; seen by bright-field optics alone.
    pub phase_rad: Number,
}

impl Default for Bacilli {
    fn default() -> Self {
        Self {
            clusters: Number::uniform(2.0, 14.0),
            per_cluster: Number::log_normal(12.0, 0.8).at_least(1.0),
            cluster_um: Number::uniform(6.0, 22.0),
            on_cells: 0.75.into(),
            length_um: Number::log_normal(2.4, 0.35),
            width_um: Number::normal(0.55, 0.06),
            bend_deg: Number::uniform(0.0, 30.0),
            absorbance: Number::normal(0.16, 0.03),
            phase_rad: Number::uniform(0.1, 0.25),
        }
    }
}

/// How a speck is grown from its two pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SpeckForm {
    /// Round, whatever the pixels.
    Round,
    /// The paper's: dilated by a cross of pixels, which makes diamonds.
    Dilated,
}

/// Specks of dust and stain ("Speckles").
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Speckles {
    /// Number of speckles, 0 to 1000000; drawn once a field.
    pub count: Number,
    /// How it is grown from its two pixels.
    pub form: SpeckForm,
    /// How often a speckle is grown by a pixel to all sides (binary dilation), 0 to 50.
    pub dilations: Number,
    /// Absorbance, 0 to 4.
    pub absorbance: Number,
    /// How late light comes through a speck, radians of phase, -3 to 3: the halo that changes sign with focus. Seen by
    /// bright-field optics alone.
    pub phase_rad: Number,
}

impl Default for Speckles {
    fn default() -> Self {
        Self {
            count: Number::uniform(40.0, 160.0),
            form: SpeckForm::Round,
            dilations: Number::log_normal(0.35, 0.9),
            absorbance: Number::log_normal(0.07, 0.5),
            phase_rad: Number::normal(0.25, 0.15),
        }
    }
}

/// Objects far outside the depth of the slide ("Out of focus objects").
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OutOfFocus {
    /// Number of objects, 0 to 100000; drawn once a field.
    pub count: Number,
    /// Radius, µm, 0.3 to 500 (s of Eq. 7).
    pub radius_um: Number,
    /// Range of the radial perturbation, 0 to 0.5 (α of Eq. 7).
    pub alpha: Number,
    /// Range of the angular perturbation, radians, 0 to 0.5 (β of Eq. 7).
    pub beta: Number,
    /// Distance from the middle of the slide, µm, 0 to 1000, above or below it.
    pub depth_um: Number,
    /// Absorbance, 0 to 4.
    pub absorbance: Number,
}

impl Default for OutOfFocus {
    fn default() -> Self {
        Self {
            count: Number::uniform(0.0, 3.0),
            radius_um: Number::log_normal(9.0, 0.5),
            alpha: 0.15.into(),
            beta: 0.2.into(),
            depth_um: Number::uniform(14.0, 40.0),
            absorbance: Number::uniform(0.04, 0.16),
        }
    }
}
