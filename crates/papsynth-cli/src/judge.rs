//! `papsynth judge`: a report on the differences between two sets of fields.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use papsynth::recipe::diagnose::quoted;
use papsynth_dataset::read::{FieldFile, FieldNuclei, Limits};
use papsynth_dataset::{field_files, write_file};
use papsynth_judge::{
    Control, Error, Field, FieldImage, Judge, JudgeParams, Measurer, MeasurerParams, NucleiAnnotation, NucleiFrom,
    Progress,
};
use rayon::prelude::*;

use crate::args;
use crate::exit::{self, ErrorReport, ExitError};
use crate::output_file::{Kind, check_folder, check_writable};
use crate::report::Bar;
use crate::setup::pool;
use crate::words::counted;

/// Output files, and the beginnings by which older ones are recognised.
const PAGE: (&str, Kind) = (
    "report.html",
    Kind::Text(
        b"<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>papsynth judge<",
        "a report of papsynth judge",
    ),
);
const NUMBERS: (&str, Kind) = ("report.json", Kind::Text(b"{\n  \"judge_report\":", "a report of papsynth judge"));

/// Relative difference below which pixel sizes count as equal.
const SAME_PIXEL: f64 = 0.01;

/// Smallest number of fields per side.
const MIN_FIELDS: usize = 2;

/// Fields of one side, each with its pixel size, µm.
type Side = Vec<(f64, FieldFile)>;

pub(crate) fn run(args: &args::Judge) -> Result<(), ExitError> {
    check_folder(&args.out, &[PAGE, NUMBERS])?;
    check_writable(&args.out.join(PAGE.0))?;
    let (real, synthetic) = sides(args)?;
    // The common pixel size is the largest.
    let pixel_um = real.iter().chain(&synthetic).map(|(um, _)| *um).fold(0.0, f64::max);
    for (folder, side) in [(&args.real, &real), (&args.synthetic, &synthetic)] {
        note_few_slides(folder, side);
    }
    let nuclei_from = nuclei_from(args, &real, &synthetic)?;
    let params = MeasurerParams { pixel_um, nuclei_from, ..MeasurerParams::default() };
    let measurer = Measurer::new(&params).map_err(ExitError::input)?;
    let params = if args.quick { JudgeParams::quick() } else { JudgeParams::default() };
    let judge =
        Judge::new(&JudgeParams { seed: args.seed, features: args.features, ..params }).map_err(ExitError::input)?;
    let stop = exit::stop_flag()?;
    let bar = Bar::start(args.quiet);
    let report = |progress: Progress| bar.update(progress.done as u64, progress.total as u64, progress.phase);
    let control = Control { stop, report: &report };
    let pool = pool(args.threads)?;
    let compare = || {
        let real = measure(&real, &measurer, pixel_um, "measuring real fields", &control)?;
        let synthetic = measure(&synthetic, &measurer, pixel_um, "measuring synthetic fields", &control)?;
        judge.compare_with(&real, &synthetic, &control).map_err(|error| exit_error(&error, None))
    };
    let result = exit::until_stopped(stop, || pool.install(compare));
    bar.clear();
    let report = result?;
    let mut numbers = serde_json::to_string_pretty(&report).unwrap_or_default();
    numbers.push('\n');
    for ((name, ..), text) in [(PAGE, report.to_html()), (NUMBERS, numbers)] {
        write_file(&args.out.join(name), text.as_bytes())?;
    }
    exit::print(&format!("{}{}: {}, {}\n", report.to_text(), args.out.display(), PAGE.0, NUMBERS.0))
}

/// The fields of both sides that `--group` selects, with their pixel sizes.
fn sides(args: &args::Judge) -> Result<(Side, Side), ExitError> {
    let real = enough(&args.real, fields_of(&args.real, &args.group)?)?;
    let mut synthetic = field_files(&args.synthetic)?;
    // Synthetic fields without groups are not filtered.
    if synthetic.iter().any(|f| !f.group.is_empty()) {
        synthetic = of_groups(&args.synthetic, synthetic, &args.group)?;
    }
    let synthetic = enough(&args.synthetic, synthetic)?;
    let recorded = |files: &[FieldFile]| files.iter().find_map(|f| f.pixel_um);
    let of_real = args.pixel_um.or(recorded(&real));
    let of_synthetic = args.synthetic_pixel_um.or(recorded(&synthetic));
    let (Some(of_real), Some(of_synthetic)) = (of_real.or(of_synthetic), of_synthetic.or(of_real)) else {
        let message = "neither folder records its pixel size";
        return Err(ExitError::with_help(message, "give the pixel size in micrometres: --pixel-um"));
    };
    let side = |files: Vec<FieldFile>, given: Option<f64>, else_um: f64| {
        files.into_iter().map(|file| (given.or(file.pixel_um).unwrap_or(else_um), file)).collect()
    };
    Ok((side(real, args.pixel_um, of_real), side(synthetic, args.synthetic_pixel_um, of_synthetic)))
}

