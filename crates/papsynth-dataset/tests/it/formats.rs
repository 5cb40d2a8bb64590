//! All formats have the same content, written from a rendering or converted from each other.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the numbers are small")]

use std::fs;
use std::io::Read;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::support::{HEIGHT, SEED, Scratch, WIDTH, colour_frame, contents, frame, recipe};
use papsynth::Frame;
use papsynth::model::Model;
#[cfg(feature = "zarr")]
use papsynth::scene::View;
use papsynth::truth::{Group, Part};
use papsynth_dataset::read::{GreyImage, LevelImage, Limits, label_map, read_label_map};
use papsynth_dataset::{Check, Dataset, DatasetInfo, Error, Flatten, Format, FrameLocation, Layout, convert, verify};
use serde_json::Value;

fn begin(path: &Path, layout: &Layout) -> Result<Dataset, Error> {
    let info = DatasetInfo { recipe: &recipe(), model: &Model::builtin(), seed: SEED, map: None, layout };
    Dataset::create_or_resume(path, &info)
}

/// Writes frames into shards of the layout.
fn write(path: &Path, layout: &Layout, frames: &[Frame]) {
    let dataset = begin(path, layout).unwrap();
    for shard in frames.chunk_by(|a, b| {
        let of = |frame: &Frame| frame.finished.scene.key.index / layout.frames_per_shard;
        of(a) == of(b)
    }) {
        let number = shard[0].finished.scene.key.index / layout.frames_per_shard;
        let mut writer = dataset.shard_writer(number).unwrap();
        for frame in shard {
            writer.begin(&frame.finished.scene).unwrap();
            frame.planes.iter().for_each(|plane| writer.write_plane(plane).unwrap());
            writer.end(&frame.finished).unwrap();
        }
        writer.commit().unwrap();
    }
    dataset.finish().unwrap();
}

fn all(frames_per_shard: u64) -> Layout {
    Layout { frames_per_shard, ..Layout::new(Format::built()) }
}

