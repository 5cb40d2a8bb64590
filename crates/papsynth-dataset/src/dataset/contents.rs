//! Whether the files of a shard say the same: what no hash tells of a file that was written wrong, or changed by somebody who mended
//! the hashes.
//!
//! Everything follows from the complete masks in the COCO document: which pixels lie in front, boxes and areas, the table, the
//! record's summary, and every label image, layer and outline of every format. Images must be the same in all formats, and as large and deep as
//! the record says.

use std::fmt::{self, Formatter};
use std::path::Path;

use papsynth::scene::Scene;
use papsynth::truth::{Group, Mask, ObjectTruth, Truth, front_masks};

use super::record::ShardRecord;
use super::set::Dataset;
use crate::error::{Error, Problem};
use crate::files::Folder;
use crate::formats::{Field, Format, LIMITS, TarFile, Written, huggingface, names, tar};
use crate::read;
use crate::truth::{Document, FrameSummary, Geometry, Image, Info, Split, table};

/// What is wrong with a file of a shard.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Flaw {
    pub(crate) path: String,
    pub(crate) message: String,
}

impl fmt::Display for Flaw {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.path, self.message)
    }
}

/// What does not fit together in a shard whose files are as its record says.
pub(super) fn flaw(dataset: &Dataset, record: &ShardRecord) -> Result<Option<Flaw>, Error> {
    match compare(dataset, record) {
        Ok(()) => Ok(None),
        Err(Error::Input { path, problem }) => {
            let path = path.strip_prefix(dataset.path()).unwrap_or(&path).display().to_string();
            // Of a file in a tar file, the tar file is at fault.
            Ok(Some(match path.split_once(".tar/") {
                Some((tar, entry)) => Flaw { path: format!("{tar}.tar"), message: format!("{entry}: {problem}") },
                None => Flaw { path, message: problem.to_string() },
            }))
        }
        Err(other) => Err(other),
    }
}

fn compare(dataset: &Dataset, record: &ShardRecord) -> Result<(), Error> {
    let Dataset { folder, layout, .. } = dataset;
    let (coco, csv) = (&folder.path(&names::coco(record.shard)), &folder.inside(&names::table(record.shard))?);
    let document = dataset.document(record.shard)?;
    if document.images.len() != record.frames.len() {
        return differs(coco, format!("it has {} images, the record {}", document.images.len(), record.frames.len()));
    }
    if document.info != Info::default() || !document.licenses.is_empty() {
        return differs(coco, "it does not say what a document of a data set says of itself".to_owned());
    }
    if document.categories != dataset.categories {
        return differs(coco, "its categories are not those of the data set".to_owned());
    }
    held_by_their_hashes(dataset, record)?;
    let tar_file = layout.has(Format::Webdataset).then(|| TarFile::open(folder, &tar(record.shard)));
    let mut tar_file = tar_file.transpose()?;
    let mut tar = tar_file.as_mut().map(TarFile::files).transpose()?;
    let (mut rows, mut before) = (Vec::new(), 0);
    for (number, frame) in record.frames.iter().enumerate() {
        let truth = dataset.truth_in(&document, record.shard, frame.index)?;
        let geometry = Geometry::of_summary(frame, record.identity.seed);
        let own = own_document(coco, &document, frame, &truth, record)?;
        let field = Field::new(&geometry, frame, &truth, &own, &[]);
        let written = Written::new(folder, layout, &field);
        layout.formats.iter().try_for_each(|format| format.check(&written, tar.as_mut()))?;
        if layout.scenes {
            scene(folder, frame, record.identity.seed)?;
        }
        rows.extend(table(&truth, frame.index, number == 0));
        let count = own.annotations.len() as u64;
        let there = document.annotations.iter().filter(|annotation| annotation.image() == frame.index);
        if !own.annotations.into_iter().map(|annotation| annotation.renumbered(before)).eq(there.cloned()) {
            return differs(
                coco,
                format!("ids, parents or categories of image {} are not as they are given", frame.index),
            );
        }
        before += count;
    }
    if before != document.annotations.len() as u64 {
        return differs(coco, "it has annotations of no image".to_owned());
    }
    tar.map_or(Ok(()), |mut tar| tar.end())?;
    match read::bytes(csv, LIMITS.max_file_bytes)? == rows {
        true => Ok(()),
        false => differs(csv, format!("it is not the table of {}", names::coco(record.shard))),
    }
}

