//! Written frames are read back by decoders.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the numbers are small")]

use crate::support;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::BufReader;

use crate::support::{HEIGHT, SEED, Scratch, WIDTH, colour_frame, contents, frame, recipe};
use papsynth::Frame;
use papsynth::model::Model;
use papsynth::truth::{Group, MIN_DETECTABILITY, SemanticClass};
use papsynth_dataset::read::{GreyImage, Limits, read_label_map};
use papsynth_dataset::{Check, Dataset, DatasetInfo, FrameSummary, Layout, RgbImage, ShardRecord, rle};
use serde_json::Value;
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;

fn open(scratch: &Scratch) -> Dataset {
    let info =
        DatasetInfo { recipe: &recipe(), model: &Model::builtin(), seed: SEED, map: None, layout: &Layout::default() };
    Dataset::create_or_resume(scratch.path(), &info).unwrap()
}

fn write(dataset: &Dataset, frame: &Frame) -> FrameSummary {
    let mut writer = dataset.shard_writer(frame.finished.scene.key.index).unwrap();
    writer.begin(&frame.finished.scene).unwrap();
    for plane in &frame.planes {
        writer.write_plane(plane).unwrap();
    }
    let summary = writer.end(&frame.finished).unwrap().clone();
    writer.commit().unwrap();
    summary
}

fn pages(scratch: &Scratch, name: &str) -> (Vec<DecodingResult>, Option<String>) {
    let mut decoder = Decoder::new(BufReader::new(File::open(scratch.join(name)).unwrap())).unwrap();
    let description = decoder.get_tag_ascii_string(Tag::ImageDescription).ok();
    let mut pages = Vec::new();
    loop {
        assert_eq!(decoder.dimensions().unwrap(), (WIDTH as u32, HEIGHT as u32));
        pages.push(decoder.read_image().unwrap());
        if !decoder.more_images() {
            return (pages, description);
        }
        decoder.next_image().unwrap();
    }
}

fn json(scratch: &Scratch, name: &str) -> Value {
    serde_json::from_slice(&fs::read(scratch.join(name)).unwrap()).unwrap()
}

fn check_labels(scratch: &Scratch, frame: &Frame) {
    let name = format!("{:06}.tif", frame.finished.scene.key.index);
    for group in Group::ALL {
        let path = scratch.join(&format!("labels/{}/{name}", group.name()));
        assert_eq!(&read_label_map(&path, &Limits::default()).unwrap(), &frame.finished.truth.labels(group));
    }
    let layers = read_label_map(&scratch.join(&format!("labels/layers/{name}")), &Limits::default()).unwrap();
    let expected: Vec<u32> = frame.finished.truth.layers().iter().map(|&n| n.into()).collect();
    assert_eq!(layers.ids, expected);
    let path = scratch.join(&format!("labels/semantic/{:06}.png", frame.finished.scene.key.index));
    let classes = GreyImage::read(&path, &Limits::default()).unwrap();
    let expected = frame.finished.truth.semantic(&SemanticClass::ALL, MIN_DETECTABILITY);
    assert_eq!((classes.white, classes.grey), (255, expected.into_iter().map(u16::from).collect()));
}

#[test]
fn a_single_plane_reads_back_in_8_and_in_12_bits() {
    for (bits, white) in [(8, 255), (12, 65_535)] {
        let scratch = Scratch::new(&format!("single-{bits}"));
        let dataset = open(&scratch);
        let frame = frame(3, 1, bits, 1);
        let summary = write(&dataset, &frame);
        let image = GreyImage::read(&scratch.join("images/000003.png"), &Limits::default()).unwrap();
        assert_eq!((image.width, image.white), (WIDTH, white));
        assert_eq!(image.grey, frame.planes[0].grey);
        let (floats, _) = pages(&scratch, "noise-free/000003.tif");
        assert!(matches!(&floats[..], [DecodingResult::F32(values)] if *values == frame.planes[0].noise_free));
        assert!(!scratch.join("all-in-focus").exists());
        check_labels(&scratch, &frame);
        assert_eq!((summary.max_overlap, summary.truncated, summary.saturated_px), (2, 1, vec![0]));
        assert_eq!(summary.objects.values().sum::<u64>(), 6);
        assert!(dataset.complete_record(3, Check::Hashes).unwrap().is_some());
        let record = ShardRecord::from_json(&fs::read(scratch.join("shards/000003.json")).unwrap()).unwrap();
        assert_eq!(&record.identity, dataset.identity());
    }
}

