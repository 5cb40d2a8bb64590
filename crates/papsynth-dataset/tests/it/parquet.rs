//! Parquet files have the content of the other files.

#![cfg(feature = "parquet")]

use std::fs::{self, File};
use std::path::Path;
use std::sync::atomic::AtomicBool;

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;

use crate::support::{HEIGHT, SEED, Scratch, WIDTH, contents, frame, recipe};
use papsynth::Frame;
use papsynth::model::Model;
use papsynth_dataset::read::{GreyImage, Limits as ImageLimits};
use papsynth_dataset::{Dataset, DatasetInfo, Format, Layout, convert, rle, verify};

/// Writes frames in shards of the layout.
fn write(path: &Path, layout: &Layout, frames: &[Frame]) {
    let info = DatasetInfo { recipe: &recipe(), model: &Model::builtin(), seed: SEED, map: None, layout };
    let dataset = Dataset::create_or_resume(path, &info).unwrap();
    let each = layout.frames_per_shard;
    for (shard, frames) in (0..).zip(frames.chunks(usize::try_from(each).unwrap())) {
        let mut writer = dataset.shard_writer(shard).unwrap();
        for frame in frames {
            writer.begin(&frame.finished.scene).unwrap();
            frame.planes.iter().for_each(|plane| writer.write_plane(plane).unwrap());
            writer.end(&frame.finished).unwrap();
        }
        writer.commit().unwrap();
    }
    dataset.finish().unwrap();
}

/// Columns of all rows, read with the Parquet library.
fn rows(path: &Path, columns: &[&str]) -> Vec<Vec<Field>> {
    let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
    let row = |row: parquet::record::Row| {
        let column = |wanted: &&str| row.get_column_iter().find(|(name, _)| name == wanted).unwrap().1.clone();
        columns.iter().map(column).collect()
    };
    reader.get_row_iter(None).unwrap().map(|found| row(found.unwrap())).collect()
}

fn text(value: &Field) -> &str {
    match value {
        Field::Str(text) => text,
        other => panic!("{other:?} is not a string"),
    }
}

fn list(value: &Field) -> Vec<Field> {
    match value {
        Field::ListInternal(values) => values.elements().to_vec(),
        Field::Group(fields) => fields.get_column_iter().map(|(_, field)| field.clone()).collect(),
        other => panic!("{other:?} is not a list"),
    }
}

#[test]
fn the_table_equals_the_csv_and_has_the_masks() {
    let scratch = Scratch::new("objects");
    let frames = [frame(0, 2, 8, 1), frame(1, 1, 8, 1)];
    write(scratch.path(), &Layout::default(), &frames);
    let csv = fs::read_to_string(scratch.join("objects.csv")).unwrap();
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let table = rows(&scratch.join("objects.parquet"), &names);
    assert_eq!(table.len(), lines.clone().count());
    for (row, line) in table.iter().zip(lines) {
        let printed = row.iter().map(|value| match value {
            Field::Null => String::new(),
            Field::Bool(flag) => flag.to_string(),
            Field::UInt(id) => id.to_string(),
            Field::Long(whole) => whole.to_string(),
            Field::Double(number) => number.to_string(),
            Field::ListInternal(values) => {
                let numbers = values.elements().iter().map(|value| match value {
                    Field::Double(number) => number.to_string(),
                    other => panic!("{other:?} in a list"),
                });
                numbers.collect::<Vec<_>>().join(";")
            }
            other => text(other).to_owned(),
        });
        assert_eq!(printed.collect::<Vec<_>>(), line);
    }
    let masks = rows(&scratch.join("objects.parquet"), &["rle", "visible_rle", "image_width_px", "image_height_px"]);
    let objects = frames.iter().flat_map(|frame| &frame.finished.truth.objects);
    assert_eq!(objects.clone().count(), masks.len());
    for (row, object) in masks.iter().zip(objects) {
        assert_eq!(rle::decode(text(&row[0]), WIDTH, HEIGHT).unwrap(), object.amodal);
        assert_eq!(rle::decode(text(&row[1]), WIDTH, HEIGHT).unwrap(), object.visible);
        assert_eq!(row[2..], [Field::Long(WIDTH as i64), Field::Long(HEIGHT as i64)]);
    }
    // Without Parquet, the layout differs.
    let plain = Scratch::new("objects-plain");
    let layout = Layout { objects_parquet: false, ..Layout::default() };
    write(plain.path(), &layout, &frames);
    assert!(contents(plain.path()).iter().all(|(name, _)| !name.ends_with(".parquet")));
    assert!(verify(plain.path(), Some(0..2)).unwrap().findings.is_empty());
    let info =
        DatasetInfo { recipe: &recipe(), model: &Model::builtin(), seed: SEED, map: None, layout: &Layout::default() };
    let error = Dataset::create_or_resume(plain.path(), &info).unwrap_err().to_string();
    assert!(error.contains("--no-parquet"), "{error}");
}

