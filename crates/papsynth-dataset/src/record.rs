//! What is recorded of a data set and of each frame in it.

use std::collections::BTreeMap;
use std::fmt::{self, Formatter};
use std::fs::File;
use std::io::{self, BufReader};
use std::ops::Range;
use std::path::{Component, Path};

use papsynth::key::{Key, STREAM_VERSION};
use papsynth::model::Model;
use papsynth::recipe::Recipe;
use papsynth::scene::{Scene, View};
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use crate::coco::Category;
use crate::error::{Error, Problem};
use crate::files::{Folder, sha256};
use crate::layout::{self, Layout};

/// Version of the layout of data sets.
pub(crate) const FORMAT_VERSION: u32 = 2;

/// What says that a folder is one of ours.
pub(crate) const FORMAT: &str = "papsynth-dataset";

/// The program that wrote a file: the same recipe gives the same pixels by every release with the same
/// `stream_version`, but not always the same compressed bytes.
pub(crate) const WRITER: &str = concat!("papsynth-dataset ", env!("CARGO_PKG_VERSION"));

/// Largest side of an image, as wide as a field may be.
const LARGEST_SIDE_PX: usize = 1 << 15;

/// Most planes of a stack, as many as a recipe may ask for.
const MOST_PLANES: usize = 1024;

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

impl Identity {
    /// What decides of what is made from these, and the texts of recipe and model whose hashes stand in it.
    pub(crate) fn of(recipe: &Recipe, model: &Model, seed: u64) -> (Self, String, String) {
        let (recipe_toml, model_json) = (recipe.to_toml(), model.to_json());
        let identity = Self {
            seed,
            stream_version: STREAM_VERSION,
            recipe_version: recipe.version,
            model_version: model.version,
            recipe_sha256: sha256(recipe_toml.as_bytes()),
            model_sha256: sha256(model_json.as_bytes()),
        };
        (identity, recipe_toml, model_json)
    }
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
    /// Pixels of the complete masks of each group that are not shown where there is room for one object a pixel
    /// ([`Layout::flatten`]).
    pub lost_px: BTreeMap<String, u64>,
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

    /// That of a frame of a data set of this seed.
    pub(crate) fn of_summary(frame: &FrameSummary, seed: u64) -> Self {
        Self {
            key: Key { seed, index: frame.index },
            view: View { width: frame.width, height: frame.height, pixel_um: frame.pixel_um },
            planes_um: frame.planes_um.clone(),
            bits: frame.bits,
            channels: frame.channels,
            slide: frame.slide,
        }
    }

    pub(crate) fn pixels(&self) -> usize {
        self.view.width * self.view.height
    }

    /// What does not fit of what was handed over.
    pub(crate) fn wrong(&self, message: String) -> Error {
        Error::Frame { index: self.key.index, message }
    }

    /// Numbers of a plane: channels of pixels.
    pub(crate) fn values(&self) -> usize {
        self.pixels() * self.channels
    }
}

/// Says that a shard is whole: written after all its files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShardRecord {
    /// Version of the layout.
    pub version: u32,
    /// What wrote the files.
    pub writer: String,
    /// What the frames were made from.
    pub identity: Identity,
    /// How they lie in files.
    pub layout: Layout,
    /// Number of the shard.
    pub shard: u64,
    /// Its frames in a few numbers each, by index.
    pub frames: Vec<FrameSummary>,
    /// Its files, by path.
    pub files: Vec<FileRecord>,
    /// SHA-256 of the record as compact JSON in which this is empty: a bit that turns over does not go unnoticed.
    pub sha256: String,
}