fn to(from: &Path, target: &Path, layout: &Layout) -> Result<u64, Error> {
    convert(from, target, layout, &AtomicBool::new(false), &|_| ()).map(|outcome| outcome.written)
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// The files of a tar file in their order.
fn untar(path: &Path) -> Vec<(String, Vec<u8>)> {
    let mut archive = tar::Archive::new(fs::File::open(path).unwrap());
    let files = archive.entries().unwrap().map(|file| {
        let mut file = file.unwrap();
        let name = file.path().unwrap().to_string_lossy().into_owned();
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        (name, bytes)
    });
    files.collect()
}

#[test]
fn converted_data_sets_equal_those_written_directly() {
    for (planes, bits, colour) in [(1, 8, false), (1, 12, true), (3, 8, false), (2, 16, true)] {
        let frames: Vec<Frame> = (0..5)
            .map(|index| if colour { colour_frame(index, planes, bits) } else { frame(index, planes, bits, 1) })
            .collect();
        let name = |what: &str| Scratch::new(&format!("{what}-{planes}-{bits}"));
        let (folder, workers, converted) = (name("folder"), name("at-once"), name("converted"));
        write(folder.path(), &Layout::default(), &frames);
        write(workers.path(), &all(2), &frames);
        assert_eq!(to(folder.path(), converted.path(), &all(2)).unwrap(), 5);
        assert!(contents(workers.path()) == contents(converted.path()), "{planes} {bits}");
        assert!(verify(workers.path(), Some(0..5)).unwrap().findings.is_empty());
        // Through tar files, which have 8-bit images and no noise-free images.
        let (tars, flat, twice) = (name("tars"), name("flat"), name("twice"));
        let layout = Layout { frames_per_shard: 3, ..Layout::new([Format::Webdataset]) };
        to(folder.path(), tars.path(), &layout).unwrap();
        let deep = Layout::new([Format::Cellpose, Format::Qupath, Format::OmeTiff]);
        let layout = if bits > 8 {
            let error = to(tars.path(), name("deep").path(), &deep).unwrap_err().to_string();
            let expected = format!("the format `ome-tiff` needs {bits} bits, but `webdataset` has 8");
            assert!(error.contains(&expected), "{error}");
            Layout::new([Format::Cellpose, Format::YoloSeg])
        } else {
            deep
        };
        write(flat.path(), &layout, &frames);
        to(tars.path(), twice.path(), &layout).unwrap();
        assert!(contents(flat.path()) == contents(twice.path()), "{planes} {bits}");
        let back = to(tars.path(), &twice.join("back"), &Layout::default()).unwrap_err().to_string();
        assert!(back.contains("noise-free"), "{back}");
        // The second conversion has nothing to write.
        assert_eq!(to(folder.path(), converted.path(), &all(2)).unwrap(), 0);
    }
}

#[test]
fn planes_and_ground_truth_are_read_back_from_every_format() {
    let alone = Format::built().map(|format| vec![format]);
    let layouts = alone.chain([vec![Format::Stardist, Format::Webdataset, Format::OmeTiff]]);
    for (number, formats) in layouts.enumerate() {
        for (planes, bits, colour) in [(1, 12, true), (3, 8, false), (2, 16, true)] {
            let frames: Vec<Frame> = [1, 2, 3, 6]
                .map(|index| if colour { colour_frame(index, planes, bits) } else { frame(index, planes, bits, 1) })
                .into();
            let scratch = Scratch::new(&format!("frames-{number}-{planes}"));
            let layout = Layout { frames_per_shard: 3, ..Layout::new(formats.iter().copied()) };
            write(scratch.path(), &layout, &frames);
            let dataset = Dataset::open(scratch.path()).unwrap();
            let places = dataset.frame_locations().unwrap();
            assert_eq!(
                places.iter().map(|place| (place.index, place.shard)).collect::<Vec<_>>(),
                [(1, 0), (2, 0), (3, 1), (6, 2)]
            );
            let flat = [Format::Cellpose, Format::Stardist, Format::YoloSeg, Format::Qupath];
            assert_eq!(dataset.has_planes(), formats.iter().any(|format| !flat.contains(format)));
            for (frame, place) in frames.iter().zip(places) {
                let summary = dataset.summary(place).unwrap();
                assert_eq!((summary.index, summary.white()), (place.index, u16::MAX >> (16 - bits)));
                let mut found = Vec::new();
                dataset
                    .planes(&summary, place.shard, &mut |number, levels| {
                        assert_eq!(number, found.len());
                        found.push(levels);
                    })
                    .unwrap();
                let training =
                    [Format::Webdataset, Format::Cellpose, Format::Stardist, Format::YoloSeg, Format::Huggingface];
                // Half a level of 8 bits.
                let coarse = bits > 8 && formats.iter().all(|format| training.contains(format));
                let error = if coarse { f32::from(summary.white()) / 510.0 + 0.51 } else { 0.51 };
                if coarse && (dataset.has_planes() || planes == 1) {
                    let levels = frame.planes.iter().map(|plane| plane.grey.iter());
                    let pairs = found.iter().zip(levels).flat_map(|(found, levels)| found.iter().zip(levels));
                    assert_eq!(found.len(), planes);
                    assert!(pairs.into_iter().all(|(a, b)| f32::from(a.abs_diff(*b)) <= error), "{formats:?} {planes}");
                } else if dataset.has_planes() || planes == 1 {
                    assert!(found.iter().eq(frame.planes.iter().map(|plane| &plane.grey)), "{formats:?} {planes}");
                } else {
                    let sharp = &frame.finished.all_in_focus;
                    let is_near = |(level, sharp): (&u16, &f32)| (f32::from(*level) - sharp).abs() <= error + 0.51;
                    assert!(found.len() == 1 && found[0].iter().zip(sharp).all(is_near), "{formats:?} {planes}");
                }
                let truth = dataset.truth(place).unwrap();
                assert_eq!([truth.width, truth.height], [WIDTH, HEIGHT]);
                assert_eq!(truth.objects, frame.finished.truth.objects);
            }
            let stranger = FrameLocation { index: 4, shard: 1 };
            assert!(dataset.summary(stranger).unwrap_err().to_string().contains("no frame 4"));
            assert!(dataset.truth(stranger).unwrap_err().to_string().contains("no image 4"));
        }
    }
}

/// Reads a PNG as 8-bit samples, without conversion.
fn eight_bits(bytes: &[u8]) -> Vec<u8> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    assert_eq!(reader.info().bit_depth, png::BitDepth::Eight);
    let mut buffer = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut buffer).unwrap();
    buffer
}

