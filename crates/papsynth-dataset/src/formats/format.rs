//! The formats of a data set, and its layout in files.

use std::fmt::{self, Formatter};
use std::ops::Range;
use std::path::Path;

use papsynth::truth::MIN_DETECTABILITY;
use serde::{Deserialize, Serialize};

use super::depth::Depth;
use crate::error::{Error, InputError};
use crate::truth::Flatten;

/// Whether this build writes Parquet.
pub(crate) const HAS_PARQUET: bool = cfg!(feature = "parquet");

/// A file format for images with ground truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// PNG and TIFF files in folders: images, label images, noise-free images.
    Folder,
    /// Tar files of many frames for streaming readers. Images have 8 bits.
    Webdataset,
    /// OME-TIFF images, with labels in separate files.
    OmeTiff,
    /// Images of 8 bits, and `_masks` with one label per pixel.
    Cellpose,
    /// `images` of 8 bits, and `masks` with one label per pixel.
    Stardist,
    /// Images of 8 bits, and polygons.
    YoloSeg,
    /// OME-TIFF images, and GeoJSON with nuclei within cells.
    Qupath,
    /// OME-Zarr groups with labels. Needs the feature `zarr`.
    OmeZarr,
    /// Parquet files of many frames for the library `datasets`. Images have 8 bits. Needs the feature `parquet`.
    Huggingface,
}

impl Format {
    /// All formats, including those that this build cannot write ([`needs`](Self::needs)).
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

    /// Returns the formats that this build writes and reads.
    pub fn built() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|format| format.needs().is_none())
    }

    /// Returns the feature that the format needs, if this build does not have it.
    #[must_use]
    pub fn needs(self) -> Option<&'static str> {
        match self {
            Self::OmeZarr if !cfg!(feature = "zarr") => Some("zarr"),
            Self::Huggingface if !HAS_PARQUET => Some("parquet"),
            _ => None,
        }
    }

    /// Returns the name of the format for error messages.
    pub(crate) fn title(self) -> String {
        format!("the format `{}`", self.name())
    }

    /// Returns the error for a data set with a format that this build does not have.
    #[cfg_attr(all(feature = "zarr", feature = "parquet"), expect(dead_code, reason = "no format is missing"))]
    pub(crate) fn missing(self, path: &Path) -> Error {
        Error::missing_feature(&self.title(), self.needs().unwrap_or_default(), path)
    }

    /// Returns the name of the format. It is also the name of its folder in a data set, except that the folders of
    /// [`Folder`](Self::Folder) are at the top.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.description().0
    }

    /// Returns a one-line description.
    #[must_use]
    pub fn about(self) -> &'static str {
        self.description().1
    }

    fn description(self) -> (&'static str, &'static str) {
        match self {
            Self::Folder => ("folder", "PNG images (stacks: OME-TIFF), noise-free images and label TIFFs in folders"),
            Self::Webdataset => ("webdataset", "tar shards for streaming: 8-bit image and ground truth of each frame"),
            Self::OmeTiff => ("ome-tiff", "OME-TIFF (large images: pyramids), with label images without overlap"),
            Self::Cellpose => ("cellpose", "8-bit images and _masks, for cytoplasm and for nuclei"),
            Self::Stardist => ("stardist", "8-bit images/ and masks/, for cytoplasm and for nuclei"),
            Self::YoloSeg => ("yolo-seg", "8-bit images/ and labels/ (polygons) by split, and data.yaml"),
            Self::Qupath => ("qupath", "OME-TIFF images, and GeoJSON with nuclei within cells"),
            Self::OmeZarr => ("ome-zarr", "OME-Zarr 0.5 (large images: pyramids), with label images without overlap"),
            Self::Huggingface => {
                ("huggingface", "Parquet shards by split for `datasets`: 8-bit images, objects with masks")
            }
        }
    }

    /// Bit depth of the images.
    pub(crate) fn depth(self) -> Depth {
        match self {
            Self::Folder | Self::OmeTiff | Self::Qupath | Self::OmeZarr => Depth::Camera,
            Self::Webdataset | Self::Cellpose | Self::Stardist | Self::YoloSeg | Self::Huggingface => Depth::Training,
        }
    }

    /// Whether a file has many frames.
    pub(crate) fn is_sharded(self) -> bool {
        matches!(self, Self::Webdataset | Self::Huggingface)
    }

    /// Whether label images have one label per pixel.
    pub(crate) fn is_flat(self) -> bool {
        matches!(self, Self::Cellpose | Self::Stardist)
    }

    /// Whether a stack is written with all planes, not only as the all-in-focus image.
    pub(crate) fn has_planes(self) -> bool {
        matches!(self, Self::Folder | Self::Webdataset | Self::OmeTiff | Self::OmeZarr | Self::Huggingface)
    }
}

