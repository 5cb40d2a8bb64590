//! Points as complex numbers.

use crate::outline::Point;

/// The product of two numbers.
pub(crate) fn multiply(a: Point, b: Point) -> Point {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// e^{iφ}.
pub(crate) fn unit(phi: f64) -> Point {
    let (sin, cos) = libm::sincos(phi);
    [cos, sin]
}
