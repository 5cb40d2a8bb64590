use crate::error::{Error, require};
use crate::fractal::{Fractal, FractalParams, FractalRows};
use crate::illumination::{Illumination, IlluminationField};
use crate::kernel::{self, single};
use crate::perlin::{Fade, PerlinParams};
use crate::rows::{Window, for_each_row};
use portable_numerics::random::{SplitMix64, unit};

/// Parameters of [`Background`].
#[derive(Debug, Clone, PartialEq)]
pub struct BackgroundParams {
    /// The level b of H(x, y) = b: the transmitted light of an empty slide, in any unit (fraction of full scale, grey
    /// levels, electrons), above 0. Default: 0.913 of full scale (ours: minus half of the texture's strength it is 229
    /// of 255, the median of real fields; the paper's program uses 255 grey levels).
    pub level: f64,
    /// Uneven illumination. Default: the mean quadratic falloff of real fields (ours).
    pub illumination: Illumination,
    /// Background texture.
    pub texture: BackgroundTexture,
}

/// Smooth random texture of the background: c_pe · I_pe(x, y) of Eq. 9, subtracted from the level.
///
/// The defaults are measured in the empty parts of 26 real fields, without their quadratic falloff. Smoothed with sigma
/// 8, 16, 32 and 64 px, these have standard deviations of 0.70, 0.64, 0.54 and 0.38 of 255 (medians); fields of the
/// defaults have 0.68, 0.65, 0.57 and 0.40. Faint cell remains contribute to the former: the actual texture is at most
/// this strong.
#[derive(Debug, Clone, PartialEq)]
pub struct BackgroundTexture {
    /// The strength c_pe in the unit of the level, from 0 (none) to less than the level. Default: 0.03 (ours, measured;
    /// the paper's program uses 10 of 255).
    pub strength: f64,
    /// Cell size of the coarsest layer in pixels, at least 1. Default: 240 (ours, measured; the paper gives none).
    pub cell_px: f64,
    /// The noise. Default: [`FractalParams::default`] (ours).
    pub noise: FractalParams,
    /// Normalisation of the noise to I_pe ∈ [0, 1]. Default: [`UnitRange::Bound`] (ours).
    pub range: UnitRange,
}

impl Default for BackgroundParams {
    fn default() -> Self {
        Self { level: 0.913, illumination: Illumination::default(), texture: BackgroundTexture::default() }
    }
}

impl Default for BackgroundTexture {
    fn default() -> Self {
        Self { strength: 0.03, cell_px: 240.0, noise: FractalParams::default(), range: UnitRange::default() }
    }
}

impl BackgroundParams {
    /// Returns the paper's background with the values of its released program, in grey levels: b = 255, c_pe = 10, n =
    /// 0.02, Perlin's noise of 1985, each image normalised to [0, 1].
    pub fn paper() -> Self {
        Self {
            level: 255.0,
            illumination: Illumination::BorderDistance { exponent: 0.02 },
            texture: BackgroundTexture {
                strength: 10.0,
                range: UnitRange::Extremes,
                noise: FractalParams {
                    base: PerlinParams { fade: Fade::Cubic, ..PerlinParams::default() },
                    ..FractalParams::default()
                },
                ..BackgroundTexture::default()
            },
        }
    }
}

/// The background of a field of view, "Background illumination" in the paper: Eqs. 8 to 10.
///
/// It is a function of its parameters, size and key. Any part of it can be computed separately.
#[derive(Debug, Clone)]
pub struct Background {
    level: f32,
    strength: f32,
    illumination_field: IlluminationField,
    noise: Fractal,
    window: Window,
    /// Position of the field of view on the slide, in pixels.
    at: [i64; 2],
    scale: f32,
    offset: f32,
}

impl Background {
    /// Creates the background of a field of view of `width` x `height` pixels.
    ///
    /// # Errors
    /// [`Error::NoLight`] if the texture's strength reaches the level, [`Error::NegativeIllumination`] if the
    /// illumination reaches zero, [`Error::EmptyField`] for a size of zero, [`Error::OutOfRange`] for any other field.
    pub fn new(params: &BackgroundParams, width: usize, height: usize, key: u64) -> Result<Self, Error> {
        let BackgroundParams { level, ref illumination, ref texture } = *params;
        if width == 0 || height == 0 {
            return Err(Error::EmptyField { width, height });
        }
        // The logarithm of Eq. 10 requires normal f32 numbers, for every illumination.
        require("level", level, (1e-20..=1e20).contains(&level), "between 1e-20 and 1e20")?;
        require("texture.strength", texture.strength, texture.strength >= 0.0, "at least 0")?;
        require("texture.cell_px", texture.cell_px, texture.cell_px >= 1.0, "at least 1")?;
        if single(level) - single(texture.strength) <= 0.0 {
            return Err(Error::NoLight { level, strength: texture.strength });
        }
        let noise = Fractal::new(&texture.noise, key)?;
        let mut background = Self {
            level: single(level),
            strength: single(texture.strength),
            illumination_field: IlluminationField::new(illumination, width, height)?,
            scale: noise.unit_scale(),
            offset: 0.5,
            noise,
            at: [0; 2],
            window: Window {
                // Shifts the corner pixel off the lattice, where the noise of all fields is zero.
                origin: [0, 1].map(|axis| unit(SplitMix64::word(!key, axis))),
                ..Window::with_cell_px(texture.cell_px)
            },
        };
        if texture.range == UnitRange::Extremes {
            let (low, high) = background.extremes();
            background.scale = unit_scale(low, high);
            background.offset = -low * background.scale;
        }
        Ok(background)
    }

