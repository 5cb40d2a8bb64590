//! Sections of a recipe about the microscope: field, focus, background, light, optics.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::number::Number;

/// The image: its size and the size of its pixels. Counts of cells and debris are those of a whole field, whatever its size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Field {
    /// Width in pixels, 16 to 32768; drawn once a field.
    pub width_px: Number,
    /// Height in pixels, 16 to 32768; drawn once a field.
    pub height_px: Number,
    /// Size of a pixel in the object, µm, 0.05 to 4 (the paper's: 0.25). Not looked at where `magnification` is given.
    pub pixel_um: Number,
    /// Magnification between slide and sensor, relay optics included, up to 400, or 0 if `pixel_um` says it all. A pixel is then
    /// `camera.pixel_um` times `camera.binning_px`, divided by this: 6.45 µm at 40 · 0.645 are 0.25 µm.
    pub magnification: Number,
}

impl Default for Field {
    fn default() -> Self {
        Self { width_px: 1376.0.into(), height_px: 1038.0.into(), pixel_um: 0.25.into(), magnification: 0.0.into() }
    }
}

/// Focal planes. A plane is where the stage stands; what is in focus there lies deeper or higher by the ratio of the two
/// indices of refraction, if the optics know them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Focus {
    /// Number of focal planes, 1 to 1024: 1 is an image, more are a focus stack.
    pub planes: Number,
    /// Travel of the stage between planes, µm, 0.001 to 100.
    pub step_um: Number,
    /// Travel of the stage to the middle plane, µm, -100 to 100; at 0 the middle of the slide is in focus, at more what
    /// lies nearer to the objective.
    pub centre_um: Number,
    /// What becomes of the planes.
    pub picture: Picture,
    /// How much of its noise a fused picture shares with the next pixel of the row, 0 to 0.5.
    pub fused_noise_across: Number,
    /// The same with the next pixel of the column, 0 to 0.5.
    pub fused_noise_down: Number,
    /// How much more it shares with the next pixel down to the right than with that down to the left (half of the
    /// difference), -0.1 to 0.1: pictures that were turned or shifted by parts of a pixel have some.
    pub fused_noise_skew: Number,
}

/// What becomes of the planes of a focus stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Picture {
    /// Each is a picture.
    Planes,
    /// They are fused to one picture of extended focus: everything as the plane that shows it sharpest, with noise that
    /// neighbouring pixels share.
    Extended,
}

impl Default for Focus {
    fn default() -> Self {
        Self {
            planes: 1.0.into(),
            step_um: 0.5.into(),
            centre_um: 0.0.into(),
            picture: Picture::Planes,
            fused_noise_across: 0.2.into(),
            fused_noise_down: 0.4.into(),
            fused_noise_skew: 0.0.into(),
        }
    }
}

/// How evenly the lamp lights the field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Illumination {
    /// The paper's: distance to the image's border to the power of an exponent (Eq. 8).
    Border {
        /// The exponent n, 0 (even) to 2; the released value is 0.02.
        #[serde(default = "defaults::exponent")]
        exponent: Number,
    },
    /// A smooth bowl, 1 − x2·x² − y2·y² over −1..1, as measured on real fields.
    Bowl {
        /// Fall towards the left and right border, as a fraction of the centre, 0 to 0.45.
        #[serde(default = "defaults::x2")]
        x2: Number,
        /// Fall towards the upper and lower border, as a fraction of the centre, 0 to 0.45.
        #[serde(default = "defaults::y2")]
        y2: Number,
        /// Where the top of the bowl lies, as a fraction of half the field to either side, 0 to 0.9.
        #[serde(default = "defaults::off_centre")]
        off_centre: Number,
    },
}

/// What the fields of an illumination, a light and of optics are where a recipe names their kind alone.
mod defaults {
    use super::{Imaging, Mixing, Number, Rendition};

    pub(super) fn wavelength_um() -> Number {
        0.57.into()
    }

    pub(super) fn bandwidth_um() -> Number {
        0.01.into()
    }

    pub(super) fn lamp_k() -> Number {
        3200.0.into()
    }

    pub(super) fn mixing() -> Mixing {
        Mixing::Spectral
    }

    pub(super) fn chromatic_um() -> Number {
        0.3.into()
    }

    pub(super) fn rendition() -> Rendition {
        Rendition::Display
    }

    pub(super) fn na() -> Number {
        0.95.into()
    }

    pub(super) fn condenser_na() -> Number {
        0.41.into()
    }

