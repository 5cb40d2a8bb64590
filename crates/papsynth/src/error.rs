//! The errors of the engine.

use crate::recipe::diagnose::plain;
use crate::recipe::number::shown;

/// An error of the engine.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The recipe has invalid fields.
    #[error("{} in the recipe:{}", count(.0), list(.0))]
    Recipe(Vec<InvalidField>),
    /// The model is invalid.
    #[error("model: {0}")]
    Model(#[source] ErrorKind),
    /// A class cannot be learned from the given images.
    #[error("class `{class}` cannot be learned: {cause}")]
    Learn {
        /// The class.
        class: String,
        /// The cause.
        #[source]
        cause: ErrorKind,
    },
    /// The density map or label image of the layout is missing or invalid.
    #[error("layout: {0}")]
    Layout(#[source] ErrorKind),
    /// A scene is invalid.
    #[error("scene: {0}")]
    Scene(#[source] ErrorKind),
    /// An image cannot be generated.
    #[error("image {index}: {cause}")]
    Image {
        /// Index of the image.
        index: u64,
        /// The cause.
        #[source]
        cause: ErrorKind,
    },
}

/// The cause of an [`Error`], with the field or object, its value, and what is accepted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ErrorKind {
    /// A number is out of range.
    #[error("{field}: {} is out of range: expected {} to {}", shown(*value), shown(*low), shown(*high))]
    OutOfRange {
        /// Path of the field.
        field: String,
        /// The value.
        value: f64,
        /// The smallest accepted value.
        low: f64,
        /// The largest accepted value.
        high: f64,
    },
    /// The image was cancelled before it was complete.
    #[error("cancelled")]
    Cancelled,
    /// A profile of a model is empty.
    #[error("{0}: expected at least 1 number, found none")]
    EmptyProfile(String),
    /// The name of a class of a model is invalid.
    #[error("classes: invalid name `{0}`; expected letters, digits, `-` and `_`")]
    ClassName(String),
    /// The model does not have a class; second, the classes that it has.
    #[error("the model has no class `{}`; its classes are {}", .0, .1.join(", "))]
    UnknownClass(String, Vec<String>),
    /// The statistics of outlines are inconsistent.
    #[error("{0}: {1}")]
    Shapes(String, #[source] fsd_shape::Error),
    /// The number of pixels of a donor is not a multiple of its width.
    #[error("{field}.width: {pixels} pixels are not a multiple of the width {width}")]
    DonorSize {
        /// Path of the donor.
        field: String,
        /// The number of columns.
        width: usize,
        /// The number of pixels.
        pixels: usize,
    },
    /// A donor has no pixel inside its nucleus.
    #[error("{0}.absorbance_milli: no pixel is inside the nucleus")]
    EmptyDonor(String),
    /// The donors of a class have different pixel sizes.
    #[error("classes.{0}.nucleus.donors: the pixel sizes differ; expected the same pixel size")]
    DonorPixels(String),
    /// A donor is invalid as a texture.
    #[error("nucleus.donors: {0}")]
    Donor(#[source] quilt_texture::Error),
    /// A text is not a model in JSON.
    #[error("not a model of papsynth: {}", plain(&.0.to_string()))]
    NotAModel(#[source] serde_json::Error),
    /// A text is not a class file in TOML.
    #[error("not a class file of papsynth: {0}")]
    NotAClassFile(#[source] toml::de::Error),
    /// The text of a model is not an object.
    #[error("not a model of papsynth: expected a JSON object")]
    NotATable,
    /// A model of another version, and the accepted version.
    #[error("version is {0}; expected {1}")]
    ModelVersion(String, u32),
    /// A field of a model or of a scene has a wrong type, is missing, or is unknown.
    #[error("{}", plain(&.0.to_string()))]
    Json(#[from] serde_json::Error),
    /// A value of a class file has a wrong type.
    #[error("{at}expected {expected}, found {found}")]
    WrongType {
        /// Path of the field with a colon, or nothing.
        at: String,
        /// What is accepted.
        expected: &'static str,
        /// The value.
        found: String,
    },
    /// A number of a class file is infinite or not a number.
    #[error("{0}: expected a finite number, found NaN or infinity")]
    NotFinite(String),
    /// A class of a class file has an unknown key; second, its keys.
    #[error("unknown key `{0}`: expected one of `{1}`")]
    UnknownClassField(String, String),
    /// A class without a base class misses a key.
    #[error("add `like`, or the missing key `{0}`: a class without `like` needs all values")]
    IncompleteClass(&'static str),
    /// The provenance of a class file is invalid.
    #[error("provenance: {}", plain(&.0.to_string()))]
    Provenance(#[source] serde_json::Error),
    /// The classes of a class file are not a table.
    #[error("classes: expected a table of classes by name")]
    ClassesNotATable,
    /// A class file has an unknown key.
    #[error("unknown key `{0}`; expected `version`, `provenance` or `classes`")]
    UnknownField(String),
    /// Classes refer to each other with `like` in a cycle.
    #[error("classes {} form a cycle of `like`", .0.join(", "))]
    ClassCircle(Vec<String>),
    /// A class of a class file is invalid.
    #[error("classes.{class}: {cause}")]
    Class {
        /// The name of the class.
        class: String,
        /// The cause.
        #[source]
        cause: Box<ErrorKind>,
    },

    /// The pixel size of images to learn from is out of range.
    #[error("pixel size: {0} µm is out of range: expected 0.05 to 4")]
    PixelSize(f64),
    /// Too few outlines.
    #[error("outlines of the {what}: {found}; expected at least {least}")]
    TooFewOutlines {
        /// Number of outlines.
        found: usize,
        /// Their part: cell or nucleus.
        what: &'static str,
        /// Minimum number.
        least: usize,
    },
    /// An outline, by its index, intersects itself.
    #[error("outline {0} of the {1} intersects itself; expected simple closed curves")]
    CrossedOutline(usize, &'static str),
    /// The model of shapes cannot be fitted to the outlines of cells or nuclei.
    #[error("outlines of the {0}: {1}")]
    Outlines(&'static str, #[source] fsd_shape::Error),
    /// The image of a nucleus is invalid.
    #[error("{name}: {cause}")]
    Nucleus {
        /// Name of the image.
        name: String,
        /// The cause.
        #[source]
        cause: NucleusError,
    },

    /// The pixel size of images of cytoplasm is out of range.
    #[error("pixel size: {0} µm is out of range for the texture of cytoplasm: expected 0.2 to 0.5")]
    TexturePixel(f64),
    /// The parts of an image of cytoplasm have different sizes.
    #[error("{0}: absorbance, mean and mask differ in size, or the size is not a multiple of the width")]
    CytoplasmSize(String),
    /// The images show too little cytoplasm.
    #[error(
        "{found} areas of cytoplasm of 64 x 64 pixels without nuclei, folds and borders; expected at least {least}: give \
         more fields"
    )]
    LittleCytoplasm {
        /// Number of areas.
        found: usize,
        /// Minimum number.
        least: usize,
    },
    /// The model does not have a kind of texture of a scene.
    #[error("textures: the model has no texture of cytoplasm `{0}`")]
    ForeignTexture(String),
    /// The texture of cytoplasm has no kind.
    #[error("cytoplasm_texture.kinds: expected at least 1 kind, found none")]
    NoTexture,
    /// A texture has the wrong number of octaves.
    #[error("{field}: expected {expected} numbers, found {found}")]
    Octaves {
        /// Path of the list.
        field: String,
        /// Its length.
        found: usize,
        /// The expected length.
        expected: usize,
    },
    /// The statistics of a texture are invalid, or cannot be measured.
    #[error("texture: {0}")]
    CytoplasmTexture(#[source] steerable_texture::Error),

    /// The file of the layout was not given.
    #[error("layout.path: the content of \"{path}\" is missing in the inputs of the engine; expected {what}")]
    NotGiven {
        /// The file.
        path: String,
        /// Its expected content.
        what: &'static str,
    },
    /// The file of the layout is not a valid density map.
    #[error("\"{path}\": {cause}")]
    Map {
        /// The file.
        path: String,
        /// The cause.
        #[source]
        cause: Box<ErrorKind>,
    },
    /// The number of pixels of a weight map, first, is not a multiple of its width.
    #[error("a weight map of {0} pixels cannot have rows of {1} pixels")]
    MapSize(usize, usize),
    /// A weight is negative or not finite.
    #[error("weight {weight} at pixel ({x}, {y}); expected a finite number of at least 0")]
    Weight {
        /// The column.
        x: usize,
        /// The row.
        y: usize,
        /// The weight.
        weight: f32,
    },
    /// A weight map has no weight above zero.
    #[error("all weights are zero; expected at least one weight above zero")]
    NoWeight,
    /// The labels of a layout cannot be smoothed.
    #[error("layout.smooth_um: {0}")]
    Smoothing(#[source] optics_psf::Error),
    /// More cells than fit into the field.
    #[error(
        "{count} cells with a spacing of {spacing_um} µm do not fit into {area_um2:.0} µm², about {room:.0} do: reduce \
         `cells` or `slide.spacing_um`, or enlarge the field"
    )]
    NoRoom {
        /// Number of cells.
        count: usize,
        /// Minimum distance, µm.
        spacing_um: f64,
        /// Area where the layout allows cells, µm².
        area_um2: f64,
        /// Number of cells that fit.
        room: f64,
    },
    /// The placement of the cells takes too many tries.
    #[error(
        "{count} cells take about {tries:.0e} tries with this uneven layout; expected at most {most:.0e}: raise the low \
         weights, or reduce `cells`"
    )]
    TooUneven {
        /// Number of cells.
        count: usize,
        /// Expected number of tries.
        tries: f64,
        /// Largest accepted number of tries.
        most: f64,
    },
    /// No place is left that is far enough from all other cells.
    #[error(
        "no place is left after {placed} cells with a spacing of {spacing_um} µm: reduce `cells` or `slide.spacing_um`, or \
         enlarge the field"
    )]
    Crowded {
        /// Number of cells placed.
        placed: usize,
        /// Minimum distance, µm.
        spacing_um: f64,
    },
    /// More objects than 32-bit labels.
    #[error("{0} objects; labels allow at most 4294967295")]
    TooManyObjects(usize),

    /// The layout is not available for whole slides.
    #[error("layout.kind: expected `uniform` or `clusters` for a whole slide")]
    LayoutOfField,
    /// The clusters are too wide for a slide with its pixel size.
    #[error("layout.radius_um: {0} is out of range for a slide with this pixel size: expected at most {1:.0}")]
    WideClusters(f64, f64),
    /// More objects in a square of a slide than it has numbers.
    #[error(
        "{found} objects in a square of {side_px} x {side_px} pixels of the slide; expected at most {most}: reduce `cells` or \
         `debris`"
    )]
    FullPlot {
        /// Size of the square, pixels.
        side_px: i64,
        /// Number of objects.
        found: usize,
        /// Largest accepted number.
        most: usize,
    },
    /// The image of an object of a slide is too large.
    #[error(
        "the image of a {kind} has a radius of {reach_um:.0} µm, above `scan.max_object_radius_um` = {most_um}: increase \
         this key, or reduce the size or the depth of the object"
    )]
    TooFar {
        /// Kind of the object.
        kind: &'static str,
        /// Radius of its image, µm.
        reach_um: f64,
        /// Largest accepted radius, µm.
        most_um: f64,
    },
    /// A frame, by column and row, is outside the slide, whose size in frames is second.
    #[error("frame ({}, {}) is outside the slide of {} x {} frames", .0[0], .0[1], .1[0], .1[1])]
    NoFrame([u32; 2], [u32; 2]),
    /// A part is not inside the slide.
    #[error(
        "{} x {} pixels at ({}, {}) are not inside the slide of {} x {} pixels",
        .size_px[0], .size_px[1], .origin_px[0], .origin_px[1], .slide_px[0], .slide_px[1]
    )]
    OffSlide {
        /// First pixel of the part.
        origin_px: [u32; 2],
        /// Columns and rows of the part.
        size_px: [u32; 2],
        /// Columns and rows of the slide.
        slide_px: [u32; 2],
    },

    /// A text is not JSON.
    #[error("not a scene of papsynth: {0}")]
    NotAScene(#[source] serde_json::Error),
    /// A scene has no list of objects.
    #[error("objects: expected a list of objects")]
    NoObjects,
    /// A string or a boolean, second, in place of a number.
    #[error("{0}: expected a number, found {1}")]
    NotANumber(String, String),
    /// A scene is a frame of a whole slide.
    #[error("`frame` and `plot` are keys of whole slides; expected the scene of a single field")]
    SlideScene,
    /// An object of a scene is invalid.
    #[error("objects[{index}] (id {id}): {cause}")]
    Object {
        /// Index in the list, from 0.
        index: usize,
        /// Id of the object.
        id: serde_json::Value,
        /// The cause.
        #[source]
        cause: Box<ErrorKind>,
    },
    /// Two objects of a scene have the same id.
    #[error("id: another object has the same id")]
    SameId,
    /// An object is too large for the pixel size of its scene; second, the largest accepted radius.
    #[error("the radius of the object is {0:.0} µm; expected at most {1:.0} µm with this pixel size")]
    Reach(f64, f64),
    /// A cell of the scene has a class that the recipe does not have.
    #[error("the scene has a cell of class `{0}`; the recipe does not have this class")]
    ForeignClass(String),
    /// The light of the scene is colour, and its optics are Gaussian.
    #[error("colour needs bright-field optics, found Gaussian optics")]
    ColourWithGaussians,
    /// Invalid optics; first, the field.
    #[error("{0}: {1}")]
    Optics(&'static str, #[source] optics_psf::Error),
    /// Invalid light.
    #[error("light: {0}")]
    Light(#[from] dye_spectra::Error),
    /// Invalid background.
    #[error("background: {0}")]
    Background(#[from] perlin_bg::Error),
    /// Invalid camera.
    #[error("camera: {0}")]
    Camera(#[from] ccd_noise::Error),
    /// An invalid outline.
    #[error(transparent)]
    Outline(#[from] fsd_shape::Error),
    /// An invalid sheet.
    #[error(transparent)]
    Sheet(#[from] cloth_verlet::Error),
    /// An invalid cytoskeleton.
    #[error(transparent)]
    Cytoskeleton(#[from] voronoi_cytoskeleton::Error),
    /// An invalid texture from donors.
    #[error(transparent)]
    Texture(#[from] quilt_texture::Error),
    /// An invalid spectrum of a texture.
    #[error(transparent)]
    Spectrum(#[from] spectral_field::Error),
}

impl From<optics_psf::Error> for ErrorKind {
    fn from(error: optics_psf::Error) -> Self {
        Self::Optics("optics", error)
    }
}

/// Checks that a number is finite and in a range.
pub(crate) fn within(field: &str, value: f64, [low, high]: [f64; 2]) -> Result<(), ErrorKind> {
    if value.is_finite() && (low..=high).contains(&value) {
        return Ok(());
    }
    Err(ErrorKind::OutOfRange { field: field.to_owned(), value, low, high })
}

/// An invalid image of a nucleus to learn from.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NucleusError {
    /// Image and mask have different sizes.
    #[error("the image has {pixels} pixels, the mask {mask}; expected the same number, in rows of {width}")]
    Size {
        /// Pixels of the image.
        pixels: usize,
        /// Pixels of the mask.
        mask: usize,
        /// Columns.
        width: usize,
    },
    /// A pixel, by column and row, is negative or not finite.
    #[error("pixel ({0}, {1}) is {2}; expected a finite number of at least 0")]
    Pixel(usize, usize, f32),
    /// The mask has no single outline.
    #[error("mask: {0}")]
    Mask(#[source] fsd_shape::Error),
    /// Too few pixels around the mask, and the minimum number.
    #[error("pixels around the mask: {0}; expected at least {1}: use a larger crop")]
    Crop(usize, usize),
    /// No light around the mask.
    #[error("the pixels around the mask are black; expected light of the empty slide around the nucleus")]
    Black,
    /// Too few pixels, and the minimum number.
    #[error("the mask has {0} pixels; expected at least {1}")]
    SmallMask(usize, usize),
    /// Too little absorbance, and the minimum.
    #[error("mean absorbance {0:.4}; expected at least {1}: a nucleus is darker than the pixels around it")]
    Faint(f64, f64),
}

/// An invalid field of a recipe.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {message}")]
pub struct InvalidField {
    /// The dotted path of the field, such as `optics.sigma_xy_um`.
    pub field: String,
    /// The value, what is wrong with it, and what is accepted.
    pub message: String,
}

fn count(fields: &[InvalidField]) -> String {
    match fields.len() {
        1 => "1 invalid field".to_owned(),
        n => format!("{n} invalid fields"),
    }
}

fn list(fields: &[InvalidField]) -> String {
    fields.iter().map(|p| format!("\n  {p}")).collect()
}
