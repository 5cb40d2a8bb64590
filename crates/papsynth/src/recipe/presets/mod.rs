//! Recipes to start from: what a slide looks like.

mod paper;

use super::imaging::{Field, Focus, Optics, Picture};
use super::number::Number;
use super::specimen::{CellMix, Clusters, Group, GroupForm, Layout, Swath, mix};
use super::whole::Recipe;

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
    /// A conventional smear: thick, uneven, with blood, mucus and leukocytes.
    Conventional,
    /// Cells of a low-grade lesion (LSIL), many with a cleared space round the nucleus.
    Lsil,
    /// A field with cells of a high-grade lesion (HSIL), as in the paper's Fig. 13.
    HighGrade,
    /// Squamous carcinoma.
    Carcinoma,
    /// A smear of atrophy: parabasal and basal cells.
    Atrophic,
    /// Palisades and honeycombs of endocervical cells, metaplastic cells.
    Endocervical,
    /// Many leukocytes, bacteria and debris.
    Inflamed,
    /// Bacterial vaginosis: clue cells and clouds of cocci, no lactobacilli.
    BacterialVaginosis,
    /// *Candida*: pseudohyphae and yeasts among inflamed cells.
    Candida,
    /// Trichomonads among inflamed cells.
    Trichomonas,
    /// Squames of the oral mucosa: another smear, of classes of its own.
    Oral,
    /// The default slide as a scanner shows it that fuses planes to pictures of extended focus.
    ExtendedFocus,
}

impl Preset {
    /// All presets.
    pub const ALL: [Self; 16] = [
        Self::Lbc,
        Self::Paper2015,
        Self::Sparse,
        Self::Dense,
        Self::Conventional,
        Self::Lsil,
        Self::HighGrade,
        Self::Carcinoma,
        Self::Atrophic,
        Self::Endocervical,
        Self::Inflamed,
        Self::BacterialVaginosis,
        Self::Candida,
        Self::Trichomonas,
        Self::Oral,
        Self::ExtendedFocus,
    ];

    /// Its name, what it shows in a line, and its recipe.
    fn entry(self) -> (&'static str, &'static str, fn() -> Recipe) {
        match self {
            Self::Lbc => ("lbc", "liquid-based cytology: free cells and small groups (default)", lbc),
            Self::Paper2015 => {
                ("paper-2015", "the simulator of the 2015 paper, with the values of its released code", paper::recipe)
            }
            Self::Sparse => ("sparse", "few cells, hardly any debris", sparse),
            Self::Dense => ("dense", "covered with cells, several layers deep", dense),
            Self::Conventional => (
                "conventional",
                "a conventional smear: thick and uneven, with blood, mucus and leukocytes",
                conventional,
            ),
            Self::Lsil => ("lsil", "cells of a low-grade lesion, koilocytes among them", lsil),
            Self::HighGrade => ("high-grade", "cells of a high-grade lesion among normal ones", high_grade),
            Self::Carcinoma => ("carcinoma", "squamous carcinoma: cells of every form, leukocytes, debris", carcinoma),
            Self::Atrophic => ("atrophic", "atrophy: parabasal and basal cells", atrophic),
            Self::Endocervical => {
                ("endocervical", "palisades and honeycombs of endocervical cells, metaplastic cells", endocervical)
            }
            Self::Inflamed => ("inflamed", "many leukocytes, bacteria and debris", inflamed),
            Self::BacterialVaginosis => {
                ("bacterial-vaginosis", "bacterial vaginosis: clue cells and clouds of cocci", bacterial_vaginosis)
            }
            Self::Candida => ("candida", "Candida: pseudohyphae and budding yeasts", candida),
            Self::Trichomonas => ("trichomonas", "trichomonads among leukocytes", trichomonas),
            Self::Oral => ("oral", "the oral mucosa: another smear, made of a class file and a few lines", oral),
            Self::ExtendedFocus => (
                "extended-focus",
                "the default slide from a scanner that fuses planes, 0.33 µm a pixel",
                extended_focus,
            ),
        }
    }

    /// The name of the preset, as the command line knows it.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.entry().0
    }

    /// What the preset shows, in a line.
    #[must_use]
    pub fn summary(self) -> &'static str {
        self.entry().1
    }

    /// The preset of a name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|preset| preset.name() == name)
    }

    /// The recipe.
    #[must_use]
    pub fn recipe(self) -> Recipe {
        self.entry().2()
    }
}

fn grouped(recipe: &mut Recipe, class: &str, count: Number, form: GroupForm, size: Number, distance: Number) {
    let group = Group { form, size, distance };
    recipe.cells.insert(class.to_owned(), CellMix { count, group, ..CellMix::default() });
}

