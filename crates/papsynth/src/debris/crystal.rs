//! Precipitated dye: dark, angular, refracting grains.

use super::prelude::*;

section! {
    /// Precipitated dye: dark, angular, refracting grains.
    pub struct Crystals, drawn from rng as pub Crystal {
        /// Number of grains; drawn once per field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(4.5, 0.9)), 0..=100000, "per field or per mm²";
        /// Fraction of the grains that are on a cell.
        on_cells: Number (undrawn) = 0.3, 0..=1;
        /// Diameter.
        diameter_um: Number = Number::log_normal(1.2, 0.4), 0.2..=50, "µm";
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.6, 0.4), 0..=4;
        /// Phase delay; has an effect only with bright-field optics.
        phase_rad: Number = Number::uniform(0.3, 1.0), -3..=3, "radians of phase";
        /// Dyes.
        dyes: DyeAmounts = DyeAmounts { haematein: 0.9, eosin_y: 0.4, orange_g: 0.4, ..DyeAmounts::none() };
    }
}

impl Crystals {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Crystal>) {
        let dyes = placer.dyes(&self.dyes);
        placer.place_on_cells(named!(self.count), &self.on_cells, |rng| Crystal { dyes, ..self.one(rng) });
    }
}

impl Crystal {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.7 * self.diameter_um + 1.0
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let outline =
            context.curve_to_grid(&shard(0.5 * self.diameter_um, 5 + random::below(3, &mut rng), 0.3, &mut rng));
        let mut canvas = context.canvas(&outline, 0.0);
        canvas.fill(&outline, self.absorbance);
        canvas.into_phantom(self.dyes, self.phase_rad, self.absorbance)
    }
}

/// Draws a polygon about the origin with corners at `radius` times 1 ± `variation`.
pub(super) fn shard(radius: f64, corners: usize, variation: f64, rng: &mut Stream) -> Vec<Point> {
    (0..corners)
        .map(|i| {
            let angle = core::f64::consts::TAU * (i as f64 + 0.6 * random::uniform(rng)) / corners as f64;
            let reach = radius * random::between(1.0 - variation, 1.0 + variation, rng);
            [reach * libm::cos(angle), reach * libm::sin(angle)]
        })
        .collect()
}
