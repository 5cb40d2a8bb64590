//! Reading of frames: images and ground truth in every format, comparison of two data sets, and fields to measure.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::PoisonError;

use papsynth::truth::{Group, ObjectTruth, Truth};
use papsynth::white_level as white;

use super::record::{read_record, recorded_shards};
use super::set::Dataset;
use crate::error::{Error, InputError};
use crate::files::Check;
#[cfg(feature = "zarr")]
use crate::formats::read_planes;
use crate::formats::{Extra, Format, LIMITS, Take, TarFile, levels, names, parquet, to_camera};
use crate::read::{self, FieldFile, LevelImage, NucleiFile, files_in};
use crate::truth::FrameSummary;

/// The location of a recorded frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct FrameLocation {
    /// Index of the frame.
    pub index: u64,
    /// Number of its shard.
    pub shard: u64,
}

impl Dataset {
    /// Returns the locations of all recorded frames, sorted by index. It reads no records if each shard has one frame.
    ///
    /// # Errors
    /// If a record cannot be read.
    pub fn frame_locations(&self) -> Result<Vec<FrameLocation>, Error> {
        let shards = recorded_shards(&self.folder)?;
        if self.layout.is_by_frame() {
            return Ok(shards.into_iter().map(|shard| FrameLocation { index: shard, shard }).collect());
        }
        let mut locations = Vec::new();
        for shard in shards {
            let frames = read_record(&self.folder, shard)?.frames;
            locations.extend(frames.iter().map(|frame| FrameLocation { index: frame.index, shard }));
        }
        Ok(locations)
    }

    /// Returns the recorded summary of a frame.
    ///
    /// # Errors
    /// If the record of its shard cannot be read or does not contain the frame.
    pub fn summary(&self, location: FrameLocation) -> Result<FrameSummary, Error> {
        let frames = read_record(&self.folder, location.shard)?.frames;
        frames.into_iter().find(|frame| frame.index == location.index).ok_or_else(|| {
            let message = format!("contains no frame {}", location.index);
            let path = self.folder.path(&names::record(location.shard));
            Error::input(&path)(InputError::broken("JSON", message))
        })
    }

    /// Whether the data set contains the planes of stacks, not only their extended-depth-of-field images.
    #[must_use]
    pub fn has_planes(&self) -> bool {
        self.with_planes().is_some()
    }

    fn with_planes(&self) -> Option<Format> {
        self.layout.best_format(true).filter(|format| format.needs().is_none())
    }

    /// Calls `take` with the number and the grey levels of each plane of a frame: row by row, channels interleaved,
    /// from 0 to [`FrameSummary::white`]. For a stack without planes ([`has_planes`](Self::has_planes)), the only plane
    /// is the extended-depth-of-field image.
    ///
    /// # Errors
    /// If the image cannot be read or differs from the record.
    pub fn planes(&self, frame: &FrameSummary, shard: u64, take: &mut dyn FnMut(usize, Vec<u16>)) -> Result<(), Error> {
        let expected = frame.planes_um.len();
        let format = self.with_planes().filter(|_| expected > 1);
        let Some(format) = format else {
            let page = display_image(self, frame, shard)?;
            take(0, checked_levels(page, frame).map_err(|problem| frame.wrong(problem.to_string()))?);
            return Ok(());
        };
        let name = format.image(self.identity.seed, shard, frame);
        let mut number = 0;
        pages(self, &name, frame, shard, &mut |page| {
            if number < expected {
                take(number, checked_levels(page, frame)?);
            }
            number += 1;
            Ok(())
        })?;
        let complete = InputError::unless(number == expected, format!("planes: found {number}, expected {expected}"));
        complete.map_err(Error::input(&self.folder.path(&name)))
    }

    /// Reads the ground truth of a frame.
    ///
    /// # Errors
    /// If it cannot be read or is inconsistent.
    pub fn truth(&self, location: FrameLocation) -> Result<Truth, Error> {
        self.truth_in(&self.document(location.shard)?, location.shard, location.index)
    }
}

