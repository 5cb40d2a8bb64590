//! Rod-shaped bacteria (paper, section "Bacilli"): short bent rods with round ends, some in chains.

use super::prelude::*;

section! {
    /// Rod-shaped bacteria (paper, section "Bacilli"), such as lactobacilli.
    pub struct Bacilli, drawn from rng as pub Bacillus {
        /// Number of clusters; drawn once per field.
        clusters: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(45.0, 0.8)), 0..=100000, "per field or per mm²";
        /// Bacilli per cluster.
        per_cluster: Count (undrawn) = Number::log_normal(9.0, 0.9).at_least(1.0), 1..=10000;
        /// Radius (standard deviation) of a cluster.
        cluster_radius_um: Number (undrawn) = Number::uniform(5.0, 16.0), 0..=1000, "µm";
        /// Fraction of the clusters that are on a cell.
        on_cells: Number (undrawn) = 0.85, 0..=1;
        /// Length of a bacillus.
        length_um: Number = Number::log_normal(2.4, 0.45), 0.3..=50, "µm";
        /// Width of a bacillus.
        width_um: Number = Number::log_normal(0.58, 0.25), 0.1..=5, "µm";
        /// Bend of a bacillus.
        bend_deg: Number = Number::uniform(0.0, 60.0), 0..=120, "degrees between its ends";
        /// Fraction of the bacilli that are in chains of two to four.
        chained: Number (given usize as rods: "Number of rods in a chain.") = 0.05, 0..=1;
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.06, 0.55), 0..=4;
        /// Phase delay; has an effect only with bright-field optics.
        phase_rad: Number (given f64) = Number::uniform(0.1, 0.25), -3..=3, "radians of phase";
    }
}

/// Maximum number of rods in a chain.
const MAX_CHAIN: usize = 4;

impl Bacilli {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Bacillus>) {
        let clusters = Clusters {
            purpose: "cluster",
            on_cells: &self.on_cells,
            radius_um: &self.cluster_radius_um,
            members: &self.per_cluster,
            depth_sd_um: 0.3,
        };
        placer.place_in_clusters(named!(self.clusters), &clusters, |placer, number, rng| {
            let mut own = placer.stream(number, "chain");
            let chained = random::chance(self.chained.draw(&mut own), &mut own);
            Bacillus {
                rods: if chained { 2 + random::below(MAX_CHAIN - 1, &mut own) } else { 1 },
                phase_rad: self.phase_rad.draw(&mut placer.stream(number, "phase")),
                ..self.one(rng)
            }
        });
    }
}

/// Straight segments of a bent rod.
const PARTS: usize = 6;

/// Standard deviation of the angle between the rods of a chain, radians.
const KINK: f64 = 0.2;

/// Bend of the rods of a chain, relative to that of single rods.
const CHAIN_BEND: f64 = 0.4;

/// Width of a chain between two rods, relative to the rods.
const WAIST: f64 = 0.7;

impl Bacillus {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        self.rods.max(1) as f64 * (1.2 * self.length_um + self.width_um)
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let half_width = 0.5 * context.px(self.width_um);
        let length = context.px((self.length_um - self.width_um).max(0.0));
        let bend = self.bend_deg.to_radians() * if self.rods > 1 { CHAIN_BEND } else { 1.0 };
        let mut rng = context.stream("chain.shape");
        let mut rods: Vec<Vec<Point>> = vec![spine(length, bend)];
        for _ in 1..self.rods {
            let size = random::between(0.8, 1.2, &mut rng);
            let kink = KINK * random::normal(&mut rng);
            let next = spine(size * length, bend * random::between(-1.0, 1.0, &mut rng));
            rods.push(appended(&rods[rods.len() - 1], &next, kink, (1.0 + WAIST) * half_width));
        }
        let middle = rods.iter().flatten().fold([0.0; 2], |sum, p| [sum[0] + p[0], sum[1] + p[1]]);
        let count = (self.rods * (PARTS + 1)) as f64;
        let middle = if self.rods > 1 { middle.map(|sum| sum / count) } else { [0.0; 2] };
        let turn = context.rotation_deg.to_radians();
        for point in rods.iter_mut().flatten() {
            *point = placed([point[0] - middle[0], point[1] - middle[1]], turn, context.centre);
        }
        let mut canvas = ObjectCanvas::around(rods.iter().flatten(), half_width + 2.0);
        for part in rods.iter().flat_map(|rod| rod.windows(2)) {
            canvas.stroke_max(&Stroke::even(part[0], part[1], half_width), self.absorbance.max(MIN_ABSORBANCE));
        }
        let (length_um, width_um) = (self.length_um, self.width_um);
        let area = (length_um - width_um).max(0.0) * width_um + core::f64::consts::FRAC_PI_4 * width_um * width_um;
        let area_px = match self.rods {
            1 => area / (context.pixel_um * context.pixel_um),
            _ => canvas.coverage.sum(),
        };
        let dyes = context.dyes.bacillus;
        Phantom::whole(canvas.absorbance, canvas.coverage, area_px, dyes).with_phase(self.phase_rad, self.absorbance)
    }
}

/// Returns the centre line of a rod: a circular arc centred on the origin.
fn spine(length: f64, bend: f64) -> Vec<Point> {
    let mut points = vec![[0.0, 0.0]];
    let step = length / PARTS as f64;
    let (mut x, mut y) = (0.0, 0.0);
    for part in 0..PARTS {
        let angle = bend * ((part as f64 + 0.5) / PARTS as f64 - 0.5);
        x += step * libm::cos(angle);
        y += step * libm::sin(angle);
        points.push([x, y]);
    }
    for point in &mut points {
        point[0] -= 0.5 * x;
        point[1] -= 0.5 * y;
    }
    points
}

/// Returns a rod appended to another one at an angle, after a gap.
fn appended(before: &[Point], next: &[Point], kink: f64, gap: f64) -> Vec<Point> {
    let [a, b] = [before[before.len() - 2], before[before.len() - 1]];
    let heading = libm::atan2(b[1] - a[1], b[0] - a[0]) + kink;
    let start = [b[0] + gap * libm::cos(heading), b[1] + gap * libm::sin(heading)];
    let lead = libm::atan2(next[1][1] - next[0][1], next[1][0] - next[0][0]);
    let first = next[0];
    next.iter().map(|p| placed([p[0] - first[0], p[1] - first[1]], heading - lead, start)).collect()
}
