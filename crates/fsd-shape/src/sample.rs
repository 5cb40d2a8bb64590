//! Random numbers of given skewness and kurtosis.

/// Fleishman's polynomial −c + bz + cz² + dz³ of a standard normal number z, with mean 0, variance 1, and given
/// skewness and excess kurtosis (doi:10.1007/BF02293811).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FleishmanPolynomial {
    b: f64,
    c: f64,
    d: f64,
}

/// Continuation steps from the normal distribution to the target moments, small enough for Newton's method to converge.
const STEPS: u32 = 32;
/// Maximum number of Newton iterations of each continuation step.
const NEWTON_STEPS: u32 = 8;
/// Change at which the iterations stop: the next change would be its square.
const CONVERGED: f64 = 1e-9;
/// Maximum final error of the moments.
const TOLERANCE: f64 = 1e-8;

impl FleishmanPolynomial {
    /// Returns the minimum accepted excess kurtosis for a skewness. The limit of Fleishman's polynomials is slightly
    /// lower.
    pub(crate) fn min_kurtosis(skewness: f64) -> f64 {
        1.7 * skewness * skewness - 1.0
    }

    /// Returns the polynomial with these moments, if there is one.
    pub(crate) fn new(skewness: f64, excess_kurtosis: f64) -> Option<Self> {
        let mut p = [1.0, 0.0, 0.0];
        for step in 1..=STEPS {
            let t = f64::from(step) / f64::from(STEPS);
            for _ in 0..NEWTON_STEPS {
                let error = Self::errors(p, t * skewness, t * excess_kurtosis);
                let change = solve(Self::jacobian(p), error)?;
                for (value, by) in p.iter_mut().zip(change) {
                    *value -= by;
                }
                if change.iter().all(|by| by.abs() < CONVERGED) {
                    break;
                }
            }
        }
        let [b, c, d] = p;
        let left = Self::errors(p, skewness, excess_kurtosis);
        left.iter().all(|e| e.abs() < TOLERANCE).then_some(Self { b, c, d })
    }

    pub(crate) fn apply(self, z: f64) -> f64 {
        ((self.d * z + self.c) * z + self.b) * z - self.c
    }

    /// Returns the errors of variance, skewness and excess kurtosis of the polynomial.
    fn errors([b, c, d]: [f64; 3], skewness: f64, kurtosis: f64) -> [f64; 3] {
        [
            b * b + 6.0 * b * d + 2.0 * c * c + 15.0 * d * d - 1.0,
            2.0 * c * (b * b + 24.0 * b * d + 105.0 * d * d + 2.0) - skewness,
            24.0 * (b * d
                + c * c * (1.0 + b * b + 28.0 * b * d)
                + d * d * (12.0 + 48.0 * b * d + 141.0 * c * c + 225.0 * d * d))
                - kurtosis,
        ]
    }

    fn jacobian([b, c, d]: [f64; 3]) -> [[f64; 3]; 3] {
        [
            [2.0 * b + 6.0 * d, 4.0 * c, 6.0 * b + 30.0 * d],
            [
                4.0 * c * (b + 12.0 * d),
                2.0 * (b * b + 24.0 * b * d + 105.0 * d * d + 2.0),
                2.0 * c * (24.0 * b + 210.0 * d),
            ],
            [
                24.0 * (d + c * c * (2.0 * b + 28.0 * d) + 48.0 * d * d * d),
                48.0 * (c * (1.0 + b * b + 28.0 * b * d) + 141.0 * c * d * d),
                24.0 * (b + 28.0 * b * c * c + d * (24.0 + 144.0 * b * d + 282.0 * c * c + 900.0 * d * d)),
            ],
        ]
    }
}

/// Solves Mx = y by Cramer's rule.
fn solve(m: [[f64; 3]; 3], y: [f64; 3]) -> Option<[f64; 3]> {
    let determinant = |m: [[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let whole = determinant(m);
    let x = core::array::from_fn(|column| {
        let mut replaced = m;
        for (row, value) in replaced.iter_mut().zip(y) {
            row[column] = value;
        }
        determinant(replaced) / whole
    });
    x.iter().all(|v: &f64| v.is_finite()).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use portable_numerics::random::Normals;
    use rand_core::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn polynomials_have_the_target_moments() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(0xBE4D);
        for (skewness, kurtosis) in [(-1.5, 3.4), (1.6, 7.0), (0.0, 5.0), (0.6, -0.3), (0.0, -1.0)] {
            let polynomial = FleishmanPolynomial::new(skewness, kurtosis).unwrap();
            let mut normals = Normals::new(&mut rng);
            let values: Vec<f64> = (0..400_000).map(|_| polynomial.apply(normals.draw())).collect();
            let power = |p: usize| values.iter().map(|v| [*v; 4][..p].iter().product::<f64>()).sum::<f64>() / 4e5;
            let excess_bound = 0.2 * (1.0 + kurtosis.abs());
            let bounds = [(0.0, 4.0 / 4e5_f64.sqrt()), (1.0, 0.03), (skewness, 0.1), (3.0 + kurtosis, excess_bound)];
            for (p, (wanted, bound)) in (1..).zip(bounds) {
                assert!((power(p) - wanted).abs() < bound, "moment {p}: {} for {wanted}", power(p));
            }
        }
    }

    #[test]
    fn all_accepted_moments_have_a_polynomial() {
        for s in -8..=8 {
            let skewness = f64::from(s) / 4.0;
            let least = FleishmanPolynomial::min_kurtosis(skewness);
            for k in 0..=20 {
                let kurtosis = least + (12.0 - least) * f64::from(k) / 20.0;
                assert!(FleishmanPolynomial::new(skewness, kurtosis).is_some(), "{skewness} {kurtosis}");
            }
        }
        assert!(FleishmanPolynomial::new(3.0, 0.0).is_none());
        assert_eq!(FleishmanPolynomial::new(0.0, 0.0).unwrap().apply(1.25), 1.25);
    }
}
