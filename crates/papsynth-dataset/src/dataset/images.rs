//! Frames of a data set read back: their images and their truth, whatever the format.

use std::sync::PoisonError;

use papsynth::truth::Truth;

use super::set::{Dataset, read_record, recorded_shards};
use crate::error::{Error, Problem};
use crate::files::Check;
use crate::formats::{Format, LIMITS, Take, TarFile, levels, names, parquet};
use crate::read::{self, LevelImage};
use crate::truth::FrameSummary;
#[cfg(feature = "zarr")]
use crate::{formats::read_planes, truth::Geometry};

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
        let mut formats = self.layout.formats.iter().copied();
        formats.find(|format| format.has_planes() && format.needs().is_none())
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
            let whole = whole(page, frame);
            take(0, whole.map_err(|problem| Error::Frame { index: frame.index, message: problem.to_string() })?);
            return Ok(());
        };
        let name = format.image(self.identity.seed, shard, frame);
        let failed = |what: String| Error::input(&self.folder.path(&name))(Problem::differs(what));
        let mut number = 0;
        pages(self, &name, frame, shard, &mut |page| {
            if number < due {
                take(number, whole(page, frame)?);
            }
            number += 1;
            Ok(())
        })?;
        if number == due { Ok(()) } else { Err(failed(format!("has {number} planes; the record says {due}"))) }
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
    let (image, all_in_focus) = dataset.images_of(frame, shard);
    let name = all_in_focus.unwrap_or(image);
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
        let read = files.try_for_each(|file| LevelImage::pages(&file, &LIMITS, take));
        return read.map_err(Error::input(&dataset.folder.path(name)));
    }
    #[cfg(feature = "zarr")]
    return read_planes(&dataset.folder, &Geometry::of_summary(frame, dataset.identity.seed), take);
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
        Some(flaw) => Err(Error::input(&dataset.folder.path(file))(Problem::differs(flaw))),
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
        return Err(Problem::differs(format!(
            "an image is {} x {} of {} channels; the record says {width} x {height} of {channels}",
            found[0], found[1], found[2]
        )));
    }
    Ok(levels(page, channels))
}