impl ShardRecord {
    /// Parses a record.
    ///
    /// # Errors
    /// If it is none, is of another version, was changed after it was written, or names a file outside the data set.
    pub fn from_json(bytes: &[u8]) -> Result<Self, Problem> {
        let record: Self = serde_json::from_slice(bytes).map_err(broken)?;
        version(record.version)?;
        inside(&record.files)?;
        record.layout.check()?;
        record.check_frames()?;
        if record.sealed().sha256 != record.sha256 {
            return Err(json("is not as it was written: its own SHA-256 is another".to_owned()));
        }
        // The manifest vouches for the bytes of a record, and not for what they say.
        if record.to_json() != bytes {
            return Err(json("is not as it was written: it says the same in other bytes".to_owned()));
        }
        Ok(record)
    }

    /// The bytes of its file.
    pub(crate) fn to_json(&self) -> Vec<u8> {
        // A number that has no JSON is in no record that was written.
        serde_json::to_vec_pretty(self).unwrap_or_default()
    }

    /// Frames must be of this shard, in order, and of sizes that there are: what is read of them is allocated by these numbers.
    fn check_frames(&self) -> Result<(), Problem> {
        let each = self.layout.frames_per_shard;
        let room = self.shard.saturating_mul(each)..self.shard.saturating_add(1).saturating_mul(each);
        let wrong = |index: u64, what: &str| Err(json(format!("frame {index}: {what}")));
        let mut before = None;
        for frame in &self.frames {
            let FrameSummary { index, width, height, bits, channels, .. } = *frame;
            let side = 1..=LARGEST_SIDE_PX;
            if !room.contains(&index) || before.is_some_and(|before| before >= index) {
                return wrong(index, "is none of this shard, or not in order");
            }
            if !side.contains(&width) || !side.contains(&height) {
                return wrong(index, &format!("{width} x {height} pixels; expected 1 to {LARGEST_SIDE_PX} a side"));
            }
            if ![1, 3].contains(&channels) || !(1..=16).contains(&bits) {
                return wrong(index, &format!("{channels} channels of {bits} bits; expected 1 or 3 of 1 to 16"));
            }
            if frame.planes_um.is_empty() || frame.planes_um.len() > MOST_PLANES {
                return wrong(index, &format!("{} planes; expected 1 to {MOST_PLANES}", frame.planes_um.len()));
            }
            before = Some(index);
        }
        Ok(())
    }

    /// The record with its own hash.
    pub(crate) fn sealed(&self) -> Self {
        let open = Self { sha256: String::new(), ..self.clone() };
        // A number that has no JSON is in no record that was written.
        let text = serde_json::to_vec(&open).unwrap_or_default();
        Self { sha256: sha256(&text), ..open }
    }

    /// Whether it has all frames with an index in a range.
    #[must_use]
    pub fn covers(&self, frames: &Range<u64>) -> bool {
        let has = |index| self.frames.binary_search_by_key(&index, |frame| frame.index).is_ok();
        frames.clone().all(has)
    }
}

/// Paths must be relative and stay below where they start.
fn inside(files: &[FileRecord]) -> Result<(), Problem> {
    // A name as it stands is one part of a path: no `.`, `..`, drive or root, and nothing between two slashes.
    let is_name = |part: &str| Path::new(part).components().eq([Component::Normal(part.as_ref())]);
    let lies_inside = |path: &str| !path.is_empty() && !path.contains(['\0', '\\']) && path.split('/').all(is_name);
    match files.iter().find(|file| !lies_inside(&file.path)) {
        Some(file) => Err(json(format!("the file `{}` lies outside the data set", file.path.escape_default()))),
        None => Ok(()),
    }
}

/// The head of `manifest.json`, and of its list of files those of the whole data set; those of shards are in their records.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Manifest {
    /// What wrote it.
    pub writer: String,
    /// What the data set is made from.
    pub identity: Identity,
    /// How it lies in files.
    pub layout: Layout,
    /// What there may be in its images.
    pub categories: Vec<Category>,
    /// Number of frames when it was written; the files of later ones are not in it.
    pub frames: u64,
    /// Number of shards that they lie in.
    pub shards: u64,
    /// The files that are no shard's.
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
    layout: Layout,
    frames: u64,
    shards: u64,
    categories: Vec<Category>,
    head_sha256: String,
    #[serde(deserialize_with = "of_no_shard")]
    files: Vec<FileRecord>,
}

