//! What is known of all frames, in one place. Only one shard is held at a time.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::card::{card, croissant};
use crate::coco::{Annotation, Document, Info};
use crate::dataset::{Dataset, read_record, recorded_shards, whole_record};
use crate::error::Error;
use crate::files::{Folder, Output, hex};
use crate::formats::Format;
use crate::image_of::picture;
use crate::layout;
use crate::parquet;
use crate::picture::ContactSheet;
use crate::read;
use crate::record::{Check, Entry, FORMAT, FORMAT_VERSION, FileRecord, ManifestHead, WRITER, broken};
use crate::shard_writer::white;
use crate::splits::Split;

/// A data set in a few numbers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Number of whole frames.
    pub frames: u64,
    /// Number of objects and parts of cells by category, as `coco.json` names it.
    pub objects: BTreeMap<String, u64>,
    /// Shards that were begun, but of which a file is missing or of another size: they are not in the merged files.
    pub damaged: Vec<u64>,
    /// Pixels of masks, by group, that formats with one label a pixel do not show.
    pub lost_px: BTreeMap<String, u64>,
}

/// What was written for one shard is read whole.
const SHARD_FILE_BYTES: u64 = 1 << 32;

pub(crate) fn merge(dataset: &Dataset) -> Result<Summary, Error> {
    let folder = &dataset.folder;
    let mut summary = Summary { frames: 0, objects: BTreeMap::new(), damaged: Vec::new(), lost_px: BTreeMap::new() };
    let (mut shards, mut sharded, mut split) = (Vec::new(), Vec::new(), BTreeSet::new());
    for shard in recorded_shards(folder)? {
        let record = whole_record(folder, &dataset.identity, &dataset.layout, shard, Check::Sizes)?;
        let Ok(record) = record else {
            summary.damaged.push(shard);
            continue;
        };
        shards.push(shard);
        summary.frames += record.frames.len() as u64;
        for frame in record.frames {
            add(&mut summary.objects, frame.objects);
            add(&mut summary.lost_px, frame.lost_px);
            split.insert(Split::of_slide(dataset.identity.seed, frame.slide));
        }
        sharded.extend(record.files.into_iter().filter(|file| is_sharded(&file.path)));
    }
    let given = [layout::MODEL, layout::RECIPE].into_iter().chain(dataset.map.as_deref());
    let mut merged = given.map(|name| folder.record(name)).collect::<Result<Vec<_>, _>>()?;
    if !shards.is_empty() {
        if dataset.layout.is_by_frame() {
            merged.push(folder.write_if_new(layout::TABLE, |out| tables(folder, &shards, out))?);
            merged.push(folder.write_if_new(layout::COCO, |out| documents(dataset, &shards, out))?);
            if dataset.layout.objects_parquet {
                merged.push(parquet::merge(folder, &shards)?);
            }
        }
        merged.push(folder.write_if_new(layout::SPLITS, |out| splits(dataset, &shards, out))?);
        merged.push(contact_sheet(dataset, &shards)?);
        let classes: Vec<String> = dataset.categories.iter().map(|category| category.name.clone()).collect();
        let split: Vec<Split> = split.into_iter().collect();
        for format in &dataset.layout.formats {
            for (name, bytes) in format.shared(&classes, &split)? {
                merged.push(folder.keep(&name, &bytes)?);
            }
        }
    }
    if !shards.is_empty() {
        merged.push(folder.keep(layout::CARD, card(dataset, &summary).as_bytes())?);
        let described: Vec<FileRecord> = merged.iter().chain(&sharded).cloned().collect();
        let text = serde_json::to_vec_pretty(&croissant(dataset, &described));
        let text = text.map_err(|e| Error::io("encode", &folder.path(layout::CROISSANT))(e.into()))?;
        merged.push(folder.keep(layout::CROISSANT, &text)?);
    }
    merged.sort_by(|a, b| a.path.cmp(&b.path));
    folder.sync_names(&merged)?;
    let manifest = write_manifest(dataset, &merged, &shards, summary.frames)?;
    folder.sync_names([&manifest])?;
    Ok(summary)
}

/// Whether a file is one of a format that keeps many frames in a file.
fn is_sharded(path: &str) -> bool {
    Format::ALL
        .into_iter()
        .filter(|format| format.is_sharded())
        .any(|format| path.split('/').next() == Some(format.name()))
}

fn add(sums: &mut BTreeMap<String, u64>, counts: BTreeMap<String, u64>) {
    for (name, count) in counts {
        *sums.entry(name).or_insert(0) += count;
    }
}

/// Which split each frame falls into, by itself and by its slide.
fn splits(dataset: &Dataset, shards: &[u64], out: &mut Output) -> Result<(), Error> {
    out.bytes(b"image,slide,by_field,by_slide\n")?;
    let seed = dataset.identity.seed;
    for &shard in shards {
        for frame in read_record(&dataset.folder, shard)?.frames {
            let (index, slide) = (frame.index, frame.slide);
            let [by_field, by_slide] = [Split::of_field(seed, index), Split::of_slide(seed, slide)].map(Split::name);
            out.bytes(format!("{index},{slide},{by_field},{by_slide}\n").as_bytes())?;
        }
    }
    Ok(())
}

/// The tables one below the other, under the header of the first.
fn tables(folder: &Folder, shards: &[u64], out: &mut Output) -> Result<(), Error> {
    for (i, &index) in shards.iter().enumerate() {
        let text = read::bytes(&folder.path(&layout::table(index)), SHARD_FILE_BYTES)?;
        let header = text.iter().position(|&b| b == b'\n').map_or(text.len(), |end| end + 1);
        out.bytes(if i == 0 { &text } else { &text[header..] })?;
    }
    Ok(())
}

