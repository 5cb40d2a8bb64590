//! Frames of a data set read back: their images and their truth, whatever the format; compared with those of another, and as fields to measure.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::PoisonError;

use papsynth::truth::{Group, ObjectTruth, Truth};
use papsynth::white_level as white;

use super::record::{read_record, recorded_shards};
use super::set::Dataset;
use crate::error::{Error, Problem};
use crate::files::Check;
#[cfg(feature = "zarr")]
use crate::formats::read_planes;
use crate::formats::{Format, LIMITS, Take, TarFile, levels, names, parquet, to_camera};
use crate::read::{self, FieldFile, LevelImage, NucleiFile, files_in};
use crate::truth::FrameSummary;

/// Where a recorded frame lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct FramePlace {
    /// Index of the frame.
    pub index: u64,
    /// The shard that holds it.
    pub shard: u64,
}

impl Dataset {
    /// Where the recorded frames lie, by index. Where every frame is a shard of its own, no record is read.
    ///
    /// # Errors
    /// If a record cannot be read.
    pub fn places(&self) -> Result<Vec<FramePlace>, Error> {
        let shards = recorded_shards(&self.folder)?;
        if self.layout.is_by_frame() {
            return Ok(shards.into_iter().map(|shard| FramePlace { index: shard, shard }).collect());
        }
        let mut places = Vec::new();
        for shard in shards {
            let frames = read_record(&self.folder, shard)?.frames;
            places.extend(frames.iter().map(|frame| FramePlace { index: frame.index, shard }));
        }
        Ok(places)
    }

    /// What is recorded of a frame.
    ///
    /// # Errors
    /// If the record of its shard cannot be read, or does not know it.
    pub fn summary(&self, place: FramePlace) -> Result<FrameSummary, Error> {
        let frames = read_record(&self.folder, place.shard)?.frames;
        frames.into_iter().find(|frame| frame.index == place.index).ok_or_else(|| {
            let message = format!("it has no frame {}", place.index);
            let path = self.folder.path(&names::record(place.shard));
            Error::input(&path)(Problem::broken("JSON", message))
        })
    }

    /// Whether the data set has the planes of stacks, rather than their pictures with everything in focus alone.
    #[must_use]
    pub fn has_planes(&self) -> bool {
        self.with_planes().is_some()
    }

    fn with_planes(&self) -> Option<Format> {
        self.layout.best_format(true).filter(|format| format.needs().is_none())
    }

    /// Hands over the planes of a frame, one after the other: row by row, the channels of a pixel side by side, levels of 0 to [`FrameSummary::white`].
    /// Of a stack whose planes the data set does not have ([`has_planes`](Self::has_planes)) it is one, with everything in focus.
    ///
    /// # Errors
    /// If the image cannot be read, or is not what is recorded of it.
    pub fn planes(&self, frame: &FrameSummary, shard: u64, take: &mut dyn FnMut(usize, Vec<u16>)) -> Result<(), Error> {
        let due = frame.planes_um.len();
        let format = self.with_planes().filter(|_| due > 1);
        let Some(format) = format else {
            let page = picture(self, frame, shard)?;
            take(0, whole(page, frame).map_err(|problem| frame.wrong(problem.to_string()))?);
            return Ok(());
        };
        let name = format.image(self.identity.seed, shard, frame);
        let mut number = 0;
        pages(self, &name, frame, shard, &mut |page| {
            if number < due {
                take(number, whole(page, frame)?);
            }
            number += 1;
            Ok(())
        })?;
        let all = Problem::unless(number == due, format!("has {number} planes; the record says {due}"));
        all.map_err(Error::input(&self.folder.path(&name)))
    }

    /// What is known of a frame.
    ///
    /// # Errors
    /// If it cannot be read, or what it says does not fit together.
    pub fn truth(&self, place: FramePlace) -> Result<Truth, Error> {
        self.truth_in(&self.document(place.shard)?, place.shard, place.index)
    }
}

/// The image that shows a frame in one plane: of a stack the one with everything in focus or, where that was not written, the middle
/// plane.
pub(super) fn picture(dataset: &Dataset, frame: &FrameSummary, shard: u64) -> Result<LevelImage, Error> {
    let seed = dataset.identity.seed;
    let sharp = frame.is_stack().then(|| dataset.layout.sharp_image(seed, shard, frame)).flatten();
    let best = || dataset.layout.best_format(false).map(|format| format.image(seed, shard, frame));
    let name = sharp.map(|(name, _)| name).or_else(best).unwrap_or_default();
    let path = dataset.folder.path(&name);
    let (mut number, mut middle) = (0, None);
    pages(dataset, &name, frame, shard, &mut |page| {
        if number <= frame.planes_um.len() / 2 {
            middle = Some(page);
        }
        number += 1;
        Ok(())
    })?;
    middle.ok_or_else(|| Error::input(&path)(Problem::NoImages))
}

/// Hands over the pages of an image of a frame, one after the other.
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

