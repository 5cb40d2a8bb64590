use core::f64::consts::{PI, TAU};

use multiversion::multiversion;

use crate::Error;

/// Orders of aliases summed on each side of the base band. Beyond them the folded spectrum is flat; the remaining
/// variance is added as a constant.
const MATERN_ALIASES: i32 = 2;

/// A Gaussian decays fast: one order suffices even for a blur of half a pixel.
const GAUSSIAN_ALIASES: i32 = 1;

/// Negative logarithm of the Gaussian density, relative to that at frequency 0, from which on it is 0: below any
/// rounding error of the sum over a grid.
const MAX_FALL: f64 = 100.0;

/// Frequencies computed together.
const LANES: usize = 16;

/// The power spectrum of a field as a function of the frequency f in cycles per pixel.
///
/// All spectra are isotropic. All fields have mean 0 and variance 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spectrum {
    /// S(f) ∝ f^-exponent up to the Nyquist frequency, without a constant part.
    ///
    /// For a steep spectrum, most of the variance is in the lowest frequencies. The mean square of a single draw may
    /// differ much from 1; the average over draws is 1.
    PowerLaw {
        /// 0 (white) to 8. The paper's Brownian noise has 2, a Brownian surface 3 to 4.
        exponent: f64,
    },
    /// S(f) ∝ (1 + (2π f l)² / 2ν)^-(ν + 1), the Matérn family: rough at small distances, uncorrelated beyond a few l.
    Matern {
        /// Smoothness ν, above 0, at most 20. If ν is 0.5, the autocorrelation is exponential. If ν is large, it is
        /// nearly Gaussian.
        nu: f64,
        /// Correlation length l in pixels, 0.001 to 1000000.
        length_px: f64,
    },
    /// White noise blurred by a Gaussian, the paper's "low frequency Gaussian noise": S(f) ∝ exp(-(2π f σ)²).
    Gaussian {
        /// Standard deviation σ of the blur in pixels, 0.001 to 1000000.
        sigma_px: f64,
    },
}

impl Spectrum {
    /// The paper's Brownian noise, "whose power spectrum decreases as a function of f²"
    /// ("Texture synthesis").
    pub const BROWNIAN: Self = Self::PowerLaw { exponent: 2.0 };

    /// Returns S at a frequency in cycles per pixel, for the continuous field.
    ///
    /// Matérn and Gaussian densities integrate to 1 over the plane. A power law is f^-exponent, without normalisation.
    /// Gaussian densities below 10⁻⁴³ of the largest are 0.
    #[must_use]
    pub fn density(&self, frequency: f64) -> f64 {
        self.density_of_square(frequency * frequency)
    }

    /// Returns the autocorrelation of the continuous field at a distance in pixels, 1 at distance 0.
    ///
    /// `None` for a power law, whose autocorrelation depends on the grid: use
    /// [`SpectralField::autocorrelation`](crate::SpectralField::autocorrelation).
    #[must_use]
    pub fn autocorrelation(&self, lag_px: f64) -> Option<f64> {
        match *self {
            Self::PowerLaw { .. } => None,
            // C(r) = 2^(1 - ν) / Γ(ν) x^ν K_ν(x), x = √(2ν) r / l.
            Self::Matern { nu, length_px } => {
                let x = (2.0 * nu).sqrt() * lag_px.abs() / length_px;
                let scale = libm::exp2(1.0 - nu) / libm::tgamma(nu) * libm::pow(x, nu);
                // Near distance 0, the scale underflows, and the autocorrelation is 1.
                Some(if scale < f64::MIN_POSITIVE { 1.0 } else { scale * bessel_k(nu, x) })
            }
            Self::Gaussian { sigma_px } => {
                let x = lag_px / (2.0 * sigma_px);
                Some(libm::exp(-x * x))
            }
        }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let within = |field, value: f64, accepted, inside: bool| {
            if inside && value.is_finite() { Ok(()) } else { Err(Error::Spectrum { field, value, accepted }) }
        };
        match *self {
            Self::PowerLaw { exponent } => {
                let inside = (0.0..=8.0).contains(&exponent);
                within("spectrum.exponent", exponent, "0 to 8", inside)
            }
            Self::Matern { nu, length_px } => {
                let smooth = nu > 0.0 && nu <= 20.0;
                within("spectrum.nu", nu, "above 0, at most 20", smooth)?;
                let long = (1e-3..=1e6).contains(&length_px);
                within("spectrum.length_px", length_px, "0.001 to 1000000", long)
            }
            Self::Gaussian { sigma_px } => {
                let wide = (1e-3..=1e6).contains(&sigma_px);
                within("spectrum.sigma_px", sigma_px, "0.001 to 1000000", wide)
            }
        }
    }

