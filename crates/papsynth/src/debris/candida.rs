//! *Candida*: long septate pseudohyphae with constrictions and branches, and budding yeasts.

use super::prelude::*;

section! {
    /// *Candida*: colonies of pseudohyphae and budding yeasts.
    pub struct Candidas, drawn from rng as pub Candida {
        /// Number of colonies; drawn once per field.
        colonies: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(0.16, 0.9)), 0..=10000, "per field or per mm²";
        /// Pseudohyphae per colony.
        hyphae: Count (given Growth as growth: "Growth form.") = Number::uniform(1.0, 5.0), 0..=1000;
        /// Yeasts per colony, most of them budding.
        yeasts: Count (undrawn) = Number::log_normal(7.0, 0.7), 0..=10000;
        /// Radius (standard deviation) of a colony.
        colony_radius_um: Number (undrawn) = Number::uniform(10.0, 25.0), 0..=1000, "µm";
        /// Fraction of the colonies that are on a cell.
        on_cells: Number (undrawn) = 0.7, 0..=1;
        /// Segments of a pseudohypha.
        segments: Count = Number::uniform(2.0, 6.0), 1..=30;
        /// Length of a segment.
        segment_length_um: Number = Number::log_normal(10.0, 0.25), 2..=50, "µm";
        /// Width of a pseudohypha.
        width_um: Number (given f64 as width_um: "Width or diameter, µm.") = Number::normal(2.4, 0.2), 0.5..=10, "µm";
        /// Diameter of a yeast.
        yeast_diameter_um: Number (given f64 as yeast_diameter_um: "Diameter of buds, µm.") = Number::normal(3.6, 0.35), 0.5..=20, "µm";
        /// Probability of a branch at each septum.
        branches: Number = 0.2, 0..=1;
        /// Probability of buds at each septum.
        buds: Number = 0.4, 0..=1;
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.16, 0.25), 0..=4;
        /// Phase delay; has an effect only with bright-field optics.
        phase_rad: Number = Number::uniform(0.2, 0.5), -3..=3, "radians of phase";
        /// Dyes.
        dyes: DyeAmounts = DyeAmounts { eosin_y: 2.2, haematein: 0.55, orange_g: 0.6, ..DyeAmounts::none() };
    }
}

/// Growth form of an element of *Candida*.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Growth {
    /// A pseudohypha with branches and buds.
    #[default]
    Hypha,
    /// A yeast, with or without a bud.
    Yeast,
}

impl Candidas {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Candida>) {
        let dyes = placer.dyes(&self.dyes);
        for index in 0..placer.count(named!(self.colonies)) {
            let mut rng = placer.stream(index, "colony");
            let colony = placer.cluster(&self.on_cells, &self.colony_radius_um, &mut rng);
            let hyphae = self.hyphae.draw_count(&mut rng);
            let yeasts = self.yeasts.draw_count(&mut rng);
            for member in 0..hyphae + yeasts {
                let number = member_number(index, member as u64);
                let mut rng = placer.stream(number, "body");
                let growth = if member < hyphae { Growth::Hypha } else { Growth::Yeast };
                let yeast_diameter_um = self.yeast_diameter_um.draw(&mut rng);
                let width_um = self.width_um.draw(&mut rng);
                let width_um = if growth == Growth::Hypha { width_um } else { yeast_diameter_um };
                let candida = Candida { growth, width_um, yeast_diameter_um, dyes, ..self.one(&mut rng) };
                let centre_um = colony.draw_position(&mut rng);
                let depth_um = colony.depth_um + 0.5 * random::normal(&mut rng);
                let placement = Placement::with_random_rotation(centre_um, depth_um, &mut rng);
                placer.add(number, cluster_id(index), placement, candida);
            }
        }
    }
}

/// Width at a septum relative to the centre of a segment.
const WAIST: f64 = 0.62;

/// Standard deviation of the angle between segments, radians.
const BEND: f64 = 0.18;
/// Angle of a branch, radians.
const FORK: f64 = 0.75;

/// Length of a yeast relative to its width.
const OVAL: f64 = 1.3;

/// Thickness of the wall, µm.
const WALL_UM: f64 = 0.35;
/// Absorbance of the interior relative to the wall.
const INSIDE: f32 = 0.55;

