//! `papsynth judge`: two sets of fields in, a report of how they differ out.

use std::collections::BTreeSet;
use std::path::Path;

use papsynth::recipe::diagnose::quoted;
use papsynth_dataset::read::{FieldFile, FieldNuclei, Limits};
use papsynth_dataset::{field_files, write_file};
use papsynth_judge::{Field, FieldImage, Judge, JudgeParams, Measurer, MeasurerParams, NucleiAnnotation, NucleiFrom};
use rayon::prelude::*;

use crate::args;
use crate::exit::{self, Failure};
use crate::setup::pool;
use crate::text_file::may_replace_in;

/// Files that are written, and how those begin that may be replaced.
const PAGE: (&str, &[u8], &str) = (
    "report.html",
    b"<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>papsynth judge<",
    "an older report",
);
const NUMBERS: (&str, &[u8], &str) = ("report.json", b"{\n  \"judge_report\":", "an older report");

/// Pixels that differ by less are of one size.
const SAME_PIXEL: f64 = 0.01;

/// Fewest fields of a side.
const LEAST: usize = 2;

/// Fields of one side, each after the size of its pixels, µm.
type Side = Vec<(f64, FieldFile)>;

pub(crate) fn run(args: &args::Judge) -> Result<(), Failure> {
    may_replace_in(&args.out, &[PAGE, NUMBERS])?;
    let (real, synthetic) = sides(args)?;
    // The size that all pixels are brought to.
    let pixel_um = real.iter().chain(&synthetic).map(|(um, _)| *um).fold(0.0, f64::max);
    for (folder, side) in [(&args.real, &real), (&args.synthetic, &synthetic)] {
        few_slides(folder, side);
    }
    let nuclei_from = nuclei_from(args, &real, &synthetic)?;
    let gauge = Measurer::new(&MeasurerParams { pixel_um, nuclei_from, ..MeasurerParams::default() })
        .map_err(Failure::input)?;
    let params = if args.quick { JudgeParams::quick() } else { JudgeParams::default() };
    let judge = Judge::new(&JudgeParams { seed: args.seed, ..params }).map_err(Failure::input)?;
    let report = pool(args.threads)?.install(|| {
        let (real, synthetic) = (measure(&real, &gauge, pixel_um)?, measure(&synthetic, &gauge, pixel_um)?);
        judge.compare(&real, &synthetic).map_err(Failure::input)
    })?;
    let mut numbers = serde_json::to_string_pretty(&report).unwrap_or_default();
    numbers.push('\n');
    for ((name, ..), text) in [(PAGE, report.to_html()), (NUMBERS, numbers)] {
        write_file(&args.out.join(name), text.as_bytes())?;
    }
    exit::print(&format!("{}{}: {}, {}\n", report.to_text(), args.out.display(), PAGE.0, NUMBERS.0))
}

/// The fields of both sides, of the groups that are asked for, with the sizes of their pixels.
fn sides(args: &args::Judge) -> Result<(Side, Side), Failure> {
    let real = enough(&args.real, fields_of(&args.real, &args.group)?)?;
    let mut synthetic = field_files(&args.synthetic)?;
    // Groups are those of the real fields: synthetic ones without any are all of the kind that is judged.
    if synthetic.iter().any(|f| !f.group.is_empty()) {
        synthetic = of_groups(&args.synthetic, synthetic, &args.group)?;
    }
    let synthetic = enough(&args.synthetic, synthetic)?;
    let recorded = |files: &[FieldFile]| files.iter().find_map(|f| f.pixel_um);
    let of_real = args.pixel_um.or(recorded(&real));
    let of_synthetic = args.synthetic_pixel_um.or(recorded(&synthetic));
    let (Some(of_real), Some(of_synthetic)) = (of_real.or(of_synthetic), of_synthetic.or(of_real)) else {
        let message = "neither folder says how large its pixels are";
        return Err(Failure::wrong(message, "give --pixel-um, the size of a pixel in micrometres"));
    };
    let side = |files: Vec<FieldFile>, given: Option<f64>, else_um: f64| {
        files.into_iter().map(|file| (given.or(file.pixel_um).unwrap_or(else_um), file)).collect()
    };
    Ok((side(real, args.pixel_um, of_real), side(synthetic, args.synthetic_pixel_um, of_synthetic)))
}

