//! Sections of a recipe about the cells: slide, layout, cells, cytoplasm, nucleus, stain.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::number::Number;

/// How deep the cells lie ("Final Image Formation": depth from a median-filtered Perlin image).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Slide {
    /// Depth over which the cells of a field lie, µm, 0 to 1000.
    pub depth_um: Number,
    /// Size of the cells of the Perlin noise that says how depth varies over the field, µm, 1 to 10000.
    pub relief_um: Number,
    /// Width of the median filter on that noise, µm, 0 to 1000.
    pub median_um: Number,
    /// Standard deviation of a cell's own depth about the relief, µm, 0 to 100: cells that lie on each other.
    pub stacking_um: Number,
    /// Least distance between the middles of two cells, µm, 0 to 1000; drawn once a field.
    pub spacing_um: Number,
    /// Fields that are taken of one slide, 1 to 1000000: images 0 to n − 1 show the first, the next n the second. Fields of
    /// one slide were stained together.
    pub fields: usize,
}

impl Default for Slide {
    fn default() -> Self {
        Self {
            depth_um: Number::uniform(1.0, 4.0),
            relief_um: 90.0.into(),
            median_um: 20.0.into(),
            stacking_um: 0.6.into(),
            spacing_um: 9.0.into(),
            fields: 16,
        }
    }
}

/// Where the cells lie: the weight map of "Population Distribution Generation".
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Layout {
    /// Anywhere, all places equally likely (Eq. 5).
    Uniform {},
    /// Round clusters at random places, and some cells outside them.
    Clusters {
        /// Number of clusters, 1 to 10000; drawn once a field.
        #[serde(default = "defaults::clusters")]
        count: Number,
        /// Radius (standard deviation) of a cluster, µm, 1 to 10000; drawn for each cluster.
        #[serde(default = "defaults::radius_um")]
        radius_um: Number,
        /// Weight of the places outside all clusters, relative to a cluster's centre, 0 to 1.
        #[serde(default = "defaults::outside")]
        outside: Number,
    },
    /// A band of material across the image.
    Swath {
        /// Width (standard deviation) of the band, µm, 1 to 10000.
        #[serde(default = "defaults::width_um")]
        width_um: Number,
        /// Weight of the places outside the band, relative to its middle, 0 to 1.
        #[serde(default = "defaults::outside")]
        outside: Number,
    },
    /// A grey image that is stretched over the field: white is likely, black never happens.
    Map {
        /// File of the image, relative to the recipe.
        path: String,
    },
    /// The layout of a given label image: as likely as the place is covered by a label there.
    Labels {
        /// File of the label image, relative to the recipe.
        path: String,
        /// Standard deviation of the smoothing of its coverage, µm, 0 to 1000.
        #[serde(default = "defaults::smooth_um")]
        smooth_um: Number,
    },
}

/// What the fields of a layout are where a recipe names its kind alone.
pub(super) mod defaults {
    use super::super::number::Number;

    pub(crate) fn clusters() -> Number {
        Number::uniform(5.0, 11.0)
    }

    pub(crate) fn radius_um() -> Number {
        Number::uniform(14.0, 34.0)
    }

    pub(crate) fn width_um() -> Number {
        40.0.into()
    }

    pub(crate) fn outside() -> Number {
        Number::uniform(0.03, 0.15)
    }

    pub(crate) fn smooth_um() -> Number {
        5.0.into()
    }
}

/// How many cells of a class there are, and how they differ from the model's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CellMix {
    /// Number of cells of this class, 0 to 100000; drawn once a field.
    pub count: Number,
    /// Factor on the size of the whole cell, 0.1 to 10; drawn for each cell.
    pub size: Number,
    /// Factor on the absorbance of its cytoplasm, 0 to 20; drawn for each cell.
    pub cytoplasm_stain: Number,
    /// Factor on the absorbance of its nucleus, 0 to 20; drawn for each cell.
    pub nucleus_stain: Number,
    /// How likely its cytoplasm is to take each tint.
    pub tints: TintMix,
    /// How its cells lie together.
    pub group: Group,
}