#[test]
fn formats_for_training_and_previews_have_8_bits() {
    for (planes, colour) in [(1, true), (1, false), (2, true)] {
        let scratch = Scratch::new(&format!("eight-{planes}-{colour}"));
        let frame = if colour { colour_frame(0, planes, 12) } else { frame(0, planes, 12, 1) };
        write(scratch.path(), &all(1), std::slice::from_ref(&frame));
        assert!(verify(scratch.path(), Some(0..1)).unwrap().findings.is_empty());
        let levels = match planes {
            1 => frame.planes[0].grey.clone(),
            _ => frame.finished.all_in_focus_levels(),
        };
        let expected: Vec<u8> = levels.iter().map(|v| (f64::from(*v) * 255.0 / 4095.0).round() as u8).collect();
        assert!(*expected.iter().max().unwrap() > 200);
        let preview = fs::read(scratch.join("preview/000000.png")).unwrap();
        assert_eq!(eight_bits(&preview), expected);
        let (_, yolo) = contents(&scratch.join("yolo-seg/images")).remove(0);
        assert_eq!(yolo, preview);
        let files = untar(&scratch.join("webdataset/000000.tar"));
        let name = if planes == 1 { "000000.png" } else { "000000.all-in-focus.png" };
        assert_eq!(files.iter().find(|(found, _)| found == name).unwrap().1, preview);
        let head: Value = serde_json::from_slice(&files[0].1).unwrap();
        assert_eq!([&head["frame"]["bits"], &head["frame"]["training_bits"]], [12, 8]);
        for name in ["cellpose/nucleus/000000.tif", "stardist/cytoplasm/images/000000.tif"] {
            let image = LevelImage::read(&scratch.join(name), &Limits::default()).unwrap();
            assert_eq!((image.white, image.channels), (255, frame.planes[0].channels));
            assert!(image.levels.iter().zip(&expected).all(|(a, b)| *a == u16::from(*b)));
        }
        // Scientific formats keep the bits of the camera.
        let image = LevelImage::read(&scratch.join("qupath/000000.ome.tif"), &Limits::default()).unwrap();
        assert_eq!((image.white, image.levels), (u16::MAX, levels));
    }
    // There are no previews of 8-bit images.
    let scratch = Scratch::new("eight-8");
    write(scratch.path(), &Layout::default(), &[frame(0, 1, 8, 1)]);
    assert!(!scratch.join("preview").exists());
}

#[test]
fn empty_splits_are_reported() {
    let scratch = Scratch::new("empty-splits");
    write(scratch.path(), &Layout::new([Format::YoloSeg]), &[frame(0, 1, 8, 1)]);
    let summary = Dataset::open(scratch.path()).unwrap().finish().unwrap();
    assert_eq!(summary.empty_splits.len(), 2);
    let card = fs::read_to_string(scratch.join("README.md")).unwrap();
    assert!(card.contains(&format!("No slide is in the split {}", summary.empty_splits.join(" and "))), "{card}");
    // Ultralytics needs the folders of `train` and `val`.
    let text = fs::read_to_string(scratch.join("yolo-seg/data.yaml")).unwrap();
    for key in ["train: ", "val: "] {
        let folder = text.lines().find_map(|line| line.strip_prefix(key)).unwrap();
        assert!(scratch.join("yolo-seg").join(folder).is_dir(), "{text}");
    }
}