/// The fields of a folder, if they are two or more.
fn enough(folder: &Path, files: Vec<FieldFile>) -> Result<Vec<FieldFile>, Failure> {
    if files.len() < LEAST {
        let message = format!("{}: there is 1 field; at least {LEAST} are needed", folder.display());
        return Err(Failure::wrong(message, "fields are never split between what is learnt from and what is tried"));
    }
    Ok(files)
}

/// The fields in a folder; of these groups alone, if any are named.
pub(crate) fn fields_of(folder: &Path, groups: &[String]) -> Result<Vec<FieldFile>, Failure> {
    of_groups(folder, field_files(folder)?, groups)
}

fn of_groups(folder: &Path, mut files: Vec<FieldFile>, groups: &[String]) -> Result<Vec<FieldFile>, Failure> {
    let wanted = |file: &FieldFile| groups.contains(&file.group);
    if files.iter().any(wanted) {
        files.retain(wanted);
    } else if !groups.is_empty() {
        let message = format!("{}: no field is of group {}", folder.display(), groups.join(" or "));
        if files.iter().all(|f| f.group.is_empty()) {
            let help = "fields have no groups there: frames.csv in that folder would name them, as frame,grade";
            return Err(Failure::wrong(message, help));
        }
        let known: BTreeSet<&str> = files.iter().map(|f| f.group.as_str()).collect();
        return Err(Failure::wrong(message, format!("there are {}", quoted(known.into_iter()))));
    }
    Ok(files)
}

/// Fields of one slide are alike, so that a few slides are told from any others: which is no fault of theirs.
fn few_slides(folder: &Path, side: &Side) {
    let slides: BTreeSet<u64> = side.iter().filter_map(|(_, file)| file.slide).collect();
    if !slides.is_empty() && 2 * slides.len() < side.len() {
        let (folder, fields, slides) = (folder.display(), side.len(), slides.len());
        exit::note(format!(
            "{folder}: {fields} fields of {slides} slides, which differ by their stain; more slides say more: generate with --set slide.fields_per_slide=1"
        ));
    }
}

/// What all fields allow, or what is asked for.
fn nuclei_from(args: &args::Judge, real: &Side, synthetic: &Side) -> Result<NucleiFrom, Failure> {
    let all = |has: fn(&FieldFile) -> bool| real.iter().chain(synthetic).map(|(_, file)| file).find(|file| !has(file));
    let lacks = |from: NucleiFrom| match from {
        NucleiFrom::Masks => all(FieldFile::has_masks),
        NucleiFrom::Points => all(FieldFile::has_points),
        NucleiFrom::Search => None,
    };
    let Some(from) = args.nuclei else {
        return Ok(NucleiFrom::ALL.into_iter().rev().find(|from| lacks(*from).is_none()).unwrap_or_default());
    };
    let Some(file) = lacks(from) else { return Ok(from) };
    let message = format!("--nuclei {}: {} has none", from.name(), file.path().display());
    Err(Failure::wrong(message, "all fields of both sides must have them"))
}

fn measure(side: &Side, gauge: &Measurer, pixel_um: f64) -> Result<Vec<Field>, Failure> {
    let measure = |(own_um, file): &(f64, FieldFile)| {
        let factor = pixel_um / own_um;
        let picture = picture(file)?;
        let picture = if factor > 1.0 + SAME_PIXEL { picture.coarsened(factor) } else { picture };
        gauge.measure(&picture).map_err(|error| Failure::input(format!("{}: {error}", file.path().display())))
    };
    let fields: Vec<Result<Field, Failure>> = side.par_iter().map(measure).collect();
    fields.into_iter().collect()
}

pub(crate) fn picture(file: &FieldFile) -> Result<FieldImage, Failure> {
    let image = file.read(&Limits::default())?;
    Ok(FieldImage {
        name: file.name.clone(),
        group: file.group.clone(),
        grey: image.grey.iter().map(|g| f32::from(*g)).collect(),
        width: image.width,
        full_scale: f32::from(image.white),
        nuclei: match image.nuclei {
            FieldNuclei::Unknown => NucleiAnnotation::None,
            FieldNuclei::Points(points) => NucleiAnnotation::Points(points),
            FieldNuclei::Labels(labels) => NucleiAnnotation::Masks(labels),
        },
    })
}
