use crate::error::{Error, require};
use crate::light::{Lamp, Sensor};

/// How the light of a channel follows from the amounts of dye.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mixing {
    /// The mean over the wavelengths of the channel of 10^−A(λ).
    #[default]
    Spectral,
    /// 10 to the minus the mean absorbance, as colour deconvolution has it: each dye is one vector of three
    /// absorbances. Some four times as fast, and light of slabs multiplies; deep stain comes out too dark and too
    /// saturated.
    ThreeVectors,
}

/// A lamp, a camera, and the wavelengths at which they are taken.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourParams {
    /// What shines. Default a halogen lamp of 3200 K, ours.
    pub lamp: Lamp,
    /// What sees. Default a colour camera, ours: the paper's is monochrome behind a filter of 0.570 µm.
    pub sensor: Sensor,
    /// Shortest wavelength in µm, at least 0.40 and below `to_um`. Default 0.40, ours.
    pub from_um: f64,
    /// Longest wavelength in µm, at most 0.70. Default 0.70, ours.
    pub to_um: f64,
    /// Number of wavelengths, 1 to 1024, in the middles of as many equal bands. Default 16, ours: within 0.003 of 151.
    pub wavelengths: usize,
    /// How the light of a channel follows from the dyes. Default spectral, ours.
    pub mixing: Mixing,
}

impl Default for ColourParams {
    fn default() -> Self {
        Self {
            lamp: Lamp::Halogen { temperature_k: 3200.0 },
            sensor: Sensor::Camera,
            from_um: 0.40,
            to_um: 0.70,
            wavelengths: 16,
            mixing: Mixing::Spectral,
        }
    }
}

impl ColourParams {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let Self { lamp, sensor: _, from_um, to_um, wavelengths, mixing: _ } = *self;
        lamp.check()?;
        require("to_um", to_um, to_um > 0.40 && to_um <= 0.70, "above 0.40 and at most 0.70")?;
        require("from_um", from_um, from_um >= 0.40 && from_um < to_um, "at least 0.40 and below to_um")?;
        require("wavelengths", wavelengths as f64, (1..=1024).contains(&wavelengths), "from 1 to 1024")
    }

    /// Middles of equal bands.
    pub(crate) fn middles(&self, bands: usize) -> impl Iterator<Item = f64> + use<> {
        let (from, width) = (self.from_um, (self.to_um - self.from_um) / bands as f64);
        (0..bands).map(move |i| from + (i as f64 + 0.5) * width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_those_of_the_documentation() {
        let params = ColourParams::default();
        assert_eq!((params.from_um, params.to_um, params.wavelengths), (0.40, 0.70, 16));
        assert_eq!(params.lamp, Lamp::Halogen { temperature_k: 3200.0 });
        assert_eq!((params.sensor, params.mixing), (Sensor::Camera, Mixing::Spectral));
        params.check().unwrap();
    }

    #[test]
    fn refusals_name_field_value_and_range() {
        let default = ColourParams::default;
        let halogen = |temperature_k| ColourParams { lamp: Lamp::Halogen { temperature_k }, ..default() };
        let cases = [
            (ColourParams { wavelengths: 0, ..default() }, "wavelengths is 0; it must be from 1 to 1024"),
            (ColourParams { wavelengths: 2000, ..default() }, "wavelengths is 2000; it must be from 1 to 1024"),
            (ColourParams { from_um: 0.0, ..default() }, "from_um is 0; it must be at least 0.40 and below to_um"),
            (ColourParams { from_um: 0.7, ..default() }, "from_um is 0.7; it must be at least 0.40 and below to_um"),
            (
                ColourParams { from_um: 0.6, to_um: 0.5, ..default() },
                "from_um is 0.6; it must be at least 0.40 and below to_um",
            ),
            (
                ColourParams { from_um: f64::NAN, ..default() },
                "from_um is NaN; it must be at least 0.40 and below to_um",
            ),
            (
                ColourParams { to_um: f64::INFINITY, ..default() },
                "to_um is inf; it must be above 0.40 and at most 0.70",
            ),
            (ColourParams { to_um: f64::NAN, ..default() }, "to_um is NaN; it must be above 0.40 and at most 0.70"),
            (halogen(0.0), "lamp.temperature_k is 0; it must be from 1000 to 10000"),
            (halogen(-3200.0), "lamp.temperature_k is -3200; it must be from 1000 to 10000"),
            (halogen(f64::NAN), "lamp.temperature_k is NaN; it must be from 1000 to 10000"),
        ];
        for (params, message) in cases {
            assert_eq!(params.check().unwrap_err().to_string(), message);
        }
    }
}
