//! `papsynth match`: the recipe whose fields resemble real fields.

use papsynth::{Engine, Inputs};
use papsynth_dataset::read::FieldFile;
use papsynth_judge::{Control, FieldImage, NucleiAnnotation, NucleiFrom, Progress, describe};
use papsynth_match::{Error, Fit, Match, MatchParams, Origin, ParameterFit, PixelSize};
use serde_json::json;

use crate::args;
use crate::exit::{self, ErrorReport, ExitError};
use crate::judge::{field_image, fields_of};
use crate::output_file::{Kind, OutputFile, check_writable};
use crate::recipe_file::RecipeFile;
use crate::report::Bar;
use crate::setup::{pool, read_model};
use crate::words::counted;

/// Output files, and the beginnings by which older ones are recognised.
const RECIPE: Kind = Kind::Text(b"# Matched to ", "a recipe of papsynth match");
const REPORT: Kind = Kind::Text(b"{\n  \"match_report\":", "a report of papsynth match");

const PAGE: Kind = Kind::Text(
    b"<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>papsynth judge<",
    "a report of papsynth judge",
);

/// Pixel size of a 20x objective, µm: the start of the search for the pixel size.
const DEFAULT_PIXEL_UM: f64 = 0.33;

/// Statistics with the largest distance that are printed.
const MAX_PRINTED: usize = 8;

pub(crate) fn run(args: &args::Match) -> Result<(), ExitError> {
    let recipe_file = OutputFile::check(&args.out, RECIPE, args.force)?;
    let report_file = args.report.as_deref().map(|path| OutputFile::check(path, REPORT, args.force)).transpose()?;
    let page_file = args.page.as_deref().map(|path| OutputFile::check(path, PAGE, args.force)).transpose()?;
    for (option, path) in [("--report", &args.report), ("--page", &args.page)] {
        let Some(path) = path else { continue };
        if *path == args.out || (option == "--page" && args.report.as_ref() == Some(path)) {
            let message =
                format!("{option} {}: the same file as another output; expected another file", path.display());
            return Err(ExitError::input(message));
        }
    }
    let stop = exit::stop_flag()?;
    let model = read_model(args.model.as_deref())?;
    let recipe = RecipeFile::load(&args.recipe)?;
    recipe.check_classes(&model)?;
    let files = fields_of(&args.real, &args.group)?;
    let pixel = pixel_size(args, &files)?;
    let fields: Vec<FieldImage> = files.iter().map(|file| read(args, file)).collect::<Result<_, _>>()?;
    [Some(&args.out), args.report.as_ref(), args.page.as_ref()]
        .into_iter()
        .flatten()
        .try_for_each(|out| check_writable(out))?;

    let default = if args.quick { MatchParams::quick() } else { MatchParams::default() };
    let simulations = args.simulations.unwrap_or(default.simulations);
    let params = MatchParams { pixel, simulations, refine: args.refine, seed: args.seed, ..default };
    let matching = Match::new(&params, &recipe.recipe).map_err(|e| exit_error(&e, &args.real))?;
    let make = |recipe: &papsynth::recipe::Recipe| Engine::new(recipe, &model, &Inputs::default());
    let bar = Bar::start(args.quiet);
    let report = |progress: Progress| bar.update(progress.done as u64, progress.total as u64, progress.phase);
    let control = Control { stop, report: &report };
    let pool = pool(args.threads)?;
    let work = || {
        let fit = matching.run(&fields, &make, &control)?;
        let page = page_file.is_some().then(|| matching.compare(&fields, &fit, &make, &control)).transpose()?;
        Ok((fit, page))
    };
    let result = exit::until_stopped(stop, || pool.install(work));
    bar.clear();
    let (fit, page) = result.map_err(|error| exit_error(&error, &args.real))?;

    if let Some(file) = report_file {
        let text = serde_json::to_string_pretty(&json!({ "match_report": 1, "fit": fit, "seed": args.seed }));
        file.write(format!("{}\n", text.unwrap_or_default()).as_bytes())?;
    }
    let mut text = summary(&fit);
    if let (Some(file), Some(path), Some(page)) = (page_file, &args.page, page) {
        file.write(page.to_html().as_bytes())?;
        text.push_str(&format!("\n{}{}: the fields side by side\n", page.to_text(), path.display()));
    }
    recipe_file.write(fit.to_toml().as_bytes())?;
    let out = args.out.display();
    exit::print(&format!("{text}\n{out}: recipe written; `papsynth preview {out}` shows one of its fields\n"))
}

/// The pixel size: of `--pixel-um`, or as recorded in all files.
fn pixel_size(args: &args::Match, files: &[FieldFile]) -> Result<PixelSize, ExitError> {
    /// Relative difference below which pixel sizes count as equal.
    const SAME: f64 = 0.01;
    let recorded = files.iter().find_map(|f| f.pixel_um);
    let differs = |um: f64| recorded.is_some_and(|first| (um / first - 1.0).abs() > SAME);
    if let (None, Some(file)) = (args.pixel_um, files.iter().find(|f| f.pixel_um.is_some_and(differs))) {
        let (path, um) = (file.path().display(), file.pixel_um.unwrap_or_default());
        let message =
            format!("{path}: {um} µm per pixel; expected {} µm, as in the other fields", recorded.unwrap_or_default());
        return Err(ExitError::with_help(message, "match fields of each magnification separately"));
    }
    match (args.find_pixel, args.pixel_um.or(recorded)) {
        (true, um) => Ok(PixelSize::Sought(um.unwrap_or(DEFAULT_PIXEL_UM))),
        (false, Some(um)) => Ok(PixelSize::Known(um)),
        (false, None) => {
            let message = format!("{}: the pixel size is not recorded", args.real.display());
            let help = "give the pixel size in micrometres with --pixel-um, or estimate it with --find-pixel";
            Err(ExitError::with_help(message, help))
        }
    }
}

