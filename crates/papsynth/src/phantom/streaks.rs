//! The direction of the streaks of cells.

use super::tile::Point;
use crate::key::Key;
use crate::random;

/// Twice the direction of streaks is the argument of a complex random field with a Gaussian correlation, of this
/// standard deviation, µm.
///
/// In normal fields of Cervix93, the directions of windows are correlated within cells and between cells. The mean of
/// cos 2Δ of two windows decreases to 0.8 at 30 µm, 0.55 at 65 µm, 0.35 at 95 µm and 0.15 at 140 µm, relative to
/// neighbouring windows.
const DIRECTION_UM: f64 = 75.0;

/// Number of plane waves of that field.
const WAVES: usize = 16;

/// Returns the direction across the streaks of cells at a place of an image or plot, radians.
///
/// It changes slowly over the slide, so that neighbouring cells have streaks of about the same direction.
pub(super) fn direction_across(place_um: Point, key: Key) -> f64 {
    let mut rng = key.stream("field", 0, "texture.direction");
    let mut sum = [0.0; 2];
    for _ in 0..WAVES {
        let mut phase = random::direction(&mut rng);
        for at in place_um {
            phase += random::normal(&mut rng) * at / DIRECTION_UM;
        }
        sum[0] += libm::cos(phase);
        sum[1] += libm::sin(phase);
    }
    0.5 * libm::atan2(sum[1], sum[0])
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use super::*;

    #[test]
    fn directions_are_correlated_as_arguments_of_a_gaussian_field() {
        const FIELDS: u64 = 4000;
        // Mean of exp(iΔ) for arguments of two complex normal deviates of correlation r: πr/4 times the hypergeometric
        // function of ½, ½, 2 and r².
        let wanted = |r: f64| {
            let sum = (0..200)
                .rev()
                .map(f64::from)
                .fold(1.0, |sum, n: f64| 1.0 + (n + 0.5) * (n + 0.5) / ((n + 2.0) * (n + 1.0)) * r * r * sum);
            0.25 * PI * r * sum
        };
        for distance in [0.1, 0.5, 1.0, 1.5, 4.0] {
            let mean = |turn: f64| {
                let of_field = |index| {
                    let key = Key { seed: 6, index };
                    let [a, b] = [0.0, distance * DIRECTION_UM].map(|x| direction_across([120.0 + x, 40.0], key));
                    libm::cos(2.0 * (b - turn * a))
                };
                (0..FIELDS).map(of_field).sum::<f64>() / FIELDS as f64
            };
            let wanted = wanted(libm::exp(-0.5 * distance * distance));
            assert!((mean(1.0) - wanted).abs() < 0.04, "{distance}: {} {wanted}", mean(1.0));
            // No direction is preferred.
            assert!(mean(0.0).abs() < 0.04, "{distance}: {}", mean(0.0));
        }
    }
}
