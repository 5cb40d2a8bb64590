use crate::{Error, Spectrum};

/// Largest size of an FFT grid, 2^14 px.
const MAX_SIZE: usize = 1 << 14;

/// Correlation between opposite edges below which [`Padding::Decorrelated`] treats them as independent.
const DECORRELATED: f64 = 0.01;

/// Parameters of a [`SpectralField`](crate::SpectralField).
#[derive(Debug, Clone, PartialEq)]
pub struct FieldParams {
    /// Width of a drawn field in pixels, 1 to 16384. Default 256 (ours: the paper gives no size).
    pub width: usize,
    /// Height of a drawn field in pixels, 1 to 16384. Default 256 (ours).
    pub height: usize,
    /// Power spectrum. Default [`Spectrum::BROWNIAN`] (the paper's, "Texture synthesis").
    pub spectrum: Spectrum,
    /// Relation of opposite edges. Default [`Padding::Decorrelated`] (ours).
    pub padding: Padding,
}

impl Default for FieldParams {
    fn default() -> Self {
        Self { width: 256, height: 256, spectrum: Spectrum::BROWNIAN, padding: Padding::Decorrelated }
    }
}

impl FieldParams {
    /// Returns the paper's Brownian noise: power that falls with f², on a grid as large as the image. Opposite edges
    /// match.
    #[must_use]
    pub fn paper() -> Self {
        Self { padding: Padding::Periodic, ..Self::default() }
    }

    /// Returns the size of the FFT grid, or an error for an invalid field.
    pub(crate) fn grid(&self) -> Result<[usize; 2], Error> {
        self.spectrum.check()?;
        let side = |field, size: usize| {
            if size == 0 || size > MAX_SIZE {
                return Err(Error::Size { field, value: size, largest: MAX_SIZE });
            }
            let margin = match self.padding {
                Padding::Periodic => return Ok(size),
                Padding::Margin { px } if px > MAX_SIZE => {
                    return Err(Error::Size { field: "padding.px", value: px, largest: MAX_SIZE });
                }
                Padding::Margin { px } => px,
                Padding::Decorrelated => self.spectrum.reach_px(DECORRELATED, size),
            };
            Ok(fast_length(size + margin))
        };
        Ok([side("width", self.width)?, side("height", self.height)?])
    }
}

/// Relation of a field to the periodic FFT grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Padding {
    /// The complete grid: opposite edges match. Sizes with large prime factors are slow.
    Periodic,
    /// A window of the grid. The grid is at least `px` larger than the window in both directions, rounded up to a fast
    /// FFT length.
    Margin {
        /// Smallest distance between opposite edges across the seam in pixels, 0 to 16384.
        px: usize,
    },
    /// A margin as long as the correlation length (autocorrelation of at least 0.01), at most as long as the window. A
    /// [`Spectrum::PowerLaw`] has no correlation length; its margin equals the window size.
    Decorrelated,
}

/// Returns the smallest even length 2^a 3^b of at least `least`.
fn fast_length(least: usize) -> usize {
    let mut best = least.next_power_of_two().max(2);
    let mut threes = 3;
    while 2 * threes < best {
        let twos = least.div_ceil(threes).next_power_of_two().max(2);
        best = best.min(threes * twos);
        threes *= 3;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_length_is_the_smallest_possible() {
        let slow = |least: usize| {
            let threes = (0..8).map(|threes| 3_usize.pow(threes));
            let lengths = threes.flat_map(|odd| (1..13).map(move |twos| odd << twos));
            lengths.filter(|&length| length >= least).min().unwrap()
        };
        for least in 1..2000 {
            assert_eq!(fast_length(least), slow(least), "{least}");
        }
    }

    #[test]
    fn paddings_determine_the_grid() {
        let grid = |padding, spectrum| {
            let params = FieldParams { width: 200, height: 61, spectrum, padding };
            params.grid().unwrap()
        };
        let gaussian = Spectrum::Gaussian { sigma_px: 7.0 };
        assert_eq!(grid(Padding::Periodic, gaussian), [200, 61]);
        assert_eq!(grid(Padding::Margin { px: 0 }, gaussian), [216, 64]);
        assert_eq!(grid(Padding::Margin { px: 20 }, gaussian), [256, 96]);
        // 2 σ √ln 100 = 30.04 px.
        assert_eq!(grid(Padding::Decorrelated, gaussian), [256, 96]);
        assert_eq!(grid(Padding::Decorrelated, Spectrum::BROWNIAN), [432, 128]);
    }

    #[test]
    fn invalid_sizes_are_errors() {
        for (width, height, px) in [(0, 5, 0), (5, 0, 0), (1 << 20, 5, 0), (5, 5, usize::MAX)] {
            let params = FieldParams { width, height, padding: Padding::Margin { px }, ..FieldParams::default() };
            assert!(matches!(params.grid(), Err(Error::Size { .. })));
        }
        let message = FieldParams { width: 0, ..FieldParams::default() }.grid().unwrap_err().to_string();
        assert_eq!(message, "width is 0 px; accepted: 1 to 16384");
    }
}
