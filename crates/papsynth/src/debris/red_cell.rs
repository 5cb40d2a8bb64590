//! Red blood cells: discs with a pale centre, and ghosts that have lost their haemoglobin.

use super::prelude::*;

section! {
    /// Red blood cells, in clusters.
    pub struct RedCells, drawn from rng as pub RedCell {
        /// Number of clusters; drawn once per field.
        clusters: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(0.5, 0.9)), 0..=100000, "per field or per mm²";
        /// Red cells per cluster.
        per_cluster: Count (undrawn) = Number::log_normal(4.0, 0.9).at_least(1.0), 1..=10000;
        /// Radius (standard deviation) of a cluster.
        cluster_radius_um: Number (undrawn) = Number::uniform(8.0, 25.0), 0..=1000, "µm";
        /// Fraction of the clusters that are on a cell.
        on_cells: Number (undrawn) = 0.3, 0..=1;
        /// Diameter.
        diameter_um: Number = Number::normal(7.0, 0.35), 1..=30, "µm";
        /// Absorbance of the centre relative to the rim.
        pallor: Number = Number::uniform(0.3, 0.6), 0..=1;
        /// Probability that a cell is a ghost, without haemoglobin.
        ghosts: Number (Chance as ghost: "Whether it is a ghost.") = 0.3, 0..=1;
        /// Absorbance: haemoglobin in a disc of 2 µm has an absorbance of 0.1 at 0.57 µm.
        absorbance: Number = Number::normal(0.10, 0.015), 0..=4;
        /// Phase delay; has an effect only with bright-field optics.
        phase_rad: Number = Number::uniform(0.1, 0.3), -3..=3, "radians of phase";
        /// Dyes: the spectra of haemoglobin and eosin are similar.
        dyes: DyeAmounts = DyeAmounts { eosin_y: 4.5, orange_g: 1.5, haematein: 0.35, ..DyeAmounts::none() };
    }
}

impl RedCells {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, RedCell>) {
        let dyes = placer.dyes(&self.dyes);
        let clusters = Clusters {
            purpose: "cluster",
            on_cells: &self.on_cells,
            radius_um: &self.cluster_radius_um,
            members: &self.per_cluster,
            depth_sd_um: 0.5,
        };
        placer.place_in_clusters(named!(self.clusters), &clusters, |_, _, rng| RedCell { dyes, ..self.one(rng) });
    }
}

/// Absorbance of a ghost relative to an intact cell.
const GHOST: f64 = 0.35;
/// Width of the rim of a ghost relative to the radius.
const GHOST_RIM: f64 = 0.18;

/// Radius at which a disc is thickest, relative to its radius.
const THICKEST_AT: f64 = 0.68;

impl RedCell {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.6 * self.diameter_um
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let radius_um = 0.5 * self.diameter_um;
        let squeeze = random::between(0.88, 1.0, &mut rng);
        let circle = perturbed_circle(radius_um, 0.03, 0.05, &mut rng);
        let outline: Vec<Point> = circle.iter().map(|p| context.to_grid([p[0], squeeze * p[1]])).collect();
        let mut canvas = context.canvas(&outline, 0.0);
        canvas.coverage.cover(&outline);
        let radius = context.px(radius_um);
        canvas.shade(|p| {
            let (dx, dy) = (p[0] - context.centre[0], p[1] - context.centre[1]);
            let r = (dx * dx + dy * dy).sqrt() / radius;
            let thickness = if self.ghost {
                let rim = ((r - 1.0 + GHOST_RIM) / GHOST_RIM).clamp(0.0, 1.0);
                GHOST * (self.pallor + (1.0 - self.pallor) * rim)
            } else {
                // Biconcave: thin at the centre, thick in a ring.
                let ring = (r / THICKEST_AT).min(1.0);
                self.pallor + (1.0 - self.pallor) * ring * ring * (3.0 - 2.0 * ring)
            };
            self.absorbance * thickness
        });
        let mut phantom = canvas.into_phantom(self.dyes, self.phase_rad, self.absorbance);
        if self.ghost {
            phantom.traits.push(Trait::Ghost);
        }
        phantom
    }
}