/// Checks that a folder has enough fields.
fn enough(folder: &Path, files: Vec<FieldFile>) -> Result<Vec<FieldFile>, ExitError> {
    if files.len() < MIN_FIELDS {
        let found = counted(files.len() as u64, "field", "fields");
        let message = format!("{}: {found}; expected at least {MIN_FIELDS}", folder.display());
        return Err(ExitError::with_help(message, "training and test use different fields"));
    }
    Ok(files)
}

/// The fields of a folder; if `groups` is not empty, only the fields of these groups.
pub(crate) fn fields_of(folder: &Path, groups: &[String]) -> Result<Vec<FieldFile>, ExitError> {
    of_groups(folder, field_files(folder)?, groups)
}

fn of_groups(folder: &Path, mut files: Vec<FieldFile>, groups: &[String]) -> Result<Vec<FieldFile>, ExitError> {
    let wanted = |file: &FieldFile| groups.contains(&file.group);
    if files.iter().any(wanted) {
        files.retain(wanted);
    } else if !groups.is_empty() {
        let message = format!("{}: no field of group {}", folder.display(), groups.join(" or "));
        if files.iter().all(|f| f.group.is_empty()) {
            let help = "the fields have no groups; frames.csv in the folder assigns them, with the columns frame,grade";
            return Err(ExitError::with_help(message, help));
        }
        let known: BTreeSet<&str> = files.iter().map(|f| f.group.as_str()).collect();
        return Err(ExitError::with_help(message, format!("groups of the folder: {}", quoted(known.into_iter()))));
    }
    Ok(files)
}

/// Prints a note if fields come from few slides, because slides differ by their stain.
fn note_few_slides(folder: &Path, side: &Side) {
    let slides: BTreeSet<u64> = side.iter().filter_map(|(_, file)| file.slide).collect();
    if !slides.is_empty() && 2 * slides.len() < side.len() {
        let (folder, fields) = (folder.display(), counted(side.len() as u64, "field", "fields"));
        let slides = counted(slides.len() as u64, "slide", "slides");
        exit::note(format!(
            "{folder}: {fields} from {slides}; stains differ between slides, so generate more slides for a fair test: \
             --set slide.fields_per_slide=1"
        ));
    }
}

/// The source of nuclei: `--nuclei`, or the best that all fields have.
fn nuclei_from(args: &args::Judge, real: &Side, synthetic: &Side) -> Result<NucleiFrom, ExitError> {
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
    let message = format!("--nuclei {0}: {1} has no {0}", from.name(), file.path().display());
    Err(ExitError::with_help(
        message,
        format!("leave out --nuclei, or give {} for all fields of both sides", from.name()),
    ))
}

/// Measures the fields of a side at the common pixel size.
fn measure(
    side: &Side,
    measurer: &Measurer,
    common_um: f64,
    phase: &str,
    control: &Control,
) -> Result<Vec<Field>, ExitError> {
    let done = AtomicUsize::new(0);
    let measure = |(pixel_um, file): &(f64, FieldFile)| {
        control.check().map_err(|error| exit_error(&error, None))?;
        let factor = common_um / pixel_um;
        let image = field_image(file)?;
        let image = if factor > 1.0 + SAME_PIXEL { image.coarsened(factor) } else { image };
        let field = measurer.measure_with(&image, control).map_err(|error| exit_error(&error, Some(file)))?;
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        (control.report)(Progress { phase, done, total: side.len() });
        Ok(field)
    };
    let fields: Vec<Result<Field, ExitError>> = side.par_iter().map(measure).collect();
    fields.into_iter().collect()
}

fn exit_error(error: &Error, file: Option<&FieldFile>) -> ExitError {
    match (error, file) {
        (Error::Stopped, _) => ExitError::interrupted(ErrorReport::new("stopped; no file was written")),
        (other, Some(file)) => ExitError::input(format!("{}: {other}", file.path().display())),
        (other, None) => ExitError::input(other),
    }
}

/// Reads a field with its nuclei.
pub(crate) fn field_image(file: &FieldFile) -> Result<FieldImage, ExitError> {
    let image = file.read(&Limits::default())?;
    let levels = |plane: &[u16]| plane.iter().map(|g| f32::from(*g)).collect();
    Ok(FieldImage {
        name: file.name.clone(),
        group: file.group.clone(),
        grey: levels(&image.grey),
        red_blue: image.red_blue.as_ref().map(|planes| planes.each_ref().map(|plane| levels(plane))),
        width: image.width,
        full_scale: f32::from(image.white),
        nuclei: match image.nuclei {
            FieldNuclei::Unknown => NucleiAnnotation::None,
            FieldNuclei::Points(points) => NucleiAnnotation::Points(points),
            FieldNuclei::Labels(labels) => NucleiAnnotation::Masks(labels),
        },
    })
}
