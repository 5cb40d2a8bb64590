//! Files that are changed, truncated, missing or untracked.

use std::fs;

use papsynth::model::Model;
use papsynth_dataset::{Dataset, DatasetInfo, Fix, Format, Layout, clean, cleanable, verify};

use super::{fill, is_found, look, make};
use crate::support::{SEED, Scratch, contents, frame, recipe};

/// A linear congruential generator: the flipped bits are the same in every run.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % end
    }
}

#[test]
fn a_complete_data_set_has_a_root() {
    let (one, two) = (make("root-1"), make("root-2"));
    let report = look(one.path());
    assert_eq!((report.frames, report.findings.len()), (3, 0));
    assert!(report.root.is_some());
    assert_eq!(report, look(two.path()));
    assert_eq!(report.files, contents(one.path()).len() as u64);
}

#[test]
fn every_flipped_bit_is_found() {
    let scratch = make("flips");
    let files = contents(scratch.path());
    let mut numbers = Numbers(1);
    // Cycles through all files; 1000 flips with `PAPSYNTH_TORTURE`.
    let count = if std::env::var_os("PAPSYNTH_TORTURE").is_some() { 1000 } else { 3 * files.len() };
    for number in 0..count {
        let (name, bytes) = &files[number % files.len()];
        let mut changed = bytes.clone();
        let bit = numbers.below(bytes.len() * 8);
        changed[bit / 8] ^= 1 << (bit % 8);
        fs::write(scratch.join(name), &changed).unwrap();
        assert!(is_found(&look(scratch.path()), name), "bit {bit} of {name}");
        fs::write(scratch.join(name), bytes).unwrap();
    }
    assert!(look(scratch.path()).root.is_some());
}

#[test]
fn every_truncated_file_is_found() {
    let scratch = make("cuts");
    let files = contents(scratch.path());
    let mut numbers = Numbers(2);
    for number in 0..100 {
        let (name, bytes) = &files[number % files.len()];
        let keep = numbers.below(bytes.len());
        fs::write(scratch.join(name), &bytes[..keep]).unwrap();
        assert!(is_found(&look(scratch.path()), name), "{keep} bytes of {name}");
        fs::write(scratch.join(name), bytes).unwrap();
    }
}

#[test]
fn every_missing_or_untracked_file_is_found() {
    let scratch = make("gone");
    for (name, bytes) in contents(scratch.path()) {
        let path = scratch.join(&name);
        fs::remove_file(&path).unwrap();
        if name == "manifest.json" {
            assert!(verify(scratch.path(), None).is_err());
            fill(scratch.path(), 2);
            assert_eq!(fs::read(&path).unwrap(), bytes);
        } else {
            let report = look(scratch.path());
            assert!(is_found(&report, &name), "{name}: {report:?}");
        }
        fs::write(&path, bytes).unwrap();
    }
    fs::write(scratch.join("images/notes.txt"), "mine").unwrap();
    fs::write(scratch.join("labels/.000009.tif.0123.tmp"), "half").unwrap();
    let found = look(scratch.path()).findings;
    let untracked: Vec<(&str, Fix)> = found.iter().map(|finding| (finding.path.as_str(), finding.fix)).collect();
    assert_eq!(untracked, [("images/notes.txt", Fix::CleanUntracked), ("labels/.000009.tif.0123.tmp", Fix::Clean)]);
    let planned = cleanable(scratch.path(), true).unwrap();
    assert_eq!(planned.untracked, ["images/notes.txt"]);
    assert!(scratch.join("images/notes.txt").exists() && scratch.join("labels/.000009.tif.0123.tmp").exists());
    let cleaned = clean(scratch.path(), false).unwrap();
    assert_eq!(cleaned.temporary, ["labels/.000009.tif.0123.tmp"]);
    assert_eq!((&cleaned.temporary, cleaned.untracked.len()), (&planned.temporary, 0));
    assert!(scratch.join("images/notes.txt").exists());
    assert_eq!(clean(scratch.path(), true).unwrap(), papsynth_dataset::Cleaned { temporary: Vec::new(), ..planned });
    assert!(look(scratch.path()).root.is_some());
    assert!(verify(scratch.path(), Some(0..9)).unwrap().findings[0].message.contains("frame"));
}

