//! Sections of a recipe about the microscope: field, focus, background, light, optics.

use super::number::{Count, Number};
use super::section::section;

section! {
    /// The image: its size and the size of its pixels. Densities of cells and debris apply to its
    /// area; objects of a density also lie in a margin of 60 µm round it, from which they reach into the image.
    pub struct Field {
        /// Width; drawn once a field.
        width_px: Count = 1376, 16..=32768, "pixels";
        /// Height; drawn once a field.
        height_px: Count = 1038, 16..=32768, "pixels";
        /// Size of a pixel in the object (the paper's: 0.25). Not looked at where `magnification` is given.
        pixel_um: Number = 0.25, 0.05..=4, "µm";
        /// Magnification between slide and sensor, relay optics included, or 0 if `pixel_um` says it all. A pixel is then
        /// `camera.pixel_um` times `camera.binning_px`, divided by this: 6.45 µm at 40 · 0.645 are 0.25 µm.
        magnification: Number = 0.0, 0..=400;
    }
}

section! {
    /// Focal planes. A plane is where the stage stands; what is in focus there lies deeper or higher by the ratio of the two
    /// indices of refraction, if the optics know them.
    pub struct Focus, drawn as pub(crate) DrawnFocus {
        /// Number of focal planes: 1 is an image, more are a focus stack.
        planes: Count = 1, 1..=1024;
        /// Travel of the stage between planes.
        step_um: Number = 0.5, 0.001..=100, "µm";
        /// Travel of the stage to the middle plane; at 0 the middle of the slide is in focus, at more what lies nearer
        /// to the objective.
        centre_um: Number = 0.0, -100..=100, "µm";
        /// What becomes of the planes.
        output: FocusOutput = FocusOutput::Planes;
        /// How much of its noise a fused picture shares with the next pixel of the row.
        noise_correlation_x: Number = 0.2, 0..=0.5;
        /// The same with the next pixel of the column.
        noise_correlation_y: Number = 0.4, 0..=0.5;
        /// How much more it shares with the next pixel down to the right than with that down to the left (half of the
        /// difference): pictures that were turned or shifted by parts of a pixel have some.
        noise_correlation_diagonal: Number = 0.0, -0.1..=0.1;
    }
}

section! {
    /// What becomes of the planes of a focus stack.
    pub enum FocusOutput {
        /// Each is a picture.
        Planes,
        /// They are fused to one picture of extended focus: everything as the plane that shows it sharpest, with noise that
        /// neighbouring pixels share.
        Edf,
    }
}

section! {
    /// How evenly the lamp lights the field.
    pub enum Illumination, by default Quadratic {
        /// The paper's: distance to the image's border to the power of an exponent (Eq. 8).
        Border(Border),
        /// A smooth bowl, 1 − x2·x² − y2·y² over −1..1, as measured on real fields.
        Quadratic(Quadratic),
    }
}

section! {
    /// The paper's light: distance to the image's border to the power of an exponent (Eq. 8).
    pub struct Border {
        /// The exponent n: 0 is even; the released value is 0.02.
        exponent: Number = 0.02, 0..=2;
    }
}

section! {
    /// A smooth bowl of light, 1 − x2·x² − y2·y² over −1..1, as measured on real fields.
    pub struct Quadratic {
        /// Fall towards the left and right border, as a fraction of the centre.
        falloff_x: Number = Number::uniform(0.01, 0.055), 0..=0.45;
        /// Fall towards the upper and lower border, as a fraction of the centre.
        falloff_y: Number = Number::uniform(0.0, 0.025), 0..=0.45;
        /// Where the top of the bowl lies, as a fraction of half the field to either side.
        centre_offset: Number = Number::uniform(0.0, 0.25), 0..=0.9;
    }
}

section! {
    /// The empty slide, as the lamp shows it (Eqs. 8–10).
    pub struct Background {
        /// Light of the empty slide as a fraction of the camera's largest grey level (b of Eq. 8).
        level: Number = Number::normal(0.90, 0.055).at_least(0.74).at_most(0.985), 0.01..=1.2;
        /// How evenly the lamp lights the field.
        illumination: Illumination;
        /// Strength of Perlin noise in the light, as a fraction of the largest grey level (c_pe of Eq. 9).
        texture: Number = Number::uniform(0.015, 0.045), 0..=0.5;
        /// Size of the cells of that noise.
        texture_um: Number = 60.0, 1..=10000, "µm";
    }
}

section! {
    /// The light: one wavelength or three colours.
    pub enum Light, by default Monochrome {
        /// A grey image in the light of one interference filter.
        Monochrome(Monochrome),
        /// A colour image: halogen lamp, colour camera, white balance on the empty slide.
        Colour(Colour),
    }
}

section! {
    /// The light of one interference filter.
    pub struct Monochrome {
        /// Wavelength (the paper's: 0.57, where nuclei stand out most).
        wavelength_um: Number = 0.57, 0.4..=0.7, "µm";
        /// Width of the filter's band.
        bandwidth_um: Number = 0.01, 0..=0.1, "µm";
    }
}

