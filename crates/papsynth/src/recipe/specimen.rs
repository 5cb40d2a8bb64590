//! Sections of a recipe about the cells: slide, layout, cells, cytoplasm, nucleus, stain.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

use super::abundance::Abundance;
use super::dyes::DyeAmounts;
use super::number::{Count, Number};
use super::section::{Bounds, Declared, Part, section, within};

section! {
    /// How deep the cells lie ("Final Image Formation": depth from a median-filtered Perlin image).
    pub struct Slide {
        /// Depth over which the cells of a field lie.
        depth_um: Number = Number::uniform(1.0, 4.0), 0..=1000, "µm";
        /// Size of the cells of the Perlin noise that says how depth varies over the field.
        depth_scale_um: Number = 90.0, 1..=10000, "µm";
        /// Width of the median filter on that noise.
        depth_filter_um: Number = 20.0, 0..=1000, "µm";
        /// Standard deviation of a cell's own depth about the relief: cells that lie on each other.
        stacking_um: Number = 0.6, 0..=100, "µm";
        /// Least distance between the middles of two cells; drawn once a field.
        spacing_um: Number = 9.0, 0..=1000, "µm";
        /// Fields that are taken of one slide: images 0 to n − 1 show the first, the next n the second. Fields of one
        /// slide were stained together.
        fields_per_slide: usize = 16, 1..=1000000;
    }
}

/// Where the cells lie: the weight map of "Population Distribution Generation".
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Layout {
    /// Anywhere, all places equally likely (Eq. 5).
    Uniform {},
    /// Round clusters at random places, and some cells outside them.
    Clusters(Clusters),
    /// A band of material across the image.
    Band(Band),
    /// A grey image that is stretched over the field: white is likely, black never happens.
    DensityMap {
        /// File of the image, relative to the recipe.
        path: String,
    },
    /// The layout of a given label image: as likely as the place is covered by a label there.
    #[serde(deserialize_with = "labels_of_a_file")]
    Labels(Labels),
}

section! {
    /// Round clusters at random places, and some cells outside them.
    pub struct Clusters {
        /// Number of clusters; drawn once a field.
        count: Abundance = Abundance::per_mm2(Number::uniform(55.0, 125.0)), 1..=10000, "per field or per mm²";
        /// Radius (standard deviation) of a cluster; drawn for each cluster.
        radius_um: Number = Number::uniform(14.0, 34.0), 1..=10000, "µm";
        /// Weight of the places outside all clusters, relative to a cluster's centre.
        outside: Number = Number::uniform(0.03, 0.15), 0..=1;
    }
}

section! {
    /// A band of material across the image.
    pub struct Band {
        /// Width (standard deviation) of the band.
        width_um: Number = 40.0, 1..=10000, "µm";
        /// Weight of the places outside the band, relative to its middle.
        outside: Number = Number::uniform(0.03, 0.15), 0..=1;
    }
}

section! {
    /// The layout of a given label image: as likely as the place is covered by a label there.
    #[schemars(extend("required" = ["path"]))]
    pub struct Labels {
        /// File of the label image, relative to the recipe.
        path: String;
        /// Standard deviation of the smoothing of its coverage.
        smooth_um: Number = 5.0, 0..=1000, "µm";
    }
}

/// Reads a [`Labels`], whose file has no default.
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
}

/// The cells of a recipe, by the name of their class in the model.
pub type Cells = BTreeMap<String, CellMix>;

impl Part for Cells {
    fn list<'a>(&'a self, path: &str, bounds: Option<Bounds>, found: &mut Vec<Declared<'a>>) {
        for (class, mix) in self {
            mix.list(&within(path, class), bounds, found);
        }
    }
}

/// The cells of the default slide.
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
    /// How many cells of a class there are, and how they differ from the model's.
    pub struct CellMix {
        /// Number of cells of this class; drawn once a field.
        count: Abundance = Abundance::per_mm2(110), 0..=100000, "per field or per mm²";
        /// Factor on the size of the whole cell; drawn for each cell.
        size: Number = 1.0, 0.1..=10;
        /// Factor on the absorbance of its cytoplasm; drawn for each cell.
        cytoplasm_stain: Number = 1.0, 0..=20;
        /// Factor on the absorbance of its nucleus; drawn for each cell.
        nucleus_stain: Number = 1.0, 0..=20;
        /// How likely its cytoplasm is to take each tint.
        tints: TintMix;
        /// How its cells lie together.
        group: Group;
    }
}