/// Files that no other is compared with, because their hashes tell enough, are in the record.
fn held_by_their_hashes(dataset: &Dataset, record: &ShardRecord) -> Result<(), Error> {
    let layout = &dataset.layout;
    let mut due: Vec<String> = layout.objects_parquet.then(|| names::objects(record.shard)).into_iter().collect();
    if layout.has(Format::Huggingface) {
        let split = |frame: &FrameSummary| Split::of_slide(record.identity.seed, frame.slide);
        due.extend(record.frames.iter().map(|frame| huggingface::file(split(frame), record.shard)));
    }
    match due.iter().find(|name| record.files.iter().all(|file| file.path != **name)) {
        Some(name) => Err(Error::input(&dataset.folder.path(name))(Problem::Missing { wanted: "file" })),
        None => Ok(()),
    }
}

/// Whether the scene of a frame can be read and is that of the frame.
fn scene(folder: &Folder, frame: &FrameSummary, seed: u64) -> Result<(), Error> {
    let path = folder.inside(&names::scene(frame.index))?;
    let broken = |message: String| Error::input(&path)(Problem::Broken { format: "JSON", message });
    let text = String::from_utf8(read::bytes(&path, LIMITS.max_file_bytes)?).map_err(|e| broken(e.to_string()))?;
    let scene = Scene::from_json(&text).map_err(|e| broken(e.to_string()))?;
    match Geometry::of(&scene) == Geometry::of_summary(frame, seed) {
        true => Ok(()),
        false => differs(&path, format!("it is not the scene of image {}", frame.index)),
    }
}

/// The document of a frame as it is written: from its masks alone, if what lies in front and the record's summary follow from them, too.
fn own_document(
    coco: &Path,
    document: &Document,
    frame: &FrameSummary,
    truth: &Truth,
    record: &ShardRecord,
) -> Result<Document, Error> {
    let ShardRecord { identity, layout, shard, .. } = record;
    if [truth.width, truth.height] != [frame.width, frame.height] {
        return differs(coco, format!("image {} has not the size that the record says", frame.index));
    }
    for group in Group::ALL {
        let objects: Vec<&ObjectTruth> = truth.objects.iter().filter(|object| object.group() == group).collect();
        let stack: Vec<_> = objects.iter().map(|o| (o.id, o.depth_um, &o.amodal)).collect();
        let fronts = front_masks(&stack, truth.width, truth.height);
        if let Some((object, _)) = objects.iter().zip(fronts).find(|(object, front)| object.front != *front) {
            let message = format!("image {}: not what lies in front of object {} is its front", frame.index, object.id);
            return differs(coco, message);
        }
    }
    let image = document.images.iter().find(|image| image.index() == frame.index);
    let mut saturated = image.map_or_else(|| Ok(Vec::new()), Image::saturated).map_err(Error::input(coco))?;
    if saturated.is_empty() {
        saturated.resize(frame.planes_um.len(), Mask::default());
    }
    let geometry = Geometry::of_summary(frame, identity.seed);
    if FrameSummary::of(&geometry, truth, &saturated, frame.floored.clone(), layout.flatten) != *frame {
        return differs(coco, format!("image {}: the record's summary is of other objects", frame.index));
    }
    let files = layout.images_of(identity.seed, *shard, frame);
    let own = Document::of_frame(truth, frame, &saturated, &document.categories, files)
        .or_else(|error| differs(coco, format!("it has no category `{}`", error.name)))?;
    match own.images.first() == image {
        true => Ok(own),
        false => differs(coco, format!("image {} is not where, or as large as, it says", frame.index)),
    }
}

fn differs<T>(path: &Path, what: String) -> Result<T, Error> {
    Err(Error::input(path)(Problem::differs(what)))
}
