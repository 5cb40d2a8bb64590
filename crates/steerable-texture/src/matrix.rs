//! Small dense matrices in double precision, row-major.

/// A matrix.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Matrix {
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) values: Vec<f64>,
}

impl Matrix {
    pub(crate) fn new(rows: usize, columns: usize, values: Vec<f64>) -> Self {
        debug_assert_eq!(values.len(), rows * columns);
        Self { rows, columns, values }
    }

    pub(crate) fn at(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }

    pub(crate) fn transposed(&self) -> Self {
        let values = (0..self.columns).flat_map(|j| (0..self.rows).map(move |i| self.at(i, j))).collect();
        Self::new(self.columns, self.rows, values)
    }

    pub(crate) fn times(&self, other: &Self) -> Self {
        let mut values = vec![0.0; self.rows * other.columns];
        for (row, to) in self.values.chunks_exact(self.columns).zip(values.chunks_exact_mut(other.columns)) {
            for (&factor, from) in row.iter().zip(other.values.chunks_exact(other.columns)) {
                to.iter_mut().zip(from).for_each(|(to, from)| *to += factor * from);
            }
        }
        Self::new(self.rows, other.columns, values)
    }

    pub(crate) fn minus(&self, other: &Self) -> Self {
        let values = self.values.iter().zip(&other.values).map(|(a, b)| a - b).collect();
        Self::new(self.rows, self.columns, values)
    }

    /// Returns U f(Λ) Uᵀ of a symmetric matrix U Λ Uᵀ. `f` gets an eigenvalue and the largest of them, at least 0.
    pub(crate) fn function(&self, f: impl Fn(f64, f64) -> f64) -> Self {
        let n = self.rows;
        let (values, vectors) = self.eigen();
        let largest = values.iter().copied().fold(0.0, f64::max);
        let mut result = vec![0.0; n * n];
        for (value, vector) in values.iter().zip(vectors.values.chunks_exact(n)) {
            let factor = f(*value, largest);
            for i in 0..n {
                for j in 0..n {
                    result[i * n + j] += factor * vector[i] * vector[j];
                }
            }
        }
        Self::new(n, n, result)
    }

    /// Returns the square root; negative eigenvalues count as 0.
    pub(crate) fn root(&self) -> Self {
        self.function(|value, _| value.max(0.0).sqrt())
    }

    /// Returns the inverse of the square root. Directions with less than `floor` of the largest eigenvalue give 0.
    pub(crate) fn inverse_root(&self, floor: f64) -> Self {
        self.function(|value, largest| if value > floor * largest { 1.0 / value.sqrt() } else { 0.0 })
    }

