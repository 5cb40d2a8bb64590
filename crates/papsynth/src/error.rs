//! What can go wrong.

/// Why an engine cannot be made, or an image not drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The recipe asks for something that cannot be.
    #[error("the recipe has {} that cannot be:{}", count(.0), list(.0))]
    Recipe(Vec<Problem>),
    /// The model cannot be used.
    #[error("the model: {0}")]
    Model(#[source] Cause),
    /// A class cannot be learned from the material given.
    #[error("class `{class}` cannot be learned: {cause}")]
    Learn {
        /// The class.
        class: String,
        /// Why, and what would help.
        #[source]
        cause: Cause,
    },
    /// The weight map or label image that the layout names was not given, or cannot be used.
    #[error("layout: {0}")]
    Layout(#[source] Cause),
    /// A scene that was read is not valid.
    #[error("the scene: {0}")]
    Scene(#[source] Cause),
    /// An image cannot be drawn from this recipe.
    #[error("image {index} cannot be drawn: {cause}")]
    Image {
        /// Index of the image.
        index: u64,
        /// Why, and what would help.
        #[source]
        cause: Cause,
    },
}

/// The cause of an [`Error`]: which field or object, which value, and what is accepted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Cause {
    /// A number lies outside its range.
    #[error("{field}: {value} is outside {low} to {high}")]
    OutOfRange {
        /// Path of the field.
        field: String,
        /// Its value.
        value: f64,
        /// The least accepted value.
        low: f64,
        /// The largest accepted value.
        high: f64,
    },
    /// A profile of a model is empty.
    #[error("{0}: it is empty; expected at least one number")]
    EmptyProfile(String),
    /// A class of a model has no usable name.
    #[error("classes: `{0}` is no name; expected letters, digits, `-` and `_`")]
    ClassName(String),
    /// The model lacks a class; second, those that it has.
    #[error("the model has no class `{}`; it has {}", .0, .1.join(", "))]
    UnknownClass(String, Vec<String>),
    /// Statistics of outlines do not fit together.
    #[error("{0}: {1}")]
    Shapes(String, #[source] fsd_shape::Error),
    /// The pixels of a donor are not whole rows.
    #[error("{field}.width: {width} does not divide its {pixels} pixels into rows")]
    DonorSize {
        /// Path of the donor.
        field: String,
        /// Its columns.
        width: usize,
        /// Its pixels.
        pixels: usize,
    },
    /// A donor has no pixel inside its nucleus.
    #[error("{0}.absorbance_milli: no pixel lies inside the nucleus")]
    EmptyDonor(String),
    /// The donors of a class differ in the size of their pixels.
    #[error("classes.{0}.nucleus.donors: their pixels differ in size; expected one size")]
    DonorPixels(String),
    /// A donor cannot be used as a texture.
    #[error("nucleus.donors: {0}")]
    Donor(#[source] quilt_texture::Error),
    /// A text is not JSON, or no model.
    #[error("this is no model of papsynth: {0}")]
    NotAModel(#[source] serde_json::Error),
    /// A text is not TOML.
    #[error("this is no class file of papsynth: {0}")]
    NotAClassFile(#[source] toml::de::Error),
    /// The text of a model is not a table.
    #[error("this is no model of papsynth: it is no table")]
    NotATable,
    /// A model of another version, and the version that is accepted.
    #[error("its version is {0}; this program reads version {1}")]
    ModelVersion(String, u32),
    /// A field of a model or of a scene has another type, is missing, or is not known.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// The provenance of a class file cannot be read.
    #[error("provenance: {0}")]
    Provenance(#[source] serde_json::Error),
    /// The classes of a class file are not a table.
    #[error("classes: expected a table of classes by name")]
    ClassesNotATable,
    /// A class file has a field that it must not have.
    #[error("`{0}` is not known here; expected version, provenance, classes")]
    UnknownField(String),
    /// Classes refer to each other with `like` in a circle.
    #[error("classes {} are like each other in a circle", .0.join(", "))]
    ClassCircle(Vec<String>),
    /// A class of a class file cannot be used.
    #[error("classes.{class}: {cause}")]
    Class {
        /// Its name.
        class: String,
        /// Why.
        #[source]
        cause: Box<Cause>,
    },

    /// The pixels of learning material have no usable size.
    #[error("pixel size {0} µm is outside 0.05 to 4")]
    PixelSize(f64),
    /// Too few outlines.
    #[error("{found} outlines of the {what} are too few; expected at least {least}")]
    TooFewOutlines {
        /// How many there are.
        found: usize,
        /// Of what: cell or nucleus.
        what: &'static str,
        /// How many are needed.
        least: usize,
    },
    /// An outline, by its index, crosses itself.
    #[error("outline {0} of the {1} crosses itself; expected simple closed curves")]
    CrossedOutline(usize, &'static str),
    /// No model of shapes fits the outlines of cells or nuclei.
    #[error("outlines of the {0}: {1}")]
    Outlines(&'static str, #[source] fsd_shape::Error),
    /// The image of a nucleus cannot be used.
    #[error("{name}: {flaw}")]
    Nucleus {
        /// Name of the image.
        name: String,
        /// Why.
        #[source]
        flaw: Flaw,
    },

    /// The layout names a file that was not given.
    #[error("`layout.path` = \"{path}\" names {what} that was not given")]
    NotGiven {
        /// The file.
        path: String,
        /// What it should hold.
        what: &'static str,
    },
    /// The file that the layout names cannot be used as a weight map.
    #[error("\"{path}\": {cause}")]
    Map {
        /// The file.
        path: String,
        /// Why.
        #[source]
        cause: Box<Cause>,
    },
    /// The pixels of a weight map, first, are not whole rows of a width.
    #[error("a weight map of {0} pixels cannot have rows of {1}")]
    MapSize(usize, usize),
    /// A weight is negative or not finite.
    #[error("the weight at pixel ({x}, {y}) is {weight}; expected a finite number of 0 or more")]
    Weight {
        /// Its column.
        x: usize,
        /// Its row.
        y: usize,
        /// The weight.
        weight: f32,
    },
    /// A weight map has no weight above zero.
    #[error("every weight is zero, so no object can ever be placed; expected at least one place above zero")]
    NoWeight,
    /// The labels of a layout cannot be smoothed.
    #[error("layout.smooth_um: {0}")]
    Smoothing(#[source] optics_psf::Error),
    /// More cells than the layout has room for.
    #[error(
        "{count} cells at least {spacing_um} µm apart do not fit where the layout lets them lie ({area_um2:.0} µm²): \
         at most about {room:.0} do; ask for fewer `cells`, a smaller `slide.spacing_um` or a larger field"
    )]
    NoRoom {
        /// Cells.
        count: usize,
        /// Least distance, µm.
        spacing_um: f64,
        /// Area that they may lie in, µm².
        area_um2: f64,
        /// How many fit.
        room: f64,
    },
    /// Placing the cells would take too many tries.
    #[error(
        "the weight map is so uneven that {count} cells would take about {tries:.0e} tries; \
         expected at most {most:.0e}: raise its dark parts, or ask for fewer `cells`"
    )]
    TooUneven {
        /// Cells.
        count: usize,
        /// Tries expected.
        tries: f64,
        /// Tries accepted.
        most: f64,
    },
    /// No place is left that is far enough from all cells placed so far.
    #[error(
        "after {placed} cells no place is left that is {spacing_um} µm from all others; ask for fewer `cells`, a \
         smaller `slide.spacing_um` or a larger field"
    )]
    Crowded {
        /// Cells placed so far.
        placed: usize,
        /// Least distance, µm.
        spacing_um: f64,
    },
    /// More objects than labels can number.
    #[error("{0} objects are more than labels can number; ask for fewer")]
    TooManyObjects(usize),

    /// The layout is not one of whole slides.
    #[error("layout.kind: slides know `uniform` and `clusters`; others describe one field")]
    LayoutOfField,
    /// Clusters too wide for the pixels of a slide.
    #[error("layout.radius_um: up to {0} is too wide for a slide of such pixels; expected at most {1:.0}")]
    WideClusters(f64, f64),
    /// More objects in a square of a slide than it can number.
    #[error(
        "{found} objects lie in a square of {side_px} x {side_px} pixels; a slide can number {most} there: ask for fewer"
    )]
    FullPlot {
        /// Side of the square, pixels.
        side_px: i64,
        /// How many there are.
        found: usize,
        /// How many can be numbered.
        most: usize,
    },
    /// An object of a slide reaches too far.
    #[error(
        "a {kind} reaches {reach_um:.0} µm at its place and depth, farther than `scan.max_object_radius_um` = {most_um}: raise that, or \
         make it smaller or nearer to focus"
    )]
    TooFar {
        /// Its kind.
        kind: &'static str,
        /// How far it reaches, µm.
        reach_um: f64,
        /// How far it may reach, µm.
        most_um: f64,
    },
    /// A frame, by column and row, is not on the slide, which has so many columns and rows.
    #[error("frame {:?} is not on the slide, which has {} x {}", .0, .1[0], .1[1])]
    NoFrame([u32; 2], [u32; 2]),
    /// A part is not on the slide.
    #[error("{} x {} pixels from {origin_px:?} on leave the slide of {} x {}", .size_px[0], .size_px[1], .slide_px[0], .slide_px[1])]
    OffSlide {
        /// Its first pixel.
        origin_px: [u32; 2],
        /// Its columns and rows.
        size_px: [u32; 2],
        /// Those of the slide.
        slide_px: [u32; 2],
    },

    /// A text is not JSON.
    #[error("this is not a scene of papsynth: {0}")]
    NotAScene(#[source] serde_json::Error),
    /// A scene has no list of objects.
    #[error("objects: expected a list of objects")]
    NoObjects,
    /// A text or a truth value, second, stands in place of a number.
    #[error("{0}: {1} is not a number")]
    NotANumber(String, String),
    /// A scene is a frame of a whole slide.
    #[error("`frame` and `plot` belong to whole slides; only scenes of single fields are read")]
    SlideScene,
    /// An object of a scene is not valid.
    #[error("objects[{index}] (id {id}): {cause}")]
    Object {
        /// Its place in the list, from 0.
        index: usize,
        /// Its id, as it was written.
        id: serde_json::Value,
        /// Why.
        #[source]
        cause: Box<Cause>,
    },
    /// Two objects of a scene have the same id.
    #[error("id: another object has the same id")]
    SameId,
    /// An object reaches too far for the pixels of its scene; second, how far it may reach.
    #[error("it reaches {0:.0} µm; with pixels of this size at most {1:.0} µm are accepted")]
    Reach(f64, f64),
    /// A cell of the scene has a class that the recipe does not have.
    #[error("the scene holds a cell of class `{0}`, which its recipe does not")]
    ForeignClass(String),
    /// The scene's light has three colours, and its optics are Gaussians.
    #[error("colour is not known to Gaussians")]
    ColourWithGaussians,
    /// Optics cannot be computed; first, the field.
    #[error("{0}: {1}")]
    Optics(&'static str, #[source] optics_psf::Error),
    /// The light cannot be computed.
    #[error("light: {0}")]
    Light(#[from] dye_spectra::Error),
    /// The background cannot be computed.
    #[error("background: {0}")]
    Background(#[from] perlin_bg::Error),
    /// The camera cannot be simulated.
    #[error("camera: {0}")]
    Camera(#[from] ccd_noise::Error),
    /// An outline cannot be drawn or measured.
    #[error(transparent)]
    Outline(#[from] fsd_shape::Error),
    /// A sheet cannot be pressed or folded.
    #[error(transparent)]
    Sheet(#[from] cloth_verlet::Error),
    /// A cytoskeleton cannot be grown.
    #[error(transparent)]
    Cytoskeleton(#[from] voronoi_cytoskeleton::Error),
    /// A texture cannot be made of donors.
    #[error(transparent)]
    Texture(#[from] quilt_texture::Error),
    /// A texture cannot be drawn from its spectrum.
    #[error(transparent)]
    Spectrum(#[from] spectral_field::Error),
}

impl From<optics_psf::Error> for Cause {
    fn from(error: optics_psf::Error) -> Self {
        Self::Optics("optics", error)
    }
}

/// Refuses a number that is not finite or lies outside a range.
pub(crate) fn within(field: &str, value: f64, [low, high]: [f64; 2]) -> Result<(), Cause> {
    if value.is_finite() && (low..=high).contains(&value) {
        return Ok(());
    }
    Err(Cause::OutOfRange { field: field.to_owned(), value, low, high })
}

/// Why the image of a nucleus cannot be learned from.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Flaw {
    /// Image and mask are not two images of the same size.
    #[error("its image has {pixels} pixels, its mask {mask}; expected as many, in rows of {width}")]
    Size {
        /// Pixels of the image.
        pixels: usize,
        /// Pixels of the mask.
        mask: usize,
        /// Columns.
        width: usize,
    },
    /// A pixel, by column and row, is negative or not finite.
    #[error("pixel ({0}, {1}) is {2}")]
    Pixel(usize, usize, f32),
    /// The mask has no single outline.
    #[error("its mask: {0}")]
    Mask(#[source] fsd_shape::Error),
    /// Too few pixels around the mask.
    #[error("only {0} pixels surround its mask; expected a wider crop")]
    Crop(usize),
    /// No light around the mask.
    #[error("its surroundings are black")]
    Black,
    /// Too few pixels, and the least number that is accepted.
    #[error("its mask has {0} pixels; expected at least {1}")]
    SmallMask(usize, usize),
    /// Too little absorbance, and the least that is accepted.
    #[error("its mean absorbance is {0:.4}, at least {1} is expected: a nucleus is darker than its surroundings")]
    Faint(f64, f64),
}

/// Something wrong with a recipe.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {message}")]
pub struct Problem {
    /// The field, as a dotted path: `optics.sigma_xy_um`.
    pub field: String,
    /// What is wrong with it: the value, and what would be accepted.
    pub message: String,
}

fn count(problems: &[Problem]) -> String {
    match problems.len() {
        1 => "a field".to_owned(),
        n => format!("{n} fields"),
    }
}

fn list(problems: &[Problem]) -> String {
    problems.iter().map(|p| format!("\n  {p}")).collect()
}
