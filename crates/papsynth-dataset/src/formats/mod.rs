//! The formats of a data set, each in a module.
//!
//! The writer of a format receives every plane when it is ready and, at the end of a frame, the [`Field`]: image and
//! ground truth. Its files are valid when the shard is recorded. All formats are derived from the COCO documents in
//! `shards/`, which every data set has.

mod depth;
mod flat;
mod folder;
mod format;
pub(crate) mod names;
mod ome;
#[cfg(feature = "zarr")]
mod ome_zarr;
#[cfg_attr(not(feature = "parquet"), path = "no_parquet.rs")]
pub(crate) mod parquet;
mod qupath;
mod sink;
mod webdataset;
mod written;
mod yolo;

pub(crate) use depth::{Depth, TRAINING_BITS, to_camera};
#[cfg(feature = "zarr")]
pub(crate) use format::HAS_PARQUET;
pub use format::{Extra, Format, Layout};
#[cfg(feature = "zarr")]
pub(crate) use ome_zarr::{channels, read_planes};
pub(crate) use sink::{Field, Files, Sink};
pub(crate) use webdataset::{Tar, TarFile, tar};
pub(crate) use written::{LIMITS, Take, Written, levels};

use papsynth::truth::Group;

use crate::error::Error;
use crate::truth::{FrameSummary, Split};
use sink::AtEnd;

impl Format {
    /// Returns the writer of a shard.
    pub(crate) fn sink<'a>(self, files: &Files<'a>) -> Result<Box<dyn Sink + 'a>, Error> {
        Ok(match self {
            Self::Folder => Box::new(folder::Frames::default()),
            Self::Webdataset => Box::new(webdataset::Shard::new(files)?),
            Self::OmeTiff => Box::new(ome::Images::default()),
            Self::Cellpose => Box::new(AtEnd(|field, files| flat::write(Self::Cellpose, field, files))),
            Self::Stardist => Box::new(AtEnd(|field, files| flat::write(Self::Stardist, field, files))),
            Self::YoloSeg => Box::new(AtEnd(yolo::write)),
            Self::Qupath => Box::new(AtEnd(qupath::write)),
            #[cfg(feature = "zarr")]
            Self::OmeZarr => Box::new(ome_zarr::Images::default()),
            #[cfg(not(feature = "zarr"))]
            Self::OmeZarr => return Err(self.missing(files.folder.root())),
            Self::Huggingface => parquet::sink(files)?,
        })
    }

    /// Checks the files of a frame against the ground truth. Frames of a tar file are read in order. Parquet files are
    /// checked only by their hash.
    pub(crate) fn check(self, written: &Written, tar: Option<&mut Tar>) -> Result<(), Error> {
        match self {
            Self::Folder => folder::check(written),
            Self::Webdataset => tar.map_or(Ok(()), |tar| webdataset::check(written, tar)),
            Self::OmeTiff => ome::check(written),
            Self::Cellpose | Self::Stardist => flat::check(self, written),
            Self::YoloSeg => yolo::check(written),
            Self::Qupath => qupath::check(written),
            #[cfg(feature = "zarr")]
            Self::OmeZarr => ome_zarr::check(written),
            #[cfg(not(feature = "zarr"))]
            Self::OmeZarr => Err(self.missing(written.folder.root())),
            Self::Huggingface => Ok(()),
        }
    }

    /// Returns the path of the image of a frame. Within a tar or Parquet file, the path starts with that of the file.
    pub(crate) fn image(self, seed: u64, shard: u64, frame: &FrameSummary) -> String {
        let index = frame.index;
        match self {
            Self::Folder => names::image(frame),
            Self::Webdataset => webdataset::image(shard, frame),
            Self::OmeTiff => ome::name(index),
            Self::Cellpose | Self::Stardist => {
                let [image, _] = flat::names(self, Group::Cytoplasm, index);
                image
            }
            Self::YoloSeg => yolo::image(Split::of_slide(seed, frame.slide), index),
            Self::Qupath => qupath::image(index),
            Self::OmeZarr => names::zarr_group(index),
            Self::Huggingface if frame.is_stack() => names::huggingface_image(seed, shard, frame, names::PLANES),
            Self::Huggingface => names::huggingface_image(seed, shard, frame, names::IMAGE),
        }
    }

    /// Returns the path of the all-in-focus image of a stack, if the format has it in addition to the planes.
    pub(crate) fn all_in_focus(self, seed: u64, shard: u64, frame: &FrameSummary) -> Option<String> {
        match self {
            Self::Folder => Some(names::all_in_focus(frame.index)),
            Self::Webdataset => Some(webdataset::all_in_focus(shard, frame.index)),
            Self::Huggingface => Some(names::huggingface_image(seed, shard, frame, names::IMAGE)),
            _ => None,
        }
    }

    /// Returns the files that the format has once in a data set. `splits` are the splits by slide that have frames.
    pub(crate) fn shared(self, classes: &[String], splits: &[Split]) -> Result<Vec<(String, Vec<u8>)>, Error> {
        Ok(match self {
            Self::YoloSeg => vec![yolo::description(classes, splits)],
            Self::Huggingface => vec![parquet::card(classes, splits)?],
            _ => Vec::new(),
        })
    }
}

impl Layout {
    /// Returns the path of the image of a frame and, of a stack, that of the all-in-focus image.
    pub(crate) fn images_of(&self, seed: u64, shard: u64, frame: &FrameSummary) -> (String, Option<String>) {
        let image = self.formats.first().expect("a layout has a format").image(seed, shard, frame);
        let mut sharp = self.formats.iter().filter_map(|format| format.all_in_focus(seed, shard, frame));
        (image, frame.is_stack().then(|| sharp.next()).flatten())
    }

    /// Returns a format with the images of frames, or with all planes of stacks; one with the bit depth of the camera
    /// if there is one.
    pub(crate) fn best_format(&self, with_planes: bool) -> Option<Format> {
        let formats = self.formats.iter().copied().filter(|format| !with_planes || format.has_planes());
        formats.min_by_key(|format| (format.needs().is_some(), format.depth()))
    }

    /// Returns the path of the all-in-focus image of a stack, and its format. Formats with the bit depth of the camera
    /// are preferred.
    pub(crate) fn edf_image(&self, seed: u64, shard: u64, frame: &FrameSummary) -> Option<(String, Format)> {
        let images = self.formats.iter().filter_map(|format| match format.has_planes() {
            true => Some((format.all_in_focus(seed, shard, frame)?, *format)),
            false => Some((format.image(seed, shard, frame), *format)),
        });
        images.min_by_key(|(_, format)| format.depth())
    }
}
