//! Drawing of an object on a tile: its coverage and absorbance.

use dye_spectra::Amounts;
use multiversion::multiversion;

use crate::phantom::noise_fields::{FieldSampler, NoiseField, SIDE, Texels};
use crate::phantom::piece::{MIN_ABSORBANCE, Phantom};
use crate::phantom::tile::{Point, Tile};

/// The tile on which an object is drawn.
pub(super) struct ObjectCanvas {
    /// Fraction of each pixel that the object covers.
    pub(super) coverage: Tile,
    /// Absorbance of each pixel.
    pub(super) absorbance: Tile,
}

/// A straight stroke with round ends and linearly changing half-width, in pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stroke {
    pub(super) ends: [Point; 2],
    pub(super) half_widths: [f64; 2],
}

impl Stroke {
    /// Creates a stroke of constant width.
    pub(super) fn even(from: Point, to: Point, half_width: f64) -> Self {
        Self { ends: [from, to], half_widths: [half_width; 2] }
    }
}

/// Mean of the absolute value of a standard normal number: √(2/π).
const MEAN_ABS: f32 = 0.797_884_6;

impl ObjectCanvas {
    /// Creates an empty canvas around points, with a margin in pixels.
    pub(super) fn around<'a>(points: impl IntoIterator<Item = &'a Point>, margin: f64) -> Self {
        let coverage = Tile::around(points, margin);
        Self { absorbance: coverage.blank(), coverage }
    }

    /// Creates an empty canvas of the same size and position.
    pub(super) fn blank(&self) -> Self {
        Self { coverage: self.coverage.blank(), absorbance: self.coverage.blank() }
    }

    /// Returns the coverage and resets it to 0.
    pub(super) fn take_coverage(&mut self) -> Vec<f32> {
        let blank = vec![0.0; self.coverage.values.len()];
        core::mem::replace(&mut self.coverage.values, blank)
    }

    /// Sets a uniform absorbance where the object covers.
    pub(super) fn fill_covered(&mut self, absorbance: f64) {
        self.shade(|_| absorbance);
    }

    /// Sets the absorbance to a function of position where the object covers.
    pub(super) fn shade(&mut self, absorbance: impl Fn(Point) -> f64) {
        let mut covers = self.coverage.values.iter();
        self.absorbance.for_each(|p, value| {
            if let Some(cover) = covers.next().filter(|cover| **cover > 0.0) {
                *value = cover * absorbance(p) as f32;
            }
        });
    }

    /// Sets the absorbance to a function of the coverage of the object and of an inner region.
    pub(super) fn shade_by_coverage(&mut self, inside: &[f32], absorbance: impl Fn(f32, f32) -> f32) {
        let values = self.absorbance.values.iter_mut().zip(&self.coverage.values).zip(inside);
        values.for_each(|((value, cover), inner)| *value = absorbance(*cover, *inner));
    }

    /// Draws a stroke; its absorbance is added to the existing one.
    pub(super) fn stroke(&mut self, stroke: &Stroke, absorbance: f64) {
        draw(stroke, self, absorbance as f32, 0.0);
    }

    /// Draws a stroke; where strokes overlap, the larger absorbance is used.
    pub(super) fn stroke_max(&mut self, stroke: &Stroke, absorbance: f64) {
        draw(stroke, self, 0.0, absorbance as f32);
    }

    /// Adds a polygon of uniform absorbance.
    pub(super) fn fill(&mut self, polygon: &[Point], absorbance: f64) {
        let mut shape = self.coverage.blank();
        shape.cover(polygon);
        self.add_shape(&shape, |coverage| coverage * absorbance as f32);
    }

    /// Adds a shape, given by its coverage on a tile of the same size; `absorbance` is a function of the coverage.
    pub(super) fn add_shape(&mut self, shape: &Tile, absorbance: impl Fn(f32) -> f32) {
        let values = self.coverage.values.iter_mut().zip(&mut self.absorbance.values);
        for ((cover, value), coverage) in values.zip(&shape.values) {
            *cover = cover.max(*coverage);
            *value += absorbance(*coverage);
        }
    }

    /// Calls `visit` for every row with its first pixel, coverage, absorbance, and values of a noise field.
    pub(super) fn rows(
        &mut self,
        noise_field: &NoiseField,
        sampler: &FieldSampler,
        mut visit: impl FnMut(Point, &mut [f32], &mut [f32], &[f32]),
    ) {
        let (width, [x, y]) = (self.coverage.width, self.coverage.origin);
        let mut field = vec![0.0; width];
        let mut texels: Texels = [0.0; SIDE + 1];
        let covers = self.coverage.values.chunks_exact_mut(width);
        for (row, (cover, value)) in covers.zip(self.absorbance.values.chunks_exact_mut(width)).enumerate() {
            noise_field.row_into(&mut field, sampler, [0.0, row as f64], &mut texels);
            visit([x as f64, y as f64 + row as f64], cover, value, &field);
        }
    }

    /// Multiplies the absorbance by max(1 + strength · field, 0).
    pub(super) fn texture(&mut self, noise_field: &NoiseField, sampler: &FieldSampler, strength: f32) {
        self.rows(noise_field, sampler, |_, _, values, field| {
            for (value, field) in values.iter_mut().zip(field) {
                *value *= (1.0 + strength * field).max(0.0);
            }
        });
    }

    /// Multiplies the absorbance by max(1 + strength · (m − |field|), 0), where m is the mean of |field|. This draws
    /// dark walls between pale vacuoles.
    pub(super) fn foam(&mut self, noise_field: &NoiseField, sampler: &FieldSampler, strength: f32) {
        self.rows(noise_field, sampler, |_, _, values, field| {
            for (value, field) in values.iter_mut().zip(field) {
                *value *= (1.0 + strength * (MEAN_ABS - field.abs())).max(0.0);
            }
        });
    }

    /// Returns the phantom, with phase delay `phase_rad` where the absorbance is `absorbance`.
    pub(super) fn into_phantom(mut self, dyes: Amounts, phase_rad: f64, absorbance: f64) -> Phantom {
        if absorbance < MIN_ABSORBANCE {
            // Phase delay is stored per absorbance, so non-absorbing objects need a minimum.
            let scale = (MIN_ABSORBANCE / absorbance.max(f64::MIN_POSITIVE)) as f32;
            let values = self.absorbance.values.iter_mut().zip(&self.coverage.values);
            for (value, cover) in values {
                *value = if absorbance > 0.0 { *value * scale } else { cover * MIN_ABSORBANCE as f32 };
            }
        }
        let area = self.coverage.sum();
        Phantom::whole(self.absorbance, self.coverage, area, dyes).with_phase(phase_rad, absorbance)
    }
}