section! {
    /// How cells of a class lie together.
    pub struct Group {
        /// The form of a group.
        form: GroupForm = GroupForm::Single;
        /// Cells of a group; drawn for each group.
        size: Count = 1, 1..=1000;
        /// Distance between the middles of neighbours, relative to their diameter: below 1 they overlap.
        distance: Number = Number::uniform(0.75, 0.95), 0.2..=3;
    }
}

section! {
    /// The form of a group of cells.
    pub enum GroupForm {
        /// Every cell has a place of its own, where the layout lets it lie.
        Single,
        /// An irregular heap, each cell beside one that lies there already.
        Aggregate,
        /// One layer, cell beside cell as in a pavement seen from above: the honeycomb of endocervical cells.
        Honeycomb,
        /// A row of cells side by side, all turned the same way: the palisade of columnar cells.
        Palisade,
    }
}

section! {
    /// How likely each tint of cytoplasm is, relative to the others.
    pub struct TintMix {
        /// Blue-green, as in young and intermediate cells.
        cyanophilic: Number = 0.85, 0..=1000;
        /// Pink, as in superficial cells.
        eosinophilic: Number = 0.15, 0..=1000;
        /// Orange, as in keratinised cells.
        orangeophilic: Number = 0.0, 0..=1000;
    }
}

impl TintMix {
    /// The tints of superficial cells.
    #[must_use]
    pub fn superficial() -> Self {
        Self { cyanophilic: 0.25.into(), eosinophilic: 0.65.into(), orangeophilic: 0.1.into() }
    }
}

section! {
    /// How shapes vary about their mean.
    pub enum ShapeSpread {
        /// Aligned descriptors with a shrinkage covariance; self-intersecting draws are drawn again.
        Correlated,
        /// The paper's: every descriptor an independent normal.
        Independent,
    }
}

section! {
    /// How the cytoplasm becomes a sheet.
    pub enum Sheet {
        /// Extended position-based dynamics with bending, under a cover glass.
        Xpbd,
        /// The paper's: Verlet steps for every vertex (Eq. 4).
        Verlet,
        /// No folds at all.
        Flat,
    }
}

section! {
    /// Parts of a cell that lie doubled back on it.
    pub struct Folds {
        /// Probability that a flap of the cell lies folded back on it.
        flap: Number = 0.38, 0..=1;
        /// Probability that a rim is rolled up.
        roll: Number = 0.18, 0..=1;
        /// Probability that the cell is folded over completely, like a cigar.
        folded_over: Number = 0.02, 0..=1;
        /// How far in from the rim a flap begins, as a fraction of the cell's radius.
        depth: Number = Number::uniform(0.10, 0.50), 0.02..=0.9;
        /// Radius of the bend.
        radius_um: Number = Number::uniform(0.35, 0.8), 0.1..=5, "µm";
    }
}

