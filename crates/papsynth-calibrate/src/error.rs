//! What can go wrong.

use optics_psf::calibrate::Window;

/// Why something cannot be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A stack has too few planes.
    #[error("{planes} planes; expected 3 or more")]
    Planes {
        /// Planes of the stack.
        planes: usize,
    },
    /// Nothing in the stack looks like a nucleus.
    #[error("no dark, compact thing was found in it")]
    NoNucleus,
    /// A nucleus cannot be measured.
    #[error("window {},{},{},{}: {source}", window.left, window.top, window.width, window.height)]
    Window {
        /// The window of the nucleus.
        window: Window,
        /// The reason.
        source: optics_psf::Error,
    },
    /// The aperture of the condenser cannot be found.
    #[error("the condenser's aperture: {0}")]
    Condenser(optics_psf::Error),
    /// The microscope is impossible, or is outside the range that the optics compute.
    #[error("the microscope: {0}")]
    Microscope(optics_psf::Error),
    /// The square around a line is too small, or lies outside the image.
    #[error("line {},{},{},{}: its square does not lie in the {width} x {height} image", line[0], line[1], line[2], line[3])]
    Line {
        /// The two ends of the line, pixels.
        line: [f64; 4],
        /// Columns of the image.
        width: usize,
        /// Rows of the image.
        height: usize,
    },
    /// No window of the image holds a straight edge.
    #[error("no straight edge was found in it")]
    NoEdge,
    /// An edge cannot be fitted.
    #[error(transparent)]
    Edge(optics_psf::Error),
    /// Frames differ in size.
    #[error("{name}: {} x {} pixels, others {} x {}", found[0], found[1], expected[0], expected[1])]
    Sizes {
        /// The frame.
        name: String,
        /// Its columns and rows.
        found: [usize; 2],
        /// Columns and rows of the frames before it.
        expected: [usize; 2],
    },
    /// A frame is not larger than the square whose mean is taken for shading.
    #[error("{name}: {} x {} pixels; expected more than {least} on each side", found[0], found[1])]
    Small {
        /// The frame.
        name: String,
        /// Its columns and rows.
        found: [usize; 2],
        /// Side of the square.
        least: usize,
    },
    /// A frame has a grey level that the camera cannot give.
    #[error("{name} holds the grey level {value}")]
    Bits {
        /// The level of light.
        name: String,
        /// The grey level.
        value: f64,
    },
    /// The frames of a level of light cannot be measured.
    #[error("{name}: {source}")]
    Level {
        /// The level.
        name: String,
        /// The reason.
        source: ccd_noise::Error,
    },
    /// The levels of light do not give the camera.
    #[error(transparent)]
    Camera(ccd_noise::Error),
    /// All levels of light are too dark: noise of the measurement would pass for a gain.
    #[error(
        "the brightest level is {found:.1} grey levels above the dark; expected at least 1 % of all, {expected:.0}"
    )]
    TooDark {
        /// Grey levels of the brightest above the dark.
        found: f64,
        /// The least that is accepted.
        expected: f64,
    },
}
