use crate::error::{Error, require};
use crate::fractal::{Fractal, FractalParams, FractalRows};
use crate::illumination::{Illumination, Shade};
use crate::kernel::{self, single};
use crate::perlin::{Fade, PerlinParams};
use crate::rows::{Window, for_each_row};
use portable_numerics::random::{SplitMix64, unit};

/// Parameters of [`Background`].
#[derive(Debug, Clone, PartialEq)]
pub struct BackgroundParams {
    /// The level b of H(x, y) = b: transmitted light where nothing is in its way, in the caller's unit (a fraction of
    /// full scale, grey levels, electrons). Above 0. Default: 0.913 of full scale (ours: less half the scatter
    /// it is 229 of 255, the median of real fields; the paper's program uses 255 grey levels).
    pub level: f64,
    /// Uneven illumination. Default: the mean bowl of real fields (ours).
    pub illumination: Illumination,
    /// Scatter of light in the slide.
    pub scatter: Scatter,
}

/// Light scattered by the slide: c_pe · I_pe(x, y) of Eq. 9, taken from the level.
///
/// The defaults follow the clear parts of 26 real fields, less their quadratic bowls: smoothed with sigma 8, 16, 32 and
/// 64 px these have standard deviations of 0.70, 0.64, 0.54 and 0.38 of 255 (medians), and fields of the defaults 0.68,
/// 0.65, 0.57 and 0.40. Faint remains of cells count in the former, so the true scatter is no stronger.
#[derive(Debug, Clone, PartialEq)]
pub struct Scatter {
    /// The strength c_pe, in the unit of the level: from 0 (none) to less than the level. Default: 0.03 (ours,
    /// measured; the paper's program takes 10 of 255).
    pub strength: f64,
    /// Size of a cell of the coarsest layer, in pixels: 1 or more. Default: 240 (ours, measured; the paper gives none).
    pub cell_px: f64,
    /// The noise. Default: [`FractalParams::default`] (ours).
    pub noise: FractalParams,
    /// How the noise becomes I_pe ∈ [0, 1]. Default: [`UnitRange::Bound`] (ours).
    pub range: UnitRange,
}

impl Default for BackgroundParams {
    fn default() -> Self {
        Self { level: 0.913, illumination: Illumination::default(), scatter: Scatter::default() }
    }
}

impl Default for Scatter {
    fn default() -> Self {
        Self { strength: 0.03, cell_px: 240.0, noise: FractalParams::default(), range: UnitRange::default() }
    }
}

impl BackgroundParams {
    /// The paper's background with the values of its released program, in grey levels: b = 255, c_pe = 10, n = 0.02,
    /// Perlin's noise of 1985, each image stretched to [0, 1].
    pub fn paper() -> Self {
        Self {
            level: 255.0,
            illumination: Illumination::BorderDistance { exponent: 0.02 },
            scatter: Scatter {
                strength: 10.0,
                range: UnitRange::Extremes,
                noise: FractalParams {
                    base: PerlinParams { fade: Fade::Cubic, ..PerlinParams::default() },
                    ..FractalParams::default()
                },
                ..Scatter::default()
            },
        }
    }
}

/// The background of one field of view, under "Background illumination" in the paper: Eqs. 8 to 10.
///
/// It is fixed by its parameters, its size and its key, and any part of it can be had alone.
#[derive(Debug, Clone)]
pub struct Background {
    level: f32,
    strength: f32,
    shade: Shade,
    noise: Fractal,
    window: Window,
    /// Pixel of the noise that the field of view begins at.
    at: [i64; 2],
    scale: f32,
    offset: f32,
}

impl Background {
    /// The background of a field of view of `width` x `height` pixels.
    ///
    /// # Errors
    /// [`Error::NoLight`] if the scatter would take all the light, [`Error::DarkBowl`] if the illumination would,
    /// [`Error::EmptyField`] for a side of zero, [`Error::OutOfRange`] for any other field.
    pub fn new(params: &BackgroundParams, width: usize, height: usize, key: u64) -> Result<Self, Error> {
        let BackgroundParams { level, ref illumination, ref scatter } = *params;
        if width == 0 || height == 0 {
            return Err(Error::EmptyField { width, height });
        }
        // The logarithm of Eq. 10 is for normal numbers of f32; this leaves room for every illumination.
        require("level", level, (1e-20..=1e20).contains(&level), "between 1e-20 and 1e20")?;
        require("scatter.strength", scatter.strength, scatter.strength >= 0.0, "0 or more")?;
        require("scatter.cell_px", scatter.cell_px, scatter.cell_px >= 1.0, "1 or more")?;
        if single(level) - single(scatter.strength) <= 0.0 {
            return Err(Error::NoLight { level, strength: scatter.strength });
        }
        let noise = Fractal::new(&scatter.noise, key)?;
        let mut background = Self {
            level: single(level),
            strength: single(scatter.strength),
            shade: Shade::new(illumination, width, height)?,
            scale: noise.unit_scale(),
            offset: 0.5,
            noise,
            at: [0; 2],
            window: Window {
                // Keeps the corner pixel, where all fields would be zero, off the lattice.
                origin: [0, 1].map(|axis| unit(SplitMix64::word(!key, axis))),
                ..Window::with_cell_px(scatter.cell_px)
            },
        };
        if scatter.range == UnitRange::Extremes {
            let (low, high) = background.extremes();
            background.scale = unit_scale(low, high);
            background.offset = -low * background.scale;
        }
        Ok(background)
    }