section! {
    /// The cytoplasm of every cell.
    pub struct Cytoplasm, drawn from rng as pub CellDetail {
        /// How outlines vary about their mean.
        shape: ShapeSpread (undrawn) = ShapeSpread::Correlated;
        /// How the cytoplasm becomes a sheet.
        sheet: Sheet (undrawn) = Sheet::Xpbd;
        /// Area of the flat sheet relative to the cell's: more makes more wrinkles.
        excess_area: Number (given f64) = Number::uniform(1.04, 1.16), 1..=2;
        /// Parts that lie doubled back.
        folds: Folds (undrawn);
        /// How nearly straight the sides of a cell run between its corners: 0 is not at all.
        angularity: Number (given f64) = Number::uniform(0.10, 0.60), 0..=1;
        /// Notches in its rim.
        notches: Number (given usize) = Number::uniform(0.0, 14.0), 0..=20;
        /// Tongues that stand out of its rim.
        protrusions: Number (given usize) = Number::uniform(0.0, 9.0), 0..=20;
        /// Wrinkles of a cell: narrow creases in which the sheet lies doubled.
        wrinkles: Number (given usize) = Number::log_normal(7.0, 0.6), 0..=100;
        /// Thickness that a wrinkle adds at its crest, relative to the flat sheet.
        wrinkle_thickness: Number (given f64) = Number::log_normal(0.42, 0.42), 0..=5;
        /// Width of a wrinkle (standard deviation of its crest).
        wrinkle_um: Number (given f64) = Number::uniform(0.18, 0.5), 0.05..=5, "µm";
        /// How much denser and more granular the cytoplasm is round the nucleus than outside.
        endoplasm: Number (given f64) = Number::log_normal(0.08, 0.6), 0..=2;
        /// First level of detail: strength of low-frequency Gaussian noise, relative to the cytoplasm's absorbance.
        clouds: Number = Number::uniform(0.10, 0.34), 0..=2;
        /// Standard deviation of its smoothing.
        clouds_um: Number = Number::uniform(3.0, 14.0), 0.1..=100, "µm";
        /// Second level of detail: strength of thresholded Brownian flecks, relative to the cytoplasm's absorbance.
        flecks: Number = Number::log_normal(0.14, 0.5).at_least(0.0).at_most(0.5), 0..=5;
        /// Share of the cell that the flecks leave free.
        flecks_threshold: Number = Number::uniform(0.55, 0.85), 0..=0.999;
        /// Third level of detail: strength of the cytoskeleton, relative to the cytoplasm's absorbance.
        cytoskeleton: Number = Number::uniform(0.05, 0.18), 0..=2;
        /// Fine grain of the cytoplasm, relative to its absorbance.
        grain: Number = Number::uniform(0.06, 0.18), 0..=2;
        /// Probability that a cell is peppered with granules.
        granular: Number (undrawn) = 0.2, 0..=1;
        /// Granules of such a cell per 100 µm².
        granules: Number
            (given f64 as granules: "Granules per 100 µm²; 0 if the cell has none.") = Number::log_normal(12.0, 0.6), 0..=1000;
        /// Roughness of the rim: the edge is frayed over about this distance.
        fray_um: Number = Number::log_normal(0.65, 0.45), 0..=5, "µm";
        /// Distance over which the sheet thins out towards its rim.
        rim_um: Number (given f64) = Number::log_normal(2.2, 0.36), 0..=10, "µm";
        /// How much thicker the sheet is towards one side (standard deviation of the slope, relative to its thickness
        /// and the cell's radius).
        thickness_gradient: Number
            (given [f64; 2] as thickness_gradient: "How much thicker to the right and below, relative to its thickness, a radius away.")
            = 0.18, 0..=1;
        /// How late light comes through a flat sheet: thicker parts and folds in proportion. It shows as bright and
        /// dark rims that change places when the focus passes.
        phase_rad: Number (undrawn) = Number::uniform(0.05, 0.15), -3..=3, "radians of phase";
    }
}

section! {
    /// Where the texture of nuclei comes from.
    pub enum Chromatin {
        /// Quilted from patches of donors: real ones where the model has learned some, else made from its spectrum.
        Quilt,
        /// A random field of the model's spectrum, a new one for every nucleus.
        Field,
    }
}

section! {
    /// Which patches of the donors are candidates ("Texture synthesis").
    pub enum Acceptance {
        /// All whose overlap differs by at most a tenth more than that of the best one.
        Near,
        /// The paper's: the first random one whose overlap differs by less than d_max.
        Threshold,
    }
}

section! {
    /// How patches are joined.
    pub enum Seam {
        /// Along the path of least difference.
        MinCut,
        /// The paper's: weighted by the distance to the patches' edges.
        Feather,
    }
}

section! {
    /// What happens to nuclei whose donors were images already (Eqs. 15, 16).
    pub enum Restore {
        /// Transmitted light is restored before detection: such nuclei are not blurred twice, and carry their donors' noise
        /// and the camera's.
        BeforeDetection,
        /// The paper's: restored in the finished image; such nuclei carry their donors' noise alone.
        AfterDetection,
        /// They are imaged like everything else.
        Off,
    }
}

