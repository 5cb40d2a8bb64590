//! Recipes to start from: what a slide looks like.

use std::collections::BTreeMap;

use super::specimen::defaults;
use super::{
    Acceptance, Bacilli, Background, Camera, CameraPreset, CellMix, Chromatin, Cytoplasm, Debris, DyeAmounts, Field,
    Focus, Folds, Group, GroupForm, Illumination, Layout, Leukocytes, Light, Nucleus, NucleusForm, Number, Optics, OutOfFocus, Picture,
    RECIPE_VERSION, Recipe, Restore, Seam, ShapeSpread, Sheet, Slide, SpeckForm, Speckles, Stain, TintMix,
};

/// A named recipe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preset {
    /// A liquid-based preparation: free cells and small groups, the default.
    Lbc,
    /// The paper's simulator with the values of its released code.
    Paper2015,
    /// Few cells, hardly any debris.
    Sparse,
    /// A field that is covered with cells several layers deep.
    Dense,
    /// A field with cells of a high-grade lesion (HSIL), as in the paper's Fig. 13.
    HighGrade,
    /// Many leukocytes and bacteria.
    Inflamed,
    /// Cells of a low-grade lesion (LSIL), many with a cleared space round the nucleus.
    Lsil,
    /// Squamous carcinoma.
    Carcinoma,
    /// A smear of atrophy: parabasal and basal cells.
    Atrophic,
    /// Palisades and honeycombs of endocervical cells, metaplastic cells.
    Endocervical,
    /// Squames of the oral mucosa: another smear, of classes of its own.
    Oral,
    /// The default slide as a scanner shows it that fuses planes to pictures of extended focus.
    ExtendedFocus,
}

impl Preset {
    /// All presets.
    pub const ALL: [Self; 12] = [
        Self::Lbc,
        Self::Paper2015,
        Self::Sparse,
        Self::Dense,
        Self::Lsil,
        Self::HighGrade,
        Self::Carcinoma,
        Self::Inflamed,
        Self::Atrophic,
        Self::Endocervical,
        Self::Oral,
        Self::ExtendedFocus,
    ];

    /// The name of the preset, as the command line knows it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Lbc => "lbc",
            Self::Paper2015 => "paper-2015",
            Self::Sparse => "sparse",
            Self::Dense => "dense",
            Self::HighGrade => "high-grade",
            Self::Inflamed => "inflamed",
            Self::Lsil => "lsil",
            Self::Carcinoma => "carcinoma",
            Self::Atrophic => "atrophic",
            Self::Endocervical => "endocervical",
            Self::Oral => "oral",
            Self::ExtendedFocus => "extended-focus",
        }
    }

    /// What the preset shows, in a line.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::Lbc => "liquid-based cytology: free cells and small groups (default)",
            Self::Paper2015 => "the simulator of the 2015 paper, with the values of its released code",
            Self::Sparse => "few cells, hardly any debris",
            Self::Dense => "covered with cells, several layers deep",
            Self::HighGrade => "cells of a high-grade lesion among normal ones",
            Self::Inflamed => "many leukocytes and bacteria",
            Self::Lsil => "cells of a low-grade lesion, koilocytes among them",
            Self::Carcinoma => "squamous carcinoma: cells of every form, leukocytes, debris",
            Self::Atrophic => "atrophy: parabasal and basal cells",
            Self::Endocervical => "palisades and honeycombs of endocervical cells, metaplastic cells",
            Self::Oral => "the oral mucosa: another smear, of a class file and a few lines",
            Self::ExtendedFocus => "the default slide as a scanner shows it, planes fused to extended focus, .33 um a pixel",
        }
    }

    /// The preset of a name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|preset| preset.name() == name)
    }

    /// The recipe.
    #[must_use]
    pub fn recipe(self) -> Recipe {
        match self {
            Self::Lbc => lbc(),
            Self::Paper2015 => paper(),
            Self::Sparse => sparse(),
            Self::Dense => dense(),
            Self::HighGrade => high_grade(),
            Self::Inflamed => inflamed(),
            Self::Lsil => lsil(),
            Self::Carcinoma => carcinoma(),
            Self::Atrophic => atrophic(),
            Self::Endocervical => endocervical(),
            Self::Oral => oral(),
            Self::ExtendedFocus => extended_focus(),
        }
    }
}

/// Numbers of cells of a class that lie in groups of a form; the groups' sizes are drawn up to the largest.
fn grouped(recipe: &mut Recipe, class: &str, count: Number, form: GroupForm, size: Number, distance: Number) {
    let group = Group { form, size, distance };
    recipe.cells.insert(class.to_owned(), CellMix { count, group, ..CellMix::default() });
}

