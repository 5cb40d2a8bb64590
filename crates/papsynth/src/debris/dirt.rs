//! Background dirt: many flecks of one or two micrometres, slightly darker than the empty slide.

use super::prelude::*;

section! {
    /// Faint flecks of background dirt, in clusters.
    ///
    /// Each fleck has its own depth, but all flecks share one row and one mask of the ground truth.
    pub struct Dirt, drawn from rng as pub Fleck {
        /// Number of clusters; drawn once per field.
        clusters: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(225.0, 0.7)), 0..=100000, "per field or per mm²";
        /// Flecks per cluster.
        per_cluster: Count (undrawn) = Number::log_normal(4.0, 0.8).at_least(1.0), 1..=10000;
        /// Radius (standard deviation) of a cluster.
        cluster_radius_um: Number (undrawn) = Number::log_normal(22.0, 0.6), 0..=1000, "µm";
        /// Length of a fleck.
        length_um: Number = Number::log_normal(2.1, 0.5), 0.1..=20, "µm";
        /// Width of a fleck.
        width_um: Number = Number::log_normal(1.1, 0.35), 0.1..=10, "µm";
        /// Fraction of the flecks that are aligned with the direction of their cluster. The clusters of a field have
        /// similar directions.
        aligned: Number (undrawn) = 0.6, 0..=1;
        /// Absorbance, mean over the fleck.
        absorbance: Number = Number::log_normal(0.028, 0.5).at_least(0.01).at_most(0.15), 0..=4;
        /// Phase delay; has an effect only with bright-field optics.
        phase_rad: Number = Number::uniform(0.0, 0.12), -3..=3, "radians of phase";
        /// Dyes.
        dyes: DyeAmounts = DyeAmounts { light_green: 1.0, haematein: 0.35, eosin_y: 0.6, orange_g: 0.3, neutral: 0.2 };
    }
}

/// Maximum number of strokes of a fleck.
const MAX_STROKES: usize = 4;
/// Standard deviation of the angles between strokes, radians.
const KINK: f64 = 0.7;

/// Standard deviation of the depths in a cluster, µm.
const DEPTH_SD_UM: f64 = 1.2;

/// Standard deviation of the directions of aligned flecks in a cluster, degrees.
const DIRECTION_SD_DEG: f64 = 14.0;
/// Standard deviation of the directions of clusters in a field, degrees.
const CLUSTER_DIRECTION_SD_DEG: f64 = 30.0;

/// Width and absorbance of the end of a fleck, relative to its beginning.
const END: f64 = 0.4;

/// Returns width and absorbance at a part of the length of a fleck, relative to its beginning.
fn along(part: f64) -> f64 {
    1.0 - (1.0 - END) * part
}

impl Dirt {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Fleck>) {
        let dyes = placer.dyes(&self.dyes);
        let field_deg = random::between(0.0, 360.0, &mut placer.stream(0, "direction"));
        for index in 0..placer.count(named!(self.clusters)) {
            let mut rng = placer.stream(index, "drift");
            let cluster = placer.cluster(&Number::Fixed(0.0), &self.cluster_radius_um, &mut rng);
            let direction_deg = field_deg + CLUSTER_DIRECTION_SD_DEG * random::normal(&mut rng);
            for member in 0..self.per_cluster.draw_count(&mut rng).max(1) as u64 {
                let number = member_number(index, member);
                let mut rng = placer.stream(number, "body");
                let centre_um = cluster.draw_position(&mut rng);
                let fleck = self.one(&mut rng);
                let fleck = Fleck { width_um: fleck.width_um.min(fleck.length_um), dyes, ..fleck };
                let depth_um = cluster.depth_um + DEPTH_SD_UM * random::normal(&mut rng);
                let mut placement = Placement::with_random_rotation(centre_um, depth_um, &mut rng);
                if random::chance(self.aligned.draw(&mut rng), &mut rng) {
                    placement.rotation_deg = direction_deg + DIRECTION_SD_DEG * random::normal(&mut rng);
                }
                placer.add(number, cluster_id(index), placement, fleck);
            }
        }
    }
}

impl Fleck {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        self.length_um + self.width_um
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        // A few connected strokes with different directions, thinner and paler from one end to the other.
        let count = 2 + random::below(MAX_STROKES - 1, &mut rng);
        let step = (self.length_um - self.width_um) / count as f64;
        let (mut at, mut heading) = ([-0.5 * step * count as f64, 0.0], KINK * random::normal(&mut rng));
        let mut joints: Vec<(Point, f64)> = Vec::with_capacity(count + 1);
        for number in 0..=count {
            let width_um = self.width_um * random::between(0.5, 1.0, &mut rng) * along(number as f64 / count as f64);
            joints.push((context.to_grid(at), context.px(0.5 * width_um)));
            at = [at[0] + step * libm::cos(heading), at[1] + step * libm::sin(heading)];
            heading = 0.5 * heading + KINK * random::normal(&mut rng);
        }
        let mut canvas = context.canvas(joints.iter().map(|(at, _)| at), 0.5 * self.width_um);
        for (number, pair) in joints.windows(2).enumerate() {
            let [(from, first), (to, last)] = [pair[0], pair[1]];
            let absorbance = along((number as f64 + 0.5) / count as f64);
            canvas.stroke_max(&Stroke { ends: [from, to], half_widths: [first, last] }, absorbance);
        }
        let drawn: f32 = canvas.absorbance.values.iter().sum();
        let scale = self.absorbance as f32 * canvas.coverage.values.iter().sum::<f32>() / drawn.max(f32::MIN_POSITIVE);
        canvas.absorbance.values.iter_mut().for_each(|value| *value *= scale);
        canvas.into_phantom(self.dyes, self.phase_rad, self.absorbance)
    }
}