/// How cells of a class lie together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Group {
    /// The form of a group.
    pub form: GroupForm,
    /// Cells of a group, 1 to 1000; drawn for each group.
    pub size: Number,
    /// Distance between the middles of neighbours, relative to their diameter, 0.2 to 3: below 1 they overlap.
    pub distance: Number,
}

impl Default for Group {
    fn default() -> Self {
        Self { form: GroupForm::Alone, size: 1.0.into(), distance: Number::uniform(0.75, 0.95) }
    }
}

impl Group {
    /// A group of a form, of so many cells.
    #[must_use]
    pub fn of(form: GroupForm, size: Number) -> Self {
        Self { form, size, ..Self::default() }
    }
}

/// The form of a group of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GroupForm {
    /// Every cell has a place of its own, where the layout lets it lie.
    Alone,
    /// An irregular heap, each cell beside one that lies there already.
    Heap,
    /// One layer, cell beside cell as in a pavement seen from above: the honeycomb of endocervical cells.
    Honeycomb,
    /// A row of cells side by side, all turned the same way: the palisade of columnar cells.
    Palisade,
}

/// How likely each tint of cytoplasm is, relative to the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TintMix {
    /// Blue-green, as in young and intermediate cells, 0 to 1000.
    pub cyanophilic: Number,
    /// Pink, as in superficial cells, 0 to 1000.
    pub eosinophilic: Number,
    /// Orange, as in keratinised cells, 0 to 1000.
    pub orangeophilic: Number,
}

impl Default for TintMix {
    fn default() -> Self {
        Self { cyanophilic: 0.85.into(), eosinophilic: 0.15.into(), orangeophilic: 0.0.into() }
    }
}

impl TintMix {
    /// The tints of superficial cells.
    #[must_use]
    pub fn superficial() -> Self {
        Self { cyanophilic: 0.25.into(), eosinophilic: 0.65.into(), orangeophilic: 0.1.into() }
    }
}

impl Default for CellMix {
    fn default() -> Self {
        Self {
            count: 10.0.into(),
            size: 1.0.into(),
            cytoplasm_stain: 1.0.into(),
            nucleus_stain: 1.0.into(),
            tints: TintMix::default(),
            group: Group::default(),
        }
    }
}

/// How shapes vary about their mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ShapeSpread {
    /// Aligned descriptors with a shrinkage covariance; self-intersecting draws are drawn again.
    Correlated,
    /// The paper's: every descriptor an independent normal.
    Independent,
}

/// How the cytoplasm becomes a sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sheet {
    /// Extended position-based dynamics with bending, under a cover glass.
    Xpbd,
    /// The paper's: Verlet steps for every vertex (Eq. 4).
    Verlet,
    /// No folds at all.
    Flat,
}

/// Parts of a cell that lie doubled back on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Folds {
    /// Probability that a flap of the cell lies folded back on it, 0 to 1.
    pub flap: Number,
    /// Probability that a rim is rolled up, 0 to 1.
    pub roll: Number,
    /// Probability that the cell is folded over completely, like a cigar, 0 to 1.
    pub cigar: Number,
    /// How far in from the rim a flap begins, as a fraction of the cell's radius, 0.02 to 0.9.
    pub depth: Number,
    /// Radius of the bend, µm, 0.1 to 5.
    pub radius_um: Number,
}

impl Default for Folds {
    fn default() -> Self {
        Self {
            flap: 0.38.into(),
            roll: 0.18.into(),
            cigar: 0.02.into(),
            depth: Number::uniform(0.10, 0.50),
            radius_um: Number::uniform(0.35, 0.8),
        }
    }
}

