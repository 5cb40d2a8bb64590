//! Slides on the disk: reproducibility, verification and repair.

#![cfg(feature = "zarr")]

use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use papsynth::model::Model;
use papsynth::recipe::{Preset, Recipe};
use papsynth::truth::Group;
use papsynth::{Engine, Inputs, Threads};
use papsynth_dataset::slide::{SlideInfo, SlideRun, SlideSet};
use papsynth_dataset::{Check, Cleaned, Fix, Task, clean};

const SEED: u64 = 11;

fn recipe() -> Recipe {
    let mut recipe = Preset::Lbc.recipe();
    (recipe.scan.width_px, recipe.scan.height_px, recipe.scan.frame_px) = (1300, 700, 512);
    recipe.scan.deposit.radius_um = 60_000.0.into();
    recipe
}

struct Folder(std::path::PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("papsynth-slide-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn info<'a>(recipe: &'a Recipe, model: &'a Model) -> SlideInfo<'a> {
    SlideInfo { recipe, model, seed: SEED, shard_px: 512, objects_parquet: cfg!(feature = "parquet") }
}

fn make(path: &Path, engine: &Engine, task: Task, check: Check) -> SlideSet {
    let slide = engine.slide(SEED, 0).unwrap();
    let (recipe, model) = (recipe(), Model::builtin());
    let info = info(&recipe, &model);
    let set = SlideSet::create_or_resume(path, &slide, &info).unwrap();
    let stop = AtomicBool::new(false);
    let run = SlideRun { task, threads: Threads::All, check, stop: &stop };
    assert!(!set.generate(&slide, &run, &|_| ()).unwrap());
    set
}

fn engine() -> Engine {
    Engine::new(&recipe(), &Model::builtin(), &Inputs::default()).unwrap()
}

#[test]
fn tasks_generate_the_same_slide_and_missing_shards_are_refused() {
    let (one, two) = (Folder::new("one"), Folder::new("two"));
    let engine = engine();
    let whole = make(&one.0, &engine, Task::ALL, Check::Sizes);
    let root = whole.finish(Check::Sizes).unwrap();
    make(&two.0, &engine, Task { index: 1, total: 2 }, Check::Sizes);
    let half = SlideSet::open(&two.0).unwrap();
    let gap = half.finish(Check::Sizes).unwrap_err().to_string();
    assert!(gap.contains("missing or damaged shards: 3 of 6") && gap.contains("0000-0000"), "{gap}");
    make(&two.0, &engine, Task { index: 0, total: 2 }, Check::Sizes);
    assert_eq!(half.finish(Check::Sizes).unwrap(), root);
    // The pixels of every level are those of the engine.
    let part = engine.slide(SEED, 0).unwrap().picture([100, 200], [900, 480], Threads::All).unwrap();
    assert_eq!(whole.image(0, 0, 200..680, 100..1000).unwrap(), part.planes[0].grey);
    for (group, labels) in Group::ALL.into_iter().zip(&part.labels) {
        assert_eq!(whole.labels(group, 0, 200..680, 100..1000).unwrap(), labels.ids, "{}", group.name());
    }
    assert_eq!(whole.levels(), 3);
    for level in 1..3 {
        let [width, height] = whole.level_px(level).unwrap();
        let [below_width, below_height] = whole.level_px(level - 1).unwrap();
        let (found, below) = (
            whole.image(level, 0, 0..height, 0..width).unwrap(),
            whole.image(level - 1, 0, 0..below_height, 0..below_width).unwrap(),
        );
        let at = |x: usize, y: usize| u32::from(below[y.min(below_height - 1) * below_width + x.min(below_width - 1)]);
        for (i, value) in found.iter().enumerate() {
            let (x, y) = (2 * (i % width), 2 * (i / width));
            let mean = (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1) + 2) / 4;
            assert_eq!(u32::from(*value), mean, "{level}: {x} {y}");
        }
    }
    // Another recipe is refused.
    let mut other = recipe();
    other.scan.frame_px = 256;
    let model = Model::builtin();
    let info = info(&other, &model);
    let refused = SlideSet::create_or_resume(&one.0, &engine.slide(SEED, 0).unwrap(), &info).unwrap_err();
    let refused = refused.to_string();
    assert!(
        refused.contains("another recipe (`scan.frame_px` is 512 in the existing recipe and 256 in the given one)"),
        "{refused}"
    );
}

#[test]
fn of_two_processes_with_different_seeds_in_a_folder_one_succeeds() {
    let engine = engine();
    for round in 0..20 {
        let folder = Folder::new(&format!("begin-{round}"));
        let barrier = std::sync::Barrier::new(2);
        let begin = |seed: u64| {
            let (slide, recipe, model) = (engine.slide(seed, 0).unwrap(), recipe(), Model::builtin());
            barrier.wait();
            SlideSet::create_or_resume(&folder.0, &slide, &SlideInfo { seed, ..info(&recipe, &model) }).is_ok()
        };
        let [one, two] = std::thread::scope(|scope| {
            [1, 2].map(|seed| scope.spawn(move || begin(seed))).map(|thread| thread.join().unwrap())
        });
        assert!(one != two, "{one} {two}");
    }
}

#[test]
fn too_large_objects_are_refused_before_a_file_is_written() {
    let folder = Folder::new("reach");
    let mut short = recipe();
    short.scan.max_object_radius_um = 20.0;
    let model = Model::builtin();
    let engine = Engine::new(&short, &model, &Inputs::default()).unwrap();
    let refused = SlideSet::create_or_resume(&folder.0, &engine.slide(SEED, 0).unwrap(), &info(&short, &model));
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("scan.max_object_radius_um") && !folder.0.exists(), "{refused}");
}