#[test]
fn every_image_has_the_pixel_size() {
    let scratch = Scratch::new("physical");
    let dataset = open(&scratch);
    write(&dataset, &frame(0, 1, 8, 1));
    let decoder = png::Decoder::new(BufReader::new(File::open(scratch.join("images/000000.png")).unwrap()));
    let dims = decoder.read_info().unwrap().info().pixel_dims.unwrap();
    assert_eq!((dims.xppu, dims.yppu, dims.unit), (4_000_000, 4_000_000, png::Unit::Meter));
    let file = BufReader::new(File::open(scratch.join("labels/nucleus/000000.tif")).unwrap());
    let resolution = Decoder::new(file).unwrap().get_tag_u64(Tag::ResolutionUnit).unwrap();
    assert_eq!(resolution, 3, "centimetres");
}

#[test]
fn a_stack_reads_back_plane_by_plane() {
    for bits in [8, 16] {
        let scratch = Scratch::new(&format!("stack-{bits}"));
        let frame = frame(0, 4, bits, 1);
        let summary = write(&open(&scratch), &frame);
        assert_eq!(summary.saturated_px, [0, 1, 2, 3]);
        let (planes, description) = pages(&scratch, "images/000000.ome.tif");
        for (plane, page) in frame.planes.iter().zip(&planes) {
            let read: Vec<u16> = match page {
                DecodingResult::U8(grey) if bits == 8 => grey.iter().map(|&g| g.into()).collect(),
                DecodingResult::U16(grey) if bits == 16 => grey.clone(),
                other => panic!("{other:?}"),
            };
            assert_eq!(read, plane.grey);
        }
        let description = description.unwrap();
        for part in [
            "SizeZ=\"4\"",
            "PhysicalSizeX=\"0.25\"",
            "PhysicalSizeZ=\"0.8\"",
            "PhysicalSizeZUnit=\"&#181;m\"",
            &format!("SignificantBits=\"{bits}\""),
        ] {
            assert!(description.contains(part), "{part} in {description}");
        }
        let (floats, _) = pages(&scratch, "noise-free/000000.tif");
        assert_eq!(floats.len(), 4);
        for (plane, page) in frame.planes.iter().zip(floats) {
            assert!(matches!(page, DecodingResult::F32(values) if values == plane.noise_free));
        }
        let sharp = GreyImage::read(&scratch.join("all-in-focus/000000.png"), &Limits::default()).unwrap();
        let off = sharp.grey.iter().zip(&frame.finished.all_in_focus).map(|(&g, v)| (f32::from(g) - v).abs());
        assert!(off.fold(0.0, f32::max) <= 0.5);
        check_labels(&scratch, &frame);
    }
}

#[test]
fn colour_images_read_back() {
    for (planes, bits) in [(1, 8), (1, 12), (3, 8), (3, 16)] {
        let scratch = Scratch::new(&format!("colour-{planes}-{bits}"));
        let frame = colour_frame(0, planes, bits);
        let summary = write(&open(&scratch), &frame);
        assert_eq!((summary.channels, summary.saturated_px.len()), (3, planes));
        let (floats, _) = pages(&scratch, "noise-free/000000.tif");
        for (plane, page) in frame.planes.iter().zip(floats) {
            assert!(matches!(page, DecodingResult::F32(values) if values == plane.noise_free));
        }
        if planes == 1 {
            let decoder = png::Decoder::new(BufReader::new(File::open(scratch.join("images/000000.png")).unwrap()));
            let info = decoder.read_info().unwrap();
            assert_eq!(info.output_color_type().0, png::ColorType::Rgb);
            continue;
        }
        let (pages, description) = pages(&scratch, "images/000000.ome.tif");
        for (plane, page) in frame.planes.iter().zip(&pages) {
            let read: Vec<u16> = match page {
                DecodingResult::U8(levels) => levels.iter().map(|&g| g.into()).collect(),
                DecodingResult::U16(levels) => levels.clone(),
                other => panic!("{other:?}"),
            };
            assert_eq!(read, plane.grey);
        }
        assert!(description.unwrap().contains("SizeC=\"3\""));
    }
}

#[test]
fn ids_above_16_bits_need_32() {
    for (first, wide) in [(65_532, false), (70_000, true)] {
        let scratch = Scratch::new(&format!("ids-{first}"));
        let frame = frame(0, 1, 8, first);
        write(&open(&scratch), &frame);
        check_labels(&scratch, &frame);
        let (labels, _) = pages(&scratch, "labels/debris/000000.tif");
        assert_eq!(matches!(labels[0], DecodingResult::U32(_)), wide);
    }
}

