//! `papsynth learn`: a model file from images and outlines of real cells.

use std::path::Path;

use papsynth::learn::{
    CytoplasmImage, CytoplasmParams, Donors, LearnParams, Material, NucleusImage, Point, learn, learn_cytoplasm,
    outline,
};
use papsynth::model::Model;
use papsynth_dataset::Error;
use papsynth_dataset::read::{
    FieldFile, Limits, components, image_files, read_label_map, read_nuclei, read_outlines, read_pairs,
};

use papsynth_judge::{Measurer, MeasurerParams, NucleiFrom};

use crate::args::Learn;
use crate::exit::{self, ExitError};
use crate::judge::{field_image, fields_of};
use crate::output_file::{Kind, OutputFile};
use crate::report::Spinner;
use crate::setup::read_model;
use crate::words::counted;
use papsynth::recipe::diagnose::{nearest, quoted};

/// The beginning of every model file.
const MODEL: Kind = Kind::Text(b"{\"version\":1,\"provenance\":", "a model of papsynth learn");

/// Points of an outline that is traced from a label image: ten for each of the 40 fitted harmonics.
const TRACED_POINTS: usize = 400;

/// Smallest area of a cell in a label image, µm²: below the smallest nucleus.
const MIN_CELL_UM2: f64 = 20.0;

pub(crate) fn run(args: &Learn) -> Result<(), ExitError> {
    let out_file = OutputFile::check(&args.out, MODEL, args.force)?;
    let limits = Limits::default();
    let mut base = read_model(args.base.as_deref())?;
    let mut textured = 0;
    if let Some(folder) = &args.cytoplasm {
        let _spinner = Spinner::start("measuring the texture of cytoplasm");
        let images = cytoplasm(folder, args.pixel_um)?;
        textured = images.len();
        let params = CytoplasmParams { pixel_um: texture_pixel(args.pixel_um), source: source(args) };
        base = learn_cytoplasm(&base, &images, &params).map_err(ExitError::input)?;
    }
    let Some(class) = &args.class else {
        out_file.write(base.to_json().as_bytes())?;
        let (out, fields) = (args.out.display(), counted(textured as u64, "field", "fields"));
        return exit::print(&format!(
            "{out}: texture of cytoplasm from {fields}\nUse it with: papsynth generate --model {out} ...\n"
        ));
    };
    let like = base_class(args, class, &base)?;
    let nuclei = match &args.nuclei {
        None => Vec::new(),
        Some(folder) => nuclei(folder, args.masks.as_deref(), &limits)?,
    };
    let cells = match (&args.outlines, &args.labels) {
        (Some(file), _) => outlines(file, &limits)?,
        (None, Some(folder)) => traced(folder, args.pixel_um, &limits)?,
        (None, None) => Vec::new(),
    };
    let nucleus_outlines = args.nucleus_outlines.as_deref().map_or(Ok(Vec::new()), |file| outlines(file, &limits))?;
    let material = Material { nuclei: &nuclei, nucleus_outlines: &nucleus_outlines, cytoplasm_outlines: &cells };
    let params = LearnParams {
        class: class.clone(),
        like,
        bethesda: args.bethesda.clone().unwrap_or_default(),
        pixel_um: args.pixel_um,
        source: args.source.clone().unwrap_or_else(|| source(args)),
        donors: if args.numbers_only { Donors::NumbersOnly } else { Donors::Keep },
    };
    let model = learn(&base, &material, &params).map_err(ExitError::input)?;
    out_file.write(model.to_json().as_bytes())?;
    let read = [
        (nuclei.len(), "image of a nucleus", "images of nuclei"),
        (nucleus_outlines.len(), "outline of a nucleus", "outlines of nuclei"),
        (cells.len(), "outline of a cell", "outlines of cells"),
        (textured, "field with cytoplasm", "fields with cytoplasm"),
    ];
    let read = read.iter().filter(|(count, ..)| *count > 0);
    let read = read.map(|(count, one, many)| counted(*count as u64, one, many)).collect::<Vec<_>>().join(", ");
    let out = args.out.display();
    exit::print(&format!(
        "{out}: class `{class}` from {read}\n\
         Use it with: papsynth generate --model {out} --set cells.{class}.count=10 ...\n"
    ))
}