fn documents(dataset: &Dataset, shards: &[u64], out: &mut Output) -> Result<(), Error> {
    let folder = &dataset.folder;
    out.bytes(b"{\"info\":")?;
    out.json(&Info::default())?;
    out.bytes(b",\"licenses\":[],\"categories\":")?;
    out.json(&dataset.categories)?;
    out.bytes(b",\"images\":[")?;
    let images = shards.iter().flat_map(|&index| match document(folder, index) {
        Ok(document) => document.images.into_iter().map(Ok).collect(),
        Err(error) => vec![Err(error)],
    });
    out.json_lines(images)?;
    out.bytes(b"],\"annotations\":[")?;
    let mut before = 0;
    let annotations = shards.iter().flat_map(|&shard| match document(folder, shard) {
        Ok(document) => {
            let count = document.annotations.len() as u64;
            let renumbered = document.annotations.into_iter().map(|a| Ok(a.renumbered(before))).collect::<Vec<_>>();
            before += count;
            renumbered
        }
        Err(error) => vec![Err(error)],
    });
    out.json_lines(annotations)?;
    out.bytes(b"]}\n")
}

pub(crate) fn document(folder: &Folder, shard: u64) -> Result<Document, Error> {
    let path = folder.path(&layout::coco(shard));
    let bytes = read::bytes(&path, SHARD_FILE_BYTES)?;
    serde_json::from_slice(&bytes).map_err(|e| Error::input(&path)(broken(e)))
}

fn contact_sheet(dataset: &Dataset, shards: &[u64]) -> Result<FileRecord, Error> {
    let folder = &dataset.folder;
    let frames = shards.iter().map(|&shard| read_record(folder, shard).map(|record| record.frames.len()));
    let count = frames.take(ContactSheet::MAX_FRAMES).sum::<Result<usize, _>>()?;
    let mut sheet = ContactSheet::new(count);
    let mut left = ContactSheet::MAX_FRAMES;
    for &shard in shards {
        if left == 0 {
            break;
        }
        let record = read_record(folder, shard)?;
        let document = document(folder, shard)?;
        let path = folder.path(&layout::coco(shard));
        for frame in record.frames.iter().take(left) {
            let image = picture(dataset, frame, shard)?;
            let masks = document.annotations.iter().filter(|a| a.image() == frame.index).map(Annotation::amodal);
            let masks = masks.collect::<Result<Vec<_>, _>>().map_err(Error::input(&path))?;
            sheet.add(&layout::numbered(frame.index), &image, white(frame.bits), &masks);
        }
        left = left.saturating_sub(record.frames.len());
    }
    let picture = sheet.into_picture();
    let png = picture.to_png().map_err(Error::io("encode", &folder.path(layout::SHEET)))?;
    folder.write_if_new(layout::SHEET, |out| out.bytes(&png))
}

/// The head, then every file: those of no shard, then shard by shard, each record after the files it vouches for.
pub(crate) fn write_manifest(
    dataset: &Dataset,
    merged: &[FileRecord],
    shards: &[u64],
    frames: u64,
) -> Result<FileRecord, Error> {
    dataset
        .folder
        .write_if_new(layout::MANIFEST, |out| manifest(dataset, merged, shards, frames, &mut |bytes| out.bytes(bytes)))
}

/// The SHA-256 of the manifest of all shards that are recorded.
pub(crate) fn manifest_sha256(dataset: &Dataset, merged: &[FileRecord]) -> Result<String, Error> {
    let shards = recorded_shards(&dataset.folder)?;
    let frames = shards.iter().map(|&shard| Ok(read_record(&dataset.folder, shard)?.frames.len() as u64));
    let frames = frames.sum::<Result<u64, Error>>()?;
    let mut hash = Sha256::new();
    manifest(dataset, merged, &shards, frames, &mut |bytes| {
        hash.update(bytes);
        Ok(())
    })?;
    Ok(hex(&hash.finalize()))
}

fn manifest(
    dataset: &Dataset,
    merged: &[FileRecord],
    shards: &[u64],
    frames: u64,
    out: &mut dyn FnMut(&[u8]) -> Result<(), Error>,
) -> Result<(), Error> {
    let folder = &dataset.folder;
    let head = ManifestHead {
        format: FORMAT,
        version: FORMAT_VERSION,
        writer: WRITER,
        identity: &dataset.identity,
        layout: &dataset.layout,
        frames,
        shards: shards.len() as u64,
        categories: &dataset.categories,
        head_sha256: String::new(),
    }
    .sealed();
    let encode = |e: serde_json::Error| Error::io("encode", &folder.path(layout::MANIFEST))(e.into());
    let head = serde_json::to_string(&head).map_err(encode)?;
    // The list is put into the head's braces by hand: it may be longer than memory.
    out(head.strip_suffix('}').unwrap_or(&head).as_bytes())?;
    out(b",\"files\":[")?;
    let mut first = true;
    let mut list = |file: &FileRecord, shard: Option<u64>| {
        out(if std::mem::take(&mut first) { b"\n" } else { b",\n" })?;
        let FileRecord { path, bytes, sha256 } = file.clone();
        out(&serde_json::to_vec(&Entry { path, bytes, sha256, shard }).map_err(encode)?)
    };
    merged.iter().try_for_each(|file| list(file, None))?;
    for &shard in shards {
        read_record(folder, shard)?.files.iter().try_for_each(|file| list(file, Some(shard)))?;
        list(&folder.record(&layout::record(shard))?, Some(shard))?;
    }
    out(b"]}\n")
}