/// Files that a data set can be written without ([`Layout::without`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Extra {
    /// Images without noise, of the format [`Folder`](Format::Folder).
    NoiseFree,
    /// Numbers of overlapping cytoplasms, of the format [`Folder`](Format::Folder).
    Layers,
    /// Label images of cytoplasm, nuclei and debris, of the format [`Folder`](Format::Folder).
    Labels,
    /// Semantic label images, of the format [`Folder`](Format::Folder).
    Semantic,
    /// Images of 8 bits for cameras with more bits, of the format [`Folder`](Format::Folder).
    Preview,
    /// The contact sheet.
    ContactSheet,
}

impl Extra {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::NoiseFree, Self::Layers, Self::Labels, Self::Semantic, Self::Preview, Self::ContactSheet];

    /// Returns the name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NoiseFree => "noise-free",
            Self::Layers => "layers",
            Self::Labels => "labels",
            Self::Semantic => "semantic",
            Self::Preview => "preview",
            Self::ContactSheet => "contact-sheet",
        }
    }

    /// Returns a one-line description.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::NoiseFree => "images without noise, of the format folder: 5/6 of its bytes",
            Self::Layers => "numbers of overlapping cytoplasms, of the format folder",
            Self::Labels => "label images of cytoplasm, nuclei and debris, of the format folder",
            Self::Semantic => "semantic label images, of the format folder",
            Self::Preview => "images of 8 bits for cameras with more bits, of the format folder",
            Self::ContactSheet => "contact-sheet.png",
        }
    }

    /// Whether the files are part of a format.
    fn is_of(self, format: Format) -> bool {
        self == Self::ContactSheet || format == Format::Folder
    }

    /// Whether a format cannot be written without files of this kind.
    fn is_needed_by(self, format: Format) -> bool {
        use Format::{Cellpose, OmeTiff, OmeZarr, Stardist, Webdataset};
        self == Self::Labels && [Cellpose, OmeTiff, OmeZarr, Stardist, Webdataset].contains(&format)
    }
}

/// Largest number of frames of a shard.
const MOST_FRAMES_PER_SHARD: u64 = 1_000_000_000;

/// The layout of a data set in files. It is fixed when the data set is created, and is recorded in the manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layout {
    /// The formats, in the order of [`Format::ALL`], without duplicates; at least one.
    pub formats: Vec<Format>,
    /// Number of frames of a shard, at least 1. Frames of a shard are written and recorded together. The first frame of
    /// shard *n* has the index *n* times this number.
    pub frames_per_shard: u64,
    /// Which label a pixel gets where objects overlap, in formats with one label per pixel.
    pub flatten: Flatten,
    /// Whether the table of objects is also written as Parquet, with masks. Needs the feature `parquet`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub objects_parquet: bool,
    /// Whether the scene of every frame is written, as JSON.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub scenes: bool,
    /// The files that are left out, in the order of [`Extra::ALL`], without duplicates.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<Extra>,
    /// Nuclei and mimics of nuclei whose best detectability is below this number are ignored: 255 in semantic label
    /// images, `iscrowd` 1 in COCO. Finite and at least 0; at 0, no object is ignored.
    #[serde(default = "min_detectability", skip_serializing_if = "is_default")]
    pub min_detectability: f64,
}

