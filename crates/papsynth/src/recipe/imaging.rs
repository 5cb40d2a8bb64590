//! The sections of a recipe about the microscope: field, focus, background, light, optics.

use super::number::{Count, Number};
use super::section::section;

section! {
    /// Size and pixel size of the image. Densities of cells and debris apply to its area. Objects whose number is given
    /// per mm² may also have their centres in a margin of 60 µm around the image.
    pub struct Field {
        /// Width of the image. Drawn once per field.
        width_px: Count = 1376, 16..=32768, "pixels";
        /// Height of the image. Drawn once per field.
        height_px: Count = 1038, 16..=32768, "pixels";
        /// Pixel size in the object (the paper: 0.25). Ignored if `magnification` is above 0.
        pixel_um: Number = 0.25, 0.05..=4, "µm";
        /// Magnification from slide to sensor, including relay optics, or 0 to use `pixel_um`. The pixel size is
        /// `camera.pixel_um` times `camera.binning_px`, divided by the magnification: 6.45 µm at 40 · 0.645 give 0.25
        /// µm.
        magnification: Number = 0.0, 0..=400;
    }
}

section! {
    /// Focal planes, as positions of the stage. With bright-field optics, the depth in focus is the position of the
    /// stage times the ratio of the refractive indices of mountant and immersion.
    pub struct Focus, drawn as pub(crate) DrawnFocus {
        /// Number of focal planes. 1 gives an image, more give a focus stack.
        planes: Count = 1, 1..=1024;
        /// Distance between planes, as travel of the stage.
        step_um: Number = 0.5, 0.001..=100, "µm";
        /// Position of the stage at the central plane. At 0 the centre of the slide is in focus; larger values focus
        /// nearer to the objective.
        centre_um: Number = 0.0, -100..=100, "µm";
        /// Output of the planes.
        output: FocusOutput = FocusOutput::Planes;
        /// Correlation of the noise of neighbouring pixels of a row, in an EDF image.
        noise_correlation_x: Number = 0.2, 0..=0.5;
        /// Correlation of the noise of neighbouring pixels of a column, in an EDF image.
        noise_correlation_y: Number = 0.4, 0..=0.5;
        /// Half the difference between the correlations of the noise along the two diagonals (down right minus down
        /// left), in an EDF image. Images that were rotated or shifted by fractions of a pixel have such a difference.
        noise_correlation_diagonal: Number = 0.0, -0.1..=0.1;
        /// Factor by which an EDF image was reduced from the pixels of the sensor, by linear interpolation. Above 1,
        /// the variance of the noise changes along rows and columns, with a period of 1/(reduction − 1) pixels.
        reduction: Number = 1.0, 1..=1.3;
        /// Difference between the responses of even columns of the sensor and the mean of all columns, as a fraction of
        /// the mean, in the last row of an EDF image. It is proportional to the number of the row.
        column_pattern: Number = 0.0, 0..=0.05;
    }
}

section! {
    /// Output of the planes of a focus stack.
    pub enum FocusOutput {
        /// One image per plane.
        Planes,
        /// One image of extended depth of field (EDF): each object as in its sharpest plane, with noise that is
        /// correlated between neighbouring pixels.
        Edf,
    }
}

section! {
    /// Illumination of the field.
    pub enum Illumination, by default Quadratic {
        /// The paper's model: a power of the distance to the image border (Eq. 8).
        Border(Border),
        /// A quadratic falloff, 1 − falloff_x·x² − falloff_y·y² over −1..1, as measured on real fields.
        Quadratic(Quadratic),
    }
}

section! {
    /// The paper's illumination: a power of the distance to the image border (Eq. 8).
    pub struct Border {
        /// Exponent n of the distance. 0 gives even illumination; the released value is 0.02.
        exponent: Number = 0.02, 0..=2;
    }
}

section! {
    /// A quadratic falloff of the illumination, 1 − falloff_x·x² − falloff_y·y² over −1..1, as measured on real fields.
    pub struct Quadratic {
        /// Falloff at the left and right border, as a fraction of the maximum.
        falloff_x: Number = Number::uniform(0.01, 0.055), 0..=0.45;
        /// Falloff at the upper and lower border, as a fraction of the maximum.
        falloff_y: Number = Number::uniform(0.0, 0.025), 0..=0.45;
        /// Distance of the maximum from the centre of the field, as a fraction of half the field.
        centre_offset: Number = Number::uniform(0.0, 0.25), 0..=0.9;
    }
}

section! {
    /// Light of the empty slide (Eqs. 8–10).
    pub struct Background {
        /// Level of the empty slide, as a fraction of the largest grey level (b of Eq. 8).
        level: Number = Number::normal(0.90, 0.055).at_least(0.74).at_most(0.985), 0.01..=1.2;
        /// Illumination of the field.
        illumination: Illumination;
        /// Amplitude of the Perlin noise of the background, as a fraction of the largest grey level (c_pe of Eq. 9).
        texture: Number = Number::uniform(0.015, 0.045), 0..=0.5;
        /// Lattice spacing of the Perlin noise of the background.
        texture_um: Number = 60.0, 1..=10000, "µm";
    }
}

section! {
    /// Light: monochrome or colour.
    pub enum LightSection, by default Monochrome {
        /// A grey image in the light of one filter.
        Monochrome(Monochrome),
        /// A colour image: halogen lamp, colour camera, white balance on the empty slide.
        Colour(Colour),
    }
}

