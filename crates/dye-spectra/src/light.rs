/// A peak of a spectrum: a split Gaussian.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lobe {
    height: f64,
    peak_um: f64,
    /// Standard deviations below and above the peak.
    below_um: f64,
    above_um: f64,
}

/// Creates a lobe from its height, and its peak and standard deviations below and above in nanometres.
pub(crate) const fn lobe(height: f64, peak_nm: f64, below_nm: f64, above_nm: f64) -> Lobe {
    Lobe { height, peak_um: peak_nm * 1e-3, below_um: below_nm * 1e-3, above_um: above_nm * 1e-3 }
}

/// Returns the sum of the lobes at a wavelength.
pub(crate) fn sum(lobes: &[Lobe], wavelength_um: f64) -> f64 {
    let one = |lobe: &Lobe| {
        let from_peak = wavelength_um - lobe.peak_um;
        let deviations = from_peak / if from_peak < 0.0 { lobe.below_um } else { lobe.above_um };
        lobe.height * libm::exp(-0.5 * deviations * deviations)
    };
    lobes.iter().map(one).sum()
}

/// Lamp of the microscope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lamp {
    /// A halogen lamp, modelled as a black body (Planck's law).
    Halogen {
        /// Colour temperature in kelvin, 1000 to 10 000. A microscope lamp at its rated voltage has 3200.
        temperature_k: f64,
    },
    /// A white phosphor-converted LED: CIE's LED-B3 (CIE 015:2018, 4103 K), within 0.04 of its peak.
    Led,
    /// An equal-energy spectrum.
    EqualEnergy,
}

impl Lamp {
    /// Returns the power at a wavelength in arbitrary units.
    pub(crate) fn power(self, wavelength_um: f64) -> f64 {
        match self {
            Self::Halogen { temperature_k } => {
                let [x, x0] = [wavelength_um, CENTRE_UM].map(|w| SECOND_RADIATION_UM_K / (w * temperature_k));
                let ratio = CENTRE_UM / wavelength_um;
                // Planck's law B(λ) ∝ λ⁻⁵ / (exp(c₂/λT) − 1), relative to its value at the centre.
                ratio * ratio * ratio * ratio * ratio * libm::expm1(x0) / libm::expm1(x)
            }
            Self::Led => sum(&LED_B3, wavelength_um),
            Self::EqualEnergy => 1.0,
        }
    }
}

/// Second radiation constant c₂ = hc/k, in µm·K (CODATA 2018).
const SECOND_RADIATION_UM_K: f64 = 14_387.768_77;
/// Centre of the visible range.
const CENTRE_UM: f64 = 0.55;

const LED_B3: [Lobe; 3] =
    [lobe(0.848, 448.2, 9.4, 9.1), lobe(0.199, 514.4, 50.1, 23.1), lobe(0.883, 592.2, 59.3, 56.9)];

/// Sensor of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensor {
    /// A colour sensor with an infrared filter: red, green and blue of a Nikon D5100 as the National Physical
    /// Laboratory measured them (Darrodi et al. 2015, doi:10.1364/JOSAA.32.000381; the copy in colour-science 0.4.7),
    /// within 0.02 of the peak.
    Camera,
    /// Three equal channels with the same sensitivity at all wavelengths: a monochrome camera without a filter.
    Panchromatic,
}

impl Sensor {
    /// Returns the sensitivity of the red, green and blue channel at a wavelength, 1 at its peak.
    pub(crate) fn sensitivity(self, wavelength_um: f64) -> [f64; 3] {
        match self {
            Self::Camera => [sum(&RED, wavelength_um), sum(&GREEN, wavelength_um), sum(&BLUE, wavelength_um)],
            Self::Panchromatic => [1.0; 3],
        }
    }
}

const RED: [Lobe; 4] = [
    lobe(0.060, 421.8, 3.7, 110.4),
    lobe(0.084, 527.7, 10.3, 11.2),
    lobe(0.961, 590.0, 9.1, 30.7),
    lobe(0.199, 652.2, 26.8, 11.2),
];
const GREEN: [Lobe; 4] = [
    lobe(0.156, 433.5, 9.5, 31.9),
    lobe(0.365, 481.3, 15.9, 71.1),
    lobe(0.615, 526.9, 19.3, 29.2),
    lobe(0.269, 570.5, 28.1, 20.5),
];
const BLUE: [Lobe; 3] = [lobe(0.464, 424.6, 4.2, 10.2), lobe(0.777, 448.9, 13.8, 45.1), lobe(0.302, 475.7, 23.0, 21.1)];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hotter_lamps_are_bluer_and_follow_wien() {
        let lamp = |temperature_k| Lamp::Halogen { temperature_k };
        assert!((lamp(3200.0).power(CENTRE_UM) - 1.0).abs() < 1e-15);
        assert!(lamp(3200.0).power(0.65) > lamp(3200.0).power(0.45));
        let blue_to_red = |t: f64| lamp(t).power(0.45) / lamp(t).power(0.65);
        assert!(blue_to_red(2800.0) < blue_to_red(3200.0) && blue_to_red(3200.0) < blue_to_red(5000.0));
        // λ_max·T = 2898 µm·K
        let hot = lamp(5000.0);
        let peak =
            (4000..7000).max_by(|a, b| hot.power(f64::from(*a) * 1e-4).total_cmp(&hot.power(f64::from(*b) * 1e-4)));
        assert!((f64::from(peak.unwrap()) * 1e-4 * 5000.0 - 2898.0).abs() < 1.0);
    }

    #[test]
    fn channel_peaks_match_the_measured_ones() {
        let measured_nm = [590, 530, 460];
        for (c, nm) in measured_nm.into_iter().enumerate() {
            let at = |nm: &i32| Sensor::Camera.sensitivity(f64::from(*nm) * 1e-3)[c];
            let peak = (400..=700).max_by(|a, b| at(a).total_cmp(&at(b))).unwrap();
            assert!((peak - nm).abs() <= 6, "{c}: {peak}");
            assert!((at(&peak) - 1.0).abs() < 0.03, "{c}: {}", at(&peak));
        }
    }
}
