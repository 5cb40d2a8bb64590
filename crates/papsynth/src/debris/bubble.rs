//! Air bubbles in the mountant: bright circles with a dark rim that deflects light out of the objective.

use super::prelude::*;

section! {
    /// Air bubbles in the mountant.
    pub struct Bubbles, drawn from rng as pub Bubble {
        /// Number of bubbles; drawn once per field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(0.06, 0.9)), 0..=10000, "per field or per mm²";
        /// Radius.
        radius_um: Number = Number::log_normal(22.0, 0.45), 1..=250, "µm";
        /// Width of the dark rim relative to the radius.
        rim: Number = Number::uniform(0.12, 0.25), 0.01..=1;
        /// Height above the cells.
        height_um: Number (undrawn) = Number::uniform(0.0, 8.0), -1000..=1000, "µm";
        /// Absorbance of the rim, which represents light deflected out of the objective.
        absorbance: Number = Number::uniform(0.8, 1.6), 0..=4;
        /// Phase delay of the rim; has an effect only with bright-field optics.
        phase_rad: Number = Number::uniform(-2.0, -1.0), -3..=3, "radians of phase";
    }
}

impl Bubbles {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Bubble>) {
        let height = |rng: &mut Stream| self.height_um.draw(rng);
        placer.place_anywhere(named!(self.count), |_, _, rng| self.one(rng), height);
    }
}

impl Bubble {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        1.1 * self.radius_um + 1.0
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        // Surface tension keeps it round.
        let circle = perturbed_circle(self.radius_um, 0.004, 0.01, &mut rng);
        let outline = context.curve_to_grid(&circle);
        let mut canvas = context.canvas(&outline, 0.0);
        canvas.coverage.cover(&outline);
        let radius = context.px(self.radius_um);
        canvas.shade(|p| {
            let (dx, dy) = (p[0] - context.centre[0], p[1] - context.centre[1]);
            // Darkest at the edge, where the surface is steepest, and clear towards the centre.
            let into = ((dx * dx + dy * dy).sqrt() / radius - 1.0 + self.rim) / self.rim;
            let steep = into.clamp(0.0, 1.0);
            self.absorbance * steep * steep
        });
        canvas.into_phantom(context.dyes.speckle, self.phase_rad, self.absorbance)
    }
}
