//! `papsynth learn`: a model file from images and outlines of real cells.

use std::path::Path;

use papsynth::learn::{Donors, LearnParams, Material, NucleusImage, Point, learn, outline};
use papsynth::model::Model;
use papsynth_dataset::Error;
use papsynth_dataset::read::{Limits, components, image_files, read_label_map, read_nuclei, read_outlines, read_pairs};

use crate::args::Learn;
use crate::exit::{self, ExitError};
use crate::output_file::{Kind, OutputFile};
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
    let base = read_model(args.base.as_deref())?;
    let like = base_class(args, &base)?;
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
        class: args.class.clone(),
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
    ];
    let read = read.iter().filter(|(count, ..)| *count > 0);
    let read = read.map(|(count, one, many)| counted(*count as u64, one, many)).collect::<Vec<_>>().join(", ");
    let (out, class) = (args.out.display(), &args.class);
    exit::print(&format!(
        "{out}: class `{class}` from {read}\n\
         Use it with: papsynth generate --model {out} --set cells.{class}.count=10 ...\n"
    ))
}

/// The class of the base model for properties without data: `--like`, or the class of the same name.
fn base_class(args: &Learn, base: &Model) -> Result<String, ExitError> {
    let wanted = args.like.as_ref().unwrap_or(&args.class);
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
    let given = [&args.nuclei, &args.nucleus_outlines, &args.outlines, &args.labels];
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