fn lsil() -> Recipe {
    let mut recipe = lbc();
    recipe.cells.extend(mix([
        ("intermediate", Number::uniform(6.0, 16.0)),
        ("superficial", Number::uniform(2.0, 8.0)),
        ("lsil", Number::uniform(3.0, 10.0)),
    ]));
    recipe
}

fn carcinoma() -> Recipe {
    let mut recipe = inflamed();
    recipe.cells = mix([("intermediate", Number::uniform(2.0, 10.0)), ("severe", Number::uniform(3.0, 12.0))]);
    let (size, distance) = (Number::uniform(2.0, 12.0), Number::uniform(0.6, 0.9));
    grouped(&mut recipe, "carcinoma", Number::uniform(8.0, 30.0), GroupForm::Heap, size, distance);
    recipe
}

fn atrophic() -> Recipe {
    let mut recipe = lbc();
    recipe.cells = mix([("intermediate", Number::uniform(0.0, 6.0)), ("basal", Number::uniform(3.0, 12.0))]);
    let (size, distance) = (Number::uniform(1.0, 14.0), Number::uniform(0.7, 1.0));
    grouped(&mut recipe, "parabasal", Number::uniform(18.0, 50.0), GroupForm::Heap, size, distance);
    recipe
}

fn endocervical() -> Recipe {
    let mut recipe = lbc();
    recipe.cells = mix([("intermediate", Number::uniform(3.0, 12.0)), ("superficial", Number::uniform(0.0, 5.0))]);
    let (size, distance) = (Number::uniform(5.0, 16.0), Number::uniform(0.40, 0.52));
    grouped(&mut recipe, "endocervical", Number::uniform(14.0, 40.0), GroupForm::Palisade, size, distance);
    let (size, distance) = (Number::uniform(12.0, 40.0), Number::uniform(0.75, 0.9));
    grouped(&mut recipe, "endocervical-en-face", Number::uniform(0.0, 40.0), GroupForm::Honeycomb, size, distance);
    let (size, distance) = (Number::uniform(1.0, 7.0), Number::uniform(0.75, 0.95));
    grouped(&mut recipe, "metaplastic", Number::uniform(3.0, 12.0), GroupForm::Heap, size, distance);
    recipe
}

fn oral() -> Recipe {
    let mut recipe = lbc();
    recipe.cells = mix([
        ("oral-intermediate", Number::uniform(6.0, 14.0)),
        ("oral-superficial", Number::uniform(3.0, 10.0)),
        ("oral-parabasal", Number::uniform(0.0, 2.0)),
    ]);
    recipe
}

/// Numbers of pictures of extended focus: three sets of them, of two scanners.
fn extended_focus() -> Recipe {
    let mut recipe = lbc();
    recipe.field = Field { width_px: 1280.0.into(), height_px: 960.0.into(), pixel_um: 0.33.into(), ..recipe.field };
    recipe.focus = Focus {
        planes: 11.0.into(),
        step_um: 1.0.into(),
        picture: Picture::Extended,
        fused_noise_across: Number::uniform(0.20, 0.30),
        fused_noise_down: Number::uniform(0.36, 0.46),
        ..recipe.focus
    };
    if let Optics::BrightField { extra_blur_um, .. } = &mut recipe.optics {
        *extra_blur_um = Number::uniform(0.30, 0.52);
    }
    recipe.camera.full_well_e = 60_000.0.into();
    recipe.camera.read_noise_e = Number::uniform(180.0, 480.0);
    recipe.stain.field_texture = Number::log_normal(0.34, 0.3);
    recipe
}

fn mix<const N: usize>(counts: [(&str, Number); N]) -> BTreeMap<String, CellMix> {
    let tints = |class: &str| if class == "superficial" { TintMix::superficial() } else { TintMix::default() };
    let mix = |(class, count): (&str, Number)| {
        (class.to_owned(), CellMix { count, tints: tints(class), ..CellMix::default() })
    };
    counts.into_iter().map(mix).collect()
}

