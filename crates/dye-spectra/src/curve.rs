use multiversion::multiversion;

use crate::dye::{Amounts, DYES};
use crate::rows::{LANES, Terms, Wavelength, exact, padded};

/// Degree of the polynomials: with `DEEPEST`, an error below 1e-5.
const DEGREE: usize = 9;
/// Absorbance, at the wavelength that absorbs most, up to which the polynomials serve. Nothing that cells bind is so
/// dark: one part in a thousand passes.
const DEEPEST: f64 = 3.0;

/// Light in each channel as a function of one number: how much there is of one mixture of dyes.
///
/// Much faster than the sum over wavelengths, since that sum is smooth: a polynomial each for the channels serves up
/// to absorbance 3; beyond, the wavelengths are summed.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Of Q_c in powers of u = amount·`scale` − 1, which is −1 to 1; light is 1 − amount·Q_c(u), so exactly 1 at none.
    coefficients: [[f32; DEGREE + 1]; 3],
    scale: f32,
    /// The largest amount of the polynomials.
    most: f32,
    /// For larger amounts: the mixture stands where the first dye does.
    beyond: Terms,
}

impl Curve {
    #[expect(clippy::cast_possible_truncation, reason = "pixels are single precision")]
    pub(crate) fn new(terms: &[Wavelength], mix: &Amounts) -> Self {
        let alone = |amount: f64| {
            let mut alone = [0.0; DYES];
            alone[0] = amount;
            alone
        };
        let mixed = |absorbances: &Amounts| absorbances.iter().zip(mix).map(|(a, share)| a * share).sum::<f64>();
        let terms: Vec<Wavelength> = terms.iter().map(|(a, weights)| (alone(mixed(a)), *weights)).collect();
        let steepest = terms.iter().fold(0.0_f64, |steepest, (a, _)| steepest.max(a[0]));
        // A mixture of nothing absorbs nothing, however much of it there is.
        let most = if steepest > 0.0 { (DEEPEST / steepest).min(f64::from(f32::MAX)) } else { f64::from(f32::MAX) };
        let quotient = |u: f64| {
            let amount = 0.5 * most * (u + 1.0);
            exact(&terms, &alone(amount)).map(|light| (1.0 - light) / amount)
        };
        Self {
            coefficients: interpolate(quotient).map(|channel| channel.map(|c| c as f32)),
            scale: (2.0 / most) as f32,
            most: most as f32,
            beyond: Terms::new(&terms),
        }
    }

    /// Light in each channel relative to the empty slide, from amounts of the mixture, each 0 or more. What a pixel
    /// gets depends on its own amount alone, and is exactly 1 where that is 0. Absolute error below 1e-5.
    ///
    /// # Panics
    ///
    /// If a plane of `out` is not as long as `amount`.
    pub fn transmittance_into(&self, amount: &[f32], out: [&mut [f32]; 3]) {
        assert!(out.iter().all(|plane| plane.len() == amount.len()), "a channel is not as long as the amounts");
        rows(self, amount, out);
    }

    /// Light of a few pixels.
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
        if amount.iter().fold(false, |any, &amount| any | (amount > self.most)) {
            let exact = self.beyond.block([0], [amount]);
            for (light, exact) in light.iter_mut().zip(exact) {
                for ((light, exact), &amount) in light.iter_mut().zip(exact).zip(amount) {
                    *light = if amount > self.most { exact } else { *light };
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

/// The polynomials in powers of u that agree with three functions at Chebyshev's points of −1 to 1.
fn interpolate(f: impl Fn(f64) -> [f64; 3]) -> [[f64; DEGREE + 1]; 3] {
    const POINTS: usize = DEGREE + 1;
    let mut powers = [[0.0; POINTS]; 3];
    let angle = |k: usize| core::f64::consts::PI * (k as f64 + 0.5) / POINTS as f64;
    let values: [[f64; 3]; POINTS] = std::array::from_fn(|k| f(libm::cos(angle(k))));
    // Chebyshev polynomials in powers of u: T₀ = 1, T₁ = u, Tₙ₊₁ = 2u·Tₙ − Tₙ₋₁.
    let (mut before, mut now) = ([0.0; POINTS], [0.0; POINTS]);
    now[0] = 1.0;
    for n in 0..POINTS {
        for (c, powers) in powers.iter_mut().enumerate() {
            let sum: f64 = values.iter().enumerate().map(|(k, v)| v[c] * libm::cos(n as f64 * angle(k))).sum();
            let coefficient = sum * if n == 0 { 1.0 } else { 2.0 } / POINTS as f64;
            for (power, term) in powers.iter_mut().zip(now) {
                *power += coefficient * term;
            }
        }
        let factor = if n == 0 { 1.0 } else { 2.0 };
        let next = std::array::from_fn(|i| factor * if i == 0 { 0.0 } else { now[i - 1] } - before[i]);
        (before, now) = (now, next);
    }
    powers
}
