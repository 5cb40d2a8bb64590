/// Aberrations of the objective: Zernike terms over its pupil, each in waves rms, −5 to 5. All are
/// 0 by default (ours).
///
/// The polynomials are orthonormal over the unit disc (Noll's; DOI 10.1364/JOSA.66.000207), so the
/// square root of the sum of the squares is the error of the whole wavefront, σ, and the Strehl
/// ratio of a small one is exp(−(2πσ)²).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Zernike {
    /// √3 (2ρ² − 1).
    pub defocus: f64,
    /// √6 ρ² cos 2θ and √6 ρ² sin 2θ.
    pub astigmatism: [f64; 2],
    /// √8 (3ρ³ − 2ρ) cos θ and √8 (3ρ³ − 2ρ) sin θ.
    pub coma: [f64; 2],
    /// √5 (6ρ⁴ − 6ρ² + 1).
    pub spherical: f64,
}

impl Zernike {
    /// Waves of the terms with a direction, at a point of the pupil, whose rim lies at distance 1.
    pub(crate) fn sided_waves(&self, [x, y]: [f64; 2]) -> f64 {
        let [a, b] = self.astigmatism;
        let [c, d] = self.coma;
        6_f64.sqrt() * (a * (x * x - y * y) + b * 2.0 * x * y)
            + 8_f64.sqrt() * (3.0 * (x * x + y * y) - 2.0) * (c * x + d * y)
    }

    /// The terms without direction, where the square of the distance from the centre is `r2`.
    #[inline(always)]
    pub(crate) fn round_waves(&self, r2: f64) -> f64 {
        self.defocus * 3_f64.sqrt() * (2.0 * r2 - 1.0)
            + self.spherical * 5_f64.sqrt() * (6.0 * r2 * r2 - 6.0 * r2 + 1.0)
    }

    /// Whether every direction is like every other.
    pub(crate) fn is_round(&self) -> bool {
        self.astigmatism == [0.0; 2] && self.coma == [0.0; 2]
    }

    /// Names and values of the terms.
    pub(crate) fn terms(&self) -> [(&'static str, f64); 6] {
        [
            ("zernike.defocus", self.defocus),
            ("zernike.astigmatism[0]", self.astigmatism[0]),
            ("zernike.astigmatism[1]", self.astigmatism[1]),
            ("zernike.coma[0]", self.coma[0]),
            ("zernike.coma[1]", self.coma[1]),
            ("zernike.spherical", self.spherical),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn single(k: usize) -> Zernike {
        let [defocus, a, b, c, d, spherical] = core::array::from_fn(|i| f64::from(u8::from(i == k)));
        Zernike { defocus, astigmatism: [a, b], coma: [c, d], spherical }
    }

    #[test]
    fn terms_are_orthonormal_and_without_piston() {
        let points: Vec<[f64; 2]> = (0..40_000)
            .map(|i| {
                let (r, t) = (((f64::from(i) + 0.5) / 40_000.0).sqrt(), f64::from(i) * 2.399_963_229_728_653);
                [r * libm::cos(t), r * libm::sin(t)]
            })
            .collect();
        let waves = |z: &Zernike, [x, y]: [f64; 2]| z.round_waves(x * x + y * y) + z.sided_waves([x, y]);
        let mean = |f: &dyn Fn([f64; 2]) -> f64| points.iter().map(|&p| f(p)).sum::<f64>() / 40_000.0;
        for i in 0..6 {
            let a = single(i);
            assert!(mean(&|p| waves(&a, p)).abs() < 2e-3);
            for j in 0..6 {
                let b = single(j);
                let product = mean(&|p| waves(&a, p) * waves(&b, p));
                assert!((product - f64::from(u8::from(i == j))).abs() < 3e-3, "{i} {j}: {product}");
            }
            assert_eq!(a.is_round(), i == 0 || i == 5);
            assert_eq!(a.terms()[i].1, 1.0);
        }
    }
}
