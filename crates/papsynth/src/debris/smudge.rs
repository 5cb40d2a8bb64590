//! Amorphous debris: greyish, granular, irregular clumps with frayed rims.

use super::prelude::*;

section! {
    /// Amorphous debris: granular clumps of remains of cells, mucus and bacteria.
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
        granularity: Number = Number::uniform(0.3, 0.7), 0..=2;
        /// Irregularity of the outline: 0 is an ellipse.
        ragged: Number = Number::uniform(0.6, 1.3), 0..=2;
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.05, 0.65).at_least(0.012).at_most(0.4), 0..=4;
        /// Phase delay; has an effect only with bright-field optics.
        phase_rad: Number = Number::uniform(0.0, 0.2), -3..=3, "radians of phase";
        /// Dyes.
        dyes: DyeAmounts = DyeAmounts { light_green: 1.0, haematein: 0.35, eosin_y: 0.6, orange_g: 0.3, neutral: 0.2 };
    }
}

impl Smudges {
    pub(super) fn draw(&self, placer: &mut KindPlacer<'_, Smudge>) {
        let dyes = placer.dyes(&self.dyes);
        placer.place_on_cells(named!(self.count), &self.on_cells, |rng| Smudge { dyes, ..self.one(rng) });
    }
}

/// Maximum extent of a clump relative to its ellipse.
const MAX_EXTENT: f64 = 1.6;

/// Size relative to the radius, and strength, of the noise fields that shape an irregular outline.
const WAVES: [(f64, f64); 2] = [(0.42, 0.42), (0.16, 0.22)];

/// Width of the thinner rim of a clump, relative to the radius.
const FADE: f64 = 0.35;

impl Smudge {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.5 * self.diameter_um * self.elongation.sqrt() * (1.0 + (MAX_EXTENT - 1.0) * self.ragged.min(1.5))
    }

    pub(super) fn phantom(&self, context: &ObjectContext<'_>) -> Phantom {
        let mut rng = context.stream("shape");
        let radius_um = 0.5 * self.diameter_um;
        let stretch = self.elongation.sqrt();
        let (a, b) = (radius_um * stretch, radius_um / stretch);
        let reach = 1.0 + (MAX_EXTENT - 1.0) * self.ragged.min(1.5);
        let corners = context.curve_to_grid(&[[-a, -b], [a, -b], [a, b], [-a, b]].map(|p| p.map(|v| v * reach)));
        let mut canvas = context.canvas(&corners, 0.0);
        let turn = context.rotation_deg.to_radians();
        let (sin, cos) = (libm::sin(turn), libm::cos(turn));
        let (a_px, b_px) = (context.px(a), context.px(b));
        // A level function, 1 at the centre and 0 on the ellipse, to which noise fields are added.
        canvas.absorbance.for_each(|p: Point, value| {
            let (dx, dy) = (p[0] - context.centre[0], p[1] - context.centre[1]);
            let (u, v) = ((dx * cos + dy * sin) / a_px, (dy * cos - dx * sin) / b_px);
            *value = (1.0 - (u * u + v * v).sqrt()) as f32;
        });
        for (size, strength) in WAVES {
            let sampler = FieldSampler::clouds(context.px(size * radius_um), &mut rng);
            let strength = (strength * self.ragged) as f32;
            canvas.rows(context.noise_fields.clouds(), &sampler, |_, _, values, field| {
                values.iter_mut().zip(field).for_each(|(value, field)| *value += strength * field);
            });
        }
        // The clump covers pixels with a positive level; its edge is one grid point wide.
        let sharpness = context.px(radius_um) as f32;
        let grains = FieldSampler::clouds(context.px(GRAIN_SIGMA * self.grain_um), &mut rng);
        let (absorbance, granularity) = (self.absorbance as f32, self.granularity as f32);
        canvas.rows(context.noise_fields.clouds(), &grains, |_, covers, values, field| {
            for ((cover, value), grain) in covers.iter_mut().zip(values).zip(field) {
                let inside = *value;
                *cover = (inside * sharpness + 0.5).clamp(0.0, 1.0);
                let fade = (0.45 + 0.55 * (inside / FADE as f32).clamp(0.0, 1.0)) * *cover;
                *value = absorbance * fade * (1.0 + granularity * grain).max(0.0);
            }
        });
        crop(&mut canvas, context, a.max(b) * reach);
        canvas.into_phantom(self.dyes, self.phase_rad, self.absorbance)
    }
}

/// Standard deviation of the noise field relative to the grain size.
const GRAIN_SIGMA: f64 = 0.42;

/// Removes parts of a clump beyond its maximum radius.
fn crop(canvas: &mut ObjectCanvas, context: &ObjectContext<'_>, reach_um: f64) {
    let reach = context.px(reach_um);
    let values = &mut canvas.absorbance.values;
    let mut index = 0;
    canvas.coverage.for_each(|p, cover| {
        let (dx, dy) = (p[0] - context.centre[0], p[1] - context.centre[1]);
        if dx * dx + dy * dy > reach * reach {
            *cover = 0.0;
            values[index] = 0.0;
        }
        index += 1;
    });
}