fn lbc() -> Recipe {
    Recipe {
        version: RECIPE_VERSION,
        field: Field::default(),
        focus: Focus::default(),
        slide: Slide::default(),
        layout: Layout::Clusters {
            count: defaults::clusters(),
            radius_um: defaults::radius_um(),
            outside: defaults::outside(),
        },
        cells: mix([
            ("intermediate", Number::uniform(8.0, 24.0)),
            ("superficial", Number::uniform(2.0, 10.0)),
            ("parabasal", Number::uniform(0.0, 1.5)),
            ("metaplastic", Number::uniform(0.0, 1.5)),
        ]),
        cytoplasm: Cytoplasm::default(),
        nucleus: Nucleus::default(),
        stain: Stain::default(),
        debris: Debris::default(),
        background: Background::default(),
        light: Light::default(),
        optics: Optics::default(),
        camera: Camera::default(),
    }
}

fn sparse() -> Recipe {
    let mut recipe = lbc();
    recipe.layout = Layout::Uniform {};
    recipe.cells = mix([("intermediate", Number::uniform(3.0, 8.0)), ("superficial", Number::uniform(1.0, 4.0))]);
    recipe.debris.leukocytes.clusters = Number::uniform(0.0, 2.0);
    recipe.debris.bacilli.clusters = Number::uniform(0.0, 3.0);
    recipe.debris.speckles.count = Number::uniform(10.0, 50.0);
    recipe.debris.out_of_focus.count = Number::uniform(0.0, 1.0);
    recipe
}

fn dense() -> Recipe {
    let mut recipe = lbc();
    recipe.layout = Layout::Clusters {
        count: Number::uniform(2.0, 4.0),
        radius_um: Number::uniform(70.0, 130.0),
        outside: 0.2.into(),
    };
    recipe.cells = mix([("intermediate", Number::uniform(45.0, 75.0)), ("superficial", Number::uniform(15.0, 30.0))]);
    recipe.slide.depth_um = Number::uniform(5.0, 10.0);
    recipe.slide.stacking_um = 1.5.into();
    recipe.stain.field_cytoplasm = Number::log_normal(0.85, 0.2);
    recipe
}

fn high_grade() -> Recipe {
    let mut recipe = lbc();
    recipe.cells = mix([
        ("intermediate", Number::uniform(8.0, 18.0)),
        ("superficial", Number::uniform(2.0, 8.0)),
        ("high-grade", Number::uniform(5.0, 14.0)),
    ]);
    recipe
}

fn inflamed() -> Recipe {
    let mut recipe = lbc();
    recipe.debris.leukocytes.clusters = Number::uniform(20.0, 60.0);
    recipe.debris.leukocytes.per_cluster = Number::log_normal(5.0, 0.9).at_least(1.0);
    recipe.debris.leukocytes.cluster_um = Number::uniform(4.0, 14.0);
    recipe.debris.bacilli.clusters = Number::uniform(20.0, 50.0);
    recipe.debris.bacilli.per_cluster = Number::log_normal(25.0, 0.7).at_least(1.0);
    recipe
}

/// The values of the paper where it states them, else those of the authors' released code.
fn paper() -> Recipe {
    let mut recipe = lbc();
    recipe.slide = Slide {
        depth_um: 0.4.into(),
        relief_um: 60.0.into(),
        median_um: 8.0.into(),
        stacking_um: 0.0.into(),
        spacing_um: 0.0.into(),
        fields: 1,
    };
    recipe.layout = Layout::Clusters { count: 3.0.into(), radius_um: 60.0.into(), outside: 0.1.into() };
    recipe.cells = mix([("intermediate", 30.0.into())]);
    recipe.cytoplasm = Cytoplasm {
        shape: ShapeSpread::Independent,
        sheet: Sheet::Verlet,
        excess: 1.0.into(),
        folds: Folds { flap: 0.0.into(), roll: 0.0.into(), cigar: 0.0.into(), ..Folds::default() },
        corners: 0.0.into(),
        notches: 0.0.into(),
        tongues: 0.0.into(),
        wrinkles: 0.0.into(),
        wrinkle: 0.0.into(),
        wrinkle_um: 0.3.into(),
        endoplasm: 0.0.into(),
        clouds: 0.2.into(),
        clouds_um: 1.75.into(),
        flecks: 0.7.into(),
        flecks_threshold: 0.5.into(),
        cytoskeleton: 0.3.into(),
        grain: 0.0.into(),
        granular: 0.0.into(),
        granules: 0.0.into(),
        fray_um: 0.0.into(),
        rim_um: 0.0.into(),
        phase_rad: 0.0.into(),
    };
    recipe.nucleus = Nucleus {
        shape: ShapeSpread::Independent,
        chromatin: Chromatin::Quilt,
        acceptance: Acceptance::Threshold,
        d_max: 0.06.into(),
        seam: Seam::Feather,
        restore: Restore::AfterDetection,
        pyknotic: 0.0.into(),
        wrinkled: 0.0.into(),
        rim: 0.0.into(),
        dome: 0.0.into(),
        wedge: 0.0.into(),
        ..Nucleus::default()
    };
    // The paper's stain is a grey value.
    recipe.stain = Stain {
        slide_cytoplasm: 1.0.into(),
        slide_nucleus: 1.0.into(),
        field_cytoplasm: 1.0.into(),
        field_nucleus: 1.0.into(),
        field_texture: 1.0.into(),
        slide_balance: 0.0.into(),
        field_balance: 0.0.into(),
        cell_balance: 0.0.into(),
        cyanophilic: DyeAmounts::grey(),
        eosinophilic: DyeAmounts::grey(),
        orangeophilic: DyeAmounts::grey(),
        nucleus: DyeAmounts::grey(),
        bacillus: DyeAmounts::grey(),
        speckle: DyeAmounts::grey(),
    };
    recipe.debris = paper_debris();
    recipe.background = Background {
        level: (235.0 / 255.0).into(),
        illumination: Illumination::Border { exponent: 0.02.into() },
        scatter: (10.0 / 255.0).into(),
        scatter_um: 55.0.into(),
    };
    // 70 photo-electrons a grey level of 8 bits; the released read noise is one grey level.
    recipe.camera = CameraPreset::Paper.camera();
    recipe.optics = Optics::gaussian();
    recipe
}

