//! How nuclei lie among each other.

use std::f64::consts::PI;

use crate::region::distance;

/// Fewer nuclei have no layout.
const LEAST: usize = 5;

/// Mean distance to the nearest neighbour over that of as many points thrown at random, by Clark and Evans
/// (doi:10.2307/1931034), with Donnelly's correction for the border: below 1 clustered, above it regular. NaN of fewer than five points.
#[must_use]
pub fn clark_evans(points: &[[f64; 2]], width: f64, height: f64) -> f64 {
    if points.len() < LEAST {
        return f64::NAN;
    }
    let n = points.len() as f64;
    let nearest = |i: usize| {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, p)| distance(points[i], *p)).fold(f64::INFINITY, f64::min)
    };
    let observed = (0..points.len()).map(nearest).sum::<f64>() / n;
    let (area, border) = (width * height, 2.0 * (width + height));
    observed / (0.5 * (area / n).sqrt() + (0.0514 + 0.041 / n.sqrt()) * border / n)
}

/// Ripley's K over that of points thrown at random, πr², with the translation correction for the border: above 1 clustered. NaN of
/// fewer than five points.
#[must_use]
pub fn ripley(points: &[[f64; 2]], width: f64, height: f64, radius: f64) -> f64 {
    if points.len() < LEAST {
        return f64::NAN;
    }
    let area = width * height;
    let mut sum = 0.0;
    for (i, a) in points.iter().enumerate() {
        for b in &points[i + 1..] {
            if distance(*a, *b) <= radius {
                // A pair so far apart is seen only where it fits into the field.
                let fits = (width - (a[0] - b[0]).abs()).max(1.0) * (height - (a[1] - b[1]).abs()).max(1.0);
                sum += 2.0 * area / fits;
            }
        }
    }
    let n = points.len() as f64;
    area / (n * (n - 1.0)) * sum / (PI * radius * radius)
}
