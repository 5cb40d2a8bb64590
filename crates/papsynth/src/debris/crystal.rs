//! Precipitated dye: dark, angular, refracting grains.

use super::prelude::*;

section! {
    /// Precipitated dye: dark, angular, refracting grains.
    pub struct Crystals, drawn from rng as pub Crystal {
        /// Number of grains; drawn once a field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(4.5, 0.9)), 0..=100000, "per field or per mm²";
        /// Share of the grains that lie on a cell.
        on_cells: Number (undrawn) = 0.3, 0..=1;
        /// Diameter.
        diameter_um: Number = Number::log_normal(1.2, 0.4), 0.2..=50, "µm";
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.6, 0.4), 0..=4;
        /// How late light comes through it; seen by bright-field optics alone.
        phase_rad: Number = Number::uniform(0.3, 1.0), -3..=3, "radians of phase";
        /// Its dyes.
        dyes: DyeAmounts = DyeAmounts { haematein: 0.9, eosin_y: 0.4, orange_g: 0.4, ..DyeAmounts::none() };
    }
}

impl Crystals {
    pub(super) fn draw(&self, ground: &mut Ground<'_, Crystal>) {
        let dyes = ground.dyes(&self.dyes);
        ground.strew_on_cells(named!(self.count), &self.on_cells, |rng| Crystal { dyes, ..self.one(rng) });
    }
}

impl Crystal {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.7 * self.diameter_um + 1.0
    }

    pub(super) fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let outline = site.places(&shard(0.5 * self.diameter_um, 5 + random::below(3, &mut rng), 0.3, &mut rng));
        let mut painting = site.painting(&outline, 0.0);
        painting.fill(&outline, self.absorbance);
        painting.finish(self.dyes, self.phase_rad, self.absorbance)
    }
}

/// A polygon with sharp corners about the origin, those so unevenly far out.
pub(super) fn shard(radius: f64, corners: usize, uneven: f64, rng: &mut Stream) -> Vec<Point> {
    (0..corners)
        .map(|i| {
            let angle = core::f64::consts::TAU * (i as f64 + 0.6 * random::uniform(rng)) / corners as f64;
            let reach = radius * random::between(1.0 - uneven, 1.0 + uneven, rng);
            [reach * libm::cos(angle), reach * libm::sin(angle)]
        })
        .collect()
}
