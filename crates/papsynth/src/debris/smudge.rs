//! Amorphous debris: granular clumps with frayed rims, fibrous shreds, and folded shreds of cytoplasm.

mod folded;

use portable_numerics::rounding::round_to_count;

use super::prelude::*;
use super::tuft::{Tuft, crop};

section! {
    /// Amorphous debris: granular clumps and fibrous shreds of remains of cells, mucus and bacteria, and folded shreds
    /// of cytoplasm without a nucleus.
    ///
    /// In 24 EDF fields of liquid-based cytology, seven clumps per mm² have an absorbance of 0.22 or more.
    /// At 10 %, 50 % and 90 %, their absorbance is 0.23, 0.27 and 0.39, and their area at half of the contrast is 21,
    /// 44 and 115 µm². The eight normal fields have five dark
    /// folded shreds of 12 to 30 µm, counted by eye: about five per mm².
    pub struct Smudges, drawn from rng as pub Smudge {
        /// Number of clumps; drawn once per field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(100.0, 0.8)), 0..=100000, "per field or per mm²";
        /// Fraction of the clumps that are on a cell.
        on_cells: Number (undrawn) = 0.25, 0..=1;
        /// Diameter of a clump.
        diameter_um: Number = Number::log_normal(6.0, 0.65).at_least(2.0).at_most(45.0), 1..=200, "µm";
        /// Length of a clump relative to its width.
        elongation: Number = Number::log_normal(1.5, 0.3).at_least(1.0), 1..=10;
        /// Grain size.
        grain_um: Number = Number::uniform(0.6, 1.1), 0.2..=5, "µm";
        /// Contrast of the grains relative to the absorbance.
        granularity: Number = Number::uniform(0.15, 0.4), 0..=2;
        /// Irregularity of the outline: 0 is an ellipse.
        ragged: Number = Number::uniform(0.7, 1.4), 0..=2;
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.06, 0.75).at_least(0.012).at_most(0.4), 0..=4;
        /// Phase delay; has an effect only with bright-field optics.
        phase_rad: Number = Number::uniform(0.0, 0.2), -3..=3, "radians of phase";
        /// Dyes.
        dyes: DyeAmounts = DyeAmounts { light_green: 1.0, haematein: 0.35, eosin_y: 0.6, orange_g: 0.3, neutral: 0.2 };
        /// Probability that a clump is a fibrous shred.
        fibrous: Number (Chance as fibrous: "Whether it is a fibrous shred.") = 0.1, 0..=1;
        /// Fraction of the clumps that collect at leukocytes, most of them between those of a cluster; these are darker
        /// and larger.
        at_leukocytes: Number (undrawn) = 0.4, 0..=1;
        /// Probability that a clump is a folded shred of cytoplasm, which is darker and larger.
        folded: Number (Chance as folded: "Whether it is a folded shred of cytoplasm.") = 0.04, 0..=1;
    }
}

impl Smudges {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Smudge>) {
        let dyes = placer.dyes(&self.dyes);
        placer.place_on_cells(named!(self.count), &self.on_cells, |rng| {
            let smudge = Smudge { dyes, ..self.one(rng) };
            if smudge.folded { smudge.enlarged(&FOLDED) } else { smudge }
        });
        let mut objects = core::mem::take(&mut placer.objects);
        for object in &mut objects {
            let mut rng = placer.stream(object.number, "collected");
            if random::chance(self.at_leukocytes.draw(&mut rng), &mut rng)
                && let Some((centre_um, depth_um)) = placer.at_leukocytes(&mut rng)
            {
                (object.placement.centre_um, object.placement.depth_um) = (centre_um, depth_um);
                if !object.body.folded {
                    object.body = object.body.enlarged(&COLLECTED);
                }
            }
        }
        placer.objects = objects;
    }
}

/// Factors on the diameter and absorbance of special clumps, and their limits.
struct Enlarged {
    diameter: f64,
    /// Minimum and maximum, µm.
    diameters_um: [f64; 2],
    absorbance: f64,
    absorbances: [f64; 2],
}

/// Clumps at leukocytes.
const COLLECTED: Enlarged =
    Enlarged { diameter: 1.6, diameters_um: [6.0, 22.0], absorbance: 2.5, absorbances: [0.08, 0.3] };
/// Folded shreds; the absorbance is that of one layer.
const FOLDED: Enlarged =
    Enlarged { diameter: 2.5, diameters_um: [11.0, 40.0], absorbance: 2.0, absorbances: [0.1, 0.17] };