#[test]
fn ground_truth_is_the_same_in_masks_tables_and_labels() {
    let scratch = Scratch::new("truth");
    let dataset = open(&scratch);
    let frames = [frame(0, 1, 8, 1), frame(2, 3, 8, 1)];
    frames.iter().for_each(|frame| drop(write(&dataset, frame)));
    let summary = dataset.finish().unwrap();
    assert_eq!((summary.frames, summary.objects.values().sum::<u64>()), (2, 12));
    let coco = json(&scratch, "coco.json");
    let objects: Vec<_> = frames.iter().flat_map(|f| &f.finished.truth.objects).collect();
    let annotations = coco["annotations"].as_array().unwrap();
    assert_eq!(annotations.len(), objects.len());
    for (i, (annotation, object)) in annotations.iter().zip(&objects).enumerate() {
        assert_eq!(annotation["id"], i + 1);
        assert_eq!(annotation["object_id"], object.id);
        assert_eq!(annotation["area"], object.amodal.area());
        let mask = |name: &str| {
            let rle = &annotation[name];
            assert_eq!(rle["size"], serde_json::json!([HEIGHT, WIDTH]));
            rle::decode(rle["counts"].as_str().unwrap(), WIDTH, HEIGHT).unwrap()
        };
        assert_eq!(mask("segmentation"), object.amodal);
        assert_eq!(mask("visible"), object.visible);
        let category = coco["categories"].as_array().unwrap().iter().find(|c| c["id"] == annotation["category_id"]);
        assert_eq!(category.unwrap()["supercategory"], object.group().name());
    }
    let files: Vec<&str> =
        coco["images"].as_array().unwrap().iter().map(|i| i["file_name"].as_str().unwrap()).collect();
    assert_eq!(files, ["images/000000.png", "images/000002.ome.tif"]);

    let mut table = csv::Reader::from_path(scratch.join("objects.csv")).unwrap();
    let header = table.headers().unwrap().clone();
    let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), objects.len());
    let get =
        |row: usize, column: &str| rows[row].get(header.iter().position(|h| h == column).unwrap()).unwrap().to_owned();
    for (i, object) in objects.iter().enumerate() {
        assert_eq!(get(i, "image"), if i < 6 { "0" } else { "2" });
        assert_eq!(get(i, "id"), object.id.to_string());
        assert_eq!(get(i, "area_px"), object.amodal.area().to_string());
        assert_eq!(get(i, "visible_area_px"), object.visible.area().to_string());
        assert_eq!(get(i, "traits"), object.traits.to_string());
        assert_eq!(get(i, "semantic_class"), object.semantic_class().name());
        assert_eq!(annotations[i]["semantic_class"], object.semantic_class().name());
        assert_eq!(get(i, "truncated"), object.truncated.to_string());
        assert_eq!(get(i, "depth_um").parse(), Ok(object.depth_um));
        let list: Vec<f64> = get(i, "detectability").split(';').map(|v| v.parse().unwrap()).collect();
        assert_eq!(list, object.detectability);
        let best: usize = get(i, "best_plane").parse().unwrap();
        assert!(list.iter().all(|d| *d <= list[best]));
    }
}

#[test]
fn the_manifest_lists_every_file_with_its_hash() {
    let scratch = Scratch::new("manifest");
    let dataset = open(&scratch);
    for index in [5, 0, 1] {
        write(&dataset, &frame(index, 1, 8, 1));
    }
    dataset.finish().unwrap();
    let manifest = json(&scratch, "manifest.json");
    assert_eq!((manifest["frames"].as_u64(), manifest["identity"]["seed"].as_u64()), (Some(3), Some(SEED)));
    let listed: BTreeSet<(String, u64)> = manifest["files"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| (f["path"].as_str().unwrap().to_owned(), f["bytes"].as_u64().unwrap()))
        .collect();
    let there = contents(scratch.path());
    let found = there.iter().map(|(name, bytes)| (name.clone(), bytes.len() as u64));
    assert_eq!(listed, found.filter(|(name, _)| name != "manifest.json").collect());
    assert_eq!(manifest["files"].as_array().unwrap().len(), listed.len());
}

