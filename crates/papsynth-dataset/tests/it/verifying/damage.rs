//! Files that are changed, cut, lost or too many.

use std::fs;

use papsynth::model::Model;
use papsynth_dataset::{Dataset, DatasetInfo, Format, Layout, Mend, clean, verify};

use super::{fill, is_found, look, make};
use crate::support::{SEED, Scratch, contents, frame, recipe};

/// The usual little generator: which bits turn over must only be the same every time.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % end
    }
}

#[test]
fn a_whole_data_set_has_a_root() {
    let (one, two) = (make("root-1"), make("root-2"));
    let verdict = look(one.path());
    assert_eq!((verdict.frames, verdict.findings.len()), (3, 0));
    assert!(verdict.root.is_some());
    assert_eq!(verdict, look(two.path()));
    assert_eq!(verdict.files, contents(one.path()).len() as u64);
}

#[test]
fn every_bit_that_turns_over_is_found() {
    let scratch = make("flips");
    let files = contents(scratch.path());
    let mut numbers = Numbers(1);
    // Every file in turn, so that small ones are not spared; a thousand with `PAPSYNTH_TORTURE`.
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
fn every_file_that_is_cut_is_found() {
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
fn every_file_that_is_gone_or_too_many_is_found() {
    let scratch = make("gone");
    for (name, bytes) in contents(scratch.path()) {
        let path = scratch.join(&name);
        fs::remove_file(&path).unwrap();
        if name == "manifest.json" {
            assert!(verify(scratch.path(), None).is_err());
            fill(scratch.path(), 2);
            assert_eq!(fs::read(&path).unwrap(), bytes);
        } else {
            let verdict = look(scratch.path());
            // Without its record a shard is not there: its frames are missing, its files too many.
            assert!(is_found(&verdict, &name), "{name}: {verdict:?}");
        }
        fs::write(&path, bytes).unwrap();
    }
    fs::write(scratch.join("images/notes.txt"), "mine").unwrap();
    fs::write(scratch.join("labels/.000009.tif.0123.tmp"), "half").unwrap();
    let found = look(scratch.path()).findings;
    let strays: Vec<(&str, Mend)> = found.iter().map(|finding| (finding.path.as_str(), finding.mend)).collect();
    assert_eq!(strays, [("images/notes.txt", Mend::Clean), ("labels/.000009.tif.0123.tmp", Mend::Clean)]);
    let cleaned = clean(scratch.path(), false).unwrap();
    assert_eq!((cleaned.temporary, cleaned.strays), (1, 0));
    assert!(scratch.join("images/notes.txt").exists());
    assert_eq!(clean(scratch.path(), true).unwrap().strays, 1);
    assert!(look(scratch.path()).root.is_some());
    assert!(verify(scratch.path(), Some(0..9)).unwrap().findings[0].message.contains("frame"));
}

#[test]
fn a_folder_where_a_file_belongs_is_found_and_gives_way() {
    let scratch = make("folder-for-file");
    let before = contents(scratch.path());
    let name = "images/000001.png";
    let place = scratch.join(name);
    let mend = |strays: Option<u64>| {
        assert!(is_found(&look(scratch.path()), name));
        if let Some(strays) = strays {
            assert_eq!(clean(scratch.path(), true).unwrap().strays, strays);
            assert!(!place.exists() && scratch.join("images").exists());
        }
        fill(scratch.path(), 2);
        assert_eq!(contents(scratch.path()), before);
        fs::remove_file(&place).unwrap();
    };
    fs::remove_file(&place).unwrap();
    fs::create_dir(&place).unwrap();
    mend(None);
    fs::create_dir_all(place.join("deep")).unwrap();
    mend(Some(0));
    fs::create_dir_all(place.join("deep")).unwrap();
    fs::write(place.join("deep/notes.txt"), "mine").unwrap();
    mend(Some(1));
}

#[test]
fn before_it_is_merged_nothing_is_taken_for_a_stray() {
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
    // Somebody is writing the second frame.
    fs::write(scratch.join("images/000001.png"), "half of it").unwrap();
    let before = contents(scratch.path());
    let found = verify(scratch.path(), None).unwrap().findings;
    // That it is not merged is one finding.
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
fn what_is_damaged_is_not_converted() {
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
    assert_eq!(convert().unwrap().made, 3);
}

#[test]
#[cfg(unix)]
fn links_are_strays_and_lead_nowhere() {
    let (scratch, elsewhere) = (make("links"), Scratch::new("elsewhere"));
    fs::write(elsewhere.join("precious.txt"), "mine").unwrap();
    std::os::unix::fs::symlink(elsewhere.path(), scratch.join("link")).unwrap();
    let found = look(scratch.path()).findings;
    assert_eq!(found.iter().map(|f| f.path.as_str()).collect::<Vec<_>>(), ["link"]);
    clean(scratch.path(), true).unwrap();
    assert!(!scratch.join("link").exists() && elsewhere.join("precious.txt").exists());
}

#[test]
fn a_record_that_says_the_same_in_other_bytes_is_found_and_written_again() {
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
fn a_lost_record_is_named_and_what_it_vouched_for_is_no_stray() {
    let scratch = make("lost-last");
    for lost in [&[1_u64][..], &[0, 1]] {
        for shard in lost {
            fs::remove_file(scratch.join(&format!("shards/{shard:06}.json"))).unwrap();
        }
        let verdict = verify(scratch.path(), None).unwrap();
        let [finding] = &verdict.findings[..] else { panic!("{verdict:?}") };
        let first = format!("shards/{:06}.json", lost[0]);
        assert_eq!((finding.path.as_str(), finding.mend), (first.as_str(), Mend::Generate), "{verdict:?}");
        fill(scratch.path(), 2);
        assert!(look(scratch.path()).root.is_some());
    }
}

#[test]
fn what_is_not_merged_is_not_called_damaged() {
    let scratch = Scratch::new("unmerged");
    let (recipe, layout) = (recipe(), Layout::new([Format::Folder]));
    let info = DatasetInfo { recipe: &recipe, model: &Model::builtin(), seed: SEED, map: None, layout: &layout };
    let dataset = Dataset::create_or_resume(scratch.path(), &info).unwrap();
    let told = |message: &str| {
        let verdict = verify(scratch.path(), None).unwrap();
        let [finding] = &verdict.findings[..] else { panic!("{verdict:?}") };
        assert_eq!(
            (finding.path.as_str(), finding.mend, finding.message.as_str()),
            ("manifest.json", Mend::Merge, message)
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
    told("no frame is made yet");
    write(0);
    told("0 of 1 shards are merged");
    dataset.finish().unwrap();
    assert!(verify(scratch.path(), None).unwrap().root.is_some());
    write(1);
    told("1 of 2 shards are merged");
}

#[test]
fn a_set_within_a_set_is_refused_and_not_cleaned_away() {
    let scratch = make("outer");
    let begin = |path: &std::path::Path| {
        let (recipe, layout) = (recipe(), Layout::new([Format::Folder]));
        let info = DatasetInfo { recipe: &recipe, model: &Model::builtin(), seed: SEED, map: None, layout: &layout };
        Dataset::create_or_resume(path, &info).map(drop)
    };
    for inner in ["inner", "images/inner", "one/two/../inner"] {
        let refused = begin(&scratch.join(inner)).unwrap_err().to_string();
        assert!(refused.contains("lies within"), "{refused}");
        assert!(look(scratch.path()).root.is_some());
    }
    // One that came there in another way stays.
    let beside = Scratch::new("beside");
    begin(beside.path()).unwrap();
    fs::rename(beside.path(), scratch.join("inner")).unwrap();
    let before = contents(scratch.path());
    let refused = clean(scratch.path(), true).unwrap_err().to_string();
    assert!(refused.contains("inner lies within"), "{refused}");
    assert_eq!(contents(scratch.path()), before);
}

#[test]
#[cfg(unix)]
fn what_cannot_be_mended_for_a_link_keeps_its_record() {
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
