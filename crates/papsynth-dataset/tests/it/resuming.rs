//! Resumption of data sets.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the numbers are small")]

use std::fs::{self, File};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::support::{SEED, Scratch, contents, frame, recipe};
use papsynth::model::Model;
use papsynth::recipe::{Preset, Recipe};
use papsynth::{Engine, Inputs, Threads};
use papsynth_dataset::{Check, Dataset, DatasetInfo, Error, Layout, Outcome, Progress, Run, Task, inspect, verify};

fn open_with(path: &Path, recipe: &Recipe, model: &Model, seed: u64) -> Result<Dataset, Error> {
    Dataset::create_or_resume(path, &DatasetInfo { recipe, model, seed, map: None, layout: &Layout::default() })
}

fn open(path: &Path) -> Result<Dataset, Error> {
    open_with(path, &recipe(), &Model::builtin(), SEED)
}

fn write(dataset: &Dataset, index: u64) {
    let frame = frame(index, 1, 8, 1);
    let mut writer = dataset.shard_writer(frame.finished.scene.key.index).unwrap();
    writer.begin(&frame.finished.scene).unwrap();
    writer.write_plane(&frame.planes[0]).unwrap();
    writer.end(&frame.finished).unwrap();
    writer.commit().unwrap();
}

fn refused(result: Result<Dataset, Error>, what: &str) {
    let error = result.unwrap_err();
    assert!(!error.is_io() && error.to_string().contains(what), "{error}");
}

#[test]
fn another_data_set_in_the_folder_is_refused_with_the_difference() {
    let scratch = Scratch::new("identity");
    let (recipe, model) = (recipe(), Model::builtin());
    open(scratch.path()).unwrap();
    refused(open_with(scratch.path(), &recipe, &model, 12), "seed 11, not 12");
    let mut other = recipe.clone();
    other.focus.planes = 7.0.into();
    refused(open_with(scratch.path(), &other, &model, SEED), "`focus.planes` is 1");
    let mut other = model.clone();
    other.provenance.clear();
    refused(open_with(scratch.path(), &recipe, &other, SEED), "another model");
    assert!(open(scratch.path()).is_ok());
}

#[test]
fn of_several_processes_that_start_at_once_one_creates_the_data_set() {
    for round in 0..30 {
        let scratch = Scratch::new(&format!("at-once-{round}"));
        let (recipe, model) = (recipe(), Model::builtin());
        let begun: Vec<u64> = std::thread::scope(|scope| {
            let begin = |seed: u64| {
                let (recipe, model, path) = (&recipe, &model, scratch.path());
                scope.spawn(move || open_with(path, recipe, model, seed).ok().map(|_| seed))
            };
            let all: Vec<_> = (0..4).map(begin).collect();
            all.into_iter().filter_map(|begun| begun.join().unwrap()).collect()
        });
        assert_eq!(begun.len(), 1, "{begun:?}");
        assert_eq!(Dataset::open(scratch.path()).unwrap().identity().seed, begun[0]);
    }
}

#[test]
fn a_folder_with_other_files_is_refused_and_unchanged() {
    let scratch = Scratch::new("stranger");
    fs::write(scratch.join("thesis.tex"), "years of work").unwrap();
    refused(open(scratch.path()), "thesis.tex");
    refused(open(&scratch.join("thesis.tex")), "expected a folder, found a file");
    assert_eq!(contents(scratch.path()), [("thesis.tex".to_owned(), b"years of work".to_vec())]);
    fs::write(scratch.join("manifest.json"), "{}").unwrap();
    refused(open(scratch.path()), "manifest.json");
    refused(open(&scratch.join("thesis.tex/inner")), "");
}

#[test]
fn frames_with_a_missing_truncated_or_changed_file_are_incomplete() {
    let scratch = Scratch::new("damage");
    let dataset = open(scratch.path()).unwrap();
    write(&dataset, 0);
    let files = contents(scratch.path());
    let of_frame = files.iter().filter(|(name, _)| name.contains("000000"));
    let mut count = 0;
    for (name, bytes) in of_frame {
        let path = scratch.join(name);
        let whole = |check| dataset.complete_record(0, check).unwrap().is_some();
        assert!(whole(Check::Hashes));
        fs::remove_file(&path).unwrap();
        assert!(!whole(Check::Sizes), "{name} lost");
        fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(!whole(Check::Sizes), "{name} cut");
        if !name.ends_with("shards/000000.json") {
            let mut changed = bytes.clone();
            changed[bytes.len() / 2] ^= 1;
            fs::write(&path, &changed).unwrap();
            assert!(whole(Check::Sizes) && !whole(Check::Hashes), "{name} changed");
        }
        fs::write(&path, bytes).unwrap();
        count += 1;
    }
    assert_eq!(count, if cfg!(feature = "parquet") { 11 } else { 10 });
    write(&dataset, 0);
    assert_eq!(contents(scratch.path()), files);
}

