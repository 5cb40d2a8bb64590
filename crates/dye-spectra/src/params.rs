use thiserror::Error;

use crate::light::{Lamp, Sensor};

/// Error of invalid parameters.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A number is out of range.
    #[error("{field} is {value}; it must be {accepted}")]
    OutOfRange {
        /// Path of the field, such as `lamp.temperature_k`.
        field: &'static str,
        /// The rejected value.
        value: f64,
        /// Description of the accepted values.
        accepted: &'static str,
    },
}

/// Returns an error unless `value` is finite and `holds` is true.
pub(crate) fn require(field: &'static str, value: f64, holds: bool, accepted: &'static str) -> Result<(), Error> {
    if value.is_finite() && holds { Ok(()) } else { Err(Error::OutOfRange { field, value, accepted }) }
}

/// Model of a channel's light as a function of dye amounts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mixing {
    /// The mean of 10^−A(λ) over the wavelengths of the channel.
    #[default]
    Spectral,
    /// 10 to the power of minus the mean absorbance, as in colour deconvolution: each dye is a vector of three
    /// absorbances. About four times as fast, and the light of slabs multiplies. Dark stain is too dark and too
    /// saturated.
    ThreeVectors,
}

/// Parameters of [`Colour`](crate::Colour): lamp, sensor and wavelengths.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourParams {
    /// Lamp. Default a halogen lamp of 3200 K, ours.
    pub lamp: Lamp,
    /// Sensor. Default a colour camera, ours; the paper's is monochrome with a filter of 0.570 µm.
    pub sensor: Sensor,
    /// Shortest wavelength in µm, at least 0.40 and below `to_um`. Default 0.40, ours.
    pub from_um: f64,
    /// Longest wavelength in µm, at most 0.70. Default 0.70, ours.
    pub to_um: f64,
    /// Number of wavelengths, 1 to 1024, at the centres of equal bands. Default 16, ours: within 0.003 of 151.
    pub wavelengths: usize,
    /// Model of a channel's light. Default spectral, ours.
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
        if let Lamp::Halogen { temperature_k: t } = lamp {
            require("lamp.temperature_k", t, (1e3..=1e4).contains(&t), "from 1000 to 10000")?;
        }
        require("to_um", to_um, to_um > 0.40 && to_um <= 0.70, "above 0.40 and at most 0.70")?;
        require("from_um", from_um, from_um >= 0.40 && from_um < to_um, "at least 0.40 and below to_um")?;
        require("wavelengths", wavelengths as f64, (1..=1024).contains(&wavelengths), "from 1 to 1024")
    }

    /// Iterates over the centres of equal bands.
    pub(crate) fn band_centres(&self, bands: usize) -> impl Iterator<Item = f64> + use<> {
        let (from, width) = (self.from_um, (self.to_um - self.from_um) / bands as f64);
        (0..bands).map(move |i| from + (i as f64 + 0.5) * width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_contain_field_value_and_range() {
        let default = ColourParams::default;
        let halogen = |temperature_k| ColourParams { lamp: Lamp::Halogen { temperature_k }, ..default() };
        type Case<'a> = (&'a dyn Fn(f64) -> ColourParams, &'a [f64], &'a str);
        let fields: [Case; 3] = [
            (
                &|v| ColourParams { from_um: v, to_um: 0.6, ..default() },
                &[0.0, 0.6, 0.7, f64::NAN],
                "from_um is {}; it must be at least 0.40 and below to_um",
            ),
            (
                &|v| ColourParams { to_um: v, ..default() },
                &[0.4, 0.71, f64::INFINITY, f64::NAN],
                "to_um is {}; it must be above 0.40 and at most 0.70",
            ),
            (&halogen, &[0.0, -3200.0, f64::NAN], "lamp.temperature_k is {}; it must be from 1000 to 10000"),
        ];
        for (params, values, message) in fields {
            for value in values {
                let error = params(*value).check().unwrap_err().to_string();
                assert_eq!(error, message.replace("{}", &value.to_string()));
            }
        }
        default().check().unwrap();
        for wavelengths in [0, 2000] {
            let error = ColourParams { wavelengths, ..default() }.check().unwrap_err().to_string();
            assert_eq!(error, format!("wavelengths is {wavelengths}; it must be from 1 to 1024"));
        }
    }
}
