//! Scratches in the glass: long, thin, straight and interrupted lines.

use serde::{Deserialize, Serialize};

use super::ground::Ground;
use super::kind::{Kinds, Thing};
use super::paint::Stroke;
use super::site::Site;
use crate::phantom::piece::Phantom;
use crate::phantom::tile::Point;
use crate::random;
use crate::recipe::number::{Count, Number};
use crate::recipe::section::{named, section};

section! {
    /// Scratches in the slide or in the cover glass.
    pub struct Scratches {
        /// Number of scratches; drawn once a field.
        count: Count = Number::log_normal(0.12, 0.8), 0..=10000;
        /// Length.
        length_um: Number = Number::uniform(20.0, 120.0), 5..=500, "µm";
        /// Width.
        width_um: Number = Number::log_normal(0.7, 0.4), 0.1..=20, "µm";
        /// How far above the cells it lies: a little below 0 is the slide's inner face, 170 the outside of a cover
        /// glass, where only wide ones are seen.
        height_um: Number = Number::choice([-3.0, 170.0, 170.0]), -1000..=1000, "µm";
        /// Absorbance.
        absorbance: Number = Number::uniform(0.02, 0.08), 0..=4;
        /// How late light comes through it; seen by bright-field optics alone.
        phase_rad: Number = Number::uniform(-0.4, 0.4), -3..=3, "radians of phase";
    }
}

/// A scratch, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scratch {
    /// Length, µm.
    pub length_um: f64,
    /// Width, µm.
    pub width_um: f64,
    /// Absorbance.
    pub absorbance: f64,
    /// How late light comes through it, radians.
    pub phase_rad: f64,
}

impl Kinds<Scratch> for Scratches {
    fn draw(&self, ground: &mut Ground<'_, Scratch>) {
        ground.strew_on_glass(named!(self.count), &self.height_um, |rng| Scratch {
            length_um: self.length_um.draw(rng),
            width_um: self.width_um.draw(rng),
            absorbance: self.absorbance.draw(rng),
            phase_rad: self.phase_rad.draw(rng),
        });
    }
}

/// Straight parts of a scratch.
const PARTS: usize = 24;

/// Share of the parts where the point skipped.
const SKIPPED: f64 = 0.15;

impl Thing for Scratch {
    fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.6 * self.length_um + self.width_um
    }

    fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let step = self.length_um / PARTS as f64;
        let bow = 0.1 * random::normal(&mut rng) / self.length_um;
        let line: Vec<(Point, f64)> = (0..=PARTS)
            .map(|part| {
                let x = step * part as f64 - 0.5 * self.length_um;
                let width = self.width_um * random::between(0.4, 1.0, &mut rng);
                (site.place([x, bow * x * x]), site.px(0.5 * width))
            })
            .collect();
        let mut painting = site.painting(line.iter().map(|(at, _)| at), 0.5 * self.width_um);
        for (part, pair) in line.windows(2).enumerate() {
            let kept = part == 0 || !random::chance(SKIPPED, &mut rng);
            if kept {
                let stroke = Stroke { ends: [pair[0].0, pair[1].0], half_widths: [pair[0].1, pair[1].1] };
                painting.stroke(&stroke, 0.0);
            }
        }
        for (value, cover) in painting.absorbance.values.iter_mut().zip(&painting.coverage.values) {
            *value = self.absorbance as f32 * cover;
        }
        painting.finish(site.dyes.speckle, self.phase_rad, self.absorbance)
    }
}
