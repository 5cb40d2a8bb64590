//! Principal components of a small set of vectors, by Jacobi's rotations: nothing but + − × ÷ and √, so the same
//! bits on every machine, which matrix libraries that pick their kernels by processor do not promise.

use crate::outline::count_as_f64;

/// Sweeps of Jacobi's method at most. It converges quadratically: 6 to 9 are usual up to a few hundred rows.
const SWEEPS: usize = 30;

/// A direction of unit length and the variance along it.
pub(crate) struct Axis {
    pub(crate) variance: f64,
    pub(crate) direction: Vec<f64>,
}

/// Axes of the sample covariance of `deviations` (rows whose mean is 0), by falling variance; those without variance are left out.
/// The largest entry of a direction is positive.
pub(crate) fn principal_axes(deviations: &[Vec<f64>]) -> Vec<Axis> {
    let count = deviations.len();
    let dims = deviations.first().map_or(0, Vec::len);
    let freedom = count_as_f64(count) - 1.0;
    // The smaller of YᵀY and YYᵀ: both have the eigenvalues of the covariance, and an eigenvector v of YYᵀ gives Yᵀv.
    let by_rows = count < dims;
    let size = count.min(dims);
    let column = |k: usize| deviations.iter().map(move |row| row[k]);
    let product = |i: usize, j: usize| -> f64 {
        if by_rows { dot(&deviations[i], &deviations[j]) } else { column(i).zip(column(j)).map(|(a, b)| a * b).sum() }
    };
    let mut matrix: Vec<Vec<f64>> = (0..size).map(|i| (0..size).map(|j| product(i, j)).collect()).collect();
    let (values, vectors) = eigen(&mut matrix);

    let mut axes: Vec<Axis> = values
        .iter()
        .zip(&vectors)
        .map(|(&value, vector)| {
            let mut direction = vector.clone();
            if by_rows {
                direction = vec![0.0; dims];
                for (row, &weight) in deviations.iter().zip(vector) {
                    add_scaled(&mut direction, row, weight);
                }
            }
            Axis { variance: value / freedom, direction }
        })
        .collect();
    axes.sort_by(|a, b| b.variance.total_cmp(&a.variance));
    let largest = axes.first().map_or(0.0, |axis| axis.variance);
    // What is left of a variance of 0 after rounding; the mean takes one degree of freedom, so there always is one.
    let floor = largest * f64::EPSILON * count_as_f64(size);
    axes.retain(|axis| axis.variance > floor);
    for axis in &mut axes {
        let extreme = axis.direction.iter().fold(0.0, |m: f64, &v| if v.abs() > m.abs() { v } else { m });
        let scale = extreme.signum() / dot(&axis.direction, &axis.direction).sqrt();
        axis.direction.iter_mut().for_each(|v| *v *= scale);
    }
    axes
}

/// Eigenvalues and eigenvectors of a symmetric matrix, in no order; the matrix is used up.
fn eigen(a: &mut [Vec<f64>]) -> (Vec<f64>, Vec<Vec<f64>>) {
    let n = a.len();
    let mut vectors: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| if i == j { 1.0 } else { 0.0 }).collect()).collect();
    let trace: f64 = (0..n).map(|i| a[i][i].abs()).sum();
    for _ in 0..SWEEPS {
        let mut off = 0.0;
        for (i, row) in a.iter().enumerate() {
            off += dot(&row[..i], &row[..i]);
        }
        if off.sqrt() <= f64::EPSILON * trace {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                if a[p][q] == 0.0 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let cos = 1.0 / (t * t + 1.0).sqrt();
                let sin = t * cos;
                for row in a.iter_mut() {
                    let (x, y) = (row[p], row[q]);
                    row[p] = cos * x - sin * y;
                    row[q] = sin * x + cos * y;
                }
                rotate_rows(a, p, q, cos, sin);
                rotate_rows(&mut vectors, p, q, cos, sin);
            }
        }
    }
    ((0..n).map(|i| a[i][i]).collect(), vectors)
}

fn rotate_rows(m: &mut [Vec<f64>], p: usize, q: usize, cos: f64, sin: f64) {
    let (head, tail) = m.split_at_mut(q);
    for (x, y) in head[p].iter_mut().zip(&mut tail[0]) {
        (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
    }
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// a += weight · b.
pub(crate) fn add_scaled(a: &mut [f64], b: &[f64], weight: f64) {
    for (x, y) in a.iter_mut().zip(b) {
        *x += weight * y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    fn rows(count: usize, dims: usize, seed: u64) -> Vec<Vec<f64>> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut rows: Vec<Vec<f64>> = (0..count)
            .map(|_| (0..dims).map(|k| f64::from(rng.next_u32() >> 16) / count_as_f64(k + 1)).collect())
            .collect();
        for k in 0..dims {
            let mean = rows.iter().map(|r| r[k]).sum::<f64>() / count_as_f64(count);
            rows.iter_mut().for_each(|r| r[k] -= mean);
        }
        rows
    }

    #[test]
    fn agrees_with_nalgebra_whichever_side_is_longer() {
        for (count, dims) in [(9, 30), (40, 12), (12, 12), (2, 5)] {
            let rows = rows(count, dims, 0x9CA);
            let axes = principal_axes(&rows);
            let y = nalgebra::DMatrix::from_fn(count, dims, |i, j| rows[i][j]);
            let covariance = y.transpose() * &y / (count_as_f64(count) - 1.0);
            let mut oracle: Vec<f64> = covariance.clone().symmetric_eigen().eigenvalues.iter().copied().collect();
            oracle.sort_by(|a, b| b.total_cmp(a));
            assert_eq!(axes.len(), dims.min(count - 1));
            for (axis, value) in axes.iter().zip(&oracle) {
                assert!((axis.variance - value).abs() < 1e-12 * oracle[0]);
                let v = nalgebra::DVector::from_column_slice(&axis.direction);
                assert!((&covariance * &v - &v * axis.variance).norm() < 1e-12 * oracle[0]);
                assert!((v.norm() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn equal_rows_have_no_axes() {
        assert!(principal_axes(&[vec![0.0; 4], vec![0.0; 4]]).is_empty());
    }
}
