//! What is known of all frames, in one place. Only one shard is held at a time.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::card::{card, croissant};
use crate::coco::{Annotation, Document, Info};
use crate::dataset::{Dataset, read_record, recorded_shards};
use crate::error::Error;
use crate::files::{Folder, hex};
use crate::formats::Format;
use crate::image_of::picture;
use crate::layout;
use crate::parquet;
use crate::picture::ContactSheet;
use crate::read;
use crate::record::{Check, Entry, FORMAT, FORMAT_VERSION, FileRecord, ManifestHead, WRITER, broken};
use crate::splits::Split;
use papsynth::white_level as white;

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
    /// SHA-256 of the manifest that was written, which names every file with its own: two data sets with the same are the same.
    pub root: String,
}

/// What was written for one shard is read whole.
const SHARD_FILE_BYTES: u64 = 1 << 32;

/// Takes the content of a file piece by piece.
pub(crate) type Sink<'a> = dyn FnMut(&[u8]) -> Result<(), Error> + Send + 'a;

/// Does with a file of this name and content what is to be done, and says how it is.
type Keep<'a> = dyn FnMut(&str, &dyn Fn(&mut Sink) -> Result<(), Error>) -> Result<FileRecord, Error> + 'a;

pub(crate) fn merge(dataset: &Dataset) -> Result<Summary, Error> {
    let folder = &dataset.folder;
    let whole = Whole::find(dataset)?;
    let given = given(dataset).map(|name| folder.record(name)).collect::<Result<Vec<_>, _>>()?;
    let merged = files(dataset, &whole, WRITER, given, &mut |name, fill| {
        folder.write_if_new(name, |out| fill(&mut |bytes| out.bytes(bytes)))
    })?;
    folder.sync_names(&merged)?;
    let manifest = write_manifest(dataset, &merged, &whole.shards, whole.summary.frames)?;
    folder.sync_names([&manifest])?;
    Ok(Summary { root: manifest.sha256, ..whole.summary })
}

/// The files of no shard as they would be merged now, with the words of the program that wrote the data set; none is written.
pub(crate) fn expected(dataset: &Dataset, writer: &str, given: Vec<FileRecord>) -> Result<Vec<FileRecord>, Error> {
    files(dataset, &Whole::find(dataset)?, writer, given, &mut |name, fill| {
        let (mut hash, mut count) = (Sha256::new(), 0);
        fill(&mut |bytes| {
            hash.update(bytes);
            count += bytes.len() as u64;
            Ok(())
        })?;
        Ok(FileRecord { path: name.to_owned(), bytes: count, sha256: hex(&hash.finalize()) })
    })
}

/// Names of the files that a data set is begun with.
pub(crate) fn given(dataset: &Dataset) -> impl Iterator<Item = &str> {
    [layout::MODEL, layout::RECIPE].into_iter().chain(dataset.map.as_deref())
}

/// The shards that are whole, and what their records say.
struct Whole {
    shards: Vec<u64>,
    /// Files of formats that keep many frames in a file.
    sharded: Vec<FileRecord>,
    /// The splits by slide that frames fall into, in order.
    splits: Vec<Split>,
    summary: Summary,
}

impl Whole {
    fn find(dataset: &Dataset) -> Result<Self, Error> {
        let folder = &dataset.folder;
        let summary = Summary {
            frames: 0,
            objects: BTreeMap::new(),
            damaged: Vec::new(),
            lost_px: BTreeMap::new(),
            root: String::new(),
        };
        let mut whole = Self { shards: Vec::new(), sharded: Vec::new(), splits: Vec::new(), summary };
        let mut splits = BTreeSet::new();
        for shard in recorded_shards(folder)? {
            let Ok(record) = dataset.whole_or_flaw(shard, Check::Sizes)? else {
                whole.summary.damaged.push(shard);
                continue;
            };
            whole.shards.push(shard);
            whole.summary.frames += record.frames.len() as u64;
            for frame in record.frames {
                add(&mut whole.summary.objects, frame.objects);
                add(&mut whole.summary.lost_px, frame.lost_px);
                splits.insert(Split::of_slide(dataset.identity.seed, frame.slide));
            }
            whole.sharded.extend(record.files.into_iter().filter(|file| is_sharded(&file.path)));
        }
        whole.splits.extend(splits);
        Ok(whole)
    }
}

