//! Merged files of all shards. One shard at a time is in memory.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};

use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::card::{card, croissant};
use super::images::display_image;
use super::manifest::{Entry, ManifestFile};
use super::record::{FORMAT, FORMAT_VERSION, WRITER, read_record, recorded_shards};
use super::rgb_image::{ContactSheet, RgbImage};
use super::set::{Dataset, SHARD_FILE_BYTES, Summary};
use crate::bytes::{hex, json, json_lines};
use crate::error::Error;
use crate::files::{Check, FileRecord, Folder};
use crate::formats::parquet::Table;
use crate::formats::{Extra, Format, names};
use crate::read;
use crate::truth::{AmodalMask, FrameSummary, Image, Info, Row, Split, typed_columns};
use papsynth::white_level as white;

/// Receives the content of a file in pieces.
pub(crate) type Sink<'a> = dyn FnMut(&[u8]) -> Result<(), Error> + Send + 'a;

/// Writes or hashes a file of this name and content, and returns its record.
type Process<'a> = dyn FnMut(&str, &dyn Fn(&mut Sink) -> Result<(), Error>) -> Result<FileRecord, Error> + 'a;

impl Dataset {
    /// Merges all complete shards into `manifest.json`, the data card, `croissant.json`, `splits.csv` and
    /// `contact-sheet.png` and, if each shard has one frame, `objects.csv` and `coco.json`. Files with the same content
    /// are not rewritten.
    ///
    /// # Errors
    /// If an input was changed after generation ([`check_inputs`](Self::check_inputs)), or a file cannot be read or
    /// written.
    pub fn finish(&self) -> Result<Summary, Error> {
        self.check_inputs()?;
        let listed = Self { folder: self.folder.listed()?, ..self.clone() };
        merge(&listed).map_err(|error| self.folder.named(error))
    }
}

fn merge(dataset: &Dataset) -> Result<Summary, Error> {
    let folder = &dataset.folder;
    let complete = CompleteShards::find(dataset)?;
    let given = dataset.given().map(|name| folder.record(name)).collect::<Result<Vec<_>, _>>()?;
    let merged = files(dataset, &complete, WRITER, given, &mut |name, fill| {
        folder.write_if_new(name, |out| fill(&mut |bytes| out.bytes(bytes)))
    })?;
    folder.sync_names(&merged)?;
    let manifest = write_manifest(dataset, &merged, &complete.shards, complete.summary.frames)?;
    folder.sync_names([&manifest])?;
    Ok(Summary { root: manifest.sha256, ..complete.summary })
}

/// Computes the records of the merged files without writing them. `writer` is the program named in the texts.
pub(super) fn expected(dataset: &Dataset, writer: &str, given: Vec<FileRecord>) -> Result<Vec<FileRecord>, Error> {
    files(dataset, &CompleteShards::find(dataset)?, writer, given, &mut |name, fill| {
        let (mut hash, mut count) = (Sha256::new(), 0);
        fill(&mut |bytes| {
            hash.update(bytes);
            count += bytes.len() as u64;
            Ok(())
        })?;
        Ok(FileRecord { path: name.to_owned(), bytes: count, sha256: hex(&hash.finalize()) })
    })
}

/// The complete shards and the contents of their records.
#[derive(Default)]
struct CompleteShards {
    shards: Vec<u64>,
    /// Files of formats with many frames in a file.
    sharded: Vec<FileRecord>,
    /// The splits by slide of the frames, sorted.
    splits: Vec<Split>,
    summary: Summary,
}

