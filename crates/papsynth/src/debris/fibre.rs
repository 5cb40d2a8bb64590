//! Textile fibres: long, of constant width, sharply bounded, with refracting edges.

use super::prelude::*;

section! {
    /// Textile fibres in the mountant or on the glass.
    pub struct Fibres, drawn from rng as pub Fibre {
        /// Number of fibres; drawn once per field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(0.06, 0.8)), 0..=10000, "per field or per mm²";
        /// Length.
        length_um: Number = Number::uniform(60.0, 200.0), 5..=500, "µm";
        /// Width.
        width_um: Number = Number::uniform(5.0, 15.0), 0.5..=50, "µm";
        /// Waviness: 0 is straight.
        waves: Number = Number::uniform(0.0, 0.8), 0..=2;
        /// Height above the cells: 170 is the outer face of a cover glass, smaller values are in the mountant.
        height_um: Number (undrawn) = Number::choice([0.0, 8.0, 30.0, 170.0]), -1000..=1000, "µm";
        /// Absorbance.
        absorbance: Number = Number::uniform(0.03, 0.2), 0..=4;
        /// Phase delay at its centre; has an effect only with bright-field optics.
        phase_rad: Number = Number::uniform(0.4, 1.2), -3..=3, "radians of phase";
    }
}

impl Fibres {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Fibre>) {
        let height = |rng: &mut Stream| self.height_um.draw(rng);
        placer.place_anywhere(named!(self.count), |_, _, rng| self.one(rng), height);
    }
}

/// Straight segments of a fibre.
const PARTS: usize = 40;

/// Amplitude of the direction of a fibre with waviness 1, radians.
const SWING: f64 = 0.5;

/// Absorbance along the edges relative to the centre: edges deflect light out of the objective.
const EDGE: f32 = 2.5;

/// Width of an edge relative to the fibre.
const EDGE_WIDTH: f64 = 0.12;

impl Fibre {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.7 * self.length_um + self.width_um
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let step = self.length_um / PARTS as f64;
        let (phase, turns) = (random::direction(&mut rng), random::between(0.5, 2.0, &mut rng));
        let bow = 0.6 * self.waves * random::normal(&mut rng);
        let mut at = [-0.5 * self.length_um, 0.0];
        let mut spine: Vec<Point> = Vec::with_capacity(PARTS + 1);
        for part in 0..=PARTS {
            spine.push(context.to_grid(at));
            let t = part as f64 / PARTS as f64;
            let way = self.waves * SWING * libm::sin(core::f64::consts::TAU * turns * t + phase) + bow * (t - 0.5);
            at = [at[0] + step * libm::cos(way), at[1] + step * libm::sin(way)];
        }
        let mut canvas = context.canvas(&spine, 0.5 * self.width_um);
        let half_width = context.px(0.5 * self.width_um);
        for part in spine.windows(2) {
            canvas.stroke(&Stroke::even(part[0], part[1], half_width * (1.0 - 2.0 * EDGE_WIDTH)), 0.0);
        }
        let inside = canvas.take_coverage();
        for part in spine.windows(2) {
            canvas.stroke(&Stroke::even(part[0], part[1], half_width), 0.0);
        }
        canvas.shade_by_coverage(&inside, |cover, inner| {
            self.absorbance as f32 * (inner + EDGE * (cover - inner).max(0.0))
        });
        canvas.into_phantom(context.dyes.speckle, self.phase_rad, self.absorbance)
    }
}