    /// Computes the density of the field sampled at pixels at the frequencies (`fx`, `fy[i]`): S folded into the base
    /// band. The samples have the exact continuous autocorrelation at integer distances.
    pub(crate) fn folded_density(&self, fx: f64, fy: &[f64], density: &mut [f64]) {
        let orders = match self {
            // A power law has no scale: its grid defines it, and it ends at the Nyquist frequency.
            Self::PowerLaw { .. } => 0,
            Self::Matern { .. } => MATERN_ALIASES,
            Self::Gaussian { .. } => GAUSSIAN_ALIASES,
        };
        density.fill(0.0);
        let mut terms = vec![0.0; fy.len()];
        for j in -orders..=orders {
            for i in -orders..=orders {
                let fx = fx + f64::from(i);
                for (square, fy) in terms.iter_mut().zip(fy) {
                    let fy = fy + f64::from(j);
                    *square = fx * fx + fy * fy;
                }
                self.densities_of_squares(&mut terms);
                density.iter_mut().zip(&terms).for_each(|(sum, term)| *sum += term);
            }
        }
        let side = f64::from(2 * orders + 1);
        // The variance outside the summed square is added as a constant; the square is replaced by a disc of its area.
        let beyond = self.variance_beyond_square(side * side / PI);
        density.iter_mut().for_each(|sum| *sum += beyond);
    }

    /// Returns the smallest distance in pixels at which the autocorrelation is below `level`, at most `most`.
    pub(crate) fn reach_px(&self, level: f64, most: usize) -> usize {
        #[expect(clippy::cast_precision_loss, reason = "at most 2^14")]
        let is_correlated = |lag: usize| self.autocorrelation(lag as f64).is_none_or(|c| c >= level);
        let (mut near, mut far) = (0, most);
        while far - near > 1 {
            let centre = usize::midpoint(near, far);
            if is_correlated(centre) {
                near = centre;
            } else {
                far = centre;
            }
        }
        far
    }

    fn density_of_square(&self, square: f64) -> f64 {
        let mut density = [square];
        self.densities_of_squares(&mut density);
        density[0]
    }

    /// Replaces squares of frequencies by densities.
    fn densities_of_squares(&self, squares: &mut [f64]) {
        match *self {
            Self::PowerLaw { exponent } => inverse_powers(squares, 0.5 * exponent),
            Self::Matern { nu, length_px } => {
                let a = TAU * TAU * length_px * length_px / (2.0 * nu);
                let scale = a * nu / PI;
                squares.iter_mut().for_each(|square| *square = 1.0 + a * *square);
                inverse_powers(squares, nu + 1.0);
                squares.iter_mut().for_each(|power| *power *= scale);
            }
            Self::Gaussian { sigma_px } => {
                let a = TAU * TAU * sigma_px * sigma_px;
                let scale = a / PI;
                for square in squares {
                    let fall = a * *square;
                    *square = if fall < MAX_FALL { scale * libm::exp(-fall) } else { 0.0 };
                }
            }
        }
    }

    /// Returns the variance at frequencies whose square exceeds `square`.
    fn variance_beyond_square(&self, square: f64) -> f64 {
        match *self {
            Self::PowerLaw { .. } => 0.0,
            Self::Matern { nu, length_px } => {
                let a = TAU * TAU * length_px * length_px / (2.0 * nu);
                let mut variance = [1.0 + a * square];
                inverse_powers(&mut variance, nu);
                variance[0]
            }
            Self::Gaussian { sigma_px } => libm::exp(-TAU * TAU * sigma_px * sigma_px * square),
        }
    }
}

