use crate::light::{Lobe, lobe, sum};

/// An absorber in a Papanicolaou smear.
///
/// The spectra are models of the *bound* dyes: sums of a few split Gaussians. Their maxima are those of Conn's
/// *Biological Stains*, shifted for binding. They are valid from 0.40 to 0.70 µm. Bismarck brown is missing because
/// cells do not bind it (Marshall and Galbraith).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Dye {
    /// Aluminium haematein, the blue of nuclei; peak at 0.580 µm.
    Haematein,
    /// Eosin Y, the pink of superficial cells; peak at 0.532 µm.
    EosinY,
    /// Light green SF, the blue-green of intermediate and parabasal cells; peaks at 0.628 µm and 0.425 µm.
    LightGreen,
    /// Orange G, the orange of keratin; peak at 0.470 µm.
    OrangeG,
    /// Equal absorbance at all wavelengths: soot, dust, ink.
    Neutral,
}

/// Number of dyes.
pub const DYES: usize = Dye::ALL.len();

/// Amount of each dye, in the order of [`Dye::ALL`]: its decadic absorbance at its peak, at least 0.
pub type Amounts = [f64; DYES];

/// Returns amounts of the named dyes, and 0 for the others. Repeated dyes add up.
///
/// ```
/// use dye_spectra::{Dye, amounts};
/// assert_eq!(amounts([(Dye::LightGreen, 0.15), (Dye::EosinY, 0.03)]), [0.0, 0.03, 0.15, 0.0, 0.0]);
/// ```
#[must_use]
pub fn amounts<const N: usize>(named: [(Dye, f64); N]) -> Amounts {
    let mut amounts = [0.0; DYES];
    for (dye, amount) in named {
        amounts[dye as usize] += amount;
    }
    amounts
}

/// Returns the total decadic absorbance at a wavelength by the Beer–Lambert law: A(λ) = Σ_d c_d·ε_d(λ).
#[must_use]
pub fn absorbance(amounts: &Amounts, wavelength_um: f64) -> f64 {
    Dye::ALL.iter().zip(amounts).map(|(dye, amount)| amount * dye.absorbance(wavelength_um)).sum()
}

impl Dye {
    /// All dyes, in the order of [`Amounts`].
    pub const ALL: [Self; 5] = [Self::Haematein, Self::EosinY, Self::LightGreen, Self::OrangeG, Self::Neutral];

    /// Returns the decadic absorbance at a wavelength for an amount of 1; its peak is 1 within 0.001.
    #[must_use]
    pub fn absorbance(self, wavelength_um: f64) -> f64 {
        match self {
            Self::Haematein => sum(&HAEMATEIN, wavelength_um),
            Self::EosinY => sum(&EOSIN_Y, wavelength_um),
            Self::LightGreen => sum(&LIGHT_GREEN, wavelength_um),
            Self::OrangeG => sum(&ORANGE_G, wavelength_um),
            Self::Neutral => 1.0,
        }
    }
}

const HAEMATEIN: [Lobe; 3] =
    [lobe(0.3438, 440.0, 48.0, 48.0), lobe(0.9551, 580.0, 52.0, 42.0), lobe(0.0955, 640.0, 45.0, 45.0)];
const EOSIN_Y: [Lobe; 3] =
    [lobe(0.0190, 430.0, 60.0, 60.0), lobe(0.2848, 502.0, 16.0, 16.0), lobe(0.9492, 534.0, 22.0, 16.0)];
const LIGHT_GREEN: [Lobe; 3] =
    [lobe(0.1581, 425.0, 22.0, 22.0), lobe(0.2789, 588.0, 26.0, 26.0), lobe(0.9298, 634.0, 33.0, 22.0)];
const ORANGE_G: [Lobe; 3] =
    [lobe(0.4197, 422.0, 28.0, 28.0), lobe(0.9308, 480.0, 40.0, 24.0), lobe(0.1118, 512.0, 14.0, 14.0)];

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of the table, in the order of `Dye::ALL`.
    const COLUMNS: [usize; 4] = [1, 2, 4, 3];

    #[test]
    fn spectra_match_the_table() {
        let table = include_str!("../tests/dye_models.csv");
        for row in table.lines().skip(1) {
            let row: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
            for (dye, column) in Dye::ALL.into_iter().zip(COLUMNS) {
                let error = dye.absorbance(row[0] * 1e-3) - row[column];
                assert!(error.abs() < 1e-3, "{dye:?} at {} nm: {error}", row[0]);
            }
        }
    }

    #[test]
    fn peaks_are_one_at_the_documented_wavelengths() {
        let peaks_um = [0.580, 0.532, 0.628, 0.470];
        for (dye, peak_um) in Dye::ALL.into_iter().zip(peaks_um) {
            let at = |i: &i32| dye.absorbance(f64::from(*i) * 1e-4);
            let highest = (4000..=7000).max_by(|a, b| at(a).total_cmp(&at(b))).unwrap();
            assert!((at(&highest) - 1.0).abs() < 1e-3, "{dye:?} {}", at(&highest));
            assert!((f64::from(highest) * 1e-4 - peak_um).abs() < 0.003, "{dye:?} {highest}");
        }
        assert_eq!(Dye::Neutral.absorbance(0.45), 1.0);
    }

    #[test]
    fn dyes_and_amounts_have_the_same_order() {
        for (i, dye) in Dye::ALL.into_iter().enumerate() {
            assert_eq!(dye as usize, i);
            assert_eq!(absorbance(&amounts([(dye, 0.5)]), 0.55), 0.5 * dye.absorbance(0.55));
        }
    }

    /// The filter of Holmquist and of the paper is at 0.570 µm.
    #[test]
    fn nuclear_contrast_is_largest_between_560_and_585_nm() {
        let nucleus = amounts([(Dye::Haematein, 0.5)]);
        let cytoplasms = [
            amounts([(Dye::LightGreen, 0.15), (Dye::EosinY, 0.03)]),
            amounts([(Dye::EosinY, 0.18), (Dye::OrangeG, 0.05)]),
        ];
        let contrast = |wavelength_um: f64| -> f64 {
            let light = |c: &Amounts| libm::exp10(-absorbance(c, wavelength_um));
            cytoplasms.iter().map(|c| light(c) * (1.0 - light(&nucleus))).sum()
        };
        let best = (400..=700).max_by(|a, b| contrast(f64::from(*a) * 1e-3).total_cmp(&contrast(f64::from(*b) * 1e-3)));
        assert!((560..=585).contains(&best.unwrap()), "{best:?}");
    }
}
