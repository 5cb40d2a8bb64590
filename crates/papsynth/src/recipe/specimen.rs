//! The sections of a recipe about the cells: slide, layout, cells, cytoplasm, nucleus, stain.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

use super::abundance::Abundance;
use super::conditions::NumberMut;
use super::dyes::DyeAmounts;
use super::number::{Count, Number};
use super::section::{Bounds, Declared, Part, section, within};

section! {
    /// Depth and spacing of the cells. The depth is a median-filtered Perlin image (paper, section "Final Image
    /// Formation").
    pub struct SlideSection {
        /// Difference between the largest and the smallest depth in a field, before `stacking_um`.
        depth_um: Number = Number::uniform(1.0, 4.0), 0..=1000, "µm";
        /// Length scale of the variation of depth: lattice spacing of its Perlin noise.
        depth_scale_um: Number = 90.0, 1..=10000, "µm";
        /// Width of the median filter of the depth.
        depth_filter_um: Number = 20.0, 0..=1000, "µm";
        /// Standard deviation of the random depth of each cell, added to the depth of its position. Separates
        /// overlapping cells.
        stacking_um: Number = 0.6, 0..=100, "µm";
        /// Minimum distance between the centres of cells. Drawn once per field.
        spacing_um: Number = 9.0, 0..=1000, "µm";
        /// Fields per slide. The first n images show slide 0, the next n slide 1. Fields of a slide share its stain.
        fields_per_slide: usize = 16, 1..=1000000;
    }
}

/// Layout of the cells: the weight map of the paper (section "Population Distribution Generation").
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Layout {
    /// Uniform over the field (Eq. 5).
    Uniform {},
    /// Round clusters at random places, and cells outside them.
    Clusters(Clusters),
    /// One band of cells across the field.
    Band(Band),
    /// A grey image, stretched over the field, as the relative density of cells: 0 at black.
    DensityMap {
        /// File of the density map, relative to the recipe.
        path: String,
    },
    /// Cells are placed where a given label image has objects, after smoothing.
    #[serde(deserialize_with = "labels_of_a_file")]
    Labels(Labels),
}

section! {
    /// Round clusters at random places, and cells outside them.
    pub struct Clusters {
        /// Number of clusters. Drawn once per field.
        count: Abundance = Abundance::per_mm2(Number::uniform(55.0, 125.0)), 1..=10000, "per field or per mm²";
        /// Radius (standard deviation) of a cluster. Drawn for each cluster.
        radius_um: Number = Number::uniform(14.0, 34.0), 1..=10000, "µm";
        /// Density outside the clusters, relative to the centre of a cluster.
        outside: Number = Number::uniform(0.03, 0.15), 0..=1;
    }
}

section! {
    /// One band of cells across the field.
    pub struct Band {
        /// Width (standard deviation) of the band.
        width_um: Number = 40.0, 1..=10000, "µm";
        /// Density outside the band, relative to its centre line.
        outside: Number = Number::uniform(0.03, 0.15), 0..=1;
    }
}

section! {
    /// Cells are placed where a given label image has objects, after smoothing.
    #[schemars(extend("required" = ["path"]))]
    pub struct Labels {
        /// File of the label image, relative to the recipe.
        path: String;
        /// Standard deviation of the smoothing of the labels.
        smooth_um: Number = 5.0, 0..=1000, "µm";
    }
}

/// Reads a [`Labels`], whose `path` has no default.
fn labels_of_a_file<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Labels, D::Error> {
    let labels = Labels::deserialize(deserializer)?;
    if labels.path.is_empty() { Err(D::Error::missing_field("path")) } else { Ok(labels) }
}

impl Default for Layout {
    fn default() -> Self {
        Self::Clusters(Clusters::default())
    }
}