section! {
    /// The nucleus of every cell.
    pub struct Nucleus {
        /// How outlines vary about their mean.
        shape: ShapeSpread = ShapeSpread::Correlated;
        /// Where the texture comes from.
        chromatin: Chromatin = Chromatin::Quilt;
        /// Donors of one nucleus (the paper's: 3).
        donors: Count = 3, 1..=64;
        /// Size of a patch (the released value: 7 px of 0.25 µm).
        patch_um: Number = 1.75, 0.5..=20, "µm";
        /// Overlap of patches (the released value: 2 px of 0.25 µm).
        overlap_um: Number = 0.5, 0.25..=10, "µm";
        /// Which patches are candidates.
        acceptance: Acceptance = Acceptance::Near;
        /// d_max of the paper: root-mean-square difference of absorbance over the overlap.
        d_max: Number = 0.1, 0..=10;
        /// How patches are joined.
        seam: Seam = Seam::MinCut;
        /// What happens to nuclei whose donors were images already.
        restore: Restore = Restore::BeforeDetection;
        /// Spread of the feathered mask of that.
        restore_feather_um: Number = 0.3, 0..=5, "µm";
        /// Probability that a nucleus is pyknotic (small, dark, without structure).
        pyknotic: Number = 0.05, 0..=1;
        /// Probability that a nucleus is wrinkled or angular.
        wrinkled: Number = 0.15, 0..=1;
        /// Absorbance of the rim (the nuclear membrane) relative to the nucleus.
        rim: Number = Number::uniform(0.0, 0.2), 0..=2;
        /// Share of a nucleus's thickness that is domed: 0 is a plate, 1 an ellipsoid.
        dome: Number = Number::uniform(0.3, 0.85), 0..=1;
        /// How much thicker a nucleus is towards one side (standard deviation of the slope, relative to its thickness
        /// and radius).
        thickness_gradient: Number = 0.2, 0..=1;
        /// Part of the variance of chromatin that is coarse, a micrometre and a half wide: what lies above and below
        /// the grains in focus.
        clumping: Number = Number::uniform(0.0, 0.4), 0..=1;
        /// How softly a nucleus ends: standard deviation of the fall of its thickness about its outline.
        edge_um: Number = Number::uniform(0.0, 0.2), 0..=3, "µm";
    }
}

section! {
    /// How evenly the stain was taken up.
    pub struct Stain {
        /// Factor on the absorbance of all cytoplasm of a slide; drawn once a slide.
        slide_cytoplasm: Number = Number::log_normal(0.75, 0.2), 0..=20;
        /// Factor on the absorbance of all nuclei of a slide; drawn once a slide.
        slide_nucleus: Number = Number::log_normal(0.75, 0.25), 0..=20;
        /// Factor on the absorbance of all cytoplasm of a field; drawn once a field.
        field_cytoplasm: Number = Number::log_normal(1.0, 0.2), 0..=20;
        /// Factor on the absorbance of all nuclei of a field; drawn once a field.
        field_nucleus: Number = Number::log_normal(1.0, 0.12), 0..=20;
        /// Factor on the contrast of the texture inside all nuclei of a field; drawn once a field.
        field_texture: Number = Number::log_normal(0.7, 0.28), 0..=20;
        /// Balance of the dyes: standard deviation of the logarithm of each dye's amount between slides.
        slide_balance: Number = 0.15, 0..=2;
        /// The same between the fields of a slide.
        field_balance: Number = 0.05, 0..=2;
        /// The same between the cells of a field.
        cell_balance: Number = 0.12, 0..=2;
        /// Dyes of cyanophilic cytoplasm.
        cyanophilic: DyeAmounts = DyeAmounts { light_green: 2.68, eosin_y: 0.3, orange_g: 0.5, ..DyeAmounts::none() };
        /// Dyes of eosinophilic cytoplasm.
        eosinophilic: DyeAmounts = DyeAmounts { eosin_y: 2.6, orange_g: 0.8, light_green: 0.4, ..DyeAmounts::none() };
        /// Dyes of orangeophilic, keratinised cytoplasm.
        orangeophilic: DyeAmounts = DyeAmounts { orange_g: 4.5, eosin_y: 1.2, light_green: 0.2, ..DyeAmounts::none() };
        /// Dyes of nuclei, also of leukocytes.
        nucleus: DyeAmounts = DyeAmounts { haematein: 1.0, eosin_y: 0.1, light_green: 0.05, ..DyeAmounts::none() };
        /// Dyes of bacteria.
        bacillus: DyeAmounts = DyeAmounts { haematein: 0.6, light_green: 1.15, ..DyeAmounts::none() };
        /// Dyes of specks.
        speckle: DyeAmounts = DyeAmounts { neutral: 1.0, ..DyeAmounts::none() };
    }
}
