//! `papsynth rerender` and `papsynth convert`: a data set imaged again, or in other formats.

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use papsynth::recipe::Recipe;
use papsynth_dataset::{Dataset, Layout, Outcome, image_paths, truth_difference};
use toml::Table;

use crate::args::{Convert, EngineArgs, RecipeArgs, Rerender};
use crate::exit::{self, ExitError};
use crate::memory;
use crate::report::FrameCounter;
use crate::setup::{Setup, run_of};
use crate::words::{frames_written, ranges};

/// Sections of a recipe that change the images of a scene, but not its objects.
const IMAGING: [&str; 6] = ["background", "camera", "focus", "light", "optics", "stain"];

pub(crate) fn run(args: &Rerender) -> Result<(), ExitError> {
    let source = Dataset::open(&args.dir)?;
    source.check_inputs()?;
    source.check_finished()?;
    let frames: Vec<u64> = image_paths(&source)?.into_keys().collect();
    let seed = source.identity().seed;
    let before = load(args, seed, false)?;
    let path = source.path().join("recipe.toml");
    let recipe = std::fs::read_to_string(&path).map_err(|error| ExitError::file("read", &path, &error))?;
    if before.recipe.recipe.to_toml() != recipe {
        return Err(ExitError::with_help(
            format!("{}: recipe.toml was written by another release of papsynth", args.dir.display()),
            "use the release that wrote the data set",
        ));
    }
    let after = load(args, seed, true)?;
    let changed = changed_sections(&before.recipe.recipe, &after.recipe.recipe);
    if let Some(section) = changed.iter().find(|section| !IMAGING.contains(&section.as_str())) {
        return Err(ExitError::with_help(
            format!("`{section}` changes the objects of a scene; rerender changes only how scenes are imaged"),
            format!("rerender accepts {}; for other sections use papsynth generate", IMAGING.join(", ")),
        ));
    }
    let (layout, _) = args.layout.layout(0);
    let stop = exit::stop_flag()?;
    let outcome = render(&after, seed, &ranges(&frames), &layout, &args.out, args.quiet, stop)?;
    if let Some(difference) = truth_difference(&args.dir, &args.out)? {
        return Err(ExitError::with_help(
            format!("the ground truth differs: {difference}"),
            "`optics.oversampling` changes masks; keep its value",
        ));
    }
    if args.quiet {
        return Ok(());
    }
    let (out, dir, frames) = (args.out.display(), args.dir.display(), frames_written(outcome.written, outcome.present));
    exit::print(&format!("{out}: {frames}; the ground truth equals that of {dir}\n"))
}

/// `papsynth convert`: a data set in other formats.
pub(crate) fn convert(args: &Convert) -> Result<(), ExitError> {
    let layout = args.files.layout(args.format.clone());
    let stop = exit::stop_flag()?;
    let total = Dataset::open(&args.dir)?.frame_locations()?.len() as u64;
    let counter = FrameCounter::start(args.quiet, "converting frames", total);
    let outcome = papsynth_dataset::convert(&args.dir, &args.out, &layout, stop, &|_| counter.step());
    counter.clear();
    let outcome = outcome?;
    let out = args.out.display();
    if outcome.stopped {
        return Err(ExitError::stopped(format!("stopped; every file in {out} is complete")));
    }
    if args.quiet {
        return Ok(());
    }
    exit::print(&format!("{out}: {}\n", frames_written(outcome.written, outcome.present)))
}

/// The engine of the data set's recipe; with the options of the command line if `changed`.
fn load(args: &Rerender, seed: u64, changed: bool) -> Result<Setup, ExitError> {
    let engine = EngineArgs {
        recipe: RecipeArgs {
            recipe: Some(args.dir.join("recipe.toml")),
            preset: None,
            with: if changed { args.with.clone() } else { Vec::new() },
            camera: args.camera.filter(|_| changed),
            widen: None,
            set: if changed { args.set.clone() } else { Vec::new() },
            vary: Vec::new(),
        },
        model: Some(args.dir.join("model.json")),
        seed,
        threads: args.threads,
    };
    Setup::load(&engine, None)
}

fn changed_sections(before: &Recipe, after: &Recipe) -> Vec<String> {
    let table = |recipe: &Recipe| -> Table { toml::from_str(&recipe.to_toml()).unwrap_or_default() };
    let (before, after) = (table(before), table(after));
    let names: std::collections::BTreeSet<&String> = before.keys().chain(after.keys()).collect();
    names.into_iter().filter(|name| before.get(*name) != after.get(*name)).cloned().collect()
}

/// Generates ranges of frames.
pub(crate) fn render(
    setup: &Setup,
    seed: u64,
    frames: &[Range<u64>],
    layout: &Layout,
    out: &std::path::Path,
    quiet: bool,
    stop: &AtomicBool,
) -> Result<Outcome, ExitError> {
    let workers = memory::frames_at_once(setup, layout, setup.threads)?;
    let dataset = Dataset::create_or_resume(out, &setup.info(seed, layout))?;
    let mut sum = Outcome { present: 0, written: 0, stopped: false };
    let count = frames.iter().map(|range| range.end - range.start).sum();
    let counter = FrameCounter::start(quiet, "rendering frames", count);
    for frames in frames {
        let run = run_of(frames.clone(), workers, stop);
        let outcome = dataset.generate(&setup.engine, &run, &|_| counter.step());
        let outcome = outcome.map_err(|error| setup.error(error))?;
        sum.present += outcome.present;
        sum.written += outcome.written;
        if outcome.stopped {
            return Err(ExitError::stopped(format!("stopped; every file in {} is complete", out.display())));
        }
    }
    counter.clear();
    dataset.finish()?;
    Ok(sum)
}