/// The cytoplasm of every cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Cytoplasm {
    /// How outlines vary about their mean.
    pub shape: ShapeSpread,
    /// How the cytoplasm becomes a sheet.
    pub sheet: Sheet,
    /// Area of the flat sheet relative to the cell's, 1 to 2: more makes more wrinkles.
    pub excess: Number,
    /// Parts that lie doubled back.
    pub folds: Folds,
    /// How nearly straight the sides of a cell run between its corners, 0 (not at all) to 1.
    pub corners: Number,
    /// Notches in its rim, 0 to 20.
    pub notches: Number,
    /// Tongues that stand out of its rim, 0 to 20.
    pub tongues: Number,
    /// Wrinkles of a cell, 0 to 100: narrow creases in which the sheet lies doubled.
    pub wrinkles: Number,
    /// Thickness that a wrinkle adds at its crest, relative to the flat sheet, 0 to 5.
    pub wrinkle: Number,
    /// Width of a wrinkle (standard deviation of its crest), µm, 0.05 to 5.
    pub wrinkle_um: Number,
    /// How much denser and more granular the cytoplasm is round the nucleus than outside, 0 to 2.
    pub endoplasm: Number,
    /// First level of detail: strength of low-frequency Gaussian noise, relative to the cytoplasm's absorbance, 0 to 2.
    pub clouds: Number,
    /// Standard deviation of its smoothing, µm, 0.1 to 100.
    pub clouds_um: Number,
    /// Second level of detail: strength of thresholded Brownian flecks, relative to the cytoplasm's absorbance, 0 to 5.
    pub flecks: Number,
    /// Share of the cell that the flecks leave free, 0 to 0.999.
    pub flecks_threshold: Number,
    /// Third level of detail: strength of the cytoskeleton, relative to the cytoplasm's absorbance, 0 to 2.
    pub cytoskeleton: Number,
    /// Fine grain of the cytoplasm, relative to its absorbance, 0 to 2.
    pub grain: Number,
    /// Probability that a cell is peppered with granules, 0 to 1.
    pub granular: Number,
    /// Granules of such a cell per 100 µm², 0 to 1000.
    pub granules: Number,
    /// Roughness of the rim, µm, 0 to 5: the edge is frayed over about this distance.
    pub fray_um: Number,
    /// Distance over which the sheet thins out towards its rim, µm, 0 to 10.
    pub rim_um: Number,
    /// How much thicker the sheet is towards one side (standard deviation of the slope, relative to its thickness and the
    /// cell's radius), 0 to 1.
    pub wedge: Number,
    /// How late light comes through a flat sheet, radians of phase, -3 to 3: thicker parts and folds in proportion. It shows
    /// as bright and dark rims that change places when the focus passes.
    pub phase_rad: Number,
}

impl Default for Cytoplasm {
    fn default() -> Self {
        Self {
            shape: ShapeSpread::Correlated,
            sheet: Sheet::Xpbd,
            excess: Number::uniform(1.04, 1.16),
            folds: Folds::default(),
            corners: Number::uniform(0.10, 0.60),
            notches: Number::uniform(0.0, 14.0),
            tongues: Number::uniform(0.0, 9.0),
            wrinkles: Number::log_normal(7.0, 0.6),
            wrinkle: Number::log_normal(0.42, 0.42),
            wrinkle_um: Number::uniform(0.18, 0.5),
            endoplasm: Number::log_normal(0.08, 0.6),
            clouds: Number::uniform(0.10, 0.34),
            clouds_um: Number::uniform(3.0, 14.0),
            flecks: Number::Drawn { law: super::Law::LogNormal(0.14, 0.5), min: 0.0, max: 0.5 },
            flecks_threshold: Number::uniform(0.55, 0.85),
            cytoskeleton: Number::uniform(0.05, 0.18),
            grain: Number::uniform(0.06, 0.18),
            granular: 0.2.into(),
            granules: Number::log_normal(12.0, 0.6),
            fray_um: Number::log_normal(0.65, 0.45),
            rim_um: Number::log_normal(2.2, 0.36),
            wedge: 0.18.into(),
            phase_rad: Number::uniform(0.05, 0.15),
        }
    }
}

/// Where the texture of nuclei comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Chromatin {
    /// Quilted from patches of donors: real ones where the model has learned some, else made from its spectrum.
    Quilt,
    /// A random field of the model's spectrum, a new one for every nucleus.
    Field,
}

/// Which patches of the donors are candidates ("Texture synthesis").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Acceptance {
    /// All whose overlap differs by at most a tenth more than that of the best one.
    Near,
    /// The paper's: the first random one whose overlap differs by less than d_max.
    Threshold,
}

