//! Folds a sheet or a polygon along a line.

use crate::outline::{moments, sides};
use crate::params::range;
use crate::refine::index;
use crate::sheet::OUTSIDE;
use crate::{Error, Point, Sheet};
use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::Range;
use std::sync::Arc;

/// Strips of half a turn of the tube; its silhouette is then exact to 1 % of its radius.
const STRIPS: u32 = 12;
/// Distance from a line, as a fraction of the radius, within which a vertex counts as on it; avoids sliver triangles.
const ON_LINE: f64 = 1e-6;
const MOST_TURNS: u32 = 100;
/// Largest number of parts of a side that follows a curved line.
const MOST_PARTS: f64 = 1000.0;

/// A fold along a line, a parabola or a wavy line. The part of the sheet beyond it is bent up around a tube on it.
///
/// A straight fold does not stretch the sheet. A curved one is a straight one of a sheared sheet: it preserves areas,
/// and stretches by about the slope of the line relative to its direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crease {
    /// Origin of the line: the vertex of its parabola.
    pub point: Point,
    /// Direction of the line, as an angle from +x towards +y. The side in the direction (−sin, cos) is beyond the
    /// line.
    pub direction_rad: f64,
    /// Curvature of the parabola at its vertex, in 1 over the unit of the sheet: 0 is a straight line, a positive one
    /// bends towards the side beyond.
    pub curvature: f64,
    /// Waves of the line, added to the parabola.
    pub waves: [Wave; 2],
    /// Radius of the tube in the unit of the sheet, above 0.
    pub radius: f64,
    /// Flap or roll.
    pub kind: FoldKind,
}

/// A wave of the line of a [`Crease`]: a·sin(kt + φ) at the distance t from its point along its direction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wave {
    /// Amplitude a in the unit of the sheet.
    pub amplitude: f64,
    /// Wave number k: 2π over the wavelength, in radians per unit of the sheet.
    pub wave_number: f64,
    /// Phase φ, radians.
    pub phase_rad: f64,
}

/// The kind of fold of a [`Crease`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FoldKind {
    /// Half a turn around the tube; the remainder is mirrored and lies flat on top.
    Flap,
    /// Several turns around the tube and another half turn; the remainder lies flat on top.
    Roll {
        /// Number of full turns, 1 to 100.
        turns: u32,
    },
}

impl Crease {
    /// Returns a crease along a straight line. The parameters are those of the fields.
    #[must_use]
    pub fn straight(point: Point, direction_rad: f64, radius: f64, kind: FoldKind) -> Self {
        Self { point, direction_rad, curvature: 0.0, waves: Default::default(), radius, kind }
    }

    fn check(&self) -> Result<(), Error> {
        let finite = (-f64::MAX, f64::MAX);
        range("point[0]", self.point[0], finite, "finite")?;
        range("point[1]", self.point[1], finite, "finite")?;
        range("direction_rad", self.direction_rad, finite, "finite")?;
        range("curvature", self.curvature, finite, "finite")?;
        for wave in &self.waves {
            range("waves.amplitude", wave.amplitude, finite, "finite")?;
            range("waves.wave_number", wave.wave_number, finite, "finite")?;
            range("waves.phase_rad", wave.phase_rad, finite, "finite")?;
        }
        range("radius", self.radius, (f64::MIN_POSITIVE, f64::MAX), "above 0 and finite")?;
        match self.kind {
            FoldKind::Flap => Ok(()),
            FoldKind::Roll { turns } => range("turns", f64::from(turns), (1.0, f64::from(MOST_TURNS)), "1 to 100"),
        }
    }

    /// Returns how far a point lies beyond the line in the unit of the sheet; negative before the line. Distances from
    /// a curved line are measured perpendicular to `direction_rad`.
    #[must_use]
    pub fn distance_beyond(&self, point: Point) -> f64 {
        self.sheared(point)[1]
    }

    /// Returns the direction beyond the line.
    fn normal(&self) -> Point {
        [-libm::sin(self.direction_rad), libm::cos(self.direction_rad)]
    }