/// Pixels computed together.
const LANES: usize = 16;

/// Draws a stroke: adds `added` and takes the maximum with `least` times its coverage, the fraction of a pixel that it
/// covers, from the distance of the pixel centre to the edge.
#[multiversion(targets = "simd")]
fn draw(stroke: &Stroke, canvas: &mut ObjectCanvas, added: f32, least: f32) {
    let (width, height) = (canvas.coverage.width, canvas.coverage.height());
    let [a, b] = stroke.ends.map(|end| [0, 1].map(|axis| end[axis] - canvas.coverage.origin[axis] as f64));
    let d = [b[0] - a[0], b[1] - a[1]];
    let square = d[0] * d[0] + d[1] * d[1];
    let inverse = if square > 0.0 { (1.0 / square) as f32 } else { 0.0 };
    let [dx, dy] = d.map(|length| length as f32);
    let [half, last] = stroke.half_widths;
    let (reach, half, growth) = (half.max(last) + 0.5, half as f32, (last - half) as f32);
    let pixels = |from: f64, to: f64, count: usize| {
        let end = (to.floor() + 1.0).max(0.0) as usize;
        from.ceil().max(0.0) as usize..end.min(count)
    };
    let per_row = 1.0 / d[1];
    for y in pixels(a[1].min(b[1]) - reach, a[1].max(b[1]) + reach, height) {
        // The part of the stroke within reach of this row bounds the columns.
        let py = y as f64 - a[1];
        let [s, t] = match d[1] {
            0.0 => [0.0, 1.0],
            _ => [py - reach, py + reach].map(|edge| (edge * per_row).clamp(0.0, 1.0)),
        };
        let (left, right) = (a[0] + s * d[0], a[0] + t * d[0]);
        let columns = pixels(left.min(right) - reach, left.max(right) + reach, width);
        let py = py as f32;
        for start in columns.clone().step_by(LANES) {
            let (first, left) = ((start as f64 - a[0]) as f32, (columns.end - start) as f32);
            let mut coverage = [0.0; LANES];
            for (i, coverage) in coverage.iter_mut().enumerate() {
                let px = first + i as f32;
                let along = smaller(larger((px * dx + py * dy) * inverse, 0.0), 1.0);
                let (ex, ey) = (px - along * dx, py - along * dy);
                let half = half + along * growth;
                let depth = half - (ex * ex + ey * ey).sqrt();
                let covered = smaller(larger(depth + 0.5, 0.0), smaller(2.0 * half, 1.0));
                // Pixels beyond the columns may be in the next row.
                *coverage = if (i as f32) < left { covered } else { 0.0 };
            }
            let at = y * width + start;
            let covers = &mut canvas.coverage.values[at..];
            let values = &mut canvas.absorbance.values[at..];
            match (covers.first_chunk_mut::<LANES>(), values.first_chunk_mut::<LANES>()) {
                (Some(covers), Some(values)) => paint(covers, values, &coverage, added, least),
                _ => paint(covers, values, &coverage, added, least),
            }
        }
    }
}

#[inline(always)]
fn paint(covers: &mut [f32], values: &mut [f32], coverage: &[f32], added: f32, least: f32) {
    for ((cover, value), &coverage) in covers.iter_mut().zip(values).zip(coverage) {
        *cover = larger(*cover, coverage);
        *value = larger(*value + added * coverage, least * coverage);
    }
}

