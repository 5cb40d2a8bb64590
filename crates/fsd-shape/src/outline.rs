//! Closed polygons: perimeter, area, circularity, and resampling at equal distances.

/// A point or complex number: x right, y down, in pixels, pixel centres at integers.
pub type Point = [f64; 2];

/// Maximum number of corrections of the spacing in [`resample`]. Each pass reduces the variation of the chords several
/// times, except at spikes narrower than the spacing.
const SPACING_PASSES: usize = 40;

/// Coefficient of variation of the chord lengths at which [`resample`] stops.
const SPACING_SPREAD: f64 = 1e-4;

/// Returns the enclosed area, in px², positive if the outline runs clockwise on the screen (x right, y down), like the
/// outlines of [`crate::trace`].
///
/// ```
/// assert_eq!(fsd_shape::signed_area(&[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]), 12.0);
/// ```
pub fn signed_area(outline: &[Point]) -> f64 {
    let Some(&origin) = outline.first() else {
        return 0.0;
    };
    let twice: f64 = edges(outline).map(|(p, q)| cross(sub(p, origin), sub(q, origin))).sum();
    twice / 2.0
}

/// Returns the centroid of the enclosed area; of an outline without area, the mean of its points; of an empty one, the
/// origin.
pub fn centroid(outline: &[Point]) -> Point {
    let Some(&origin) = outline.first() else {
        return [0.0, 0.0];
    };
    let mut twice_area = 0.0;
    let mut moment = [0.0, 0.0];
    let mut sum = [0.0, 0.0];
    for (p, q) in edges(outline) {
        let (p, q) = (sub(p, origin), sub(q, origin));
        let c = cross(p, q);
        twice_area += c;
        moment = [moment[0] + (p[0] + q[0]) * c, moment[1] + (p[1] + q[1]) * c];
        sum = [sum[0] + p[0], sum[1] + p[1]];
    }
    // Six times the area: the centroid of the triangle (0, p, q) is (p + q) / 3.
    let (sum, divisor) = if twice_area == 0.0 { (sum, outline.len() as f64) } else { (moment, 3.0 * twice_area) };
    [origin[0] + sum[0] / divisor, origin[1] + sum[1] / divisor]
}

/// Returns the length of the closed outline, in px.
pub fn perimeter(outline: &[Point]) -> f64 {
    edges(outline).map(|(p, q)| distance(p, q)).sum()
}

/// Returns the isoperimetric quotient 4πA / P²: 1 for a circle, π/4 for a square, 0 for an outline without area or
/// length.
///
/// It decreases with the detail of an outline, so compare only outlines with the same number of harmonics.
pub fn circularity(outline: &[Point]) -> f64 {
    let length = perimeter(outline);
    if length == 0.0 {
        return 0.0;
    }
    4.0 * core::f64::consts::PI * signed_area(outline).abs() / (length * length)
}

