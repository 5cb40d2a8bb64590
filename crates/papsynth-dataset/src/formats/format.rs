//! The formats that a data set is written in, and how it lies in files.

use std::fmt::{self, Formatter};
use std::ops::Range;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Problem};
use crate::truth::Flatten;

/// Whether this build writes Parquet.
pub(crate) const HAS_PARQUET: bool = cfg!(feature = "parquet");

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
            Self::Huggingface if !HAS_PARQUET => Some("parquet"),
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
        Error::missing_feature(&self.title(), self.needs().unwrap_or_default(), path)
    }

    /// Its name, which is also that of its folder in a data set (but for [`Folder`](Self::Folder), whose folders lie at the top).
    #[must_use]
    pub fn name(self) -> &'static str {
        self.words().0
    }

    /// What it is, in a line.
    #[must_use]
    pub fn about(self) -> &'static str {
        self.words().1
    }

    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Folder => ("folder", "PNG images (stacks: OME-TIFF), noise-free images, label TIFFs in folders"),
            Self::Webdataset => ("webdataset", "tar shards for streaming: image and truth of each frame"),
            Self::OmeTiff => ("ome-tiff", "OME-TIFF, pyramidal where large, with label layers that never overlap"),
            Self::Cellpose => ("cellpose", "images beside _masks, for cytoplasm and for nuclei"),
            Self::Stardist => ("stardist", "images/ and masks/, for cytoplasm and for nuclei"),
            Self::YoloSeg => ("yolo-seg", "images/ and labels/ by split, with polygons, and data.yaml"),
            Self::Qupath => ("qupath", "GeoJSON with nuclei within cells, beside OME-TIFF images"),
            Self::OmeZarr => ("ome-zarr", "OME-Zarr 0.5, pyramidal where large, with label layers that never overlap"),
            Self::Huggingface => ("huggingface", "Parquet shards by split for `datasets`: images, objects with masks"),
        }
    }

    /// Whether it keeps many frames in a file.
    pub(crate) fn is_sharded(self) -> bool {
        matches!(self, Self::Webdataset | Self::Huggingface)
    }

    /// Whether it has room for one object of a group a pixel.
    pub(crate) fn is_flat(self) -> bool {
        matches!(self, Self::Cellpose | Self::Stardist)
    }

    /// Whether it has all planes of a stack, rather than its picture with everything in focus alone.
    pub(crate) fn has_planes(self) -> bool {
        matches!(self, Self::Folder | Self::Webdataset | Self::OmeTiff | Self::OmeZarr | Self::Huggingface)
    }
}

/// Most frames of a shard.
const MOST_FRAMES_PER_SHARD: u64 = 1_000_000_000;

/// How a data set lies in files: decided when it is begun, and kept in its manifest.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layout {
    /// The formats it is written in, in the order of [`Format::ALL`], each once; at least one.
    pub formats: Vec<Format>,
    /// Frames that are written, made again and recorded together, at least 1: shard *n* holds those with an index from
    /// *n* times this number on.
    pub frames_per_shard: u64,
    /// What pixels show that belong to several objects, in formats that have one label a pixel.
    pub flatten: Flatten,
    /// Whether the table of objects is also written as Parquet, with masks; wants the feature `parquet`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub objects_parquet: bool,
    /// Whether the scene of every frame is written, as JSON.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub scenes: bool,
}

impl Default for Layout {
    fn default() -> Self {
        Self::new([Format::Folder])
    }
}

impl Layout {
    /// Frames of a shard of formats that keep many in a file: some hundred megabytes.
    pub const FRAMES_PER_SHARD: u64 = 256;

    /// The usual layout of these formats: with the feature `parquet` objects are also written as Parquet.
    #[must_use]
    pub fn new(formats: impl IntoIterator<Item = Format>) -> Self {
        let mut formats: Vec<Format> = formats.into_iter().collect();
        formats.sort_unstable();
        formats.dedup();
        let many = formats.iter().any(|format| format.is_sharded());
        let frames_per_shard = if many { Self::FRAMES_PER_SHARD } else { 1 };
        Self { formats, frames_per_shard, flatten: Flatten::Top, objects_parquet: HAS_PARQUET, scenes: false }
    }

    /// Why a range of frames cannot be made, if it cannot: it begins within a shard.
    #[must_use]
    pub fn refusal_of(&self, frames: &Range<u64>) -> Option<String> {
        let each = self.frames_per_shard;
        (!frames.is_empty() && !frames.start.is_multiple_of(each)).then(|| {
            format!(
                "frames {}..{} begin within a shard; with {each} frames a shard a range begins at a multiple of {each}",
                frames.start, frames.end
            )
        })
    }

    /// A layout that was read is one that can be written.
    pub(crate) fn check(&self) -> Result<(), Problem> {
        let message = match self.frames_per_shard {
            1..=MOST_FRAMES_PER_SHARD if self.formats.is_empty() => "the layout names no format".to_owned(),
            1..=MOST_FRAMES_PER_SHARD if !self.formats.is_sorted_by(|a, b| a < b) => {
                "the formats of the layout are not in order, each once".to_owned()
            }
            1..=MOST_FRAMES_PER_SHARD => return Ok(()),
            frames => format!("frames_per_shard is {frames}; expected 1 to {MOST_FRAMES_PER_SHARD}"),
        };
        Err(Problem::broken("JSON", message))
    }

    /// Whether every frame is a shard of its own.
    pub(crate) fn is_by_frame(&self) -> bool {
        self.frames_per_shard == 1
    }

    /// The feature without which this build cannot write it, and what wants it.
    pub(crate) fn needs(&self) -> Option<(&'static str, String)> {
        let format = self.formats.iter().find_map(|format| Some((format.needs()?, format.title())));
        let table =
            (self.objects_parquet && !HAS_PARQUET).then(|| ("parquet", "the table of objects as Parquet".to_owned()));
        format.or(table)
    }

    /// Whether a format is among the data set's.
    #[must_use]
    pub fn has(&self, format: Format) -> bool {
        self.formats.contains(&format)
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.formats.iter().map(|format| format.name()).collect();
        let table = if self.objects_parquet { ", objects also as Parquet" } else { "" };
        let scenes = if self.scenes { ", with scenes" } else { "" };
        write!(f, "{} with {} a shard, {}{table}{scenes}", names.join(","), self.frames_per_shard, self.flatten.name())
    }
}
