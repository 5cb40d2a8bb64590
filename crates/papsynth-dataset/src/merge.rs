//! What is known of all frames, in one place. Only one frame is held at a time.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::coco::{Annotation, Document, Info};
use crate::dataset::{Dataset, read_record, recorded_frames, whole_record};
use crate::error::Error;
use crate::files::{Folder, Output};
use crate::frame_writer::white;
use crate::layout::{self, Form};
use crate::picture::ContactSheet;
use crate::read::{self, LevelImage, Limits};
use crate::record::{Check, FORMAT, FORMAT_VERSION, FileRecord, FrameSummary, ManifestHead, WRITER, broken};

/// A data set in a few numbers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Number of whole frames.
    pub frames: u64,
    /// Number of objects and parts of cells by category, as `coco.json` names it.
    pub objects: BTreeMap<String, u64>,
    /// Frames that were begun, but of which a file is missing or of another size: they are not in the merged files.
    pub damaged: Vec<u64>,
}

/// What was written for one frame is read whole.
const FRAME_FILE_BYTES: u64 = 1 << 32;

pub(crate) fn merge(dataset: &Dataset) -> Result<Summary, Error> {
    let folder = &dataset.folder;
    let mut summary = Summary { frames: 0, objects: BTreeMap::new(), damaged: Vec::new() };
    let mut frames = Vec::new();
    for index in recorded_frames(folder)? {
        let Ok(record) = whole_record(folder, &dataset.identity, index, Check::Sizes)? else {
            summary.damaged.push(index);
            continue;
        };
        frames.push(index);
        for (category, count) in record.summary.objects {
            *summary.objects.entry(category).or_insert(0) += count;
        }
    }
    summary.frames = frames.len() as u64;
    let given = [layout::MODEL, layout::RECIPE].into_iter().chain(dataset.map.as_deref());
    let mut merged = given.map(|name| folder.record(name)).collect::<Result<Vec<_>, _>>()?;
    if !frames.is_empty() {
        merged.push(folder.write_if_new(layout::TABLE, |out| tables(folder, &frames, out))?);
        merged.push(folder.write_if_new(layout::COCO, |out| documents(dataset, &frames, out))?);
        merged.push(contact_sheet(folder, &frames)?);
    }
    merged.sort_by(|a, b| a.path.cmp(&b.path));
    write_manifest(dataset, &merged, &frames)?;
    for name in layout::FOLDERS.into_iter().chain([""]) {
        folder.sync_names(name);
    }
    Ok(summary)
}

/// The tables one below the other, under the header of the first.
fn tables(folder: &Folder, frames: &[u64], out: &mut Output) -> Result<(), Error> {
    for (i, &index) in frames.iter().enumerate() {
        let text = read::bytes(&folder.path(&layout::table(index)), FRAME_FILE_BYTES)?;
        let header = text.iter().position(|&b| b == b'\n').map_or(text.len(), |end| end + 1);
        out.bytes(if i == 0 { &text } else { &text[header..] })?;
    }
    Ok(())
}

fn documents(dataset: &Dataset, frames: &[u64], out: &mut Output) -> Result<(), Error> {
    let folder = &dataset.folder;
    out.bytes(b"{\"info\":")?;
    out.json(&Info::default())?;
    out.bytes(b",\"licenses\":[],\"categories\":")?;
    out.json(&dataset.categories)?;
    out.bytes(b",\"images\":[")?;
    let images = frames.iter().flat_map(|&index| match document(folder, index) {
        Ok(document) => document.images.into_iter().map(Ok).collect(),
        Err(error) => vec![Err(error)],
    });
    out.json_lines(images)?;
    out.bytes(b"],\"annotations\":[")?;
    let annotations = frames.iter().flat_map(|&index| match document(folder, index) {
        Ok(document) => document.annotations.into_iter().map(Ok).collect(),
        Err(error) => vec![Err(error)],
    });
    out.json_lines((1..).zip(annotations).map(|(id, annotation)| annotation.map(|a| a.renumbered(id))))?;
    out.bytes(b"]}\n")
}

fn document(folder: &Folder, index: u64) -> Result<Document, Error> {
    let path = folder.path(&layout::coco(index));
    let bytes = read::bytes(&path, FRAME_FILE_BYTES)?;
    serde_json::from_slice(&bytes).map_err(|e| Error::input(&path)(broken(e)))
}

fn contact_sheet(folder: &Folder, frames: &[u64]) -> Result<FileRecord, Error> {
    let mut sheet = ContactSheet::new(frames.len());
    for &index in frames.iter().take(ContactSheet::MAX_FRAMES) {
        let frame = read_record(folder, index)?.summary;
        let image = level_image(folder, &frame)?;
        let document = document(folder, index)?;
        let path = folder.path(&layout::coco(index));
        let masks = document.annotations.iter().map(Annotation::amodal).collect::<Result<Vec<_>, _>>();
        sheet.add(&layout::frame_name(index), &image, white(frame.bits), &masks.map_err(Error::input(&path))?);
    }
    let picture = sheet.into_picture();
    let png = picture.to_png().map_err(Error::io("encode", &folder.path(layout::SHEET)))?;
    folder.write_if_new(layout::SHEET, |out| out.bytes(&png))
}

/// The image of a frame, of a stack the one with everything in focus.
fn level_image(folder: &Folder, frame: &FrameSummary) -> Result<LevelImage, Error> {
    let name = match Form::of(frame.planes_um.len()) {
        Form::Single => layout::image(frame.index, Form::Single),
        Form::Stack => layout::all_in_focus(frame.index),
    };
    let limits = Limits { max_pixels: 1 << 30, max_file_bytes: FRAME_FILE_BYTES, ..Limits::default() };
    LevelImage::read(&folder.path(&name), &limits)
}

/// The head, then every file: those at the top, then frame by frame, each record after the files it vouches for.
pub(crate) fn write_manifest(dataset: &Dataset, merged: &[FileRecord], frames: &[u64]) -> Result<FileRecord, Error> {
    let folder = &dataset.folder;
    let head = ManifestHead {
        format: FORMAT,
        version: FORMAT_VERSION,
        writer: WRITER,
        identity: &dataset.identity,
        frames: frames.len() as u64,
    };
    let of_frame = |index: u64| -> Result<Vec<FileRecord>, Error> {
        let mut files = read_record(folder, index)?.files;
        files.push(folder.record(&layout::record(index))?);
        Ok(files)
    };
    let head =
        serde_json::to_string(&head).map_err(|e| Error::io("encode", &folder.path(layout::MANIFEST))(e.into()))?;
    folder.write_if_new(layout::MANIFEST, |out| {
        // The list is put into the head's braces by hand: it may be longer than memory.
        out.bytes(head.strip_suffix('}').unwrap_or(&head).as_bytes())?;
        out.bytes(b",\"files\":[")?;
        let listed = frames.iter().flat_map(|&index| match of_frame(index) {
            Ok(files) => files.into_iter().map(Ok).collect(),
            Err(e) => vec![Err(e)],
        });
        out.json_lines(merged.iter().cloned().map(Ok).chain(listed))?;
        out.bytes(b"]}\n")
    })
}
