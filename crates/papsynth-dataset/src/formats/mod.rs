//! The formats that a data set is written in: one file each.
//!
//! A format gets every plane as it arrives and, at the end of a frame, the [`Field`]: its picture and everything known of
//! it. What it wrote counts when the shard is recorded. All formats follow from the same truth, which every data set
//! keeps in `shards/`.

mod cellpose;
mod flat;
mod folder;
pub(crate) mod huggingface;
mod ome_tiff;
#[cfg(feature = "zarr")]
mod ome_zarr;
pub(crate) mod qupath;
mod stardist;
mod webdataset;
mod written;
mod yolo;

#[cfg(feature = "zarr")]
pub(crate) use ome_zarr::read_planes;
pub(crate) use webdataset::{Tar, tar};
pub(crate) use written::Written;

use std::cell::OnceCell;
use std::io;
use std::path::Path;

use papsynth::Plane;
use papsynth::truth::{Group, Truth};
use serde::{Deserialize, Serialize};

use crate::coco::Document;
use crate::error::Error;
use crate::files::Folder;
use crate::layout::{self, Form, Layout};
use crate::parquet;
use crate::record::{FileRecord, FrameSummary, Geometry};
use crate::splits::Split;
use crate::write;

/// A way to write images and their truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// PNG and TIFF files in folders, label images, noise-free images.
    Folder,
    /// Tar files of many frames for streaming readers.
    Webdataset,
    /// OME-TIFF images with their labels as further files.
    OmeTiff,
    /// Images beside `_masks` of one label a pixel.
    Cellpose,
    /// `images` and `masks` of one label a pixel.
    Stardist,
    /// Polygons for detectors that segment.
    YoloSeg,
    /// GeoJSON, nuclei within cells, beside OME-TIFF images.
    Qupath,
    /// OME-Zarr groups with their labels; of builds with the feature `zarr`.
    OmeZarr,
    /// Parquet files of many frames, as the library `datasets` reads them; of builds with the feature `parquet`.
    Huggingface,
}

impl Format {
    /// All formats, also those that this build cannot write ([`needs`](Self::needs)).
    pub const ALL: [Self; 9] = [
        Self::Folder,
        Self::Webdataset,
        Self::OmeTiff,
        Self::Cellpose,
        Self::Stardist,
        Self::YoloSeg,
        Self::Qupath,
        Self::OmeZarr,
        Self::Huggingface,
    ];