    /// The same light over another part of the slide: the scatter is that of a field of view that begins at pixel `at`
    /// (column, row) of one without end, so that neighbouring fields of one key go on in each other. Scatter that is
    /// stretched to each image's extremes does not.
    #[must_use]
    pub fn on_slide(mut self, at: [i64; 2]) -> Self {
        self.at = at;
        self
    }

    /// Fills `image` with transmitted light (Eqs. 8 and 9), above 0 and at most level times the brightest
    /// illumination. `image` shows the part of the field of view that begins at pixel `first` (column, row):
    /// [0, 0] for all of it.
    ///
    /// # Panics
    /// If `width` is zero or does not divide the length of `image`, or if the part leaves the field of view.
    pub fn transmitted_into(&self, image: &mut [f32], width: usize, first: [usize; 2]) {
        self.fill(image, width, first, |_| {});
    }

    /// Fills `image` with the decadic logarithm of [`Background::transmitted_into`] (Eq. 10), ready for absorbances to
    /// be taken from it.
    ///
    /// # Panics
    /// As [`Background::transmitted_into`].
    pub fn log10_into(&self, image: &mut [f32], width: usize, first: [usize; 2]) {
        // Eq. 10: I_b = log10((H − c_pe · I_pe) · I_dⁿ)
        self.fill(image, width, first, kernel::log10);
    }

    fn fill(&self, image: &mut [f32], width: usize, first: [usize; 2], finish: impl Fn(&mut [f32])) {
        let height = image.len().checked_div(width).unwrap_or(0);
        assert!(
            first[0].saturating_add(width) <= self.shade.width()
                && first[1].saturating_add(height) <= self.shade.height(),
            "a part of {width} x {height} pixels at {first:?} leaves the field of {} x {}",
            self.shade.width(),
            self.shade.height()
        );
        let mut scatter = self.scatter_rows(width, first);
        let mut illumination = vec![0.0; width];
        for_each_row(image, width, |r, row| {
            row.fill(0.0);
            if self.strength > 0.0 {
                let (rows, window) = &mut scatter;
                rows.add_row(row, window.y(r));
                kernel::affine(row, self.scale, self.offset);
            }
            self.shade.row_into(&mut illumination, first[0], first[1] + r);
            kernel::transmit(row, &illumination, self.level, self.strength);
            finish(row);
        });
    }

    fn scatter_rows(&self, width: usize, first: [usize; 2]) -> (FractalRows<'_>, Window) {
        // No field of view reaches 2^63 pixels.
        let first = [0, 1].map(|axis| self.at[axis].saturating_add_unsigned(first[axis] as u64));
        let window = self.window.tile(first);
        (self.noise.rows(width, &window, 1.0), window)
    }

    /// The smallest and largest noise over the whole field of view.
    fn extremes(&self) -> (f32, f32) {
        let width = self.shade.width();
        let (mut rows, window) = self.scatter_rows(width, [0, 0]);
        let mut row = vec![0.0; width];
        (0..self.shade.height()).fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), r| {
            row.fill(0.0);
            rows.add_row(&mut row, window.y(r));
            kernel::extremes(&row, low, high)
        })
    }
}

/// How noise becomes the paper's I_pe(x, y) ∈ [0, 1].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UnitRange {
    /// n / (2 · bound) + ½ with the bound that analysis gives: a pure function of position, which depends on no other
    /// pixel. It fills the middle of the range; a single image hardly reaches 0 or 1.
    #[default]
    Bound,
    /// (n − min) / (max − min) over the whole field of view, as programs that normalise an image do: each image spans
    /// 0 to 1, so that two fields of one slide do not join.
    Extremes,
}

/// Rescales an image linearly so that its smallest value becomes 0 and its largest 1; a constant image becomes 0.
///
/// The result of a pixel depends on all others: not for tiles. [`UnitRange::Extremes`] does this for a background.
pub fn stretch_to_unit(image: &mut [f32]) {
    let (low, high) = kernel::extremes(image, f32::INFINITY, f32::NEG_INFINITY);
    let scale = unit_scale(low, high);
    for value in image {
        *value = (*value - low) * scale;
    }
}

/// 1 / (high − low), or 0 where there is nothing to stretch.
fn unit_scale(low: f32, high: f32) -> f32 {
    let range = high - low;
    if range > 0.0 { 1.0 / range } else { 0.0 }
}

#[cfg(test)]
mod tests;