/// Reads a field, with the nuclei of `--nuclei`.
fn read(args: &args::Match, file: &FieldFile) -> Result<FieldImage, ExitError> {
    let mut image = field_image(file)?;
    match args.nuclei {
        None => {}
        Some(NucleiFrom::Search) => image.nuclei = NucleiAnnotation::None,
        Some(from) if NucleiFrom::of(&image.nuclei) < from => {
            let message = format!("--nuclei {0}: {1} has no {0}", from.name(), file.path().display());
            let help = format!("leave out --nuclei, or give {} for all fields", from.name());
            return Err(ExitError::with_help(message, help));
        }
        Some(_) => {}
    }
    Ok(image)
}

fn exit_error(error: &Error, real: &std::path::Path) -> ExitError {
    match error {
        Error::Stopped => ExitError::interrupted(ErrorReport::new("stopped; no file was written")),
        other => ExitError::input(format!("{}: {other}", real.display())),
    }
}

fn summary(fit: &Fit) -> String {
    let extended = if fit.extended {
        "the fields are fused from several focal planes: focus, blur, stray light, noise and softness of edges \
         begin with those of the preset extended-focus\n"
    } else {
        ""
    };
    let shown = |a: &&ParameterFit| a.origin != Origin::NotVisible;
    let name = |a: &ParameterFit| if a.unit.is_empty() { a.path.to_owned() } else { format!("{}, {}", a.path, a.unit) };
    let wide = fit.parameters.iter().filter(shown).map(|a| name(a).chars().count()).max().unwrap_or(0);
    let mut text = format!(
        "{}, {}; {} simulated\n{extended}\n{:<wide$} {:>10} {:>21} {:>10} {:>10}  source\n",
        counted(fit.fields.len() as u64, "field", "fields"),
        counted(fit.nuclei as u64, "nucleus", "nuclei"),
        counted(fit.simulated as u64, "field", "fields"),
        "parameter",
        "mean",
        "95 % interval",
        "spread",
        "before"
    );
    let number = |value: f64| format!("{value:.3}");
    let line = |a: &ParameterFit| {
        let [low, high] = a.interval.map(number);
        let interval = format!("{low} to {high}");
        let origin = if a.origin == Origin::Measured { "measured" } else { "simulated" };
        let name = name(a);
        let spread = if a.fields.is_empty() { "-".to_owned() } else { number(a.spread) };
        let (value, before) = (number(a.value), number(a.before));
        format!("{name:<wide$} {value:>10} {interval:>21} {spread:>10} {before:>10}  {origin}\n")
    };
    text.extend(fit.parameters.iter().filter(shown).map(line));
    let lost = fit.parameters.iter().filter(|a| a.origin == Origin::NotVisible);
    let lost: Vec<String> = lost.map(|a| format!("    {}\n", a.path)).collect();
    if !lost.is_empty() {
        text.push_str(&format!("without visible influence on these fields, unchanged:\n{}", lost.concat()));
    }
    let d = fit.distance;
    text.push_str(&format!(
        "spread: standard deviation between fields, of the logarithm for ratios\n\n\
         distance to the real fields, in standard deviations between fields: {:.2} before, {:.2} after\n",
        d.before, d.after
    ));
    if let Some(r) = &fit.refinement {
        let (before, after) = (r.before, r.after);
        text.push_str(&format!(
            "refined in {}: AUC {:.3} before, {:.3} after; of the held-out fields {:.3} before, {:.3} after{}\n",
            counted(r.rounds as u64, "round", "rounds"),
            before.used,
            after.used,
            before.held_out,
            after.held_out,
            if r.kept { "" } else { ": over-fitted, so the recipe is that before the search" }
        ));
    }
    let mut worst: Vec<_> = fit.statistics.iter().filter(|s| s.difference.is_finite()).collect();
    worst.sort_by(|a, b| b.difference.abs().total_cmp(&a.difference.abs()));
    text.push_str("largest differences:\n");
    for s in worst.iter().take(MAX_PRINTED) {
        text.push_str(&format!(
            "    {:<62} real {:>9.4}  before {:>9.4}  after {:>9.4}  difference {:>5.1}\n",
            in_words(&s.name),
            s.real,
            s.before,
            s.after,
            s.difference
        ));
    }
    text
}

/// Returns a statistic in words: `nuclei: core sd, sd` is that of a feature of nuclei within a field.
fn in_words(name: &str) -> String {
    let Some((_, feature)) = name.split_once(": ") else { return describe(name) };
    match feature.strip_suffix(", sd") {
        Some(feature) => format!("{}, ln of the spread within a field", describe(feature)),
        None => describe(feature),
    }
}
