//! Fibres of cotton and cloth: long, of even width, sharply bounded, with refracting edges.

use super::prelude::*;

section! {
    /// Fibres of cotton and cloth, in the mountant or on the glass.
    pub struct Fibres, drawn from rng as pub Fibre {
        /// Number of fibres; drawn once a field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(0.18, 0.8)), 0..=10000, "per field or per mm²";
        /// Length.
        length_um: Number = Number::uniform(60.0, 200.0), 5..=500, "µm";
        /// Width.
        width_um: Number = Number::uniform(5.0, 15.0), 0.5..=50, "µm";
        /// How wavy it is: 0 is straight.
        waves: Number = Number::uniform(0.0, 0.8), 0..=2;
        /// How far above the cells it lies: 170 is the outside of a cover glass, less lies within the mountant.
        height_um: Number (undrawn) = Number::choice([0.0, 8.0, 30.0, 170.0]), -1000..=1000, "µm";
        /// Absorbance.
        absorbance: Number = Number::uniform(0.03, 0.2), 0..=4;
        /// How late light comes through its middle; seen by bright-field optics alone.
        phase_rad: Number = Number::uniform(0.4, 1.2), -3..=3, "radians of phase";
    }
}

impl Fibres {
    pub(super) fn draw(&self, ground: &mut Ground<'_, Fibre>) {
        let height = |rng: &mut Stream| self.height_um.draw(rng);
        ground.strew_anywhere(named!(self.count), |_, _, rng| self.one(rng), height);
    }
}

/// Straight parts of a fibre.
const PARTS: usize = 40;

/// Angle to which a fibre of waviness 1 swings, radians.
const SWING: f64 = 0.5;

/// Absorbance along the edges relative to the middle: they throw light out of the objective.
const EDGE: f32 = 2.5;

/// Width of an edge relative to the fibre's.
const EDGE_WIDTH: f64 = 0.12;

impl Fibre {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.7 * self.length_um + self.width_um
    }

    pub(super) fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let step = self.length_um / PARTS as f64;
        let (phase, turns) = (random::direction(&mut rng), random::between(0.5, 2.0, &mut rng));
        let bow = 0.6 * self.waves * random::normal(&mut rng);
        let mut at = [-0.5 * self.length_um, 0.0];
        let mut spine: Vec<Point> = Vec::with_capacity(PARTS + 1);
        for part in 0..=PARTS {
            spine.push(site.place(at));
            let t = part as f64 / PARTS as f64;
            let way = self.waves * SWING * libm::sin(core::f64::consts::TAU * turns * t + phase) + bow * (t - 0.5);
            at = [at[0] + step * libm::cos(way), at[1] + step * libm::sin(way)];
        }
        let mut painting = site.painting(&spine, 0.5 * self.width_um);
        let half_width = site.px(0.5 * self.width_um);
        for part in spine.windows(2) {
            painting.stroke(&Stroke::even(part[0], part[1], half_width * (1.0 - 2.0 * EDGE_WIDTH)), 0.0);
        }
        let inside = painting.lifted();
        for part in spine.windows(2) {
            painting.stroke(&Stroke::even(part[0], part[1], half_width), 0.0);
        }
        painting.layered(&inside, |cover, inner| self.absorbance as f32 * (inner + EDGE * (cover - inner).max(0.0)));
        painting.finish(site.dyes.speckle, self.phase_rad, self.absorbance)
    }
}
