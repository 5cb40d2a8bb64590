//! `papsynth rerender` and `papsynth convert`: a data set of another, under another microscope or in other formats.

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use papsynth::recipe::Recipe;
use papsynth_dataset::{Dataset, Layout, Outcome, Progress, image_paths, truth_difference};
use toml::Table;

use crate::args::{Convert, EngineArgs, RecipeArgs, Rerender};
use crate::exit::{self, Failure};
use crate::setup::{Setup, run_of};
use crate::words::{counted, runs};

/// The sections of a recipe that say how a scene is imaged, not what lies in it.
const IMAGING: [&str; 6] = ["background", "camera", "focus", "light", "optics", "stain"];

pub(crate) fn run(args: &Rerender) -> Result<(), Failure> {
    let source = Dataset::open(&args.dir)?;
    source.check_inputs()?;
    let frames: Vec<u64> = image_paths(&source)?.into_keys().collect();
    let seed = source.identity().seed;
    let before = load(args, seed, false)?;
    let path = source.path().join("recipe.toml");
    let recipe = std::fs::read_to_string(&path).map_err(|error| Failure::file("read", &path, &error))?;
    if before.recipe.recipe.to_toml() != recipe {
        return Err(Failure::wrong(
            format!("{}: this program reads its recipe otherwise", args.dir.display()),
            "a data set is rendered again by the release that made it",
        ));
    }
    let after = load(args, seed, true)?;
    let changed = changed_sections(&before.recipe.recipe, &after.recipe.recipe);
    if let Some(section) = changed.iter().find(|section| !IMAGING.contains(&section.as_str())) {
        return Err(Failure::wrong(
            format!("`{section}` says what lies in a scene; rerender changes how it is imaged"),
            format!("it takes {}; for all else: papsynth generate", IMAGING.join(", ")),
        ));
    }
    let (layout, _) = args.layout.layout(0);
    let stop = exit::watch()?;
    let outcome = render(&after, seed, &runs(&frames), &layout, &args.out, stop)?;
    if let Some(difference) = truth_difference(&args.dir, &args.out)? {
        return Err(Failure::wrong(
            format!("the truth is another: {difference}"),
            "a finer grid (`optics.oversampling`) draws other masks; leave it as it was",
        ));
    }
    if args.quiet {
        return Ok(());
    }
    let (out, dir, Outcome { written: made, present: kept, .. }) = (args.out.display(), args.dir.display(), outcome);
    exit::print(&format!("{out}: {made} frames made, {kept} were there; the truth is that of {dir}\n"))
}

/// `papsynth convert`: a data set in other formats.
pub(crate) fn convert(args: &Convert) -> Result<(), Failure> {
    let layout = args.files.layout(args.format.clone());
    let stop = exit::watch()?;
    let report = |_: Progress| ();
    let outcome = papsynth_dataset::convert(&args.dir, &args.out, &layout, stop, &report)?;
    let out = args.out.display();
    if outcome.stopped {
        let message = format!("stopped; every file in {out} is whole");
        return Err(Failure::stopped(message, "write"));
    }
    if args.quiet {
        return Ok(());
    }
    let there = if outcome.present > 0 { format!(", {} were there", outcome.present) } else { String::new() };
    exit::print(&format!("{out}: {} written{there}\n", counted(outcome.written, "frame", "frames")))
}

/// The engine of the data set's recipe, with what is set over it or without.
fn load(args: &Rerender, seed: u64, changed: bool) -> Result<Setup, Failure> {
    let engine = EngineArgs {
        recipe: RecipeArgs {
            recipe: Some(args.dir.join("recipe.toml")),
            preset: None,
            with: if changed { args.with.clone() } else { Vec::new() },
            camera: args.camera.filter(|_| changed),
            set: if changed { args.set.clone() } else { Vec::new() },
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

/// Makes frames that need not follow each other.
pub(crate) fn render(
    setup: &Setup,
    seed: u64,
    frames: &[Range<u64>],
    layout: &Layout,
    out: &std::path::Path,
    stop: &AtomicBool,
) -> Result<Outcome, Failure> {
    let dataset = Dataset::create_or_resume(out, &setup.info(seed, layout))?;
    let mut sum = Outcome { present: 0, written: 0, stopped: false };
    for frames in frames {
        let run = run_of(frames.clone(), setup.threads, stop);
        let outcome = dataset.generate(&setup.engine, &run, &|_| ()).map_err(|error| setup.failure(error))?;
        sum.present += outcome.present;
        sum.written += outcome.written;
        if outcome.stopped {
            let message = format!("stopped; every file in {} is whole", out.display());
            return Err(Failure::stopped(message, "make"));
        }
    }
    dataset.finish()?;
    Ok(sum)
}
