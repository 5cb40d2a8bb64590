//! Straight lines through points (x, y).

/// The slope of the line through the origin with the least sum of squares.
pub(super) fn through_origin(points: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    let [xy, xx] = points.into_iter().fold([0.0; 2], |[xy, xx], (x, y)| [xy + x * y, xx + x * x]);
    xy / xx
}

/// The largest deviation, as a share of the line's value, from the line with the least sum of squares of such
/// deviations, of three points or more.
pub(super) fn largest_deviation(points: &[(f64, f64)]) -> Option<f64> {
    if points.len() < 3 {
        return None;
    }
    // Weights 1/y², by which the sums of squares are of shares.
    let [mut w, mut wx, mut wy, mut wxx, mut wxy] = [0.0; 5];
    for &(x, y) in points {
        let weight = 1.0 / (y * y);
        w += weight;
        wx += weight * x;
        wy += weight * y;
        wxx += weight * x * x;
        wxy += weight * x * y;
    }
    let slope = (w * wxy - wx * wy) / (w * wxx - wx * wx);
    let start = (wy - slope * wx) / w;
    let deviation = |&(x, y): &(f64, f64)| (y / (start + slope * x) - 1.0).abs();
    let largest = points.iter().map(deviation).fold(0.0, f64::max);
    slope.is_finite().then_some(largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_found() {
        assert_eq!(through_origin([(1.0, 2.0), (2.0, 4.0)]), 2.0);
        let line = [(1.0, 3.0), (2.0, 5.0), (4.0, 9.0)];
        assert!(largest_deviation(&line).unwrap() < 1e-12);
        let bent = [(1.0, 3.0), (2.0, 5.0), (4.0, 9.9), (5.0, 11.0)];
        let deviation = largest_deviation(&bent).unwrap();
        assert!((0.04..0.1).contains(&deviation), "{deviation}");
        assert_eq!(largest_deviation(&line[..2]), None);
        assert_eq!(largest_deviation(&[(1.0, 3.0), (1.0, 5.0), (1.0, 9.0)]), None);
    }
}
