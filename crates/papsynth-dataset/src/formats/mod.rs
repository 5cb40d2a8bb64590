//! The formats that a data set is written in: one file each.
//!
//! A format gets every plane as it arrives and, at the end of a frame, the [`Field`]: its picture and everything known of
//! it. What it wrote counts when the shard is recorded. All formats follow from the same truth, which every data set
//! keeps in `shards/`.

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

#[cfg(feature = "zarr")]
pub(crate) use format::HAS_PARQUET;
pub use format::{Format, Layout};
#[cfg(feature = "zarr")]
pub(crate) use ome_zarr::{channels, read_planes};
pub(crate) use sink::{Field, Files, Sink};
pub(crate) use webdataset::{Tar, TarFile, tar};
pub(crate) use written::{LIMITS, Take, Written, levels};

use papsynth::truth::Group;

use crate::error::Error;
use crate::truth::{FrameSummary, Split};
use sink::AtOnce;

impl Format {
    /// What writes a shard of it.
    pub(crate) fn sink<'a>(self, files: &Files<'a>) -> Result<Box<dyn Sink + 'a>, Error> {
        Ok(match self {
            Self::Folder => Box::new(folder::Frames::default()),
            Self::Webdataset => Box::new(webdataset::Shard::new(files)?),
            Self::OmeTiff => Box::new(ome::Images::default()),
            Self::Cellpose => Box::new(AtOnce(|field, files| flat::write(Self::Cellpose, field, files))),
            Self::Stardist => Box::new(AtOnce(|field, files| flat::write(Self::Stardist, field, files))),
            Self::YoloSeg => Box::new(AtOnce(yolo::write)),
            Self::Qupath => Box::new(AtOnce(qupath::write)),
            #[cfg(feature = "zarr")]
            Self::OmeZarr => Box::new(ome_zarr::Images::default()),
            #[cfg(not(feature = "zarr"))]
            Self::OmeZarr => return Err(self.missing(files.folder.root())),
            Self::Huggingface => parquet::sink(files)?,
        })
    }

    /// Whether the files of a frame hold what its truth says; in a tar file those of frames follow each other. Parquet is held by its hash alone.
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

    /// Where the image of a frame lies; of one in a tar file, the path goes on behind that file's name.
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
            Self::Huggingface => names::huggingface_image(seed, shard, frame, names::PICTURE),
        }
    }

    /// Where the picture of a stack with everything in focus lies, if the format has it beside the planes.
    pub(crate) fn all_in_focus(self, seed: u64, shard: u64, frame: &FrameSummary) -> Option<String> {
        match self {
            Self::Folder => Some(names::all_in_focus(frame.index)),
            Self::Webdataset => Some(webdataset::all_in_focus(shard, frame.index)),
            Self::Huggingface => Some(names::huggingface_image(seed, shard, frame, names::PICTURE)),
            _ => None,
        }
    }

    /// Files that it has once in a data set, frames of which fall into these splits by slide.
    pub(crate) fn shared(self, classes: &[String], splits: &[Split]) -> Result<Vec<(String, Vec<u8>)>, Error> {
        Ok(match self {
            Self::YoloSeg => vec![yolo::description(classes)],
            Self::Huggingface => vec![parquet::card(classes, splits)?],
            _ => Vec::new(),
        })
    }
}

impl Layout {
    /// Where the image of a frame lies and, of a stack, the one with everything in focus.
    pub(crate) fn images_of(&self, seed: u64, shard: u64, frame: &FrameSummary) -> (String, Option<String>) {
        let image = self.formats.first().expect("a layout has a format").image(seed, shard, frame);
        let mut sharp = self.formats.iter().filter_map(|format| format.all_in_focus(seed, shard, frame));
        (image, frame.is_stack().then(|| sharp.next()).flatten())
    }
}
