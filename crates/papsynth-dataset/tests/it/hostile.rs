//! No input makes a reader panic, hang, or allocate much memory.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the numbers are small")]

use crate::support::{SEED, Scratch, contents, frame, recipe};
use papsynth::model::Model;
use papsynth_dataset::read::{GreyImage, Limits, label_map, outlines};
use papsynth_dataset::{
    Check, Dataset, DatasetInfo, Format, InputError, Layout, Manifest, ShardRecord, clean, convert, inspect, verify,
};
use proptest::prelude::*;
use std::fs;
use std::sync::LazyLock;

/// The files of a data set with one small stack and one small image, as seeds of damaged files.
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

/// Runs every parser.
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
        // The head contains sizes and offsets.
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
    for path in
        ["../secret", "/etc/passwd", "images/../../x", "", "./x/..", "images//x", "./x", "x/", "a\\u0000b", "..\\\\x"]
    {
        let bad = text.replace("images/000000.png", path);
        let problem = ShardRecord::from_json(bad.as_bytes()).unwrap_err().to_string();
        assert!(problem.contains("outside"), "{path}: {problem}");
    }
    let newer = text.replacen("\"version\": 2", "\"version\": 3", 1);
    assert!(ShardRecord::from_json(newer.as_bytes()).unwrap_err().to_string().contains("version: expected 2, found 3"));
}

#[test]
fn a_data_set_with_damaged_files_is_inspected_without_panic() {
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
    // A change that keeps the size is found by its hash; merging names the damaged file.
    let coco = scratch.join("shards/000000.coco.json");
    let mut bytes = fs::read(&coco).unwrap();
    bytes[0] = b'[';
    fs::write(&coco, &bytes).unwrap();
    let overview = inspect(scratch.path(), Check::Hashes).unwrap();
    assert!(overview.damaged_shards[0].to_string().contains("000000.coco.json: changed"));
    let error = dataset.finish().unwrap_err();
    assert!(!error.is_io() && error.to_string().contains("000000.coco.json"), "{error}");
    fs::write(scratch.join("manifest.json"), "[").unwrap();
    assert!(inspect(scratch.path(), Check::Sizes).unwrap_err().to_string().contains("manifest.json"));
}

/// Records with valid hashes whose numbers would cause large allocations, divisions by zero or wrong frames.
#[test]
fn records_of_invalid_frames_are_refused() {
    let (_, record) = FILES.iter().find(|(name, _)| name == "shards/000000.json").unwrap();
    let good = ShardRecord::from_json(record).unwrap();
    type Change = (fn(&mut ShardRecord), &'static str);
    let changes: [Change; 12] = [
        (|r| r.frames[0].width = usize::MAX, "size"),
        (|r| r.frames[0].height = 0, "size"),
        (|r| r.frames[0].height = 32_769, "size"),
        (|r| r.frames[0].channels = usize::MAX, "channels"),
        (|r| r.frames[0].bits = 0, "bits"),
        (|r| r.frames[0].bits = u32::MAX, "bits"),
        (|r| r.frames[0].planes_um.clear(), "planes"),
        (|r| r.frames[0].planes_um.resize(1025, 0.0), "planes"),
        (|r| r.frames[0].index = u64::MAX, "shard"),
        (|r| r.frames.push(r.frames[0].clone()), "ascending"),
        (|r| r.layout.frames_per_shard = 0, "frames_per_shard"),
        (|r| r.layout.formats.clear(), "format"),
    ];
    for (number, (lie, named)) in changes.into_iter().enumerate() {
        let mut record = good.clone();
        lie(&mut record);
        let problem = ShardRecord::from_json(&serde_json::to_vec(&record).unwrap()).unwrap_err().to_string();
        assert!(problem.contains(named), "lie {number}: {problem}");
    }
    let (_, manifest) = FILES.iter().find(|(name, _)| name == "manifest.json").unwrap();
    let text = String::from_utf8(manifest.clone()).unwrap();
    for (from, to) in [("\"frames_per_shard\":1", "\"frames_per_shard\":0"), ("[\"folder\"]", "[]")] {
        assert!(text.contains(from), "{from}");
        let problem = Manifest::from_json(text.replacen(from, to, 1).as_bytes()).unwrap_err().to_string();
        assert!(problem.contains("frames_per_shard") || problem.contains("format"), "{problem}");
    }
}

/// A small file with a huge size in its head is refused before memory is allocated.
#[test]
fn images_with_huge_sizes_are_refused() {
    let png = |width: u32, height: u32| {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.write_header().unwrap().write_image_data(&[0]).unwrap();
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        // The CRC of the head, as defined by PNG.
        let crc = !bytes[12..29].iter().fold(u32::MAX, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
        });
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        bytes
    };
    let tiff = |width: u32, height: u32, rows: u32, bytes_of_strip: u32| {
        let fields = [
            (256_u16, width),
            (257, height),
            (258, 8),
            (259, 1),
            (262, 1),
            (273, 8),
            (277, 1),
            (278, rows),
            (279, bytes_of_strip),
        ];
        let mut bytes = b"II*\0\x08\0\0\0".to_vec();
        bytes.extend(u16::try_from(fields.len()).unwrap().to_le_bytes());
        for (tag, value) in fields {
            bytes.extend(
                [&tag.to_le_bytes()[..], &4_u16.to_le_bytes(), &1_u32.to_le_bytes(), &value.to_le_bytes()].concat(),
            );
        }
        bytes.extend([0; 4]);
        bytes
    };
    let limits = Limits::default();
    let vast = [[u32::MAX >> 1, 1], [1, u32::MAX >> 1], [32_769, 1], [32_768, 32_768], [1 << 20, 1 << 20]];
    for [width, height] in vast {
        for bytes in [png(width, height), tiff(width, height, height, width.wrapping_mul(height))] {
            let problems = [
                GreyImage::decode(&bytes, &limits).map(|_| ()).unwrap_err(),
                label_map(&bytes, &limits).map(|_| ()).unwrap_err(),
            ];
            assert!(
                problems.iter().all(|p| matches!(p, InputError::ImageSize { .. })),
                "{width} x {height}: {problems:?}"
            );
        }
    }
    // Sizes within the limits without data are truncated.
    for bytes in [
        png(8192, 8192),
        tiff(8192, 8192, 8192, 1 << 26),
        tiff(8192, 8192, 1, 1 << 26),
        tiff(8192, 8192, 8192, u32::MAX),
    ] {
        let problem = GreyImage::decode(&bytes, &limits).unwrap_err();
        assert!(matches!(problem, InputError::Truncated { .. } | InputError::Broken { .. }), "{problem:?}");
    }
}

