//! Descriptors of an outline of equal steps, split into where the steps point and how long they are.
//!
//! The derivative of a normalised curve is i2π e^{i2πt} (1 + Σ dₘ e^{i2πmt}) with dₘ = (1 + m) u₁₊ₘ. Along a walk of equal
//! steps the bracket turns but hardly stretches. So of the two harmonics
//!
//! ```text
//! dₘ = step + i · direction,   d₋ₘ = conj(step) + i · conj(direction)
//! ```
//!
//! the step is small (a fifth of the direction in outlines of cells), which ties u₁₊ₘ to u₁₋ₘ. Independent descriptors break
//! that tie: the points of such a draw crowd here and spread there, and its perimeter comes out too short.

/// The first m whose pair is free: below it u₀, u₁, u₋₁ belong to the pose.
const FIRST: usize = 3;

/// Replaces each pair u₁₊ₘ, u₁₋ₘ of coordinates by direction and step.
#[cfg(any(test, feature = "fit"))]
pub(crate) fn to_steps(coordinates: &mut [f64]) {
    change_pairs(coordinates, |high, low, up, down| {
        let ([a, b], [c, d]) = (high.map(|v| up * v), low.map(|v| down * v));
        // direction = (dₘ − conj d₋ₘ) / 2i, step = (dₘ + conj d₋ₘ) / 2
        [[(b + d) / 2.0, (c - a) / 2.0], [(a + c) / 2.0, (b - d) / 2.0]]
    });
}

/// The inverse of [`to_steps`].
pub(crate) fn from_steps(coordinates: &mut [f64]) {
    change_pairs(coordinates, |direction, step, up, down| {
        let (high, low) =
            ([step[0] - direction[1], step[1] + direction[0]], [step[0] + direction[1], direction[0] - step[1]]);
        [high.map(|v| v / up), low.map(|v| v / down)]
    });
}

/// Mean squares of coordinates whose directions and steps are independent and have these mean squares.
pub(crate) fn squares_from_steps(squares: &mut [f64]) {
    change_pairs(squares, |direction, step, up, down| {
        let sums = [step[0] + direction[1], step[1] + direction[0]];
        [sums.map(|v| v / (up * up)), sums.map(|v| v / (down * down))]
    });
}

/// Replaces each pair u₁₊ₘ, u₁₋ₘ by what `change` makes of it and of 1 + m and 1 − m.
fn change_pairs(coordinates: &mut [f64], change: impl Fn([f64; 2], [f64; 2], f64, f64) -> [[f64; 2]; 2]) {
    // As pairs of Re u₋ₕ, Im u₋ₕ, … without u₀.
    let (terms, _) = coordinates.as_chunks_mut();
    let harmonics = terms.len() / 2;
    for m in FIRST..harmonics {
        let (high, low) = (harmonics + m, harmonics + 1 - m);
        [terms[high], terms[low]] = change(terms[high], terms[low], m as f64 + 1.0, 1.0 - m as f64);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descriptors::Descriptors;
    use crate::outline::{distance, edges};
    use crate::statistics::terms;

    #[test]
    fn there_and_back() {
        for harmonics in [1, 3, 4, 5, 12] {
            let before: Vec<f64> = (0..4 * harmonics).map(|k| libm::sin((k * k) as f64)).collect();
            let mut after = before.clone();
            to_steps(&mut after);
            assert_eq!(after == before, harmonics < 4);
            from_steps(&mut after);
            assert!(after.iter().zip(&before).all(|(a, b)| (a - b).abs() < 1e-14));
        }
    }

    #[test]
    fn a_direction_turns_the_steps_and_a_step_stretches_them() {
        let harmonics = 12;
        let spread = |place_of: fn(usize, usize) -> usize| {
            let mut coordinates = vec![0.0; 4 * harmonics];
            coordinates[place_of(harmonics, 5)] = 0.01;
            from_steps(&mut coordinates);
            coordinates[2 * harmonics] = 1.0;
            let outline = Descriptors::from_harmonics(terms(&coordinates)).unwrap().outline(2000);
            let steps: Vec<f64> = edges(&outline).map(|(p, q)| distance(p, q)).collect();
            let (low, high) = steps.iter().fold((f64::MAX, 0.0_f64), |(l, h), &s| (l.min(s), h.max(s)));
            high / low - 1.0
        };
        let direction = spread(|h, m| 2 * (h + m));
        let step = spread(|h, m| 2 * (h + 1 - m));
        assert!(direction < 3e-4, "{direction}");
        assert!(step > 0.03, "{step}");
    }
}