impl CompleteShards {
    fn find(dataset: &Dataset) -> Result<Self, Error> {
        let folder = &dataset.folder;
        let mut complete = Self::default();
        let mut splits = BTreeSet::new();
        for shard in recorded_shards(folder)? {
            let Ok(record) = dataset.record_or_finding(shard, Check::Sizes)? else {
                complete.summary.damaged.push(shard);
                continue;
            };
            complete.shards.push(shard);
            complete.summary.frames += record.frames.len() as u64;
            for frame in record.frames {
                add(&mut complete.summary.objects, frame.objects);
                add(&mut complete.summary.occluded_px, frame.occluded_px);
                splits.insert(Split::of_slide(dataset.identity.seed, frame.slide));
            }
            complete.sharded.extend(record.files.into_iter().filter(|file| is_sharded(&file.path)));
        }
        complete.splits.extend(splits);
        let is_empty = |split: &Split| !complete.splits.contains(split);
        let empty = Split::ALL.into_iter().filter(is_empty).map(|split| split.name().to_owned());
        complete.summary.empty_splits = empty.collect();
        Ok(complete)
    }
}

/// Processes every merged file, and returns all records with those of the input files.
fn files(
    dataset: &Dataset,
    CompleteShards { shards, sharded, splits: splits_there, summary }: &CompleteShards,
    writer: &str,
    given: Vec<FileRecord>,
    process: &mut Process,
) -> Result<Vec<FileRecord>, Error> {
    let folder = &dataset.folder;
    let mut merged = given;
    // `croissant.json` lists them in this order.
    merged.sort_by(|a, b| a.path.cmp(&b.path));
    if !shards.is_empty() {
        if dataset.layout.is_by_frame() {
            merged.push(process(names::TABLE, &|out| tables(folder, shards, out))?);
            merged.push(process(names::COCO, &|out| documents(dataset, shards, out))?);
            if dataset.layout.objects_parquet {
                merged.push(process(names::OBJECTS, &|out| objects(dataset, shards, out))?);
            }
        }
        merged.push(process(names::SPLITS, &|out| splits(dataset, shards, out))?);
        if dataset.layout.has_extra(Extra::ContactSheet) {
            let sheet = contact_sheet(dataset, shards)?;
            merged.push(process(names::SHEET, &|out| out(&sheet))?);
        }
        let classes: Vec<String> = dataset.categories.iter().map(|category| category.name.clone()).collect();
        for format in &dataset.layout.formats {
            for (name, bytes) in format.shared(&classes, splits_there)? {
                merged.push(process(&name, &|out| out(&bytes))?);
            }
        }
        let card = card(dataset, writer, summary);
        merged.push(process(names::CARD, &|out| out(card.as_bytes()))?);
        let described: Vec<FileRecord> = merged.iter().chain(sharded).cloned().collect();
        let text = json_lines(&croissant(dataset, &described));
        merged.push(process(names::CROISSANT, &|out| out(&text))?);
    }
    merged.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(merged)
}

/// Whether a file belongs to a format with many frames in a file.
fn is_sharded(path: &str) -> bool {
    let first = path.split('/').next();
    Format::ALL.into_iter().any(|format| format.is_sharded() && first == Some(format.name()))
}

fn add(sums: &mut BTreeMap<String, u64>, counts: BTreeMap<String, u64>) {
    for (name, count) in counts {
        *sums.entry(name).or_insert(0) += count;
    }
}

/// Writes the split of each frame, by field and by slide.
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

/// Writes the concatenated tables with one header.
fn tables(folder: &Folder, shards: &[u64], out: &mut Sink) -> Result<(), Error> {
    for (i, &index) in shards.iter().enumerate() {
        let text = read::bytes(&folder.inside(&names::table(index))?, SHARD_FILE_BYTES)?;
        let header = text.iter().position(|&b| b == b'\n').map_or(text.len(), |end| end + 1);
        folder.release([names::table(index).as_str()]);
        out(if i == 0 { &text } else { &text[header..] })?;
    }
    Ok(())
}

/// The images of a COCO document.
#[derive(Deserialize)]
struct Images {
    images: Vec<Image>,
}

/// The complete masks of a COCO document.
#[derive(Deserialize)]
struct Masks {
    annotations: Vec<AmodalMask>,
}

