//! Amorphous debris: greyish, granular, irregular clumps and shreds, frayed at their rims.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::check::Section;
use super::ground::{Ground, Lie};
use super::kind::{Kinds, Thing};
use super::paint::Painting;
use super::site::Site;
use crate::phantom::piece::Phantom;
use crate::phantom::pools::Look;
use crate::phantom::tile::Point;
use crate::recipe::number::Number;
use crate::recipe::specimen::DyeAmounts;

/// Amorphous debris: granular clumps of what was left of cells, mucus and bacteria.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Smudges {
    /// Number of clumps, 0 to 100000; drawn once a field.
    pub count: Number,
    /// Share of the clumps that lie on a cell, 0 to 1.
    pub on_cells: Number,
    /// Diameter of a clump, µm, 1 to 200.
    pub diameter_um: Number,
    /// Length of a clump relative to its width, 1 to 10.
    pub elongation: Number,
    /// Size of its grains, µm, 0.2 to 5.
    pub grain_um: Number,
    /// How much the grains differ from each other, relative to the absorbance, 0 to 2.
    pub granularity: Number,
    /// How ragged its outline is, 0 to 2: 0 is an ellipse.
    pub ragged: Number,
    /// Absorbance, 0 to 4.
    pub absorbance: Number,
    /// How late light comes through it, radians of phase, -3 to 3; seen by bright-field optics alone.
    pub phase_rad: Number,
    /// Its dyes.
    pub dyes: DyeAmounts,
}

/// A clump of amorphous debris, its numbers drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Smudge {
    /// Diameter of the disc of its area before it is frayed, µm.
    pub diameter_um: f64,
    /// Length relative to width.
    pub elongation: f64,
    /// Size of its grains, µm.
    pub grain_um: f64,
    /// How much the grains differ, relative to the absorbance.
    pub granularity: f64,
    /// How ragged its outline is.
    pub ragged: f64,
    /// Absorbance.
    pub absorbance: f64,
    /// How late light comes through it, radians.
    pub phase_rad: f64,
    /// Its dyes where its absorbance is 1.
    pub dyes: dye_spectra::Amounts,
}

impl Default for Smudges {
    fn default() -> Self {
        Self {
            count: Number::log_normal(9.0, 0.8),
            on_cells: 0.25.into(),
            diameter_um: Number::log_normal(6.0, 0.65).at_least(2.0).at_most(45.0),
            elongation: Number::log_normal(1.5, 0.3).at_least(1.0),
            grain_um: Number::uniform(0.6, 1.1),
            granularity: Number::uniform(0.3, 0.7),
            ragged: Number::uniform(0.6, 1.3),
            absorbance: Number::log_normal(0.05, 0.65).at_least(0.012).at_most(0.4),
            phase_rad: Number::uniform(0.0, 0.2),
            dyes: DyeAmounts { light_green: 1.0, haematein: 0.35, eosin_y: 0.6, orange_g: 0.3, neutral: 0.2 },
        }
    }
}

impl Kinds<Smudge> for Smudges {
    fn none() -> Self {
        Self { count: 0.0.into(), ..Self::default() }
    }

    fn check(&self, section: &mut Section<'_>) {
        section.count("count", &self.count, 0.0, 1e5);
        section.share("on_cells", &self.on_cells);
        section.number("diameter_um", &self.diameter_um, 1.0, 200.0);
        section.number("elongation", &self.elongation, 1.0, 10.0);
        section.number("grain_um", &self.grain_um, 0.2, 5.0);
        section.number("granularity", &self.granularity, 0.0, 2.0);
        section.number("ragged", &self.ragged, 0.0, 2.0);
        section.absorbance("absorbance", &self.absorbance);
        section.phase_rad("phase_rad", &self.phase_rad);
        section.dyes("dyes", &self.dyes);
    }

    fn draw(&self, ground: &mut Ground<'_, Smudge>) {
        let dyes = ground.dyes(&self.dyes);
        for number in 0..ground.count("count", &self.count) {
            let mut rng = ground.stream(number, "body");
            let (centre_um, depth_um) = ground.spot(&self.on_cells, &mut rng);
            let smudge = Smudge {
                diameter_um: self.diameter_um.draw(&mut rng),
                elongation: self.elongation.draw(&mut rng),
                grain_um: self.grain_um.draw(&mut rng),
                granularity: self.granularity.draw(&mut rng),
                ragged: self.ragged.draw(&mut rng),
                absorbance: self.absorbance.draw(&mut rng),
                phase_rad: self.phase_rad.draw(&mut rng),
                dyes,
            };
            let lie = Lie::any_way(centre_um, depth_um, &mut rng);
            ground.add(number, 0, lie, smudge);
        }
    }
}

/// How far beyond its ellipse a clump may reach, in its radii.
const REACH: f64 = 1.6;

/// Sizes of the waves of a ragged outline, relative to the radius, and their strengths.
const WAVES: [(f64, f64); 2] = [(0.42, 0.42), (0.16, 0.22)];

/// Width over which the outline fades, relative to the radius: a clump is thinner at its rim.
const FADE: f64 = 0.35;

impl Thing for Smudge {
    fn absorbance(&self) -> f64 {
        self.absorbance
    }

    fn reach_um(&self, _pixel_um: f64) -> f64 {
        0.5 * self.diameter_um * self.elongation.sqrt() * (1.0 + (REACH - 1.0) * self.ragged.min(1.5))
    }

    fn phantom(&self, site: &Site<'_>) -> Phantom {
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
            let look = Look::clouds(site.px(size * radius_um), &mut rng);
            let strength = (strength * self.ragged) as f32;
            painting.rows(site.pools.clouds(), &look, |_, _, values, field| {
                values.iter_mut().zip(field).for_each(|(value, field)| *value += strength * field);
            });
        }
        // A pixel is covered where that is above 0, and its edge is as sharp as the grid.
        let sharpness = site.px(radius_um) as f32;
        let grains = Look::clouds(site.px(GRAIN_SIGMA * self.grain_um), &mut rng);
        let (absorbance, granularity) = (self.absorbance as f32, self.granularity as f32);
        painting.rows(site.pools.clouds(), &grains, |_, covers, values, field| {
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