/// The files that make up an image of the data set: one, or one for each plane.
pub(super) fn images(dataset: &Dataset, name: &str, shard: u64) -> Result<Vec<Vec<u8>>, Error> {
    let folder = &dataset.folder;
    if let Some((file, image)) = name.split_once(".parquet/") {
        let file = format!("{file}.parquet");
        is_as_recorded(dataset, &file, shard)?;
        return parquet::images(&folder.inside(&file)?, image);
    }
    Ok(vec![match name.split_once(".tar/") {
        Some((tar, entry)) => TarFile::open(folder, &format!("{tar}.tar"))?.content(entry)?,
        None => read::bytes(&folder.inside(name)?, LIMITS.max_file_bytes)?,
    }])
}

/// What a library reads that takes files on trust has the SHA-256 that is recorded. It is compared once.
fn is_as_recorded(dataset: &Dataset, file: &str, shard: u64) -> Result<(), Error> {
    let mut trusted = dataset.trusted.lock().unwrap_or_else(PoisonError::into_inner);
    if trusted.contains(file) {
        return Ok(());
    }
    let record = read_record(&dataset.folder, shard)?;
    let flaw = match record.files.iter().find(|found| found.path == file) {
        Some(found) => dataset.folder.flaw(found, Check::Hashes)?,
        None => Some("is in no record".to_owned()),
    };
    match flaw {
        Some(flaw) => Err(Error::input(&dataset.folder.path(file))(Problem::unfit(flaw))),
        None => {
            trusted.insert(file.to_owned());
            Ok(())
        }
    }
}

/// The levels of a page that is as large as the record says.
fn whole(page: LevelImage, frame: &FrameSummary) -> Result<Vec<u16>, Problem> {
    let FrameSummary { width, height, channels, .. } = *frame;
    let found = [page.width, page.height(), page.channels];
    if found[..2] != [width, height] || found[2] > channels {
        return Err(Problem::unfit(format!(
            "an image is {} x {} of {} channels; the record says {width} x {height} of {channels}",
            found[0], found[1], found[2]
        )));
    }
    Ok(levels(page, channels))
}

/// Of every recorded frame, by index, the slide and where its image lies.
///
/// # Errors
/// If a record cannot be read, or is missing of a shard that was merged.
pub fn images_of(dataset: &Dataset) -> Result<BTreeMap<u64, (u64, String)>, Error> {
    let mut images = BTreeMap::new();
    for shard in dataset.shards()? {
        for frame in read_record(&dataset.folder, shard)?.frames {
            let (image, _) = dataset.images_of(&frame, shard);
            images.insert(frame.index, (frame.slide, image));
        }
    }
    Ok(images)
}

/// The first difference between what lies where in two data sets: objects, classes, places, complete and visible masks. Stain,
/// defocus and detectability may differ.
///
/// # Errors
/// If one is no data set, or its truth cannot be read.
pub fn truth_differs(one: &Path, other: &Path) -> Result<Option<String>, Error> {
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
        return Some(format!("{} objects and parts, not {}", other.objects.len(), one.objects.len()));
    }
    let what = |a: &ObjectTruth, b: &ObjectTruth| {
        let claims = [
            ("id", a.id == b.id && a.part == b.part && a.kind == b.kind),
            ("class", a.class == b.class),
            ("place", a.centre_um == b.centre_um && a.depth_um == b.depth_um && a.rotation_deg == b.rotation_deg),
            ("complete mask", a.amodal == b.amodal),
            ("visible mask", a.front == b.front),
        ];
        claims.into_iter().find(|(_, same)| !same).map(|(what, _)| format!("object {} has another {what}", a.id))
    };
    one.objects.iter().zip(&other.objects).find_map(|(a, b)| what(a, b))
}

/// The fields in a folder, in the order of their names: a data set of ours with its masks of nuclei; or images (in the folder,
/// or in `images`), with masks of the same names in `masks` (labels, or anything above 0), or for each image
/// a table `NAME.csv` of `y,x` points beside it, and `frames.csv` that says which group each belongs to.
///
/// # Errors
/// If there is no image, the folder cannot be read, or its tables make no sense.
pub fn field_files(folder: &Path) -> Result<Vec<FieldFile>, Error> {
    if folder.join(names::MANIFEST).exists() { of_dataset(folder) } else { files_in(folder) }
}

/// The frames of a data set, which must all be whole; of a stack, its image with everything in focus.
fn of_dataset(path: &Path) -> Result<Vec<FieldFile>, Error> {
    let dataset = Dataset::open(path)?;
    let Dataset { folder, layout, .. } = &dataset;
    if !layout.has(Format::Folder) {
        let message =
            format!("the data set lies in files as {layout}; images and labels are read from the format `folder`");
        return Err(Error::folder(path, message));
    }
    let mut fields = Vec::new();
    for shard in recorded_shards(folder)? {
        let record = dataset.whole_or_flaw(shard, Check::Sizes)?.map_err(|flaw| {
            let message =
                format!("shard {shard} is not whole: {flaw}; `papsynth generate` with its recipe makes it again");
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
    match fields.is_empty() {
        true => Err(Error::folder(path, "the data set has no whole frame")),
        false => Ok(fields),
    }
}
