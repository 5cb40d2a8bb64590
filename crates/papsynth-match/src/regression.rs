//! Ridge regressions of parameters on statistics.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Scaled statistics are clipped to this number of standard deviations.
const FARTHEST: f64 = 4.0;

/// Standardises statistics. Unknown values become the mean, and values are clipped to the range of the rows.
///
/// Holds mean, standard deviation, minimum and maximum of each statistic.
#[derive(Debug, Clone)]
pub(crate) struct Scaler(Vec<[f64; 4]>);

impl Scaler {
    pub(crate) fn new(rows: &[&[f64]], weights: &[f64]) -> Self {
        let column = |c: usize| {
            let known = || rows.iter().zip(weights).map(|(r, w)| (r[c], *w)).filter(|(v, _)| v.is_finite());
            let mean = weighted_mean(known());
            let variance = weighted_mean(known().map(|(v, w)| ((v - mean) * (v - mean), w)));
            let [low, high] = min_max(known().map(|(v, _)| v));
            [mean, variance.sqrt(), low, high]
        };
        Self((0..rows.first().map_or(0, |r| r.len())).map(column).collect())
    }

    pub(crate) fn scaled(&self, row: &[f64]) -> Vec<f64> {
        let one = |(value, [mean, sd, low, high]): (&f64, &[f64; 4])| {
            if value.is_finite() && *sd > 0.0 {
                ((value.clamp(*low, *high) - mean) / sd).clamp(-FARTHEST, FARTHEST)
            } else {
                0.0
            }
        };
        row.iter().zip(&self.0).map(one).collect()
    }
}

/// Returns the mean of values with weights; 0 without values.
pub(crate) fn weighted_mean(values: impl Iterator<Item = (f64, f64)>) -> f64 {
    let [sum, all] = values.fold([0.0; 2], |[sum, all], (v, w)| [sum + v * w, all + w]);
    if all > 0.0 { sum / all } else { 0.0 }
}

/// Candidate penalties, relative to the mean square of the rows.
const PENALTIES: [f64; 11] = [1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0];

/// Number of cross-validation folds; a fold holds every tenth row.
const FOLDS: usize = 10;

/// Minimum eigenvalue, relative to the largest one.
const LEAST: f64 = 1e-12;

/// Singular value decomposition of rows of features, X = U S Vᵀ, for several regressions.
pub(crate) struct Features {
    /// U: one row per row.
    turned: DMatrix<f64>,
    /// S².
    squares: DVector<f64>,
    /// V S⁻¹: one row per feature.
    back: DMatrix<f64>,
    scale: f64,
    weights: Vec<f64>,
}

/// Coefficients of features, and the prediction of each row from the other folds.
#[derive(Debug, Clone)]
pub(crate) struct Ridge {
    pub(crate) mean: f64,
    pub(crate) factors: Vec<f64>,
    pub(crate) unseen: Vec<f64>,
}

impl Features {
    /// Decomposes centred rows of the same length.
    pub(crate) fn new(rows: &[Vec<f64>], weights: &[f64]) -> Self {
        let (n, p) = (rows.len(), rows.first().map_or(0, Vec::len));
        let x = DMatrix::from_fn(n, p, |i, j| weights[i].sqrt() * rows[i][j]);
        let scale = x.norm_squared() / n.max(1) as f64;
        // Uses the smaller one of XᵀX and XXᵀ: both have the eigenvalues S².
        let few = p <= n;
        let eigen = SymmetricEigen::new(if few { x.tr_mul(&x) } else { &x * x.transpose() });
        let most = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
        let kept: Vec<usize> = (0..eigen.eigenvalues.len()).filter(|i| eigen.eigenvalues[*i] > LEAST * most).collect();
        let squares = DVector::from_iterator(kept.len(), kept.iter().map(|i| eigen.eigenvalues[*i]));
        let own = eigen.eigenvectors.select_columns(&kept);
        let over = |mut m: DMatrix<f64>, divisors: &DVector<f64>| {
            m.column_iter_mut().zip(divisors.iter()).for_each(|(mut column, by)| column.scale_mut(1.0 / by));
            m
        };
        let roots = squares.map(f64::sqrt);
        let (turned, back) = if few {
            (over(&x * &own, &roots), over(own, &roots))
        } else {
            (own.clone(), over(x.tr_mul(&own), &squares))
        };
        Self { turned, squares, back, scale, weights: weights.to_vec() }
    }