#[test]
fn a_stopped_conversion_resumes() {
    let (folder, tars, whole) = (Scratch::new("go-folder"), Scratch::new("go-tars"), Scratch::new("go-whole"));
    let frames: Vec<Frame> = (0..6).map(|index| frame(index, 1, 8, 1)).collect();
    write(folder.path(), &Layout::default(), &frames);
    let layout = Layout { frames_per_shard: 2, ..Layout::new([Format::Webdataset]) };
    let stop = AtomicBool::new(false);
    let seen = AtomicBool::new(false);
    let outcome = convert(folder.path(), tars.path(), &layout, &stop, &|_| {
        stop.store(true, std::sync::atomic::Ordering::Relaxed);
        seen.store(true, std::sync::atomic::Ordering::Relaxed);
    });
    let outcome = outcome.unwrap();
    assert_eq!((outcome.written, outcome.stopped), (2, true));
    assert_eq!(to(folder.path(), tars.path(), &layout).unwrap(), 4);
    write(whole.path(), &layout, &frames);
    assert!(contents(tars.path()) == contents(whole.path()));
}

#[test]
fn flat_labels_follow_the_policy_and_occluded_pixels_are_recorded() {
    for policy in Flatten::ALL {
        let scratch = Scratch::new(&format!("flat-{}", policy.name()));
        let frames = [frame(0, 1, 8, 1)];
        let layout = Layout { flatten: policy, ..Layout::new([Format::Cellpose, Format::Stardist]) };
        write(scratch.path(), &layout, &frames);
        let truth = &frames[0].finished.truth;
        let dataset = begin(scratch.path(), &layout).unwrap();
        let record = dataset.complete_record(0, Check::Hashes).unwrap().unwrap();
        for (group, part) in [(Group::Cytoplasm, Part::Cytoplasm), (Group::Nucleus, Part::Nucleus)] {
            let group = group.name();
            let masks = scratch.join(&format!("cellpose/{group}/000000_masks.tif"));
            let ids = read_label_map(&masks, &Limits::default()).unwrap().ids;
            let stardist = scratch.join(&format!("stardist/{group}/masks/000000.tif"));
            assert_eq!(fs::read(&masks).unwrap(), fs::read(stardist).unwrap());
            let image = scratch.join(&format!("cellpose/{group}/000000.tif"));
            assert_eq!(GreyImage::read(&image, &Limits::default()).unwrap().grey, frames[0].planes[0].grey);
            let all: u64 = truth.objects.iter().filter(|o| o.part == part).map(|o| o.amodal.area()).sum();
            let shown = ids.iter().filter(|&&id| id > 0).count() as u64;
            assert_eq!(record.frames[0].occluded_px[group], all - shown, "{group} {}", policy.name());
        }
        let card = fs::read_to_string(scratch.join("README.md")).unwrap();
        assert!(card.contains(&format!("`{}`", policy.name())), "{card}");
    }
}

