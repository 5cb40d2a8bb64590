//! Whether a shard is whole: its files are as its record says, and they agree with each other. The second is what no hash
//! tells, of a file that was written wrong, or changed by somebody who mended the hashes.
//!
//! Everything follows from the complete masks in the COCO document: which pixels lie in front, boxes and areas, the table, the
//! record's summary, and every label image, layer and outline of every format. Images must be the same in all formats, and as large and deep as
//! the record says.

use std::fmt::{self, Formatter};
use std::path::Path;

use papsynth::scene::Scene;
use papsynth::truth::{Group, Mask, ObjectTruth, Truth, front_masks};
use serde::Serialize;

use super::manifest::Manifest;
use super::record::{ShardRecord, read_record, recorded_shards};
use super::set::Dataset;
use crate::error::{Error, Problem};
use crate::files::{Check, Folder, is_temporary};
use crate::formats::{Field, Format, LIMITS, TarFile, Written, names, tar};
use crate::read;
use crate::truth::{Document, FrameSummary, Info, Split, table};

/// One thing that is wrong.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Finding {
    /// The file, relative to the data set.
    pub path: String,
    /// What is wrong with it.
    pub message: String,
    /// What mends it.
    pub mend: Mend,
}

impl Finding {
    /// What making it again mends.
    pub(crate) fn made_wrong(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self { path: path.into(), message: message.into(), mend: Mend::Generate }
    }

    /// A file that a data set or slide (`whole`) does not have.
    pub(crate) fn stray(path: &str, whole: &str) -> Self {
        let message = match is_temporary(path.rsplit('/').next().unwrap_or(path)) {
            true => "was left behind by a run that was killed".to_owned(),
            false => format!("is no file of the {whole}"),
        };
        Self { path: path.to_owned(), message, mend: Mend::Clean }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.path, self.message)
    }
}

/// What mends a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mend {
    /// `papsynth generate --verify`, of a slide `papsynth slide make --verify`, with the same recipe makes it again.
    Generate,
    /// `papsynth clean` takes it away.
    Clean,
    /// `papsynth merge`, when all shards are there.
    Merge,
}

impl Dataset {
    /// The record of a shard if it is whole: its record is there, is of this data set, and all its files are as it says.
    ///
    /// # Errors
    /// If the system refuses to tell.
    pub fn whole(&self, shard: u64, check: Check) -> Result<Option<ShardRecord>, Error> {
        let whole = self.whole_or_flaw(shard, check).map_err(|error| self.folder.named(error));
        Ok(whole?.ok())
    }

    /// The same, or what the shard lacks.
    pub(crate) fn whole_or_flaw(&self, shard: u64, check: Check) -> Result<Result<ShardRecord, Finding>, Error> {
        let lacks = |message: String| Ok(Err(Finding::made_wrong(names::record(shard), message)));
        let record = match read_record(&self.folder, shard) {
            Ok(record) => record,
            Err(Error::Input { problem, .. }) => return lacks(problem.to_string()),
            Err(failure) => return Err(failure),
        };
        if record.identity != self.identity || record.layout != self.layout {
            return lacks("is of another data set".to_owned());
        }
        if let Some((path, message)) = self.folder.first_flaw(&record.files, check)? {
            return Ok(Err(Finding::made_wrong(path, message)));
        }
        if check == Check::Hashes
            && let Some(flaw) = flaw(self, &record)?
        {
            return Ok(Err(flaw));
        }
        Ok(Ok(record))
    }

    /// Whether [`finish`](Self::finish) has merged all frames that are recorded, and its files are still there.
    ///
    /// # Errors
    /// If the system refuses to tell.
    pub fn is_finished(&self) -> Result<bool, Error> {
        let manifest = Manifest::read(&self.folder)?;
        if manifest.frames == 0 || manifest.shards != recorded_shards(&self.folder)?.len() as u64 {
            return Ok(false);
        }
        Ok(self.folder.first_flaw(&manifest.files, Check::Sizes)?.is_none())
    }
}

/// What does not fit together in a shard whose files are as its record says.
fn flaw(dataset: &Dataset, record: &ShardRecord) -> Result<Option<Finding>, Error> {
    match compare(dataset, record) {
        Ok(()) => Ok(None),
        Err(Error::Input { path, problem }) => {
            let path = path.strip_prefix(dataset.path()).unwrap_or(&path).display().to_string();
            // Of a file in a tar file, the tar file is at fault.
            Ok(Some(match path.split_once(".tar/") {
                Some((tar, entry)) => Finding::made_wrong(format!("{tar}.tar"), format!("{entry}: {problem}")),
                None => Finding::made_wrong(path, problem.to_string()),
            }))
        }
        Err(other) => Err(other),
    }
}