    /// Returns the position of the line at `t` along its direction, f(t) = κt²/2 + Σ a·sin(kt + φ).
    fn line_at(&self, t: f64) -> f64 {
        let wave = |wave: &Wave| wave.amplitude * libm::sin(wave.wave_number * t + wave.phase_rad);
        0.5 * self.curvature * t * t + self.waves.iter().filter(|wave| wave.amplitude != 0.0).map(wave).sum::<f64>()
    }

    /// Returns an upper bound of the curvature of the line.
    fn most_curved(&self) -> f64 {
        let wave = |wave: &Wave| (wave.amplitude * wave.wave_number * wave.wave_number).abs();
        self.curvature.abs() + self.waves.iter().map(wave).sum::<f64>()
    }

    /// Returns the coordinates of a point along and beyond the line: s = n − f(t).
    fn sheared(&self, [x, y]: Point) -> Point {
        let (normal, [x, y]) = (self.normal(), [x - self.point[0], y - self.point[1]]);
        let t = x * normal[1] - y * normal[0];
        [t, x * normal[0] + y * normal[1] - self.line_at(t)]
    }

    /// Returns the point with these coordinates along and beyond the line.
    fn point_at(&self, [t, s]: Point) -> Point {
        let (normal, n) = (self.normal(), s + self.line_at(t));
        [self.point[0] + t * normal[1] + n * normal[0], self.point[1] - t * normal[0] + n * normal[1]]
    }

    fn half_turns(&self) -> u32 {
        match self.kind {
            FoldKind::Flap => 1,
            FoldKind::Roll { turns } => 2 * turns + 1,
        }
    }

    /// Returns the new distance beyond the line and the height of a point at the distance `s` beyond the line.
    fn bent(&self, s: f64) -> [f64; 2] {
        let r = self.radius;
        let end = PI * r * f64::from(self.half_turns());
        if s <= 0.0 {
            [s, 0.0]
        } else if s < end {
            // x = r sin(s/r), z = r (1 − cos(s/r))
            [r * libm::sin(s / r), r * (1.0 - libm::cos(s / r))]
        } else {
            [end - s, 2.0 * r]
        }
    }

    /// Returns the distances of the borders of the strips, up to `end`.
    fn strips(&self, end: f64) -> impl Iterator<Item = f64> {
        let width = PI * self.radius / f64::from(STRIPS);
        (0..=STRIPS * self.half_turns()).map(move |k| f64::from(k) * width).take_while(move |&s| s < end)
    }
}

impl Sheet {
    /// Folds the crumpled sheet. Heights add to those of the tube, triangles on the tube are divided; the flat sheet
    /// and its volume do not change.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if a field of the crease is out of range.
    pub fn fold(&mut self, crease: &Crease) -> Result<(), Error> {
        crease.check()?;
        let normal = crease.normal();
        let mut far: Vec<f64> = self.vertices.iter().map(|v| crease.sheared([v[0], v[1]])[1]).collect();
        let end = far.iter().fold(0.0_f64, |m, &s| m.max(s));
        if end == 0.0 {
            return Ok(());
        }
        self.cut(&mut far, &crease.strips(end).collect::<Vec<_>>(), ON_LINE * crease.radius);
        for (v, &s) in self.vertices.iter_mut().zip(&far) {
            if s > 0.0 {
                let [x, z] = crease.bent(s);
                *v = [v[0] + (x - s) * normal[0], v[1] + (x - s) * normal[1], v[2] + z];
            }
        }
        self.update_edges();
        Ok(())
    }

