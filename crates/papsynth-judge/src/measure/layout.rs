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

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use crate::statistics::{deviation, mean};
    use portable_numerics::random::below;

    fn random(count: usize, rng: &mut Xoshiro256PlusPlus) -> Vec<[f64; 2]> {
        (0..count).map(|_| [below(128_000, rng) as f64 / 100.0, below(96_000, rng) as f64 / 100.0]).collect()
    }

    #[test]
    fn points_at_random_have_one_and_one() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
        let fields: Vec<Vec<[f64; 2]>> = (0..300).map(|_| random(29, &mut rng)).collect();
        let check = |values: Vec<f64>, what: &str| {
            let error = deviation(&values) / (values.len() as f64).sqrt();
            assert!((mean(&values) - 1.0).abs() < 3.5 * error + 0.005, "{what}: {} ± {error}", mean(&values));
        };
        check(fields.iter().map(|p| clark_evans(p, 1280.0, 960.0)).collect(), "Clark-Evans");
        for radius in [50.0, 100.0, 200.0, 300.0] {
            check(fields.iter().map(|p| ripley(p, 1280.0, 960.0, radius)).collect(), "K");
        }
    }

    #[test]
    fn lattices_are_regular_and_pairs_are_clustered() {
        let lattice: Vec<[f64; 2]> =
            (0..48).map(|i| [80.0 + 160.0 * f64::from(i % 8), 80.0 + 160.0 * f64::from(i / 8)]).collect();
        assert!(clark_evans(&lattice, 1280.0, 960.0) > 1.8);
        assert_eq!(ripley(&lattice, 1280.0, 960.0, 100.0), 0.0);
        let pairs: Vec<[f64; 2]> = lattice.iter().flat_map(|p| [*p, [p[0] + 5.0, p[1]]]).collect();
        assert!(clark_evans(&pairs, 1280.0, 960.0) < 0.1);
        assert!(ripley(&pairs, 1280.0, 960.0, 20.0) > 5.0);
        assert!(clark_evans(&lattice[..4], 1280.0, 960.0).is_nan() && ripley(&[], 1.0, 1.0, 1.0).is_nan());
    }
}