/// How patches are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Seam {
    /// Along the path of least difference.
    MinCut,
    /// The paper's: weighted by the distance to the patches' edges.
    Feather,
}

/// What happens to nuclei whose donors were images already (Eqs. 15, 16).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Restore {
    /// Transmitted light is restored before detection: such nuclei are not blurred twice, and carry their donors' noise
    /// and the camera's.
    BeforeDetection,
    /// The paper's: restored in the finished image; such nuclei carry their donors' noise alone.
    AfterDetection,
    /// They are imaged like everything else.
    Off,
}

/// The nucleus of every cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Nucleus {
    /// How outlines vary about their mean.
    pub shape: ShapeSpread,
    /// Where the texture comes from.
    pub chromatin: Chromatin,
    /// Donors of one nucleus, 1 to 64 (the paper's: 3).
    pub donors: Number,
    /// Size of a patch, µm, 0.5 to 20 (the released value: 7 px of 0.25 µm).
    pub patch_um: Number,
    /// Overlap of patches, µm, 0.25 to 10 (the released value: 2 px of 0.25 µm).
    pub overlap_um: Number,
    /// Which patches are candidates.
    pub acceptance: Acceptance,
    /// d_max of the paper: root-mean-square difference of absorbance over the overlap, 0 to 10.
    pub d_max: Number,
    /// How patches are joined.
    pub seam: Seam,
    /// What happens to nuclei whose donors were images already.
    pub restore: Restore,
    /// Spread of the feathered mask of that, µm, 0 to 5.
    pub restore_feather_um: Number,
    /// Probability that a nucleus is pyknotic (small, dark, without structure), 0 to 1.
    pub pyknotic: Number,
    /// Probability that a nucleus is wrinkled or angular, 0 to 1.
    pub wrinkled: Number,
    /// Absorbance of the rim (the nuclear membrane) relative to the nucleus, 0 to 2.
    pub rim: Number,
    /// Share of a nucleus's thickness that is domed, 0 (a plate) to 1 (an ellipsoid).
    pub dome: Number,
    /// How much thicker a nucleus is towards one side (standard deviation of the slope, relative to its thickness and
    /// radius), 0 to 1.
    pub wedge: Number,
    /// Part of the variance of chromatin that is coarse, a micrometre and a half wide, 0 to 1: what lies above and below the grains in
    /// focus.
    pub clumping: Number,
    /// How softly a nucleus ends: standard deviation of the fall of its thickness about its outline, µm, 0 to 3.
    pub edge_um: Number,
}

impl Default for Nucleus {
    fn default() -> Self {
        Self {
            shape: ShapeSpread::Correlated,
            chromatin: Chromatin::Quilt,
            donors: 3.0.into(),
            patch_um: 1.75.into(),
            overlap_um: 0.5.into(),
            acceptance: Acceptance::Near,
            d_max: 0.1.into(),
            seam: Seam::MinCut,
            restore: Restore::BeforeDetection,
            restore_feather_um: 0.3.into(),
            pyknotic: 0.05.into(),
            wrinkled: 0.15.into(),
            rim: Number::uniform(0.0, 0.2),
            dome: Number::uniform(0.3, 0.85),
            wedge: 0.2.into(),
            clumping: Number::uniform(0.0, 0.4),
            edge_um: Number::uniform(0.0, 0.2),
        }
    }
}