    /// The formats that this build writes and reads.
    pub fn built() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|format| format.needs().is_none())
    }

    /// The feature that a build must have to write and read it, if this one has it not.
    #[must_use]
    pub fn needs(self) -> Option<&'static str> {
        match self {
            Self::OmeZarr if !cfg!(feature = "zarr") => Some("zarr"),
            Self::Huggingface if !parquet::IS_HERE => Some("parquet"),
            _ => None,
        }
    }

    /// How it is called where it is missing.
    pub(crate) fn title(self) -> String {
        format!("the format `{}`", self.name())
    }

    /// What to say of a data set where a format is missing.
    #[cfg_attr(all(feature = "zarr", feature = "parquet"), expect(dead_code, reason = "no format is missing"))]
    pub(crate) fn missing(self, path: &Path) -> Error {
        missing(&self.title(), self.needs().unwrap_or_default(), path)
    }

    /// Its name, which is also that of its folder in a data set (but for [`Folder`](Self::Folder), whose folders lie at the top).
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Folder => "folder",
            Self::Webdataset => "webdataset",
            Self::OmeTiff => "ome-tiff",
            Self::Cellpose => "cellpose",
            Self::Stardist => "stardist",
            Self::YoloSeg => "yolo-seg",
            Self::Qupath => "qupath",
            Self::OmeZarr => "ome-zarr",
            Self::Huggingface => "huggingface",
        }
    }

    /// What it is, in a line.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Folder => "PNG images (stacks: OME-TIFF), noise-free images, label TIFFs in folders",
            Self::Webdataset => "tar shards for streaming: image and truth of each frame",
            Self::OmeTiff => "OME-TIFF, pyramidal where large, with label layers that never overlap",
            Self::Cellpose => "images beside _masks, for cytoplasm and for nuclei",
            Self::Stardist => "images/ and masks/, for cytoplasm and for nuclei",
            Self::YoloSeg => "images/ and labels/ by split, with polygons, and data.yaml",
            Self::Qupath => "GeoJSON with nuclei within cells, beside OME-TIFF images",
            Self::OmeZarr => "OME-Zarr 0.5, pyramidal where large, with label layers that never overlap",
            Self::Huggingface => "Parquet shards by split for `datasets`: images, objects with masks",
        }
    }

    /// Whether it keeps many frames in a file.
    #[must_use]
    pub fn is_sharded(self) -> bool {
        matches!(self, Self::Webdataset | Self::Huggingface)
    }

    /// Whether it has room for one object of a group a pixel.
    #[must_use]
    pub fn is_flat(self) -> bool {
        matches!(self, Self::Cellpose | Self::Stardist)
    }

    /// What writes a shard of it.
    pub(crate) fn sink(self, place: Place<'_>) -> Result<Box<dyn Sink + '_>, Error> {
        Ok(match self {
            Self::Folder => Box::new(folder::Frames::new(place)),
            Self::Webdataset => Box::new(webdataset::Shard::new(place)?),
            Self::OmeTiff => Box::new(ome_tiff::Images::new(place)),
            Self::Cellpose => Box::new(cellpose::Pairs::new(place)),
            Self::Stardist => Box::new(stardist::Pairs::new(place)),
            Self::YoloSeg => Box::new(yolo::Polygons::new(place)),
            Self::Qupath => Box::new(qupath::Objects::new(place)),
            #[cfg(feature = "zarr")]
            Self::OmeZarr => Box::new(ome_zarr::Images::new(place)),
            #[cfg(not(feature = "zarr"))]
            Self::OmeZarr => return Err(self.missing(place.folder.root())),
            Self::Huggingface => parquet::sink(place)?,
        })
    }

    /// Whether the files of a frame hold what its truth says; in files of many frames they follow each other.
    pub(crate) fn check(self, written: &Written, shards: &mut Shards<'_>) -> Result<(), Error> {
        match self {
            Self::Folder => folder::check(written),
            Self::Webdataset => shards.tar.as_mut().map_or(Ok(()), |tar| webdataset::check(written, tar)),
            Self::OmeTiff => ome_tiff::check(written),
            Self::Cellpose => cellpose::check(written),
            Self::Stardist => stardist::check(written),
            Self::YoloSeg => yolo::check(written),
            Self::Qupath => qupath::check(written),
            #[cfg(feature = "zarr")]
            Self::OmeZarr => ome_zarr::check(written),
            #[cfg(not(feature = "zarr"))]
            Self::OmeZarr => Err(self.missing(written.folder.root())),
            Self::Huggingface => shards.frames.as_mut().map_or(Ok(()), |frames| frames.check(written)),
        }
    }

    /// Where the image of a frame lies; of one in a tar file, the path goes on behind that file's name.
    pub(crate) fn image(self, seed: u64, shard: u64, frame: &FrameSummary) -> String {
        let (index, form) = (frame.index, Form::of(frame.planes_um.len()));
        match self {
            Self::Folder => layout::image(index, form),
            Self::Webdataset => webdataset::image(shard, index, form),
            Self::OmeTiff => ome_tiff::image(index),
            Self::Cellpose => cellpose::image(Group::Cytoplasm, index),
            Self::Stardist => stardist::image(Group::Cytoplasm, index),
            Self::YoloSeg => yolo::image(Split::of_slide(seed, frame.slide), index),
            Self::Qupath => qupath::image(index),
            Self::OmeZarr => zarr_group(index),
            Self::Huggingface => huggingface::image(seed, shard, frame, form),
        }
    }

    /// Where the picture of a stack with everything in focus lies, if the format has it beside the planes.
    pub(crate) fn all_in_focus(self, seed: u64, shard: u64, frame: &FrameSummary) -> Option<String> {
        match self {
            Self::Folder => Some(layout::all_in_focus(frame.index)),
            Self::Webdataset => Some(webdataset::all_in_focus(shard, frame.index)),
            Self::Huggingface => Some(huggingface::image(seed, shard, frame, Form::Single)),
            _ => None,
        }
    }

    /// Whether it has all planes of a stack, rather than its picture with everything in focus alone.
    pub(crate) fn has_planes(self) -> bool {
        matches!(self, Self::Folder | Self::Webdataset | Self::OmeTiff | Self::OmeZarr | Self::Huggingface)
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

/// What to say of a data set that has something which this build misses for want of a feature.
pub(crate) fn missing(what: &str, feature: &str, path: &Path) -> Error {
    let message = format!("{what} needs a build of papsynth with `--features {feature}`");
    Error::Folder { path: path.to_owned(), message }
}

/// Files of many frames that are read again, frame by frame.
pub(crate) struct Shards<'a> {
    pub(crate) tar: Option<Tar<'a>>,
    pub(crate) frames: Option<parquet::Frames>,
}

/// The folder of a frame that is a group of Zarr.
pub(crate) fn zarr_group(index: u64) -> String {
    format!("ome-zarr/{index:06}{ZARR_GROUP}")
}

/// How the name of such a folder ends.
pub(crate) const ZARR_GROUP: &str = ".ome.zarr";

/// Where a shard is written, and how.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place<'a> {
    pub(crate) folder: &'a Folder,
    pub(crate) layout: &'a Layout,
    pub(crate) shard: u64,
}

