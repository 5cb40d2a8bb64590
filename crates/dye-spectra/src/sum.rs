//! The sum over wavelengths, in double precision.

use crate::dye::Amounts;

/// Absorbance of unit amounts, and weight in each channel.
pub(crate) type Term = (Amounts, [f64; 3]);

/// T_c = Σ_λ w_c(λ)·10^−A(λ)
pub(crate) fn transmittance(terms: &[Term], amounts: &Amounts) -> [f64; 3] {
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