#[test]
fn a_folder_with_the_name_of_a_file_is_found_and_replaced() {
    let scratch = make("folder-for-file");
    let before = contents(scratch.path());
    let name = "images/000001.png";
    let place = scratch.join(name);
    let repair = |untracked: Option<&[&str]>| {
        assert!(is_found(&look(scratch.path()), name));
        if let Some(untracked) = untracked {
            assert_eq!(clean(scratch.path(), true).unwrap().untracked, untracked);
            assert!(!place.exists() && scratch.join("images").exists());
        }
        fill(scratch.path(), 2);
        assert_eq!(contents(scratch.path()), before);
        fs::remove_file(&place).unwrap();
    };
    fs::remove_file(&place).unwrap();
    fs::create_dir(&place).unwrap();
    repair(None);
    fs::create_dir_all(place.join("deep")).unwrap();
    repair(Some(&[]));
    fs::create_dir_all(place.join("deep")).unwrap();
    fs::write(place.join("deep/notes.txt"), "mine").unwrap();
    repair(Some(&["images/000001.png/deep/notes.txt"]));
}

#[test]
fn untracked_files_are_not_removed_before_the_merge() {
    let scratch = Scratch::new("unmerged");
    let recipe = papsynth::recipe::Recipe {
        layout: papsynth::recipe::Layout::DensityMap { path: "map.png".to_owned() },
        ..recipe()
    };
    let layout = Layout { frames_per_shard: 1, ..Layout::new([Format::Folder]) };
    let map = papsynth_dataset::read::InputFile { name: "map.png".to_owned(), bytes: b"a map".to_vec() };
    let info = DatasetInfo { recipe: &recipe, model: &Model::builtin(), seed: SEED, map: Some(&map), layout: &layout };
    let dataset = Dataset::create_or_resume(scratch.path(), &info).unwrap();
    let one = frame(0, 1, 8, 1);
    let mut writer = dataset.shard_writer(0).unwrap();
    writer.begin(&one.finished.scene).unwrap();
    writer.write_plane(&one.planes[0]).unwrap();
    writer.end(&one.finished).unwrap();
    writer.commit().unwrap();
    // Another process writes the second frame.
    fs::write(scratch.join("images/000001.png"), "half of it").unwrap();
    let before = contents(scratch.path());
    let found = verify(scratch.path(), None).unwrap().findings;
    // The missing merge is one finding.
    let paths: Vec<&str> = found.iter().map(|finding| finding.path.as_str()).collect();
    assert_eq!(paths, ["images/000001.png", "manifest.json"]);
    let refused = clean(scratch.path(), true).unwrap_err();
    assert!(!refused.is_io() && refused.to_string().contains("merge"), "{refused}");
    assert_eq!(contents(scratch.path()), before);
    fs::write(scratch.join("model.json"), "{}").unwrap();
    assert!(is_found(&verify(scratch.path(), None).unwrap(), "model.json"));
    fs::remove_file(scratch.join("recipe.toml")).unwrap();
    assert!(is_found(&verify(scratch.path(), None).unwrap(), "recipe.toml"));
}

#[test]
fn damaged_data_sets_are_not_converted() {
    let scratch = make("convert-damaged");
    let to = Scratch::new("convert-to");
    let layout = Layout::new([Format::Cellpose]);
    let stop = std::sync::atomic::AtomicBool::new(false);
    let convert = || papsynth_dataset::convert(scratch.path(), to.path(), &layout, &stop, &|_| ());
    for (name, lost) in [("noise-free/000001.tif", false), ("images/000001.png", false), ("shards/000001.json", true)] {
        let path = scratch.join(name);
        let good = fs::read(&path).unwrap();
        let mut bytes = good.clone();
        *bytes.last_mut().unwrap() ^= 1;
        if lost { fs::remove_file(&path) } else { fs::write(&path, bytes) }.unwrap();
        let error = convert().unwrap_err();
        assert!(!error.is_io() && error.to_string().contains(if lost { "shards" } else { name }), "{error}");
        fs::write(path, good).unwrap();
    }
    assert_eq!(convert().unwrap().written, 3);
}

