//! Kernel ridge regression whose error on rows it has not seen is known exactly.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Penalties that are tried, each a part of the kernel's mean diagonal.
const PENALTIES: [f64; 9] = [1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0];

/// Rows are left out by as many folds, every tenth row together.
const FOLDS: usize = 10;

/// A symmetric kernel, taken apart once for all that is regressed on it.
pub(crate) struct Kernel {
    vectors: DMatrix<f64>,
    values: DVector<f64>,
    scale: f64,
}

/// Weights of rows, and what each row would have been told by those of other folds.
#[derive(Debug, Clone)]
pub(crate) struct Ridge {
    pub(crate) weights: DVector<f64>,
    pub(crate) mean: f64,
    pub(crate) unseen: Vec<f64>,
    pub(crate) error: f64,
}

impl Kernel {
    pub(crate) fn new(kernel: DMatrix<f64>) -> Self {
        let scale = kernel.trace() / kernel.nrows().max(1) as f64;
        let eigen = SymmetricEigen::new(kernel);
        Self { vectors: eigen.eigenvectors, values: eigen.eigenvalues, scale }
    }

    /// The ridge through values whose error on unseen rows is least.
    pub(crate) fn best(&self, y: &[f64]) -> Ridge {
        let mean = crate::number::mean(y);
        let centred = DVector::from_iterator(y.len(), y.iter().map(|v| v - mean));
        let turned = self.vectors.tr_mul(&centred);
        let tried = PENALTIES.map(|penalty| {
            let inverse = self.values.map(|v| 1.0 / (v.max(0.0) + penalty * self.scale));
            let weights = &self.vectors * turned.component_mul(&inverse);
            let unseen = self.unseen(y, &weights, &inverse);
            let error = unseen.iter().zip(y).map(|(u, v)| (u - v) * (u - v)).sum::<f64>() / y.len() as f64;
            Ridge { weights, mean, unseen, error }
        });
        let mut best = 0;
        for (i, ridge) in tried.iter().enumerate() {
            if ridge.error < tried[best].error {
                best = i;
            }
        }
        tried.into_iter().nth(best).unwrap_or_else(|| Ridge {
            weights: DVector::zeros(y.len()),
            mean,
            unseen: y.to_vec(),
            error: f64::MAX,
        })
    }
}

impl Kernel {
    /// What the rows of each fold would have been told by all others. Single rows would not do: the mean of the others is low where
    /// a row is high, which the next regression would learn from.
    fn unseen(&self, y: &[f64], weights: &DVector<f64>, inverse: &DVector<f64>) -> Vec<f64> {
        let mut unseen = y.to_vec();
        for fold in 0..FOLDS.min(y.len()) {
            let rows: Vec<usize> = (fold..y.len()).step_by(FOLDS).collect();
            let own = DMatrix::from_fn(rows.len(), self.values.len(), |i, j| self.vectors[(rows[i], j)]);
            let scaled = DMatrix::from_fn(rows.len(), self.values.len(), |i, j| own[(i, j)] * inverse[j]);
            let of_fold = DVector::from_iterator(rows.len(), rows.iter().map(|i| weights[*i]));
            // The fold's own part in its predictions is taken out: exact for a given mean.
            if let Some(rest) = (scaled * own.transpose()).cholesky().map(|c| c.solve(&of_fold)) {
                for (i, r) in rows.iter().zip(rest.iter()) {
                    unseen[*i] = y[*i] - r;
                }
            }
        }
        unseen
    }
}

impl Ridge {
    /// For a row with these values of the kernel to all rows.
    pub(crate) fn predict(&self, kernel: &DVector<f64>) -> f64 {
        self.mean + self.weights.dot(kernel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_on_unseen_rows_is_that_of_leaving_them_out() {
        let n: usize = 25;
        let x: Vec<f64> = (0..n).map(|i| (i * i % 7) as f64).collect();
        let y: Vec<f64> = x.iter().enumerate().map(|(i, v)| 2.0 * v + f64::from(u8::from(i % 3 == 0))).collect();
        let kernel = |a: f64, b: f64| a * b + libm::exp(-(a - b) * (a - b));
        let all = DMatrix::from_fn(n, n, |i, j| kernel(x[i], x[j]) + if i == j { 1e-9 } else { 0.0 });
        let scale = all.trace() / n as f64;
        let found = Kernel::new(all).best(&y);
        let mean = crate::number::mean(&y);
        // The slow way, with each penalty, a fold left out and the mean kept.
        let slow = |penalty: f64, out: usize| {
            let rows: Vec<usize> = (0..n).filter(|i| i % FOLDS != out % FOLDS).collect();
            let own = |i: usize, j: usize| kernel(x[i], x[j]) + if i == j { 1e-9 + penalty * scale } else { 0.0 };
            let g = DMatrix::from_fn(rows.len(), rows.len(), |i, j| own(rows[i], rows[j]));
            let t = DVector::from_iterator(rows.len(), rows.iter().map(|i| y[*i] - mean));
            let w = g.lu().solve(&t).unwrap();
            mean + rows.iter().zip(w.iter()).map(|(i, w)| w * kernel(x[*i], x[out])).sum::<f64>()
        };
        let right = |penalty: &f64| (0..n).all(|i| (slow(*penalty, i) - found.unseen[i]).abs() < 1e-6);
        assert!(PENALTIES.iter().any(right));
    }
}
