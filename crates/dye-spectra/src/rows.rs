//! Light of rows of pixels. The bits are the same on every machine: only multiplications, additions and conversions in
//! a fixed order, without fused operations or library functions.

use multiversion::multiversion;

use crate::dye::{Amounts, DYES};

/// Absorbances of unit amounts, and weights in each channel.
pub(crate) type Wavelength = (Amounts, [f64; 3]);

/// T_c = Σ_λ w_c(λ)·10^−A(λ)
pub(crate) fn exact(terms: &[Wavelength], amounts: &Amounts) -> [f64; 3] {
    let mut light = [0.0; 3];
    for (absorbances, weights) in terms {
        let absorbance: f64 = absorbances.iter().zip(amounts).map(|(a, amount)| a * amount).sum();
        let power = libm::exp10(-absorbance);
        for (light, weight) in light.iter_mut().zip(weights) {
            *light += weight * power;
        }
    }
    light
}

/// Pixels processed in parallel.
pub(crate) const LANES: usize = 16;
/// Size of the exponents of a term, a power of two, so that bounds checks are unnecessary.
const EXPONENTS: usize = DYES.next_power_of_two();

/// A term of the sums: light `weights[c]`·2^Σ_d `exponents[d]`·c_d in channel c.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Term {
    exponents: [f32; EXPONENTS],
    weights: [f32; 3],
}

/// The sum of terms, exactly 1 in every channel without dye.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Terms {
    terms: Vec<Term>,
    /// Rounding error 1 − Σ weights.
    rest: [f32; 3],
}

impl Terms {
    #[expect(clippy::cast_possible_truncation, reason = "pixels use single precision")]
    pub(crate) fn new(terms: &[Wavelength]) -> Self {
        let single = |(absorbances, weights): &Wavelength| {
            let mut exponents = [0.0; EXPONENTS];
            for (exponent, absorbance) in exponents.iter_mut().zip(absorbances) {
                *exponent = (-absorbance * core::f64::consts::LOG2_10) as f32;
            }
            Term { exponents, weights: weights.map(|w| w as f32) }
        };
        let terms: Vec<Term> = terms.iter().map(single).collect();
        let sum = |c: usize| terms.iter().fold(0.0, |sum: f32, term| sum + term.weights[c]);
        Self { rest: std::array::from_fn(|c| 1.0 - sum(c)), terms }
    }

    /// Returns the light in each channel of a block of pixels, skipping absent dyes.
    #[inline(always)]
    fn present(&self, amounts: [&[f32; LANES]; DYES]) -> [[f32; LANES]; 3] {
        let (mut dyes, mut here, mut present) = ([0; DYES], [&NONE; DYES], 0);
        for (dye, block) in amounts.into_iter().enumerate() {
            (dyes[present], here[present]) = (dye, block);
            // Any bit except the sign.
            let bits = block.iter().fold(0, |bits, amount| bits | amount.to_bits()) << 1;
            present += usize::from(bits != 0);
        }
        let [d0, d1, d2, d3, _] = dyes;
        let [h0, h1, h2, h3, _] = here;
        match present {
            0 => [[1.0; LANES]; 3],
            1 => self.block([d0], [h0]),
            2 => self.block([d0, d1], [h0, h1]),
            3 => self.block([d0, d1, d2], [h0, h1, h2]),
            4 => self.block([d0, d1, d2, d3], [h0, h1, h2, h3]),
            _ => self.block(dyes, here),
        }
    }

    /// Returns the light in each channel of a block of pixels. Amounts must be at least 0.
    #[inline(always)]
    pub(crate) fn block<const D: usize>(&self, dyes: [usize; D], amounts: [&[f32; LANES]; D]) -> [[f32; LANES]; 3] {
        let mut sums = [[0.0; LANES]; 3];
        for term in &self.terms {
            let mut powers = [0.0; LANES];
            for j in 0..D {
                let exponent = term.exponents[dyes[j] % EXPONENTS];
                for (power, amount) in powers.iter_mut().zip(amounts[j]) {
                    let absorbed = exponent * amount;
                    *power = if j == 0 { absorbed } else { *power + absorbed };
                }
            }
            for power in &mut powers {
                *power = exp2(*power);
            }
            for (sums, weight) in sums.iter_mut().zip(term.weights) {
                for (sum, power) in sums.iter_mut().zip(&powers) {
                    *sum += weight * power;
                }
            }
        }
        for (sums, rest) in sums.iter_mut().zip(self.rest) {
            for sum in sums {
                *sum += rest;
            }
        }
        sums
    }
}

/// Writes the light in each channel from planes of amounts. An empty plane means no dye.
#[multiversion(targets = "simd")]
pub(crate) fn transmittance(terms: &Terms, amounts: [&[f32]; DYES], out: [&mut [f32]; 3]) {
    let [(red, red_end), (green, green_end), (blue, blue_end)] = out.map(|plane| plane.as_chunks_mut());
    let planes = amounts.map(|plane| plane.as_chunks());
    for (i, ((red, green), blue)) in red.iter_mut().zip(green).zip(blue).enumerate() {
        [*red, *green, *blue] = terms.present(planes.map(|(blocks, _)| blocks.get(i).unwrap_or(&NONE)));
    }
    let ends = planes.map(|(_, end)| padded(end));
    let light = terms.present(ends.each_ref());
    for (out, light) in [red_end, green_end, blue_end].into_iter().zip(light) {
        out.copy_from_slice(&light[..out.len()]);
    }
}

/// A block without dye.
const NONE: [f32; LANES] = [0.0; LANES];

/// Pads the last pixels of a row with zeros.
pub(crate) fn padded(end: &[f32]) -> [f32; LANES] {
    let mut block = NONE;
    block[..end.len()].copy_from_slice(end);
    block
}

/// Returns 2ˣ for x from −120 to 1, and 2⁻¹²⁰ below. The relative error is below 3·10⁻⁶; integers are exact.
#[inline(always)]
fn exp2(x: f32) -> f32 {
    /// 1.5·2²³: adding it rounds to an integer, which the lowest bits then hold.
    const ROUND: f32 = 12_582_912.0;
    let x = if x > -120.0 { x } else { -120.0 };
    let shifted = x + ROUND;
    let t = x - (shifted - ROUND);
    // The minimax polynomial for relative error on −½ to ½ that is 1 at 0.
    let p = 1.0 + t * (0.693_124_2 + t * (0.240_240_99 + t * (0.055_906_445 + t * 0.009_582_861)));
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}