/// Reads the image that shows a frame in one plane: for a stack the extended-depth-of-field image or, if it is missing,
/// the central plane.
pub(super) fn display_image(dataset: &Dataset, frame: &FrameSummary, shard: u64) -> Result<LevelImage, Error> {
    let seed = dataset.identity.seed;
    let edf = frame.is_stack().then(|| dataset.layout.edf_image(seed, shard, frame)).flatten();
    let best = || dataset.layout.best_format(false).map(|format| format.image(seed, shard, frame));
    let name = edf.map(|(name, _)| name).or_else(best).unwrap_or_default();
    let path = dataset.folder.path(&name);
    let (mut number, mut central) = (0, None);
    pages(dataset, &name, frame, shard, &mut |page| {
        if number <= frame.planes_um.len() / 2 {
            central = Some(page);
        }
        number += 1;
        Ok(())
    })?;
    central.ok_or_else(|| Error::input(&path)(InputError::NoImages))
}

/// Calls `take` with each page of an image of a frame.
pub(super) fn pages(
    dataset: &Dataset,
    name: &str,
    frame: &FrameSummary,
    shard: u64,
    take: &mut Take,
) -> Result<(), Error> {
    if !name.ends_with(names::ZARR_GROUP) {
        let mut files = images(dataset, name, shard)?.into_iter();
        let take = &mut |page| take(to_camera(page, frame.bits));
        let read = files.try_for_each(|file| LevelImage::pages(&file, &LIMITS, take));
        return read.map_err(Error::input(&dataset.folder.path(name)));
    }
    #[cfg(feature = "zarr")]
    return read_planes(&dataset.folder, frame, take);
    #[cfg(not(feature = "zarr"))]
    {
        let _ = (frame, take);
        Err(Format::OmeZarr.missing(dataset.path()))
    }
}

/// Reads the files of an image of the data set: one, or one for each plane.
pub(super) fn images(dataset: &Dataset, name: &str, shard: u64) -> Result<Vec<Vec<u8>>, Error> {
    let folder = &dataset.folder;
    if let Some((file, image)) = name.split_once(".parquet/") {
        let file = format!("{file}.parquet");
        check_hash(dataset, &file, shard)?;
        return parquet::images(&folder.inside(&file)?, image);
    }
    Ok(vec![match name.split_once(".tar/") {
        Some((tar, entry)) => TarFile::open(folder, &format!("{tar}.tar"))?.content(entry)?,
        None => read::bytes(&folder.inside(name)?, LIMITS.max_file_bytes)?,
    }])
}

/// Checks the SHA-256 of a file once, before a library reads it that does not validate its input.
fn check_hash(dataset: &Dataset, file: &str, shard: u64) -> Result<(), Error> {
    let mut trusted = dataset.trusted.lock().unwrap_or_else(PoisonError::into_inner);
    if trusted.contains(file) {
        return Ok(());
    }
    let record = read_record(&dataset.folder, shard)?;
    let defect = match record.files.iter().find(|found| found.path == file) {
        Some(found) => dataset.folder.defect(found, Check::Hashes)?,
        None => Some("no record lists this file".to_owned()),
    };
    match defect {
        Some(defect) => Err(Error::input(&dataset.folder.path(file))(InputError::unfit(defect))),
        None => {
            trusted.insert(file.to_owned());
            Ok(())
        }
    }
}

/// Returns the grey levels of a page after a check of its size.
fn checked_levels(page: LevelImage, frame: &FrameSummary) -> Result<Vec<u16>, InputError> {
    let FrameSummary { width, height, channels, .. } = *frame;
    let found = [page.width, page.height(), page.channels];
    if found[..2] != [width, height] || found[2] > channels {
        return Err(InputError::unfit(format!(
            "image size: found {} x {} px with {} channel(s), expected {width} x {height} px with {channels} channel(s)",
            found[0], found[1], found[2]
        )));
    }
    Ok(levels(page, channels))
}

/// Returns the slide and the image path of every recorded frame, by index.
///
/// # Errors
/// If a record is missing or cannot be read.
pub fn image_paths(dataset: &Dataset) -> Result<BTreeMap<u64, (u64, String)>, Error> {
    let mut images = BTreeMap::new();
    for shard in dataset.shards()? {
        for frame in read_record(&dataset.folder, shard)?.frames {
            let (image, _) = dataset.image_paths(&frame, shard);
            images.insert(frame.index, (frame.slide, image));
        }
    }
    Ok(images)
}