fn min_detectability() -> f64 {
    MIN_DETECTABILITY
}

/// Whether a minimum of the detectability is the default.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_default(min_detectability: &f64) -> bool {
    min_detectability.total_cmp(&MIN_DETECTABILITY).is_eq()
}

impl Default for Layout {
    fn default() -> Self {
        Self::new([Format::Folder])
    }
}

impl Layout {
    /// Default number of frames of a shard for formats with many frames in a file: some hundred megabytes.
    pub const FRAMES_PER_SHARD: u64 = 256;

    /// Returns the default layout of these formats. With the feature `parquet`, objects are also written as Parquet.
    #[must_use]
    pub fn new(formats: impl IntoIterator<Item = Format>) -> Self {
        let mut formats: Vec<Format> = formats.into_iter().collect();
        formats.sort_unstable();
        formats.dedup();
        let many = formats.iter().any(|format| format.is_sharded());
        let frames_per_shard = if many { Self::FRAMES_PER_SHARD } else { 1 };
        Self {
            formats,
            frames_per_shard,
            flatten: Flatten::Top,
            objects_parquet: HAS_PARQUET,
            scenes: false,
            without: Vec::new(),
            min_detectability: MIN_DETECTABILITY,
        }
    }

    /// Returns the layout without these files.
    #[must_use]
    pub fn without(mut self, extras: impl IntoIterator<Item = Extra>) -> Self {
        self.without.extend(extras);
        self.without.sort_unstable();
        self.without.dedup();
        self
    }

    /// Whether data sets of this layout have these files.
    #[must_use]
    pub fn has_extra(&self, extra: Extra) -> bool {
        !self.without.contains(&extra) && self.formats.iter().any(|format| extra.is_of(*format))
    }

