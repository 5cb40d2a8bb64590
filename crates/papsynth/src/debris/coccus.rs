//! Cocci and coccobacilli: round bacteria in pairs, chains and clusters. A colony is one object.

use super::prelude::*;

section! {
    /// Colonies of cocci and coccobacilli.
    pub struct Cocci, drawn from rng as pub Colony {
        /// Number of colonies; drawn once per field.
        colonies: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(2.0, 1.1)), 0..=100000, "per field or per mm²";
        /// Cocci per colony.
        per_colony: Count (Count as cocci: "Number of cocci.") = Number::log_normal(30.0, 0.9).at_least(2.0), 1..=20000;
        /// Radius (standard deviation) of a colony that is not a chain.
        colony_radius_um: Number = Number::log_normal(3.5, 0.5), 0..=500, "µm";
        /// Fraction of the colonies that are on a cell.
        on_cells: Number (undrawn) = 0.6, 0..=1;
        /// Fraction of the colonies that are one chain.
        chains: Number (Chance as chain: "Whether the colony is one chain.") = 0.15, 0..=1;
        /// Diameter of a coccus.
        diameter_um: Number = Number::normal(0.8, 0.05), 0.1..=5, "µm";
        /// Length of a coccus relative to its diameter; above 1.3 for coccobacilli.
        elongation: Number = Number::uniform(1.0, 1.6), 1..=5;
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.11, 0.3), 0..=4;
        /// Phase delay; has an effect only with bright-field optics.
        phase_rad: Number = Number::uniform(0.05, 0.2), -3..=3, "radians of phase";
    }
}

impl Cocci {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Colony>) {
        placer.place_on_cells(named!(self.colonies), &self.on_cells, |rng| self.one(rng));
    }
}

/// Maximum number of cocci in a chain.
const MAX_CHAIN: usize = 24;

/// Mean number of cocci in a clump.
const CLUMP: usize = 9;
/// Radius of a clump relative to its colony.
const CLUMP_WIDTH: f64 = 0.28;

/// Standard deviation of the angle from one coccus of a chain to the next, radians.
const KINK: f64 = 0.22;

/// Maximum distance of a coccus from the centre, in standard deviations.
const MAX_DISTANCE: f64 = 4.0;

impl Colony {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        if self.chain {
            0.8 * self.cocci.min(MAX_CHAIN) as f64 * self.diameter_um * self.elongation + self.diameter_um
        } else {
            (1.0 + CLUMP_WIDTH) * MAX_DISTANCE * self.colony_radius_um + 2.0 * self.diameter_um * self.elongation
        }
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let places = if self.chain { self.chain(&mut rng) } else { self.clumps(&mut rng) };
        let places: Vec<(Point, f64)> = places.iter().map(|(at, way)| (context.to_grid(*at), *way)).collect();
        let half_width = 0.5 * self.diameter_um;
        let margin_um = half_width * self.elongation;
        let mut canvas = context.canvas(places.iter().map(|(at, _)| at), margin_um);
        for (at, way) in &places {
            let size = random::between(0.8, 1.15, &mut rng);
            let reach = context.px(size * half_width * (self.elongation - 1.0));
            let (dx, dy) = (reach * libm::cos(*way), reach * libm::sin(*way));
            let stroke =
                Stroke::even([at[0] - dx, at[1] - dy], [at[0] + dx, at[1] + dy], context.px(size * half_width));
            // Cocci of a chain touch; those of a clump lie on each other.
            if self.chain {
                canvas.stroke_max(&stroke, self.absorbance);
            } else {
                canvas.stroke(&stroke, self.absorbance);
            }
        }
        canvas.into_phantom(context.dyes.bacillus, self.phase_rad, self.absorbance)
    }
}

impl Colony {
    /// Draws the positions and directions of a chain, µm and radians.
    fn chain(&self, rng: &mut Stream) -> Vec<(Point, f64)> {
        let count = self.cocci.min(MAX_CHAIN);
        let step = self.diameter_um * self.elongation;
        let (mut at, mut way) = ([-0.5 * step * count as f64, 0.0], 0.0);
        (0..count)
            .map(|_| {
                let (here, before) = (at, way);
                way += KINK * random::normal(rng);
                at = [at[0] + step * libm::cos(way), at[1] + step * libm::sin(way)];
                (here, 0.5 * (before + way))
            })
            .collect()
    }

    /// Draws the positions and directions of a colony of clumps, with most cocci in pairs.
    fn clumps(&self, rng: &mut Stream) -> Vec<(Point, f64)> {
        let clumps: Vec<Point> =
            (0..self.cocci.div_ceil(CLUMP)).map(|_| scattered([0.0; 2], self.colony_radius_um, rng)).collect();
        let mut places = Vec::with_capacity(self.cocci);
        while places.len() < self.cocci {
            let clump = clumps[random::below(clumps.len(), rng)];
            let (at, way) = (scattered(clump, CLUMP_WIDTH * self.colony_radius_um, rng), random::direction(rng));
            places.push((at, way));
            if places.len() < self.cocci {
                let step = 0.95 * self.diameter_um * self.elongation;
                places.push(([at[0] + step * libm::cos(way), at[1] + step * libm::sin(way)], way));
            }
        }
        places
    }
}

/// Draws a position normally distributed about a point, with limited distance.
fn scattered(about: Point, sd: f64, rng: &mut Stream) -> Point {
    about.map(|v| v + sd * random::normal(rng).clamp(-MAX_DISTANCE, MAX_DISTANCE))
}