fn compare(dataset: &Dataset, record: &ShardRecord) -> Result<(), Error> {
    let Dataset { folder, layout, .. } = dataset;
    let (coco, csv) = (&folder.path(&names::coco(record.shard)), &folder.inside(&names::table(record.shard))?);
    let document = dataset.document(record.shard)?;
    let due = |fits: bool, what: String| Problem::unless(fits, what).map_err(Error::input(coco));
    let (images, frames) = (document.images.len(), record.frames.len());
    due(images == frames, format!("it has {images} images, the record {frames}"))?;
    let is_ours = document.info == Info::default() && document.licenses.is_empty();
    due(is_ours, "it does not say what a document of a data set says of itself".to_owned())?;
    due(document.categories == dataset.categories, "its categories are not those of the data set".to_owned())?;
    held_by_their_hashes(dataset, record)?;
    let tar_file = layout.has(Format::Webdataset).then(|| TarFile::open(folder, &tar(record.shard)));
    let mut tar_file = tar_file.transpose()?;
    let mut tar = tar_file.as_mut().map(TarFile::files).transpose()?;
    let (mut rows, mut before) = (Vec::new(), 0);
    for (number, frame) in record.frames.iter().enumerate() {
        let truth = dataset.truth_in(&document, record.shard, frame.index)?;
        let own = own_document(coco, &document, frame, &truth, record)?;
        let field = Field::new(record.identity.seed, frame, &truth, &own, &[]);
        let written = Written::new(folder, layout, &field);
        layout.formats.iter().try_for_each(|format| format.check(&written, tar.as_mut()))?;
        if layout.scenes {
            scene(folder, frame, record.identity.seed)?;
        }
        rows.extend(table(&truth, frame.index, number == 0));
        let count = own.annotations.len() as u64;
        let there = document.annotations.iter().filter(|annotation| annotation.image_id == frame.index).cloned();
        let same = own.annotations.into_iter().map(|annotation| annotation.renumbered(before)).eq(there);
        due(same, format!("ids, parents or categories of image {} are not as they are given", frame.index))?;
        before += count;
    }
    due(before == document.annotations.len() as u64, "it has annotations of no image".to_owned())?;
    tar.map_or(Ok(()), |mut tar| tar.end())?;
    let same = read::bytes(csv, LIMITS.max_file_bytes)? == rows;
    Problem::unless(same, format!("it is not the table of {}", names::coco(record.shard))).map_err(Error::input(csv))
}

/// Files that no other is compared with, because their hashes tell enough, are in the record.
fn held_by_their_hashes(dataset: &Dataset, record: &ShardRecord) -> Result<(), Error> {
    let layout = &dataset.layout;
    let mut due: Vec<String> = layout.objects_parquet.then(|| names::objects(record.shard)).into_iter().collect();
    if layout.has(Format::Huggingface) {
        let split = |frame: &FrameSummary| Split::of_slide(record.identity.seed, frame.slide);
        due.extend(record.frames.iter().map(|frame| names::huggingface_file(split(frame), record.shard)));
    }
    match due.iter().find(|name| record.files.iter().all(|file| file.path != **name)) {
        Some(name) => Err(Error::input(&dataset.folder.path(name))(Problem::Missing("file"))),
        None => Ok(()),
    }
}

/// Whether the scene of a frame can be read and is that of the frame.
fn scene(folder: &Folder, frame: &FrameSummary, seed: u64) -> Result<(), Error> {
    let path = folder.inside(&names::scene(frame.index))?;
    let broken = |message: String| Error::input(&path)(Problem::Broken { format: "JSON", message });
    let text = String::from_utf8(read::bytes(&path, LIMITS.max_file_bytes)?).map_err(|e| broken(e.to_string()))?;
    let scene = Scene::from_json(&text).map_err(|e| broken(e.to_string()))?;
    let same = scene.key.seed == seed && frame.is_of(&scene);
    Problem::unless(same, format!("it is not the scene of image {}", frame.index)).map_err(Error::input(&path))
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
    let index = frame.index;
    let due = |fits: bool, what: String| Problem::unless(fits, what).map_err(Error::input(coco));
    let same = [truth.width, truth.height] == [frame.width, frame.height];
    due(same, format!("image {index} has not the size that the record says"))?;
    for group in Group::ALL {
        let objects: Vec<&ObjectTruth> = truth.objects.iter().filter(|object| object.group() == group).collect();
        let stack: Vec<_> = objects.iter().map(|o| (o.id, o.depth_um, &o.amodal)).collect();
        for (object, front) in objects.iter().zip(front_masks(&stack, truth.width, truth.height)) {
            let what = format!("image {index}: not what lies in front of object {} is its front", object.id);
            due(object.front == front, what)?;
        }
    }
    let mut saturated = document.saturated(index).map_err(Error::input(coco))?;
    if saturated.is_empty() {
        saturated.resize(frame.planes_um.len(), Mask::default());
    }
    let counted = frame.clone().counted(truth, &saturated, frame.clipped_px.clone(), layout.flatten);
    due(counted == *frame, format!("image {index}: the record's summary is of other objects"))?;
    let files = layout.images_of(identity.seed, *shard, frame);
    let own = Document::of_frame(truth, frame, &saturated, &document.categories, files)
        .map_err(|category| Error::input(coco)(Problem::unfit(format!("it has no category `{category}`"))))?;
    let same = own.images.first() == document.image(index);
    due(same, format!("image {index} is not where, or as large as, it says")).map(|()| own)
}
