//! Cocci and coccobacilli: round bacteria in pairs, chains and clouds. A colony is one object.

use super::prelude::*;

section! {
    /// Cocci and coccobacilli, colony by colony.
    pub struct Cocci, drawn from rng as pub Colony {
        /// Number of colonies; drawn once a field.
        colonies: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(6.4, 1.1)), 0..=100000, "per field or per mm²";
        /// Cocci of a colony.
        per_colony: Count (Count as cocci: "Number of cocci.") = Number::log_normal(30.0, 0.9).at_least(2.0), 1..=20000;
        /// Radius (standard deviation) of a cloud.
        cloud_um: Number = Number::log_normal(3.5, 0.5), 0..=500, "µm";
        /// Share of the colonies that lie on a cell.
        on_cells: Number (undrawn) = 0.6, 0..=1;
        /// Share of the colonies that are one chain.
        chains: Number (Chance as chain: "Whether they hang together in one chain.") = 0.15, 0..=1;
        /// Diameter of a coccus.
        diameter_um: Number = Number::normal(0.8, 0.05), 0.1..=5, "µm";
        /// Length of a coccus relative to its diameter: above 1.3 it is a coccobacillus.
        elongation: Number = Number::uniform(1.0, 1.6), 1..=5;
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.11, 0.3), 0..=4;
        /// How late light comes through a coccus; seen by bright-field optics alone.
        phase_rad: Number = Number::uniform(0.05, 0.2), -3..=3, "radians of phase";
    }
}

impl Cocci {
    pub(super) fn draw(&self, ground: &mut Ground<'_, Colony>) {
        ground.strew_on_cells(named!(self.colonies), &self.on_cells, |rng| self.one(rng));
    }
}

const LONGEST_CHAIN: usize = 24;

/// Cocci to a clump of a cloud, on average, and the width of a clump relative to its cloud.
const CLUMP: usize = 9;
const CLUMP_WIDTH: f64 = 0.28;

/// Standard deviation of the angle from one coccus of a chain to the next, radians.
const KINK: f64 = 0.45;

/// How far from the middle of a normal cloud a coccus may lie, in standard deviations.
const FARTHEST: f64 = 4.0;

impl Colony {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        if self.chain {
            0.8 * self.cocci.min(LONGEST_CHAIN) as f64 * self.diameter_um * self.elongation + self.diameter_um
        } else {
            (1.0 + CLUMP_WIDTH) * FARTHEST * self.cloud_um + 2.0 * self.diameter_um * self.elongation
        }
    }

    pub(super) fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let places = if self.chain { self.chain(&mut rng) } else { self.cloud(&mut rng) };
        let places: Vec<(Point, f64)> = places.iter().map(|(at, way)| (site.place(*at), *way)).collect();
        let half_width = 0.5 * self.diameter_um;
        let margin_um = half_width * self.elongation;
        let mut painting = site.painting(places.iter().map(|(at, _)| at), margin_um);
        for (at, way) in &places {
            let size = random::between(0.8, 1.15, &mut rng);
            let reach = site.px(size * half_width * (self.elongation - 1.0));
            let (dx, dy) = (reach * libm::cos(*way), reach * libm::sin(*way));
            let stroke = Stroke::even([at[0] - dx, at[1] - dy], [at[0] + dx, at[1] + dy], site.px(size * half_width));
            painting.stroke(&stroke, self.absorbance);
        }
        painting.finish(site.dyes.bacillus, self.phase_rad, self.absorbance)
    }
}

impl Colony {
    /// Places of a chain and the way it runs there, µm and radians.
    fn chain(&self, rng: &mut Stream) -> Vec<(Point, f64)> {
        let count = self.cocci.min(LONGEST_CHAIN);
        let step = self.diameter_um * self.elongation;
        let (mut at, mut way) = ([-0.5 * step * count as f64, 0.0], 0.0);
        (0..count)
            .map(|_| {
                let here = at;
                way += KINK * random::normal(rng);
                at = [at[0] + step * libm::cos(way), at[1] + step * libm::sin(way)];
                (here, way)
            })
            .collect()
    }

    /// Places of a cloud of clumps, most of the cocci in pairs.
    fn cloud(&self, rng: &mut Stream) -> Vec<(Point, f64)> {
        let clumps: Vec<Point> =
            (0..self.cocci.div_ceil(CLUMP)).map(|_| scattered([0.0; 2], self.cloud_um, rng)).collect();
        let mut places = Vec::with_capacity(self.cocci);
        while places.len() < self.cocci {
            let clump = clumps[random::below(clumps.len(), rng)];
            let (at, way) = (scattered(clump, CLUMP_WIDTH * self.cloud_um, rng), random::direction(rng));
            places.push((at, way));
            if places.len() < self.cocci {
                let step = 0.95 * self.diameter_um * self.elongation;
                places.push(([at[0] + step * libm::cos(way), at[1] + step * libm::sin(way)], way));
            }
        }
        places
    }
}

/// A place about another one, normal in both directions.
fn scattered(about: Point, sd: f64, rng: &mut Stream) -> Point {
    about.map(|v| v + sd * random::normal(rng).clamp(-FARTHEST, FARTHEST))
}