#[test]
#[cfg(unix)]
fn symbolic_links_are_untracked_and_not_followed() {
    let (scratch, elsewhere) = (make("links"), Scratch::new("elsewhere"));
    fs::write(elsewhere.join("precious.txt"), "mine").unwrap();
    std::os::unix::fs::symlink(elsewhere.path(), scratch.join("link")).unwrap();
    let found = look(scratch.path()).findings;
    assert_eq!(found.iter().map(|f| f.path.as_str()).collect::<Vec<_>>(), ["link"]);
    clean(scratch.path(), true).unwrap();
    assert!(!scratch.join("link").exists() && elsewhere.join("precious.txt").exists());
}

#[test]
fn a_reformatted_record_is_found_and_rewritten() {
    let scratch = make("reworded");
    let before = contents(scratch.path());
    let name = "shards/000000.json";
    let text = fs::read_to_string(scratch.join(name)).unwrap();
    let compact = serde_json::from_str::<serde_json::Value>(&text).unwrap().to_string();
    for other in [format!("{text}\n"), text.replacen("  ", "\t", 1), compact] {
        fs::write(scratch.join(name), other).unwrap();
        assert!(is_found(&look(scratch.path()), name));
        fill(scratch.path(), 2);
        assert_eq!(contents(scratch.path()), before);
    }
}

#[test]
fn a_missing_record_is_found_and_its_files_are_not_untracked() {
    let scratch = make("lost-last");
    for lost in [&[1_u64][..], &[0, 1]] {
        for shard in lost {
            fs::remove_file(scratch.join(&format!("shards/{shard:06}.json"))).unwrap();
        }
        let report = verify(scratch.path(), None).unwrap();
        let [finding] = &report.findings[..] else { panic!("{report:?}") };
        let first = format!("shards/{:06}.json", lost[0]);
        assert_eq!((finding.path.as_str(), finding.fix), (first.as_str(), Fix::Generate), "{report:?}");
        fill(scratch.path(), 2);
        assert!(look(scratch.path()).root.is_some());
    }
}

#[test]
fn an_unmerged_data_set_is_not_reported_as_damaged() {
    let scratch = Scratch::new("unmerged");
    let (recipe, layout) = (recipe(), Layout::new([Format::Folder]));
    let info = DatasetInfo { recipe: &recipe, model: &Model::builtin(), seed: SEED, map: None, layout: &layout };
    let dataset = Dataset::create_or_resume(scratch.path(), &info).unwrap();
    let told = |message: &str| {
        let report = verify(scratch.path(), None).unwrap();
        let [finding] = &report.findings[..] else { panic!("{report:?}") };
        assert_eq!(
            (finding.path.as_str(), finding.fix, finding.message.as_str()),
            ("manifest.json", Fix::Merge, message)
        );
    };
    let write = |index| {
        let one = frame(index, 1, 8, 1);
        let mut writer = dataset.shard_writer(index).unwrap();
        writer.begin(&one.finished.scene).unwrap();
        writer.write_plane(&one.planes[0]).unwrap();
        writer.end(&one.finished).unwrap();
        writer.commit().unwrap();
    };
    told("no frame is written yet");
    write(0);
    told("merged shards: 0 of 1");
    dataset.finish().unwrap();
    assert!(verify(scratch.path(), None).unwrap().root.is_some());
    write(1);
    told("merged shards: 1 of 2");
}

#[test]
fn a_data_set_inside_a_data_set_is_refused_and_not_removed() {
    let scratch = make("outer");
    let begin = |path: &std::path::Path| {
        let (recipe, layout) = (recipe(), Layout::new([Format::Folder]));
        let info = DatasetInfo { recipe: &recipe, model: &Model::builtin(), seed: SEED, map: None, layout: &layout };
        Dataset::create_or_resume(path, &info).map(drop)
    };
    for inner in ["inner", "images/inner", "one/two/../inner"] {
        let refused = begin(&scratch.join(inner)).unwrap_err().to_string();
        assert!(refused.contains("is inside the data set"), "{refused}");
        assert!(look(scratch.path()).root.is_some());
    }
    // A data set that was moved there is not removed.
    let beside = Scratch::new("beside");
    begin(beside.path()).unwrap();
    fs::rename(beside.path(), scratch.join("inner")).unwrap();
    let before = contents(scratch.path());
    let refused = clean(scratch.path(), true).unwrap_err().to_string();
    assert!(refused.contains("contains another data set or slide in ") && refused.contains("inner"), "{refused}");
    assert_eq!(contents(scratch.path()), before);
}

