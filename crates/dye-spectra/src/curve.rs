use std::sync::LazyLock;

use multiversion::multiversion;

use crate::dye::{Amounts, DYES};
use crate::rows::{LANES, Terms, Wavelength, exact, padded};

/// Degree of the polynomials. Their error up to `MAX_ABSORBANCE` is below 1e-5.
const DEGREE: usize = 9;
/// Largest peak absorbance of the polynomials, a transmittance of one in a thousand. Stained cells absorb less.
const MAX_ABSORBANCE: f64 = 3.0;

/// Light in each channel as a function of the amount of one mixture of dyes.
///
/// Polynomials replace the sum over wavelengths up to an absorbance of 3, which is much faster. Larger amounts use the
/// sum.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Coefficients of Q_c in powers of u = amount·`scale` − 1, from −1 to 1. Light is 1 − amount·Q_c(u), exactly 1 at
    /// amount 0.
    coefficients: [[f32; POINTS]; 3],
    scale: f32,
    /// Largest amount for the polynomials.
    max_amount: f32,
    /// Sum for larger amounts; the mixture takes the position of the first dye.
    beyond: Terms,
}

impl Curve {
    #[expect(clippy::cast_possible_truncation, reason = "pixels use single precision")]
    pub(crate) fn new(terms: &[Wavelength], mix: &Amounts) -> Self {
        let single_dye = |amount: f64| {
            let mut amounts = [0.0; DYES];
            amounts[0] = amount;
            amounts
        };
        let mixed = |absorbances: &Amounts| absorbances.iter().zip(mix).map(|(a, amount)| a * amount).sum::<f64>();
        let terms: Vec<Wavelength> = terms.iter().map(|(a, weights)| (single_dye(mixed(a)), *weights)).collect();
        let steepest = terms.iter().fold(0.0_f64, |steepest, (a, _)| steepest.max(a[0]));
        // An empty mixture absorbs nothing at any amount.
        let max_amount =
            if steepest > 0.0 { (MAX_ABSORBANCE / steepest).min(f64::from(f32::MAX)) } else { f64::from(f32::MAX) };
        let quotient = |u: f64| {
            let amount = 0.5 * max_amount * (u + 1.0);
            exact(&terms, &single_dye(amount)).map(|light| (1.0 - light) / amount)
        };
        Self {
            coefficients: interpolate(quotient).map(|channel| channel.map(|c| c as f32)),
            scale: (2.0 / max_amount) as f32,
            max_amount: max_amount as f32,
            beyond: Terms::new(&terms),
        }
    }

    /// Writes the light in each channel relative to an empty slide to `out`, for amounts of the mixture of at least 0.
    /// Each pixel depends only on its own amount, and is exactly 1 at 0. The absolute error is below 1e-5.
    ///
    /// # Panics
    ///
    /// If a plane of `out` and `amount` differ in length.
    pub fn transmittance_into(&self, amount: &[f32], out: [&mut [f32]; 3]) {
        assert!(out.iter().all(|plane| plane.len() == amount.len()), "channels and amounts must have the same length");
        rows(self, amount, out);
    }

    /// Returns the light of a block of pixels.
    #[inline(always)]
    fn block(&self, amount: &[f32; LANES]) -> [[f32; LANES]; 3] {
        let mut light = [[0.0; LANES]; 3];
        for (light, coefficients) in light.iter_mut().zip(&self.coefficients) {
            for (light, &amount) in light.iter_mut().zip(amount) {
                let u = amount * self.scale - 1.0;
                let quotient = coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * u + coefficient);
                *light = 1.0 - amount * quotient;
            }
        }
        if amount.iter().fold(false, |any, &amount| any | (amount > self.max_amount)) {
            let exact = self.beyond.block([0], [amount]);
            for (light, exact) in light.iter_mut().zip(exact) {
                for ((light, exact), &amount) in light.iter_mut().zip(exact).zip(amount) {
                    *light = if amount > self.max_amount { exact } else { *light };
                }
            }
        }
        light
    }
}

#[multiversion(targets = "simd")]
fn rows(curve: &Curve, amount: &[f32], out: [&mut [f32]; 3]) {
    let [(red, red_end), (green, green_end), (blue, blue_end)] = out.map(|plane| plane.as_chunks_mut());
    let (blocks, end) = amount.as_chunks();
    for (amount, ((red, green), blue)) in blocks.iter().zip(red.iter_mut().zip(green).zip(blue)) {
        [*red, *green, *blue] = curve.block(amount);
    }
    let light = curve.block(&padded(end));
    for (out, light) in [red_end, green_end, blue_end].into_iter().zip(light) {
        out.copy_from_slice(&light[..out.len()]);
    }
}

/// Number of interpolation points.
const POINTS: usize = DEGREE + 1;

/// Polynomial interpolation at the Chebyshev points of −1 to 1.
struct Chebyshev {
    points: [f64; POINTS],
    /// Coefficients, in powers of u, of the polynomial that is 1 at a point and 0 at all others.
    powers: [[f64; POINTS]; POINTS],
}

impl Chebyshev {
    fn new() -> Self {
        let angle = |k: usize| core::f64::consts::PI * (k as f64 + 0.5) / POINTS as f64;
        let mut powers = [[0.0; POINTS]; POINTS];
        // Chebyshev polynomials in powers of u: T₀ = 1, T₁ = u, Tₙ₊₁ = 2u·Tₙ − Tₙ₋₁.
        let (mut before, mut now) = ([0.0; POINTS], [0.0; POINTS]);
        now[0] = 1.0;
        for n in 0..POINTS {
            for (k, powers) in powers.iter_mut().enumerate() {
                let coefficient = libm::cos(n as f64 * angle(k)) * if n == 0 { 1.0 } else { 2.0 } / POINTS as f64;
                for (power, term) in powers.iter_mut().zip(now) {
                    *power += coefficient * term;
                }
            }
            let factor = if n == 0 { 1.0 } else { 2.0 };
            let next = std::array::from_fn(|i| factor * if i == 0 { 0.0 } else { now[i - 1] } - before[i]);
            (before, now) = (now, next);
        }
        Self { points: std::array::from_fn(|k| libm::cos(angle(k))), powers }
    }
}

/// Returns the polynomials in powers of u that interpolate three functions at Chebyshev points of −1 to 1.
fn interpolate(f: impl Fn(f64) -> [f64; 3]) -> [[f64; POINTS]; 3] {
    static CHEBYSHEV: LazyLock<Chebyshev> = LazyLock::new(Chebyshev::new);
    let mut sums = [[0.0; POINTS]; 3];
    for (&point, powers) in CHEBYSHEV.points.iter().zip(&CHEBYSHEV.powers) {
        for (sums, value) in sums.iter_mut().zip(f(point)) {
            for (sum, power) in sums.iter_mut().zip(powers) {
                *sum += value * power;
            }
        }
    }
    sums
}