section! {
    /// The light of one interference filter, or of a broad band.
    pub struct Monochrome {
        /// Wavelength of the filter (the paper: 0.57, the highest contrast of nuclei).
        wavelength_um: Number = 0.57, 0.4..=0.7, "µm";
        /// Bandwidth of the filter.
        bandwidth_um: Number = 0.01, 0..=0.1, "µm";
        /// Coefficient of variation of the stains' absorption over the wavelengths of the light, in bright field. In
        /// light of one wavelength it is 0 and absorbances of overlapping objects add up; in a broad band they add up
        /// to less.
        absorption_variation: Number = 0.0, 0..=1;
    }
}

section! {
    /// Colour: halogen lamp, colour camera, white balance on the empty slide.
    pub struct Colour {
        /// Colour temperature of the lamp.
        lamp_k: Number = 3200.0, 2000..=10000, "K";
        /// Colour model of the dyes.
        mixing: Mixing = Mixing::Spectral;
        /// Longitudinal chromatic aberration: stage position at which red light (0.65 µm) is in focus, minus that of
        /// green light (0.55 µm). Below 1 for an apochromat.
        chromatic_um: Number = 0.3, -10..=10, "µm of stage travel";
        /// Colour rendition of the camera.
        rendition: Rendition = Rendition::Display;
    }
}

section! {
    /// Colour model of the dyes.
    pub enum Mixing {
        /// Beer–Lambert law at sixteen wavelengths, averaged over the band of each channel.
        Spectral,
        /// One absorbance per dye and channel. Faster; dark stains become too dark.
        ThreeVectors,
        /// Sixteen wavelengths, each imaged separately. The reference for the other models; several times slower.
        PerWavelength,
    }
}

section! {
    /// Colour rendition of the camera.
    pub enum Rendition {
        /// The three channels of the sensor, white-balanced and linear, for measurements.
        Raw,
        /// The three channels of the sensor, white-balanced, with the tone curve of sRGB, as most microscope cameras
        /// save them.
        Display,
        /// Colorimetric colours: sRGB primaries and tone curve.
        Srgb,
    }
}

section! {
    /// Optics between slide and sensor.
    #[expect(clippy::large_enum_variant, reason = "a recipe has one value of it")]
    pub enum Optics, by default BrightField {
        /// Partially coherent bright field; `imaging` selects the model.
        BrightField(Microscope),
        /// The paper's model: Gaussian blur of the absorbance (Eqs. 13, 14, Fig. 10).
        Gaussian(Gaussians),
    }
}

section! {
    /// A bright-field microscope.
    pub struct Microscope, drawn as pub SceneMicroscope {
        /// Numerical aperture of the objective, at most `immersion_index` and below `mount_index`.
        na: Number = 0.95, 0.05..=1.6;
        /// Numerical aperture of the condenser, below `mount_index`. Light beyond `na` is lost. 0.41 gives 0.25 µm of
        /// blur per µm of stage travel, as in the paper's Fig. 10.
        condenser_na: Number = 0.41, 0.05..=1.6;
        /// Refractive index of the mountant.
        mount_index: Number = 1.515, 1..=2;
        /// Refractive index between cover glass and objective. 1 for a dry lens.
        immersion_index: Number = 1.0, 1..=2;
        /// Thickness error of the cover glass: its thickness minus the design thickness of the objective.
        cover_error_um: Number = 0.0, -50..=50, "µm";
        /// Spherical aberration of the objective, root mean square.
        spherical: Number = 0.0, -1..=1, "waves";
        /// Coma along the rows, root mean square.
        coma: Number = 0.0, -1..=1, "waves";
        /// Astigmatism between rows and columns, root mean square.
        astigmatism: Number = 0.0, -1..=1, "waves";
        /// Standard deviation of additional blur: relay optics, charge diffusion, vibration. 0.16 gives the edge width
        /// measured in the paper, 0.9 px.
        extra_blur_um: Number = 0.16, 0..=10, "µm";
        /// Fraction of the light that is stray light (glare).
        stray_light: Number = Number::uniform(0.01, 0.04), 0..=0.5;
        /// Distance over which stray light spreads: half of it is a Gaussian of this standard deviation, and a quarter
        /// each is 2 and 4 times as wide. 0 distributes the light evenly over the field, as in frames of a slide.
        stray_light_um: Number = 0.0, 0..=50, "µm";
        /// Oversampling: number of samples per pixel in x and in y.
        oversampling: Count = 2, 1..=4;
        /// Imaging model.
        imaging: Imaging (last) = Imaging::Product;
        /// Thickness of the slabs of `abbe`. `product` uses the exact depth of each object.
        slab_um: Number = 0.25, 0.1..=10, "µm";
        /// Number of illumination directions of `abbe`.
        directions: Count (last) = 64, 1..=65536;
    }
}

section! {
    /// The paper's optics: Gaussian blur of the absorbance (Eqs. 13, 14, Fig. 10).
    pub struct Gaussians {
        /// Standard deviation of the blur in focus (the paper: 0.9 px of 0.25 µm).
        sigma_xy_um: Number = 0.225, 0..=20, "µm";
        /// Increase of the blur with distance from focus. The paper's program uses 0.25, one pixel of 0.25 µm per µm.
        /// Its text, "σ ≈ dz, in µm", gives 1.
        sigma_z_um_per_um: Number = 0.25, 0..=10, "µm per µm";
    }
}

section! {
    /// Imaging model of bright-field optics.
    pub enum Imaging {
        /// The product of the transmittances of all objects, each filtered by the weak-object transfer function.
        /// Accurate to one or two per cent of the contrast.
        Product,
        /// Abbe's integration over the source, with propagation from slab to slab. The reference, thousands of times
        /// slower, for small fields.
        Abbe,
    }
}

impl Optics {
    /// Returns the paper's optics.
    #[must_use]
    pub fn gaussian() -> Self {
        Self::Gaussian(Gaussians::default())
    }
}
