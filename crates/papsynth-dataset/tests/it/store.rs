//! Data sets in object stores are equal to those in folders, also after failures of the store.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the numbers are small")]

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::{fs, iter};

use crate::support::{SEED, Scratch, contents, frame, recipe};
use papsynth::model::Model;
use papsynth_dataset::{
    Check, Dataset, DatasetInfo, Error, Format, Layout, Location, Store, clean, missing_shards, verify,
};

const FRAMES: u64 = 5;

/// A store in memory that fails from a given call on.
#[derive(Clone, Default)]
struct Memory(Arc<Mutex<Inner>>);

#[derive(Default)]
struct Inner {
    files: BTreeMap<String, Vec<u8>>,
    /// Number of calls that still succeed; `None`: all succeed.
    left: Option<usize>,
    /// Names of uploaded and removed files, in order.
    log: Vec<String>,
}

impl Memory {
    fn call<T>(&self, work: impl FnOnce(&mut Inner) -> io::Result<T>) -> io::Result<T> {
        let mut inner = self.0.lock().unwrap();
        match &mut inner.left {
            Some(0) => return Err(io::Error::other("the store is gone")),
            Some(left) => *left -= 1,
            None => {}
        }
        work(&mut inner)
    }

    fn files(&self) -> Vec<(String, Vec<u8>)> {
        self.0.lock().unwrap().files.clone().into_iter().collect()
    }

    fn home(&self) -> Location {
        Location::in_store(self.clone()).unwrap()
    }
}

impl Store for Memory {
    fn url(&self) -> String {
        "memory://bucket".to_owned()
    }

    fn size(&self, name: &str) -> io::Result<Option<u64>> {
        self.call(|inner| Ok(inner.files.get(name).map(|bytes| bytes.len() as u64)))
    }

    fn get(&self, name: &str, to: &Path) -> io::Result<bool> {
        self.call(|inner| inner.files.get(name).map_or(Ok(false), |bytes| fs::write(to, bytes).map(|()| true)))
    }

    fn put(&self, name: &str, from: &Path) -> io::Result<()> {
        self.call(|inner| {
            inner.log.push(format!("put {name}"));
            inner.files.insert(name.to_owned(), fs::read(from)?);
            Ok(())
        })
    }

    fn remove(&self, name: &str) -> io::Result<()> {
        self.call(|inner| {
            inner.log.push(format!("remove {name}"));
            inner.files.remove(name);
            Ok(())
        })
    }

    fn list(&self, folder: &str) -> io::Result<BTreeMap<String, u64>> {
        let below = if folder.is_empty() { String::new() } else { format!("{folder}/") };
        self.call(|inner| {
            let files = inner.files.iter().filter(|(name, _)| name.starts_with(&below));
            Ok(files.map(|(name, bytes)| (name.clone(), bytes.len() as u64)).collect())
        })
    }
}

fn layout(frames_per_shard: u64) -> Layout {
    Layout { frames_per_shard, ..Layout::new(Format::built()) }
}

/// Generates the missing shards of a data set of a stack and images, and merges it.
fn make(home: impl Into<Location>, layout: &Layout) -> Result<Dataset, Error> {
    let info = DatasetInfo { recipe: &recipe(), model: &Model::builtin(), seed: SEED, map: None, layout };
    let dataset = Dataset::create_or_resume(home, &info)?;
    for shard in 0..FRAMES.div_ceil(layout.frames_per_shard) {
        if dataset.complete_record(shard, Check::Sizes)?.is_some() {
            continue;
        }
        let mut writer = dataset.shard_writer(shard)?;
        for index in dataset.frames_of_shard(shard).filter(|index| *index < FRAMES) {
            let frame = frame(index, 1 + (index % 2) as usize, 8, 1);
            writer.begin(&frame.finished.scene)?;
            frame.planes.iter().try_for_each(|plane| writer.write_plane(plane))?;
            writer.end(&frame.finished)?;
        }
        writer.commit()?;
    }
    dataset.finish()?;
    Ok(dataset)
}