    /// Moves the field of view: its texture begins at pixel `at` (column, row) of an infinite slide. Neighbouring
    /// fields of one key continue each other, except with [`UnitRange::Extremes`].
    #[must_use]
    pub fn on_slide(mut self, at: [i64; 2]) -> Self {
        self.at = at;
        self
    }

    /// Fills `image` with transmitted light (Eqs. 8 and 9), above 0 and at most level times the brightest illumination.
    /// `image` is the part of the field of view that begins at pixel `first` (column, row); [0, 0] for the complete
    /// field.
    ///
    /// # Panics
    /// If `width` is zero or does not divide the length of `image`, or if the part exceeds the field of view.
    pub fn transmitted_into(&self, image: &mut [f32], width: usize, first: [usize; 2]) {
        self.fill(image, width, first, |_| {});
    }

    /// Fills `image` with the decadic logarithm of [`Background::transmitted_into`] (Eq. 10), from which absorbances
    /// are subtracted.
    ///
    /// # Panics
    /// See [`Background::transmitted_into`].
    pub fn log10_into(&self, image: &mut [f32], width: usize, first: [usize; 2]) {
        // Eq. 10: I_b = log10((H − c_pe · I_pe) · I_dⁿ)
        self.fill(image, width, first, kernel::log10);
    }

    fn fill(&self, image: &mut [f32], width: usize, first: [usize; 2], finish: impl Fn(&mut [f32])) {
        let height = image.len().checked_div(width).unwrap_or(0);
        assert!(
            first[0].saturating_add(width) <= self.illumination_field.width()
                && first[1].saturating_add(height) <= self.illumination_field.height(),
            "a part of {width} x {height} pixels at {first:?} exceeds the field of {} x {}",
            self.illumination_field.width(),
            self.illumination_field.height()
        );
        let mut texture = self.texture_rows(width, first);
        let mut illumination = vec![0.0; width];
        for_each_row(image, width, |r, row| {
            row.fill(0.0);
            if self.strength > 0.0 {
                let (rows, window) = &mut texture;
                rows.add_row(row, window.y(r));
                kernel::affine(row, self.scale, self.offset);
            }
            self.illumination_field.row_into(&mut illumination, first[0], first[1] + r);
            kernel::transmit(row, &illumination, self.level, self.strength);
            finish(row);
        });
    }

    fn texture_rows(&self, width: usize, first: [usize; 2]) -> (FractalRows<'_>, Window) {
        // Positions in a field of view are below 2^63.
        let first = [0, 1].map(|axis| self.at[axis].saturating_add_unsigned(first[axis] as u64));
        let window = self.window.tile(first);
        (self.noise.rows(width, &window, 1.0), window)
    }

    /// Returns the smallest and largest noise over the complete field of view.
    fn extremes(&self) -> (f32, f32) {
        let width = self.illumination_field.width();
        let (mut rows, window) = self.texture_rows(width, [0, 0]);
        let mut row = vec![0.0; width];
        (0..self.illumination_field.height()).fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), r| {
            row.fill(0.0);
            rows.add_row(&mut row, window.y(r));
            kernel::extremes(&row, low, high)
        })
    }
}

/// Normalisation of noise to the paper's I_pe(x, y) ∈ [0, 1].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UnitRange {
    /// n / (2 · bound) + ½ with the analytic bound: a pure function of position, independent of other pixels. Values
    /// concentrate at the centre of the range; an image hardly reaches 0 or 1.
    #[default]
    Bound,
    /// (n − min) / (max − min) over the complete field of view. Each image spans 0 to 1; neighbouring fields of a slide
    /// do not match.
    Extremes,
}

/// Rescales an image linearly: its smallest value becomes 0 and its largest 1. A constant image becomes 0.
///
/// Each pixel depends on all others; do not apply it to tiles. [`UnitRange::Extremes`] normalises a background in this
/// way.
pub fn stretch_to_unit(image: &mut [f32]) {
    let (low, high) = kernel::extremes(image, f32::INFINITY, f32::NEG_INFINITY);
    let scale = unit_scale(low, high);
    for value in image {
        *value = (*value - low) * scale;
    }
}

/// Returns 1 / (high − low), or 0 for an empty range.
fn unit_scale(low: f32, high: f32) -> f32 {
    let range = high - low;
    if range > 0.0 { 1.0 / range } else { 0.0 }
}

#[cfg(test)]
mod tests;