    /// Divides all triangles along the lines where `far` equals one of `lines`, which are in ascending order.
    fn cut(&mut self, far: &mut Vec<f64>, lines: &[f64], tolerance: f64) {
        // For each triangle the new vertices on the side opposite each corner, in ascending order of `far`.
        const NONE: Range<u32> = 0..0;
        let mut made = vec![[NONE; 3]; self.triangles.len()];
        let Some((&first_line, &last_line)) = lines.first().zip(lines.last()) else { return };
        let radius = Arc::make_mut(&mut self.radius);
        for edge in self.edges.iter() {
            let [i, j] = edge.ends.map(|v| v as usize);
            let [i, j] = if far[i] < far[j] { [i, j] } else { [j, i] };
            if far[j] <= first_line || far[i] >= last_line {
                continue;
            }
            let crossed = lines.partition_point(|line| line - far[i] <= tolerance)
                ..lines.partition_point(|line| far[j] - line > tolerance);
            if crossed.is_empty() {
                continue;
            }
            let first = index(far.len());
            for &line in &lines[crossed] {
                let part = (line - far[i]) / (far[j] - far[i]);
                let mix = |p: f64, q: f64| p + part * (q - p);
                let (p, q) = (self.vertices[i], self.vertices[j]);
                self.vertices.push([mix(p[0], q[0]), mix(p[1], q[1]), mix(p[2], q[2])]);
                let (p, q) = (self.rest[i], self.rest[j]);
                self.rest.push([mix(p[0], q[0]), mix(p[1], q[1])]);
                radius.push(mix(radius[i], radius[j]));
                far.push(line);
            }
            for &t in edge.sides.iter().filter(|&&t| t != OUTSIDE) {
                let opposite = self.triangles[t as usize].iter().position(|v| !edge.ends.contains(v));
                made[t as usize][opposite.unwrap_or(0)] = first..index(far.len());
            }
        }
        let triangles = Arc::make_mut(&mut self.triangles);
        let [mut long, mut short] = [Vec::new(), Vec::new()];
        for (t, made) in made.iter().enumerate().filter(|(_, made)| made.iter().any(|side| !side.is_empty())) {
            let corners = triangles[t];
            let mut order = [0, 1, 2];
            order.sort_by(|&i, &j| far[corners[i] as usize].total_cmp(&far[corners[j] as usize]));
            let [low, middle, high] = order;
            // The vertices of the longest side, and those of the two others.
            long.clear();
            long.extend([corners[low]].into_iter().chain(made[middle].clone()).chain([corners[high]]));
            short.clear();
            short.extend([corners[low]].into_iter().chain(made[high].clone()).chain([corners[middle]]));
            short.extend(made[low].clone().chain([corners[high]]));
            let cyclic = (low + 1) % 3 == middle;
            let mut free = Some(t);
            for [a, b, c] in between(&long, &short, far) {
                let triangle = if cyclic { [a, b, c] } else { [b, a, c] };
                match free.take() {
                    Some(t) => triangles[t] = triangle,
                    None => triangles.push(triangle),
                }
            }
        }
    }
}

/// Returns the triangles between two chains with the same ends, whose vertices are in ascending order of `far`: each
/// has a corner on the first chain, one on the second, and then the next vertex of either. No triangle crosses a line
/// of constant `far` on which both chains have a vertex.
fn between<'a>(first: &'a [u32], second: &'a [u32], far: &'a [f64]) -> impl Iterator<Item = [u32; 3]> {
    let (mut i, mut j) = (0, 0);
    let step = move || {
        let (a, b) = (first[i], second[j]);
        let next = match (first.get(i + 1), second.get(j + 1)) {
            (Some(&p), Some(&q)) if far[q as usize] < far[p as usize] => (q, false),
            (Some(&p), _) => (p, true),
            (None, Some(&q)) => (q, false),
            (None, None) => return None,
        };
        if next.1 {
            i += 1;
        } else {
            j += 1;
        }
        Some([a, b, next.0])
    };
    // At the common ends, corners coincide.
    std::iter::from_fn(step).filter(|[a, b, c]| a != b && b != c && c != a)
}