/// Makes every file that follows from the shards, and lists it with those that were given.
fn files(
    dataset: &Dataset,
    Whole { shards, sharded, splits: splits_there, summary }: &Whole,
    writer: &str,
    given: Vec<FileRecord>,
    keep: &mut Keep,
) -> Result<Vec<FileRecord>, Error> {
    let folder = &dataset.folder;
    let mut merged = given;
    if !shards.is_empty() {
        if dataset.layout.is_by_frame() {
            merged.push(keep(layout::TABLE, &|out| tables(folder, shards, out))?);
            merged.push(keep(layout::COCO, &|out| documents(dataset, shards, out))?);
            if dataset.layout.objects_parquet {
                merged.push(keep(layout::OBJECTS, &|out| parquet::merge(folder, shards, out))?);
            }
        }
        merged.push(keep(layout::SPLITS, &|out| splits(dataset, shards, out))?);
        let sheet = contact_sheet(dataset, shards)?;
        merged.push(keep(layout::SHEET, &|out| out(&sheet))?);
        let classes: Vec<String> = dataset.categories.iter().map(|category| category.name.clone()).collect();
        for format in &dataset.layout.formats {
            for (name, bytes) in format.shared(&classes, splits_there)? {
                merged.push(keep(&name, &|out| out(&bytes))?);
            }
        }
        let card = card(dataset, writer, summary);
        merged.push(keep(layout::CARD, &|out| out(card.as_bytes()))?);
        let described: Vec<FileRecord> = merged.iter().chain(sharded).cloned().collect();
        let text = serde_json::to_vec_pretty(&croissant(dataset, &described));
        let text = text.map_err(|e| Error::io("encode", &folder.path(layout::CROISSANT))(e.into()))?;
        merged.push(keep(layout::CROISSANT, &|out| out(&text))?);
    }
    merged.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(merged)
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
fn splits(dataset: &Dataset, shards: &[u64], out: &mut Sink) -> Result<(), Error> {
    out(b"image,slide,by_field,by_slide\n")?;
    let seed = dataset.identity.seed;
    for &shard in shards {
        for frame in read_record(&dataset.folder, shard)?.frames {
            let (index, slide) = (frame.index, frame.slide);
            let [by_field, by_slide] = [Split::of_field(seed, index), Split::of_slide(seed, slide)].map(Split::name);
            out(format!("{index},{slide},{by_field},{by_slide}\n").as_bytes())?;
        }
    }
    Ok(())
}

/// The tables one below the other, under the header of the first.
fn tables(folder: &Folder, shards: &[u64], out: &mut Sink) -> Result<(), Error> {
    for (i, &index) in shards.iter().enumerate() {
        let text = read::bytes(&folder.inside(&layout::table(index))?, SHARD_FILE_BYTES)?;
        let header = text.iter().position(|&b| b == b'\n').map_or(text.len(), |end| end + 1);
        folder.release([layout::table(index).as_str()]);
        out(if i == 0 { &text } else { &text[header..] })?;
    }
    Ok(())
}

fn documents(dataset: &Dataset, shards: &[u64], out: &mut Sink) -> Result<(), Error> {
    let folder = &dataset.folder;
    out(b"{\"info\":")?;
    json(folder, &Info::default(), out)?;
    out(b",\"licenses\":[],\"categories\":")?;
    json(folder, &dataset.categories, out)?;
    out(b",\"images\":[")?;
    let mut first = true;
    for &shard in shards {
        for image in document(folder, shard)?.images {
            out(if std::mem::take(&mut first) { b"\n" } else { b",\n" })?;
            json(folder, &image, out)?;
        }
    }
    out(b"],\"annotations\":[")?;
    let mut before = 0;
    for &shard in shards {
        let annotations = document(folder, shard)?.annotations;
        let count = annotations.len() as u64;
        for (i, annotation) in annotations.into_iter().enumerate() {
            out(if before == 0 && i == 0 { b"\n" } else { b",\n" })?;
            json(folder, &annotation.renumbered(before), out)?;
        }
        before += count;
    }
    out(b"]}\n")
}

fn json(folder: &Folder, value: &impl Serialize, out: &mut Sink) -> Result<(), Error> {
    let text = serde_json::to_vec(value);
    out(&text.map_err(|e| Error::io("encode", &folder.path(layout::COCO))(e.into()))?)
}

pub(crate) fn document(folder: &Folder, shard: u64) -> Result<Document, Error> {
    let path = folder.inside(&layout::coco(shard))?;
    let bytes = read::bytes(&path, SHARD_FILE_BYTES)?;
    folder.release([layout::coco(shard).as_str()]);
    serde_json::from_slice(&bytes).map_err(|e| Error::input(&path)(broken(e)))
}

fn contact_sheet(dataset: &Dataset, shards: &[u64]) -> Result<Vec<u8>, Error> {
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
        folder.release(record.files.iter().map(|file| file.path.as_str()));
        left = left.saturating_sub(record.frames.len());
    }
    sheet.into_picture().to_png().map_err(Error::io("encode", &folder.path(layout::SHEET)))
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
        .write_if_new(layout::MANIFEST, |out| manifest(dataset, WRITER, merged, shards, frames, &mut |b| out.bytes(b)))
}

/// The manifest of a data set without a frame, unless there is any manifest by now. Says whether it was written.
pub(crate) fn begin_manifest(dataset: &Dataset) -> Result<bool, Error> {
    dataset
        .folder
        .write_unless_there(layout::MANIFEST, |out| manifest(dataset, WRITER, &[], &[], 0, &mut |b| out.bytes(b)))
}

/// The SHA-256 of the manifest of all shards that are recorded.
pub(crate) fn manifest_sha256(dataset: &Dataset, writer: &str, merged: &[FileRecord]) -> Result<String, Error> {
    let shards = recorded_shards(&dataset.folder)?;
    let frames = shards.iter().map(|&shard| Ok(read_record(&dataset.folder, shard)?.frames.len() as u64));
    let frames = frames.sum::<Result<u64, Error>>()?;
    let mut hash = Sha256::new();
    manifest(dataset, writer, merged, &shards, frames, &mut |bytes| {
        hash.update(bytes);
        Ok(())
    })?;
    Ok(hex(&hash.finalize()))
}

fn manifest(
    dataset: &Dataset,
    writer: &str,
    merged: &[FileRecord],
    shards: &[u64],
    frames: u64,
    out: &mut Sink,
) -> Result<(), Error> {
    let folder = &dataset.folder;
    let head = ManifestHead {
        format: FORMAT,
        version: FORMAT_VERSION,
        writer,
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
