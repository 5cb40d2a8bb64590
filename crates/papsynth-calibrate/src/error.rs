//! Errors.

use optics_psf::calibrate::Window;

/// An error of a measurement.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A stack has too few planes.
    #[error("planes: found {planes}, expected 3 or more")]
    Planes {
        /// Number of planes.
        planes: usize,
    },
    /// The stack contains no nucleus.
    #[error("no nucleus found: expected a dark, compact object")]
    NoNucleus,
    /// Too few planes show a measurable blur.
    #[error(
        "the blur of {blurred} of {planes} planes is at the limit of 16 px: the images are not planes of one focus \
         stack, or the planes are too far apart"
    )]
    Blurred {
        /// Number of distances from focus at the limit.
        blurred: usize,
        /// Number of distances from focus.
        planes: usize,
    },
    /// A nucleus cannot be measured.
    #[error("window {},{},{},{}: {source}", window.left, window.top, window.width, window.height)]
    Window {
        /// The window of the nucleus.
        window: Window,
        /// The reason.
        source: optics_psf::Error,
    },
    /// The aperture of the condenser cannot be estimated.
    #[error("condenser aperture: {0}")]
    Condenser(optics_psf::Error),
    /// A parameter of the microscope is out of range.
    #[error("microscope: {0}")]
    Microscope(optics_psf::Error),
    /// The square around a line is too small, or extends beyond the image.
    #[error("line {},{},{},{}: its square extends beyond the {width} x {height} image, or is smaller than 8 px", line[0], line[1], line[2], line[3])]
    Line {
        /// The two ends of the line, pixels.
        line: [f64; 4],
        /// Columns of the image.
        width: usize,
        /// Rows of the image.
        height: usize,
    },
    /// The image contains no straight edge.
    #[error("no straight edge found")]
    NoEdge,
    /// An edge cannot be fitted.
    #[error(transparent)]
    Edge(optics_psf::Error),
    /// Frames differ in size.
    #[error("{name}: found {} x {} pixels, expected {} x {} as in the other frames", found[0], found[1], expected[0], expected[1])]
    Sizes {
        /// The frame.
        name: String,
        /// Its columns and rows.
        found: [usize; 2],
        /// Columns and rows of the frames before it.
        expected: [usize; 2],
    },
    /// A frame is not larger than the window of the shading correction.
    #[error("{name}: {} x {} pixels; expected more than {least} in each direction", found[0], found[1])]
    Small {
        /// The frame.
        name: String,
        /// Its columns and rows.
        found: [usize; 2],
        /// Size of the window.
        least: usize,
    },
    /// A grey level is above the maximum of the bit depth of the camera.
    #[error("{name}: the grey level {value} is above the maximum of this bit depth")]
    Bits {
        /// The light level.
        name: String,
        /// The grey level.
        value: f64,
    },
    /// The frames of a light level cannot be measured.
    #[error("{name}: {source}")]
    Level {
        /// The level.
        name: String,
        /// The reason.
        source: ccd_noise::Error,
    },
    /// The light levels are insufficient for the camera.
    #[error(transparent)]
    Camera(ccd_noise::Error),
    /// All light levels are too dark to measure the gain.
    #[error(
        "the brightest light level is {found:.1} grey levels above the dark level; expected at least {expected:.0} (1 % of full scale)"
    )]
    TooDark {
        /// Difference between the brightest level and the dark level, grey levels.
        found: f64,
        /// Smallest accepted difference, grey levels.
        expected: f64,
    },
}
