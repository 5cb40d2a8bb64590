//! Amounts of dyes.

use super::section::section;

section! {
    /// Amounts of dyes at staining strength 1, each as the absorbance at the peak of the dye. The staining strength is
    /// given by the model and the factors of `stain`. It is the absorbance at 0.57 µm if the absorbances of the amounts
    /// add up to 1 there.
    #[derive(Copy)]
    pub struct DyeAmounts {
        /// Haematein bound to aluminium, blue-violet, peak near 0.58 µm.
        haematein: f64 = 0.0, 0..=100;
        /// Eosin Y, pink, peak near 0.53 µm.
        eosin_y: f64 = 0.0, 0..=100;
        /// Light green SF, blue-green, peak near 0.63 µm.
        light_green: f64 = 0.0, 0..=100;
        /// Orange G, orange, peak near 0.48 µm.
        orange_g: f64 = 0.0, 0..=100;
        /// A grey absorber, the same at all wavelengths.
        neutral: f64 = 0.0, 0..=100;
    }
}

impl DyeAmounts {
    /// Returns no dye.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// Returns grey of strength 1.
    #[must_use]
    pub fn grey() -> Self {
        Self { neutral: 1.0, ..Self::none() }
    }

    /// Returns the amounts in the order of [`dye_spectra::Dye::ALL`].
    #[must_use]
    pub fn amounts(&self) -> dye_spectra::Amounts {
        [self.haematein, self.eosin_y, self.light_green, self.orange_g, self.neutral]
    }
}
