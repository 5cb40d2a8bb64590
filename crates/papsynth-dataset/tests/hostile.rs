//! No bytes make a reader panic, hang, or ask for vast memory.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the numbers are small")]

mod support;

use papsynth::model::Model;
use papsynth_dataset::read::{GreyImage, Limits, label_map, outlines};
use papsynth_dataset::{Check, Dataset, DatasetInfo, Layout, Manifest, ShardRecord, inspect};
use proptest::prelude::*;
use std::fs;
use std::sync::LazyLock;
use support::{SEED, Scratch, contents, frame, recipe};

/// A data set of one small stack and one small image, as good seeds of bad files.
static FILES: LazyLock<Vec<(String, Vec<u8>)>> = LazyLock::new(|| {
    let scratch = Scratch::new("hostile");
    let info =
        DatasetInfo { recipe: &recipe(), model: &Model::builtin(), seed: SEED, map: None, layout: &Layout::default() };
    let dataset = Dataset::create_or_resume(scratch.path(), &info).unwrap();
    for frame in [frame(0, 1, 8, 1), frame(1, 2, 12, 70_000)] {
        let mut writer = dataset.shard_writer(frame.finished.scene.key.index).unwrap();
        writer.begin(&frame.finished.scene).unwrap();
        frame.planes.iter().for_each(|plane| writer.write_plane(plane).unwrap());
        writer.end(&frame.finished).unwrap();
        writer.commit().unwrap();
    }
    dataset.finish().unwrap();
    contents(scratch.path())
});

/// Gives bytes to every parser.
fn parse(bytes: &[u8]) {
    let limits = Limits { max_pixels: 1 << 20, ..Limits::default() };
    let _ = GreyImage::decode(bytes, &limits);
    let _ = label_map(bytes, &limits);
    let _ = outlines(bytes);
    let _ = ShardRecord::from_json(bytes);
    let _ = Manifest::from_json(bytes);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn random_bytes(bytes in proptest::collection::vec(any::<u8>(), 0..300), head in 0_usize..4) {
        let heads: [&[u8]; 4] = [b"", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", b"II*\0\x08\0\0\0", b"outline,k,x_px,y_px\n"];
        parse(&[heads[head], &bytes].concat());
    }

    #[test]
    fn good_files_with_changes(file in any::<prop::sample::Index>(), changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), cut in any::<prop::sample::Index>(), keep in any::<bool>()) {
        let (_, bytes) = &FILES[file.index(FILES.len())];
        // The head is where sizes and offsets stand.
        let mut bytes = bytes.clone();
        for (i, (at, value)) in changes.iter().enumerate() {
            let range = if i % 2 == 0 { bytes.len() } else { bytes.len().min(200) };
            let at = at.index(range);
            bytes[at] = *value;
        }
        if !keep {
            bytes.truncate(cut.index(bytes.len()));
        }
        parse(&bytes);
    }
}

#[test]
fn records_that_point_outside_the_folder_are_refused() {
    let (_, record) = FILES.iter().find(|(name, _)| name == "shards/000000.json").unwrap();
    let text = String::from_utf8(record.clone()).unwrap();
    assert!(ShardRecord::from_json(text.as_bytes()).is_ok());
    for path in ["../secret", "/etc/passwd", "images/../../x", "", "./x/.."] {
        let bad = text.replace("images/000000.png", path);
        let problem = ShardRecord::from_json(bad.as_bytes()).unwrap_err().to_string();
        assert!(problem.contains("outside"), "{path}: {problem}");
    }
    let newer = text.replacen("\"version\": 2", "\"version\": 3", 1);
    assert!(ShardRecord::from_json(newer.as_bytes()).unwrap_err().to_string().contains("version is 3"));
}

#[test]
fn a_data_set_with_damaged_files_is_looked_at_without_harm() {
    let scratch = Scratch::new("hostile-set");
    for (name, bytes) in FILES.iter() {
        let path = scratch.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    let info =
        DatasetInfo { recipe: &recipe(), model: &Model::builtin(), seed: SEED, map: None, layout: &Layout::default() };
    let dataset = Dataset::create_or_resume(scratch.path(), &info).unwrap();
    assert_eq!(inspect(scratch.path(), Check::Hashes).unwrap().frames, 2);
    // A change of content that leaves the size alone is found by its hash; merging says which file is wrong.
    let coco = scratch.join("shards/000000.coco.json");
    let mut bytes = fs::read(&coco).unwrap();
    bytes[0] = b'[';
    fs::write(&coco, &bytes).unwrap();
    let overview = inspect(scratch.path(), Check::Hashes).unwrap();
    assert!(overview.defects[0].message.contains("000000.coco.json has another content"));
    let error = dataset.finish().unwrap_err();
    assert!(!error.is_io() && error.to_string().contains("000000.coco.json"), "{error}");
    fs::write(scratch.join("manifest.json"), "[").unwrap();
    assert!(inspect(scratch.path(), Check::Sizes).unwrap_err().to_string().contains("manifest.json"));
}