#[test]
fn a_store_has_the_same_files_as_a_folder() {
    for layout in [layout(1), layout(2)] {
        let (scratch, store) = (Scratch::new("store-same"), Memory::default());
        make(scratch.path(), &layout).unwrap();
        let dataset = make(store.home(), &layout).unwrap();
        assert_eq!(store.files(), contents(scratch.path()));
        let there = dataset.path().to_owned();
        let copies: Vec<String> = contents(&there).into_iter().map(|(name, _)| name).collect();
        let images = copies.iter().filter(|name| [".png", ".tif", ".tar"].iter().any(|end| name.ends_with(end)));
        assert!(
            images.eq(iter::empty::<&String>().chain(copies.iter().filter(|name| *name == "contact-sheet.png"))),
            "{copies:?}"
        );
        drop(dataset);
        assert!(!there.exists());
        let roots = [verify(scratch.path(), None), verify(store.home(), Some(0..FRAMES))].map(|v| v.unwrap().root);
        assert!(roots[0].is_some() && roots[0] == roots[1]);
    }
}

#[test]
fn a_record_is_uploaded_after_the_files_that_it_lists() {
    let store = Memory::default();
    make(store.home(), &layout(2)).unwrap();
    let log = store.0.lock().unwrap().log.clone();
    let mut put = BTreeSet::new();
    for line in &log {
        let Some(name) = line.strip_prefix("put ") else { continue };
        if name.starts_with("shards/") && name.matches('.').count() == 1 && name.ends_with(".json") {
            let record = store.0.lock().unwrap().files[name].clone();
            for file in papsynth_dataset::ShardRecord::from_json(&record).unwrap().files {
                assert!(put.contains(&file.path), "{} after {name}", file.path);
            }
        }
        put.insert(name.to_owned());
    }
}

#[test]
fn after_any_failure_of_the_store_no_file_is_partial_and_the_next_run_completes_it() {
    let good = Memory::default();
    let layout = Layout { frames_per_shard: 2, ..Layout::new([Format::Folder, Format::Webdataset]) };
    make(good.home(), &layout).unwrap();
    let expected = good.files();
    let mut failures = 0;
    for answered in (0..60).chain((60..).step_by(5)) {
        let store = Memory::default();
        let home = store.home();
        store.0.lock().unwrap().left = Some(answered);
        let result = make(&home, &layout);
        store.0.lock().unwrap().left = None;
        let Err(error) = result else { break };
        failures += 1;
        assert!(error.is_io() && error.to_string().contains("memory://bucket"), "{error}");
        for (name, bytes) in store.files() {
            let whole = expected.iter().any(|(n, b)| *n == name && (*b == bytes || name == "manifest.json"));
            assert!(whole, "{name} after {answered} calls");
        }
        make(store.home(), &layout).unwrap();
        assert_eq!(store.files(), expected, "after {answered} calls");
    }
    assert!(failures > 60, "{failures}");
}

#[test]
fn damage_in_a_store_is_found_and_repaired() {
    let store = Memory::default();
    let layout = Layout { frames_per_shard: 1, ..Layout::new([Format::Folder]) };
    make(store.home(), &layout).unwrap();
    let expected = store.files();
    // As in a folder, there is no data set without a manifest.
    for (name, _) in expected.iter().filter(|(name, _)| name != "manifest.json") {
        store.0.lock().unwrap().files.remove(name);
        let report = verify(store.home(), Some(0..FRAMES)).unwrap();
        assert!(report.root.is_none() && !report.findings.is_empty(), "{name}");
        make(store.home(), &layout).unwrap();
        assert_eq!(store.files(), expected, "{name}");
    }
    store.0.lock().unwrap().files.insert("thesis.tex".to_owned(), b"years of work".to_vec());
    assert!(verify(store.home(), None).unwrap().findings.iter().any(|finding| finding.path == "thesis.tex"));
    assert_eq!(clean(store.home(), true).unwrap().untracked.len(), 1);
    assert_eq!(store.files(), expected);
    let dataset = Dataset::open(store.home()).unwrap();
    let missing: Vec<u64> =
        missing_shards(&dataset, 0..FRAMES + 2, Check::Sizes).unwrap().into_iter().flatten().collect();
    assert_eq!(missing, [FRAMES, FRAMES + 1]);
}

#[test]
fn a_store_with_other_files_is_refused_and_unchanged() {
    let store = Memory::default();
    store.0.lock().unwrap().files.insert("thesis.tex".to_owned(), Vec::new());
    let error = make(store.home(), &layout(1)).unwrap_err().to_string();
    assert!(error.contains("memory://bucket") && error.contains("thesis.tex"), "{error}");
    assert_eq!(store.files().len(), 1);
    let error = Dataset::open(store.home()).unwrap_err().to_string();
    assert!(error.contains("memory://bucket") && error.contains("no data set"), "{error}");
}
