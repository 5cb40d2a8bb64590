//! Transforms descriptors to the directions and lengths of steps along the outline, and back.
//!
//! The derivative of a normalised curve is i2π e^{i2πt} (1 + Σ dₘ e^{i2πmt}) with dₘ = (1 + m) u₁₊ₘ. Along an outline
//! of equal steps, the phase of the bracket varies, but its modulus hardly. So of the two harmonics
//!
//! ```text
//! dₘ = step + i · direction,   d₋ₘ = conj(step) + i · conj(direction)
//! ```
//!
//! the step is small (a fifth of the direction in outlines of cells), which couples u₁₊ₘ and u₁₋ₘ. Independent
//! descriptors lose this coupling: the points of a draw are unevenly spaced, and its perimeter is too short.

/// The first m that is transformed: pairs of smaller m contain u₀, u₁ or u₋₁, which the pose determines.
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

/// Replaces mean squares of independent directions and steps by those of the coordinates.
pub(crate) fn squares_from_steps(squares: &mut [f64]) {
    change_pairs(squares, |direction, step, up, down| {
        let sums = [step[0] + direction[1], step[1] + direction[0]];
        [sums.map(|v| v / (up * up)), sums.map(|v| v / (down * down))]
    });
}

/// Replaces each pair u₁₊ₘ, u₁₋ₘ by the result of `change`, which also takes 1 + m and 1 − m.
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
    fn the_transform_is_invertible() {
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
    fn a_direction_rotates_steps_and_a_step_changes_their_length() {
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