impl Candida {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        match self.growth {
            // Half of its length, and a branch of two segments from an end of it that bends back.
            Growth::Hypha => {
                (0.8 * self.segments as f64 + 3.0) * self.segment_length_um
                    + 2.0 * self.yeast_diameter_um
                    + self.width_um
            }
            Growth::Yeast => 2.5 * self.width_um,
        }
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let mut strokes = Vec::new();
        match self.growth {
            Growth::Hypha => {
                let start = [-0.5 * self.segments as f64 * self.segment_length_um, 0.0];
                self.filament(start, 0.0, self.segments, self.width_um, &mut strokes, &mut rng);
            }
            Growth::Yeast => {
                self.oval([0.0, 0.0], 0.0, self.width_um, &mut strokes);
                if random::chance(0.5 + 0.5 * self.buds, &mut rng) {
                    let (way, bud) = (0.6 * random::normal(&mut rng), random::between(0.4, 0.85, &mut rng));
                    let distance = 0.5 * self.width_um * (OVAL + 0.9 * bud);
                    let at = [distance * libm::cos(way), distance * libm::sin(way)];
                    self.oval(at, way, bud * self.width_um, &mut strokes);
                }
            }
        }
        let placed: Vec<Stroke> = strokes
            .iter()
            .map(|(ends, widths)| Stroke {
                ends: ends.map(|end| context.to_grid(end)),
                half_widths: widths.map(|width| context.px(0.5 * width)),
            })
            .collect();
        let widest = self.width_um.max(self.yeast_diameter_um);
        let mut canvas = context.canvas(placed.iter().flat_map(|stroke| &stroke.ends), 0.5 * widest);
        let wall = context.px(WALL_UM);
        for stroke in &placed {
            let inner = stroke.half_widths.map(|half| half - wall);
            if inner[0].min(inner[1]) > 0.0 {
                canvas.stroke(&Stroke { half_widths: inner, ..*stroke }, 0.0);
            }
        }
        // The interior is paler than the wall.
        let inside = canvas.take_coverage();
        for stroke in &placed {
            canvas.stroke(stroke, 0.0);
        }
        canvas.shade_by_coverage(&inside, |cover, inner| {
            self.absorbance as f32 * (cover - (1.0 - INSIDE) * inner.min(cover))
        });
        let mut phantom = canvas.into_phantom(self.dyes, self.phase_rad, self.absorbance);
        phantom.traits.push(match self.growth {
            Growth::Hypha => Trait::Hypha,
            Growth::Yeast => Trait::Yeast,
        });
        phantom
    }
}

/// Ends of a stroke and the widths there, µm.
type Limb = ([Point; 2], [f64; 2]);

impl Candida {
    /// Adds a row of segments with branches and buds at the septa.
    fn filament(&self, start: Point, way: f64, segments: usize, width: f64, limbs: &mut Vec<Limb>, rng: &mut Stream) {
        let (mut at, mut way) = (start, way);
        for segment in 0..segments {
            let length = self.segment_length_um * random::between(0.75, 1.25, rng);
            way += BEND * random::normal(rng);
            let along = |share: f64| [at[0] + share * length * libm::cos(way), at[1] + share * length * libm::sin(way)];
            let last = segment + 1 == segments;
            let widths = [WAIST * width, width, if last { 0.8 * width } else { WAIST * width }];
            limbs.push(([at, along(0.3)], [widths[0], widths[1]]));
            limbs.push(([along(0.3), along(0.75)], [widths[1], widths[1]]));
            limbs.push(([along(0.75), along(1.0)], [widths[1], widths[2]]));
            at = along(1.0);
            if last {
                break;
            }
            let side = if random::chance(0.5, rng) { 1.0 } else { -1.0 };
            if segments > 2 && random::chance(self.branches, rng) {
                let rest = 1 + random::below(segments / 2, rng);
                self.filament(at, way + side * FORK, rest.min(2), 0.9 * width, limbs, rng);
            } else if random::chance(self.buds, rng) {
                let out = way + side * random::between(0.6, 1.4, rng);
                let size = self.yeast_diameter_um * random::between(0.6, 1.0, rng);
                let distance = 0.5 * (width * WAIST + size * OVAL);
                self.oval([at[0] + distance * libm::cos(out), at[1] + distance * libm::sin(out)], out, size, limbs);
            }
        }
    }

    /// Adds an oval of this width, elongated along its direction.
    fn oval(&self, centre: Point, way: f64, width: f64, limbs: &mut Vec<Limb>) {
        let reach = 0.5 * (OVAL - 1.0) * width;
        let end = |side: f64| [centre[0] + side * reach * libm::cos(way), centre[1] + side * reach * libm::sin(way)];
        limbs.push(([end(-1.0), end(1.0)], [width, width]));
    }
}