/// Elongation of a shred relative to a granular clump.
const SHRED_ELONGATION: f64 = 1.5;
/// Distance of the fibres of a shred, µm.
const FIBRE_DISTANCE_UM: f64 = 0.35;
/// Number of fibres of a shred: minimum, maximum.
const FIBRES: [f64; 2] = [5.0, 40.0];
/// Half-width of a fibre, µm: minimum, maximum.
const FIBRE_UM: [f64; 2] = [0.2, 0.8];
/// Absorbance of a fibre relative to the shred: minimum, maximum.
const FIBRE: [f64; 2] = [0.08, 0.35];
/// Absorbance of the granular part of a shred relative to the shred.
const VEIL: f64 = 0.6;
/// Straight segments of a fibre.
const PARTS: usize = 4;
/// Standard deviation of the curvature of a shred: displacement at its ends relative to its half length.
const BEND: f64 = 0.25;
/// Standard deviation of the directions of fibres, radians.
const FAN: f64 = 0.3;

impl Smudge {
    /// Returns the clump with other values; those outside the limits move towards them, but not beyond.
    fn enlarged(self, by: &Enlarged) -> Self {
        let toward = |value: f64, factor: f64, [low, high]: [f64; 2]| (value * factor).max(low).min(high.max(value));
        Self {
            diameter_um: toward(self.diameter_um, by.diameter, by.diameters_um),
            absorbance: if self.absorbance > 0.0 {
                toward(self.absorbance, by.absorbance, by.absorbances)
            } else {
                0.0
            },
            ..self
        }
    }

    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.5 * self.diameter_um * self.elongation().sqrt() * Tuft::extent(self.ragged)
    }

    /// Returns its length relative to its width.
    fn elongation(&self) -> f64 {
        if self.fibrous && !self.folded { SHRED_ELONGATION * self.elongation } else { self.elongation }
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let mut canvas = match (self.folded, self.fibrous) {
            (true, _) => folded::draw(self, context, &mut rng),
            (false, true) => self.shred(context, &mut rng),
            (false, false) => self.clump(context, &mut rng),
        };
        crop(&mut canvas, context, context.px(self.reach_um(context.pixel_um)));
        canvas.into_phantom(self.dyes, self.phase_rad, self.absorbance)
    }

    /// Returns the granular part of a clump.
    fn tuft(&self, context: &ObjectContext<'_>) -> Tuft {
        let (radius, stretch) = (context.px(0.5 * self.diameter_um), self.elongation().sqrt());
        Tuft {
            centre: context.centre,
            half: [radius * stretch, radius / stretch],
            turn: context.rotation_deg.to_radians(),
            grain: context.px(self.grain_um),
            granularity: self.granularity,
            ragged: self.ragged,
            absorbance: self.absorbance,
        }
    }

    /// Draws a granular clump.
    fn clump(&self, context: &ObjectContext<'_>, rng: &mut Stream) -> ObjectCanvas {
        let tuft = self.tuft(context);
        let mut canvas = context.canvas(&tuft.corners(), 0.0);
        tuft.draw(&mut canvas, context, rng);
        canvas
    }

    /// Draws a shred: a bent bundle of fibres of unequal length in a granular clump.
    fn shred(&self, context: &ObjectContext<'_>, rng: &mut Stream) -> ObjectCanvas {
        let (radius, stretch) = (0.5 * self.diameter_um, self.elongation().sqrt());
        let [a, b] = [radius * stretch, radius / stretch];
        let bend = BEND * random::normal(rng);
        let count = round_to_count((2.0 * b / FIBRE_DISTANCE_UM).clamp(FIBRES[0], FIBRES[1]));
        let fibres: Vec<(Vec<Point>, f64)> = (0..count)
            .map(|_| {
                let (from, across) = (0.3 * a * random::normal(rng), b * random::between(-1.0, 1.0, rng));
                let (half, fan) = (a * random::between(0.15, 0.5, rng), FAN * random::normal(rng));
                let points = (0..=PARTS).map(|i| {
                    let along = half * (2.0 * i as f64 / PARTS as f64 - 1.0);
                    let x = (from + along).clamp(-1.2 * a, 1.2 * a);
                    let jitter = 0.06 * self.ragged * b * random::normal(rng);
                    context.to_grid([x, across + fan * along + bend * x * x / a + jitter])
                });
                (points.collect(), random::between(FIBRE_UM[0], FIBRE_UM[1], rng))
            })
            .collect();
        let tuft = Tuft { absorbance: VEIL * self.absorbance, ..self.tuft(context) };
        let corners = tuft.corners();
        let mut canvas = context.canvas(fibres.iter().flat_map(|(points, _)| points).chain(&corners), FIBRE_UM[1]);
        tuft.draw(&mut canvas, context, rng);
        for (points, half_width) in &fibres {
            let strength = self.absorbance * random::between(FIBRE[0], FIBRE[1], rng);
            for (i, pair) in points.windows(2).enumerate() {
                // Fibres taper towards both ends.
                let taper = |i: usize| if i == 0 || i == PARTS { 0.4 } else { 1.0 };
                let half_widths = [taper(i), taper(i + 1)].map(|share| context.px(share * half_width));
                canvas.stroke(&Stroke { ends: [pair[0], pair[1]], half_widths }, strength);
            }
        }
        canvas
    }
}