    /// Returns the eigenvalues of a symmetric matrix, and the eigenvectors as rows, by Jacobi's rotations.
    fn eigen(&self) -> (Vec<f64>, Self) {
        /// Far more than needed: convergence is quadratic.
        const SWEEPS: usize = 30;
        let n = self.rows;
        let mut a: Vec<f64> = (0..n * n).map(|i| 0.5 * (self.values[i] + self.at(i % n, i / n))).collect();
        let mut vectors: Vec<f64> = (0..n * n).map(|i| if i / n == i % n { 1.0 } else { 0.0 }).collect();
        let total: f64 = a.iter().map(|v| v * v).sum();
        for _ in 0..SWEEPS {
            let off: f64 =
                (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i * n + j] * a[i * n + j]).sum();
            if off <= 1e-30 * total {
                break;
            }
            for p in 0..n {
                for q in p + 1..n {
                    let apq = a[p * n + q];
                    if apq == 0.0 {
                        continue;
                    }
                    let theta = (a[q * n + q] - a[p * n + p]) / (2.0 * apq);
                    // The smaller root of t² + 2 θ t − 1, the tangent of the rotation.
                    let t = 1.0_f64.copysign(theta) / (theta.abs() + (theta * theta + 1.0).sqrt());
                    let cos = 1.0 / (t * t + 1.0).sqrt();
                    let sin = t * cos;
                    for i in 0..n {
                        let (x, y) = (a[i * n + p], a[i * n + q]);
                        (a[i * n + p], a[i * n + q]) = (cos * x - sin * y, sin * x + cos * y);
                    }
                    for i in 0..n {
                        let (x, y) = (a[p * n + i], a[q * n + i]);
                        (a[p * n + i], a[q * n + i]) = (cos * x - sin * y, sin * x + cos * y);
                        let (x, y) = (vectors[p * n + i], vectors[q * n + i]);
                        (vectors[p * n + i], vectors[q * n + i]) = (cos * x - sin * y, sin * x + cos * y);
                    }
                }
            }
        }
        ((0..n).map(|i| a[i * n + i]).collect(), Self::new(n, n, vectors))
    }

    /// Solves A x = b for a positive definite matrix by Cholesky's method. Returns `None` if it is not.
    pub(crate) fn solve(mut self, mut b: Vec<f64>) -> Option<Vec<f64>> {
        let n = self.rows;
        let a = &mut self.values;
        for j in 0..n {
            let pivot = a[j * n + j] - (0..j).map(|k| a[j * n + k] * a[j * n + k]).sum::<f64>();
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            let root = pivot.sqrt();
            a[j * n + j] = root;
            for i in j + 1..n {
                let sum: f64 = (0..j).map(|k| a[i * n + k] * a[j * n + k]).sum();
                a[i * n + j] = (a[i * n + j] - sum) / root;
            }
        }
        for i in 0..n {
            let sum: f64 = (0..i).map(|k| a[i * n + k] * b[k]).sum();
            b[i] = (b[i] - sum) / a[i * n + i];
        }
        for i in (0..n).rev() {
            let sum: f64 = (i + 1..n).map(|k| a[k * n + i] * b[k]).sum();
            b[i] = (b[i] - sum) / a[i * n + i];
        }
        b.iter().all(|v| v.is_finite()).then_some(b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use portable_numerics::random::normal;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    /// Returns a random positive definite matrix.
    fn random(n: usize, seed: u64) -> Matrix {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let factor = Matrix::new(n, n, (0..n * n).map(|_| normal(&mut rng)).collect());
        factor.times(&factor.transposed())
    }

    fn distance(a: &Matrix, b: &Matrix) -> f64 {
        a.minus(b).values.iter().fold(0.0, |worst, v| worst.max(v.abs()))
    }

    #[test]
    fn roots_multiply_to_the_matrix_and_its_inverse() {
        for n in [1, 2, 4, 8, 16] {
            let a = random(n, 0x3a7 + n as u64);
            let (root, inverse) = (a.root(), a.inverse_root(1e-12));
            assert!(distance(&root.times(&root), &a) < 1e-10);
            let identity = a.function(|_, _| 1.0);
            assert!(distance(&inverse.times(&a).times(&inverse), &identity) < 1e-6, "{n}");
        }
    }

    #[test]
    fn directions_without_variance_are_left_out() {
        let singular = Matrix::new(2, 2, vec![1.0; 4]);
        assert!(distance(&singular.inverse_root(1e-9), &Matrix::new(2, 2, vec![0.125_f64.sqrt(); 4])) < 1e-12);
        let zero = Matrix::new(2, 2, vec![0.0; 4]);
        assert_eq!(zero.inverse_root(1e-9), zero);
    }

    #[test]
    fn solutions_satisfy_the_equations() {
        for n in [1, 3, 25] {
            let a = random(n, 0x50_1e + n as u64);
            let b: Vec<f64> = (0..n).map(|i| i as f64 - 1.5).collect();
            let x = a.clone().solve(b.clone()).unwrap();
            let residual = a.times(&Matrix::new(n, 1, x)).minus(&Matrix::new(n, 1, b));
            assert!(residual.values.iter().all(|v| v.abs() < 1e-8), "{n}");
        }
        assert_eq!(Matrix::new(2, 2, vec![1.0, 2.0, 2.0, 1.0]).solve(vec![1.0, 1.0]), None);
        assert_eq!(Matrix::new(1, 1, vec![f64::NAN]).solve(vec![1.0]), None);
    }
}