#[test]
fn inspection_reports_present_and_missing_frames() {
    let scratch = Scratch::new("inspect");
    assert!(inspect(scratch.path(), Check::Sizes).unwrap_err().to_string().contains("contains no data set"));
    let dataset = open(scratch.path()).unwrap();
    assert_eq!(inspect(scratch.path(), Check::Sizes).unwrap().frames, 0);
    for index in [1, 2, 5, 6] {
        write(&dataset, index);
    }
    dataset.finish().unwrap();
    fs::remove_file(scratch.join("objects/000006.csv")).unwrap();
    let overview = inspect(scratch.path(), Check::Hashes).unwrap();
    assert_eq!((overview.frames, overview.manifest.frames), (3, 4));
    assert_eq!(overview.missing, [0..1, 3..5, 6..7]);
    assert_eq!(overview.damaged_shards[0].to_string(), "objects/000006.csv: missing");
    assert_eq!(overview.objects.values().sum::<u64>(), 18);
    assert_eq!(overview.pixel_um, [0.25, 0.25]);
    assert_eq!(dataset.finish().unwrap().damaged, [6]);
}

#[test]
fn temporary_files_of_killed_processes_are_removed_and_locked_ones_are_not() {
    let scratch = Scratch::new("sweep");
    let dataset = open(scratch.path()).unwrap();
    write(&dataset, 0);
    let (dead, alive) = (scratch.join("images/.000001.png.0123.tmp"), scratch.join("images/.000002.png.4567.tmp"));
    fs::write(&dead, "half").unwrap();
    let held = File::create(&alive).unwrap();
    held.lock().unwrap();
    open(scratch.path()).unwrap();
    assert!(!dead.exists() && alive.exists());
    // A folder with only temporary files counts as empty.
    let other = Scratch::new("sweep-fresh");
    fs::write(other.join(".manifest.json.89ab.tmp"), "half").unwrap();
    open(other.path()).unwrap();
    assert!(!other.join(".manifest.json.89ab.tmp").exists());
}

#[test]
fn a_missing_recipe_is_written_again() {
    let scratch = Scratch::new("recipe");
    open(scratch.path()).unwrap();
    let before = contents(scratch.path());
    fs::remove_file(scratch.join("recipe.toml")).unwrap();
    fs::write(scratch.join("model.json"), "{}").unwrap();
    open(scratch.path()).unwrap();
    assert_eq!(contents(scratch.path()), before);
}

#[test]
fn a_file_with_the_name_of_a_folder_is_not_an_io_error() {
    let scratch = Scratch::new("refusing");
    let dataset = open(scratch.path()).unwrap();
    // This error does not depend on permissions.
    fs::write(scratch.join("labels"), "in the way").unwrap();
    let frame = frame(0, 1, 8, 1);
    let mut writer = dataset.shard_writer(0).unwrap();
    writer.begin(&frame.finished.scene).unwrap();
    writer.write_plane(&frame.planes[0]).unwrap();
    let error = writer.end(&frame.finished).unwrap_err();
    drop(writer);
    assert!(!error.is_io() && error.to_string().contains("labels/cytoplasm/000000.tif"), "{error}");
    assert!(dataset.complete_record(0, Check::Sizes).unwrap().is_none());
    assert!(contents(scratch.path()).iter().all(|(name, _)| !name.ends_with(".tmp")));
}

/// A recipe of small fields, and its engine.
fn small() -> (Recipe, Engine) {
    let mut recipe = Preset::Sparse.recipe();
    recipe.field.width_px = 96.0.into();
    recipe.field.height_px = 80.0.into();
    for mix in recipe.cells.values_mut() {
        mix.count = 1.0.into();
    }
    let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default()).unwrap();
    (recipe, engine)
}

