//! The section of a recipe about whole slides.

use super::number::Number;
use super::section::section;

section! {
    /// A whole slide, as a scanner sees it frame by frame (`papsynth slide`); fields do not look at it.
    ///
    /// Densities of cells and debris are those within the deposit. A count per field is divided by the mean area of a field.
    pub struct Scan {
        /// Width of the slide's picture.
        width_px: u32 = 56_000, 64..=1000000, "pixels";
        /// Its height.
        height_px: u32 = 56_000, 64..=1000000, "pixels";
        /// Side of the square frames that the scanner's camera takes: each is lit and exposed by itself.
        frame_px: u32 = 2048, 128..=8192, "pixels";
        /// Share of the unevenness of the lamp (`background.illumination`) that the scanner's correction leaves.
        residual_shading: f64 = 0.15, 0..=1;
        /// Farthest that an object's picture may reach from the object's middle; what would reach further is refused.
        max_object_radius_um: f64 = 400.0, 10..=2000, "µm";
        /// Where the material lies.
        deposit: Deposit;
    }
}

section! {
    /// The round deposit of a liquid-based preparation: by default a circle 13 mm wide, as filters and settling chambers
    /// leave it.
    pub struct Deposit, drawn as pub(crate) SceneDeposit {
        /// Its middle, from the left border of the picture; drawn once a slide, as all that follow.
        x_um: Number = 7000.0, -1000000..=1000000, "µm";
        /// Its middle, from the upper border of the picture.
        y_um: Number = 7000.0, -1000000..=1000000, "µm";
        /// Its radius.
        radius_um: Number = 6500.0, 1..=1000000, "µm";
        /// Distance over which it thins out at its edge.
        edge_um: Number = 120.0, 1..=100000, "µm";
        /// How unevenly the cells lie: standard deviation of the logarithm of their density.
        density_variation: Number = 0.35, 0..=1;
        /// Size of its dense and thin patches.
        density_scale_um: Number = 900.0, 50..=100000, "µm";
        /// Density beyond its edge, relative to that within.
        outside_density: Number = 0.01, 0..=1;
    }
}
