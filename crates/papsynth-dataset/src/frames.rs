//! One frame of a data set read back: its image and its truth, whatever the format.

use papsynth::truth::Truth;

use crate::dataset::{Dataset, read_record, recorded_shards};
use crate::error::{Error, Problem};
use crate::formats::Format;
use crate::image_of::{levels, pages, picture};
use crate::layout;
use crate::merge::document;
use crate::read::LevelImage;
use crate::record::FrameSummary;
use papsynth::white_level as white;

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
            let path = self.folder.path(&layout::record(place.shard));
            Error::input(&path)(Problem::Broken { format: "JSON", message })
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
            let whole = whole(page, frame).map_err(|what| Error::Frame { index: frame.index, message: what })?;
            take(0, whole);
            return Ok(());
        };
        let name = format.image(self.identity.seed, shard, frame);
        let failed = |what: String| Error::input(&self.folder.path(&name))(Problem::Differs { what });
        let mut number = 0;
        pages(self, &name, frame, |page| {
            if number < due {
                take(number, whole(page, frame).map_err(|what| Problem::Differs { what })?);
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
        let path = self.folder.path(&layout::coco(place.shard));
        document(&self.folder, place.shard)?.truth(place.index).map_err(Error::input(&path))
    }
}

impl FrameSummary {
    /// The largest level that the camera gives.
    #[must_use]
    pub fn white(&self) -> u16 {
        white(self.bits)
    }
}

/// The levels of a page that is as large as the record says, or what is wrong with it.
fn whole(page: LevelImage, frame: &FrameSummary) -> Result<Vec<u16>, String> {
    let FrameSummary { width, height, channels, .. } = *frame;
    let found = [page.width, page.height(), page.channels];
    if found[..2] != [width, height] || found[2] > channels {
        return Err(format!(
            "an image is {} x {} of {} channels; the record says {width} x {height} of {channels}",
            found[0], found[1], found[2]
        ));
    }
    Ok(levels(page, channels))
}