impl Part for Layout {
    fn list<'a>(&'a self, path: &str, bounds: Option<Bounds>, found: &mut Vec<Declared<'a>>) {
        match self {
            Self::Uniform {} | Self::DensityMap { .. } => {}
            Self::Clusters(clusters) => clusters.list(path, bounds, found),
            Self::Band(band) => band.list(path, bounds, found),
            Self::Labels(labels) => labels.list(path, bounds, found),
        }
    }

    fn number_mut(&mut self, path: &str) -> Option<NumberMut<'_>> {
        match self {
            Self::Uniform {} | Self::DensityMap { .. } => None,
            Self::Clusters(clusters) => clusters.number_mut(path),
            Self::Band(band) => band.number_mut(path),
            Self::Labels(labels) => labels.number_mut(path),
        }
    }
}

/// Cells of a recipe, by the name of their class in the model.
pub type Cells = BTreeMap<String, CellMix>;

impl Part for Cells {
    fn list<'a>(&'a self, path: &str, bounds: Option<Bounds>, found: &mut Vec<Declared<'a>>) {
        for (class, mix) in self {
            mix.list(&within(path, class), bounds, found);
        }
    }

    fn number_mut(&mut self, path: &str) -> Option<NumberMut<'_>> {
        // The name of a class may contain dots.
        self.iter_mut().find_map(|(class, mix)| mix.number_mut(path.strip_prefix(class)?.strip_prefix('.')?))
    }
}

/// Returns the cells of the default recipe.
pub(super) fn default_cells() -> Cells {
    let cells = [
        ("intermediate", 85.0, 250.0),
        ("superficial", 20.0, 105.0),
        ("parabasal", 0.0, 15.0),
        ("metaplastic", 0.0, 15.0),
    ];
    let mix = |(class, least, most): (&str, f64, f64)| {
        let tints = if class == "superficial" { TintMix::superficial() } else { TintMix::default() };
        (
            class.to_owned(),
            CellMix { count: Abundance::per_mm2(Number::uniform(least, most)), tints, ..CellMix::default() },
        )
    };
    cells.map(mix).into()
}

section! {
    /// Number of cells of a class, and their differences from the model.
    pub struct CellMix {
        /// Number of cells of the class. Drawn once per field.
        count: Abundance = Abundance::per_mm2(110), 0..=100000, "per field or per mm²";
        /// Factor by which the size of the cell is multiplied. Drawn for each cell.
        size: Number = 1.0, 0.1..=10;
        /// Factor by which the size of the nucleus is multiplied, in addition to `size`. Drawn for each cell.
        nucleus_size: Number = 1.0, 0.1..=10;
        /// Factor by which the standard deviation of the logarithm of the sizes of cells and nuclei is multiplied.
        /// Drawn for each cell.
        size_variation: Number = 1.0, 0..=5;
        /// Factor by which the absorbance of the cytoplasm is multiplied. Drawn for each cell.
        cytoplasm_stain: Number = 1.0, 0..=20;
        /// Factor by which the absorbance of the nucleus is multiplied. Drawn for each cell.
        nucleus_stain: Number = 1.0, 0..=20;
        /// Relative frequencies of the tints of the cytoplasm.
        tints: TintMix;
        /// Grouping of the cells.
        group: Group;
    }
}

section! {
    /// Grouping of the cells of a class.
    pub struct Group {
        /// Form of the groups.
        form: GroupForm = GroupForm::Single;
        /// Number of cells of a group. Drawn for each group.
        size: Count = 1, 1..=1000;
        /// Distance between the centres of neighbours, relative to their diameter. Neighbours overlap below 1.
        distance: Number = Number::uniform(0.75, 0.95), 0.2..=3;
    }
}

section! {
    /// Form of a group of cells.
    pub enum GroupForm {
        /// Single cells, placed independently.
        Single,
        /// An irregular aggregate: each cell next to another one.
        Aggregate,
        /// A single layer of adjacent cells, like the honeycomb of endocervical cells.
        Honeycomb,
        /// A row of parallel cells, like the palisade of columnar cells.
        Palisade,
    }
}

section! {
    /// Relative frequencies of the tints of cytoplasm.
    pub struct TintMix {
        /// Relative frequency of blue-green, as seen in parabasal and intermediate cells.
        cyanophilic: Number = 0.85, 0..=1000;
        /// Relative frequency of pink, as seen in superficial cells.
        eosinophilic: Number = 0.15, 0..=1000;
        /// Relative frequency of orange, as seen in keratinised cells.
        orangeophilic: Number = 0.0, 0..=1000;
    }
}