fn documents(dataset: &Dataset, shards: &[u64], out: &mut Sink) -> Result<(), Error> {
    out(b"{\"info\":")?;
    out(&json(&Info::default()))?;
    out(b",\"licenses\":[],\"categories\":")?;
    out(&json(&dataset.categories))?;
    out(b",\"images\":[")?;
    let mut first = true;
    for &shard in shards {
        for image in dataset.part_of_document::<Images>(shard)?.images {
            out(if std::mem::take(&mut first) { b"\n" } else { b",\n" })?;
            out(&json(&image))?;
        }
    }
    out(b"],\"annotations\":[")?;
    let mut before = 0;
    for &shard in shards {
        let annotations = dataset.document(shard)?.annotations;
        let count = annotations.len() as u64;
        for (i, annotation) in annotations.into_iter().enumerate() {
            out(if before == 0 && i == 0 { b"\n" } else { b",\n" })?;
            out(&json(&annotation.renumbered(before)))?;
        }
        before += count;
    }
    out(b"]}\n")
}

fn objects(dataset: &Dataset, shards: &[u64], out: &mut Sink) -> Result<(), Error> {
    let mut pieces = Pieces { out, failure: None };
    let written = write_objects(dataset, shards, &mut pieces);
    pieces.failure.map_or(written, Err)
}

fn write_objects(dataset: &Dataset, shards: &[u64], pieces: &mut Pieces) -> Result<(), Error> {
    let mut table = Table::begin(pieces, &dataset.folder.path(names::OBJECTS), typed_columns())?;
    for &shard in shards {
        let document = dataset.document(shard)?;
        for image in &document.images {
            let truth = dataset.truth_in(&document, shard, image.id)?;
            Row::all(&truth, image.id).try_for_each(|row| table.row(&row))?;
        }
    }
    table.end()
}

/// A writer to a sink that keeps the first error of the sink.
struct Pieces<'a, 's> {
    out: &'a mut Sink<'s>,
    failure: Option<Error>,
}