/// Writes the frames of a shard, one after the other.
pub(crate) trait Sink {
    /// A frame begins.
    fn begin(&mut self, _: &Geometry) -> Result<(), Error> {
        Ok(())
    }

    /// The next plane of the frame.
    fn plane(&mut self, _: &Plane, _: &Geometry) -> Result<(), Error> {
        Ok(())
    }

    /// The frame is complete.
    fn field(&mut self, field: &Field) -> Result<(), Error>;

    /// No further frame follows: the files of the shard get their names.
    fn close(self: Box<Self>) -> Result<Vec<FileRecord>, Error>;
}

/// A frame of which everything is known.
#[derive(Debug)]
pub(crate) struct Field<'a> {
    pub(crate) geometry: &'a Geometry,
    pub(crate) summary: &'a FrameSummary,
    pub(crate) truth: &'a Truth,
    /// The truth as COCO.
    pub(crate) document: &'a Document,
    /// Grey levels of the image or, of a stack, with every object in focus.
    pub(crate) picture: &'a [u16],
    png: OnceCell<Vec<u8>>,
}

impl<'a> Field<'a> {
    pub(crate) fn new(
        geometry: &'a Geometry,
        summary: &'a FrameSummary,
        truth: &'a Truth,
        document: &'a Document,
        picture: &'a [u16],
    ) -> Self {
        Self { geometry, summary, truth, document, picture, png: OnceCell::new() }
    }

    pub(crate) fn index(&self) -> u64 {
        self.geometry.key.index
    }

    /// The picture as PNG, made once for all formats.
    pub(crate) fn png(&self) -> io::Result<&[u8]> {
        if let Some(png) = self.png.get() {
            return Ok(png);
        }
        let Geometry { view, bits, channels, .. } = self.geometry;
        let png = write::png(self.picture, view.width, *channels, *bits, view.pixel_um)?;
        Ok(self.png.get_or_init(|| png))
    }
}

/// Files of a shard as they are written.
#[derive(Debug)]
pub(crate) struct Files<'a> {
    pub(crate) folder: &'a Folder,
    pub(crate) written: Vec<FileRecord>,
}

impl<'a> Files<'a> {
    pub(crate) fn new(folder: &'a Folder) -> Self {
        Self { folder, written: Vec::new() }
    }

    pub(crate) fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        self.written.push(self.folder.write(name, bytes)?);
        Ok(())
    }

    /// Encodes and writes a file.
    pub(crate) fn encode(&mut self, name: &str, encoded: io::Result<Vec<u8>>) -> Result<(), Error> {
        let bytes = encoded.map_err(Error::io("encode", &self.folder.path(name)))?;
        self.write(name, &bytes)
    }

    /// Writes the picture of a frame as PNG.
    pub(crate) fn png(&mut self, name: &str, field: &Field) -> Result<(), Error> {
        let bytes = field.png().map_err(Error::io("encode", &self.folder.path(name)))?;
        self.write(name, bytes)
    }
}