/// No file behind a symbolic link in a data set is read, written or removed.
#[test]
#[cfg(unix)]
fn symbolic_links_in_a_data_set_are_not_followed() {
    use std::os::unix::fs::symlink;
    use std::sync::atomic::AtomicBool;
    let info =
        DatasetInfo { recipe: &recipe(), model: &Model::builtin(), seed: SEED, map: None, layout: &Layout::default() };
    let go_on = |path: &std::path::Path| -> Result<(), papsynth_dataset::Error> {
        let dataset = Dataset::create_or_resume(path, &info)?;
        for frame in [frame(0, 1, 8, 1), frame(1, 2, 12, 70_000)] {
            if dataset.complete_record(frame.finished.scene.key.index, Check::Hashes)?.is_none() {
                let mut writer = dataset.shard_writer(frame.finished.scene.key.index)?;
                writer.begin(&frame.finished.scene)?;
                frame.planes.iter().try_for_each(|plane| writer.write_plane(plane))?;
                writer.end(&frame.finished)?;
                writer.commit()?;
            }
        }
        dataset.finish().map(|_| ())
    };
    let names: Vec<&str> = FILES.iter().map(|(name, _)| name.as_str()).collect();
    let folders = ["images", "labels", "labels/nucleus", "shards", "objects", "noise-free"];
    for name in names.iter().copied().chain(folders) {
        let (scratch, elsewhere) = (Scratch::new("links-set"), Scratch::new("links-elsewhere"));
        for (name, bytes) in FILES.iter() {
            let path = scratch.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
        // Moves the file or folder outside and replaces it by a symbolic link.
        fs::rename(scratch.join(name), elsewhere.join("it")).unwrap();
        symlink(elsewhere.join("it"), scratch.join(name)).unwrap();
        let before = contents(elsewhere.path());
        let found = verify(scratch.path(), None);
        assert!(found.as_ref().map_or(true, |report| report.root.is_none()), "{name}: {found:?}");
        let to = Scratch::new("links-converted");
        let layout = Layout::new([Format::Cellpose]);
        let converted = convert(scratch.path(), to.path(), &layout, &AtomicBool::new(false), &|_| {});
        // Conversion does not read merged files.
        let is_read = name.contains('/')
            || folders.contains(&name)
            || ["manifest.json", "recipe.toml", "model.json"].contains(&name);
        assert!(converted.is_err() == is_read, "{name}: {converted:?}");
        let gone_on = go_on(scratch.path());
        let _ = clean(scratch.path(), true);
        assert_eq!(contents(elsewhere.path()), before, "{name}");
        // A link with the name of a file is replaced; a link with the name of a folder is not followed.
        let mended = verify(scratch.path(), None).is_ok_and(|report| report.root.is_some());
        assert!(mended != folders.contains(&name) && mended == gone_on.is_ok(), "{name}: {gone_on:?}");
    }
    // A link with the name of a temporary file is removed, but not its target.
    let (scratch, elsewhere) = (Scratch::new("links-tmp"), Scratch::new("links-precious"));
    go_on(scratch.path()).unwrap();
    fs::write(elsewhere.join("precious"), "mine").unwrap();
    symlink(elsewhere.join("precious"), scratch.join("images/.x.tmp")).unwrap();
    assert_eq!(clean(scratch.path(), false).unwrap().temporary.len(), 1);
    assert_eq!(fs::read(elsewhere.join("precious")).unwrap(), b"mine");
    assert!(verify(scratch.path(), None).unwrap().root.is_some());
}
