//! The faint dirt of the background: flecks of a micrometre or two, many of them, hardly darker than empty slide.

use super::prelude::*;

section! {
    /// Faint flecks of background dirt, in drifts that the fluid has laid down side by side.
    ///
    /// Each fleck lies at a depth of its own, but nobody counts them: the truth has one row and one mask for all of them.
    pub struct Dirt, drawn from rng as pub Fleck {
        /// Number of clusters; drawn once a field.
        clusters: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(225.0, 0.7)), 0..=100000, "per field or per mm²";
        /// Flecks of a drift.
        per_drift: Count (undrawn) = Number::log_normal(4.0, 0.8).at_least(1.0), 1..=10000;
        /// Radius (standard deviation) of a drift.
        drift_um: Number (undrawn) = Number::log_normal(22.0, 0.6), 0..=1000, "µm";
        /// Length of a fleck.
        length_um: Number = Number::log_normal(2.1, 0.5), 0.1..=20, "µm";
        /// Width of a fleck.
        width_um: Number = Number::log_normal(1.1, 0.35), 0.1..=10, "µm";
        /// Share of the flecks that lie in the direction of their drift.
        aligned: Number (undrawn) = 0.6, 0..=1;
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.028, 0.5).at_least(0.01).at_most(0.15), 0..=4;
        /// How late light comes through a fleck; seen by bright-field optics alone.
        phase_rad: Number = Number::uniform(0.0, 0.12), -3..=3, "radians of phase";
        /// Their dyes.
        dyes: DyeAmounts = DyeAmounts { light_green: 1.0, haematein: 0.35, eosin_y: 0.6, orange_g: 0.3, neutral: 0.2 };
    }
}

/// Most strokes that a fleck is made of, and the spread of the angles between them, radians.
const MOST_STROKES: usize = 4;
const KINK: f64 = 0.7;

/// Spread of the depths of a drift's flecks, µm.
const SCATTER_UM: f64 = 1.2;

/// Spread of the directions of flecks that lie as their drift does, degrees.
const ASTRAY_DEG: f64 = 14.0;

impl Dirt {
    pub(super) fn draw(&self, ground: &mut Ground<'_, Fleck>) {
        let dyes = ground.dyes(&self.dyes);
        for index in 0..ground.count(named!(self.clusters)) {
            let mut rng = ground.stream(index, "drift");
            let drift = ground.cluster(&Number::Fixed(0.0), &self.drift_um, &mut rng);
            let direction_deg = random::between(0.0, 360.0, &mut rng);
            for member in 0..self.per_drift.draw_count(&mut rng).max(1) as u64 {
                let number = member_number(index, member);
                let mut rng = ground.stream(number, "body");
                let centre_um = drift.place(&mut rng);
                let fleck = self.one(&mut rng);
                let fleck = Fleck { width_um: fleck.width_um.min(fleck.length_um), dyes, ..fleck };
                let depth_um = drift.depth_um + SCATTER_UM * random::normal(&mut rng);
                let mut lie = Lie::any_way(centre_um, depth_um, &mut rng);
                if random::chance(self.aligned.draw(&mut rng), &mut rng) {
                    lie.rotation_deg = direction_deg + ASTRAY_DEG * random::normal(&mut rng);
                }
                ground.add(number, cluster_id(index), lie, fleck);
            }
        }
    }
}

impl Fleck {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        self.length_um + self.width_um
    }

    pub(super) fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        // A crumb: a few strokes one after the other, each with its own width and heading.
        let count = 2 + random::below(MOST_STROKES - 1, &mut rng);
        let step = (self.length_um - self.width_um) / count as f64;
        let (mut at, mut heading) = ([-0.5 * step * count as f64, 0.0], KINK * random::normal(&mut rng));
        let mut joints: Vec<(Point, f64)> = Vec::with_capacity(count + 1);
        for _ in 0..=count {
            joints.push((site.place(at), site.px(0.5 * self.width_um * random::between(0.35, 1.0, &mut rng))));
            at = [at[0] + step * libm::cos(heading), at[1] + step * libm::sin(heading)];
            heading = 0.5 * heading + KINK * random::normal(&mut rng);
        }
        let mut painting = site.painting(joints.iter().map(|(at, _)| at), 0.5 * self.width_um);
        for pair in joints.windows(2) {
            let [(from, first), (to, last)] = [pair[0], pair[1]];
            painting.stroke(&Stroke { ends: [from, to], half_widths: [first, last] }, 0.0);
        }
        painting.even(self.absorbance);
        painting.finish(self.dyes, self.phase_rad, self.absorbance)
    }
}
