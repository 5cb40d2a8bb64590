//! Scratches in the glass: long, thin, straight and interrupted lines.

use super::prelude::*;

section! {
    /// Scratches in the slide or in the cover glass.
    pub struct Scratches, drawn from rng as pub Scratch {
        /// Number of scratches; drawn once per field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(0.3, 0.8)), 0..=10000, "per field or per mm²";
        /// Length.
        length_um: Number = Number::uniform(20.0, 120.0), 5..=500, "µm";
        /// Width.
        width_um: Number = Number::log_normal(0.7, 0.4), 0.1..=20, "µm";
        /// Height above the cells: slightly below 0 is the face of the slide, 170 is the outer face of a cover glass,
        /// where only wide scratches are visible.
        height_um: Number (undrawn) = Number::choice([-3.0, 170.0, 170.0]), -1000..=1000, "µm";
        /// Absorbance.
        absorbance: Number = Number::uniform(0.02, 0.08), 0..=4;
        /// Phase delay; has an effect only with bright-field optics.
        phase_rad: Number = Number::uniform(-0.4, 0.4), -3..=3, "radians of phase";
    }
}

impl Scratches {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Scratch>) {
        let height = |rng: &mut Stream| self.height_um.draw(rng);
        placer.place_anywhere(named!(self.count), |_, _, rng| self.one(rng), height);
    }
}

/// Straight segments of a scratch.
const PARTS: usize = 24;

/// Fraction of the segments that are gaps.
const GAPS: f64 = 0.15;

impl Scratch {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.6 * self.length_um + self.width_um
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let step = self.length_um / PARTS as f64;
        let bow = 0.1 * random::normal(&mut rng) / self.length_um;
        let line: Vec<(Point, f64)> = (0..=PARTS)
            .map(|part| {
                let x = step * part as f64 - 0.5 * self.length_um;
                let width = self.width_um * random::between(0.4, 1.0, &mut rng);
                (context.to_grid([x, bow * x * x]), context.px(0.5 * width))
            })
            .collect();
        let mut canvas = context.canvas(line.iter().map(|(at, _)| at), 0.5 * self.width_um);
        for (part, pair) in line.windows(2).enumerate() {
            let kept = part == 0 || !random::chance(GAPS, &mut rng);
            if kept {
                let stroke = Stroke { ends: [pair[0].0, pair[1].0], half_widths: [pair[0].1, pair[1].1] };
                canvas.stroke(&stroke, 0.0);
            }
        }
        canvas.fill_covered(self.absorbance);
        canvas.into_phantom(context.dyes.speckle, self.phase_rad, self.absorbance)
    }
}
