//! Points, vectors and polygons.

/// A point [x, y], x right and y down, in pixels or any other unit.
pub type Point = [f64; 2];

#[inline]
pub(crate) fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

#[inline]
pub(crate) fn along(origin: Point, direction: Point, t: f64) -> Point {
    [origin[0] + direction[0] * t, origin[1] + direction[1] * t]
}

#[inline]
pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[inline]
pub(crate) fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(crate) fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// Returns the lowest and the highest coordinates.
pub(crate) fn bounds(points: &[Point]) -> [Point; 2] {
    [(f64::min as fn(f64, f64) -> f64, f64::INFINITY), (f64::max, f64::NEG_INFINITY)].map(|(of, from)| {
        points.iter().fold([from; 2], |bound, point| [of(bound[0], point[0]), of(bound[1], point[1])])
    })
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "rounding is the purpose")]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}

/// Moments of a polygon about a point.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Moments {
    /// Signed area, positive if the corners are oriented from x towards y.
    pub(crate) area: f64,
    /// Integrals of x and of y.
    pub(crate) first: Point,
    /// Integral of x² + y².
    pub(crate) second: f64,
}

impl Moments {
    /// Computes exact moments, from the triangles between `about` and each side.
    pub(crate) fn of(corners: impl DoubleEndedIterator<Item = Point> + Clone, about: Point) -> Self {
        let mut moments = Self::default();
        let mut a = sub(corners.clone().next_back().unwrap_or(about), about);
        for corner in corners {
            let b = sub(corner, about);
            let double_area = cross(a, b);
            moments.area += double_area / 2.0;
            for axis in 0..2 {
                moments.first[axis] += double_area * (a[axis] + b[axis]) / 6.0;
            }
            moments.second += double_area * (dot(a, a) + dot(a, b) + dot(b, b)) / 12.0;
            a = b;
        }
        moments
    }
}
