//! Dust on the glass, far out of focus.

use super::crystal::shard;
use super::prelude::*;

section! {
    /// Dust on the cover glass or in the mountant.
    pub struct Dust, drawn from rng as pub Grain {
        /// Number of grains; drawn once per field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(0.2, 0.9)), 0..=100000, "per field or per mm²";
        /// Diameter.
        diameter_um: Number = Number::log_normal(14.0, 0.5), 0.5..=200, "µm";
        /// Height above the cells: 170 is the outer face of a cover glass, smaller values are in the mountant.
        height_um: Number (undrawn) = Number::choice([20.0, 35.0, 60.0, 170.0]), -1000..=1000, "µm";
        /// Absorbance.
        absorbance: Number = Number::uniform(0.1, 0.7), 0..=4;
    }
}

impl Dust {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Grain>) {
        let height = |rng: &mut Stream| self.height_um.draw(rng);
        placer.place_anywhere(named!(self.count), |_, _, rng| self.one(rng), height);
    }
}

impl Grain {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.65 * self.diameter_um + 1.0
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let outline =
            context.curve_to_grid(&shard(0.5 * self.diameter_um, 7 + random::below(5, &mut rng), 0.25, &mut rng));
        let mut canvas = context.canvas(&outline, 0.0);
        canvas.fill(&outline, self.absorbance);
        canvas.into_phantom(context.dyes.speckle, 0.0, self.absorbance)
    }
}
