//! Linear changes of several images that impose their covariances with each other and with given images.

use crate::matrix::Matrix;
use crate::sums::{add_scaled, products, single};

/// Directions with less than this fraction of the largest variance count as constant.
const FLOOR: f64 = 1e-6;

/// The largest fraction of the variance that the given images may explain.
const EXPLAINED: f64 = 0.98;

/// Changes `images` linearly so that their covariance matrix is `own`, and their covariance matrix with `parents` is
/// `cross`, with one row for each image: the paper's "adjustment of the correlations". All images have mean 0.
///
/// Let X be the images and Z the parents, one in each row, C the matrix `own` and D the matrix `cross`. B is the
/// covariance matrix of Z, and A Z the regression of X on Z: A is the covariance matrix of X with Z, times B⁻¹.
///
/// The result is D B⁻¹ Z + M (X − A Z). The first term has the covariances D with the parents. The second one is a
/// linear map M of the residuals X − A Z, which are uncorrelated with the parents, and has the rest of the covariance
/// of the result, T = C − D B⁻¹ Dᵀ. Of all maps that give T, M is the one that changes the residuals least:
/// M = E^(−1/2) (E^(1/2) T E^(1/2))^(1/2) E^(−1/2), where E is the covariance matrix of the residuals.
///
/// If the parents would explain more than 98 % of the variance of a combination of images, its correlations are
/// reduced.
pub(crate) fn impose(images: &mut [Vec<f32>], parents: &[Vec<f32>], own: &[f64], cross: &[f64]) {
    let (n, p) = (images.len(), parents.len());
    let Some(len) = images.first().map(Vec::len) else { return };
    let scale = 1.0 / len as f64;
    let covariance = |values: Vec<f64>, rows, columns| {
        Matrix::new(rows, columns, values.into_iter().map(|value| value * scale).collect())
    };
    let target = Matrix::new(n, n, own.to_vec());
    let present = covariance(products(images, images), n, n);
    let (kept, added) = if p == 0 {
        (cheapest_map(&present, &target), Matrix::new(n, 0, Vec::new()))
    } else {
        let with_parents = covariance(products(images, parents), n, p);
        let of_parents = covariance(products(parents, parents), p, p);
        let whitening = of_parents.inverse_root(FLOOR);
        // Regressions on uncorrelated parents of variance 1.
        let wanted = within_bounds(&Matrix::new(n, p, cross.to_vec()).times(&whitening), &target);
        let found = with_parents.times(&whitening);
        let residual = present.minus(&found.times(&found.transposed()));
        let map = cheapest_map(&residual, &target.minus(&wanted.times(&wanted.transposed())));
        let added = wanted.minus(&map.times(&found)).times(&whitening);
        (map, added)
    };
    if !kept.values.iter().chain(&added.values).all(|v| v.is_finite()) {
        return;
    }
    apply(images, parents, &kept, &added);
}

/// Reduces regressions that explain too much of the covariance `target`.
fn within_bounds(regression: &Matrix, target: &Matrix) -> Matrix {
    let whitened = target.inverse_root(FLOOR).times(regression);
    let explained = whitened.times(&whitened.transposed());
    let reduced = explained.function(|value, _| if value > EXPLAINED { (EXPLAINED / value).sqrt() } else { 1.0 });
    target.root().times(&reduced.times(&whitened))
}

/// Returns the symmetric map of images with the covariance `from` to images with the covariance `to`.
fn cheapest_map(from: &Matrix, to: &Matrix) -> Matrix {
    let (root, inverse) = (from.root(), from.inverse_root(FLOOR));
    inverse.times(&root.times(to).times(&root).root()).times(&inverse)
}

/// Replaces the images X by `map` X + `added` Z, where Z are the parents.
fn apply(images: &mut [Vec<f32>], parents: &[Vec<f32>], map: &Matrix, added: &Matrix) {
    /// Pixels computed together, so that they stay in the cache.
    const TILE: usize = 4096;
    let len = images[0].len();
    let mut results = vec![0.0; images.len() * TILE];
    for from in (0..len).step_by(TILE) {
        let to = (from + TILE).min(len);
        results.fill(0.0);
        for (i, result) in results.chunks_exact_mut(TILE).enumerate() {
            for (j, image) in images.iter().enumerate() {
                add_scaled(&mut result[..to - from], &image[from..to], single(map.at(i, j)));
            }
            for (j, parent) in parents.iter().enumerate() {
                add_scaled(&mut result[..to - from], &parent[from..to], single(added.at(i, j)));
            }
        }
        for (image, result) in images.iter_mut().zip(results.chunks_exact(TILE)) {
            image[from..to].copy_from_slice(&result[..to - from]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use portable_numerics::random::Ziggurat;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    /// Returns images of white noise without correlation to each other.
    fn noise(count: usize, seed: u64) -> Vec<Vec<f32>> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let ziggurat = Ziggurat::new();
        (0..count).map(|_| (0..5000).flat_map(|_| ziggurat.pair(&mut rng)).collect()).collect()
    }

    fn covariance(a: &[Vec<f32>], b: &[Vec<f32>]) -> Vec<f64> {
        products(a, b).iter().map(|v| v / a[0].len() as f64).collect()
    }

    #[test]
    fn covariances_are_imposed() {
        let parents = noise(3, 1);
        let mut images = noise(2, 2);
        let (own, cross) = ([2.0, 0.5, 0.5, 1.0], [0.3, 0.0, -0.6, 0.1, 0.2, 0.0]);
        impose(&mut images, &parents, &own, &cross);
        let close = |found: Vec<f64>, expected: &[f64]| found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(close(covariance(&images, &images), &own));
        assert!(close(covariance(&images, &parents), &cross));
        // What already agrees does not change.
        let before = images.clone();
        impose(&mut images, &parents, &own, &cross);
        assert!(before.iter().flatten().zip(images.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-4));
        impose(&mut images, &[], &[1.0, 0.0, 0.0, 3.0], &[]);
        assert!(close(covariance(&images, &images), &[1.0, 0.0, 0.0, 3.0]));
    }

    #[test]
    fn impossible_covariances_keep_the_variance() {
        let parents = noise(2, 3);
        let mut images = noise(2, 4);
        impose(&mut images, &parents, &[1.0, 0.0, 0.0, 1.0], &[5.0, 0.0, 0.0, 0.1]);
        let found = covariance(&images, &images);
        assert!((found[0] - 1.0).abs() < 1e-4 && (found[3] - 1.0).abs() < 1e-4, "{found:?}");
    }

    #[test]
    fn images_without_variance_stay_finite() {
        for (images, parents) in [
            (vec![vec![0.0; 100]; 2], vec![vec![0.0; 100]; 3]),
            (vec![vec![0.0; 10_000]; 2], noise(3, 5)),
            (noise(2, 6), vec![vec![0.0; 10_000]; 3]),
        ] {
            for own in [[0.0; 4], [1.0, 1.0, 1.0, 1.0], [1.0, 2.0, 2.0, 1.0]] {
                let mut images = images.clone();
                impose(&mut images, &parents, &own, &[0.7; 6]);
                assert!(images.iter().flatten().all(|v| v.is_finite()));
            }
        }
    }
}
