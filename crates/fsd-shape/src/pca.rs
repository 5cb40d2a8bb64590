//! Mean, spread and principal components of a small set of vectors.

use nalgebra::DMatrix;

use crate::coordinates::add_scaled;
use crate::outline::count_as_f64;

/// A direction of unit length and the variance along it.
pub(crate) struct Axis {
    pub(crate) variance: f64,
    pub(crate) direction: Vec<f64>,
}

/// Axes of the sample covariance of `deviations` (rows whose mean is 0), by falling variance; those without variance are left out.
/// The largest entry of a direction is positive.
pub(crate) fn principal_axes(deviations: &[Vec<f64>]) -> Vec<Axis> {
    let (count, dims) = (deviations.len(), deviations.first().map_or(0, Vec::len));
    let freedom = count_as_f64(count) - 1.0;
    let rows = DMatrix::from_fn(count, dims, |i, k| deviations[i][k]);
    // The smaller of YᵀY and YYᵀ: both have the eigenvalues of the covariance, and an eigenvector v of YYᵀ gives Yᵀv.
    // `tr_mul` sums in one order on every processor; `*` does not.
    let (eigen, directions) = if count < dims {
        let columns = rows.transpose();
        let eigen = columns.tr_mul(&columns).symmetric_eigen();
        let directions = rows.tr_mul(&eigen.eigenvectors);
        (eigen.eigenvalues, directions)
    } else {
        let eigen = rows.tr_mul(&rows).symmetric_eigen();
        (eigen.eigenvalues, eigen.eigenvectors)
    };
    // What is left of a variance of 0 after rounding; the mean takes one degree of freedom, so there always is one.
    let floor = eigen.max() * f64::EPSILON * count_as_f64(count.min(dims));
    let mut axes: Vec<Axis> = eigen
        .iter()
        .zip(directions.column_iter())
        .filter(|&(&value, _)| value > floor)
        .map(|(value, direction)| {
            let scale = direction[direction.icamax()].signum() / direction.norm();
            Axis { variance: value / freedom, direction: direction.iter().map(|v| v * scale).collect() }
        })
        .collect();
    axes.sort_by(|a, b| b.variance.total_cmp(&a.variance));
    axes
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Mean of each column.
pub(crate) fn mean_of(rows: &[Vec<f64>]) -> Vec<f64> {
    let mut mean = vec![0.0; rows[0].len()];
    for row in rows {
        add_scaled(&mut mean, row, 1.0 / count_as_f64(rows.len()));
    }
    mean
}

/// Standard deviation of each column of rows with mean 0.
pub(crate) fn sd_of(deviations: &[Vec<f64>]) -> Vec<f64> {
    let freedom = count_as_f64(deviations.len()) - 1.0;
    (0..deviations[0].len())
        .map(|k| (deviations.iter().map(|row| row[k] * row[k]).sum::<f64>() / freedom).sqrt())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn axes_are_eigenvectors_of_the_covariance_whichever_side_is_longer() {
        for (count, dims) in [(9, 30), (40, 12), (12, 12), (2, 5)] {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(0x9CA);
            let mut value = |k: usize| f64::from(rng.next_u32() >> 16) / count_as_f64(k + 1);
            let mut rows: Vec<Vec<f64>> = (0..count).map(|_| (0..dims).map(&mut value).collect()).collect();
            let mean = mean_of(&rows);
            rows.iter_mut().for_each(|row| add_scaled(row, &mean, -1.0));
            let axes = principal_axes(&rows);
            assert_eq!(axes.len(), dims.min(count - 1));
            assert!(axes.is_sorted_by(|a, b| a.variance >= b.variance));
            let total: f64 = sd_of(&rows).iter().map(|sd| sd * sd).sum();
            assert!((axes.iter().map(|axis| axis.variance).sum::<f64>() / total - 1.0).abs() < 1e-12);
            for Axis { variance, direction } in &axes {
                let mut left: Vec<f64> = direction.iter().map(|v| -variance * v).collect();
                for row in &rows {
                    add_scaled(&mut left, row, dot(row, direction) / (count_as_f64(count) - 1.0));
                }
                assert!(dot(&left, &left).sqrt() < 1e-12 * total);
                assert!((dot(direction, direction) - 1.0).abs() < 1e-12);
                assert!(direction.iter().all(|v| v.abs() <= direction.iter().copied().fold(0.0, f64::max)));
            }
        }
    }

    #[test]
    fn equal_rows_have_no_axes() {
        assert!(principal_axes(&[vec![0.0; 4], vec![0.0; 4]]).is_empty());
    }
}