section! {
    /// Colours: halogen lamp, colour camera, white balance on the empty slide.
    pub struct Colour {
        /// Temperature of the lamp.
        lamp_k: Number = 3200.0, 2000..=10000, "K";
        /// How dyes make colours.
        mixing: Mixing = Mixing::Spectral;
        /// How much farther from the objective red light (0.65 µm) comes to focus than green (0.55 µm); what an apochromat
        /// leaves is below one.
        chromatic_um: Number = 0.3, -10..=10, "µm of stage travel";
        /// How the camera's colours are written.
        rendition: Rendition = Rendition::Display;
    }
}

section! {
    /// How dyes make colours.
    pub enum Mixing {
        /// Beer and Lambert's law at sixteen wavelengths, averaged over the band of each channel.
        Spectral,
        /// One absorbance for each dye and channel: faster; dark stains turn out too dark.
        ThreeVectors,
        /// Sixteen wavelengths, each imaged by itself: the reference for the others, and several times as slow.
        PerWavelength,
    }
}

section! {
    /// How the camera's colours are written.
    pub enum Rendition {
        /// The three channels of the sensor, balanced and in proportion to the light: for measuring.
        Raw,
        /// The same three channels, balanced, under the tone curve of sRGB: what most microscope cameras save.
        Display,
        /// Colours as an eye would see them: sRGB primaries and tone curve.
        Srgb,
    }
}

section! {
    /// How light spreads between slide and sensor.
    #[expect(clippy::large_enum_variant, reason = "one a recipe")]
    pub enum Optics, by default BrightField {
        /// Partially coherent bright field: what every slab transmits, filtered by the weak-object transfer function.
        BrightField(Microscope),
        /// The paper's: Gaussians on the absorbance (Eqs. 13, 14, Fig. 10).
        Gaussian(Gaussians),
    }
}

section! {
    /// A bright-field microscope.
    pub struct Microscope, drawn as pub SceneMicroscope {
        /// Numerical aperture of the objective, at most `immersion_index` and below `mount_index`.
        na: Number = 0.95, 0.05..=1.6;
        /// Numerical aperture to which the condenser is opened, below `mount_index`; what exceeds `na` is lost light. 0.41
        /// gives 0.25 µm of blur for each µm of stage travel, the paper's Fig. 10.
        condenser_na: Number = 0.41, 0.05..=1.6;
        /// Refractive index of the mountant in which the cells lie.
        mount_index: Number = 1.515, 1..=2;
        /// Refractive index between cover glass and objective: 1 for a dry lens.
        immersion_index: Number = 1.0, 1..=2;
        /// How much thicker the cover glass is than the lens was made for.
        cover_error_um: Number = 0.0, -50..=50, "µm";
        /// Spherical aberration of the objective (root mean square).
        spherical: Number = 0.0, -1..=1, "waves";
        /// Coma along the rows (root mean square).
        coma: Number = 0.0, -1..=1, "waves";
        /// Astigmatism between rows and columns (root mean square).
        astigmatism: Number = 0.0, -1..=1, "waves";
        /// Standard deviation of further spread: relay optics, charge diffusion, vibration. 0.16 makes edges as wide as the
        /// paper measured them, 0.9 px.
        extra_blur_um: Number = 0.16, 0..=10, "µm";
        /// Share of an empty field's light that lies evenly over the picture: glare.
        stray_light: Number = Number::uniform(0.01, 0.04), 0..=0.5;
        /// Samples of the slide along the side of a pixel.
        oversampling: Count = 2, 1..=4;
        /// How light is followed through the slide.
        imaging: Imaging (last) = Imaging::Product;
        /// Thickness of the slabs between which `abbe` carries light; `product` knows every depth.
        slab_um: Number = 0.25, 0.1..=10, "µm";
        /// Directions of light that `abbe` follows.
        directions: Count (last) = 64, 1..=65536;
    }
}

section! {
    /// The paper's spread of light: Gaussians on the absorbance (Eqs. 13, 14, Fig. 10).
    pub struct Gaussians {
        /// Standard deviation of the spread in the image plane (the paper's: 0.9 px of 0.25 µm).
        sigma_xy_um: Number = 0.225, 0..=20, "µm";
        /// Growth of the spread with distance from focus. The paper's calibration is 0.25, that is one pixel of 0.25 µm per
        /// µm; its sentence read as "µm per µm" would be 1.
        sigma_z_um_per_um: Number = 0.25, 0..=10, "µm per µm";
    }
}

section! {
    /// How light is followed through the slide.
    pub enum Imaging {
        /// The product over all objects of what each transmits, filtered by the weak-object transfer function: right to
        /// one or two per cent of the contrast.
        Product,
        /// Abbe's integration over the source, light carried from slab to slab: the reference, thousands of times as slow and for
        /// small fields.
        Abbe,
    }
}

impl Optics {
    /// The paper's Gaussians.
    #[must_use]
    pub fn gaussian() -> Self {
        Self::Gaussian(Gaussians::default())
    }
}
