//! Bare nuclei: nuclei of intermediate cells that have lost their cytoplasm but for faint shreds.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::check::Section;
use super::ground::{Ground, Lie};
use super::kind::{Kinds, Thing};
use super::paint::{Painting, Stroke};
use super::site::Site;
use crate::phantom::piece::Phantom;
use crate::phantom::pools::Look;
use crate::phantom::tile::Point;
use crate::phantom::wobble::wobbled_circle;
use crate::random;
use crate::recipe::number::Number;

/// Bare nuclei: what bacteria leave of intermediate cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BareNuclei {
    /// Number of nuclei, 0 to 100000; drawn once a field.
    pub count: Number,
    /// Share of the nuclei that lie on a cell, 0 to 1.
    pub on_cells: Number,
    /// Radius of the disc of the same area, µm, 1 to 20.
    pub radius_um: Number,
    /// Length relative to width, 1 to 4.
    pub elongation: Number,
    /// Absorbance, 0 to 4, before the field's stain of nuclei.
    pub absorbance: Number,
    /// Contrast of its chromatin relative to the absorbance, 0 to 2.
    pub texture: Number,
    /// Absorbance of the shreds of cytoplasm round it, 0 to 4.
    pub shreds: Number,
}

/// A bare nucleus, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BareNucleus {
    /// Radius of the disc of the same area, µm.
    pub radius_um: f64,
    /// Length relative to width.
    pub elongation: f64,
    /// Absorbance.
    pub absorbance: f64,
    /// Contrast of its chromatin relative to the absorbance.
    pub texture: f64,
    /// Absorbance of the shreds of cytoplasm round it.
    pub shreds: f64,
    /// Dyes of the shreds where their absorbance is 1.
    pub dyes: dye_spectra::Amounts,
}

impl Default for BareNuclei {
    fn default() -> Self {
        Self {
            count: Number::log_normal(0.5, 0.9),
            on_cells: 0.15.into(),
            radius_um: Number::normal(3.7, 0.35),
            elongation: Number::uniform(1.05, 1.5),
            absorbance: Number::normal(0.34, 0.05),
            texture: Number::uniform(0.08, 0.18),
            shreds: Number::uniform(0.0, 0.06),
        }
    }
}

impl Kinds<BareNucleus> for BareNuclei {
    fn none() -> Self {
        Self { count: 0.0.into(), ..Self::default() }
    }

    fn check(&self, section: &mut Section<'_>) {
        section.count("count", &self.count, 0.0, 1e5);
        section.share("on_cells", &self.on_cells);
        section.number("radius_um", &self.radius_um, 1.0, 20.0);
        section.number("elongation", &self.elongation, 1.0, 4.0);
        section.absorbance("absorbance", &self.absorbance);
        section.number("texture", &self.texture, 0.0, 2.0);
        section.absorbance("shreds", &self.shreds);
    }

    fn draw(&self, ground: &mut Ground<'_, BareNucleus>) {
        let dyes = ground.cyanophilic();
        for number in 0..ground.count("count", &self.count) {
            let mut rng = ground.stream(number, "body");
            let (centre_um, depth_um) = ground.spot(&self.on_cells, &mut rng);
            let nucleus = BareNucleus {
                radius_um: self.radius_um.draw(&mut rng),
                elongation: self.elongation.draw(&mut rng),
                absorbance: self.absorbance.draw(&mut rng) * ground.nuclear_stain(),
                texture: self.texture.draw(&mut rng),
                shreds: self.shreds.draw(&mut rng),
                dyes,
            };
            let lie = Lie::any_way(centre_um, depth_um, &mut rng);
            ground.add(number, 0, lie, nucleus);
        }
    }
}

/// Width of the dark rim, µm, and how much darker it is.
const RIM_UM: f64 = 0.45;
const RIM: f32 = 0.15;

/// Size (standard deviation) of clumps of chromatin, µm.
const CLUMP_UM: f64 = 0.35;

/// Shreds round a nucleus.
const SHREDS: usize = 7;

impl Thing for BareNucleus {
    fn absorbance(&self) -> f64 {
        self.absorbance
    }

    fn reach_um(&self, _pixel_um: f64) -> f64 {
        (1.8 * self.elongation.max(1.0 / self.elongation).sqrt()).max(2.8) * self.radius_um
    }

    fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let stretch = self.elongation.sqrt();
        let shape = wobbled_circle(self.radius_um, 0.04, 0.08, &mut rng);
        let scaled = |by: f64| -> Vec<Point> {
            shape.iter().map(|p| site.place([by * stretch * p[0], by * p[1] / stretch])).collect()
        };
        let outline = scaled(1.0);
        let mut nucleus = site.painting(&outline, 1.2 * self.radius_um);
        nucleus.coverage.cover(&outline);
        let mut inner = nucleus.coverage.blank();
        inner.cover(&scaled((1.0 - RIM_UM / self.radius_um).max(0.0)));
        let values = nucleus.absorbance.values.iter_mut().zip(&nucleus.coverage.values).zip(&inner.values);
        for ((value, cover), inner) in values {
            *value = self.absorbance as f32 * (cover + RIM * (cover - inner).max(0.0));
        }
        let look = Look::clouds(site.px(CLUMP_UM), &mut rng);
        nucleus.texture(site.pools.clouds(), &look, self.texture as f32);
        let mut shreds = Painting { coverage: nucleus.coverage.blank(), absorbance: nucleus.coverage.blank() };
        for _ in 0..SHREDS {
            let (angle, reach) = (random::direction(&mut rng), self.radius_um * random::between(1.0, 1.8, &mut rng));
            let ends = [0.7 * self.radius_um, reach];
            let bend = angle + 0.3 * random::normal(&mut rng);
            let ends = ends.map(|r| site.place([r * libm::cos(bend), r * libm::sin(angle)]));
            let half_width = site.px(self.radius_um * random::between(0.12, 0.45, &mut rng));
            shreds.stroke(&Stroke { ends, half_widths: [half_width, 0.4 * half_width] }, self.shreds);
        }
        nucleus.finish(site.dyes.nucleus, 0.0, self.absorbance).stained(shreds.absorbance, self.dyes)
    }
}