/// The paper's four kinds of debris.
fn paper_debris() -> Debris {
    let mut debris = Debris::none();
    debris.leukocytes = Leukocytes {
        clusters: 8.0.into(),
        per_cluster: Number::uniform(3.0, 6.0),
        cluster_um: Number::uniform(2.5, 6.0),
        on_cells: 0.5.into(),
        form: NucleusForm::Round,
        radius_um: Number::normal(2.6, 0.25),
        alpha: 0.10.into(),
        beta: 0.10.into(),
        absorbance: 0.70.into(),
        halo: 0.0.into(),
        ..Leukocytes::default()
    };
    debris.bacilli = Bacilli {
        clusters: 8.0.into(),
        per_cluster: Number::uniform(8.0, 20.0),
        cluster_um: Number::uniform(6.0, 22.0),
        on_cells: 0.75.into(),
        length_um: Number::log_normal(2.4, 0.35),
        width_um: Number::normal(0.55, 0.06),
        bend_deg: 0.0.into(),
        chained: 0.0.into(),
        absorbance: 0.15.into(),
        phase_rad: 0.0.into(),
    };
    debris.speckles = Speckles {
        count: 120.0.into(),
        form: SpeckForm::Dilated,
        dilations: Number::Drawn {
            law: super::Law::Choice(vec![0.0, 0.0, 1.0]),
            min: f64::NEG_INFINITY,
            max: f64::INFINITY,
        },
        absorbance: 0.25.into(),
        phase_rad: 0.0.into(),
    };
    debris.out_of_focus = OutOfFocus {
        count: 5.0.into(),
        radius_um: Number::log_normal(9.0, 0.5),
        alpha: 0.15.into(),
        beta: 0.2.into(),
        depth_um: Number::uniform(14.0, 40.0),
        absorbance: 0.35.into(),
    };
    debris
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_sound_and_reads_back_as_written() {
        for preset in Preset::ALL {
            let recipe = preset.recipe();
            assert!(recipe.problems().is_empty(), "{}: {:?}", preset.name(), recipe.problems());
            for text in [recipe.to_toml(), recipe.to_commented_toml()] {
                let again: Recipe = toml::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}\n{text}", preset.name()));
                assert_eq!(again, recipe, "{}", preset.name());
            }
            assert_eq!(Preset::by_name(preset.name()), Some(preset));
        }
    }

    #[test]
    fn the_paper_preset_holds_the_published_values() {
        let paper = Preset::Paper2015.recipe();
        assert_eq!(paper.field.pixel_um, 0.25.into());
        let Optics::Gaussian { sigma_xy_um, sigma_z_um_per_um } = paper.optics else { panic!("{:?}", paper.optics) };
        assert_eq!((sigma_xy_um, sigma_z_um_per_um), (0.225.into(), 0.25.into()), "0.9 px, 1 px a µm");
        assert_eq!(paper.camera.full_well_e, 17_850.0.into());
        assert_eq!(paper.nucleus.donors, 3.0.into());
        assert_eq!(paper.cytoplasm.sheet, Sheet::Verlet);
        assert_eq!(paper.nucleus.seam, Seam::Feather);
    }
}