#[test]
fn rows_are_frames_in_files_by_split() {
    let scratch = Scratch::new("rows");
    // A slide has 16 frames.
    let frames: Vec<Frame> = (0..40).map(|index| frame(index, 1, 8, 1)).collect();
    let layout = Layout { frames_per_shard: 20, ..Layout::new([Format::Huggingface]) };
    write(scratch.path(), &layout, &frames);
    let splits = fs::read_to_string(scratch.join("splits.csv")).unwrap();
    let split = |index: usize| match splits.lines().nth(index + 1).unwrap().rsplit(',').next().unwrap() {
        "val" => "validation",
        other => other,
    };
    let mut seen = Vec::new();
    for (name, _) in contents(&scratch.join("huggingface/data")) {
        let columns = ["index", "image", "planes", "objects"];
        for row in rows(&scratch.join("huggingface/data").join(&name), &columns) {
            let Field::Long(index) = row[0] else { panic!("{row:?}") };
            let index = usize::try_from(index).unwrap();
            assert_eq!(name, format!("{}-{:06}.parquet", split(index), index / 20));
            let [Field::Bytes(png), path] = &list(&row[1])[..] else { panic!("frame {index} has no image") };
            assert_eq!(text(path), format!("{index:06}.png"));
            assert_eq!(
                GreyImage::decode(png.data(), &ImageLimits::default()).unwrap().grey,
                frames[index].planes[0].grey
            );
            assert!(list(&row[2]).is_empty());
            let objects = &frames[index].finished.truth.objects;
            assert_eq!(list(&row[3]).len(), objects.len());
            for (found, object) in list(&row[3]).iter().zip(objects) {
                let found = list(found);
                assert_eq!(found[0], Field::UInt(object.id));
                assert_eq!(rle::decode(text(&found[18]), WIDTH, HEIGHT).unwrap(), object.amodal);
            }
            seen.push(index);
        }
    }
    seen.sort_unstable();
    assert_eq!(seen, (0..40).collect::<Vec<_>>());
    let card = fs::read_to_string(scratch.join("huggingface/README.md")).unwrap();
    for name in ["train", "validation", "test"] {
        assert_eq!(card.contains(&format!("data/{name}-*.parquet")), (0..40).any(|index| split(index) == name));
    }
}

#[test]
fn stacks_keep_their_planes_in_conversions_through_parquet() {
    for (planes, bits) in [(1, 12), (3, 8)] {
        let name = |what: &str| Scratch::new(&format!("way-{what}-{planes}"));
        let (rows, flat, back) = (name("rows"), name("flat"), name("back"));
        let frames: Vec<Frame> = (0..3).map(|index| frame(index, planes, bits, 1)).collect();
        write(rows.path(), &Layout { frames_per_shard: 2, ..Layout::new([Format::Huggingface]) }, &frames);
        let layout = Layout {
            frames_per_shard: 1,
            ..Layout::new([if bits > 8 { Format::Cellpose } else { Format::OmeTiff }, Format::Webdataset])
        };
        write(flat.path(), &layout, &frames);
        let stop = AtomicBool::new(false);
        convert(rows.path(), back.path(), &layout, &stop, &|_| ()).unwrap();
        assert!(contents(flat.path()) == contents(back.path()), "{planes} {bits}");
        assert!(verify(rows.path(), Some(0..3)).unwrap().findings.is_empty());
    }
}

#[test]
fn images_are_read_only_from_files_that_match_their_record() {
    let scratch = Scratch::new("as-recorded");
    write(scratch.path(), &Layout { frames_per_shard: 2, ..Layout::new([Format::Huggingface]) }, &[frame(0, 1, 8, 1)]);
    let (name, mut bytes) = contents(&scratch.join("huggingface/data")).remove(0);
    let dataset = Dataset::open(scratch.path()).unwrap();
    let place = dataset.frame_locations().unwrap()[0];
    let summary = dataset.summary(place).unwrap();
    let mut planes = 0;
    dataset.planes(&summary, 0, &mut |_, _| planes += 1).unwrap();
    assert_eq!(planes, 1);
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(scratch.join("huggingface/data").join(name), bytes).unwrap();
    let dataset = Dataset::open(scratch.path()).unwrap();
    let error = dataset.planes(&summary, 0, &mut |_, _| ()).unwrap_err().to_string();
    assert!(error.contains("the SHA-256 differs"), "{error}");
    assert!(!verify(scratch.path(), None).unwrap().findings.is_empty());
}
