//! Precipitated dye: dark, angular, refracting grains.

use serde::{Deserialize, Serialize};

use super::ground::Ground;
use super::kind::{Kinds, Thing};
use super::site::Site;
use crate::phantom::piece::Phantom;
use crate::phantom::tile::Point;
use crate::random;
use crate::recipe::dyes::DyeAmounts;
use crate::recipe::number::{Count, Number};
use crate::recipe::section::{named, section};

section! {
    /// Precipitated dye: dark, angular, refracting grains.
    pub struct Crystals {
        /// Number of grains; drawn once a field.
        count: Count = Number::log_normal(0.45, 0.9), 0..=100000;
        /// Share of the grains that lie on a cell.
        on_cells: Number = 0.3, 0..=1;
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

/// A grain of dye, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Crystal {
    /// Diameter, µm.
    pub diameter_um: f64,
    /// Absorbance.
    pub absorbance: f64,
    /// How late light comes through it, radians.
    pub phase_rad: f64,
    /// Its dyes where its absorbance is 1.
    pub dyes: dye_spectra::Amounts,
}

impl Kinds<Crystal> for Crystals {
    fn draw(&self, ground: &mut Ground<'_, Crystal>) {
        let dyes = ground.dyes(&self.dyes);
        ground.strew_on_cells(named!(self.count), &self.on_cells, |rng| Crystal {
            diameter_um: self.diameter_um.draw(rng),
            absorbance: self.absorbance.draw(rng),
            phase_rad: self.phase_rad.draw(rng),
            dyes,
        });
    }
}

impl Thing for Crystal {
    fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.7 * self.diameter_um + 1.0
    }

    fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let outline = site.places(&shard(0.5 * self.diameter_um, 5 + random::below(3, &mut rng), 0.3, &mut rng));
        let mut painting = site.painting(&outline, 0.0);
        painting.fill(&outline, self.absorbance);
        painting.finish(self.dyes, self.phase_rad, self.absorbance)
    }
}

/// A polygon with sharp corners about the origin, those so unevenly far out.
pub(super) fn shard(radius: f64, corners: usize, uneven: f64, rng: &mut crate::key::Stream) -> Vec<Point> {
    (0..corners)
        .map(|i| {
            let angle = core::f64::consts::TAU * (i as f64 + 0.6 * random::uniform(rng)) / corners as f64;
            let reach = radius * random::between(1.0 - uneven, 1.0 + uneven, rng);
            [reach * libm::cos(angle), reach * libm::sin(angle)]
        })
        .collect()
}
