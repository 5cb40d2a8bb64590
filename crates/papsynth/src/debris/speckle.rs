//! Specks of dust and stain ("Speckles"): a pixel, extended by one in a random direction, then dilated.

use super::prelude::*;

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
    pub struct Speckles, drawn from rng as pub Speckle {
        /// Number of speckles; drawn once a field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(67.0, 0.7)), 0..=1000000, "per field or per mm²";
        /// How it is grown from its two pixels.
        form: SpeckForm = SpeckForm::Round;
        /// How often a speckle is grown by a pixel to all sides (binary dilation).
        dilations: Count = Number::log_normal(0.35, 0.9), 0..=50;
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.09, 0.6), 0..=4;
        /// How late light comes through a speck: the halo that changes sign with focus. Seen by bright-field optics
        /// alone.
        phase_rad: Number (given f64) = Number::normal(0.25, 0.15), -3..=3, "radians of phase";
    }
}

impl Speckles {
    pub(super) fn draw(&self, ground: &mut Ground<'_, Speckle>) {
        let speckle = |ground: &Ground<'_, Speckle>, number: u64, rng: &mut Stream| Speckle {
            phase_rad: self.phase_rad.draw(&mut ground.stream(number, "phase")),
            ..self.one(rng)
        };
        ground.strew_anywhere(named!(self.count), speckle, random::normal);
    }
}

impl Speckle {
    pub(super) fn reach_um(&self, pixel_um: f64) -> f64 {
        (self.dilations as f64 + 3.0) * pixel_um
    }

    pub(super) fn phantom(&self, site: &Site<'_>) -> Phantom {
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
            *value *= self.absorbance.max(MIN_ABSORBANCE) as f32;
        }
        Phantom::whole(tile, coverage, area, site.dyes.speckle).with_phase(self.phase_rad, self.absorbance)
    }
}
