//! `papsynth learn`: files of real material in, a model file out.

use std::path::Path;

use papsynth::learn::{Donors, LearnParams, Material, NucleusImage, Point, learn, outline};
use papsynth::model::Model;
use papsynth_dataset::read::{Limits, components, image_files, read_label_map, read_nuclei, read_outlines, read_pairs};
use papsynth_dataset::{Error, write_file};

use crate::args::Learn;
use crate::exit::{self, Failure};
use crate::setup::read_model;
use crate::text_file;
use papsynth::recipe::diagnose::{nearest, quoted};

/// Points of an outline that is traced from a label image: ten for each of the 40 harmonics that are fitted.
const TRACED_POINTS: usize = 400;

/// Smallest region of a label image that is taken for a cell, µm²: less than the smallest nucleus.
const SMALLEST_CELL_UM2: f64 = 20.0;

pub(crate) fn run(args: &Learn) -> Result<(), Failure> {
    // The beginning of every model that was written.
    text_file::may_replace(&args.out, b"{\"version\":", "an older model")?;
    let limits = Limits::default();
    let base = read_model(args.base.as_deref())?;
    let like = class_to_take_after(args, &base)?;
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
    let model = learn(&base, &material, &params).map_err(Failure::input)?;
    write_file(&args.out, model.to_json().as_bytes())?;
    let read = [
        (nuclei.len(), "images of nuclei"),
        (nucleus_outlines.len(), "outlines of nuclei"),
        (cells.len(), "outlines of cells"),
    ];
    let read = read.iter().filter(|(count, _)| *count > 0);
    let read = read.map(|(count, what)| format!("{count} {what}")).collect::<Vec<_>>().join(", ");
    let (out, class) = (args.out.display(), &args.class);
    exit::print(&format!(
        "{out}: class `{class}` from {read}\n\
         Use it with: papsynth generate --model {out} --set cells.{class}.count=10 ...\n"
    ))
}

/// What the material does not show is taken from a class of the base model: the same, or the one that was named.
fn class_to_take_after(args: &Learn, base: &Model) -> Result<String, Failure> {
    let wanted = args.like.as_ref().unwrap_or(&args.class);
    if base.classes.contains_key(wanted) {
        return Ok(wanted.clone());
    }
    let known = || base.classes.keys().map(String::as_str);
    let message = format!("the base model has no class `{wanted}`");
    let help = match (nearest(wanted, known()), &args.like) {
        (Some(near), _) => format!("did you mean `{near}`? It has {}", quoted(known())),
        (None, Some(_)) => format!("it has {}", quoted(known())),
        (None, None) => format!(
            "a new class takes after another in what its material does not show: name one with --like, of {}",
            quoted(known())
        ),
    };
    Err(Failure::wrong(message, help))
}

/// The names of files and folders, without where they lie on this machine.
fn source(args: &Learn) -> String {
    let given = [&args.nuclei, &args.nucleus_outlines, &args.outlines, &args.labels];
    let names = given.into_iter().flatten().filter_map(|path| path.file_name()).map(|name| name.to_string_lossy());
    names.collect::<Vec<_>>().join(", ")
}

/// Nuclei of a folder with `images` and `masks` in it, or of two folders.
fn nuclei(folder: &Path, masks: Option<&Path>, limits: &Limits) -> Result<Vec<NucleusImage>, Failure> {
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

fn outlines(file: &Path, limits: &Limits) -> Result<Vec<Vec<Point>>, Failure> {
    Ok(read_outlines(file, limits)?.into_iter().map(|outline| outline.points).collect())
}

/// The outlines of all regions of label images that lie in them completely.
fn traced(folder: &Path, pixel_um: f64, limits: &Limits) -> Result<Vec<Vec<Point>>, Failure> {
    let smallest_px = SMALLEST_CELL_UM2 / (pixel_um * pixel_um);
    let mut outlines = Vec::new();
    for path in image_files(folder)?.values() {
        let refuse = |what: papsynth::Cause| Failure::input(format!("{}: {what}", path.display()));
        let labels = read_label_map(path, limits)?;
        let regions = components(&labels, limits).map_err(|problem| Error::Input { path: path.clone(), problem })?;
        for region in regions.iter().filter(|r| !r.at_border && r.mask.area() as f64 >= smallest_px) {
            let (tile, width, _) = region.tile();
            outlines.push(outline(&tile, width, TRACED_POINTS).map_err(refuse)?);
        }
    }
    if outlines.is_empty() {
        let message = format!("{}: no region of its label images is a whole cell", folder.display());
        let help = format!("expected regions of at least {SMALLEST_CELL_UM2} um2 that do not touch the border");
        return Err(Failure::wrong(message, help));
    }
    Ok(outlines)
}
