//! What a slide is, and what of it is whole.

use papsynth::Slide;
use papsynth::model::Model;
use papsynth::recipe::Recipe;
use serde::{Deserialize, Serialize};

use crate::bytes::{json, json_lines, sha256};
use crate::dataset::{Identity, SLIDE, WRITER, lies_inside};
use crate::error::{Error, Problem};
use crate::files::{FileRecord, Folder};

/// Name of the file that says what a slide is made from.
pub(super) const HEAD: &str = SLIDE[0];

const FORMAT: &str = SLIDE[1];
const VERSION: u32 = 1;

/// Largest record that is read back.
pub(super) const RECORD_BYTES: u64 = 1 << 26;

/// What a slide is made from.
#[derive(Debug, Clone, Copy)]
pub struct SlideInfo<'a> {
    /// The recipe, resolved: as the engine got it.
    pub recipe: &'a Recipe,
    /// The model.
    pub model: &'a Model,
    /// The seed.
    pub seed: u64,
    /// Side of the squares that are written and made again together, px: 512 times a power of two.
    pub shard_px: u32,
    /// Whether tables of objects are also written as Parquet, which wants the feature `parquet`.
    pub objects_parquet: bool,
}

/// What a slide is made from, and how it is cut: `slide.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlideHead {
    /// What this file is.
    pub format: String,
    /// Version of the layout.
    pub version: u32,
    /// What wrote the files.
    pub writer: String,
    /// What the slide is made from.
    pub identity: Identity,
    /// Its number among the slides of its seed.
    pub slide: u64,
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Side of a pixel, µm.
    pub pixel_um: f64,
    /// Travel of the stage to the focal planes, µm.
    pub planes_um: Vec<f64>,
    /// Channels of a pixel: 1, or 3 for red, green and blue.
    pub channels: usize,
    /// Bits of a grey level.
    pub bits: u32,
    /// Side of the camera's frames, px.
    pub frame_px: u32,
    /// Side of a shard, px.
    pub shard_px: u32,
    /// Whether tables of objects are also written as Parquet; wants the feature `parquet`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub objects_parquet: bool,
}

impl SlideHead {
    pub(super) fn new(identity: Identity, slide: &Slide, info: &SlideInfo) -> Self {
        let [width_px, height_px] = slide.size_px();
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            writer: WRITER.to_owned(),
            identity,
            slide: slide.number(),
            width_px,
            height_px,
            pixel_um: slide.pixel_um(),
            planes_um: slide.planes_um().to_vec(),
            channels: slide.channels(),
            bits: slide.bits(),
            frame_px: slide.side_px(),
            shard_px: info.shard_px,
            objects_parquet: info.objects_parquet,
        }
    }

    pub(super) fn read(folder: &Folder) -> Result<Self, Error> {
        let path = folder.path(HEAD);
        let bytes = crate::read::bytes(&path, RECORD_BYTES)?;
        Self::from_json(&bytes).map_err(Error::input(&path))
    }

    /// Parses `slide.json`.
    ///
    /// # Errors
    /// If it is none, or of another version.
    pub fn from_json(bytes: &[u8]) -> Result<Self, Problem> {
        let head: Self = serde_json::from_slice(bytes)?;
        let said = |message: String| Err(Problem::broken("JSON", message));
        if head.format != FORMAT || head.version != VERSION {
            let (format, version) = (head.format.escape_default().to_string(), head.version);
            return said(format!("is `{format}` of version {version}; expected `{FORMAT}` of version {VERSION}"));
        }
        // What is asked for by sizes is memory.
        let sides = [head.width_px, head.height_px, head.shard_px];
        if sides.iter().any(|side| !(1..=1 << 20).contains(side)) {
            return said(format!("sides of {sides:?} pixels; expected 1 to 1048576"));
        }
        if !(1..=1024).contains(&head.planes_um.len())
            || !matches!(head.channels, 1 | 3)
            || !(1..=16).contains(&head.bits)
        {
            let planes = head.planes_um.len();
            return said(format!("{planes} planes of {} channels of {} bits", head.channels, head.bits));
        }
        Ok(head)
    }

    pub(super) fn to_json(&self) -> Vec<u8> {
        let mut text = json_lines(self);
        text.push(b'\n');
        text
    }

    /// The SHA-256 of `slide.json`.
    #[must_use]
    pub fn sha256(&self) -> String {
        sha256(&self.to_json())
    }

    /// In what it differs from another.
    pub(super) fn differs(&self, other: &Self) -> Option<&'static str> {
        let (a, b) = (&self.identity, &other.identity);
        let pairs = [
            ("recipe", a.recipe_sha256 != b.recipe_sha256),
            ("model", a.model_sha256 != b.model_sha256),
            ("seed", a.seed != b.seed),
            ("stream version", a.stream_version != b.stream_version),
            ("slide number", self.slide != other.slide),
            ("shard size", self.shard_px != other.shard_px),
            ("kind of tables (with or without Parquet)", self.objects_parquet != other.objects_parquet),
        ];
        let known = pairs.into_iter().find(|(_, differs)| *differs).map(|(name, _)| name);
        known.or_else(|| (self != other).then_some("kind"))
    }
}

/// Says that files of a slide are whole: written after all of them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlideRecord {
    /// SHA-256 of the slide's `slide.json`.
    pub head_sha256: String,
    /// Objects and parts of cells that are told in the files.
    pub objects: u64,
    /// The files, by path.
    pub files: Vec<FileRecord>,
    /// SHA-256 of the record as compact JSON in which this is empty.
    pub sha256: String,
}

impl SlideRecord {
    pub(super) fn new(head_sha256: String, mut files: Vec<FileRecord>, objects: u64) -> Self {
        files.sort_by(|a, b| a.path.cmp(&b.path));
        Self { head_sha256, objects, files, sha256: String::new() }.sealed()
    }

    fn sealed(self) -> Self {
        let open = Self { sha256: String::new(), ..self };
        Self { sha256: sha256(&json(&open)), ..open }
    }

    pub(super) fn to_json(&self) -> Vec<u8> {
        json_lines(self)
    }

    /// Parses a record.
    ///
    /// # Errors
    /// If it is none, was changed after it was written, or names a file outside the slide.
    pub fn from_json(bytes: &[u8]) -> Result<Self, Problem> {
        let record: Self = serde_json::from_slice(bytes)?;
        let said = |message: &str| Err(Problem::broken("JSON", message));
        if !record.files.iter().all(|file| lies_inside(&file.path)) {
            return said("names a file outside the slide");
        }
        if record.clone().sealed().sha256 != record.sha256 {
            return said("is not as it was written: its own SHA-256 is another");
        }
        if record.to_json() != bytes {
            return said("is not as it was written: it says the same in other bytes");
        }
        Ok(record)
    }
}
