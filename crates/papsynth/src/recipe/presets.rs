//! The presets: recipes to start from. Each is a file in `presets/` with the differences from the default recipe.

use super::imaging::{Focus, LightSection, Optics};
use super::whole::Recipe;
use crate::words::words;

macro_rules! presets {
    ($($(#[$doc:meta])* $Name:ident = $name:literal,)*) => {
        words! {
            /// A preset: a named recipe.
            pub enum Preset { $($(#[$doc])* $Name = $name,)* }
        }

        impl Preset {
            /// Returns the preset as TOML: a comment with its summary, and the differences from the default recipe.
            fn text(self) -> &'static str {
                match self {
                    $(Self::$Name => include_str!(concat!("../../presets/", $name, ".toml")),)*
                }
            }
        }
    };
}

presets! {
    /// Liquid-based cytology: single cells and small groups (default).
    Lbc = "lbc",
    /// The simulator of the 2015 paper, with the values of its released code.
    Paper2015 = "paper-2015",
    /// Few cells, little debris.
    Sparse = "sparse",
    /// Fields covered with several layers of cells.
    Dense = "dense",
    /// Conventional smear: thick and uneven, with blood, mucus and leukocytes.
    Conventional = "conventional",
    /// Low-grade lesion (LSIL), with koilocytes.
    Lsil = "lsil",
    /// High-grade lesion (HSIL) among normal cells, as in the paper's Fig. 13.
    HighGrade = "high-grade",
    /// Squamous carcinoma.
    Carcinoma = "carcinoma",
    /// Atrophy: parabasal and basal cells.
    Atrophic = "atrophic",
    /// Palisades and honeycombs of endocervical cells, with metaplastic cells.
    Endocervical = "endocervical",
    /// Many leukocytes, bacteria and debris.
    Inflamed = "inflamed",
    /// Bacterial vaginosis: clue cells and cocci, no lactobacilli.
    BacterialVaginosis = "bacterial-vaginosis",
    /// *Candida*: pseudohyphae and yeasts among inflamed cells.
    Candida = "candida",
    /// Trichomonads among inflamed cells.
    Trichomonas = "trichomonas",
    /// Oral mucosa: another specimen, with its own classes.
    Oral = "oral",
    /// The default slide as EDF images of a scanner.
    ExtendedFocus = "extended-focus",
    /// An empty field of 800 x 600 pixels, to which cells and debris can be added.
    Empty = "empty",
}

impl Preset {
    /// Returns a summary in one line.
    #[must_use]
    pub fn summary(self) -> &'static str {
        self.text().lines().next().unwrap_or_default().trim_start_matches("# ")
    }

    /// Returns the recipe.
    ///
    /// # Panics
    /// Never: the files are part of the crate and its tests read them.
    #[must_use]
    pub fn recipe(self) -> Recipe {
        Recipe::from_toml(self.text()).expect("all presets are valid")
    }
}

impl Recipe {
    /// Returns the same slide as an EDF image of a scanner: with the focus, blur, stray light, softness of edges,
    /// noise, texture and staining strength of [`Preset::ExtendedFocus`], and no objects out of focus.
    ///
    /// The reduction and the pattern of columns are those of one camera; for another one, set them to 1 and 0.
    #[must_use]
    pub fn fused(mut self) -> Self {
        let like = Preset::ExtendedFocus.recipe();
        self.focus = Focus { centre_um: self.focus.centre_um, ..like.focus };
        if let (Optics::BrightField(own), Optics::BrightField(like)) = (&mut self.optics, like.optics) {
            own.extra_blur_um = like.extra_blur_um;
            own.stray_light = like.stray_light;
            own.stray_light_um = like.stray_light_um;
        }
        if let (LightSection::Monochrome(own), LightSection::Monochrome(like)) = (&mut self.light, like.light) {
            own.absorption_variation = like.absorption_variation;
        }
        macro_rules! take {
            ($($section:ident.$number:ident),*) => {
                $(self.$section.$number = like.$section.$number;)*
            };
        }
        take!(nucleus.edge_um, nucleus.clumping, cytoplasm.rim_um, cytoplasm.texture);
        take!(camera.prnu, camera.full_well_e, camera.glare_subtracted, camera.read_noise_e, camera.sensor_dust);
        take!(stain.slide_cytoplasm, stain.slide_nucleus, stain.field_texture);
        self.debris.out_of_focus.count = like.debris.out_of_focus.count;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::super::camera::CameraPreset;
    use super::super::imaging::Gaussians;
    use super::super::specimen::{Seam, Sheet};
    use super::*;
    use crate::recipe::Debris;

    #[test]
    fn every_preset_is_valid_and_reads_back_as_written() {
        for preset in Preset::ALL {
            let recipe = preset.recipe();
            assert!(recipe.problems().is_empty(), "{}: {:?}", preset.name(), recipe.problems());
            for text in [preset.text().to_owned(), recipe.to_toml(), recipe.to_commented_toml()] {
                let again = crate::recipe::diagnose::read(&text);
                assert_eq!(again.as_ref(), Ok(&recipe), "{}\n{text}", preset.name());
            }
            assert_eq!(Preset::by_name(preset.name()), Some(preset));
        }
        assert_eq!(Preset::Lbc.recipe(), Recipe::default());
    }

    #[test]
    fn a_fused_recipe_has_the_focus_and_nuclei_of_extended_focus_and_keeps_its_cells() {
        let (like, own) = (Preset::ExtendedFocus.recipe(), Preset::Lsil.recipe());
        let fused = own.clone().fused();
        assert!(fused.problems().is_empty(), "{:?}", fused.problems());
        assert_eq!((fused.focus.output, &fused.focus.planes), (like.focus.output, &like.focus.planes));
        assert_eq!(
            (&fused.nucleus.edge_um, &fused.stain.field_texture),
            (&like.nucleus.edge_um, &like.stain.field_texture)
        );
        let light = |recipe: &Recipe| match &recipe.optics {
            Optics::BrightField(microscope) => Some((microscope.extra_blur_um.clone(), microscope.stray_light.clone())),
            Optics::Gaussian(_) => None,
        };
        assert!(light(&fused).is_some() && light(&fused) == light(&like));
        assert_eq!(fused.debris.out_of_focus.count, like.debris.out_of_focus.count);
        assert_eq!((&fused.cells, &fused.debris.leukocytes), (&own.cells, &own.debris.leukocytes));
    }

    #[test]
    fn the_empty_preset_has_no_objects() {
        let empty = Preset::Empty.recipe();
        assert!(empty.cells.is_empty());
        assert_eq!(empty.debris, Debris::none());
    }

    #[test]
    fn the_paper_preset_holds_the_published_values() {
        let paper = Preset::Paper2015.recipe();
        assert_eq!(paper.field.pixel_um, 0.25.into());
        let Optics::Gaussian(Gaussians { sigma_xy_um, sigma_z_um_per_um }) = paper.optics else { panic!() };
        assert_eq!((sigma_xy_um, sigma_z_um_per_um), (0.225.into(), 0.25.into()), "0.9 px, 1 px a µm");
        assert_eq!(paper.camera, CameraPreset::Paper.camera());
        assert_eq!(paper.camera.full_well_e, 17_850.0.into());
        assert_eq!(paper.nucleus.donors, 3.0.into());
        assert_eq!(paper.cytoplasm.sheet, Sheet::Verlet);
        assert_eq!(paper.nucleus.seam, Seam::Feather);
    }
}
