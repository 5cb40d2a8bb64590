//! `papsynth match`: the recipe whose fields resemble real fields.

use papsynth::{Engine, Inputs};
use papsynth_judge::{Control, FieldImage, Progress};
use papsynth_match::{Error, Fit, Match, MatchParams, Origin, ParameterFit, PixelSize};
use serde_json::json;

use crate::args;
use crate::exit::{self, ErrorReport, ExitError};
use crate::judge::{field_image, fields_of};
use crate::output_file::{Kind, OutputFile, check_writable};
use crate::report::Bar;
use crate::setup::{pool, read_model};
use crate::words::counted;

/// Output files, and the beginnings by which older ones are recognised.
const RECIPE: Kind = Kind::Text(b"# Matched to ", "a recipe of papsynth match");
const REPORT: Kind = Kind::Text(b"{\n  \"match_report\":", "a report of papsynth match");

/// Pixel size of a 20x objective, µm: the start of the search for the pixel size.
const DEFAULT_PIXEL_UM: f64 = 0.33;

/// Statistics with the largest distance that are printed.
const MAX_PRINTED: usize = 8;

pub(crate) fn run(args: &args::Match) -> Result<(), ExitError> {
    let recipe_file = OutputFile::check(&args.out, RECIPE, args.force)?;
    let report_file = args.report.as_deref().map(|path| OutputFile::check(path, REPORT, args.force)).transpose()?;
    if args.report.as_ref() == Some(&args.out) {
        let message = format!("--report {}: the same file as --out; expected another file", args.out.display());
        return Err(ExitError::input(message));
    }
    let stop = exit::stop_flag()?;
    let model = read_model(args.model.as_deref())?;
    let files = fields_of(&args.real, &args.group)?;
    let recorded = files.iter().find_map(|f| f.pixel_um);
    let pixel = match (args.find_pixel, args.pixel_um.or(recorded)) {
        (true, um) => PixelSize::Sought(um.unwrap_or(DEFAULT_PIXEL_UM)),
        (false, Some(um)) => PixelSize::Known(um),
        (false, None) => {
            let message = format!("{}: the pixel size is not recorded", args.real.display());
            let help = "give the pixel size in micrometres with --pixel-um, or estimate it with --find-pixel";
            return Err(ExitError::with_help(message, help));
        }
    };
    let fields: Vec<FieldImage> = files.iter().map(field_image).collect::<Result<_, _>>()?;
    [Some(&args.out), args.report.as_ref()].into_iter().flatten().try_for_each(|out| check_writable(out))?;

    let default = if args.quick { MatchParams::quick() } else { MatchParams::default() };
    let simulations = args.simulations.unwrap_or(default.simulations);
    let params = MatchParams { pixel, simulations, seed: args.seed, ..default };
    let base = args.preset.recipe();
    let matching = Match::new(&params, &base).map_err(|e| exit_error(&e, &args.real))?;
    let make = |recipe: &papsynth::recipe::Recipe| Engine::new(recipe, &model, &Inputs::default());
    let bar = Bar::start(args.quiet);
    let report = |progress: Progress| bar.update(progress.done as u64, progress.total as u64, progress.phase);
    let control = Control { stop, report: &report };
    let pool = pool(args.threads)?;
    let fit = exit::until_stopped(stop, || pool.install(|| matching.run(&fields, &make, &control)));
    bar.clear();
    let fit = fit.map_err(|error| exit_error(&error, &args.real))?;

    if let Some(file) = report_file {
        let text = serde_json::to_string_pretty(&json!({ "match_report": 1, "fit": fit, "seed": args.seed }));
        file.write(format!("{}\n", text.unwrap_or_default()).as_bytes())?;
    }
    recipe_file.write(fit.to_toml().as_bytes())?;
    let out = args.out.display();
    exit::print(&format!("{}\n{out}: use it with papsynth generate {out}\n", summary(&fit)))
}

fn exit_error(error: &Error, real: &std::path::Path) -> ExitError {
    match error {
        Error::Stopped => ExitError::interrupted(ErrorReport::new("stopped; no file was written")),
        other => ExitError::input(format!("{}: {other}", real.display())),
    }
}

fn summary(fit: &Fit) -> String {
    let extended = if fit.extended {
        "the fields have an extended depth of field, so the match begins with that of the preset\n"
    } else {
        ""
    };
    let mut text = format!(
        "{}, {}, {}; {} simulated\n{extended}\n{:<24} {:>10} {:>21} {:>10}  source\n",
        counted(fit.fields as u64, "field", "fields"),
        counted(fit.windows as u64, "window", "windows"),
        counted(fit.nuclei as u64, "nucleus", "nuclei"),
        counted(fit.simulated as u64, "recipe", "recipes"),
        "parameter",
        "value",
        "95 % interval",
        "before"
    );
    let number = |value: f64| format!("{value:.3}");
    let line = |a: &ParameterFit| {
        let [low, high] = a.interval.map(number);
        let interval = format!("{low} to {high}");
        let origin = match a.origin {
            Origin::Measured => "measured",
            Origin::Simulated => "simulated",
            Origin::NotIdentified => "not identified",
        };
        let name = if a.unit.is_empty() { a.parameter.name() } else { format!("{}, {}", a.parameter.name(), a.unit) };
        format!("{name:<24} {:>10} {interval:>21} {:>10}  {origin}\n", number(a.value), number(a.before))
    };
    text.extend(fit.parameters.iter().filter(|a| a.origin != Origin::NotIdentified).map(line));
    let lost: Vec<String> =
        fit.parameters.iter().filter(|a| a.origin == Origin::NotIdentified).map(|a| a.parameter.name()).collect();
    if !lost.is_empty() {
        text.push_str(&format!("not identified, unchanged: {}\n", lost.join(", ")));
    }
    let d = fit.distance;
    text.push_str(&format!(
        "\ndistance to the real windows, in standard errors: {:.2} before, {:.2} after the estimate, {:.2} after the search\n",
        d.before, d.estimated, d.after
    ));
    let mut worst: Vec<_> = fit.statistics.iter().filter(|s| s.standard_errors.is_finite()).collect();
    worst.sort_by(|a, b| b.standard_errors.abs().total_cmp(&a.standard_errors.abs()));
    text.push_str("largest differences:\n");
    for s in worst.iter().take(MAX_PRINTED) {
        text.push_str(&format!(
            "    {:<44} real {:>9.4}  before {:>9.4}  after {:>9.4}\n",
            s.name, s.real, s.before, s.after
        ));
    }
    text
}