/// Returns `count` points on the outline at equal distances from each other, starting at its first point.
///
/// The points are on the given polygon. They start at equal arc lengths and move along it until the chords between
/// neighbours are equal (coefficient of variation below 0.1 %), which differs at corners. If the polygon has spikes
/// narrower than the spacing, the best approximation is returned. An outline of a single point is repeated.
///
/// ```
/// let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
/// assert_eq!(fsd_shape::resample(&square, 8)[3], [2.0, 1.0]);
/// ```
pub fn resample(outline: &[Point], count: usize) -> Vec<Point> {
    let Some((arc, mut positions)) = equidistant_positions(outline, count) else {
        return outline.first().map_or(Vec::new(), |&first| vec![first; count]);
    };
    let length = positions[count];
    let mut points = points_at(outline, &arc, &positions[..count]);
    let mut best = points.clone();
    let mut best_spread = f64::INFINITY;
    let mut chords = vec![0.0; count + 1];
    for _ in 0..SPACING_PASSES {
        let mut total = 0.0;
        let mut squares = 0.0;
        for (k, (p, q)) in edges(&points).enumerate() {
            let chord = distance(p, q);
            total += chord;
            squares += chord * chord;
            chords[k + 1] = total;
        }
        let mean = total / count as f64;
        let spread = (squares / count as f64 / (mean * mean) - 1.0).max(0.0).sqrt();
        if spread < best_spread {
            best_spread = spread;
            best.clone_from(&points);
        }
        if spread <= SPACING_SPREAD {
            break;
        }
        // Interpolates arc length as a function of chord length at equal chords.
        let mut moved = Vec::with_capacity(count + 1);
        let mut k = 0;
        for target in (0..count).map(|k| k as f64 * mean) {
            while k + 1 < count && chords[k + 1] <= target {
                k += 1;
            }
            let t = ratio(target - chords[k], chords[k + 1] - chords[k]);
            moved.push(positions[k] + t * (positions[k + 1] - positions[k]));
        }
        moved.push(length);
        positions = moved;
        points = points_at(outline, &arc, &positions[..count]);
    }
    best
}

/// Returns `count` points at equal arc lengths, starting at the first point of the outline. Many times as fast as
/// [`resample`], which also equalises the chords; chords are shorter across corners.
///
/// ```
/// let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
/// assert_eq!(fsd_shape::resample_along(&square, 16)[3], [1.5, 0.0]);
/// ```
pub fn resample_along(outline: &[Point], count: usize) -> Vec<Point> {
    let Some((arc, positions)) = equidistant_positions(outline, count) else {
        return outline.first().map_or(Vec::new(), |&first| vec![first; count]);
    };
    points_at(outline, &arc, &positions[..count])
}

/// Returns the arc length at each vertex and at the end, and `count` equidistant arc lengths and the total; none if the
/// outline has no length.
fn equidistant_positions(outline: &[Point], count: usize) -> Option<(Vec<f64>, Vec<f64>)> {
    let mut arc = Vec::with_capacity(outline.len() + 1);
    arc.push(0.0);
    let mut length = 0.0;
    for (p, q) in edges(outline) {
        length += distance(p, q);
        arc.push(length);
    }
    let step = length / count as f64;
    let mut positions: Vec<f64> = (0..count).map(|k| k as f64 * step).collect();
    positions.push(length);
    (length > 0.0 && length.is_finite()).then_some((arc, positions))
}

/// Returns the points of the polygon at ascending arc lengths `positions`; `arc` holds the arc length at each vertex
/// and at the end.
fn points_at(outline: &[Point], arc: &[f64], positions: &[f64]) -> Vec<Point> {
    let mut edge = 0;
    let at = |&s: &f64| {
        while edge + 1 < outline.len() && arc[edge + 1] <= s {
            edge += 1;
        }
        let (p, q) = (outline[edge], outline[(edge + 1) % outline.len()]);
        let t = ratio(s - arc[edge], arc[edge + 1] - arc[edge]);
        [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]
    };
    positions.iter().map(at).collect()
}

/// Returns part / whole, clamped to 0..=1; 0 if `whole` is 0.
fn ratio(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { 0.0 }
}

/// Returns the edges of the closed outline, including the one from the last to the first point.
pub(crate) fn edges(outline: &[Point]) -> impl Iterator<Item = (Point, Point)> + '_ {
    let next = outline.iter().skip(1).chain(outline.first());
    outline.iter().copied().zip(next.copied())
}

pub(crate) fn sub(p: Point, q: Point) -> Point {
    [p[0] - q[0], p[1] - q[1]]
}

pub(crate) fn cross(p: Point, q: Point) -> f64 {
    p[0] * q[1] - p[1] * q[0]
}

pub(crate) fn distance(p: Point, q: Point) -> f64 {
    let d = sub(p, q);
    (d[0] * d[0] + d[1] * d[1]).sqrt()
}