/// Returns the silhouette of a folded polygon: the part before the line, then the mirrored flap (for a roll, each half
/// turn), each as one or more simple polygons with positive area. Pieces overlap; the silhouette is their union. To
/// fold again, fold each piece.
///
/// # Errors
///
/// As [`Sheet::fold`], and if the outline is invalid.
pub fn crease_outline(outline: &[Point], crease: &Crease) -> Result<Vec<Vec<Point>>, Error> {
    crease.check()?;
    crate::outline::Outline::new(outline)?;
    // Sides longer than this differ from the line by more than a hundredth of the radius.
    let longest = (0.08 * crease.radius / crease.most_curved()).sqrt();
    let polygon: Vec<Point> = finely(outline, longest).into_iter().map(|p| crease.sheared(p)).collect();
    let end = polygon.iter().fold(0.0_f64, |m, p| m.max(p[1]));
    let lines: Vec<f64> = crease.strips(end).collect();
    let mut pieces = Vec::new();
    let mut left = vec![polygon];
    // The direction of the sheet reverses at angles of π/2, 3π/2, … around the tube.
    for half in 0..=crease.half_turns() {
        let turn =
            if half < crease.half_turns() { crease.radius * (FRAC_PI_2 + PI * f64::from(half)) } else { f64::INFINITY };
        let mut later = Vec::new();
        for piece in &left {
            for part in clipped(piece, turn) {
                let bent = divided(&part, &lines).into_iter().map(|[t, s]| [t, crease.bent(s)[0]]).collect::<Vec<_>>();
                let folded: Vec<Point> = finely(&bent, longest).into_iter().map(|p| crease.point_at(p)).collect();
                let area = moments(&folded).0;
                if area > 0.0 {
                    pieces.push(folded);
                } else if area < 0.0 {
                    pieces.push(folded.into_iter().rev().collect());
                }
            }
            let mirrored: Vec<Point> = piece.iter().map(|p| [p[0], -p[1]]).collect();
            later.extend(clipped(&mirrored, -turn).iter().map(|part| part.iter().map(|p| [p[0], -p[1]]).collect()));
        }
        left = later;
    }
    Ok(pieces)
}

/// Divides sides that are longer than `longest`.
fn finely(polygon: &[Point], longest: f64) -> Vec<Point> {
    let side = |(a, b): (Point, Point)| {
        let parts = (libm::hypot(b[0] - a[0], b[1] - a[1]) / longest).ceil().clamp(1.0, MOST_PARTS);
        let steps = std::iter::successors(Some(0.0), |k| Some(k + 1.0)).take_while(move |k| *k < parts);
        steps.map(move |k| [0, 1].map(|axis| a[axis] + k / parts * (b[axis] - a[axis])))
    };
    sides(polygon).flat_map(side).collect()
}

/// Inserts a point wherever a side crosses one of the lines y = `lines`, which are in ascending order.
fn divided(polygon: &[Point], lines: &[f64]) -> Vec<Point> {
    let mut points = Vec::with_capacity(polygon.len());
    for (a, b) in sides(polygon) {
        points.push(a);
        let crossing = |line: f64| [a[0] + (b[0] - a[0]) * (line - a[1]) / (b[1] - a[1]), line];
        let (low, high) = (a[1].min(b[1]), a[1].max(b[1]));
        let between = lines.iter().copied().filter(|&line| line > low && line < high);
        if a[1] < b[1] { points.extend(between.map(crossing)) } else { points.extend(between.rev().map(crossing)) }
    }
    points
}

/// Returns the parts of a simple polygon with y ≤ `line`.
fn clipped(polygon: &[Point], line: f64) -> Vec<Vec<Point>> {
    let Some(start) = polygon.iter().position(|p| p[1] > line) else {
        return vec![polygon.to_vec()];
    };
    let mut polygon = polygon.to_vec();
    polygon.rotate_left(start);
    // Chains below the line, each from a downward to an upward crossing.
    let mut chains: Vec<Vec<Point>> = Vec::new();
    for (a, b) in sides(&polygon) {
        let crossing = || [a[0] + (b[0] - a[0]) * (line - a[1]) / (b[1] - a[1]), line];
        let (from, to) = (a[1] <= line, b[1] <= line);
        if to && !from {
            chains.push(vec![crossing()]);
        }
        if let Some(chain) = chains.last_mut().filter(|_| from || to) {
            chain.push(if to { b } else { crossing() });
        }
    }
    joined(chains)
}