impl TintMix {
    /// Returns the tints of superficial cells.
    #[must_use]
    pub fn superficial() -> Self {
        Self { cyanophilic: 0.25.into(), eosinophilic: 0.65.into(), orangeophilic: 0.1.into() }
    }
}

section! {
    /// Model of the variation of shapes.
    pub enum ShapeSpread {
        /// Aligned descriptors with a shrinkage covariance. Self-intersecting shapes are drawn again.
        Correlated,
        /// The paper's model: independent normal descriptors.
        Independent,
    }
}

section! {
    /// Model of the cytoplasm as a sheet.
    pub enum Sheet {
        /// Extended position-based dynamics with bending, under a cover glass.
        Xpbd,
        /// The paper's model: Verlet integration of every vertex (Eq. 4).
        Verlet,
        /// A flat sheet without folds.
        Flat,
    }
}

section! {
    /// Folds of the cytoplasm.
    pub struct Folds {
        /// Probability of a flap, a part of the cell that is folded back, before multiplication with the pliability of
        /// the cell class.
        flap: Number = 0.15, 0..=1;
        /// Probability of a rolled rim, before multiplication with the pliability of the cell class.
        roll: Number = 0.12, 0..=1;
        /// Probability that both sides of the cell are folded over, before multiplication with the pliability of the
        /// cell class.
        folded_over: Number = 0.02, 0..=1;
        /// Distance of the crease of a flap from the rim, as a fraction of the radius of the cell.
        depth: Number = Number::uniform(0.10, 0.50), 0.02..=0.9;
        /// Curvature of a crease times the radius of the cell, bent to either side: 0 is a straight line.
        curvature: Number = Number::uniform(0.10, 0.60), 0..=2;
        /// Amplitude of the longer of two waves of a crease, as a fraction of the radius of the cell.
        waviness: Number = Number::uniform(0.03, 0.11), 0..=0.5;
        /// Bending radius of a flap. A rolled rim has twice this radius.
        radius_um: Number = Number::uniform(0.4, 1.2), 0.1..=5, "µm";
    }
}

