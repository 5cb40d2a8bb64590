//! What is recorded of a data set and of each frame in it.

use std::collections::BTreeMap;
use std::fmt::{self, Formatter};
use std::path::{Component, Path};

use papsynth::key::Key;
use papsynth::scene::{Scene, View};
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use crate::error::Problem;

/// Version of the layout of data sets.
pub(crate) const FORMAT_VERSION: u32 = 1;

/// What says that a folder is one of ours.
pub(crate) const FORMAT: &str = "papsynth-dataset";

/// The program that wrote a file: the same recipe gives the same pixels by every release with the same
/// `stream_version`, but not always the same compressed bytes.
pub(crate) const WRITER: &str = concat!("papsynth-dataset ", env!("CARGO_PKG_VERSION"));

/// How carefully files are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Check {
    /// They are there and of the right size.
    Sizes,
    /// Their SHA-256 is right, too; all are read.
    Hashes,
}

/// What decides every image of a data set.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Seed of the data set.
    pub seed: u64,
    /// Version of the mapping from recipe, model, seed and index to images.
    pub stream_version: u32,
    /// Version of the recipe's format.
    pub recipe_version: u32,
    /// Version of the model's format.
    pub model_version: u32,
    /// SHA-256 of `recipe.toml`.
    pub recipe_sha256: String,
    /// SHA-256 of `model.json`.
    pub model_sha256: String,
}

/// A file of a data set.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileRecord {
    /// Path relative to the data set, with `/` between folders.
    pub path: String,
    /// Size in bytes.
    pub bytes: u64,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
}

/// A frame in a few numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameSummary {
    /// Index of the frame.
    pub index: u64,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Size of a pixel, µm.
    pub pixel_um: f64,
    /// Bits of a grey level.
    pub bits: u32,
    /// Channels of a pixel: 1, or 3 for red, green and blue.
    pub channels: usize,
    /// Number of the slide that the frame shows a field of.
    pub slide: u64,
    /// Travel of the stage to the focal planes, µm, in the order of the stack.
    pub planes_um: Vec<f64>,
    /// Number of saturated pixels of each plane.
    pub saturated: Vec<usize>,
    /// Number of places in each plane, in pixels, where the model of the optics would have given less light than there can
    /// be and a least one was put in its place: beside very dark things.
    pub floored: Vec<usize>,
    /// Number of objects and parts of cells by category, as `coco.json` names it.
    pub objects: BTreeMap<String, u64>,
    /// How many of them lie partly outside the image.
    pub truncated: u64,
    /// The largest number of cytoplasms that lie over each other.
    pub most_layers: u16,
}

/// What must be known of a frame before its first plane is written.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Geometry {
    pub(crate) key: Key,
    pub(crate) view: View,
    pub(crate) planes_um: Vec<f64>,
    pub(crate) bits: u32,
    pub(crate) channels: usize,
    pub(crate) slide: u64,
}

impl Geometry {
    pub(crate) fn of(scene: &Scene) -> Self {
        Self {
            key: scene.key,
            view: scene.view,
            planes_um: scene.planes_um.clone(),
            bits: scene.camera.bits,
            channels: scene.channels(),
            slide: scene.slide,
        }
    }

    pub(crate) fn pixels(&self) -> usize {
        self.view.width * self.view.height
    }

    /// Numbers of a plane: channels of pixels.
    pub(crate) fn values(&self) -> usize {
        self.pixels() * self.channels
    }
}

/// Says that a frame is whole: written after all its files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameRecord {
    /// Version of the layout.
    pub version: u32,
    /// What wrote the files.
    pub writer: String,
    /// What the frame was made from.
    pub identity: Identity,
    /// The frame in a few numbers.
    pub summary: FrameSummary,
    /// Its files.
    pub files: Vec<FileRecord>,
}

impl FrameRecord {
    /// Parses a record.
    ///
    /// # Errors
    /// If it is none, is of another version, or names a file outside the data set.
    pub fn from_json(bytes: &[u8]) -> Result<Self, Problem> {
        let record: Self = serde_json::from_slice(bytes).map_err(broken)?;
        version(record.version)?;
        inside(&record.files)?;
        Ok(record)
    }
}

/// Paths must be relative and stay below where they start.
fn inside(files: &[FileRecord]) -> Result<(), Problem> {
    let lies_inside =
        |path: &str| !path.is_empty() && Path::new(path).components().all(|c| matches!(c, Component::Normal(_)));
    match files.iter().find(|file| !lies_inside(&file.path)) {
        Some(file) => Err(json(format!("the file `{}` lies outside the data set", file.path.escape_default()))),
        None => Ok(()),
    }
}

/// The head of `manifest.json`, and of its list of files those of the whole data set; those of frames are in their records.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Manifest {
    /// What wrote it.
    pub writer: String,
    /// What the data set is made from.
    pub identity: Identity,
    /// Number of frames when it was written; the files of later ones are not in it.
    pub frames: u64,
    /// The files that are no frame's.
    pub files: Vec<FileRecord>,
}

/// As it stands in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawManifest {
    format: String,
    version: u32,
    writer: String,
    identity: Identity,
    frames: u64,
    #[serde(deserialize_with = "at_the_top")]
    files: Vec<FileRecord>,
}

/// Of a list of files, which may be longer than memory, those that lie in no folder.
fn at_the_top<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<FileRecord>, D::Error> {
    struct Top;

    impl<'de> Visitor<'de> for Top {
        type Value = Vec<FileRecord>;

        fn expecting(&self, f: &mut Formatter<'_>) -> fmt::Result {
            f.write_str("a list of files")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
            let mut found = Vec::new();
            while let Some(file) = list.next_element::<FileRecord>()? {
                if !file.path.contains('/') {
                    found.push(file);
                }
            }
            Ok(found)
        }
    }

    deserializer.deserialize_seq(Top)
}

/// The head of the file, as it is written.
#[derive(Serialize)]
pub(crate) struct ManifestHead<'a> {
    pub(crate) format: &'a str,
    pub(crate) version: u32,
    pub(crate) writer: &'a str,
    pub(crate) identity: &'a Identity,
    pub(crate) frames: u64,
}

impl Manifest {
    /// Parses a manifest.
    ///
    /// # Errors
    /// If it is none, or of another version.
    pub fn from_json(bytes: &[u8]) -> Result<Self, Problem> {
        Self::from_reader(bytes)
    }

    pub(crate) fn from_reader(reader: impl std::io::Read) -> Result<Self, Problem> {
        let raw: RawManifest = serde_json::from_reader(reader).map_err(broken)?;
        if raw.format != FORMAT {
            return Err(json(format!("format is `{}`; `{FORMAT}` is wanted", raw.format.escape_default())));
        }
        version(raw.version)?;
        inside(&raw.files)?;
        Ok(Self { writer: raw.writer, identity: raw.identity, frames: raw.frames, files: raw.files })
    }
}

fn version(found: u32) -> Result<(), Problem> {
    if found == FORMAT_VERSION {
        return Ok(());
    }
    Err(json(format!("version is {found}; this program reads and writes version {FORMAT_VERSION}")))
}

pub(crate) fn broken(error: serde_json::Error) -> Problem {
    json(error.to_string())
}

fn json(message: String) -> Problem {
    Problem::Broken { format: "JSON", message }
}
