//! Closed polygons: length, area, roundness, and points at equal distances.

/// A point or complex number: x right, y down, in pixels, pixel centres at integers.
pub type Point = [f64; 2];

/// How often [`resample`] corrects its spacing at most. Each pass shrinks the spread of the chords several times over;
/// only needles narrower than one spacing are left after this many.
const SPACING_PASSES: usize = 40;

/// Spread of the chord lengths (standard deviation over mean) at which [`resample`] is content.
const SPACING_SPREAD: f64 = 1e-4;

/// Area enclosed, in px², positive if the outline runs clockwise on the screen (x right, y down), as [`crate::trace`] makes it.
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

/// Centre of gravity of the enclosed area; of an outline without area, the mean of its points; of none, the origin.
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
    // Three times twice the area: the centroid of the triangle (0, p, q) is a third of p + q.
    let (sum, divisor) = if twice_area == 0.0 { (sum, outline.len() as f64) } else { (moment, 3.0 * twice_area) };
    [origin[0] + sum[0] / divisor, origin[1] + sum[1] / divisor]
}

/// Length of the closed outline, in px.
pub fn perimeter(outline: &[Point]) -> f64 {
    edges(outline).map(|(p, q)| distance(p, q)).sum()
}

/// Isoperimetric quotient 4πA / P²: 1 for a circle, π/4 for a square, 0 for an outline without area or length.
///
/// It falls with every wiggle of the perimeter, so compare outlines of equal harmonics only.
pub fn circularity(outline: &[Point]) -> f64 {
    let length = perimeter(outline);
    if length == 0.0 {
        return 0.0;
    }
    4.0 * core::f64::consts::PI * signed_area(outline).abs() / (length * length)
}

/// `count` points on the outline at equal distances from each other, starting at its first point.
///
/// The points lie on the given polygon. First they are set at equal arc length, then moved along it until the chords between
/// neighbours are equal too (spread below 0.1 %), which differs at corners. Where the polygon has needles
/// narrower than the spacing this cannot be had, and the best found is returned. Fewer than two points are repeated.
///
/// ```
/// let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
/// assert_eq!(fsd_shape::resample(&square, 8)[3], [2.0, 1.0]);
/// ```
pub fn resample(outline: &[Point], count: usize) -> Vec<Point> {
    let Some((arc, mut places)) = even_places(outline, count) else {
        return outline.first().map_or(Vec::new(), |&first| vec![first; count]);
    };
    let length = places[count];
    let mut points = place(outline, &arc, &places[..count]);
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
        // Arc length as a function of chord length, read at equal chords.
        let mut moved = Vec::with_capacity(count + 1);
        let mut k = 0;
        for target in (0..count).map(|k| k as f64 * mean) {
            while k + 1 < count && chords[k + 1] <= target {
                k += 1;
            }
            let t = ratio(target - chords[k], chords[k + 1] - chords[k]);
            moved.push(places[k] + t * (places[k + 1] - places[k]));
        }
        moved.push(length);
        places = moved;
        points = place(outline, &arc, &places[..count]);
    }
    best
}

/// `count` points on the outline at equal distances along it, starting at its first point: [`resample`] without its correction of
/// chords, many times as fast. Chords are shorter across corners.
///
/// ```
/// let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
/// assert_eq!(fsd_shape::resample_along(&square, 16)[3], [1.5, 0.0]);
/// ```
pub fn resample_along(outline: &[Point], count: usize) -> Vec<Point> {
    let Some((arc, places)) = even_places(outline, count) else {
        return outline.first().map_or(Vec::new(), |&first| vec![first; count]);
    };
    place(outline, &arc, &places[..count])
}

/// The arc length at each vertex and at the end, and `count` even arc lengths and the whole; nothing if the outline has no length.
fn even_places(outline: &[Point], count: usize) -> Option<(Vec<f64>, Vec<f64>)> {
    let mut arc = Vec::with_capacity(outline.len() + 1);
    arc.push(0.0);
    let mut length = 0.0;
    for (p, q) in edges(outline) {
        length += distance(p, q);
        arc.push(length);
    }
    let step = length / count as f64;
    let mut places: Vec<f64> = (0..count).map(|k| k as f64 * step).collect();
    places.push(length);
    (length > 0.0 && length.is_finite()).then_some((arc, places))
}

/// Points of the polygon at ascending arc lengths `places`; `arc` holds the arc length at each vertex and at the end.
fn place(outline: &[Point], arc: &[f64], places: &[f64]) -> Vec<Point> {
    let mut edge = 0;
    let at = |&s: &f64| {
        while edge + 1 < outline.len() && arc[edge + 1] <= s {
            edge += 1;
        }
        let (p, q) = (outline[edge], outline[(edge + 1) % outline.len()]);
        let t = ratio(s - arc[edge], arc[edge + 1] - arc[edge]);
        [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]
    };
    places.iter().map(at).collect()
}

/// Place of a part within a whole, 0..=1; 0 in a whole of no length.
fn ratio(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { 0.0 }
}

/// The edges of the closed outline, the last one back to the start.
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
