//! Specks of dust and stain ("Speckles"): a pixel, extended by one in a random direction, then dilated.

use serde::{Deserialize, Serialize};

use super::ground::{Ground, Lie};
use super::kind::{Kinds, Thing};
use super::site::Site;
use crate::phantom::piece::{LEAST_ABSORBANCE, Phantom};
use crate::phantom::tile::Tile;
use crate::random;
use crate::recipe::number::{Count, Number};
use crate::recipe::section::{named, section};

section! {
    /// How a speck is grown from its two pixels.
    pub enum SpeckForm {
        /// Round, whatever the pixels.
        Round,
        /// The paper's: dilated by a cross of pixels, which makes diamonds.
        Dilated,
    }
}

section! {
    /// Specks of dust and stain ("Speckles").
    pub struct Speckles {
        /// Number of speckles; drawn once a field.
        count: Count = Number::log_normal(6.0, 0.7), 0..=1000000;
        /// How it is grown from its two pixels.
        form: SpeckForm = SpeckForm::Round;
        /// How often a speckle is grown by a pixel to all sides (binary dilation).
        dilations: Count = Number::log_normal(0.35, 0.9), 0..=50;
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.09, 0.6), 0..=4;
        /// How late light comes through a speck: the halo that changes sign with focus. Seen by bright-field optics
        /// alone.
        phase_rad: Number = Number::normal(0.25, 0.15), -3..=3, "radians of phase";
    }
}

/// A speck of dust or stain, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Speckle {
    /// How it was grown.
    pub form: SpeckForm,
    /// How often it was grown by a pixel.
    pub dilations: usize,
    /// Absorbance.
    pub absorbance: f64,
    /// How late light comes through it, radians.
    pub phase_rad: f64,
}

impl Kinds<Speckle> for Speckles {
    fn draw(&self, ground: &mut Ground<'_, Speckle>) {
        for number in 0..ground.count(named!(self.count)) {
            let mut rng = ground.stream(number, "body");
            let centre_um = ground.anywhere(&mut rng);
            let speckle = Speckle {
                form: self.form,
                dilations: self.dilations.draw_count(&mut rng),
                absorbance: self.absorbance.draw(&mut rng),
                phase_rad: self.phase_rad.draw(&mut ground.stream(number, "phase")),
            };
            let depth_um = random::normal(&mut rng);
            let lie = Lie::any_way(centre_um, depth_um, &mut rng);
            ground.add(number, 0, lie, speckle);
        }
    }
}

impl Thing for Speckle {
    fn reach_um(&self, pixel_um: f64) -> f64 {
        (self.dilations as f64 + 3.0) * pixel_um
    }

    fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let pixel = site.oversampling as f64;
        // Its pixels are those of the image, whatever grid it is drawn on.
        let [x, y] = site.view.to_px(site.centre_um).map(libm::round);
        let [dx, dy] = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][random::below(4, &mut rng)];
        let seeds = [[x, y], [x + dx, y + dy]];
        let to_grid = |p: [f64; 2]| p.map(|v| (v + 0.5) * pixel - 0.5);
        let reach = self.dilations as f64;
        let mut coverage = Tile::around(&seeds.map(to_grid), (reach + 2.0) * pixel);
        coverage.for_each(|p, value| {
            let p = p.map(|v| (v + 0.5) / pixel - 0.5);
            *value = match self.form {
                // Dilation by a cross, so often, is everything within that many steps along rows and columns.
                SpeckForm::Dilated => {
                    let p = p.map(libm::round);
                    let inside = seeds.iter().any(|s| (p[0] - s[0]).abs() + (p[1] - s[1]).abs() <= reach);
                    if inside { 1.0 } else { 0.0 }
                }
                // By a disc: everything nearer to the way between the two than the radius, its edge as far as it is
                // covered.
                SpeckForm::Round => {
                    let along = ((p[0] - x) * dx + (p[1] - y) * dy).clamp(0.0, 1.0);
                    let (ex, ey) = (p[0] - x - along * dx, p[1] - y - along * dy);
                    ((reach + 0.5 - (ex * ex + ey * ey).sqrt()) * pixel + 0.5).clamp(0.0, 1.0) as f32
                }
            };
        });
        let area = coverage.values.iter().map(|v| f64::from(*v)).sum();
        let mut tile = coverage.clone();
        for value in &mut tile.values {
            *value *= self.absorbance.max(LEAST_ABSORBANCE) as f32;
        }
        Phantom::whole(tile, coverage, area, site.dyes.speckle).refracting(self.phase_rad, self.absorbance)
    }
}
