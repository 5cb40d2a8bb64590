//! Checks of a shard: its files match its record, and the files are consistent. The second check finds files that were
//! written wrongly, or changed together with their hashes.
//!
//! Everything is derived from the complete masks in the COCO document: visible masks, boxes, areas, the table, the
//! summary in the record, and every label image, layer and outline of every format. Images must be equal in all
//! formats, and have the size and the bit depth in the record.

use std::fmt::{self, Formatter};
use std::path::Path;

use papsynth::scene::Scene;
use papsynth::truth::{Group, Mask, ObjectTruth, Truth, visible_masks};
use serde::Serialize;

use super::manifest::Manifest;
use super::record::{ShardRecord, read_record, recorded_shards};
use super::set::Dataset;
use crate::error::{Error, InputError};
use crate::files::{Check, Folder, is_temporary, last_part};
use crate::formats::{Field, Format, LIMITS, TarFile, Written, names, tar};
use crate::read;
use crate::truth::{Document, FrameSummary, Info, Split, table};

/// One defect found by `verify` or `inspect`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Finding {
    /// Path of the file, relative to the data set.
    pub path: String,
    /// The defect.
    pub message: String,
    /// The remedy.
    pub fix: Fix,
}

impl Finding {
    /// A defect that generating the file again repairs.
    pub(crate) fn damaged(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self { path: path.into(), message: message.into(), fix: Fix::Generate }
    }

    /// A file that does not belong to the data set or slide (`owner`).
    pub(crate) fn untracked(path: &str, owner: &str) -> Self {
        let (message, fix) = match is_temporary(last_part(path)) {
            true => ("temporary file of an interrupted run".to_owned(), Fix::Clean),
            false => (format!("untracked: does not belong to the {owner}"), Fix::CleanUntracked),
        };
        Self { path: path.to_owned(), message, fix }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path, self.message)
    }
}

/// The remedy for a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fix {
    /// `papsynth generate --verify` with the same recipe generates the file again; for a slide `papsynth slide make
    /// --verify`.
    Generate,
    /// `papsynth clean` removes the temporary file.
    Clean,
    /// `papsynth clean --untracked` removes the file.
    CleanUntracked,
    /// `papsynth merge` after all shards are generated.
    Merge,
}

impl Dataset {
    /// Returns the record of a shard if the shard is complete: the record belongs to this data set, and all its files
    /// match it.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn complete_record(&self, shard: u64, check: Check) -> Result<Option<ShardRecord>, Error> {
        let record = self.record_or_finding(shard, check).map_err(|error| self.folder.named(error));
        Ok(record?.ok())
    }

    /// As [`complete_record`](Self::complete_record); returns the first defect of an incomplete shard.
    pub(crate) fn record_or_finding(&self, shard: u64, check: Check) -> Result<Result<ShardRecord, Finding>, Error> {
        let damaged = |message: String| Ok(Err(Finding::damaged(names::record(shard), message)));
        let record = match read_record(&self.folder, shard) {
            Ok(record) => record,
            Err(Error::Input { problem, .. }) => return damaged(problem.to_string()),
            Err(failure) => return Err(failure),
        };
        if record.identity != self.identity || record.layout != self.layout {
            return damaged("belongs to another data set".to_owned());
        }
        if let Some((path, message)) = self.folder.first_defect(&record.files, check)? {
            return Ok(Err(Finding::damaged(path, message)));
        }
        if check == Check::Hashes
            && let Some(finding) = inconsistency(self, &record)?
        {
            return Ok(Err(finding));
        }
        Ok(Ok(record))
    }

    /// Whether [`finish`](Self::finish) has merged all recorded frames, and the merged files still exist.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn is_finished(&self) -> Result<bool, Error> {
        let manifest = Manifest::read(&self.folder)?;
        if manifest.frames == 0 || manifest.shards != self.recorded()? {
            return Ok(false);
        }
        Ok(self.folder.first_defect(&manifest.files, Check::Sizes)?.is_none())
    }

    /// Checks that [`finish`](Self::finish) has merged all recorded frames. A data set whose generation was interrupted
    /// has frames that are not merged.
    ///
    /// # Errors
    /// If the number of merged shards is not that of the records, or a file cannot be read.
    pub fn check_finished(&self) -> Result<(), Error> {
        let (merged, recorded) = (Manifest::read(&self.folder)?.shards, self.recorded()?);
        if merged == recorded && merged > 0 {
            return Ok(());
        }
        let message = format!(
            "the data set is not finished: manifest.json has {merged} merged shards, and `shards` has {recorded}; run \
             the command that writes it again, or `papsynth merge` if all frames are generated"
        );
        Err(Error::folder(self.path(), message))
    }

    /// Returns the number of recorded shards.
    fn recorded(&self) -> Result<u64, Error> {
        Ok(recorded_shards(&self.folder)?.len() as u64)
    }
}