    pub(super) fn mount_index() -> Number {
        1.515.into()
    }

    pub(super) fn immersion_index() -> Number {
        1.0.into()
    }

    pub(super) fn nothing() -> Number {
        0.0.into()
    }

    pub(super) fn extra_blur_um() -> Number {
        0.16.into()
    }

    pub(super) fn stray_light() -> Number {
        Number::uniform(0.01, 0.04)
    }

    pub(super) fn oversampling() -> Number {
        2.0.into()
    }

    pub(super) fn slab_um() -> Number {
        0.25.into()
    }

    pub(super) fn imaging() -> Imaging {
        Imaging::Product
    }

    pub(super) fn directions() -> Number {
        64.0.into()
    }

    pub(super) fn sigma_xy_um() -> Number {
        0.225.into()
    }

    pub(super) fn sigma_z_um_per_um() -> Number {
        0.25.into()
    }

    pub(super) fn exponent() -> Number {
        0.02.into()
    }

    pub(super) fn x2() -> Number {
        Number::uniform(0.01, 0.055)
    }

    pub(super) fn y2() -> Number {
        Number::uniform(0.0, 0.025)
    }

    pub(super) fn off_centre() -> Number {
        Number::uniform(0.0, 0.25)
    }
}

/// The empty slide, as the lamp shows it (Eqs. 8–10).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Background {
    /// Light of the empty slide as a fraction of the camera's largest grey level, 0.01 to 1.2 (b of Eq. 8).
    pub level: Number,
    /// How evenly the lamp lights the field.
    pub illumination: Illumination,
    /// Strength of Perlin noise in the light, as a fraction of the largest grey level, 0 to 0.5 (c_pe of Eq. 9).
    pub scatter: Number,
    /// Size of the cells of that noise, µm, 1 to 10000.
    pub scatter_um: Number,
}

impl Default for Background {
    fn default() -> Self {
        Self {
            level: Number::normal(0.90, 0.055).at_least(0.74).at_most(0.985),
            illumination: Illumination::Bowl {
                x2: defaults::x2(),
                y2: defaults::y2(),
                off_centre: defaults::off_centre(),
            },
            scatter: Number::uniform(0.015, 0.045),
            scatter_um: 60.0.into(),
        }
    }
}

/// The light: one wavelength or three colours.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Light {
    /// A grey image in the light of one interference filter.
    Monochrome {
        /// Wavelength, µm, 0.4 to 0.7 (the paper's: 0.57, where nuclei stand out most).
        #[serde(default = "defaults::wavelength_um")]
        wavelength_um: Number,
        /// Width of the filter's band, µm, 0 to 0.1.
        #[serde(default = "defaults::bandwidth_um")]
        bandwidth_um: Number,
    },
    /// A colour image: halogen lamp, colour camera, white balance on the empty slide.
    Colour {
        /// Temperature of the lamp, K, 2000 to 10000.
        #[serde(default = "defaults::lamp_k")]
        lamp_k: Number,
        /// How dyes make colours.
        #[serde(default = "defaults::mixing")]
        mixing: Mixing,
        /// How much farther from the objective red light (0.65 µm) comes to focus than green (0.55 µm), in µm of stage
        /// travel, -10 to 10; what an apochromat leaves is below one.
        #[serde(default = "defaults::chromatic_um")]
        chromatic_um: Number,
        /// How the camera's colours are written.
        #[serde(default = "defaults::rendition")]
        rendition: Rendition,
    },
}

impl Default for Light {
    fn default() -> Self {
        Self::Monochrome { wavelength_um: defaults::wavelength_um(), bandwidth_um: defaults::bandwidth_um() }
    }
}

/// How dyes make colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mixing {
    /// Beer and Lambert's law at sixteen wavelengths, averaged over the band of each channel.
    Spectral,
    /// One absorbance for each dye and channel: faster; dark stains turn out too dark.
    ThreeVectors,
    /// Sixteen wavelengths, each imaged by itself: the reference for the others, and several times as slow.
    PerWavelength,
}

/// How the camera's colours are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Rendition {
    /// The three channels of the sensor, balanced and in proportion to the light: for measuring.
    Raw,
    /// The same three channels, balanced, under the tone curve of sRGB: what most microscope cameras save.
    Display,
    /// Colours as an eye would see them: sRGB primaries and tone curve.
    Srgb,
}