    /// Returns an error message if the layout is without files that one of its formats needs, or that none of its
    /// formats has, or if the minimum of the detectability is out of range.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        let least = self.min_detectability;
        if !(least.is_finite() && least >= 0.0) {
            return Some(format!("min_detectability: {least} is out of range: expected a finite number of at least 0"));
        }
        self.without.iter().find_map(|&extra| {
            let name = extra.name();
            if let Some(format) = self.formats.iter().find(|format| extra.is_needed_by(**format)) {
                return Some(format!("`{name}` cannot be left out: {} needs label images", format.title()));
            }
            let is_there = self.formats.iter().any(|format| extra.is_of(*format));
            let formats = self.formats.iter().map(|format| format.name()).collect::<Vec<_>>().join(", ");
            (!is_there).then(|| {
                format!("`{name}` cannot be left out: {formats} does not contain it; only the format `folder` does")
            })
        })
    }

    /// Returns an error message if a range of frames does not begin at the start of a shard.
    #[must_use]
    pub fn refusal_of(&self, frames: &Range<u64>) -> Option<String> {
        let each = self.frames_per_shard;
        (!frames.is_empty() && !frames.start.is_multiple_of(each)).then(|| {
            format!(
                "frames {}..{} begin within a shard of {each} frames; expected a start that is a multiple of {each}; \
                 or use --format folder, or --frames-per-shard 1, for all frames of the data set",
                frames.start, frames.end
            )
        })
    }

    /// Returns the first option of `papsynth generate` in which the layout of a data set differs from `given`, and the
    /// remedy.
    pub(crate) fn difference(&self, given: &Self) -> Option<(String, &'static str)> {
        if self.objects_parquet && !HAS_PARQUET {
            let message = "was written with objects also as Parquet".to_owned();
            return Some((message, "use a build of papsynth with `--features parquet`"));
        }
        let list = |names: Vec<&str>| (!names.is_empty()).then(|| names.join(","));
        let options = |layout: &Self| {
            [
                ("--format", list(layout.formats.iter().map(|format| format.name()).collect())),
                ("--frames-per-shard", Some(layout.frames_per_shard.to_string())),
                ("--flatten", Some(layout.flatten.name().to_owned())),
                ("--min-detectability", Some(layout.min_detectability.to_string())),
                ("--without", list(layout.without.iter().map(|extra| extra.name()).collect())),
                ("--scenes", layout.scenes.then(String::new)),
                ("--no-parquet", (!layout.objects_parquet).then(String::new)),
            ]
        };
        let pairs = options(self).into_iter().zip(options(given));
        pairs.into_iter().find_map(|((name, existing), (_, given))| match (existing, given) {
            (existing, given) if existing == given => None,
            (Some(existing), Some(given)) => {
                Some((format!("was written with {name} {existing}, not {given}"), "use the original value"))
            }
            (Some(existing), None) => {
                Some((format!("was written with {}", format!("{name} {existing}").trim_end()), "add this option"))
            }
            (None, _) => Some((format!("was written without {name}"), "leave it out")),
        })
    }

    /// Checks a layout that was read from a file.
    pub(crate) fn check(&self) -> Result<(), InputError> {
        let message = match self.frames_per_shard {
            1..=MOST_FRAMES_PER_SHARD if self.formats.is_empty() => "the layout has no format".to_owned(),
            1..=MOST_FRAMES_PER_SHARD if !self.formats.is_sorted_by(|a, b| a < b) => {
                "the formats of the layout are not sorted, or have duplicates".to_owned()
            }
            1..=MOST_FRAMES_PER_SHARD if !self.without.is_sorted_by(|a, b| a < b) => {
                "the list `without` of the layout is not sorted, or has duplicates".to_owned()
            }
            1..=MOST_FRAMES_PER_SHARD => match self.refusal() {
                Some(message) => message,
                None => return Ok(()),
            },
            frames => format!("frames_per_shard is {frames}; expected 1 to {MOST_FRAMES_PER_SHARD}"),
        };
        Err(InputError::broken("JSON", message))
    }

    /// Whether each shard has one frame.
    pub(crate) fn is_by_frame(&self) -> bool {
        self.frames_per_shard == 1
    }

    /// Returns the feature that the layout needs and this build does not have, and the part of the layout that needs
    /// it.
    pub(crate) fn needs(&self) -> Option<(&'static str, String)> {
        let format = self.formats.iter().find_map(|format| Some((format.needs()?, format.title())));
        let table =
            (self.objects_parquet && !HAS_PARQUET).then(|| ("parquet", "the table of objects as Parquet".to_owned()));
        format.or(table)
    }

    /// Returns the names of the files that are left out, after "without".
    pub(crate) fn left_out(&self) -> String {
        let names: Vec<&str> = self.without.iter().map(|extra| extra.name()).collect();
        format!("without {}", names.join(", "))
    }

    /// Whether the data set has a format.
    #[must_use]
    pub fn has(&self, format: Format) -> bool {
        self.formats.contains(&format)
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.formats.iter().map(|format| format.name()).collect();
        let table = if self.objects_parquet { ", objects also as Parquet" } else { "" };
        let frames = if self.frames_per_shard == 1 { "frame" } else { "frames" };
        let scenes = if self.scenes { ", with scenes" } else { "" };
        let without = if self.without.is_empty() { String::new() } else { format!(", {}", self.left_out()) };
        let least = if is_default(&self.min_detectability) {
            String::new()
        } else {
            format!(", minimum detectability {}", self.min_detectability)
        };
        write!(
            f,
            "{} with {} {} per shard, {}{table}{scenes}{without}{least}",
            names.join(","),
            self.frames_per_shard,
            frames,
            self.flatten.name()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_a_format_needs_or_no_format_has_cannot_be_left_out() {
        use Extra::{ContactSheet, Labels, Layers, NoiseFree, Preview, Semantic};
        let layout = |formats: &[Format], without: &[Extra]| {
            Layout::new(formats.iter().copied()).without(without.iter().copied())
        };
        let all = layout(&[Format::Folder], &[ContactSheet, Layers, NoiseFree, Labels, Semantic, Preview, Layers]);
        assert_eq!(all.without, Extra::ALL);
        assert!(all.check().is_ok() && Extra::ALL.iter().all(|extra| !all.has_extra(*extra)));
        assert!(layout(&[Format::Folder, Format::Cellpose], &[NoiseFree, Layers]).refusal().is_none());
        assert!(layout(&[Format::Cellpose], &[ContactSheet]).refusal().is_none());
        for (formats, without, expected) in [
            (&[Format::Folder, Format::Stardist][..], Labels, "the format `stardist` needs label images"),
            (&[Format::Cellpose], NoiseFree, "only the format `folder` does"),
            (&[Format::YoloSeg], Labels, "yolo-seg does not contain it"),
        ] {
            let layout = layout(formats, &[without]);
            let message = layout.refusal().unwrap();
            assert!(message.contains(expected) && message.contains(without.name()), "{message}");
            assert!(layout.check().is_err());
        }
    }

    #[test]
    fn the_first_option_that_differs_is_named() {
        let base = Layout { objects_parquet: HAS_PARQUET, ..Layout::default() };
        let difference = |existing: &Layout, given: &Layout| existing.difference(given).map(|(message, _)| message);
        for (other, with, without) in [
            (Layout { scenes: true, ..base.clone() }, "with --scenes", "without --scenes"),
            (base.clone().without([Extra::Layers]), "with --without layers", "without --without"),
            (
                Layout { frames_per_shard: 4, ..base.clone() },
                "with --frames-per-shard 4, not 1",
                "with --frames-per-shard 1, not 4",
            ),
            (
                Layout { formats: vec![Format::Cellpose], ..base.clone() },
                "with --format cellpose, not folder",
                "with --format folder, not cellpose",
            ),
        ] {
            assert_eq!(difference(&other, &base).unwrap(), format!("was written {with}"));
            assert_eq!(difference(&base, &other).unwrap(), format!("was written {without}"));
            assert_eq!(difference(&other, &other), None);
        }
    }

    #[test]
    fn a_layout_without_files_is_read_back_and_an_older_one_has_all() {
        let layout = Layout::default().without([Extra::Layers]);
        let text = serde_json::to_string(&layout).unwrap();
        assert!(text.ends_with(r#""without":["layers"]}"#), "{text}");
        assert_eq!(serde_json::from_str::<Layout>(&text).unwrap(), layout);
        let text = serde_json::to_string(&Layout::default()).unwrap();
        assert!(!text.contains("without") && serde_json::from_str::<Layout>(&text).unwrap() == Layout::default());
        assert!(layout.to_string().ends_with(", without layers"), "{layout}");
    }

    #[test]
    fn the_minimum_of_the_detectability_is_recorded_unless_it_is_the_default() {
        let of = |min_detectability| Layout { min_detectability, ..Layout::default() };
        let text = serde_json::to_string(&of(0.25)).unwrap();
        assert!(text.ends_with(r#""min_detectability":0.25}"#), "{text}");
        assert_eq!(serde_json::from_str::<Layout>(&text).unwrap(), of(0.25));
        assert!(of(0.25).to_string().ends_with(", minimum detectability 0.25") && of(0.0).check().is_ok());
        assert!(!serde_json::to_string(&Layout::default()).unwrap().contains("detectability"));
        for wrong in [-1.0, f64::NAN, f64::INFINITY] {
            let message = of(wrong).refusal().unwrap();
            assert!(message.contains(&format!("min_detectability: {wrong} is out of range")), "{message}");
            assert!(of(wrong).check().is_err());
        }
    }
}