/// The class of the base model for properties without data: `--like`, or the class of the same name.
fn base_class(args: &Learn, class: &String, base: &Model) -> Result<String, ExitError> {
    let wanted = args.like.as_ref().unwrap_or(class);
    if base.classes.contains_key(wanted) {
        return Ok(wanted.clone());
    }
    let known = || base.classes.keys().map(String::as_str);
    let message = format!("the base model has no class `{wanted}`");
    let help = match (nearest(wanted, known()), &args.like) {
        (Some(near), _) => format!("did you mean `{near}`? Classes of the model: {}", quoted(known())),
        (None, Some(_)) => format!("classes of the model: {}", quoted(known())),
        (None, None) => format!(
            "a new class takes all other properties from an existing class: give one with --like, of {}",
            quoted(known())
        ),
    };
    Err(ExitError::with_help(message, help))
}

/// The names of the input files and folders, without their paths.
fn source(args: &Learn) -> String {
    let given = [&args.nuclei, &args.nucleus_outlines, &args.outlines, &args.labels, &args.cytoplasm];
    let names = given.into_iter().flatten().filter_map(|path| path.file_name()).map(|name| name.to_string_lossy());
    names.collect::<Vec<_>>().join(", ")
}

/// Reads nuclei from a folder with the subfolders `images` and `masks`, or from two folders.
fn nuclei(folder: &Path, masks: Option<&Path>, limits: &Limits) -> Result<Vec<NucleusImage>, ExitError> {
    let samples = match masks {
        None => read_nuclei(folder, limits)?,
        Some(masks) => read_pairs(folder, masks, limits)?,
    };
    Ok(samples
        .into_iter()
        .map(|sample| NucleusImage {
            light: sample.image.fractions(),
            width: sample.image.width,
            name: sample.name,
            mask: sample.mask,
        })
        .collect())
}

/// Largest pixel size at which finer images are reduced, µm: a 20x objective.
const TEXTURE_UM: f64 = 0.33;

/// Relative difference below which pixel sizes count as equal.
const SAME_PIXEL: f64 = 0.25;

/// Returns the pixel size of the texture of cytoplasm, µm.
fn texture_pixel(pixel_um: f64) -> f64 {
    if pixel_um < TEXTURE_UM * (1.0 - SAME_PIXEL) { TEXTURE_UM } else { pixel_um }
}

/// Reads fields and finds the areas that show cytoplasm alone.
fn cytoplasm(folder: &Path, pixel_um: f64) -> Result<Vec<CytoplasmImage>, ExitError> {
    let files = fields_of(folder, &[])?;
    let texture_um = texture_pixel(pixel_um);
    let nuclei_from = if files.iter().all(FieldFile::has_points) { NucleiFrom::Points } else { NucleiFrom::Search };
    let params = MeasurerParams { pixel_um: texture_um, nuclei_from, ..MeasurerParams::default() };
    let measurer = Measurer::new(&params).map_err(ExitError::input)?;
    let measure = |file: &FieldFile| {
        let image = field_image(file)?;
        let image = if texture_um > pixel_um { image.coarsened(texture_um / pixel_um) } else { image };
        let found = measurer.bare_cytoplasm(&image);
        let found = found.map_err(|error| ExitError::input(format!("{}: {error}", file.path().display())))?;
        Ok(CytoplasmImage {
            name: file.path().display().to_string(),
            width: found.width,
            absorbance: found.absorbance,
            mean: found.mean,
            mask: found.mask,
            empty: found.empty,
            noise: found.noise,
            blur_px: found.blur_px,
        })
    };
    files.iter().map(measure).collect()
}

fn outlines(file: &Path, limits: &Limits) -> Result<Vec<Vec<Point>>, ExitError> {
    Ok(read_outlines(file, limits)?.into_iter().map(|outline| outline.points).collect())
}

/// Traces the regions of label images that do not touch the border.
fn traced(folder: &Path, pixel_um: f64, limits: &Limits) -> Result<Vec<Vec<Point>>, ExitError> {
    let smallest_px = MIN_CELL_UM2 / (pixel_um * pixel_um);
    let mut outlines = Vec::new();
    for path in image_files(folder)?.values() {
        let refuse = |what: papsynth::ErrorKind| ExitError::input(format!("{}: {what}", path.display()));
        let labels = read_label_map(path, limits)?;
        let regions = components(&labels, limits).map_err(|problem| Error::Input { path: path.clone(), problem })?;
        for region in regions.iter().filter(|r| !r.at_border && r.mask.area() as f64 >= smallest_px) {
            let (tile, width, _) = region.tile();
            outlines.push(outline(&tile, width, TRACED_POINTS).map_err(refuse)?);
        }
    }
    if outlines.is_empty() {
        let message = format!("{}: no complete cell in the label images", folder.display());
        let help = format!("expected regions of {MIN_CELL_UM2} um2 or more that do not touch the border");
        return Err(ExitError::with_help(message, help));
    }
    Ok(outlines)
}