fn lsil() -> Recipe {
    let mut recipe = lesion();
    recipe.cells = mix([
        ("intermediate", Number::uniform(2.0, 8.0)),
        ("superficial", Number::uniform(1.0, 5.0)),
        ("ascus", Number::uniform(8.0, 24.0)),
        ("lsil", Number::uniform(1.0, 5.0)),
    ]);
    recipe.stain.field_cytoplasm = Number::log_normal(1.05, 0.25);
    recipe
}

/// What slides of lesions have in common: cells in wide sheets, nuclei flatter than normal ones.
fn lesion() -> Recipe {
    let mut recipe = lbc();
    let (count, radius_um) = (Number::uniform(2.0, 6.0), Number::uniform(25.0, 60.0));
    recipe.layout = Layout::Clusters(Clusters { count, radius_um, ..Clusters::default() });
    recipe.nucleus.dome = Number::uniform(0.0, 0.6);
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

/// As a scanner of squares of a third of a micrometre shows the default slide.
fn extended_focus() -> Recipe {
    let mut recipe = lbc().fused();
    recipe.field = Field { width_px: 1280.0.into(), height_px: 960.0.into(), pixel_um: 0.33.into(), ..recipe.field };
    recipe.background.level = Number::normal(0.93, 0.05).at_least(0.75).at_most(0.99);
    recipe
}

impl Recipe {
    /// The same slide as a scanner shows it that fuses planes to a picture of extended focus: focus, blur, soft edges, noise and texture, as
    /// three sets of such pictures have them, of two scanners; stained as strongly as the slides of those sets are.
    #[must_use]
    pub fn fused(mut self) -> Self {
        self.focus = Focus {
            planes: 11.0.into(),
            step_um: 1.0.into(),
            picture: Picture::Extended,
            fused_noise_across: Number::uniform(0.22, 0.28),
            fused_noise_down: Number::uniform(0.40, 0.44),
            fused_noise_skew: 0.02.into(),
            ..self.focus
        };
        if let Optics::BrightField(microscope) = &mut self.optics {
            microscope.extra_blur_um = Number::log_normal(0.36, 0.35);
        }
        // What fusing leaves of edges is softer than the lens: specks stay sharper than nuclei and rims.
        self.nucleus.edge_um = Number::uniform(0.05, 0.5);
        self.nucleus.clumping = Number::uniform(0.0, 0.5);
        self.cytoplasm.rim_um = Number::log_normal(3.4, 0.26);
        // Two thirds of the variance of noise are the same in every picture; half of it is left in nuclei.
        self.camera.prnu = 0.007.into();
        self.camera.full_well_e = 120_000.0.into();
        self.camera.glare_removed = Number::uniform(0.12, 0.22);
        self.camera.read_noise_e = Number::uniform(350.0, 620.0);
        self.stain.slide_cytoplasm = Number::log_normal(1.2, 0.15);
        self.stain.slide_nucleus = Number::log_normal(1.0, 0.12);
        self.stain.field_texture = Number::log_normal(0.23, 0.3);
        self
    }
}

fn lbc() -> Recipe {
    Recipe::default()
}

fn sparse() -> Recipe {
    let mut recipe = lbc();
    recipe.layout = Layout::Uniform {};
    recipe.cells = mix([("intermediate", Number::uniform(3.0, 8.0)), ("superficial", Number::uniform(1.0, 4.0))]);
    let debris = &mut recipe.debris;
    debris.leukocytes.clusters = Number::log_normal(0.8, 0.7);
    debris.bacilli.clusters = Number::uniform(0.0, 3.0);
    debris.speckles.count = Number::log_normal(2.5, 0.7);
    debris.smudges.count = Number::log_normal(2.0, 0.7);
    debris.dirt.drifts = Number::log_normal(7.0, 0.6);
    debris.out_of_focus.count = Number::uniform(0.0, 1.0);
    recipe
}

fn dense() -> Recipe {
    let mut recipe = lbc();
    recipe.layout = Layout::Clusters(Clusters {
        count: Number::uniform(2.0, 4.0),
        radius_um: Number::uniform(70.0, 130.0),
        outside: 0.2.into(),
    });
    recipe.cells = mix([("intermediate", Number::uniform(45.0, 75.0)), ("superficial", Number::uniform(15.0, 30.0))]);
    recipe.slide.depth_um = Number::uniform(5.0, 10.0);
    recipe.slide.stacking_um = 1.5.into();
    recipe.stain.field_cytoplasm = Number::log_normal(0.85, 0.2);
    recipe
}

/// Spread by hand and dried: thick and uneven, material in strands, blood and leukocytes over everything.
fn conventional() -> Recipe {
    let mut recipe = dense();
    recipe.layout = Layout::Swath(Swath { width_um: Number::uniform(60.0, 140.0), outside: Number::uniform(0.1, 0.3) });
    recipe.cells = mix([
        ("intermediate", Number::uniform(35.0, 70.0)),
        ("superficial", Number::uniform(10.0, 30.0)),
        ("parabasal", Number::uniform(0.0, 6.0)),
    ]);
    recipe.slide.depth_um = Number::uniform(6.0, 16.0);
    recipe.slide.stacking_um = 2.5.into();
    recipe.cytoplasm.folds.flap = 0.5.into();
    recipe.cytoplasm.folds.cigar = 0.06.into();
    let debris = &mut recipe.debris;
    debris.leukocytes.clusters = Number::uniform(15.0, 50.0);
    debris.leukocytes.degenerated = 0.4.into();
    debris.red_cells.clusters = Number::uniform(3.0, 14.0);
    debris.mucus.strands = Number::uniform(2.0, 8.0);
    debris.smudges.count = Number::log_normal(40.0, 0.5);
    debris.bare_nuclei.count = Number::log_normal(3.0, 0.7);
    recipe
}

fn high_grade() -> Recipe {
    let mut recipe = lesion();
    recipe.cells = mix([
        ("intermediate", Number::uniform(0.0, 4.0)),
        ("superficial", Number::uniform(0.0, 2.0)),
        ("ascus", Number::uniform(5.0, 15.0)),
        ("lsil", Number::uniform(0.0, 4.0)),
        ("high-grade", Number::uniform(1.0, 4.0)),
        ("moderate", Number::uniform(1.0, 3.0)),
        ("severe", Number::uniform(0.0, 2.0)),
    ]);
    recipe.stain.field_cytoplasm = Number::log_normal(0.68, 0.25);
    recipe
}

fn inflamed() -> Recipe {
    let mut recipe = lbc();
    let debris = &mut recipe.debris;
    debris.leukocytes.clusters = Number::uniform(15.0, 40.0);
    debris.leukocytes.per_cluster = Number::log_normal(4.0, 0.9).at_least(1.0);
    debris.leukocytes.degenerated = 0.3.into();
    debris.bacilli.clusters = Number::uniform(4.0, 15.0);
    debris.cocci.colonies = Number::log_normal(4.0, 0.6);
    debris.smudges.count = Number::log_normal(25.0, 0.5);
    debris.mucus.strands = Number::log_normal(1.5, 0.6);
    debris.red_cells.clusters = Number::log_normal(1.5, 0.8);
    debris.bare_nuclei.count = Number::log_normal(2.0, 0.7);
    recipe
}

fn bacterial_vaginosis() -> Recipe {
    let mut recipe = lbc();
    let debris = &mut recipe.debris;
    debris.clue_cells.share = Number::uniform(0.3, 0.7);
    debris.clue_cells.density = Number::uniform(2.0, 6.0);
    debris.cocci.colonies = Number::log_normal(14.0, 0.5);
    debris.cocci.per_colony = Number::log_normal(60.0, 0.9).at_least(2.0);
    debris.bacilli.clusters = 0.0.into();
    debris.smudges.count = Number::log_normal(18.0, 0.5);
    recipe
}

fn candida() -> Recipe {
    let mut recipe = lbc();
    let debris = &mut recipe.debris;
    debris.candida.colonies = Number::uniform(1.0, 5.0);
    debris.leukocytes.clusters = Number::uniform(4.0, 15.0);
    debris.smudges.count = Number::log_normal(12.0, 0.5);
    recipe
}

fn trichomonas() -> Recipe {
    let mut recipe = lbc();
    let debris = &mut recipe.debris;
    debris.trichomonads.groups = Number::uniform(2.0, 7.0);
    debris.leukocytes.clusters = Number::uniform(10.0, 30.0);
    debris.leukocytes.per_cluster = Number::log_normal(4.0, 0.9).at_least(1.0);
    debris.cocci.colonies = Number::log_normal(3.0, 0.6);
    debris.smudges.count = Number::log_normal(15.0, 0.5);
    recipe
}

#[cfg(test)]
mod tests {
    use super::super::imaging::Gaussians;
    use super::super::specimen::{Seam, Sheet};
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
        let Optics::Gaussian(Gaussians { sigma_xy_um, sigma_z_um_per_um }) = paper.optics else { panic!() };
        assert_eq!((sigma_xy_um, sigma_z_um_per_um), (0.225.into(), 0.25.into()), "0.9 px, 1 px a µm");
        assert_eq!(paper.camera.full_well_e, 17_850.0.into());
        assert_eq!(paper.nucleus.donors, 3.0.into());
        assert_eq!(paper.cytoplasm.sheet, Sheet::Verlet);
        assert_eq!(paper.nucleus.seam, Seam::Feather);
    }
}
