/// One peak of a spectrum: a Gaussian with a width of its own on either side.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lobe {
    height: f64,
    peak_um: f64,
    /// Standard deviations below and above the peak.
    below_um: f64,
    above_um: f64,
}

/// A lobe by height and, in nanometres, as tables of spectra have them, peak and standard deviations below and above.
pub(crate) const fn lobe(height: f64, peak_nm: f64, below_nm: f64, above_nm: f64) -> Lobe {
    Lobe { height, peak_um: peak_nm * 1e-3, below_um: below_nm * 1e-3, above_um: above_nm * 1e-3 }
}

/// Sum of the lobes at a wavelength.
pub(crate) fn sum(lobes: &[Lobe], wavelength_um: f64) -> f64 {
    let one = |lobe: &Lobe| {
        let from_peak = wavelength_um - lobe.peak_um;
        let deviations = from_peak / if from_peak < 0.0 { lobe.below_um } else { lobe.above_um };
        lobe.height * libm::exp(-0.5 * deviations * deviations)
    };
    lobes.iter().map(one).sum()
}
