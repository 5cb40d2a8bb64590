//! Objects far outside the depth of the slide ("Out of focus objects"): shaped and textured like leukocytes.

use rand_core::Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::check::Section;
use super::ground::{Ground, Lie};
use super::kind::{Kinds, Thing};
use super::site::Site;
use crate::phantom::piece::Phantom;
use crate::phantom::tile::{Point, Tile, area};
use crate::phantom::wobble::{placed, textured, wobbled_circle};
use crate::random;
use crate::recipe::number::Number;

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

/// An object far outside the depth of the slide, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blob {
    /// Radius, µm.
    pub radius_um: f64,
    /// Range of the radial perturbation (α of Eq. 7).
    pub alpha: f64,
    /// Range of the angular perturbation (β of Eq. 7).
    pub beta: f64,
    /// Absorbance.
    pub absorbance: f64,
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

impl Kinds<Blob> for OutOfFocus {
    fn none() -> Self {
        Self { count: 0.0.into(), ..Self::default() }
    }

    fn check(&self, section: &mut Section<'_>) {
        section.count("count", &self.count, 0.0, 1e5);
        section.number("radius_um", &self.radius_um, 0.3, 500.0);
        section.number("alpha", &self.alpha, 0.0, 0.5);
        section.number("beta", &self.beta, 0.0, 0.5);
        section.number("depth_um", &self.depth_um, 0.0, 1000.0);
        section.absorbance("absorbance", &self.absorbance);
    }

    fn draw(&self, ground: &mut Ground<'_, Blob>) {
        for number in 0..ground.count("count", &self.count) {
            let mut rng = ground.stream(number, "body");
            let centre_um = ground.anywhere(&mut rng);
            let blob = Blob {
                radius_um: self.radius_um.draw(&mut rng),
                alpha: self.alpha.draw(&mut rng),
                beta: self.beta.draw(&mut rng),
                absorbance: self.absorbance.draw(&mut rng),
            };
            let side = if random::chance(0.5, &mut rng) { 1.0 } else { -1.0 };
            let depth_um = side * self.depth_um.draw(&mut rng);
            let lie = Lie::any_way(centre_um, depth_um, &mut rng);
            ground.add(number, 0, lie, blob);
        }
    }
}

/// Size of the cells of the Perlin noise inside, relative to the radius.
const NOISE_CELL: f64 = 0.7;
/// Strength of that noise relative to the absorbance.
const NOISE_STRENGTH: f32 = 0.6;

impl Thing for Blob {
    fn absorbance(&self) -> f64 {
        self.absorbance
    }

    fn reach_um(&self, _pixel_um: f64) -> f64 {
        (1.2 + 1.5 * self.alpha) * self.radius_um
    }

    fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let radius = site.px(self.radius_um);
        let turn = site.rotation_deg.to_radians();
        let shape: Vec<Point> = wobbled_circle(radius, self.alpha, self.beta, &mut rng)
            .iter()
            .map(|p| placed(*p, turn, site.centre))
            .collect();
        let mut coverage = Tile::around(&shape, 2.0);
        coverage.cover(&shape);
        let mut tile = coverage.clone();
        textured(&mut tile, site.centre, NOISE_CELL * radius, 3, NOISE_STRENGTH, self.absorbance, rng.next_u64());
        Phantom::whole(tile, coverage, area(&shape), site.dyes.nucleus)
    }
}
