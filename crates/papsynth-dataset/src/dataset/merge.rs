//! What is known of all frames, in one place. Only one shard is held at a time.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};

use sha2::{Digest, Sha256};

use super::card::{card, croissant};
use super::images::picture;
use super::manifest::{Entry, ManifestFile};
use super::picture::ContactSheet;
use super::record::{FORMAT, FORMAT_VERSION, WRITER, read_record, recorded_shards};
use super::set::{Dataset, SHARD_FILE_BYTES, Summary};
use crate::bytes::{hex, json, json_lines};
use crate::error::Error;
use crate::files::{Check, FileRecord, Folder};
use crate::formats::parquet::Table;
use crate::formats::{Format, names};
use crate::read;
use crate::truth::{Annotation, Info, Row, Split, typed_columns};
use papsynth::white_level as white;

/// Takes the content of a file piece by piece.
pub(crate) type Sink<'a> = dyn FnMut(&[u8]) -> Result<(), Error> + Send + 'a;

/// Does with a file of this name and content what is to be done, and says how it is.
type Keep<'a> = dyn FnMut(&str, &dyn Fn(&mut Sink) -> Result<(), Error>) -> Result<FileRecord, Error> + 'a;

impl Dataset {
    /// Merges what is known of all whole shards into `manifest.json`, the data card, `croissant.json` and `splits.csv`, `contact-sheet.png` and, where every frame
    /// is a shard, `objects.csv` and `coco.json`; one shard at a time in their order. What is there already and the same is left untouched.
    ///
    /// # Errors
    /// If a file of a shard cannot be read any more, or the system refuses.
    pub fn finish(&self) -> Result<Summary, Error> {
        let listed = Self { folder: self.folder.listed()?, ..self.clone() };
        merge(&listed).map_err(|error| self.folder.named(error))
    }
}

fn merge(dataset: &Dataset) -> Result<Summary, Error> {
    let folder = &dataset.folder;
    let whole = Whole::find(dataset)?;
    let given = dataset.given().map(|name| folder.record(name)).collect::<Result<Vec<_>, _>>()?;
    let merged = files(dataset, &whole, WRITER, given, &mut |name, fill| {
        folder.write_if_new(name, |out| fill(&mut |bytes| out.bytes(bytes)))
    })?;
    folder.sync_names(&merged)?;
    let manifest = write_manifest(dataset, &merged, &whole.shards, whole.summary.frames)?;
    folder.sync_names([&manifest])?;
    Ok(Summary { root: manifest.sha256, ..whole.summary })
}

/// The files of no shard as they would be merged now, with the words of the program that wrote the data set; none is written.
pub(super) fn expected(dataset: &Dataset, writer: &str, given: Vec<FileRecord>) -> Result<Vec<FileRecord>, Error> {
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

/// The shards that are whole, and what their records say.
#[derive(Default)]
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
        let mut whole = Self::default();
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
                add(&mut whole.summary.occluded_px, frame.occluded_px);
                splits.insert(Split::of_slide(dataset.identity.seed, frame.slide));
            }
            whole.sharded.extend(record.files.into_iter().filter(|file| is_sharded(&file.path)));
        }
        whole.splits.extend(splits);
        let is_empty = |split: &Split| !whole.splits.contains(split);
        let empty = Split::ALL.into_iter().filter(is_empty).map(|split| split.name().to_owned());
        whole.summary.empty_splits = empty.collect();
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
            merged.push(keep(names::TABLE, &|out| tables(folder, shards, out))?);
            merged.push(keep(names::COCO, &|out| documents(dataset, shards, out))?);
            if dataset.layout.objects_parquet {
                merged.push(keep(names::OBJECTS, &|out| objects(dataset, shards, out))?);
            }
        }
        merged.push(keep(names::SPLITS, &|out| splits(dataset, shards, out))?);
        let sheet = contact_sheet(dataset, shards)?;
        merged.push(keep(names::SHEET, &|out| out(&sheet))?);
        let classes: Vec<String> = dataset.categories.iter().map(|category| category.name.clone()).collect();
        for format in &dataset.layout.formats {
            for (name, bytes) in format.shared(&classes, splits_there)? {
                merged.push(keep(&name, &|out| out(&bytes))?);
            }
        }
        let card = card(dataset, writer, summary);
        merged.push(keep(names::CARD, &|out| out(card.as_bytes()))?);
        let described: Vec<FileRecord> = merged.iter().chain(sharded).cloned().collect();
        let text = json_lines(&croissant(dataset, &described));
        merged.push(keep(names::CROISSANT, &|out| out(&text))?);
    }
    merged.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(merged)
}

