//! Ridge regression whose error on rows it has not seen is known exactly.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Penalties that are tried, each a part of the rows' mean square.
const PENALTIES: [f64; 11] = [1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0];

/// Rows are left out by as many folds, every tenth row together.
pub(crate) const FOLDS: usize = 10;

/// Directions in which rows differ by less than this part of the most are none.
const LEAST: f64 = 1e-12;

/// Rows of features, taken apart once for all that is regressed on them: X = U S Vᵀ.
pub(crate) struct Features {
    /// U, a row a row.
    turned: DMatrix<f64>,
    /// S².
    squares: DVector<f64>,
    /// V S⁻¹, a row a feature.
    back: DMatrix<f64>,
    scale: f64,
}

/// Factors of features, and what each row would have been told by those of other folds.
#[derive(Debug, Clone)]
pub(crate) struct Ridge {
    pub(crate) mean: f64,
    pub(crate) factors: Vec<f64>,
    pub(crate) unseen: Vec<f64>,
    /// Mean square by which unseen rows were missed.
    pub(crate) error: f64,
}

impl Features {
    /// Of rows of the same length.
    pub(crate) fn new(rows: &[Vec<f64>]) -> Self {
        let (n, p) = (rows.len(), rows.first().map_or(0, Vec::len));
        let x = DMatrix::from_fn(n, p, |i, j| rows[i][j]);
        let scale = x.norm_squared() / n.max(1) as f64;
        // Of the smaller product of X with itself: the other one has the same S.
        let few = p <= n;
        let eigen = SymmetricEigen::new(if few { x.tr_mul(&x) } else { &x * x.transpose() });
        let most = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
        let kept: Vec<usize> = (0..eigen.eigenvalues.len()).filter(|i| eigen.eigenvalues[*i] > LEAST * most).collect();
        let squares = DVector::from_iterator(kept.len(), kept.iter().map(|i| eigen.eigenvalues[*i]));
        let own = eigen.eigenvectors.select_columns(&kept);
        let over = |mut m: DMatrix<f64>, power: i32| {
            for (mut column, square) in m.column_iter_mut().zip(squares.iter()) {
                column.scale_mut(if power == 1 { 1.0 / square.sqrt() } else { 1.0 / square });
            }
            m
        };
        let (turned, back) =
            if few { (over(&x * &own, 1), over(own, 1)) } else { (own.clone(), over(x.tr_mul(&own), 2)) };
        Self { turned, squares, back, scale }
    }

    /// The ridge through values whose error on unseen rows is least.
    pub(crate) fn best(&self, y: &[f64]) -> Ridge {
        let mean = portable_numerics::statistics::mean(y);
        let centred = DVector::from_iterator(y.len(), y.iter().map(|v| v - mean));
        let turned = self.turned.tr_mul(&centred);
        let mut best = Ridge { mean, factors: vec![0.0; self.back.nrows()], unseen: Vec::new(), error: f64::MAX };
        for penalty in PENALTIES {
            let kept = self.squares.map(|s| s / (s + penalty * self.scale));
            let unseen = self.unseen(y, &centred, &turned, &kept);
            let error = unseen.iter().zip(y).map(|(u, v)| (u - v) * (u - v)).sum::<f64>() / y.len() as f64;
            if error < best.error {
                let factors = (&self.back * turned.component_mul(&kept)).iter().copied().collect();
                best = Ridge { mean, factors, unseen, error };
            }
        }
        best
    }

    /// What the rows of each fold would have been told by all others. Single rows would not do: the mean of the others is low where
    /// a row is high, which the next regression would learn from.
    fn unseen(&self, y: &[f64], centred: &DVector<f64>, turned: &DVector<f64>, kept: &DVector<f64>) -> Vec<f64> {
        let mut unseen = y.to_vec();
        let rest = centred - &self.turned * turned.component_mul(kept);
        for fold in 0..FOLDS.min(y.len()) {
            let rows: Vec<usize> = (fold..y.len()).step_by(FOLDS).collect();
            let own = self.turned.select_rows(&rows);
            let scaled = DMatrix::from_fn(rows.len(), kept.len(), |i, j| own[(i, j)] * kept[j]);
            let of_fold = DVector::from_iterator(rows.len(), rows.iter().map(|i| rest[*i]));
            // The fold's own part in its predictions is taken out: exact for a given mean.
            let others = DMatrix::identity(rows.len(), rows.len()) - scaled * own.transpose();
            if let Some(rest) = others.cholesky().map(|c| c.solve(&of_fold)) {
                for (i, r) in rows.iter().zip(rest.iter()) {
                    unseen[*i] = y[*i] - r;
                }
            }
        }
        unseen
    }
}

impl Ridge {
    /// For a row of features.
    pub(crate) fn predict(&self, row: &[f64]) -> f64 {
        self.mean + self.factors.iter().zip(row).map(|(f, x)| f * x).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With few rows and with more features than rows.
    #[test]
    fn the_error_on_unseen_rows_is_that_of_leaving_them_out() {
        for (n, p) in [(25, 4), (25, 40)] {
            let at = |i: usize, j: usize| ((i * i + 3 * j) % 7) as f64 + libm::sin((i * (j + 1)) as f64);
            let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..p).map(|j| at(i, j)).collect()).collect();
            let y: Vec<f64> = rows.iter().enumerate().map(|(i, r)| r[0] + f64::from(u8::from(i % 3 == 0))).collect();
            let found = Features::new(&rows).best(&y);
            let mean = portable_numerics::statistics::mean(&y);
            let scale = rows.iter().flatten().map(|v| v * v).sum::<f64>() / n as f64;
            // The slow way, with each penalty, a fold left out and the mean kept.
            let factors = |penalty: f64, kept: &dyn Fn(usize) -> bool| {
                let kept: Vec<usize> = (0..n).filter(|i| kept(*i)).collect();
                let x = DMatrix::from_fn(kept.len(), p, |i, j| rows[kept[i]][j]);
                let t = DVector::from_iterator(kept.len(), kept.iter().map(|i| y[*i] - mean));
                let g = x.tr_mul(&x) + DMatrix::identity(p, p) * (penalty * scale);
                g.lu().solve(&x.tr_mul(&t)).unwrap()
            };
            let tell = |f: &DVector<f64>, row: usize| mean + rows[row].iter().zip(f).map(|(a, b)| a * b).sum::<f64>();
            let right = |penalty: &f64| {
                let all = factors(*penalty, &|_| true);
                (0..n).all(|i| {
                    let others = factors(*penalty, &|j| j % FOLDS != i % FOLDS);
                    (tell(&others, i) - found.unseen[i]).abs() < 1e-6
                        && (tell(&all, i) - found.predict(&rows[i])).abs() < 1e-6
                })
            };
            assert!(PENALTIES.iter().any(right), "{n} rows of {p}");
        }
    }
}
