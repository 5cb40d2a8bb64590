//! Air bubbles in the mountant: circles as bright as the field, with a dark rim that throws the light out.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::check::Section;
use super::ground::{Ground, Lie};
use super::kind::{Kinds, Thing};
use super::site::Site;
use crate::phantom::piece::Phantom;
use crate::phantom::tile::Point;
use crate::phantom::wobble::wobbled_circle;
use crate::recipe::number::Number;

/// Air bubbles in the mountant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Bubbles {
    /// Number of bubbles, 0 to 10000; drawn once a field.
    pub count: Number,
    /// Radius, µm, 1 to 250.
    pub radius_um: Number,
    /// Width of the dark rim relative to the radius, 0.01 to 1.
    pub rim: Number,
    /// How far above the cells it lies, µm, -1000 to 1000.
    pub height_um: Number,
    /// Absorbance of the rim, 0 to 4: what it throws beside the objective.
    pub absorbance: Number,
    /// How late light comes through the rim, radians of phase, -3 to 3; seen by bright-field optics alone.
    pub phase_rad: Number,
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

impl Default for Bubbles {
    fn default() -> Self {
        Self {
            count: Number::log_normal(0.08, 0.9),
            radius_um: Number::log_normal(22.0, 0.45),
            rim: Number::uniform(0.12, 0.25),
            height_um: Number::uniform(0.0, 8.0),
            absorbance: Number::uniform(0.8, 1.6),
            phase_rad: Number::uniform(-2.0, -1.0),
        }
    }
}

impl Kinds<Bubble> for Bubbles {
    fn none() -> Self {
        Self { count: 0.0.into(), ..Self::default() }
    }

    fn check(&self, section: &mut Section<'_>) {
        section.count("count", &self.count, 0.0, 1e4);
        section.number("radius_um", &self.radius_um, 1.0, 250.0);
        section.number("rim", &self.rim, 0.01, 1.0);
        section.height_um("height_um", &self.height_um);
        section.absorbance("absorbance", &self.absorbance);
        section.phase_rad("phase_rad", &self.phase_rad);
    }

    fn draw(&self, ground: &mut Ground<'_, Bubble>) {
        for number in 0..ground.count("count", &self.count) {
            let mut rng = ground.stream(number, "body");
            let centre_um = ground.anywhere(&mut rng);
            let bubble = Bubble {
                radius_um: self.radius_um.draw(&mut rng),
                rim: self.rim.draw(&mut rng),
                absorbance: self.absorbance.draw(&mut rng),
                phase_rad: self.phase_rad.draw(&mut rng),
            };
            let lie = Lie::any_way(centre_um, self.height_um.draw(&mut rng), &mut rng);
            ground.add(number, 0, lie, bubble);
        }
    }
}

impl Thing for Bubble {
    fn absorbance(&self) -> f64 {
        self.absorbance
    }

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