#[test]
#[cfg(unix)]
fn a_shard_that_cannot_be_rewritten_because_of_a_link_keeps_its_record() {
    let (scratch, elsewhere) = (make("link-mend"), Scratch::new("link-mend-elsewhere"));
    let before: Vec<_> = fs::read_dir(scratch.join("shards")).unwrap().map(|entry| entry.unwrap().path()).collect();
    fs::create_dir_all(elsewhere.path()).unwrap();
    fs::remove_dir_all(scratch.join("images")).unwrap();
    std::os::unix::fs::symlink(elsewhere.path(), scratch.join("images")).unwrap();
    let (recipe, layout) = (recipe(), Layout { frames_per_shard: 2, ..Layout::new(Format::built()) });
    let info = DatasetInfo { recipe: &recipe, model: &Model::builtin(), seed: SEED, map: None, layout: &layout };
    let dataset = Dataset::create_or_resume(scratch.path(), &info).unwrap();
    let refused = dataset.shard_writer(0).err().unwrap().to_string();
    assert!(refused.contains("images") && before.iter().all(|file| file.exists()), "{refused}");
    assert!(contents(elsewhere.path()).is_empty());
}

#[test]
fn files_of_the_desktop_are_ignored() {
    let scratch = make("desktop");
    for name in [".DS_Store", "shards/.DS_Store", "images/Thumbs.db", "images/desktop.ini", "images/._000001.png"] {
        fs::write(scratch.join(name), "view settings").unwrap();
    }
    assert!(look(scratch.path()).root.is_some(), "{:?}", look(scratch.path()));
    assert!(clean(scratch.path(), true).unwrap().untracked.is_empty());
    // A folder with nothing else counts as empty.
    let other = Scratch::new("desktop-empty");
    fs::write(other.join(".DS_Store"), "view settings").unwrap();
    fill(other.path(), 2);
    assert!(look(other.path()).root.is_some());
}

#[test]
fn a_damaged_record_is_one_finding_and_its_files_are_not_untracked() {
    for is_merged in [true, false] {
        let scratch = make("bad-record");
        if !is_merged {
            // As before the merge, whose manifest lists no file of a shard.
            let manifest = fs::read_to_string(scratch.join("manifest.json")).unwrap();
            let lines = manifest.lines().filter(|line| !line.contains("\"shard\":")).collect::<Vec<_>>().join("\n");
            fs::write(scratch.join("manifest.json"), format!("{}]}}\n", lines.trim_end_matches(','))).unwrap();
        }
        fs::write(scratch.join("shards/000000.json"), "{").unwrap();
        fs::write(scratch.join("notes.txt"), "mine").unwrap();
        let report = look(scratch.path());
        let found: Vec<(&str, Fix)> = report.findings.iter().map(|f| (f.path.as_str(), f.fix)).collect();
        assert_eq!(found, [("notes.txt", Fix::CleanUntracked), ("shards/000000.json", Fix::Generate)], "{report:?}");
    }
}

#[test]
fn inputs_that_were_changed_after_generation_are_refused() {
    let scratch = make("changed-inputs");
    let dataset = Dataset::open(scratch.path()).unwrap();
    dataset.check_inputs().unwrap();
    for name in ["recipe.toml", "model.json"] {
        let good = fs::read(scratch.join(name)).unwrap();
        fs::write(scratch.join(name), [&good[..], b"\n"].concat()).unwrap();
        let refused = dataset.check_inputs().unwrap_err();
        let (is_io, refused) = (refused.is_io(), refused.to_string());
        assert!(!is_io && refused.contains(name) && refused.contains("changed after generation"), "{refused}");
        assert_eq!(dataset.finish().unwrap_err().to_string(), refused);
        fs::write(scratch.join(name), good).unwrap();
    }
}

#[test]
fn progress_counts_all_shards() {
    let scratch = make("progress");
    let seen = std::cell::RefCell::new(Vec::new());
    let report = |progress: papsynth_dataset::VerifyProgress| seen.borrow_mut().push((progress.done, progress.total));
    papsynth_dataset::verify_with_progress(scratch.path(), None, &report).unwrap();
    assert_eq!(*seen.borrow(), [(1, 2), (2, 2)]);
}
