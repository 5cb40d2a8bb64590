//! Objects far outside the depth of the specimen (paper, section "Out of focus objects"), with the shape and texture of
//! leukocytes.

use super::prelude::*;

section! {
    /// Objects far outside the depth of the specimen (paper, section "Out of focus objects").
    pub struct OutOfFocus, drawn from rng as pub Blob {
        /// Number of objects; drawn once per field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::uniform(0.0, 34.0)), 0..=100000, "per field or per mm²";
        /// Radius (s of Eq. 7).
        radius_um: Number = Number::log_normal(9.0, 0.5), 0.3..=500, "µm";
        /// Range of the radial perturbation (α of Eq. 7).
        alpha: Number = 0.15, 0..=0.5;
        /// Range of the angular perturbation (β of Eq. 7).
        beta: Number = 0.2, 0..=0.5, "radians";
        /// Distance above or below the centre of the specimen.
        depth_um: Number (undrawn) = Number::uniform(14.0, 40.0), 0..=1000, "µm";
        /// Absorbance.
        absorbance: Number = Number::uniform(0.04, 0.16), 0..=4;
    }
}

impl OutOfFocus {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Blob>) {
        let depth = |rng: &mut Stream| {
            let side = if random::chance(0.5, rng) { 1.0 } else { -1.0 };
            side * self.depth_um.draw(rng)
        };
        placer.place_anywhere(named!(self.count), |_, _, rng| self.one(rng), depth);
    }
}

/// Cell size of the Perlin noise, relative to the radius.
const NOISE_CELL: f64 = 0.7;
/// Strength of the noise relative to the absorbance.
const NOISE_STRENGTH: f32 = 0.6;

impl Blob {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        (1.2 + 1.5 * self.alpha) * self.radius_um
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let radius = context.px(self.radius_um);
        let turn = context.rotation_deg.to_radians();
        let shape: Vec<Point> = perturbed_circle(radius, self.alpha, self.beta, &mut rng)
            .iter()
            .map(|p| placed(*p, turn, context.centre))
            .collect();
        let mut coverage = Tile::around(&shape, 2.0);
        coverage.cover(&shape);
        let mut tile = coverage.clone();
        textured(&mut tile, context.centre, NOISE_CELL * radius, 3, NOISE_STRENGTH, self.absorbance, rng.next_u64());
        Phantom::whole(tile, coverage, area(&shape), context.dyes.nucleus)
    }
}
