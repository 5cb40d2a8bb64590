//! `papsynth match`: real fields in, the recipe of fields like them out.

use papsynth::{Engine, Inputs};
use papsynth_dataset::write_file;
use papsynth_judge::{Control, FieldImage, Progress};
use papsynth_match::{Error, Fit, Match, MatchParams, Origin, ParameterFit, PixelSize};
use serde_json::json;

use crate::args;
use crate::exit::{self, Complaint, Failure};
use crate::judge::{fields_of, picture};
use crate::report::Bar;
use crate::setup::{pool, read_model};
use crate::text_file::{can_write, may_replace};

/// How files begin that may be replaced.
const RECIPE: &[u8] = b"# Matched to ";
const REPORT: &[u8] = b"{\n  \"match_report\":";

/// Pixels of a 20x objective, µm: where the search for their size begins.
const USUAL_PIXEL_UM: f64 = 0.33;

/// Statistics that are told of at the end: those that the recipe shows worst.
const TOLD: usize = 8;

pub(crate) fn run(args: &args::Match) -> Result<(), Failure> {
    may_replace(&args.out, RECIPE, "an older match")?;
    if let Some(report) = &args.report {
        may_replace(report, REPORT, "an older report of a match")?;
    }
    if args.report.as_ref() == Some(&args.out) {
        let message = format!("--report {}: this is the file of the recipe; expected another", args.out.display());
        return Err(Failure::input(message));
    }
    let stop = exit::watch()?;
    let model = read_model(args.model.as_deref())?;
    let files = fields_of(&args.real, &args.group)?;
    let recorded = files.iter().find_map(|f| f.pixel_um);
    let pixel = match (args.find_pixel, args.pixel_um.or(recorded)) {
        (true, um) => PixelSize::Sought(um.unwrap_or(USUAL_PIXEL_UM)),
        (false, Some(um)) => PixelSize::Known(um),
        (false, None) => {
            let message = format!("{}: nothing says how large the pixels are", args.real.display());
            let help = "give --pixel-um, the size of a pixel in micrometres, or --find-pixel";
            return Err(Failure::wrong(message, help));
        }
    };
    let fields: Vec<FieldImage> = files.iter().map(picture).collect::<Result<_, _>>()?;
    [Some(&args.out), args.report.as_ref()].into_iter().flatten().try_for_each(|out| can_write(out))?;

    let usual = if args.quick { MatchParams::quick() } else { MatchParams::default() };
    let simulations = args.budget.unwrap_or(usual.simulations);
    let params = MatchParams { pixel, simulations, seed: args.seed, ..usual };
    let base = args.preset.recipe();
    let matching = Match::new(&params, &base).map_err(|e| refuse(&e, &args.real))?;
    let make = |recipe: &papsynth::recipe::Recipe| Engine::new(recipe, &model, &Inputs::default());
    let bar = Bar::start(args.quiet);
    let report = |p: Progress| bar.say(p.done as u64, p.total as u64, p.phase);
    let control = Control { stop, report: &report };
    let fit =
        pool(args.threads)?.install(|| matching.run(&fields, &make, &control)).map_err(|e| refuse(&e, &args.real))?;
    bar.clear();

    if let Some(report) = &args.report {
        let text = serde_json::to_string_pretty(&json!({ "match_report": 1, "fit": fit, "seed": args.seed }));
        write_file(report, format!("{}\n", text.unwrap_or_default()).as_bytes())?;
    }
    write_file(&args.out, fit.to_toml().as_bytes())?;
    let out = args.out.display();
    exit::print(&format!("{}\n{out}: use it with papsynth generate {out}\n", told(&fit)))
}

fn refuse(error: &Error, real: &std::path::Path) -> Failure {
    match error {
        Error::Stopped => Failure::interrupted(Complaint::new("stopped; nothing was written")),
        other => Failure::input(format!("{}: {other}", real.display())),
    }
}

fn told(fit: &Fit) -> String {
    let begun = if fit.extended {
        "these fields are fused: begun from the preset as a scanner that fuses planes shows it\n"
    } else {
        ""
    };
    let mut text = format!(
        "{} fields, {} windows, {} nuclei; {} recipes simulated\n{begun}\n{:<24} {:>10} {:>21} {:>10}  from\n",
        fit.fields, fit.windows, fit.nuclei, fit.simulated, "parameter", "value", "95 % interval", "before"
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
        text.push_str(&format!("not identified, left as they were: {}\n", lost.join(", ")));
    }
    let d = fit.distance;
    text.push_str(&format!(
        "\ndistance from the real windows, in standard errors: {:.2} before, {:.2} as estimated, {:.2} after the search\n",
        d.before, d.estimated, d.after
    ));
    let mut worst: Vec<_> = fit.statistics.iter().filter(|s| s.standard_errors.is_finite()).collect();
    worst.sort_by(|a, b| b.standard_errors.abs().total_cmp(&a.standard_errors.abs()));
    text.push_str("farthest apart:\n");
    for s in worst.iter().take(TOLD) {
        text.push_str(&format!(
            "    {:<44} real {:>9.4}  before {:>9.4}  after {:>9.4}\n",
            s.name, s.real, s.before, s.after
        ));
    }
    text
}