// These compile to one vector instruction; `f32::max` and `f32::min` also handle NaN.

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::phantom::noise_fields::NoiseFieldGenerator;
    use crate::random;

    /// Returns the fraction of a pixel that a stroke covers.
    fn coverage(stroke: &Stroke, p: Point) -> f64 {
        let [a, b] = stroke.ends;
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx * dx + dy * dy;
        let along = (p[0] - a[0]) * dx + (p[1] - a[1]) * dy;
        let t = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
        let (ex, ey) = (p[0] - a[0] - t * dx, p[1] - a[1] - t * dy);
        let half_width = stroke.half_widths[0] + t * (stroke.half_widths[1] - stroke.half_widths[0]);
        (half_width - (ex * ex + ey * ey).sqrt() + 0.5).clamp(0.0, (2.0 * half_width).min(1.0))
    }

    #[test]
    fn strokes_equal_their_definition_at_every_pixel() {
        let mut rng = Key { seed: 4, index: 0 }.stream("test", 0, "strokes");
        for _ in 0..300 {
            let mut canvas = ObjectCanvas::around(&[[100.0, -40.0], [130.0, -19.0]], 0.0);
            let mut point = || [random::between(90.0, 140.0, &mut rng), random::between(-45.0, -10.0, &mut rng)];
            let mut ends = [point(), point()];
            match random::below(6, &mut rng) {
                0 => ends[1] = ends[0],
                1 => ends[1][0] = ends[0][0],
                2 => ends[1][1] = ends[0][1],
                _ => {}
            }
            let half_widths = [random::between(0.0, 9.0, &mut rng), random::between(0.0, 3.0, &mut rng)];
            let stroke = Stroke { ends, half_widths };
            canvas.absorbance.values.fill(0.25);
            canvas.stroke(&stroke, 0.5);
            canvas.stroke_max(&stroke, 0.6);
            let mut covers = canvas.coverage.values.iter();
            canvas.absorbance.clone().for_each(|p, value| {
                let (wanted, cover) = (coverage(&stroke, p), f64::from(*covers.next().unwrap()));
                assert!((cover - wanted).abs() < 2e-5, "{stroke:?} {p:?}: {cover} {wanted}");
                let absorbance = (0.25 + 0.5 * wanted).max(0.6 * wanted);
                assert!((f64::from(*value) - absorbance).abs() < 2e-5, "{stroke:?} {p:?}: {value} {absorbance}");
            });
        }
    }

    #[test]
    fn foam_keeps_the_mean_and_is_darkest_where_the_field_is_zero() {
        let key = Key { seed: 4, index: 0 };
        let (generator, mut rng) = (NoiseFieldGenerator::new(), key.stream("test", 0, "foam"));
        let (fields, sampler) = (generator.fields(key), FieldSampler::clouds(2.0, &mut rng));
        let mut canvas = ObjectCanvas::around(&[[0.0, 0.0], [400.0, 300.0]], 0.0);
        canvas.absorbance.values.fill(0.1);
        canvas.foam(fields.clouds(), &sampler, 0.5);
        let mean = canvas.absorbance.values.iter().sum::<f32>() / canvas.absorbance.values.len() as f32;
        assert!((mean - 0.1).abs() < 0.004, "{mean}");
        canvas.rows(fields.clouds(), &sampler, |_, _, values, field| {
            let pairs = || values.iter().zip(field);
            let darkest = 0.1 * (1.0 + 0.5 * MEAN_ABS);
            assert!(
                pairs().all(|(value, field)| *value <= darkest && (field.abs() > 0.05) == (*value < darkest - 0.0025))
            );
        });
    }

    #[test]
    fn strokes_have_the_specified_area_and_absorbance() {
        for (to, half_width) in [([30.2, 17.7], 2.3), ([3.1, 4.2], 5.0), ([14.0, 4.2], 1.4)] {
            let from = [3.1, 4.2];
            let mut canvas = ObjectCanvas::around(&[from, to], half_width + 2.0);
            canvas.stroke(&Stroke::even(from, to, half_width), 0.25);
            let (dx, dy): (f64, f64) = (to[0] - from[0], to[1] - from[1]);
            let length = (dx * dx + dy * dy).sqrt();
            let area = 2.0 * half_width * length + core::f64::consts::PI * half_width * half_width;
            let covered: f64 = canvas.coverage.values.iter().map(|v| f64::from(*v)).sum();
            let absorbed: f64 = canvas.absorbance.values.iter().map(|v| f64::from(*v)).sum();
            assert!((covered / area - 1.0).abs() < 0.03, "{covered} {area}");
            assert!((absorbed / covered - 0.25).abs() < 1e-6);
        }
    }

    #[test]
    fn a_stroke_outside_the_tile_is_clipped() {
        let mut canvas = ObjectCanvas::around(&[[0.0, 0.0]], 3.0);
        canvas.stroke(&Stroke::even([-40.0, 0.0], [40.0, 0.0], 1.0), 1.0);
        canvas.stroke(&Stroke::even([90.0, 90.0], [90.0, 90.0], 2.0), 1.0);
        let covered: f64 = canvas.coverage.values.iter().map(|v| f64::from(*v)).sum();
        assert!((covered - 14.0).abs() < 1e-6, "{covered}");
    }
}