#[test]
fn every_damage_is_found_and_repaired() {
    let folder = Folder::new("wrong");
    let engine = engine();
    let set = make(&folder.0, &engine, Task::ALL, Check::Sizes);
    let root = set.finish(Check::Sizes).unwrap();
    assert_eq!(set.verify().unwrap(), []);
    let mut files = Vec::new();
    let mut folders = vec![folder.0.clone()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let entry = entry.unwrap();
            if entry.file_type().unwrap().is_dir() { folders.push(entry.path()) } else { files.push(entry.path()) }
        }
    }
    files.sort();
    assert!(files.len() > 40, "{}", files.len());
    for (number, file) in files.iter().enumerate() {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        let bytes = fs::read(file).unwrap();
        let broken = |what: &str| {
            // A slide without its head cannot be opened.
            let found = match SlideSet::open(&folder.0) {
                Ok(set) => set.verify().unwrap().len(),
                Err(_) => usize::from(name == "slide.json"),
            };
            assert!(found > 0, "{} {what}", file.display());
        };
        fs::remove_file(file).unwrap();
        broken("deleted");
        fs::write(file, &bytes[..bytes.len() - 1]).unwrap();
        broken("cut");
        let mut flipped = bytes.clone();
        let at = number * 7919 % bytes.len();
        flipped[at] ^= 1 << (number % 8);
        fs::write(file, &flipped).unwrap();
        broken("flipped");
        fs::write(file, &bytes).unwrap();
    }
    assert_eq!(SlideSet::open(&folder.0).unwrap().verify().unwrap(), []);
    fs::write(folder.0.join("objects/other.csv"), "x").unwrap();
    fs::write(folder.0.join("objects/.0000-0000.csv.0123456789abcdef.tmp"), "x").unwrap();
    let found = set.verify().unwrap();
    assert!(found.len() == 2 && found[0].fix == Fix::Clean && found[1].fix == Fix::CleanUntracked, "{found:?}");
    let (temporary, untracked) = (vec![found[0].path.clone()], vec![found[1].path.clone()]);
    assert_eq!(clean(&folder.0, false).unwrap(), Cleaned { temporary, untracked: Vec::new(), skipped: 0 });
    assert_eq!(clean(&folder.0, true).unwrap(), Cleaned { temporary: Vec::new(), untracked, skipped: 0 });
    assert_eq!(set.verify().unwrap(), []);
    // A reformatted record counts as changed.
    for name in ["shards/0000-0000.json", "upper.json"] {
        let mut bytes = fs::read(folder.0.join(name)).unwrap();
        bytes.push(b'\n');
        fs::write(folder.0.join(name), bytes).unwrap();
        let found = set.verify().unwrap();
        assert!(found.len() == 1 && found[0].path == name && found[0].fix == Fix::Generate, "{found:?}");
        make(&folder.0, &engine, Task::ALL, Check::Sizes).finish(Check::Sizes).unwrap();
        assert_eq!(set.verify().unwrap(), []);
    }
    let (slide, recipe_here, model) = (engine.slide(SEED, 0).unwrap(), recipe(), Model::builtin());
    let within = SlideSet::create_or_resume(&folder.0.join("objects/inner"), &slide, &info(&recipe_here, &model));
    assert!(within.unwrap_err().to_string().contains("is inside the data set or slide"));
    // Inputs are restored if the records belong to this slide.
    let head = fs::read(folder.0.join("slide.json")).unwrap();
    for lost in [None, Some(&head[..head.len() / 2])] {
        match lost {
            None => fs::remove_file(folder.0.join("slide.json")).unwrap(),
            Some(half) => fs::write(folder.0.join("slide.json"), half).unwrap(),
        }
        assert!(SlideSet::is_in(&folder.0) && clean(&folder.0, true).is_err());
        let (slide, recipe, model) = (engine.slide(SEED + 1, 0).unwrap(), recipe(), Model::builtin());
        let other = SlideInfo { seed: SEED + 1, ..info(&recipe, &model) };
        let refused = SlideSet::create_or_resume(&folder.0, &slide, &other).unwrap_err().to_string();
        assert!(refused.contains("slide.json"), "{refused}");
        make(&folder.0, &engine, Task::ALL, Check::Sizes);
        assert_eq!(set.verify().unwrap(), []);
    }
    // Untracked files cannot be removed before the slide is finished.
    fs::remove_file(folder.0.join("upper.json")).unwrap();
    let refused = clean(&folder.0, true).unwrap_err().to_string();
    assert!(refused.contains("papsynth slide finalize"), "{refused}");
    assert!(!set.is_finished().unwrap());
    let shard = files.iter().find(|file| file.to_string_lossy().contains("slide.ome.zarr/0/c")).unwrap();
    let mut bytes = fs::read(shard).unwrap();
    bytes[100] ^= 4;
    fs::write(shard, bytes).unwrap();
    let refused = set.finish(Check::Hashes).unwrap_err().to_string();
    assert!(refused.contains("damaged shards: 1 of 6"), "{refused}");
    make(&folder.0, &engine, Task::ALL, Check::Hashes);
    assert_eq!(set.finish(Check::Sizes).unwrap(), root);
    assert!(set.is_finished().unwrap());
    assert_eq!(set.verify().unwrap(), []);
}
