//! Specks of dust and stain: two adjacent pixels in a random direction, dilated (paper, section "Speckles").

use super::prelude::*;

section! {
    /// Method of dilating the two pixels of a speck.
    pub enum SpeckForm {
        /// By a disc, independent of the pixel grid.
        Round,
        /// The paper's method: by a cross of pixels, which gives diamonds.
        Dilated,
    }
}

section! {
    /// Specks of dust and stain (paper, section "Speckles").
    pub struct Speckles, drawn from rng as pub Speckle {
        /// Number of speckles; drawn once per field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(67.0, 0.7)), 0..=1000000, "per field or per mm²";
        /// Method of dilation.
        form: SpeckForm = SpeckForm::Round;
        /// Number of binary dilations.
        dilations: Count = Number::log_normal(0.35, 0.9), 0..=50;
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.09, 0.6), 0..=4;
        /// Phase delay, which gives a halo that changes sign with focus. Has an effect only with bright-field optics.
        phase_rad: Number (given f64) = Number::normal(0.25, 0.15), -3..=3, "radians of phase";
    }
}

impl Speckles {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Speckle>) {
        let speckle = |placer: &KindPlacer<'_, Speckle>, number: u64, rng: &mut Stream| Speckle {
            phase_rad: self.phase_rad.draw(&mut placer.stream(number, "phase")),
            ..self.one(rng)
        };
        placer.place_anywhere(named!(self.count), speckle, random::normal);
    }
}

impl Speckle {
    pub(super) fn reach_um(&self, pixel_um: f64) -> f64 {
        (self.dilations as f64 + 3.0) * pixel_um
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let pixel = context.oversampling as f64;
        // The pixels of a speck are image pixels, independent of the drawing grid.
        let [x, y] = context.view.to_px(context.centre_um).map(libm::round);
        let [dx, dy] = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][random::below(4, &mut rng)];
        let seeds = [[x, y], [x + dx, y + dy]];
        let to_grid = |p: [f64; 2]| p.map(|v| (v + 0.5) * pixel - 0.5);
        let reach = self.dilations as f64;
        let mut coverage = Tile::around(&seeds.map(to_grid), (reach + 2.0) * pixel);
        coverage.for_each(|p, value| {
            let p = p.map(|v| (v + 0.5) / pixel - 0.5);
            *value = match self.form {
                // Repeated dilation by a cross gives all pixels within a city-block distance.
                SpeckForm::Dilated => {
                    let p = p.map(libm::round);
                    let inside = seeds.iter().any(|s| (p[0] - s[0]).abs() + (p[1] - s[1]).abs() <= reach);
                    if inside { 1.0 } else { 0.0 }
                }
                // Dilation by a disc gives all points within a distance of the line between the two pixels.
                SpeckForm::Round => {
                    let along = ((p[0] - x) * dx + (p[1] - y) * dy).clamp(0.0, 1.0);
                    let (ex, ey) = (p[0] - x - along * dx, p[1] - y - along * dy);
                    ((reach + 0.5 - (ex * ex + ey * ey).sqrt()) * pixel + 0.5).clamp(0.0, 1.0) as f32
                }
            };
        });
        let area = coverage.sum();
        let mut tile = coverage.clone();
        for value in &mut tile.values {
            *value *= self.absorbance.max(MIN_ABSORBANCE) as f32;
        }
        Phantom::whole(tile, coverage, area, context.dyes.speckle).with_phase(self.phase_rad, self.absorbance)
    }
}