#[test]
fn bytes_do_not_depend_on_order_or_repetition() {
    let (one, two) = (Scratch::new("order-1"), Scratch::new("order-2"));
    let first = open(&one);
    for index in 0..4 {
        write(&first, &frame(index, 1, 8, 1));
    }
    first.finish().unwrap();
    let second = open(&two);
    for index in [3, 1] {
        write(&second, &frame(index, 1, 8, 1));
    }
    second.finish().unwrap();
    let second = open(&two);
    for index in [0, 2] {
        write(&second, &frame(index, 1, 8, 1));
    }
    second.finish().unwrap();
    assert_eq!(contents(one.path()), contents(two.path()));

    let touched = |name: &str| fs::metadata(two.join(name)).unwrap().modified().unwrap();
    let names: Vec<String> = contents(two.path()).into_iter().map(|(name, _)| name).collect();
    let before: Vec<_> = names.iter().map(|name| touched(name)).collect();
    open(&two).finish().unwrap();
    assert_eq!(names.iter().map(|name| touched(name)).collect::<Vec<_>>(), before);
}

#[test]
fn pictures_show_every_object() {
    let frame = frame(0, 1, 8, 1);
    let picture = RgbImage::overlay(&frame.planes[0], &frame.finished);
    assert_eq!(picture.rgb.len(), WIDTH * HEIGHT * 3);
    let is_grey =
        |at: usize| picture.rgb[at * 3] == picture.rgb[at * 3 + 1] && picture.rgb[at * 3] == picture.rgb[at * 3 + 2];
    for object in &frame.finished.truth.objects {
        // The first pixel of a mask is on its border.
        let first = object.amodal.pixels(WIDTH).next().unwrap();
        assert!(!is_grey(first), "object {}", object.id);
    }
    assert!(is_grey(WIDTH - 1));
    assert!(picture.to_png().unwrap().starts_with(b"\x89PNG"));

    let scratch = Scratch::new("sheet");
    let dataset = open(&scratch);
    for index in 0..30 {
        write(&dataset, &support::frame(index, 1 + index as usize % 2 * 2, 12, 1));
    }
    dataset.finish().unwrap();
    let decoder = png::Decoder::new(BufReader::new(File::open(scratch.join("contact-sheet.png")).unwrap()));
    let info = decoder.read_info().unwrap();
    assert_eq!((info.info().width, info.info().height), (4 * 352 + 8, 6 * 290 + 8));
}

#[test]
fn inconsistent_input_is_refused_and_writes_no_frame() {
    let scratch = Scratch::new("misfit");
    let dataset = open(&scratch);
    let good = frame(0, 2, 8, 1);
    let refused = |error: papsynth_dataset::Error, what: &str| {
        assert!(!error.is_io() && error.to_string().contains(what), "{error}");
    };
    let begin = || {
        let mut writer = dataset.shard_writer(0).unwrap();
        writer.begin(&good.finished.scene).unwrap();
        writer
    };
    let both = || {
        let mut writer = begin();
        good.planes.iter().for_each(|plane| writer.write_plane(plane).unwrap());
        writer
    };
    refused(begin().write_plane(&good.planes[1]).unwrap_err(), "found plane 1, expected plane 0 of 2");
    refused(both().write_plane(&good.planes[1]).unwrap_err(), "found plane 1, expected plane 2 of 2");
    refused(begin().end(&good.finished).unwrap_err(), "planes written: 0 of 2");
    refused(both().end(&frame(1, 2, 8, 1).finished).unwrap_err(), "another scene");
    let mut plane = good.planes[0].clone();
    plane.grey[7] = 256;
    refused(begin().write_plane(&plane).unwrap_err(), "grey level 256 exceeds 8 bits");
    plane.grey.pop();
    refused(begin().write_plane(&plane).unwrap_err(), "found 3499, expected");
    let mut finished = good.finished.clone();
    finished.truth.objects[0].class = "unknown class".to_owned();
    refused(both().end(&finished).unwrap_err(), "unknown class cytoplasm");
    let mut finished = good.finished.clone();
    finished.truth.width += 1;
    refused(both().end(&finished).unwrap_err(), "the ground truth is 71 x 50 px");
    let mut scene = good.finished.scene.clone();
    scene.key.seed += 1;
    refused(dataset.shard_writer(0).unwrap().begin(&scene).unwrap_err(), "seed");
    scene = good.finished.scene.clone();
    scene.planes_um.clear();
    refused(dataset.shard_writer(0).unwrap().begin(&scene).unwrap_err(), "planes 0");
    refused(
        dataset.shard_writer(1).unwrap().begin(&good.finished.scene).unwrap_err(),
        "shard 1 contains frames 1 to 1",
    );
    refused(begin().commit().unwrap_err(), "is not finished");
    assert!(dataset.complete_record(0, Check::Sizes).unwrap().is_none());
    assert_eq!(dataset.finish().unwrap().frames, 0);
    assert!(contents(scratch.path()).iter().all(|(name, _)| !name.ends_with(".tmp")));
}
