//! Air bubbles in the mountant: circles as bright as the field, with a dark rim that throws the light out.

use serde::{Deserialize, Serialize};

use super::ground::Ground;
use super::kind::{Kinds, Thing};
use super::site::Site;
use crate::phantom::piece::Phantom;
use crate::phantom::tile::Point;
use crate::phantom::wobble::wobbled_circle;
use crate::recipe::number::{Count, Number};
use crate::recipe::section::{named, section};

section! {
    /// Air bubbles in the mountant.
    pub struct Bubbles {
        /// Number of bubbles; drawn once a field.
        count: Count = Number::log_normal(0.08, 0.9), 0..=10000;
        /// Radius.
        radius_um: Number = Number::log_normal(22.0, 0.45), 1..=250, "µm";
        /// Width of the dark rim relative to the radius.
        rim: Number = Number::uniform(0.12, 0.25), 0.01..=1;
        /// How far above the cells it lies.
        height_um: Number = Number::uniform(0.0, 8.0), -1000..=1000, "µm";
        /// Absorbance of the rim: what it throws beside the objective.
        absorbance: Number = Number::uniform(0.8, 1.6), 0..=4;
        /// How late light comes through the rim; seen by bright-field optics alone.
        phase_rad: Number = Number::uniform(-2.0, -1.0), -3..=3, "radians of phase";
    }
}

/// An air bubble, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bubble {
    /// Radius, µm.
    pub radius_um: f64,
    /// Width of the rim relative to it.
    pub rim: f64,
    /// Absorbance of the rim.
    pub absorbance: f64,
    /// How late light comes through the rim, radians.
    pub phase_rad: f64,
}

impl Kinds<Bubble> for Bubbles {
    fn draw(&self, ground: &mut Ground<'_, Bubble>) {
        ground.strew_on_glass(named!(self.count), &self.height_um, |rng| Bubble {
            radius_um: self.radius_um.draw(rng),
            rim: self.rim.draw(rng),
            absorbance: self.absorbance.draw(rng),
            phase_rad: self.phase_rad.draw(rng),
        });
    }
}

impl Thing for Bubble {
    fn reach_um(&self, _pixel_um: f64) -> f64 {
        1.1 * self.radius_um + 1.0
    }

    fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        // Surface tension keeps it round.
        let circle = wobbled_circle(self.radius_um, 0.004, 0.01, &mut rng);
        let outline: Vec<Point> = circle.iter().map(|p| site.place(*p)).collect();
        let mut painting = site.painting(&outline, 0.0);
        painting.coverage.cover(&outline);
        let radius = site.px(self.radius_um);
        let cover = &painting.coverage.values;
        let mut index = 0;
        painting.absorbance.for_each(|p, value| {
            let (dx, dy) = (p[0] - site.centre[0], p[1] - site.centre[1]);
            // Darkest at the edge, where the surface is steepest, and clear towards the middle.
            let into = ((dx * dx + dy * dy).sqrt() / radius - 1.0 + self.rim) / self.rim;
            let steep = into.clamp(0.0, 1.0);
            *value = cover[index] * (self.absorbance * steep * steep) as f32;
            index += 1;
        });
        painting.finish(site.dyes.speckle, self.phase_rad, self.absorbance)
    }
}