    /// Fits a ridge regression with the penalty of the smallest error on held-out rows.
    pub(crate) fn best(&self, y: &[f64]) -> Ridge {
        let weights = || self.weights.iter().copied();
        let mean = weighted_mean(y.iter().copied().zip(weights()));
        let centred = DVector::from_iterator(y.len(), y.iter().zip(weights()).map(|(v, w)| (v - mean) * w.sqrt()));
        let turned = self.turned.tr_mul(&centred);
        let mut best = Ridge { mean, factors: vec![0.0; self.back.nrows()], unseen: Vec::new() };
        let mut least = f64::MAX;
        for penalty in PENALTIES {
            let kept = self.squares.map(|s| s / (s + penalty * self.scale));
            let unseen = self.unseen(y, &centred, &turned, &kept);
            let error = weighted_mean(unseen.iter().zip(y).map(|(u, v)| (u - v) * (u - v)).zip(weights()));
            if error < least {
                least = error;
                let factors = (&self.back * turned.component_mul(&kept)).iter().copied().collect();
                best = Ridge { mean, factors, unseen };
            }
        }
        best
    }

    /// Returns the prediction of the rows of each fold from the other folds. Leave-one-out would bias the next
    /// regression: the mean of the other rows is low if a row is high.
    fn unseen(&self, y: &[f64], centred: &DVector<f64>, turned: &DVector<f64>, kept: &DVector<f64>) -> Vec<f64> {
        let mut unseen = y.to_vec();
        let rest = centred - &self.turned * turned.component_mul(kept);
        for fold in 0..FOLDS.min(y.len()) {
            let rows: Vec<usize> = (fold..y.len()).step_by(FOLDS).collect();
            let own = self.turned.select_rows(&rows);
            let scaled = DMatrix::from_fn(rows.len(), kept.len(), |i, j| own[(i, j)] * kept[j]);
            let of_fold = DVector::from_iterator(rows.len(), rows.iter().map(|i| rest[*i]));
            // Removes the influence of the fold on its predictions: exact for a given mean.
            let others = DMatrix::identity(rows.len(), rows.len()) - scaled * own.transpose();
            if let Some(rest) = others.cholesky().map(|c| c.solve(&of_fold)) {
                for (i, r) in rows.iter().zip(rest.iter()) {
                    unseen[*i] = y[*i] - r / self.weights[*i].sqrt();
                }
            }
        }
        unseen
    }
}

/// Returns minimum and maximum.
pub(crate) fn min_max(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use portable_numerics::statistics::mean;

    /// With fewer and with more features than rows.
    #[test]
    fn the_error_on_unseen_rows_is_that_of_leaving_them_out() {
        for (n, p) in [(25, 4), (25, 40)] {
            let at = |i: usize, j: usize| ((i * i + 3 * j) % 7) as f64 + libm::sin((i * (j + 1)) as f64);
            let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..p).map(|j| at(i, j)).collect()).collect();
            let y: Vec<f64> = rows.iter().enumerate().map(|(i, r)| r[0] + f64::from(u8::from(i % 3 == 0))).collect();
            let found = Features::new(&rows, &vec![1.0; n]).best(&y);
            let mean = mean(&y);
            let scale = rows.iter().flatten().map(|v| v * v).sum::<f64>() / n as f64;
            // Direct computation for each penalty, without the fold and with the mean of all rows.
            let factors = |penalty: f64, kept: &dyn Fn(usize) -> bool| {
                let kept: Vec<usize> = (0..n).filter(|i| kept(*i)).collect();
                let x = DMatrix::from_fn(kept.len(), p, |i, j| rows[kept[i]][j]);
                let t = DVector::from_iterator(kept.len(), kept.iter().map(|i| y[*i] - mean));
                let g = x.tr_mul(&x) + DMatrix::identity(p, p) * (penalty * scale);
                g.lu().solve(&x.tr_mul(&t)).unwrap()
            };
            let tell = |f: &DVector<f64>, row: usize| mean + rows[row].iter().zip(f).map(|(a, b)| a * b).sum::<f64>();
            let predicted =
                |row: usize| found.mean + found.factors.iter().zip(&rows[row]).map(|(f, x)| f * x).sum::<f64>();
            let right = |penalty: &f64| {
                let all = factors(*penalty, &|_| true);
                (0..n).all(|i| {
                    let others = factors(*penalty, &|j| j % FOLDS != i % FOLDS);
                    (tell(&others, i) - found.unseen[i]).abs() < 1e-6 && (tell(&all, i) - predicted(i)).abs() < 1e-6
                })
            };
            assert!(PENALTIES.iter().any(right), "{n} rows of {p}");
        }
    }
}