/// Replaces every x by x^-p. Integer and half-integer p, the common ones, use multiplications, which is many times
/// faster.
fn inverse_powers(values: &mut [f64], p: f64) {
    let halves = 2.0 * p;
    if halves != libm::floor(halves) {
        values.iter_mut().for_each(|x| *x = libm::pow(*x, -p));
        return;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an integer from 0 to 42")]
    let exponent = halves as u32;
    inverse_roots_to(values, exponent);
}

/// Replaces every x by x^-½ to the power of `exponent`.
#[multiversion(targets = "simd")]
fn inverse_roots_to(values: &mut [f64], exponent: u32) {
    for values in values.chunks_mut(LANES) {
        let (mut base, mut power) = ([1.0; LANES], [1.0; LANES]);
        base[..values.len()].copy_from_slice(values);
        base.iter_mut().for_each(|x| *x = 1.0 / x.sqrt());
        let mut exponent = exponent;
        while exponent > 0 {
            for (power, base) in power.iter_mut().zip(&base) {
                *power = if exponent & 1 == 1 { *power * base } else { *power };
            }
            base.iter_mut().for_each(|x| *x *= *x);
            exponent >>= 1;
        }
        values.copy_from_slice(&power[..values.len()]);
    }
}

/// Returns the modified Bessel function of the second kind, K_ν(x) = ∫₀^∞ exp(-x cosh t) cosh(ν t) dt.
///
/// The trapezoidal rule converges exponentially on this integrand, which decays doubly exponentially (Trefethen and
/// Weideman, doi:10.1137/130932132).
fn bessel_k(nu: f64, x: f64) -> f64 {
    // Error about exp(-2π · π/2 / STEP).
    const STEP: f64 = 0.125;
    let term = |t: f64| {
        let fall = x * libm::cosh(t);
        0.5 * (libm::exp(nu * t - fall) + libm::exp(-nu * t - fall))
    };
    let mut sum = 0.5 * term(0.0);
    let mut t = STEP;
    loop {
        let next = term(t);
        sum += next;
        // Beyond the peak at sinh t = ν / x the terms decrease.
        if x * libm::sinh(t) > nu && next <= f64::EPSILON * sum {
            return STEP * sum;
        }
        t += STEP;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_integer_bessel_has_closed_forms() {
        for x in [0.01, 0.3, 1.0, 4.0, 30.0] {
            let half = (PI / (2.0 * x)).sqrt() * libm::exp(-x);
            assert!((bessel_k(0.5, x) / half - 1.0).abs() < 1e-13);
            let three_halves = half * (1.0 + 1.0 / x);
            assert!((bessel_k(1.5, x) / three_halves - 1.0).abs() < 1e-13);
        }
        // Abramowitz and Stegun, table 9.8.
        assert!((bessel_k(1.0, 1.0) - 0.601_907_230_197_234_6).abs() < 1e-14);
        assert!((bessel_k(0.0, 2.0) - 0.113_893_872_749_533_44).abs() < 1e-14);
    }

    #[test]
    fn matern_with_nu_one_half_is_exponential() {
        let spectrum = Spectrum::Matern { nu: 0.5, length_px: 3.0 };
        for r in [0.0, 1e-200, 0.5, 1.0, 7.0, 40.0] {
            let c = spectrum.autocorrelation(r).unwrap();
            assert!((c - libm::exp(-r / 3.0)).abs() < 1e-13, "{r}: {c}");
        }
    }

    #[test]
    fn integer_and_half_integer_powers_are_correct() {
        for p in [0.5, 1.0, 1.5, 2.0, 3.5, 21.0, 1.3] {
            for x in [1.0, 1.7, 100.0] {
                let expected = libm::pow(x, -p);
                let mut found = [x];
                inverse_powers(&mut found, p);
                assert!((found[0] / expected - 1.0).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn folded_densities_are_the_sums_of_aliases() {
        for (spectrum, orders) in [
            (Spectrum::BROWNIAN, 0),
            (Spectrum::PowerLaw { exponent: 2.6 }, 0),
            (Spectrum::Matern { nu: 0.5, length_px: 1.6 }, MATERN_ALIASES),
            (Spectrum::Matern { nu: 0.8, length_px: 30.0 }, MATERN_ALIASES),
            (Spectrum::Gaussian { sigma_px: 0.5 }, GAUSSIAN_ALIASES),
            (Spectrum::Gaussian { sigma_px: 1.5 }, GAUSSIAN_ALIASES),
        ] {
            let fy: Vec<f64> = (0..=17).map(|ky| f64::from(ky) / 34.0).collect();
            let mut found = vec![f64::NAN; fy.len()];
            for fx in [0.0, 0.03, 0.5] {
                spectrum.folded_density(fx, &fy, &mut found);
                for (&fy, &found) in fy.iter().zip(&found) {
                    let mut sum = 0.0;
                    for j in -orders..=orders {
                        for i in -orders..=orders {
                            sum += spectrum.density(libm::hypot(fx + f64::from(i), fy + f64::from(j)));
                        }
                    }
                    let side = f64::from(2 * orders + 1);
                    let expected = sum + spectrum.variance_beyond_square(side * side / PI);
                    assert!(found == expected || (found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
                }
            }
        }
    }

    #[test]
    fn densities_integrate_to_one() {
        for spectrum in [Spectrum::Gaussian { sigma_px: 0.4 }, Spectrum::Matern { nu: 0.8, length_px: 1.5 }] {
            let step = 1e-3;
            let inside: f64 =
                (0..3000).map(|i| (f64::from(i) + 0.5) * step).map(|f| TAU * f * spectrum.density(f) * step).sum();
            let beyond = spectrum.variance_beyond_square(9.0);
            assert!((inside + beyond - 1.0).abs() < 1e-5, "{spectrum:?}");
        }
    }

    #[test]
    fn out_of_range_values_are_errors() {
        for bad in [f64::NAN, f64::INFINITY, -1.0] {
            let (power, gaussian) = (Spectrum::PowerLaw { exponent: bad }, Spectrum::Gaussian { sigma_px: bad });
            let (rough, short) =
                (Spectrum::Matern { nu: bad, length_px: 1.0 }, Spectrum::Matern { nu: 1.0, length_px: bad });
            assert!([power, gaussian, rough, short].iter().all(|spectrum| spectrum.check().is_err()), "{bad}");
        }
        assert!(Spectrum::Gaussian { sigma_px: 0.0 }.check().is_err());
        let message = Spectrum::PowerLaw { exponent: 9.0 }.check().unwrap_err();
        assert_eq!(message.to_string(), "spectrum.exponent is 9; accepted: 0 to 8");
    }
}