/// How evenly the stain was taken up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Stain {
    /// Factor on the absorbance of all cytoplasm of a slide, 0 to 20; drawn once a slide.
    pub slide_cytoplasm: Number,
    /// Factor on the absorbance of all nuclei of a slide, 0 to 20; drawn once a slide.
    pub slide_nucleus: Number,
    /// Factor on the absorbance of all cytoplasm of a field, 0 to 20; drawn once a field.
    pub field_cytoplasm: Number,
    /// Factor on the absorbance of all nuclei of a field, 0 to 20; drawn once a field.
    pub field_nucleus: Number,
    /// Factor on the contrast of the texture inside all nuclei of a field, 0 to 20; drawn once a field.
    pub field_texture: Number,
    /// Balance of the dyes: standard deviation of the logarithm of each dye's amount between slides, 0 to 2.
    pub slide_balance: Number,
    /// The same between the fields of a slide, 0 to 2.
    pub field_balance: Number,
    /// The same between the cells of a field, 0 to 2.
    pub cell_balance: Number,
    /// Dyes of cyanophilic cytoplasm.
    pub cyanophilic: DyeAmounts,
    /// Dyes of eosinophilic cytoplasm.
    pub eosinophilic: DyeAmounts,
    /// Dyes of orangeophilic, keratinised cytoplasm.
    pub orangeophilic: DyeAmounts,
    /// Dyes of nuclei, also of leukocytes.
    pub nucleus: DyeAmounts,
    /// Dyes of bacteria.
    pub bacillus: DyeAmounts,
    /// Dyes of specks.
    pub speckle: DyeAmounts,
}

impl Default for Stain {
    fn default() -> Self {
        Self {
            slide_cytoplasm: Number::log_normal(0.75, 0.2),
            slide_nucleus: Number::log_normal(0.75, 0.25),
            field_cytoplasm: Number::log_normal(1.0, 0.2),
            field_nucleus: Number::log_normal(1.0, 0.12),
            field_texture: Number::log_normal(0.7, 0.28),
            slide_balance: 0.15.into(),
            field_balance: 0.05.into(),
            cell_balance: 0.12.into(),
            cyanophilic: DyeAmounts { light_green: 2.68, eosin_y: 0.3, orange_g: 0.5, ..DyeAmounts::none() },
            eosinophilic: DyeAmounts { eosin_y: 2.6, orange_g: 0.8, light_green: 0.4, ..DyeAmounts::none() },
            orangeophilic: DyeAmounts { orange_g: 4.5, eosin_y: 1.2, light_green: 0.2, ..DyeAmounts::none() },
            nucleus: DyeAmounts { haematein: 1.0, eosin_y: 0.1, light_green: 0.05, ..DyeAmounts::none() },
            bacillus: DyeAmounts { haematein: 0.6, light_green: 1.15, ..DyeAmounts::none() },
            speckle: DyeAmounts { neutral: 1.0, ..DyeAmounts::none() },
        }
    }
}

/// Amounts of dyes in what is stained with strength 1, each as the absorbance at the dye's own peak. The strength of
/// the stain is what the model and the factors of this section say: the absorbance at 0.57 µm where the amounts are
/// such that their absorbances add up to 1 there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DyeAmounts {
    /// Haematein bound to aluminium, blue-violet, peak near 0.58 µm, 0 to 100.
    pub haematein: f64,
    /// Eosin Y, pink, peak near 0.53 µm, 0 to 100.
    pub eosin_y: f64,
    /// Light green SF, blue-green, peak near 0.63 µm, 0 to 100.
    pub light_green: f64,
    /// Orange G, orange, peak near 0.48 µm, 0 to 100.
    pub orange_g: f64,
    /// Something grey that absorbs all light alike, 0 to 100.
    pub neutral: f64,
}

impl DyeAmounts {
    /// No dye at all.
    #[must_use]
    pub const fn none() -> Self {
        Self { haematein: 0.0, eosin_y: 0.0, light_green: 0.0, orange_g: 0.0, neutral: 0.0 }
    }

    /// Grey of strength 1.
    #[must_use]
    pub const fn grey() -> Self {
        Self { neutral: 1.0, ..Self::none() }
    }

    /// Every amount with the name of its field.
    pub(crate) fn named(&self) -> [(&'static str, f64); 5] {
        [
            ("haematein", self.haematein),
            ("eosin_y", self.eosin_y),
            ("light_green", self.light_green),
            ("orange_g", self.orange_g),
            ("neutral", self.neutral),
        ]
    }

    /// In the order of [`dye_spectra::Dye::ALL`].
    #[must_use]
    pub fn amounts(&self) -> dye_spectra::Amounts {
        [self.haematein, self.eosin_y, self.light_green, self.orange_g, self.neutral]
    }
}

impl Default for DyeAmounts {
    fn default() -> Self {
        Self::none()
    }
}
