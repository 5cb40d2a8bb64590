//! Red blood cells: discs with a pale middle, and the ghosts that are left of them.

use serde::{Deserialize, Serialize};

use super::ground::{Clusters, Ground};
use super::kind::{Kinds, Thing};
use super::site::Site;
use crate::phantom::piece::Phantom;
use crate::phantom::tile::Point;
use crate::phantom::wobble::wobbled_circle;
use crate::random;
use crate::recipe::dyes::DyeAmounts;
use crate::recipe::number::{Count, Number};
use crate::recipe::section::{named, section};
use crate::truth::traits::Trait;

section! {
    /// Red blood cells, in clusters.
    pub struct RedCells {
        /// Number of clusters; drawn once a field.
        clusters: Count = Number::log_normal(0.22, 0.9), 0..=100000;
        /// Red cells of a cluster.
        per_cluster: Count = Number::log_normal(4.0, 0.9).at_least(1.0), 1..=10000;
        /// Radius (standard deviation) of a cluster.
        cluster_um: Number = Number::uniform(8.0, 25.0), 0..=1000, "µm";
        /// Share of the clusters that lie on a cell.
        on_cells: Number = 0.3, 0..=1;
        /// Diameter.
        diameter_um: Number = Number::normal(7.0, 0.35), 1..=30, "µm";
        /// Absorbance of the middle relative to the rim.
        pallor: Number = Number::uniform(0.3, 0.6), 0..=1;
        /// Probability that it is a ghost that has lost its haemoglobin.
        ghosts: Number = 0.3, 0..=1;
        /// Absorbance: haemoglobin in a disc of 2 µm absorbs 0.1 at 0.57 µm.
        absorbance: Number = Number::normal(0.10, 0.015), 0..=4;
        /// How late light comes through it; seen by bright-field optics alone.
        phase_rad: Number = Number::uniform(0.1, 0.3), -3..=3, "radians of phase";
        /// Its dyes: haemoglobin and eosin are much alike.
        dyes: DyeAmounts = DyeAmounts { eosin_y: 4.5, orange_g: 1.5, haematein: 0.35, ..DyeAmounts::none() };
    }
}

/// A red blood cell, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RedCell {
    /// Diameter, µm.
    pub diameter_um: f64,
    /// Absorbance of the middle relative to the rim.
    pub pallor: f64,
    /// Whether it has lost its haemoglobin.
    pub ghost: bool,
    /// Absorbance.
    pub absorbance: f64,
    /// How late light comes through it, radians.
    pub phase_rad: f64,
    /// Its dyes where its absorbance is 1.
    pub dyes: dye_spectra::Amounts,
}

impl Kinds<RedCell> for RedCells {
    fn draw(&self, ground: &mut Ground<'_, RedCell>) {
        let dyes = ground.dyes(&self.dyes);
        let clusters = Clusters {
            purpose: "cluster",
            on_cells: &self.on_cells,
            radius_um: &self.cluster_um,
            members: &self.per_cluster,
            spread_um: 0.5,
        };
        ground.strew_in_clusters(named!(self.clusters), &clusters, |_, _, rng| RedCell {
            diameter_um: self.diameter_um.draw(rng),
            pallor: self.pallor.draw(rng),
            ghost: random::chance(self.ghosts.draw(rng), rng),
            absorbance: self.absorbance.draw(rng),
            phase_rad: self.phase_rad.draw(rng),
            dyes,
        });
    }
}

/// Haemoglobin that a ghost has left, and the width of its seam relative to the radius.
const GHOST: f64 = 0.35;
const SEAM: f64 = 0.18;

/// Where a disc is thickest, relative to its radius.
const THICKEST: f64 = 0.68;

impl Thing for RedCell {
    fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.6 * self.diameter_um
    }

    fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let radius_um = 0.5 * self.diameter_um;
        let squeeze = random::between(0.88, 1.0, &mut rng);
        let circle = wobbled_circle(radius_um, 0.03, 0.05, &mut rng);
        let outline: Vec<Point> = circle.iter().map(|p| site.place([p[0], squeeze * p[1]])).collect();
        let mut painting = site.painting(&outline, 0.0);
        painting.coverage.cover(&outline);
        let radius = site.px(radius_um);
        let cover = &painting.coverage.values;
        let mut index = 0;
        painting.absorbance.for_each(|p, value| {
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
            *value = cover[index] * (self.absorbance * thickness) as f32;
            index += 1;
        });
        let mut phantom = painting.finish(self.dyes, self.phase_rad, self.absorbance);
        if self.ghost {
            phantom.traits.push(Trait::Ghost);
        }
        phantom
    }
}
