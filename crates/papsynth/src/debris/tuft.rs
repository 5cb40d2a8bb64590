//! Granular tufts: irregular patches of grains, in amorphous debris and in the remains of leukocytes.

use super::prelude::*;

/// A granular tuft.
pub(super) struct Tuft {
    /// Centre in grid points.
    pub(super) centre: Point,
    /// Half length and half width of its ellipse, grid points.
    pub(super) half: [f64; 2],
    /// Direction of its length, radians.
    pub(super) turn: f64,
    /// Grain size, grid points.
    pub(super) grain: f64,
    /// Contrast of the grains relative to the absorbance.
    pub(super) granularity: f64,
    /// Irregularity of the outline: 0 is an ellipse.
    pub(super) ragged: f64,
    /// Absorbance of its centre.
    pub(super) absorbance: f64,
}

/// Maximum extent of a tuft relative to its ellipse.
const MAX_EXTENT: f64 = 1.6;

/// Size relative to the radius, and strength, of the noise fields that shape an irregular outline.
const WAVES: [(f64, f64); 2] = [(0.42, 0.42), (0.16, 0.22)];
/// Displacement of an irregular outline by grains, in grain sizes.
const GRAINY_EDGE: f64 = 0.3;
/// Maximum of this displacement relative to the radius.
const MAX_GRAINY_EDGE: f64 = 0.25;

/// Slope of the level function outside the ellipse.
const OUTSIDE: f64 = 2.2;

/// Width of the thinner rim of a tuft, relative to the radius.
const FADE: f32 = 0.6;
/// Absorbance at the outline relative to the centre. On EDF fields of liquid-based cytology, the edges of
/// debris are about as soft as those of leukocytes.
const EDGE: f32 = 0.1;

/// Sizes relative to the grain size, and strengths, of the noise fields of the grains: debris has grains and larger,
/// uneven patches. The sum has a standard deviation of 1.
const GRAINS: [(f64, f32); 2] = [(1.0, 0.7), (2.7, 0.714)];

/// Standard deviation of the noise field relative to the grain size.
const GRAIN_SIGMA: f64 = 0.42;

impl Tuft {
    /// Returns the maximum extent of a tuft relative to its ellipse.
    pub(super) fn extent(ragged: f64) -> f64 {
        1.0 + (MAX_EXTENT - 1.0) * ragged.min(1.5)
    }

    /// Returns the corners of a rectangle that contains the tuft, in grid points.
    pub(super) fn corners(&self) -> [Point; 4] {
        let [a, b] = self.half.map(|half| half * Self::extent(self.ragged));
        [[-a, -b], [a, -b], [a, b], [-a, b]].map(|corner| placed(corner, self.turn, self.centre))
    }

    /// Draws the tuft on an empty canvas.
    pub(super) fn draw(&self, canvas: &mut ObjectCanvas, context: &ObjectContext<'_>, rng: &mut Stream) {
        let [a, b] = self.half;
        let radius = (a * b).sqrt();
        let (sin, cos) = (libm::sin(self.turn), libm::cos(self.turn));
        // A level function, 1 at the centre and 0 on the ellipse, to which noise fields are added. It falls faster
        // outside the ellipse, so that the tuft ends before the maximum extent.
        canvas.absorbance.for_each(|p: Point, value| {
            let (dx, dy) = (p[0] - self.centre[0], p[1] - self.centre[1]);
            let (u, v) = ((dx * cos + dy * sin) / a, (dy * cos - dx * sin) / b);
            let level = 1.0 - (u * u + v * v).sqrt();
            *value = level.min(OUTSIDE * level) as f32;
        });
        for (size, strength) in WAVES {
            let sampler = FieldSampler::clouds(size * radius, rng);
            let strength = (strength * self.ragged) as f32;
            canvas.rows(context.noise_fields.clouds(), &sampler, |_, _, values, field| {
                values.iter_mut().zip(field).for_each(|(value, field)| *value += strength * field);
            });
        }
        // The tuft covers pixels with a positive level; its edge is one grid point wide.
        let sharpness = radius as f32;
        let grainy_edge = (self.ragged * (GRAINY_EDGE * self.grain / radius).min(MAX_GRAINY_EDGE)) as f32;
        let (absorbance, granularity) = (self.absorbance as f32, self.granularity as f32);
        let mut structure = vec![0.0; canvas.absorbance.values.len()];
        for (size, strength) in GRAINS {
            let sampler = FieldSampler::clouds(size * GRAIN_SIGMA * self.grain, rng);
            let mut rest = structure.as_mut_slice();
            canvas.rows(context.noise_fields.clouds(), &sampler, |_, _, values, field| {
                let (row, later) = core::mem::take(&mut rest).split_at_mut(values.len());
                row.iter_mut().zip(field).for_each(|(sum, field)| *sum += strength * field);
                rest = later;
            });
        }
        let values = canvas.absorbance.values.iter_mut().zip(&mut canvas.coverage.values);
        for ((value, cover), grain) in values.zip(&structure) {
            let inside = *value + grainy_edge * grain;
            *cover = (inside * sharpness + 0.5).clamp(0.0, 1.0);
            let fade = (EDGE + (1.0 - EDGE) * (inside / FADE).clamp(0.0, 1.0)) * *cover;
            *value = absorbance * fade * (1.0 + granularity * grain).max(0.0);
        }
    }
}

/// Removes the parts of an object beyond a distance from its centre, in grid points.
pub(super) fn crop(canvas: &mut ObjectCanvas, context: &ObjectContext<'_>, reach: f64) {
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