/// Returns the first difference between the ground truth of two data sets: objects, classes, positions, complete and
/// visible masks. Absorbance, defocus and detectability may differ.
///
/// # Errors
/// If one is not a data set, or its ground truth cannot be read.
pub fn truth_difference(one: &Path, other: &Path) -> Result<Option<String>, Error> {
    let (one, other) = (Dataset::open(one)?, Dataset::open(other)?);
    let mut there = Vec::new();
    for shard in recorded_shards(&other.folder)? {
        there.extend(read_record(&other.folder, shard)?.frames.into_iter().map(|frame| (frame.index, shard)));
    }
    for shard in recorded_shards(&one.folder)? {
        let here = one.document(shard)?;
        for frame in read_record(&one.folder, shard)?.frames {
            let index = frame.index;
            let Ok(at) = there.binary_search_by_key(&index, |(index, _)| *index) else {
                return Ok(Some(format!("frame {index} is missing")));
            };
            let a = one.truth_in(&here, shard, index)?;
            let b = other.truth_in(&other.document(there[at].1)?, there[at].1, index)?;
            if let Some(difference) = difference(&a, &b) {
                return Ok(Some(format!("frame {index}: {difference}")));
            }
        }
    }
    Ok(None)
}

fn difference(one: &Truth, other: &Truth) -> Option<String> {
    if one.objects.len() != other.objects.len() {
        return Some(format!("found {} objects and parts, expected {}", other.objects.len(), one.objects.len()));
    }
    let what = |a: &ObjectTruth, b: &ObjectTruth| {
        let properties = [
            ("id", a.id == b.id && a.part == b.part && a.kind == b.kind),
            ("class", a.class == b.class),
            ("position", a.centre_um == b.centre_um && a.depth_um == b.depth_um && a.rotation_deg == b.rotation_deg),
            ("complete mask", a.amodal == b.amodal),
            ("visible mask", a.visible == b.visible),
        ];
        properties.into_iter().find(|(_, same)| !same).map(|(what, _)| format!("the {what} of object {} differs", a.id))
    };
    one.objects.iter().zip(&other.objects).find_map(|(a, b)| what(a, b))
}

/// Returns the fields in a folder, sorted by name. The folder is a data set with masks of nuclei, or contains images
/// (in it or in `images`). Nuclei of images are masks of the same name in `masks` (labels, or values above 0), or a
/// table `NAME.csv` of `y,x` points next to the image. `frames.csv` lists the group of each image.
///
/// # Errors
/// If there is no image, the data set is not finished, the folder cannot be read, or its tables are invalid.
pub fn field_files(folder: &Path) -> Result<Vec<FieldFile>, Error> {
    if folder.join(names::MANIFEST).exists() { of_dataset(folder) } else { files_in(folder) }
}

/// Returns the frames of a finished data set; for stacks, their extended-depth-of-field images.
fn of_dataset(path: &Path) -> Result<Vec<FieldFile>, Error> {
    let dataset = Dataset::open(path)?;
    let Dataset { folder, layout, .. } = &dataset;
    if !layout.has_extra(Extra::Labels) {
        let message = format!("the layout is {layout}; the format `folder` with labels is needed to read fields");
        return Err(Error::folder(path, message));
    }
    dataset.check_finished()?;
    let mut fields = Vec::new();
    for shard in recorded_shards(folder)? {
        let record = dataset.record_or_finding(shard, Check::Sizes)?.map_err(|finding| {
            let message =
                format!("shard {shard} is damaged: {finding}; generate it again with `papsynth generate --verify`");
            Error::folder(path, message)
        })?;
        for frame in record.frames {
            let index = frame.index;
            let image = if frame.is_stack() { names::all_in_focus(index) } else { names::image(&frame) };
            fields.push(FieldFile {
                name: names::numbered(index),
                group: String::new(),
                pixel_um: Some(frame.pixel_um),
                slide: Some(frame.slide),
                image: folder.inside(&image)?,
                nuclei: NucleiFile::Labels(folder.inside(&names::labels(Group::Nucleus, index))?),
                white: Some(white(frame.bits)),
            });
        }
    }
    Ok(fields)
}
