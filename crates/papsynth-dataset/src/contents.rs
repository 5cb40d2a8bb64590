//! Whether the files of a shard say the same: what no hash tells of a file that was written wrong, or changed by somebody who mended
//! the hashes.
//!
//! Everything follows from the complete masks in the COCO document: which pixels lie in front, boxes and areas, the table, the
//! record's summary, and every label image, layer and outline of every format. Images must be the same in all formats, and as large and deep as
//! the record says.

use std::fs::File;
use std::io::{BufReader, ErrorKind};
use std::path::Path;

use papsynth::scene::Scene;
use papsynth::truth::{Group, Mask, ObjectTruth, Truth, front_masks};

use crate::coco::{Category, Document, Image, Info};
use crate::dataset::Flaw;
use crate::error::{Error, Problem};
use crate::files::Folder;
use crate::formats::{Field, Format, Shards, Tar, Written, tar};
use crate::image_of::LIMITS;
use crate::layout::{self, Layout};
use crate::merge::document;
use crate::parquet::{Frames, ObjectRows};
use crate::read;
use crate::record::{FrameSummary, Geometry, ShardRecord};
use crate::shard_writer::summary;
use crate::table::table;

/// What does not fit together in a shard whose files are as its record says.
pub(crate) fn flaw(
    folder: &Folder,
    layout: &Layout,
    categories: &[Category],
    record: &ShardRecord,
) -> Result<Option<Flaw>, Error> {
    match compare(folder, layout, categories, record) {
        Ok(()) => Ok(None),
        Err(Error::Input { path, problem }) => {
            let path = path.strip_prefix(folder.root()).unwrap_or(&path).display().to_string();
            // Of a file in a tar file, the tar file is at fault.
            Ok(Some(match path.split_once(".tar/") {
                Some((tar, entry)) => Flaw { path: format!("{tar}.tar"), message: format!("{entry}: {problem}") },
                None => Flaw { path, message: problem.to_string() },
            }))
        }
        Err(other) => Err(other),
    }
}

fn compare(folder: &Folder, layout: &Layout, categories: &[Category], record: &ShardRecord) -> Result<(), Error> {
    let (coco, csv) = (&folder.path(&layout::coco(record.shard)), &folder.inside(&layout::table(record.shard))?);
    let document = document(folder, record.shard)?;
    if document.images.len() != record.frames.len() {
        return differs(coco, format!("it has {} images, the record {}", document.images.len(), record.frames.len()));
    }
    if document.info != Info::default() || !document.licenses.is_empty() {
        return differs(coco, "it does not say what a document of a data set says of itself".to_owned());
    }
    if document.categories != categories {
        return differs(coco, "its categories are not those of the data set".to_owned());
    }
    let tar_path = folder.inside(&tar(record.shard))?;
    let open = || match File::open(&tar_path) {
        Err(e) if e.kind() == ErrorKind::NotFound => Err(Error::input(&tar_path)(Problem::Missing { wanted: "file" })),
        opened => opened.map_err(Error::io("read", &tar_path)),
    };
    let mut archive = match layout.has(Format::Webdataset) {
        true => Some(tar::Archive::new(BufReader::new(open()?))),
        false => None,
    };
    let tar = archive.as_mut().map(|archive| Tar::new(&tar_path, archive)).transpose()?;
    let frames = layout.has(Format::Huggingface).then(|| Frames::new(folder, record.shard)).transpose()?;
    let mut shards = Shards { tar, frames };
    let objects = folder.inside(&layout::objects(record.shard))?;
    let mut objects = layout.objects_parquet.then(|| ObjectRows::open(&objects)).transpose()?;
    let (mut rows, mut before) = (Vec::new(), 0);
    for (number, frame) in record.frames.iter().enumerate() {
        let truth = document.truth(frame.index).map_err(Error::input(coco))?;
        let geometry = Geometry::of_summary(frame, record.identity.seed);
        let own = own_document(coco, &document, frame, &truth, record)?;
        let field = Field::new(&geometry, frame, &truth, &own, &[]);
        let written = Written::new(folder, layout, &field);
        layout.formats.iter().try_for_each(|format| format.check(&written, &mut shards))?;
        objects.as_mut().map_or(Ok(()), |objects| objects.check(&truth, frame.index))?;
        if layout.scenes {
            scene(folder, frame, record.identity.seed)?;
        }
        let table = table(&truth, frame.index, number == 0)
            .map_err(|e| Error::input(csv)(Problem::Broken { format: "CSV", message: e.to_string() }))?;
        rows.extend(table);
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
    shards.tar.map_or(Ok(()), |mut tar| tar.end())?;
    shards.frames.map_or(Ok(()), Frames::end)?;
    objects.map_or(Ok(()), ObjectRows::end)?;
    match read::bytes(csv, LIMITS.max_file_bytes)? == rows {
        true => Ok(()),
        false => differs(csv, format!("it is not the table of {}", layout::coco(record.shard))),
    }
}

/// Whether the scene of a frame can be read and is that of the frame.
fn scene(folder: &Folder, frame: &FrameSummary, seed: u64) -> Result<(), Error> {
    let path = folder.inside(&layout::scene(frame.index))?;
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
    if summary(&geometry, truth, &saturated, frame.floored.clone(), layout.flatten) != *frame {
        return differs(coco, format!("image {}: the record's summary is of other objects", frame.index));
    }
    let files = layout.images_of(identity.seed, *shard, frame);
    let own = Document::of_frame(truth, frame, &saturated, &document.categories, files)
        .or_else(|name| differs(coco, format!("it has no category `{name}`")))?;
    match own.images.first() == image {
        true => Ok(own),
        false => differs(coco, format!("image {} is not where, or as large as, it says", frame.index)),
    }
}

fn differs<T>(path: &Path, what: String) -> Result<T, Error> {
    Err(Error::input(path)(Problem::Differs { what }))
}