#[test]
fn the_bytes_do_not_depend_on_the_split_into_runs() {
    let (recipe, engine) = small();
    let model = Model::builtin();
    let (one, two) = (Scratch::new("split-1"), Scratch::new("split-2"));
    let stop = AtomicBool::new(false);
    let run = |dataset: &Dataset, frames, workers| {
        let seen = Mutex::new(Vec::new());
        let run = Run {
            frames,
            task: Task::ALL,
            workers,
            threads: Threads::One,
            check: Check::Sizes,
            stop: &stop,
            profile: None,
        };
        let outcome = dataset.generate(&engine, &run, &|progress| {
            seen.lock().unwrap().push(match progress {
                Progress::Present(index) => (index, false),
                Progress::Written(summary) => (summary.index, true),
            });
        });
        let mut seen = seen.into_inner().unwrap();
        seen.sort_unstable();
        (outcome.unwrap(), seen)
    };
    let whole = open_with(one.path(), &recipe, &model, SEED).unwrap();
    let (outcome, _) = run(&whole, 0..4, 1);
    assert_eq!(outcome, Outcome { present: 0, written: 4, stopped: false });
    whole.finish().unwrap();

    let parts = open_with(two.path(), &recipe, &model, SEED).unwrap();
    run(&parts, 2..3, 1);
    let (outcome, seen) = run(&parts, 0..4, 3);
    assert_eq!(outcome, Outcome { present: 1, written: 3, stopped: false });
    assert_eq!(seen, [(0, true), (1, true), (2, false), (3, true)]);
    parts.finish().unwrap();
    assert_eq!(contents(one.path()), contents(two.path()));

    stop.store(true, Ordering::Relaxed);
    let (outcome, seen) = run(&parts, 0..u64::MAX, 2);
    assert_eq!((outcome, seen), (Outcome { present: 0, written: 0, stopped: true }, vec![]));
    let other = Scratch::new("split-3");
    let stranger = open(other.path()).unwrap();
    let run = Run {
        frames: 0..1,
        task: Task::ALL,
        workers: 1,
        threads: Threads::One,
        check: Check::Sizes,
        stop: &AtomicBool::new(false),
        profile: None,
    };
    assert!(stranger.generate(&engine, &run, &|_| ()).unwrap_err().to_string().contains("the recipe of the engine"));
}

#[test]
fn damage_that_keeps_the_size_is_found_and_repaired() {
    let scratch = Scratch::new("mend");
    let (recipe, engine) = small();
    let dataset = open_with(scratch.path(), &recipe, &Model::builtin(), SEED).unwrap();
    let stop = AtomicBool::new(false);
    let run = |check| Run {
        frames: 0..2,
        task: Task::ALL,
        workers: 1,
        threads: Threads::One,
        check,
        stop: &stop,
        profile: None,
    };
    assert!(!dataset.is_finished().unwrap());
    dataset.generate(&engine, &run(Check::Sizes), &|_| ()).unwrap();
    assert!(!dataset.is_finished().unwrap());
    dataset.finish().unwrap();
    assert!(dataset.is_finished().unwrap());
    let good = contents(scratch.path());
    for (name, _) in &good {
        let path = scratch.join(name);
        let mut bytes = fs::read(&path).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(&path, bytes).unwrap();
        // A file that the manifest lists under another name is missing.
        let findings = verify(scratch.path(), None).unwrap().findings;
        match name.as_str() {
            "manifest.json" => assert!(!findings.is_empty(), "{name}"),
            _ => assert!(findings.iter().any(|f| f.path == *name), "{name}: {findings:?}"),
        }
        let again = open_with(scratch.path(), &recipe, &Model::builtin(), SEED).unwrap();
        let made = again.generate(&engine, &run(Check::Hashes), &|_| ()).unwrap().written;
        assert_eq!(made, u64::from(name.contains('/')), "{name}");
        again.finish().unwrap();
        assert!(contents(scratch.path()) == good, "{name} is mended, and nothing else is touched");
    }
    for name in ["coco.json", "recipe.toml"] {
        fs::remove_file(scratch.join(name)).unwrap();
        let damaged = inspect(scratch.path(), Check::Sizes).unwrap().damaged_files;
        assert_eq!(damaged.iter().map(ToString::to_string).collect::<Vec<_>>(), [format!("{name}: missing")]);
        assert!(!dataset.is_finished().unwrap());
        open_with(scratch.path(), &recipe, &Model::builtin(), SEED).unwrap().finish().unwrap();
    }
    assert!(contents(scratch.path()) == good);
}
