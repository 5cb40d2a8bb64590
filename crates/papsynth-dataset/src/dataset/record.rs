//! Records of shards, and the identity of a data set.

use std::ops::Range;
use std::path::{Component, Path};

use papsynth::key::STREAM_VERSION;
use papsynth::model::Model;
use papsynth::recipe::Recipe;
use serde::{Deserialize, Serialize};

use crate::bytes::{self, sha256};
use crate::error::{Error, InputError};
use crate::files::{FileRecord, Folder};
use crate::formats::{Layout, names};
use crate::read;
use crate::truth::FrameSummary;

pub(crate) const FORMAT_VERSION: u32 = 2;

/// Name of the format in `manifest.json`.
pub(crate) const FORMAT: &str = "papsynth-dataset";

/// Program and version that write files. Releases with the same `stream_version` write the same pixels, but not always
/// the same compressed bytes.
pub(crate) const WRITER: &str = concat!("papsynth-dataset ", env!("CARGO_PKG_VERSION"));

/// Largest record, bytes.
const RECORD_BYTES: u64 = 1 << 28;

/// Largest width and height of an image, as for fields.
const MAX_SIDE_PX: usize = 1 << 15;

/// Largest number of planes of a stack, as in recipes.
const MAX_PLANES: usize = 1024;

/// The identity of a data set: data sets with equal identities have equal pixels.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Seed.
    pub seed: u64,
    /// Version of the mapping from recipe, model, seed and index to images.
    pub stream_version: u32,
    /// Version of the recipe format.
    pub recipe_version: u32,
    /// Version of the model format.
    pub model_version: u32,
    /// SHA-256 of `recipe.toml`.
    pub recipe_sha256: String,
    /// SHA-256 of `model.json`.
    pub model_sha256: String,
}

impl Identity {
    /// Returns the identity with the texts of recipe and model whose hashes it contains.
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

/// The record of a complete shard, written after all its files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShardRecord {
    /// Version of the format.
    pub version: u32,
    /// Program and version that wrote the files.
    pub writer: String,
    /// Identity of the data set.
    pub identity: Identity,
    /// Layout of the files.
    pub layout: Layout,
    /// Number of the shard.
    pub shard: u64,
    /// Summaries of its frames, sorted by index.
    pub frames: Vec<FrameSummary>,
    /// Its files, sorted by path.
    pub files: Vec<FileRecord>,
    /// SHA-256 of the record as compact JSON in which this field is empty.
    pub sha256: String,
}

impl ShardRecord {
    /// Parses a record.
    ///
    /// # Errors
    /// If it is invalid, of another version, was changed after it was written, or lists a file outside the data set.
    pub fn from_json(bytes: &[u8]) -> Result<Self, InputError> {
        let record: Self = serde_json::from_slice(bytes)?;
        check_version(record.version)?;
        check_paths(&record.files)?;
        record.layout.check()?;
        record.check_frames()?;
        if record.sealed().sha256 != record.sha256 {
            return Err(json("its content was changed: the SHA-256 differs".to_owned()));
        }
        // The manifest lists the hash of the bytes.
        if record.to_json() != bytes {
            return Err(json("was reformatted: the content is equal, but not the bytes".to_owned()));
        }
        Ok(record)
    }

    pub(crate) fn to_json(&self) -> Vec<u8> {
        bytes::json_lines(self)
    }

    /// Checks that the frames belong to the shard, are sorted, and have valid sizes, because readers allocate by these
    /// numbers.
    fn check_frames(&self) -> Result<(), InputError> {
        let each = self.layout.frames_per_shard;
        let range = self.shard.saturating_mul(each)..self.shard.saturating_add(1).saturating_mul(each);
        let mut previous = None;
        for frame in &self.frames {
            let FrameSummary { index, width, height, bits, channels, .. } = *frame;
            let (side, planes) = (1..=MAX_SIDE_PX, frame.planes_um.len());
            let wrong = if !range.contains(&index) {
                format!("shard {} contains frames {} to {}", self.shard, range.start, range.end.saturating_sub(1))
            } else if let Some(previous) = previous.filter(|previous| *previous >= index) {
                format!("after frame {previous}; expected ascending indices")
            } else if !side.contains(&width) || !side.contains(&height) {
                format!("size {width} x {height} px; expected 1 to {MAX_SIDE_PX} in each direction")
            } else if ![1, 3].contains(&channels) || !(1..=16).contains(&bits) {
                format!("channels {channels}, bits {bits}; expected 1 or 3 channels and 1 to 16 bits")
            } else if !(1..=MAX_PLANES).contains(&planes) {
                format!("planes {planes}; expected 1 to {MAX_PLANES}")
            } else {
                previous = Some(index);
                continue;
            };
            return Err(json(format!("frame {index}: {wrong}")));
        }
        Ok(())
    }

    /// Returns the record with its SHA-256.
    pub(crate) fn sealed(&self) -> Self {
        let open = Self { sha256: String::new(), ..self.clone() };
        Self { sha256: sha256(&bytes::json(&open)), ..open }
    }

    /// Whether the shard contains all frames of a range of indices.
    #[must_use]
    pub fn covers(&self, frames: &Range<u64>) -> bool {
        let has = |index| self.frames.binary_search_by_key(&index, |frame| frame.index).is_ok();
        frames.clone().all(has)
    }
}

/// Reads the record of a shard.
///
/// # Errors
/// If it is invalid, or missing: [`InputError::Missing`].
pub(crate) fn read_record(folder: &Folder, shard: u64) -> Result<ShardRecord, Error> {
    let path = folder.inside(&names::record(shard))?;
    let record = ShardRecord::from_json(&read::bytes(&path, RECORD_BYTES)?).map_err(Error::input(&path))?;
    if record.shard != shard {
        return Err(Error::input(&path)(json(format!(
            "expected the record of shard {shard}, found that of shard {}",
            record.shard
        ))));
    }
    Ok(record)
}

/// Returns the numbers of all shards with a record, sorted.
pub(crate) fn recorded_shards(folder: &Folder) -> Result<Vec<u64>, Error> {
    let names = folder.names_in(names::SHARDS)?;
    let mut found: Vec<u64> = names.iter().filter_map(|name| names::number_of_record(name)).collect();
    found.sort_unstable();
    Ok(found)
}

/// Whether a path is relative and stays inside its folder.
pub(crate) fn is_inside(path: &str) -> bool {
    // Every part is a plain name: not `.`, `..`, a drive, the root, or empty.
    let is_name = |part: &str| Path::new(part).components().eq([Component::Normal(part.as_ref())]);
    !path.is_empty() && !path.contains(['\0', '\\']) && path.split('/').all(is_name)
}

/// Checks that all files are inside the data set.
pub(super) fn check_paths(files: &[FileRecord]) -> Result<(), InputError> {
    match files.iter().find(|file| !is_inside(&file.path)) {
        Some(file) => Err(json(format!("lists the file `{}` outside the data set", file.path.escape_default()))),
        None => Ok(()),
    }
}

/// Checks the version of the format.
pub(super) fn check_version(found: u32) -> Result<(), InputError> {
    if found == FORMAT_VERSION {
        return Ok(());
    }
    Err(json(format!("version: expected {FORMAT_VERSION}, found {found}")))
}

fn json(message: String) -> InputError {
    InputError::broken("JSON", message)
}