section! {
    /// Cytoplasm of all cells.
    pub struct Cytoplasm, drawn from rng as pub CellDetail {
        /// Model of the variation of outlines.
        shape: ShapeSpread (undrawn) = ShapeSpread::Correlated;
        /// Model of the cytoplasm as a sheet.
        sheet: Sheet (undrawn) = Sheet::Xpbd;
        /// Area of the flat sheet, relative to the area of the cell. Larger values give more wrinkles.
        excess_area: Number (given f64) = Number::uniform(1.0, 1.06), 1..=2;
        /// Folds of the cytoplasm.
        folds: Folds (undrawn);
        /// Angularity of the outline: 0 is smooth, 1 a polygon.
        angularity: Number (given f64) = Number::uniform(0.10, 0.60), 0..=1;
        /// Length of a cell relative to its width, in addition to the shape of its class: the cell is stretched along
        /// its long axis and keeps its area.
        elongation: Number (given f64) = 1.0, 0.2..=5;
        /// Number of notches of the rim.
        notches: Number (given usize) = Number::log_normal(2.5, 0.9).at_most(14.0), 0..=20;
        /// Number of protrusions of the rim.
        protrusions: Number (given usize) = Number::log_normal(1.5, 0.9).at_most(9.0), 0..=20;
        /// Largest additional thickness of narrow ridges, up to 1.4 µm wide, relative to the flat sheet. Ridges rise
        /// where the sheet stands up along its rim or a fold. 100 means no limit, as in the paper.
        ridges: Number (given f64) = 0.25, 0..=100;
        /// Number of wrinkles: ridges, pleats and bundles of fine ridges. An eighth of them are rolled stretches of the
        /// rim. A quarter to a third are bundles, whose ridges have a width of 0.25 to 0.5 µm.
        wrinkles: Number (given usize) = Number::log_normal(20.0, 0.6).at_most(80.0), 0..=100;
        /// Additional thickness at the crest of a wrinkle, relative to the flat sheet. Rolled stretches of the rim have
        /// 0.4 to 1.6 times this thickness. Ridges narrower than 0.6 µm are thinner in proportion to their width.
        wrinkle_thickness: Number (given f64) = Number::log_normal(0.34, 0.6).at_most(1.3), 0..=5;
        /// Width of a wrinkle: standard deviation of its profile. Rolled stretches of the rim have 0.4 to 0.9 µm.
        wrinkle_um: Number (given f64) = Number::uniform(0.25, 0.8), 0.05..=5, "µm";
        /// Additional thickness of the inner cytoplasm, relative to the rest: 1.4 times this number.
        endoplasm: Number (given f64) = Number::log_normal(0.3, 0.9).at_most(1.4), 0..=2;
        /// Amplitude of the first level of detail, low-frequency noise, relative to the absorbance of the cytoplasm.
        /// Dark places are smaller and stronger than pale ones.
        clouds: Number = Number::log_normal(0.11, 0.5).at_most(0.4), 0..=2;
        /// Standard deviation of the smoothing of that noise: three noise fields with 2.4, 1.2 and 0.6 times this
        /// number, each stretched about along the streaks of the fine texture.
        clouds_um: Number = Number::log_normal(2.5, 0.6).at_least(0.7).at_most(14.0), 0.1..=100, "µm";
        /// Length of the clouds relative to their width, with the same area; 1 for round clouds.
        clouds_stretch: Number = Number::log_normal(2.0, 0.5).at_least(1.0).at_most(4.0), 1..=20;
        /// Amplitude of the second level of detail, relative to the absorbance of the cytoplasm: spots, made by
        /// thresholding Brownian noise.
        flecks: Number = Number::log_normal(0.02, 0.5).at_least(0.0).at_most(0.5), 0..=5;
        /// Quantile of the Brownian noise at which it is thresholded: the fraction of the cell without spots.
        flecks_threshold: Number = Number::uniform(0.55, 0.85), 0..=0.999;
        /// Amplitude of the third level of detail, the cytoskeleton, relative to the absorbance of the cytoplasm.
        cytoskeleton: Number = Number::uniform(0.05, 0.18), 0..=2;
        /// Factor on the strength of the fine texture of the cytoplasm in the model: grains, networks and fibres.
        /// Matched to the 24 fields of Cervix93, which are EDF images, it is 0.43 to 1.04, with a median of 0.61.
        /// Without their blur, grains of this strength look too even, so that the default is lower.
        texture: Number
            (given [f64; 2] as texture: "Standard deviation of the fine texture of the outer and of the inner cytoplasm, relative to their absorbance.")
            = 0.47, 0..=20;
        /// Factor on the sizes of the fine texture of the cytoplasm. Its strength stays the same.
        texture_size: Number (given f64) = Number::log_normal(0.94, 0.2).at_least(0.4).at_most(2.5), 0.2..=5;
        /// Probability that a cell is granular.
        granular: Number (undrawn) = 0.14, 0..=1;
        /// Number of granules of a granular cell per 100 µm².
        granules: Number
            (given f64 as granules: "Number of granules per 100 µm², 0 if the cell is not granular.") = Number::log_normal(12.0, 0.6), 0..=1000;
        /// Number of specks per 100 µm²: dark dots and short rods, such as granules, or bacteria on the cell.
        specks: Number = Number::log_normal(1.5, 0.9).at_most(15.0), 0..=1000;
        /// Degeneration: dark granular material at the rim and in patches, and a frayed rim. For a
        /// degeneration s, the absorbance of the material relative to the cytoplasm is s/(1 + s). From s = 1, material
        /// covers the cell.
        degeneration: Number (given f64) = 0.0, 0..=5;
        /// Amplitude of the irregularity of the outline.
        fray_um: Number = Number::log_normal(0.65, 0.45), 0..=5, "µm";
        /// Width of the marginal zone in which the sheet becomes thinner. The thickness increases exponentially with
        /// the distance from the rim: at this distance, it is 86 % of that far from the rim. Parts of the rim slope
        /// over another 8 µm; not with 0.
        rim_um: Number (given f64) = Number::log_normal(2.2, 0.36), 0..=10, "µm";
        /// Gradient of the thickness of the sheet: standard deviation of the relative change over the radius of the
        /// cell.
        thickness_gradient: Number
            (given [f64; 2] as thickness_gradient: "Relative change of the thickness over a radius to the right and downwards.")
            = 0.22, 0..=1;
        /// Phase delay of the flat sheet; elsewhere proportional to the thickness. Causes a bright or dark rim that
        /// reverses between the two sides of focus.
        phase_rad: Number (undrawn) = Number::uniform(0.05, 0.15), -3..=3, "radians of phase";
    }
}

