//! Amorphous debris: greyish, granular, irregular clumps and shreds, frayed at their rims.

use super::prelude::*;

section! {
    /// Amorphous debris: granular clumps of what was left of cells, mucus and bacteria.
    pub struct Smudges, drawn from rng as pub Smudge {
        /// Number of clumps; drawn once a field.
        count: Abundance (undrawn) = Abundance::per_mm2(Number::log_normal(100.0, 0.8)), 0..=100000, "per field or per mm²";
        /// Share of the clumps that lie on a cell.
        on_cells: Number (undrawn) = 0.25, 0..=1;
        /// Diameter of a clump.
        diameter_um: Number = Number::log_normal(6.0, 0.65).at_least(2.0).at_most(45.0), 1..=200, "µm";
        /// Length of a clump relative to its width.
        elongation: Number = Number::log_normal(1.5, 0.3).at_least(1.0), 1..=10;
        /// Size of its grains.
        grain_um: Number = Number::uniform(0.6, 1.1), 0.2..=5, "µm";
        /// How much the grains differ from each other, relative to the absorbance.
        granularity: Number = Number::uniform(0.3, 0.7), 0..=2;
        /// How ragged its outline is: 0 is an ellipse.
        ragged: Number = Number::uniform(0.6, 1.3), 0..=2;
        /// Absorbance.
        absorbance: Number = Number::log_normal(0.05, 0.65).at_least(0.012).at_most(0.4), 0..=4;
        /// How late light comes through it; seen by bright-field optics alone.
        phase_rad: Number = Number::uniform(0.0, 0.2), -3..=3, "radians of phase";
        /// Its dyes.
        dyes: DyeAmounts = DyeAmounts { light_green: 1.0, haematein: 0.35, eosin_y: 0.6, orange_g: 0.3, neutral: 0.2 };
    }
}

impl Smudges {
    pub(super) fn draw(&self, ground: &mut Ground<'_, Smudge>) {
        let dyes = ground.dyes(&self.dyes);
        ground.strew_on_cells(named!(self.count), &self.on_cells, |rng| Smudge { dyes, ..self.one(rng) });
    }
}

/// How far beyond its ellipse a clump may reach, in its radii.
const REACH: f64 = 1.6;

/// Sizes of the waves of a ragged outline, relative to the radius, and their strengths.
const WAVES: [(f64, f64); 2] = [(0.42, 0.42), (0.16, 0.22)];

/// Width over which the outline fades, relative to the radius: a clump is thinner at its rim.
const FADE: f64 = 0.35;

impl Smudge {
    pub(super) fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.5 * self.diameter_um * self.elongation.sqrt() * (1.0 + (REACH - 1.0) * self.ragged.min(1.5))
    }

    pub(super) fn phantom(&self, site: &Site<'_>) -> Phantom {
        let mut rng = site.stream("shape");
        let radius_um = 0.5 * self.diameter_um;
        let stretch = self.elongation.sqrt();
        let (a, b) = (radius_um * stretch, radius_um / stretch);
        let reach = 1.0 + (REACH - 1.0) * self.ragged.min(1.5);
        let corners = site.places(&[[-a, -b], [a, -b], [a, b], [-a, b]].map(|p| p.map(|v| v * reach)));
        let mut painting = site.painting(&corners, 0.0);
        let turn = site.rotation_deg.to_radians();
        let (sin, cos) = (libm::sin(turn), libm::cos(turn));
        let (a_px, b_px) = (site.px(a), site.px(b));
        // Where the clump is: 1 in its middle, 0 on its outline, before waves push that in and out.
        painting.absorbance.for_each(|p: Point, value| {
            let (dx, dy) = (p[0] - site.centre[0], p[1] - site.centre[1]);
            let (u, v) = ((dx * cos + dy * sin) / a_px, (dy * cos - dx * sin) / b_px);
            *value = (1.0 - (u * u + v * v).sqrt()) as f32;
        });
        for (size, strength) in WAVES {
            let look = FieldSampler::clouds(site.px(size * radius_um), &mut rng);
            let strength = (strength * self.ragged) as f32;
            painting.rows(site.noise_fields.clouds(), &look, |_, _, values, field| {
                values.iter_mut().zip(field).for_each(|(value, field)| *value += strength * field);
            });
        }
        // A pixel is covered where that is above 0, and its edge is as sharp as the grid.
        let sharpness = site.px(radius_um) as f32;
        let grains = FieldSampler::clouds(site.px(GRAIN_SIGMA * self.grain_um), &mut rng);
        let (absorbance, granularity) = (self.absorbance as f32, self.granularity as f32);
        painting.rows(site.noise_fields.clouds(), &grains, |_, covers, values, field| {
            for ((cover, value), grain) in covers.iter_mut().zip(values).zip(field) {
                let inside = *value;
                *cover = (inside * sharpness + 0.5).clamp(0.0, 1.0);
                let fade = (0.45 + 0.55 * (inside / FADE as f32).clamp(0.0, 1.0)) * *cover;
                *value = absorbance * fade * (1.0 + granularity * grain).max(0.0);
            }
        });
        within(&mut painting, site, a.max(b) * reach);
        painting.finish(self.dyes, self.phase_rad, self.absorbance)
    }
}

/// Standard deviation of a field whose grains are so large, relative to their diameter.
const GRAIN_SIGMA: f64 = 0.42;

/// Cuts off what waves have carried beyond the reach of a clump.
fn within(painting: &mut Painting, site: &Site<'_>, reach_um: f64) {
    let reach = site.px(reach_um);
    let values = &mut painting.absorbance.values;
    let mut index = 0;
    painting.coverage.for_each(|p, cover| {
        let (dx, dy) = (p[0] - site.centre[0], p[1] - site.centre[1]);
        if dx * dx + dy * dy > reach * reach {
            *cover = 0.0;
            values[index] = 0.0;
        }
        index += 1;
    });
}
