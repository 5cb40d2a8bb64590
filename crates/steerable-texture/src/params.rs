use crate::Error;

/// Largest side of an image, px.
const MAX_SIDE: usize = 1 << 13;

/// Smallest side of the low-pass residual, px.
const MIN_RESIDUAL: usize = 4;

/// Parameters of a [`Pyramid`](crate::Pyramid).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct PyramidParams {
    /// Number of scales, 1 to 8, each an octave. Default 4 (the paper's).
    pub scales: usize,
    /// Number of orientations, 2 to 8. Default 4 (the paper's).
    pub orientations: usize,
}

impl Default for PyramidParams {
    fn default() -> Self {
        Self { scales: 4, orientations: 4 }
    }
}

impl PyramidParams {
    pub(crate) fn check(&self) -> Result<(), Error> {
        in_range("scales", self.scales, 1, 8, "1 to 8")?;
        in_range("orientations", self.orientations, 2, 8, "2 to 8")
    }

    /// Returns an error if an image of this size is too small for the scales, or a side is not a power of two.
    pub(crate) fn check_size(&self, width: usize, height: usize, residual: usize) -> Result<(), Error> {
        let least = residual.max(MIN_RESIDUAL).next_power_of_two() << self.scales;
        for (field, value) in [("width", width), ("height", height)] {
            if !value.is_power_of_two() || !(least..=MAX_SIDE).contains(&value) {
                return Err(Error::Side { field, value, least, most: MAX_SIDE });
            }
        }
        Ok(())
    }
}

/// Parameters of [`Statistics`](crate::Statistics).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct TextureParams {
    /// Scales and orientations. Default: that of [`PyramidParams`].
    pub pyramid: PyramidParams,
    /// Side of the square windows of autocorrelation, in pixels of each scale: odd, 3 to 15. Default 7 (the paper's).
    pub neighbourhood: usize,
}

impl Default for TextureParams {
    fn default() -> Self {
        Self { pyramid: PyramidParams::default(), neighbourhood: 7 }
    }
}

impl TextureParams {
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.pyramid.check()?;
        let accepted = "odd numbers from 3 to 15";
        if self.neighbourhood.is_multiple_of(2) {
            return Err(Error::Parameter { field: "neighbourhood", value: self.neighbourhood, accepted });
        }
        in_range("neighbourhood", self.neighbourhood, 3, 15, accepted)
    }

    /// Returns the smallest accepted side of an image in pixels: the low-pass residual contains the window of
    /// autocorrelation.
    ///
    /// ```
    /// assert_eq!(steerable_texture::TextureParams::default().least_side(), 128);
    /// ```
    #[must_use]
    pub fn least_side(&self) -> usize {
        self.neighbourhood.next_power_of_two() << self.pyramid.scales
    }

    /// Returns the largest distance of the autocorrelation in pixels of a scale.
    pub(crate) fn radius(&self) -> usize {
        self.neighbourhood / 2
    }

    pub(crate) fn mismatch(&self, index: usize) -> Error {
        let PyramidParams { scales, orientations } = self.pyramid;
        Error::Mismatch { index, scales, orientations, neighbourhood: self.neighbourhood }
    }
}

/// Parameters of a [`Synthesizer`](crate::Synthesizer).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SynthesisParams {
    /// Parameters of the statistics. Default: that of [`TextureParams`].
    pub texture: TextureParams,
    /// Number of times that all statistics are imposed, 1 to 1000. Default 25 (ours: the paper uses about 50).
    pub iterations: usize,
}

impl Default for SynthesisParams {
    fn default() -> Self {
        Self { texture: TextureParams::default(), iterations: 25 }
    }
}

impl SynthesisParams {
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.texture.check()?;
        in_range("iterations", self.iterations, 1, 1000, "1 to 1000")
    }
}

fn in_range(field: &'static str, value: usize, least: usize, most: usize, accepted: &'static str) -> Result<(), Error> {
    if (least..=most).contains(&value) { Ok(()) } else { Err(Error::Parameter { field, value, accepted }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_as_documented() {
        let SynthesisParams { texture, iterations } = SynthesisParams::default();
        assert_eq!(texture.pyramid, PyramidParams { scales: 4, orientations: 4 });
        assert_eq!((texture.neighbourhood, iterations), (7, 25));
    }

    #[test]
    fn invalid_parameters_are_errors() {
        let invalid = |pyramid: PyramidParams, neighbourhood| {
            let texture = TextureParams { pyramid, neighbourhood };
            texture.check().unwrap_err().to_string()
        };
        let pyramid = PyramidParams::default();
        assert_eq!(invalid(PyramidParams { scales: 9, ..pyramid }, 7), "scales is 9; accepted: 1 to 8");
        assert_eq!(invalid(PyramidParams { orientations: 1, ..pyramid }, 7), "orientations is 1; accepted: 2 to 8");
        assert_eq!(invalid(pyramid, 4), "neighbourhood is 4; accepted: odd numbers from 3 to 15");
        assert_eq!(invalid(pyramid, 17), "neighbourhood is 17; accepted: odd numbers from 3 to 15");
        let none = SynthesisParams { iterations: 0, ..SynthesisParams::default() };
        assert_eq!(none.check().unwrap_err().to_string(), "iterations is 0; accepted: 1 to 1000");
        for (width, height, field) in
            [(32, 128, "width"), (128, 96, "height"), (0, 64, "width"), (64, 1 << 14, "height")]
        {
            let error = pyramid.check_size(width, height, 1).unwrap_err();
            assert!(matches!(error, Error::Side { field: found, least: 64, .. } if found == field), "{error}");
        }
    }
}
