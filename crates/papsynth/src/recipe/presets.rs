//! Recipes to start from: what a slide looks like. Each is a file of `presets/` that holds what differs from the default.

use super::imaging::{Focus, Optics};
use super::whole::Recipe;
use crate::words::words;

macro_rules! presets {
    ($($(#[$doc:meta])* $Name:ident = $name:literal,)*) => {
        words! {
            /// A named recipe.
            pub enum Preset { $($(#[$doc])* $Name = $name,)* }
        }

        impl Preset {
            /// The preset as TOML: a line that says what it shows, and what differs from the default.
            fn text(self) -> &'static str {
                match self {
                    $(Self::$Name => include_str!(concat!("../../presets/", $name, ".toml")),)*
                }
            }
        }
    };
}

presets! {
    /// A liquid-based preparation: free cells and small groups, the default.
    Lbc = "lbc",
    /// The paper's simulator with the values of its released code.
    Paper2015 = "paper-2015",
    /// Few cells, hardly any debris.
    Sparse = "sparse",
    /// A field that is covered with cells several layers deep.
    Dense = "dense",
    /// A conventional smear: thick, uneven, with blood, mucus and leukocytes.
    Conventional = "conventional",
    /// Cells of a low-grade lesion (LSIL), many with a cleared space round the nucleus.
    Lsil = "lsil",
    /// A field with cells of a high-grade lesion (HSIL), as in the paper's Fig. 13.
    HighGrade = "high-grade",
    /// Squamous carcinoma.
    Carcinoma = "carcinoma",
    /// A smear of atrophy: parabasal and basal cells.
    Atrophic = "atrophic",
    /// Palisades and honeycombs of endocervical cells, metaplastic cells.
    Endocervical = "endocervical",
    /// Many leukocytes, bacteria and debris.
    Inflamed = "inflamed",
    /// Bacterial vaginosis: clue cells and clouds of cocci, no lactobacilli.
    BacterialVaginosis = "bacterial-vaginosis",
    /// *Candida*: pseudohyphae and yeasts among inflamed cells.
    Candida = "candida",
    /// Trichomonads among inflamed cells.
    Trichomonas = "trichomonas",
    /// Squames of the oral mucosa: another smear, of classes of its own.
    Oral = "oral",
    /// The default slide as a scanner shows it that fuses planes to pictures of extended focus.
    ExtendedFocus = "extended-focus",
}

impl Preset {
    /// What the preset shows, in a line.
    #[must_use]
    pub fn summary(self) -> &'static str {
        self.text().lines().next().unwrap_or_default().trim_start_matches("# ")
    }

    /// The recipe.
    ///
    /// # Panics
    /// Never: the files are part of the crate and its tests read them.
    #[must_use]
    pub fn recipe(self) -> Recipe {
        Recipe::from_toml(self.text()).expect("the presets that ship are sound")
    }
}

impl Recipe {
    /// The same slide as a scanner shows it that fuses planes to a picture of extended focus: focus, blur, soft edges, noise,
    /// texture and strength of stain of [`Preset::ExtendedFocus`].
    #[must_use]
    pub fn fused(mut self) -> Self {
        let like = Preset::ExtendedFocus.recipe();
        self.focus = Focus { centre_um: self.focus.centre_um, ..like.focus };
        if let (Optics::BrightField(own), Optics::BrightField(like)) = (&mut self.optics, like.optics) {
            own.extra_blur_um = like.extra_blur_um;
        }
        macro_rules! take {
            ($($section:ident.$number:ident),*) => {
                $(self.$section.$number = like.$section.$number;)*
            };
        }
        take!(nucleus.edge_um, nucleus.clumping, cytoplasm.rim_um);
        take!(camera.prnu, camera.full_well_e, camera.glare_subtracted, camera.read_noise_e);
        take!(stain.slide_cytoplasm, stain.slide_nucleus, stain.field_texture);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::super::camera::CameraPreset;
    use super::super::imaging::Gaussians;
    use super::super::specimen::{Seam, Sheet};
    use super::*;

    #[test]
    fn every_preset_is_sound_and_reads_back_as_written() {
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