/// Whether a file is one of a format that keeps many frames in a file.
fn is_sharded(path: &str) -> bool {
    let first = path.split('/').next();
    Format::ALL.into_iter().any(|format| format.is_sharded() && first == Some(format.name()))
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
        let text = read::bytes(&folder.inside(&names::table(index))?, SHARD_FILE_BYTES)?;
        let header = text.iter().position(|&b| b == b'\n').map_or(text.len(), |end| end + 1);
        folder.release([names::table(index).as_str()]);
        out(if i == 0 { &text } else { &text[header..] })?;
    }
    Ok(())
}

fn documents(dataset: &Dataset, shards: &[u64], out: &mut Sink) -> Result<(), Error> {
    out(b"{\"info\":")?;
    out(&json(&Info::default()))?;
    out(b",\"licenses\":[],\"categories\":")?;
    out(&json(&dataset.categories))?;
    out(b",\"images\":[")?;
    let mut first = true;
    for &shard in shards {
        for image in dataset.document(shard)?.images {
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

/// Hands on what is written piece by piece, and keeps the first error, of which the writer knows only that there is one.
struct Pieces<'a, 's> {
    out: &'a mut Sink<'s>,
    failure: Option<Error>,
}

impl Write for Pieces<'_, '_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        (self.out)(bytes).map(|()| bytes.len()).map_err(|error| {
            self.failure.get_or_insert(error);
            io::Error::other("what was written is not taken")
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
    let mut left = ContactSheet::MAX_FRAMES;
    for &shard in shards {
        if left == 0 {
            break;
        }
        let record = read_record(folder, shard)?;
        let document = dataset.document(shard)?;
        let path = folder.path(&names::coco(shard));
        for frame in record.frames.iter().take(left) {
            let image = picture(dataset, frame, shard)?;
            let masks = document.annotations.iter().filter(|a| a.image_id == frame.index).map(Annotation::amodal);
            let masks = masks.collect::<Result<Vec<_>, _>>().map_err(Error::input(&path))?;
            sheet.add(&names::numbered(frame.index), &image, white(frame.bits), &masks);
        }
        folder.release(record.files.iter().map(|file| file.path.as_str()));
        left = left.saturating_sub(record.frames.len());
    }
    sheet.picture.to_png().map_err(Error::io("encode", &folder.path(names::SHEET)))
}

/// The head, then every file: those of no shard, then shard by shard, each record after the files it vouches for.
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

/// The manifest of a data set without a frame, unless there is any manifest by now. Says whether it was written.
pub(super) fn begin_manifest(dataset: &Dataset) -> Result<bool, Error> {
    dataset
        .folder
        .write_unless_there(names::MANIFEST, |out| manifest(dataset, WRITER, &[], &[], 0, &mut |b| out.bytes(b)))
}

/// The SHA-256 of the manifest of all shards that are recorded.
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
    // The list is put into the head's braces by hand: it may be longer than memory.
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

    /// A data set of one stack, from nothing.
    fn make(path: &Path) -> Result<(), Error> {
        let layout = Layout::new([Format::Folder, Format::OmeZarr].into_iter().filter(|f| f.needs().is_none()));
        let info = DatasetInfo { recipe: &recipe(), model: &Model::builtin(), seed: SEED, map: None, layout: &layout };
        let dataset = Dataset::create_or_resume(path, &info)?;
        if dataset.whole(0, Check::Sizes)?.is_none() {
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
    fn wherever_the_disk_fails_no_file_is_partial_and_the_next_run_completes_the_set() {
        // The manifest is written at the beginning and at the end.
        let failures = fault::everywhere("faults", 40, names::MANIFEST, make);
        assert!(failures > 50, "{failures}");
    }
}