section! {
    /// Source of the texture of nuclei.
    pub enum Chromatin {
        /// Quilted from patches of donors: learned nuclei of the model, or textures made from its spectrum.
        Quilt,
        /// A new random field with the spectrum of the model for each nucleus.
        Field,
    }
}

section! {
    /// Selection of the patches of the donors (paper, section "Texture synthesis").
    pub enum Acceptance {
        /// A random one of the patches whose overlap differs by at most 10 % more than that of the best patch.
        Near,
        /// The paper's method: the first random patch whose overlap differs by less than `d_max`.
        Threshold,
    }
}

section! {
    /// Seams between patches.
    pub enum Seam {
        /// Along the path of minimum difference.
        MinCut,
        /// The paper's method: blended, weighted by the distance to the edges of the patches.
        Feather,
    }
}

section! {
    /// Restoration of nuclei whose donors are images (Eqs. 15, 16).
    pub enum Restore {
        /// The transmitted light is restored before detection. The nuclei are not blurred twice, and have the noise of
        /// their donors and of the camera.
        BeforeDetection,
        /// The paper's method: the image is restored after detection. The nuclei have the noise of their donors only.
        AfterDetection,
        /// No restoration.
        Off,
    }
}

section! {
    /// Nuclei of all cells.
    pub struct Nucleus {
        /// Model of the variation of outlines.
        shape: ShapeSpread = ShapeSpread::Correlated;
        /// Source of the texture.
        chromatin: Chromatin = Chromatin::Quilt;
        /// Number of donors of a nucleus (the paper: 3).
        donors: Count = 3, 1..=64;
        /// Size of a patch (the released value: 7 px of 0.25 µm).
        patch_um: Number = 1.75, 0.5..=20, "µm";
        /// Overlap of patches (the released value: 2 px of 0.25 µm).
        overlap_um: Number = 0.5, 0.25..=10, "µm";
        /// Selection of the patches.
        acceptance: Acceptance = Acceptance::Near;
        /// Only for `acceptance = "threshold"`: largest accepted root-mean-square difference of the absorbance over the
        /// overlap (d_max of the paper).
        d_max: Number = 0.1, 0..=10;
        /// Seams between patches.
        seam: Seam = Seam::MinCut;
        /// Restoration of nuclei whose donors are images.
        restore: Restore = Restore::BeforeDetection;
        /// Standard deviation of the feathered mask of the restoration.
        restore_feather_um: Number = 0.3, 0..=5, "µm";
        /// Probability that a nucleus is pyknotic: small, dark, without structure.
        pyknotic: Number = 0.05, 0..=1;
        /// Probability that a nucleus is wrinkled: round bulges with narrow notches between them.
        wrinkled: Number = 0.15, 0..=1;
        /// Absorbance of the rim (the nuclear membrane) relative to the nucleus.
        rim: Number = Number::uniform(0.0, 0.2), 0..=2;
        /// Fraction of the thickness of a nucleus that is domed: 0 is a plate, 1 an ellipsoid.
        dome: Number = Number::uniform(0.3, 0.85), 0..=1;
        /// Gradient of the thickness of a nucleus: standard deviation of the relative change over its radius.
        thickness_gradient: Number = 0.2, 0..=1;
        /// Fraction of the variance of the chromatin at a scale of 1.5 µm. Models chromatin above and below the plane
        /// in focus.
        clumping: Number = Number::uniform(0.0, 0.4), 0..=1;
        /// Softness of the edge of a nucleus: standard deviation of the falloff of its thickness at the outline.
        edge_um: Number = Number::uniform(0.0, 0.2), 0..=3, "µm";
        /// Fraction of the cytoplasm of a cell that its nucleus displaces. The mean contrast of nuclei does not depend
        /// on it, but nuclei in thick cytoplasm are fainter.
        displacement: Number = 0.45, 0..=1;
    }
}

