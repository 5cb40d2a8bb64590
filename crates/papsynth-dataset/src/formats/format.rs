//! The formats that a data set is written in.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::Error;

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
    #[must_use]
    pub fn is_sharded(self) -> bool {
        matches!(self, Self::Webdataset | Self::Huggingface)
    }

    /// Whether it has room for one object of a group a pixel.
    #[must_use]
    pub fn is_flat(self) -> bool {
        matches!(self, Self::Cellpose | Self::Stardist)
    }

    /// Whether it has all planes of a stack, rather than its picture with everything in focus alone.
    pub(crate) fn has_planes(self) -> bool {
        matches!(self, Self::Folder | Self::Webdataset | Self::OmeTiff | Self::OmeZarr | Self::Huggingface)
    }
}
