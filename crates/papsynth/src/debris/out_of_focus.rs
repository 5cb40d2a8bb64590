//! Objects far outside the depth of the slide ("Out of focus objects"): shaped and textured like leukocytes.

use rand_core::Rng;
use serde::{Deserialize, Serialize};

use super::ground::{Ground, Lie};
use super::kind::{Kinds, Thing};
use super::site::Site;
use crate::phantom::piece::Phantom;
use crate::phantom::tile::{Point, Tile, area};
use crate::phantom::wobble::{placed, textured, wobbled_circle};
use crate::random;
use crate::recipe::number::{Count, Number};
use crate::recipe::section::{named, section};

section! {
    /// Objects far outside the depth of the slide ("Out of focus objects").
    pub struct OutOfFocus {
        /// Number of objects; drawn once a field.
        count: Count = Number::uniform(0.0, 3.0), 0..=100000;
        /// Radius (s of Eq. 7).
        radius_um: Number = Number::log_normal(9.0, 0.5), 0.3..=500, "µm";
        /// Range of the radial perturbation (α of Eq. 7).
        alpha: Number = 0.15, 0..=0.5;
        /// Range of the angular perturbation (β of Eq. 7).
        beta: Number = 0.2, 0..=0.5, "radians";
        /// Distance from the middle of the slide, above or below it.
        depth_um: Number = Number::uniform(14.0, 40.0), 0..=1000, "µm";
        /// Absorbance.
        absorbance: Number = Number::uniform(0.04, 0.16), 0..=4;
    }
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

impl Kinds<Blob> for OutOfFocus {
    fn draw(&self, ground: &mut Ground<'_, Blob>) {
        for number in 0..ground.count(named!(self.count)) {
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