impl Write for Pieces<'_, '_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        (self.out)(bytes).map(|()| bytes.len()).map_err(|error| {
            self.failure.get_or_insert(error);
            io::Error::other("the sink failed")
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn contact_sheet(dataset: &Dataset, shards: &[u64]) -> Result<Vec<u8>, Error> {
    let folder = &dataset.folder;
    let frames = shards.iter().map(|&shard| read_record(folder, shard).map(|record| record.frames.len()));
    let count = frames.take(ContactSheet::MAX_FRAMES).sum::<Result<usize, _>>()?;
    let mut sheet = ContactSheet::new(count);
    let mut remaining = ContactSheet::MAX_FRAMES;
    for &shard in shards {
        if remaining == 0 {
            break;
        }
        let record = read_record(folder, shard)?;
        let mut document = None;
        for frame in record.frames.iter().take(remaining) {
            let thumbnail = match dataset.thumbnails.get(frame.index) {
                Some(thumbnail) => thumbnail,
                None => {
                    let document = match &mut document {
                        Some(document) => document,
                        None => document.insert(dataset.part_of_document(shard)?),
                    };
                    thumbnail(dataset, frame, shard, document)?
                }
            };
            sheet.add(&names::numbered(frame.index), &thumbnail);
        }
        folder.release(record.files.iter().map(|file| file.path.as_str()));
        remaining = remaining.saturating_sub(record.frames.len());
    }
    sheet.image.to_png().map_err(Error::io("encode", &folder.path(names::SHEET)))
}

/// Draws the thumbnail of a recorded frame from its files.
fn thumbnail(dataset: &Dataset, frame: &FrameSummary, shard: u64, document: &Masks) -> Result<RgbImage, Error> {
    let image = display_image(dataset, frame, shard)?;
    let masks = document.annotations.iter().filter(|a| a.image_id == frame.index).map(AmodalMask::decode);
    let masks = masks.collect::<Result<Vec<_>, _>>();
    let masks = masks.map_err(Error::input(&dataset.folder.path(&names::coco(shard))))?;
    Ok(ContactSheet::thumbnail(&image, white(frame.bits), &masks))
}

/// Writes the manifest: the head, the merged files, then the files of each shard, each record after the files it lists.
pub(super) fn write_manifest(
    dataset: &Dataset,
    merged: &[FileRecord],
    shards: &[u64],
    frames: u64,
) -> Result<FileRecord, Error> {
    dataset
        .folder
        .write_if_new(names::MANIFEST, |out| manifest(dataset, WRITER, merged, shards, frames, &mut |b| out.bytes(b)))
}

/// Writes the manifest of an empty data set unless one exists. Returns whether it was written.
pub(super) fn begin_manifest(dataset: &Dataset) -> Result<bool, Error> {
    dataset.folder.write_new(names::MANIFEST, |out| manifest(dataset, WRITER, &[], &[], 0, &mut |b| out.bytes(b)))
}

/// Computes the SHA-256 of the manifest of all recorded shards.
pub(super) fn manifest_sha256(dataset: &Dataset, writer: &str, merged: &[FileRecord]) -> Result<String, Error> {
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
    let head = ManifestFile {
        format: FORMAT.to_owned(),
        version: FORMAT_VERSION,
        writer: writer.to_owned(),
        identity: dataset.identity.clone(),
        layout: dataset.layout.clone(),
        frames,
        shards: shards.len() as u64,
        categories: dataset.categories.clone(),
        head_sha256: String::new(),
        files: Vec::new(),
    };
    let head = json(&head.sealed());
    // The list is appended inside the braces of the head, because it may be larger than the memory.
    out(head.strip_suffix(b"}").unwrap_or(&head))?;
    out(b",\"files\":[")?;
    let mut first = true;
    let mut list = |file: &FileRecord, shard: Option<u64>| {
        out(if std::mem::take(&mut first) { b"\n" } else { b",\n" })?;
        let FileRecord { path, bytes, sha256 } = file.clone();
        out(&json(&Entry { path, bytes, sha256, shard }))
    };
    merged.iter().try_for_each(|file| list(file, None))?;
    for &shard in shards {
        read_record(folder, shard)?.files.iter().try_for_each(|file| list(file, Some(shard)))?;
        list(&folder.record(&names::record(shard))?, Some(shard))?;
    }
    out(b"]}\n")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use papsynth::model::Model;

    use super::super::begin::DatasetInfo;
    use super::*;
    use crate::files::fault;
    use crate::formats::Layout;
    use crate::support::{SEED, frame, recipe};

    /// Generates a data set of one stack.
    fn make(path: &Path) -> Result<(), Error> {
        let layout = Layout::new([Format::Folder, Format::OmeZarr].into_iter().filter(|f| f.needs().is_none()));
        let info = DatasetInfo { recipe: &recipe(), model: &Model::builtin(), seed: SEED, map: None, layout: &layout };
        let dataset = Dataset::create_or_resume(path, &info)?;
        if dataset.complete_record(0, Check::Sizes)?.is_none() {
            let frame = frame(0, 2, 8, 1);
            let mut writer = dataset.shard_writer(0)?;
            writer.begin(&frame.finished.scene)?;
            frame.planes.iter().try_for_each(|plane| writer.write_plane(plane))?;
            writer.end(&frame.finished)?;
            writer.commit()?;
        }
        dataset.finish().map(|_| ())
    }

    #[test]
    fn after_any_disk_failure_no_file_is_partial_and_the_next_run_completes_the_set() {
        // The manifest is written at the start and at the end.
        let failures = fault::everywhere("faults", 60, names::MANIFEST, make);
        assert!(failures > 50, "{failures}");
    }
}