#[test]
fn nuclei_and_mimics_below_the_minimum_of_the_detectability_are_ignored() {
    // In the order of objects: cytoplasm and nucleus of two cells, a leukocyte, a speckle. The nuclei have a
    // detectability of 7.7 and 4.3, the leukocyte has 5.6.
    for (least, ignored) in
        [(0.0, [0; 6]), (5.0, [0, 0, 0, 1, 0, 0]), (7.0, [0, 0, 0, 1, 1, 0]), (8.0, [0, 1, 0, 1, 1, 0])]
    {
        let layout = Layout { min_detectability: least, ..Layout::new([Format::Folder, Format::Webdataset]) };
        let [written, converted] =
            ["written", "converted"].map(|name| Scratch::new(&format!("ignored-{name}-{least}")));
        let frames = [frame(0, 1, 8, 1)];
        write(written.path(), &layout, &frames);
        let crowds = |scratch: &Scratch| -> Vec<Value> {
            let coco = fs::read(scratch.join("shards/000000.coco.json")).unwrap();
            let coco: Value = serde_json::from_slice(&coco).unwrap();
            let annotations = coco["annotations"].as_array().unwrap();
            annotations.iter().map(|annotation| annotation["iscrowd"].clone()).collect()
        };
        assert_eq!(crowds(&written), ignored, "{least}");
        let classes = GreyImage::read(&written.join("labels/semantic/000000.png"), &Limits::default()).unwrap();
        let truth = &frames[0].finished.truth;
        for (object, ignored) in truth.objects.iter().zip(ignored).filter(|(o, _)| o.group() != Group::Cytoplasm) {
            let expected = if ignored == 1 { 255 } else { object.semantic_class().number().into() };
            assert!(object.amodal.pixels(WIDTH).all(|pixel| classes.grey[pixel] == expected), "{}", object.class);
        }
        assert!(verify(written.path(), Some(0..1)).unwrap().findings.is_empty());
        // A conversion applies its own minimum.
        let other = Layout { min_detectability: 5.0, ..Layout::new([Format::YoloSeg]) };
        to(written.path(), converted.path(), &other).unwrap();
        assert_eq!(crowds(&converted), [0, 0, 0, 1, 0, 0]);
    }
}

#[test]
fn samples_of_a_tar_file_are_consecutive_and_have_image_ground_truth_and_labels() {
    let scratch = Scratch::new("samples");
    let layout = Layout { frames_per_shard: 4, ..Layout::new([Format::Webdataset]) };
    let frames: Vec<Frame> = (0..6).map(|index| frame(index, 1, 8, 1)).collect();
    write(scratch.path(), &layout, &frames);
    let files = untar(&scratch.join("webdataset/000001.tar"));
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    let of = |index: u64| {
        ["json", "png", "cytoplasm.png", "nucleus.png"].map(|ending| format!("{index:06}.{ending}")).to_vec()
    };
    assert_eq!(names, [of(4), of(5)].concat());
    let image = GreyImage::decode(&files[1].1, &Limits::default()).unwrap();
    assert_eq!(image.grey, frames[4].planes[0].grey);
    let labels = label_map(&files[2].1, &Limits::default()).unwrap();
    assert_eq!(labels, frames[4].finished.truth.labels(Group::Cytoplasm));
    let sample: Value = serde_json::from_slice(&files[0].1).unwrap();
    assert_eq!(sample["truth"]["annotations"].as_array().unwrap().len(), 6);
    // Ids of annotations are consecutive in the document of a shard.
    let coco = json(&scratch.join("shards/000001.coco.json"));
    let ids: Vec<u64> = coco["annotations"].as_array().unwrap().iter().map(|a| a["id"].as_u64().unwrap()).collect();
    assert_eq!(ids, (1..=12).collect::<Vec<_>>());
    assert_eq!(coco["images"][1]["file_name"], "webdataset/000001.tar/000005.png");
    assert!(!scratch.join("coco.json").exists() && !scratch.join("images").exists());
}

#[test]
fn nuclei_are_within_their_cells() {
    let scratch = Scratch::new("geojson");
    write(scratch.path(), &Layout::new([Format::Qupath]), &[frame(0, 1, 8, 1)]);
    let collection = json(&scratch.join("qupath/000000.geojson"));
    let features = collection["features"].as_array().unwrap();
    let types: Vec<&str> = features.iter().map(|f| f["properties"]["objectType"].as_str().unwrap()).collect();
    assert_eq!(types, ["cell", "cell", "detection", "detection"]);
    for feature in features {
        let ring = feature["geometry"]["coordinates"][0].as_array().unwrap();
        assert_eq!(ring.first(), ring.last());
        assert_eq!(feature["nucleusGeometry"].is_object(), feature["properties"]["objectType"] == "cell");
    }
    let mut ids: Vec<&str> = features.iter().map(|feature| feature["id"].as_str().unwrap()).collect();
    ids.dedup();
    assert_eq!(ids.len(), 4);
}