/// Of a list of files, which may be longer than memory, those that belong to no shard: they come first, before the first record.
fn of_no_shard<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<FileRecord>, D::Error> {
    struct Top;

    impl<'de> Visitor<'de> for Top {
        type Value = Vec<FileRecord>;

        fn expecting(&self, f: &mut Formatter<'_>) -> fmt::Result {
            f.write_str("a list of files")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
            let mut found = Vec::new();
            while let Some(entry) = list.next_element::<Entry>()? {
                if entry.shard.is_none() {
                    found.push(FileRecord { path: entry.path, bytes: entry.bytes, sha256: entry.sha256 });
                }
            }
            Ok(found)
        }
    }

    deserializer.deserialize_seq(Top)
}

/// A file as the manifest lists it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    pub(crate) path: String,
    pub(crate) bytes: u64,
    pub(crate) sha256: String,
    /// The shard it is of, if it is of one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) shard: Option<u64>,
}

/// The head of the file, as it is written.
#[derive(Serialize)]
pub(crate) struct ManifestHead<'a> {
    pub(crate) format: &'a str,
    pub(crate) version: u32,
    pub(crate) writer: &'a str,
    pub(crate) identity: &'a Identity,
    pub(crate) layout: &'a Layout,
    pub(crate) frames: u64,
    pub(crate) shards: u64,
    pub(crate) categories: &'a [Category],
    /// SHA-256 of the head as compact JSON in which this is empty.
    pub(crate) head_sha256: String,
}

impl ManifestHead<'_> {
    pub(crate) fn sealed(self) -> Self {
        let open = Self { head_sha256: String::new(), ..self };
        let text = serde_json::to_vec(&open).unwrap_or_default();
        Self { head_sha256: sha256(&text), ..open }
    }
}

impl Manifest {
    /// Parses a manifest.
    ///
    /// # Errors
    /// If it is none, or of another version.
    pub fn from_json(bytes: &[u8]) -> Result<Self, Problem> {
        Self::from_reader(bytes)
    }

    /// The manifest in a folder.
    pub(crate) fn read(folder: &Folder) -> Result<Self, Error> {
        let path = folder.inside(layout::MANIFEST)?;
        let file = File::open(&path).map_err(|e| match e.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => Error::Folder {
                path: folder.root().to_owned(),
                message: "holds no data set: there is no manifest.json".to_owned(),
            },
            _ => Error::io("read", &path)(e),
        })?;
        Self::from_reader(BufReader::new(file)).map_err(Error::input(&path))
    }

    pub(crate) fn from_reader(reader: impl std::io::Read) -> Result<Self, Problem> {
        let raw: RawManifest = serde_json::from_reader(reader).map_err(broken)?;
        if raw.format != FORMAT {
            return Err(json(format!("format is `{}`; `{FORMAT}` is wanted", raw.format.escape_default())));
        }
        version(raw.version)?;
        inside(&raw.files)?;
        raw.layout.check()?;
        let head = ManifestHead {
            format: &raw.format,
            version: raw.version,
            writer: &raw.writer,
            identity: &raw.identity,
            layout: &raw.layout,
            frames: raw.frames,
            shards: raw.shards,
            categories: &raw.categories,
            head_sha256: String::new(),
        };
        if head.sealed().head_sha256 != raw.head_sha256 {
            return Err(json("is not as it was written: the SHA-256 of its head is another".to_owned()));
        }
        Ok(Self {
            writer: raw.writer,
            identity: raw.identity,
            layout: raw.layout,
            frames: raw.frames,
            shards: raw.shards,
            categories: raw.categories,
            files: raw.files,
        })
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
