//! Air bubbles in the mountant: circles as bright as the field, with a dark rim that throws the light out.

use super::prelude::*;

section! {
    /// Air bubbles in the mountant.
    pub struct Bubbles, drawn from rng as pub Bubble {
        /// Number of bubbles; drawn once a field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(0.16, 0.9)), 0..=10000, "per field or per mm²";
        /// Radius.
        radius_um: Number = Number::log_normal(22.0, 0.45), 1..=250, "µm";
        /// Width of the dark rim relative to the radius.
        rim: Number = Number::uniform(0.12, 0.25), 0.01..=1;
        /// How far above the cells it lies.
        height_um: Number (undrawn) = Number::uniform(0.0, 8.0), -1000..=1000, "µm";
        /// Absorbance of the rim: what it throws beside the objective.
        absorbance: Number = Number::uniform(0.8, 1.6), 0..=4;
        /// How late light comes through the rim; seen by bright-field optics alone.
        phase_rad: Number = Number::uniform(-2.0, -1.0), -3..=3, "radians of phase";
    }
}

impl Bubbles {
    pub(super) fn draw(&self, ground: &mut Ground<'_, Bubble>) {
        let height = |rng: &mut Stream| self.height_um.draw(rng);
        ground.strew_anywhere(named!(self.count), |_, _, rng| self.one(rng), height);
    }
}

impl Bubble {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        1.1 * self.radius_um + 1.0
    }

    pub(super) fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        // Surface tension keeps it round.
        let circle = perturbed_circle(self.radius_um, 0.004, 0.01, &mut rng);
        let outline = site.places(&circle);
        let mut painting = site.painting(&outline, 0.0);
        painting.coverage.cover(&outline);
        let radius = site.px(self.radius_um);
        painting.shade(|p| {
            let (dx, dy) = (p[0] - site.centre[0], p[1] - site.centre[1]);
            // Darkest at the edge, where the surface is steepest, and clear towards the middle.
            let into = ((dx * dx + dy * dy).sqrt() / radius - 1.0 + self.rim) / self.rim;
            let steep = into.clamp(0.0, 1.0);
            self.absorbance * steep * steep
        });
        painting.finish(site.dyes.speckle, self.phase_rad, self.absorbance)
    }
}
