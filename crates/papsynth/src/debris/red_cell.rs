//! Red blood cells: discs with a pale middle, and the ghosts that are left of them.

use super::prelude::*;

section! {
    /// Red blood cells, in clusters.
    pub struct RedCells, drawn from rng as pub RedCell {
        /// Number of clusters; drawn once a field.
        clusters: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(1.5, 0.9)), 0..=100000, "per field or per mm²";
        /// Red cells of a cluster.
        per_cluster: Count (undrawn) = Number::log_normal(4.0, 0.9).at_least(1.0), 1..=10000;
        /// Radius (standard deviation) of a cluster.
        cluster_um: Number (undrawn) = Number::uniform(8.0, 25.0), 0..=1000, "µm";
        /// Share of the clusters that lie on a cell.
        on_cells: Number (undrawn) = 0.3, 0..=1;
        /// Diameter.
        diameter_um: Number = Number::normal(7.0, 0.35), 1..=30, "µm";
        /// Absorbance of the middle relative to the rim.
        pallor: Number = Number::uniform(0.3, 0.6), 0..=1;
        /// Probability that it is a ghost that has lost its haemoglobin.
        ghosts: Number (Chance as ghost: "Whether it has lost its haemoglobin.") = 0.3, 0..=1;
        /// Absorbance: haemoglobin in a disc of 2 µm absorbs 0.1 at 0.57 µm.
        absorbance: Number = Number::normal(0.10, 0.015), 0..=4;
        /// How late light comes through it; seen by bright-field optics alone.
        phase_rad: Number = Number::uniform(0.1, 0.3), -3..=3, "radians of phase";
        /// Its dyes: haemoglobin and eosin are much alike.
        dyes: DyeAmounts = DyeAmounts { eosin_y: 4.5, orange_g: 1.5, haematein: 0.35, ..DyeAmounts::none() };
    }
}

impl RedCells {
    pub(super) fn draw(&self, ground: &mut Ground<'_, RedCell>) {
        let dyes = ground.dyes(&self.dyes);
        let clusters = Clusters {
            purpose: "cluster",
            on_cells: &self.on_cells,
            radius_um: &self.cluster_um,
            members: &self.per_cluster,
            spread_um: 0.5,
        };
        ground.strew_in_clusters(named!(self.clusters), &clusters, |_, _, rng| RedCell { dyes, ..self.one(rng) });
    }
}

/// Haemoglobin that a ghost has left, and the width of its seam relative to the radius.
const GHOST: f64 = 0.35;
const SEAM: f64 = 0.18;

/// Where a disc is thickest, relative to its radius.
const THICKEST: f64 = 0.68;

impl RedCell {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.6 * self.diameter_um
    }

    pub(super) fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let radius_um = 0.5 * self.diameter_um;
        let squeeze = random::between(0.88, 1.0, &mut rng);
        let circle = perturbed_circle(radius_um, 0.03, 0.05, &mut rng);
        let outline: Vec<Point> = circle.iter().map(|p| site.place([p[0], squeeze * p[1]])).collect();
        let mut painting = site.painting(&outline, 0.0);
        painting.coverage.cover(&outline);
        let radius = site.px(radius_um);
        painting.shade(|p| {
            let (dx, dy) = (p[0] - site.centre[0], p[1] - site.centre[1]);
            let r = (dx * dx + dy * dy).sqrt() / radius;
            let thickness = if self.ghost {
                let seam = ((r - 1.0 + SEAM) / SEAM).clamp(0.0, 1.0);
                GHOST * (self.pallor + (1.0 - self.pallor) * seam)
            } else {
                // Biconcave: from the dent in the middle to the thick ring.
                let ring = (r / THICKEST).min(1.0);
                self.pallor + (1.0 - self.pallor) * ring * ring * (3.0 - 2.0 * ring)
            };
            self.absorbance * thickness
        });
        let mut phantom = painting.finish(self.dyes, self.phase_rad, self.absorbance);
        if self.ghost {
            phantom.traits.push(Trait::Ghost);
        }
        phantom
    }
}