section! {
    /// Stain: its strength, its variation and its dyes.
    pub struct Stain {
        /// Factor by which the absorbance of the cytoplasm of a slide is multiplied. Drawn once per slide.
        slide_cytoplasm: Number = Number::log_normal(0.75, 0.2), 0..=20;
        /// Factor by which the absorbance of the nuclei of a slide is multiplied. Drawn once per slide.
        slide_nucleus: Number = Number::log_normal(0.75, 0.25), 0..=20;
        /// Factor by which the absorbance of the cytoplasm of a field is multiplied. Drawn once per field.
        field_cytoplasm: Number = Number::log_normal(1.0, 0.2), 0..=20;
        /// Factor by which the absorbance of the nuclei of a field is multiplied. Drawn once per field.
        field_nucleus: Number = Number::log_normal(1.0, 0.12), 0..=20;
        /// Factor by which the contrast of the texture of the nuclei of a field is multiplied. Drawn once per field.
        field_texture: Number = Number::log_normal(0.7, 0.28), 0..=20;
        /// Factor by which the standard deviation of the absorbance of cytoplasm between the cells of a class is
        /// multiplied. Drawn once per field.
        cytoplasm_variation: Number = 1.0, 0..=5;
        /// Factor by which the standard deviations of absorbance and texture between the nuclei of a class are
        /// multiplied. Drawn once per field.
        nucleus_variation: Number = 1.0, 0..=5;
        /// Factor by which the standard deviations of the strength of the fine texture of cytoplasm, between cells and
        /// between fields, are multiplied. Drawn once per field. The outer and the inner cytoplasm of a cell have a
        /// strength each. Between fields, half of the deviation of the model counts.
        texture_variation: Number = 1.1, 0..=5;
        /// Variation of the dye balance between slides: standard deviation of the logarithm of each dye's amount.
        slide_balance: Number = 0.15, 0..=2;
        /// Variation of the dye balance between the fields of a slide, as `slide_balance`.
        field_balance: Number = 0.05, 0..=2;
        /// Variation of the dye balance between the cells of a field, as `slide_balance`.
        cell_balance: Number = 0.12, 0..=2;
        /// Dyes of cyanophilic cytoplasm.
        cyanophilic: DyeAmounts = DyeAmounts { light_green: 2.68, eosin_y: 0.3, orange_g: 0.5, ..DyeAmounts::none() };
        /// Dyes of eosinophilic cytoplasm.
        eosinophilic: DyeAmounts = DyeAmounts { eosin_y: 2.6, orange_g: 0.8, light_green: 0.4, ..DyeAmounts::none() };
        /// Dyes of orangeophilic, keratinised cytoplasm.
        orangeophilic: DyeAmounts = DyeAmounts { orange_g: 4.5, eosin_y: 1.2, light_green: 0.2, ..DyeAmounts::none() };
        /// Dyes of nuclei, including those of leukocytes.
        nucleus: DyeAmounts = DyeAmounts { haematein: 1.0, eosin_y: 0.1, light_green: 0.05, ..DyeAmounts::none() };
        /// Dyes of bacteria.
        bacillus: DyeAmounts = DyeAmounts { haematein: 0.6, light_green: 1.15, ..DyeAmounts::none() };
        /// Dyes of specks.
        speckle: DyeAmounts = DyeAmounts { neutral: 1.0, ..DyeAmounts::none() };
    }
}