/// How light spreads between slide and sensor.
#[expect(clippy::large_enum_variant, reason = "one a recipe")]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Optics {
    /// Partially coherent bright field: what every slab transmits, filtered by the weak-object transfer function.
    BrightField {
        /// Numerical aperture of the objective, 0.05 to 1.6, at most `immersion_index` and below `mount_index`.
        #[serde(default = "defaults::na")]
        na: Number,
        /// Numerical aperture to which the condenser is opened, 0.05 to 1.6 and below `mount_index`; what exceeds `na` is
        /// lost light. 0.41 gives 0.25 µm of blur for each µm of stage travel, the paper's Fig. 10.
        #[serde(default = "defaults::condenser_na")]
        condenser_na: Number,
        /// Refractive index of the mountant in which the cells lie, 1 to 2.
        #[serde(default = "defaults::mount_index")]
        mount_index: Number,
        /// Refractive index between cover glass and objective, 1 to 2: 1 for a dry lens.
        #[serde(default = "defaults::immersion_index")]
        immersion_index: Number,
        /// How much thicker the cover glass is than the lens was made for, µm, -50 to 50.
        #[serde(default = "defaults::nothing")]
        cover_error_um: Number,
        /// Spherical aberration of the objective, waves (root mean square), -1 to 1.
        #[serde(default = "defaults::nothing")]
        spherical: Number,
        /// Coma along the rows, waves (root mean square), -1 to 1.
        #[serde(default = "defaults::nothing")]
        coma: Number,
        /// Astigmatism between rows and columns, waves (root mean square), -1 to 1.
        #[serde(default = "defaults::nothing")]
        astigmatism: Number,
        /// Standard deviation of further spread, µm, 0 to 10: relay optics, charge diffusion, vibration. 0.16 makes edges as wide as
        /// the paper measured them, 0.9 px.
        #[serde(default = "defaults::extra_blur_um")]
        extra_blur_um: Number,
        /// Share of an empty field's light that lies evenly over the picture, 0 to 0.5: glare.
        #[serde(default = "defaults::stray_light")]
        stray_light: Number,
        /// Samples of the slide along the side of a pixel, 1 to 4.
        #[serde(default = "defaults::oversampling")]
        oversampling: Number,
        /// How light is followed through the slide.
        #[serde(default = "defaults::imaging")]
        imaging: Imaging,
        /// Thickness of the slabs between which `abbe` carries light, µm, 0.1 to 10; `product` knows every depth.
        #[serde(default = "defaults::slab_um")]
        slab_um: Number,
        /// Directions of light that `abbe` follows, 1 to 65536.
        #[serde(default = "defaults::directions")]
        directions: Number,
    },
    /// The paper's: Gaussians on the absorbance (Eqs. 13, 14, Fig. 10).
    Gaussian {
        /// Standard deviation of the spread in the image plane, µm, 0 to 20 (the paper's: 0.9 px of 0.25 µm).
        #[serde(default = "defaults::sigma_xy_um")]
        sigma_xy_um: Number,
        /// Growth of the spread with distance from focus, µm per µm, 0 to 10. The paper's calibration is 0.25, that is
        /// one pixel of 0.25 µm per µm; its sentence read as "µm per µm" would be 1.
        #[serde(default = "defaults::sigma_z_um_per_um")]
        sigma_z_um_per_um: Number,
    },
}

/// How light is followed through the slide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Imaging {
    /// The product over all objects of what each transmits, filtered by the weak-object transfer function: right to
    /// one or two per cent of the contrast.
    Product,
    /// Abbe's integration over the source, light carried from slab to slab: the reference, thousands of times as slow and for
    /// small fields.
    Abbe,
}

impl Default for Optics {
    fn default() -> Self {
        Self::BrightField {
            na: defaults::na(),
            condenser_na: defaults::condenser_na(),
            mount_index: defaults::mount_index(),
            immersion_index: defaults::immersion_index(),
            cover_error_um: defaults::nothing(),
            spherical: defaults::nothing(),
            coma: defaults::nothing(),
            astigmatism: defaults::nothing(),
            extra_blur_um: defaults::extra_blur_um(),
            stray_light: defaults::stray_light(),
            oversampling: defaults::oversampling(),
            slab_um: defaults::slab_um(),
            imaging: defaults::imaging(),
            directions: defaults::directions(),
        }
    }
}

impl Optics {
    /// The paper's Gaussians.
    #[must_use]
    pub fn gaussian() -> Self {
        Self::Gaussian { sigma_xy_um: defaults::sigma_xy_um(), sigma_z_um_per_um: defaults::sigma_z_um_per_um() }
    }
}