/// Closes chains along the line on which they start and end: of the gaps between sorted crossings, every second is
/// inside.
fn joined(chains: Vec<Vec<Point>>) -> Vec<Vec<Point>> {
    let ends = chains.iter().enumerate().flat_map(|(k, c)| [(c[0][0], k, true), (c[c.len() - 1][0], k, false)]);
    let mut ends: Vec<(f64, usize, bool)> = ends.collect();
    ends.sort_by(|p, q| p.0.total_cmp(&q.0));
    let mut next = vec![None; chains.len()];
    for pair in ends.chunks_exact(2) {
        match (pair[0], pair[1]) {
            ((_, to, true), (_, from, false)) | ((_, from, false), (_, to, true)) => next[from] = Some(to),
            // Only for a self-intersecting polygon: return one closed curve.
            _ => return vec![chains.concat()],
        }
    }
    let mut used = vec![false; chains.len()];
    let mut loops = Vec::new();
    for first in 0..chains.len() {
        let mut curve = Vec::new();
        let mut at = Some(first);
        while let Some(k) = at.filter(|&k| !used[k]) {
            used[k] = true;
            curve.extend_from_slice(&chains[k]);
            at = next[k];
        }
        if !curve.is_empty() {
            loops.push(curve);
        }
    }
    loops
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sheet::rim;
    use crate::testing::{angular, rng, wavy};
    use crate::{Cloth, ClothParams, PixelGrid};

    const STRAIGHT: Wave = Wave { amplitude: 0.0, wave_number: 0.0, phase_rad: 0.0 };
    const WAVES: [Wave; 2] = [
        Wave { amplitude: 1.5, wave_number: 0.2, phase_rad: 0.4 },
        Wave { amplitude: -0.5, wave_number: 0.47, phase_rad: -2.0 },
    ];
    const CREASE: Crease = Crease {
        point: [40.0, -10.0],
        direction_rad: 2.0,
        curvature: 0.0,
        waves: [STRAIGHT; 2],
        radius: 3.0,
        kind: FoldKind::Flap,
    };

    fn flat() -> Sheet {
        let mut sheet = Cloth::new(&ClothParams::default()).unwrap().crumple(&wavy(2.0, 0.1), &mut rng(5)).unwrap();
        sheet.vertices = sheet.rest.iter().map(|r| [30.0 + r[0], r[1] - 20.0, 0.0]).collect();
        sheet
    }

    #[test]
    fn a_fold_preserves_lengths_and_volume() {
        for kind in [FoldKind::Flap, FoldKind::Roll { turns: 2 }] {
            let mut sheet = flat();
            let (volume, count) = (sheet.volume(|r| 2.0 - r), sheet.triangles().len());
            sheet.fold(&Crease { kind, ..CREASE }).unwrap();
            assert!((sheet.volume(|r| 2.0 - r) / volume - 1.0).abs() < 1e-9);
            assert!(sheet.triangles().len() > count + 100);
            // A chord of 1/24 turn is shorter than its arc by 3 in 1000.
            assert!(sheet.edge_strain_rms() < 3e-3, "{}", sheet.edge_strain_rms());
            let top = sheet.vertices().iter().fold(0.0_f64, |m, v| m.max(v[2]));
            assert!((top - 6.0).abs() < 1e-9, "{top}");
        }
    }

    #[test]
    fn no_triangle_crosses_a_strip() {
        let mut sheet = flat();
        let count = sheet.vertices.len();
        let normal = CREASE.normal();
        let beyond = |v: &[f64; 3]| (v[0] - 40.0) * normal[0] + (v[1] + 10.0) * normal[1];
        let mut far: Vec<f64> = sheet.vertices.iter().map(beyond).collect();
        let lines: Vec<f64> = CREASE.strips(100.0).collect();
        let area = |sheet: &Sheet, t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| sheet.rest[v as usize]);
            crate::sheet::cross(a, b, c)
        };
        let before: f64 = sheet.triangles().iter().map(|t| area(&sheet, t)).sum();
        sheet.cut(&mut far, &lines, 1e-9);
        assert!(far.len() > count + 500 && far.len() == sheet.vertices.len());
        for t in sheet.triangles() {
            let corners = t.map(|v| far[v as usize]);
            let (low, high) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
            assert!(lines.iter().all(|line| line - low < 2e-9 || high - line < 2e-9), "{corners:?}");
            assert!(area(&sheet, t) > 0.0);
        }
        let after: f64 = sheet.triangles().iter().map(|t| area(&sheet, t)).sum();
        assert!((after / before - 1.0).abs() < 1e-12);
        // Neighbours share their edges: Euler, V − E + F = 1.
        sheet.update_edges();
        assert_eq!(sheet.vertices.len() + sheet.triangles().len(), sheet.edges.len() + 1);
    }

    #[test]
    fn distances_beyond_a_curved_line_are_perpendicular_to_its_direction() {
        let curved = Crease { curvature: 0.02, waves: WAVES, ..CREASE };
        for [t, s] in [[0.0, 0.0], [3.0, -2.0], [-8.0, 5.0]] {
            assert!((curved.distance_beyond(curved.point_at([t, s])) - s).abs() < 1e-12);
        }
        let (normal, [x, y]) = (CREASE.normal(), CREASE.point);
        assert!((CREASE.distance_beyond([x + 4.0 * normal[0], y + 4.0 * normal[1]]) - 4.0).abs() < 1e-12);
    }

    #[test]
    fn a_flap_is_mirrored_on_top() {
        let mut sheet = flat();
        let before = sheet.vertices().to_vec();
        sheet.fold(&CREASE).unwrap();
        let normal = CREASE.normal();
        let beyond = |v: &[f64; 3]| (v[0] - 40.0) * normal[0] + (v[1] + 10.0) * normal[1];
        for (old, new) in before.iter().zip(sheet.vertices()) {
            let s = beyond(old);
            if s <= 0.0 {
                assert_eq!(old, new);
            } else if s > 3.0 * PI {
                assert!((beyond(new) + s - 3.0 * PI).abs() < 1e-9 && (new[2] - 6.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_curved_flap_lies_on_its_line_and_keeps_its_area() {
        for waves in [CREASE.waves, WAVES] {
            lies_on_its_line(&Crease { curvature: 0.01, waves, radius: 1e-3, ..CREASE });
        }
    }

    fn lies_on_its_line(crease: &Crease) {
        let outline: Vec<Point> = finely(&wavy(2.0, 0.1), 0.5).iter().map(|p| [30.0 + p[0], p[1] - 20.0]).collect();
        let pieces = crease_outline(&outline, crease).unwrap();
        let area: f64 = pieces.iter().map(|p| moments(p).0).sum();
        assert!((area / moments(&outline).0 - 1.0).abs() < 1e-3, "{area}");
        let points = || pieces.iter().flatten().map(|p| crease.sheared(*p));
        assert!(points().all(|[_, s]| s < 1.1e-3));
        // Both ends of the fold and its middle are on the line.
        let on_line: Vec<f64> = points().filter(|[_, s]| s.abs() < 2e-3).map(|[t, _]| t).collect();
        assert!(on_line.len() > 20 && on_line.iter().any(|t| *t < -10.0) && on_line.iter().any(|t| *t > 10.0));
        for p in [[3.0, -4.0], [55.0, 1.0]] {
            let back = crease.point_at(crease.sheared(p));
            assert!((back[0] - p[0]).abs() < 1e-12 && (back[1] - p[1]).abs() < 1e-12);
        }
    }

    #[test]
    fn a_crease_outside_the_sheet_changes_nothing() {
        let mut sheet = flat();
        let before = sheet.clone();
        sheet.fold(&Crease { point: [1e4, 0.0], direction_rad: -FRAC_PI_2, ..CREASE }).unwrap();
        assert_eq!(sheet, before);
    }

    #[test]
    fn the_silhouette_is_that_of_the_folded_sheet() {
        for (direction_rad, curvature, waves, kind) in [
            (2.0, 0.0, CREASE.waves, FoldKind::Flap),
            (0.3, 0.0, CREASE.waves, FoldKind::Roll { turns: 1 }),
            (2.0, 0.008, CREASE.waves, FoldKind::Flap),
            (0.3, -0.008, CREASE.waves, FoldKind::Roll { turns: 1 }),
            (2.0, 0.008, WAVES, FoldKind::Flap),
            (0.3, -0.008, WAVES, FoldKind::Roll { turns: 1 }),
        ] {
            let crease = Crease { direction_rad, curvature, waves, kind, ..CREASE };
            let mut sheet = flat();
            let place = |&(v, _): &(u32, u32)| [sheet.vertices[v as usize][0], sheet.vertices[v as usize][1]];
            let rim: Vec<Point> = rim(&sheet.edges).iter().map(place).collect();
            let pieces = crease_outline(&rim, &crease).unwrap();
            let areas: f64 = pieces.iter().map(|p| moments(p).0).sum();
            sheet.fold(&crease).unwrap();
            let shadow: f64 = sheet
                .triangles()
                .iter()
                .map(|t| t.map(|v| sheet.vertices()[v as usize]).map(|v| [v[0], v[1]]))
                .map(|[a, b, c]| crate::sheet::cross(a, b, c).abs() / 2.0)
                .sum();
            // Triangles of the sheet have straight sides.
            let tolerance = if crease.most_curved() == 0.0 { 1e-9 } else { 3e-3 };
            assert!((areas / shadow - 1.0).abs() < tolerance, "{areas} {shadow}");
            // Pixels have a thickness exactly where a piece covers them.
            let mut image = vec![0.0_f32; 250 * 250];
            let grid = PixelGrid { origin: [-100.0, -150.0], pixel_size: 1.0 };
            sheet.thickness_into(&mut image, 250, &grid, |_| 1.0);
            let insides: Vec<crate::outline::Inside> = pieces.iter().map(|p| crate::outline::Inside::new(p)).collect();
            let mut wrong = 0;
            for (k, &value) in image.iter().enumerate() {
                let p = [grid.origin[0] + (k % 250) as f64, grid.origin[1] + (k / 250) as f64];
                let covered = |x: f64, y: f64| insides.iter().any(|i| i.contains([p[0] + x, p[1] + y]));
                // A pixel at the silhouette may have a thickness although its centre is uncovered.
                let near = [-1.0, 0.0, 1.0].iter().any(|&x| [-1.0, 0.0, 1.0].iter().any(|&y| covered(x, y)));
                wrong += usize::from(covered(0.0, 0.0) && value == 0.0) + usize::from(!near && value > 0.0);
            }
            assert_eq!(wrong, 0);
        }
    }

    #[test]
    fn a_concave_outline_is_split_into_pieces() {
        // Both arms of a U are beyond the line.
        let u = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [6.0, 9.0], [6.0, 3.0], [3.0, 3.0], [3.0, 9.0], [0.0, 9.0]];
        let crease = Crease { point: [0.0, 5.0], direction_rad: 0.0, radius: 1e-6, ..CREASE };
        let pieces = crease_outline(&u, &crease).unwrap();
        let mut areas: Vec<f64> = pieces.iter().map(|p| moments(p).0).collect();
        areas.sort_by(f64::total_cmp);
        assert_eq!(areas.len(), 3);
        for (found, wanted) in areas.iter().zip([12.0, 12.0, 39.0]) {
            assert!((found - wanted).abs() < 1e-3, "{areas:?}");
        }
        let whole = crease_outline(&angular(), &Crease { point: [0.0, 100.0], ..crease }).unwrap();
        assert!(whole.len() == 1 && (moments(&whole[0]).0 - 54.0).abs() < 1e-9);
    }

    #[test]
    fn invalid_creases_are_rejected() {
        let mut sheet = flat();
        for crease in [
            Crease { radius: 0.0, ..CREASE },
            Crease { radius: f64::NAN, ..CREASE },
            Crease { direction_rad: f64::INFINITY, ..CREASE },
            Crease { curvature: f64::NAN, ..CREASE },
            Crease { waves: [STRAIGHT, Wave { wave_number: f64::INFINITY, ..STRAIGHT }], ..CREASE },
            Crease { point: [0.0, f64::NAN], ..CREASE },
            Crease { kind: FoldKind::Roll { turns: 0 }, ..CREASE },
        ] {
            assert!(matches!(sheet.fold(&crease), Err(Error::Parameter { .. })));
            assert!(crease_outline(&angular(), &crease).is_err());
        }
        assert!(crease_outline(&[[0.0, 0.0]], &CREASE).is_err());
    }
}