#[test]
fn polygons_are_fractions_of_the_image_and_classes_are_named() {
    let scratch = Scratch::new("yolo");
    let frames: Vec<Frame> = (0..40).map(|index| frame(index, 1, 8, 1)).collect();
    write(scratch.path(), &Layout::new([Format::YoloSeg]), &frames);
    let manifest = json(&scratch.join("manifest.json"));
    let names = manifest["categories"].as_array().unwrap().len();
    let classes = fs::read_to_string(scratch.join("yolo-seg/data.yaml")).unwrap();
    assert_eq!(classes.lines().filter(|line| line.starts_with("  ")).count(), names);
    let mut count = 0;
    for (name, bytes) in contents(&scratch.join("yolo-seg/labels")) {
        count += 1;
        let image = scratch.join("yolo-seg/images").join(name.replace(".txt", ".png"));
        assert!(image.exists(), "{}", image.display());
        let index: usize = name[name.len() - 10..name.len() - 4].parse().unwrap();
        let lines: Vec<Vec<f64>> = String::from_utf8(bytes)
            .unwrap()
            .lines()
            .map(|line| line.split(' ').map(|v| v.parse().unwrap()).collect())
            .collect();
        for (line, object) in lines.iter().zip(&frames[index].finished.truth.objects) {
            assert!(line[0] < names as f64 && line[1..].iter().all(|v| (0.0..=1.0).contains(v)));
            // The shoelace formula: seams of zero width have no area.
            let corners: Vec<[f64; 2]> =
                line[1..].chunks(2).map(|p| [p[0] * WIDTH as f64, p[1] * HEIGHT as f64]).collect();
            let next = corners.iter().cycle().skip(1);
            let area: f64 = corners.iter().zip(next).map(|(a, b)| (a[0] * b[1] - b[0] * a[1]) / 2.0).sum();
            assert!((area - object.amodal.area() as f64).abs() < 0.01, "{area}");
        }
        assert_eq!(lines.len(), 6);
    }
    assert_eq!(count, 40);
    // The 16 frames of a slide are in the same split.
    let splits = fs::read_to_string(scratch.join("splits.csv")).unwrap();
    let of_first: Vec<&str> = splits.lines().skip(1).take(16).map(|line| line.rsplit(',').next().unwrap()).collect();
    assert!(of_first.windows(2).all(|pair| pair[0] == pair[1]) && splits.lines().count() == 41);
}

/// A frame of many tiles, with more objects than fit into one layer.
#[cfg(feature = "zarr")]
fn large(width: usize, height: usize) -> Frame {
    let mut frame = colour_frame(0, 1, 12);
    frame.finished.scene.view = View { width, height, pixel_um: 0.25 };
    (frame.finished.truth.width, frame.finished.truth.height) = (width, height);
    let grey = |i: usize| ((i as u64).wrapping_mul(6_364_136_223_846_793_005) >> 52) as u16;
    frame.planes[0].grey = (0..width * height * 3).map(grey).collect();
    frame.planes[0].noise_free = vec![0.0; width * height * 3];
    frame.finished.all_in_focus = vec![0.0; width * height * 3];
    // Masks are stored by coordinates, so they stay valid.
    frame
}

