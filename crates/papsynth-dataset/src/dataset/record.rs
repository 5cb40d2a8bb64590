//! What is recorded of a shard, and of what it is made from.

use std::ops::Range;
use std::path::{Component, Path};

use papsynth::key::STREAM_VERSION;
use papsynth::model::Model;
use papsynth::recipe::Recipe;
use serde::{Deserialize, Serialize};

use crate::bytes::{self, sha256};
use crate::error::{Error, Problem};
use crate::files::{FileRecord, Folder};
use crate::formats::{Layout, names};
use crate::read;
use crate::truth::FrameSummary;

pub(crate) const FORMAT_VERSION: u32 = 2;

/// What says that a folder is one of ours.
pub(crate) const FORMAT: &str = "papsynth-dataset";

/// The program that wrote a file: the same recipe gives the same pixels by every release with the same
/// `stream_version`, but not always the same compressed bytes.
pub(crate) const WRITER: &str = concat!("papsynth-dataset ", env!("CARGO_PKG_VERSION"));

const RECORD_BYTES: u64 = 1 << 28;

/// Largest side of an image, as wide as a field may be.
const LARGEST_SIDE_PX: usize = 1 << 15;

/// Most planes of a stack, as many as a recipe may ask for.
const MOST_PLANES: usize = 1024;

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
        let record: Self = serde_json::from_slice(bytes)?;
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

    pub(crate) fn to_json(&self) -> Vec<u8> {
        bytes::json_lines(self)
    }

    /// Frames must be of this shard, in order, and of sizes that there are: what is read of them is allocated by these numbers.
    fn check_frames(&self) -> Result<(), Problem> {
        let each = self.layout.frames_per_shard;
        let room = self.shard.saturating_mul(each)..self.shard.saturating_add(1).saturating_mul(each);
        let mut before = None;
        for frame in &self.frames {
            let FrameSummary { index, width, height, bits, channels, .. } = *frame;
            let (side, planes) = (1..=LARGEST_SIDE_PX, frame.planes_um.len());
            let wrong = if !room.contains(&index) || before.is_some_and(|before| before >= index) {
                "is none of this shard, or not in order".to_owned()
            } else if !side.contains(&width) || !side.contains(&height) {
                format!("{width} x {height} pixels; expected 1 to {LARGEST_SIDE_PX} a side")
            } else if ![1, 3].contains(&channels) || !(1..=16).contains(&bits) {
                format!("{channels} channels of {bits} bits; expected 1 or 3 of 1 to 16")
            } else if !(1..=MOST_PLANES).contains(&planes) {
                format!("{planes} planes; expected 1 to {MOST_PLANES}")
            } else {
                before = Some(index);
                continue;
            };
            return Err(json(format!("frame {index}: {wrong}")));
        }
        Ok(())
    }

    pub(crate) fn sealed(&self) -> Self {
        let open = Self { sha256: String::new(), ..self.clone() };
        Self { sha256: sha256(&bytes::json(&open)), ..open }
    }

    /// Whether it has all frames with an index in a range.
    #[must_use]
    pub fn covers(&self, frames: &Range<u64>) -> bool {
        let has = |index| self.frames.binary_search_by_key(&index, |frame| frame.index).is_ok();
        frames.clone().all(has)
    }
}

/// The record of a shard; a missing one is an [`Problem::Missing`].
pub(crate) fn read_record(folder: &Folder, shard: u64) -> Result<ShardRecord, Error> {
    let path = folder.inside(&names::record(shard))?;
    let record = ShardRecord::from_json(&read::bytes(&path, RECORD_BYTES)?).map_err(Error::input(&path))?;
    if record.shard != shard {
        return Err(Error::input(&path)(json(format!("is the record of shard {}", record.shard))));
    }
    Ok(record)
}

/// Numbers of all shards with a record, in order.
pub(crate) fn recorded_shards(folder: &Folder) -> Result<Vec<u64>, Error> {
    let names = folder.names_in(names::SHARDS)?;
    let mut found: Vec<u64> = names.iter().filter_map(|name| names::number_of_record(name)).collect();
    found.sort_unstable();
    Ok(found)
}

/// Whether a path is relative and stays below where it starts.
pub(crate) fn lies_inside(path: &str) -> bool {
    // A name as it stands is one part of a path: no `.`, `..`, drive or root, and nothing between two slashes.
    let is_name = |part: &str| Path::new(part).components().eq([Component::Normal(part.as_ref())]);
    !path.is_empty() && !path.contains(['\0', '\\']) && path.split('/').all(is_name)
}

pub(super) fn inside(files: &[FileRecord]) -> Result<(), Problem> {
    match files.iter().find(|file| !lies_inside(&file.path)) {
        Some(file) => Err(json(format!("the file `{}` lies outside the data set", file.path.escape_default()))),
        None => Ok(()),
    }
}

pub(super) fn version(found: u32) -> Result<(), Problem> {
    if found == FORMAT_VERSION {
        return Ok(());
    }
    Err(json(format!("version is {found}; this program reads and writes version {FORMAT_VERSION}")))
}

fn json(message: String) -> Problem {
    Problem::broken("JSON", message)
}
