//! A shape as a row of *coordinates*: Re u₋ₕ, Im u₋ₕ, …, Re uₕ, Im uₕ without u₀.

use crate::outline::Point;

/// |l| of coordinate k.
pub(crate) fn order(k: usize, harmonics: usize) -> usize {
    let place = k / 2;
    if place < harmonics { harmonics - place } else { place + 1 - harmonics }
}

/// Descriptors of coordinates, u₀ = 0.
pub(crate) fn terms(coordinates: &[f64]) -> Vec<Point> {
    let mut terms: Vec<Point> = coordinates.chunks_exact(2).map(|c| [c[0], c[1]]).collect();
    terms.insert(terms.len() / 2, [0.0, 0.0]);
    terms
}

/// Highest |l| that counts as form, not as detail: a fifth of the harmonics. Of 40 that is 8, up to where the components explain
/// outlines of cells; beyond, the residual does.
pub(crate) fn finest_coarse(harmonics: usize) -> usize {
    (harmonics / 5).max(1)
}

/// a += weight · b.
pub(crate) fn add_scaled(a: &mut [f64], b: &[f64], weight: f64) {
    for (x, y) in a.iter_mut().zip(b) {
        *x += weight * y;
    }
}