#[test]
#[cfg(feature = "zarr")]
fn zarr_groups_have_every_level_and_every_complete_mask() {
    use papsynth_zarr::{DataType, Pyramid, PyramidShape, Shard, ShardReader, Tiling, halved, halved_labels};
    let scratch = Scratch::new("zarr-large");
    let (width, height) = (2101, 61);
    let frame = large(width, height);
    write(scratch.path(), &Layout::new([Format::OmeZarr]), std::slice::from_ref(&frame));
    assert!(verify(scratch.path(), Some(0..1)).unwrap().findings.is_empty());
    let group = scratch.join("ome-zarr/000000.ome.zarr");
    let open = |pyramid: &Pyramid, level: usize, path: &Path, file: &str| {
        let file = fs::File::open(path.join(level.to_string()).join(file)).unwrap();
        ShardReader::open(&pyramid.levels()[level], Shard::default(), file).unwrap()
    };
    let tiling = Tiling { chunk: 512, shard: 4096, planes: 1 };
    let form = PyramidShape { kind: DataType::U16, channels: Some(3), planes: None, height, width, tiling, levels: 4 };
    let image = Pyramid::new(&form).unwrap();
    for channel in 0..3 {
        let mut expected: Vec<u16> = frame.planes[0].grey.iter().skip(channel).step_by(3).copied().collect();
        let mut side = width;
        for level in 0..4 {
            let found = open(&image, level, &group, "c/0/0/0").plane::<u16>(channel, 0).unwrap();
            assert!(found == expected, "channel {channel} of level {level}");
            (expected, side) = (halved(&expected, side), side.div_ceil(2));
        }
    }
    assert!(!group.join("4").exists());
    // Two cells overlap: there are two layers, each with one complete cell and its properties.
    let labels = Pyramid::new(&PyramidShape { channels: None, ..form }).unwrap();
    for (layer, id) in [(0, 1), (1, 2)] {
        let path = group.join(format!("labels/cytoplasm-{layer}"));
        let object = |o: &&papsynth::truth::ObjectTruth| o.id == id && o.part == Part::Cytoplasm;
        let object = frame.finished.truth.objects.iter().find(object).unwrap();
        let mut expected = vec![0_u16; width * height];
        object.amodal.pixels(width).for_each(|pixel| expected[pixel] = id as u16);
        let mut side = width;
        for level in 0..4 {
            assert!(open(&labels, level, &path, "c/0/0").plane::<u16>(0, 0).unwrap() == expected, "{layer} {level}");
            (expected, side) = (halved_labels(&expected, side), side.div_ceil(2));
        }
        let known = &json(&path.join("zarr.json"))["attributes"]["ome"]["image-label"]["properties"];
        assert_eq!(known.as_array().unwrap().len(), 1);
        assert_eq!((&known[0]["label-value"], &known[0]["parent"]), (&Value::from(id), &Value::Null));
        assert_eq!(known[0]["area_px"], object.amodal.area());
    }
    let nuclei = json(&group.join("labels/nucleus-0/zarr.json"));
    assert_eq!(nuclei["attributes"]["ome"]["image-label"]["properties"][1]["parent"], 2);
}

#[test]
#[cfg(not(feature = "zarr"))]
fn a_build_without_zarr_returns_an_error_and_writes_nothing() {
    let scratch = Scratch::new("no-zarr");
    let says = "the format `ome-zarr` needs a build of papsynth with `--features zarr`";
    let error = begin(scratch.path(), &Layout::new([Format::OmeZarr])).unwrap_err().to_string();
    assert!(error.ends_with(says), "{error}");
    assert!(contents(scratch.path()).is_empty());
    assert!(Format::built().all(|format| format != Format::OmeZarr));
}

#[test]
#[cfg(not(feature = "parquet"))]
fn a_build_without_parquet_returns_an_error_and_writes_nothing() {
    let scratch = Scratch::new("no-parquet");
    let says = "the format `huggingface` needs a build of papsynth with `--features parquet`";
    let error = begin(scratch.path(), &Layout::new([Format::Huggingface])).unwrap_err().to_string();
    assert!(error.ends_with(says), "{error}");
    let says = "the table of objects as Parquet needs a build of papsynth with `--features parquet`";
    let layout = Layout { objects_parquet: true, ..Layout::default() };
    let error = begin(scratch.path(), &layout).unwrap_err().to_string();
    assert!(error.ends_with(says), "{error}");
    assert!(contents(scratch.path()).is_empty());
    assert!(Format::built().all(|format| format != Format::Huggingface));
}

#[test]
fn another_layout_is_refused() {
    let scratch = Scratch::new("layout");
    begin(scratch.path(), &Layout::default()).unwrap();
    let error = begin(scratch.path(), &Layout::new([Format::Cellpose])).unwrap_err().to_string();
    assert!(error.contains("was written with --format folder, not cellpose"), "{error}");
}