/// Returns the first inconsistency between the files of a shard that match their record.
fn inconsistency(dataset: &Dataset, record: &ShardRecord) -> Result<Option<Finding>, Error> {
    match compare(dataset, record) {
        Ok(()) => Ok(None),
        Err(Error::Input { path, problem }) => {
            let path = path.strip_prefix(dataset.path()).unwrap_or(&path).display().to_string();
            // The finding names the tar file, not the file in it.
            Ok(Some(match path.split_once(".tar/") {
                Some((tar, entry)) => Finding::damaged(format!("{tar}.tar"), format!("{entry}: {problem}")),
                None => Finding::damaged(path, problem.to_string()),
            }))
        }
        Err(other) => Err(other),
    }
}

fn compare(dataset: &Dataset, record: &ShardRecord) -> Result<(), Error> {
    let Dataset { folder, layout, .. } = dataset;
    let (coco, csv) = (&folder.path(&names::coco(record.shard)), &folder.inside(&names::table(record.shard))?);
    let document = dataset.document(record.shard)?;
    let check = |fits: bool, what: String| InputError::unless(fits, what).map_err(Error::input(coco));
    let (images, frames) = (document.images.len(), record.frames.len());
    check(images == frames, format!("it lists {images} images; the record lists {frames} frames"))?;
    let is_ours = document.info == Info::default() && document.licenses.is_empty();
    check(is_ours, "its `info` or `licenses` differ from those of a data set".to_owned())?;
    check(document.categories == dataset.categories, "its categories differ from those of the data set".to_owned())?;
    unparsed_files_are_listed(dataset, record)?;
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
        check(same, format!("image {}: ids, parents or categories of its annotations are wrong", frame.index))?;
        before += count;
    }
    check(before == document.annotations.len() as u64, "it has annotations without an image".to_owned())?;
    tar.map_or(Ok(()), |mut tar| tar.end())?;
    let same = read::bytes(csv, LIMITS.max_file_bytes)? == rows;
    InputError::unless(same, format!("differs from {}", names::coco(record.shard))).map_err(Error::input(csv))
}

/// Checks that the record lists the files that are checked by their hashes alone.
fn unparsed_files_are_listed(dataset: &Dataset, record: &ShardRecord) -> Result<(), Error> {
    let layout = &dataset.layout;
    let mut expected: Vec<String> = layout.objects_parquet.then(|| names::objects(record.shard)).into_iter().collect();
    if layout.has(Format::Huggingface) {
        let split = |frame: &FrameSummary| Split::of_slide(record.identity.seed, frame.slide);
        expected.extend(record.frames.iter().map(|frame| names::huggingface_file(split(frame), record.shard)));
    }
    match expected.iter().find(|name| record.files.iter().all(|file| file.path != **name)) {
        Some(name) => Err(Error::input(&dataset.folder.path(name))(InputError::Missing("file"))),
        None => Ok(()),
    }
}

/// Checks that the scene file of a frame is valid and belongs to the frame.
fn scene(folder: &Folder, frame: &FrameSummary, seed: u64) -> Result<(), Error> {
    let path = folder.inside(&names::scene(frame.index))?;
    let broken = |message: String| Error::input(&path)(InputError::Broken { format: "JSON", message });
    let text = String::from_utf8(read::bytes(&path, LIMITS.max_file_bytes)?).map_err(|e| broken(e.to_string()))?;
    let scene = Scene::from_json(&text).map_err(|e| broken(e.to_string()))?;
    let same = scene.key.seed == seed && frame.is_of(&scene);
    InputError::unless(same, format!("the scene of another frame, not {}", frame.index)).map_err(Error::input(&path))
}

/// Builds the COCO document of a frame from its masks, and checks the visible masks and the summary in the record.
fn own_document(
    coco: &Path,
    document: &Document,
    frame: &FrameSummary,
    truth: &Truth,
    record: &ShardRecord,
) -> Result<Document, Error> {
    let ShardRecord { identity, layout, shard, .. } = record;
    let index = frame.index;
    let check = |fits: bool, what: String| InputError::unless(fits, what).map_err(Error::input(coco));
    let same = [truth.width, truth.height] == [frame.width, frame.height];
    check(same, format!("image {index}: the size differs from the record"))?;
    for group in Group::ALL {
        let objects: Vec<&ObjectTruth> = truth.objects.iter().filter(|object| object.group() == group).collect();
        let stack: Vec<_> = objects.iter().map(|o| (o.id, o.depth_um, &o.amodal)).collect();
        for (object, visible) in objects.iter().zip(visible_masks(&stack, truth.width, truth.height)) {
            let what = format!("image {index}: the visible mask of object {} is wrong", object.id);
            check(object.visible == visible, what)?;
        }
    }
    let mut saturated = document.saturated(index).map_err(Error::input(coco))?;
    if saturated.is_empty() {
        saturated.resize(frame.planes_um.len(), Mask::default());
    }
    let counted = frame.clone().counted(truth, &saturated, frame.clipped_px.clone(), layout.flatten);
    check(counted == *frame, format!("image {index}: the summary in the record differs"))?;
    let files = layout.images_of(identity.seed, *shard, frame);
    let own = Document::of_frame(truth, frame, &saturated, &document.categories, files, layout.min_detectability)
        .map_err(|category| Error::input(coco)(InputError::unfit(format!("the category `{category}` is missing"))))?;
    let same = own.images.first() == document.image(index);
    check(same, format!("image {index}: file name or size differ from the record")).map(|()| own)
}
