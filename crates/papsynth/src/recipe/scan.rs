//! The section of a recipe about whole slides.

use super::number::Number;
use super::section::section;

section! {
    /// A whole slide, imaged frame by frame by a scanner (`papsynth slide`). Not used for fields.
    ///
    /// Densities of cells and debris are those within the deposit. A count per field is divided by the mean area of a
    /// field.
    pub struct Scan {
        /// Width of the image of the slide.
        width_px: u32 = 56_000, 64..=1000000, "pixels";
        /// Height of the image of the slide.
        height_px: u32 = 56_000, 64..=1000000, "pixels";
        /// Size of the square frames of the scanner's camera. Each frame has its own illumination and exposure.
        frame_px: u32 = 2048, 128..=8192, "pixels";
        /// Fraction of the uneven illumination (`background.illumination`) that remains after the scanner's correction.
        residual_shading: f64 = 0.15, 0..=1;
        /// Largest accepted distance from the centre of an object to the edge of its image. Larger objects are an
        /// error.
        max_object_radius_um: f64 = 400.0, 10..=2000, "µm";
        /// Deposit of the material.
        deposit: Deposit;
    }
}

section! {
    /// The round deposit of a liquid-based preparation. The default is a circle of 13 mm diameter, as made by filters
    /// and settling chambers.
    pub struct Deposit, drawn as pub(crate) SceneDeposit {
        /// Centre of the deposit, from the left border of the image. All numbers of the deposit are drawn once per
        /// slide.
        x_um: Number = 7000.0, -1000000..=1000000, "µm";
        /// Centre of the deposit, from the upper border of the image.
        y_um: Number = 7000.0, -1000000..=1000000, "µm";
        /// Radius of the deposit.
        radius_um: Number = 6500.0, 1..=1000000, "µm";
        /// Width of the edge, over which the density falls.
        edge_um: Number = 120.0, 1..=100000, "µm";
        /// Variation of the density: standard deviation of its logarithm.
        density_variation: Number = 0.35, 0..=1;
        /// Length scale of the variation of the density.
        density_scale_um: Number = 900.0, 50..=100000, "µm";
        /// Density outside the deposit, relative to the mean density inside.
        outside_density: Number = 0.01, 0..=1;
    }
}
