use crate::{Error, Spectrum};

/// The longest side of an FFT grid, 2^14 px: half a gigapixel would be a mistake, not a texture.
const LONGEST_SIDE: usize = 1 << 14;

/// Correlation between opposite edges below which [`Padding::Decorrelated`] calls them independent.
const DECORRELATED: f64 = 0.01;

/// What a [`SpectralField`](crate::SpectralField) draws.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldParams {
    /// Width of a drawn field, px, 1 to 16384. Default 256 (ours: the paper gives no size).
    pub width: usize,
    /// Height of a drawn field, px, 1 to 16384. Default 256 (ours).
    pub height: usize,
    /// How variance is spread over spatial frequencies.
    /// Default [`Spectrum::BROWNIAN`] (the paper's, "Texture synthesis").
    pub spectrum: Spectrum,
    /// Whether the field tiles. Default [`Padding::Decorrelated`] (ours).
    pub padding: Padding,
}

impl Default for FieldParams {
    fn default() -> Self {
        Self { width: 256, height: 256, spectrum: Spectrum::BROWNIAN, padding: Padding::Decorrelated }
    }
}

impl FieldParams {
    /// The paper's Brownian noise: power falling with f², made on a grid as large as the image, so
    /// that opposite edges match.
    #[must_use]
    pub fn paper() -> Self {
        Self { padding: Padding::Periodic, ..Self::default() }
    }

    /// The sides of the FFT grid, or the field that forbids one.
    pub(crate) fn grid(&self) -> Result<[usize; 2], Error> {
        self.spectrum.check()?;
        let side = |field, size: usize| {
            if size == 0 || size > LONGEST_SIDE {
                return Err(Error::Size { field, value: size, largest: LONGEST_SIDE });
            }
            let margin = match self.padding {
                Padding::Periodic => return Ok(size),
                Padding::Margin { px } if px > LONGEST_SIDE => {
                    return Err(Error::Size { field: "padding.px", value: px, largest: LONGEST_SIDE });
                }
                Padding::Margin { px } => px,
                Padding::Decorrelated => self.spectrum.reach_px(DECORRELATED, size),
            };
            Ok(fast_length(size + margin))
        };
        Ok([side("width", self.width)?, side("height", self.height)?])
    }
}

/// How much of the periodic FFT grid a field shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Padding {
    /// All of it: the field tiles the plane, its left edge continues its right one. Sides with
    /// large prime factors are slow.
    Periodic,
    /// A window of it: the grid is at least `px` longer than the window in each direction, then
    /// rounded up to a length with a fast FFT.
    Margin {
        /// Least distance between opposite edges across the seam, px, 0 to 16384.
        px: usize,
    },
    /// A margin as long as the field remembers (autocorrelation below 0.01), at most as long as
    /// the window. A [`Spectrum::PowerLaw`] has no such length and gets the window's own.
    Decorrelated,
}

/// The next length of the form 2^a 3^b, even so that rows come in pairs.
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
    fn fast_lengths() {
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
    fn paddings_and_their_grids() {
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
    fn impossible_sizes_are_errors() {
        for (width, height, px) in [(0, 5, 0), (5, 0, 0), (1 << 20, 5, 0), (5, 5, usize::MAX)] {
            let params = FieldParams { width, height, padding: Padding::Margin { px }, ..FieldParams::default() };
            assert!(matches!(params.grid(), Err(Error::Size { .. })));
        }
        let message = FieldParams { width: 0, ..FieldParams::default() }.grid().unwrap_err().to_string();
        assert_eq!(message, "width is 0 px; accepted: 1 to 16384");
    }
}
