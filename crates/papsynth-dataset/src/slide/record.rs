//! The head of a slide, the records of its files, and its OME-Zarr metadata.

use papsynth::Slide;
use papsynth::model::Model;
use papsynth::recipe::Recipe;
use papsynth::truth::Group;
use papsynth_zarr::{Coordinates, DataType, Image, Labels, Pyramid, PyramidShape, Tiling, levels_until};
use serde::{Deserialize, Serialize};
use serde_json::{Map, json};

use crate::bytes::{self, json_lines, sha256};
use crate::dataset::{Identity, SLIDE, WRITER, is_inside};
use crate::error::{Error, InputError};
use crate::files::{FileRecord, Folder};
use crate::formats::channels;

/// Name of the head of a slide.
pub(super) const HEAD: &str = SLIDE[0];

const FORMAT: &str = SLIDE[1];
const VERSION: u32 = 1;

pub(super) const RECORD_BYTES: u64 = 1 << 26;

/// The inputs of a slide.
#[derive(Debug, Clone, Copy)]
pub struct SlideInfo<'a> {
    /// The resolved recipe: the one of the engine.
    pub recipe: &'a Recipe,
    /// The model.
    pub model: &'a Model,
    /// The seed.
    pub seed: u64,
    /// Size of the square shards, px: 512 times a power of two.
    pub shard_px: u32,
    /// Whether tables of objects are also written as Parquet; needs the feature `parquet`.
    pub objects_parquet: bool,
}

/// The head of a slide: the content of `slide.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlideHead {
    /// Name of the format: `papsynth-slide`.
    pub format: String,
    /// Version of the format.
    pub version: u32,
    /// Program and version that wrote the files.
    pub writer: String,
    /// Identity: seed, versions and hashes of the inputs.
    pub identity: Identity,
    /// Number of the slide for its seed.
    pub slide: u64,
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Size of a pixel, µm.
    pub pixel_um: f64,
    /// Stage positions of the focal planes, µm.
    pub planes_um: Vec<f64>,
    /// Channels of a pixel: 1, or 3 for red, green and blue.
    pub channels: usize,
    /// Bits of a grey level.
    pub bits: u32,
    /// Size of the frames of the camera, px.
    pub frame_px: u32,
    /// Size of a shard, px.
    pub shard_px: u32,
    /// Whether tables of objects are also written as Parquet; needs the feature `parquet`.
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
    /// If it is invalid or of another version.
    pub fn from_json(bytes: &[u8]) -> Result<Self, InputError> {
        let head: Self = serde_json::from_slice(bytes)?;
        let invalid = |message: String| Err(InputError::broken("JSON", message));
        if head.format != FORMAT || head.version != VERSION {
            let (format, version) = (head.format.escape_default().to_string(), head.version);
            return invalid(format!("format `{format}`, version {version}; expected `{FORMAT}`, version {VERSION}"));
        }
        // Sizes decide how much memory readers allocate.
        let sides = [head.width_px, head.height_px, head.shard_px];
        if sides.iter().any(|side| !(1..=1 << 20).contains(side)) {
            return invalid(format!("sizes {sides:?} px; expected 1 to 1048576"));
        }
        if !(1..=1024).contains(&head.planes_um.len())
            || !matches!(head.channels, 1 | 3)
            || !(1..=16).contains(&head.bits)
        {
            let planes = head.planes_um.len();
            return invalid(format!(
                "planes {planes}, channels {}, bits {}; expected 1 to 1024 planes, 1 or 3 channels, 1 to 16 bits",
                head.channels, head.bits
            ));
        }
        Ok(head)
    }

    pub(super) fn to_json(&self) -> Vec<u8> {
        let mut text = json_lines(self);
        text.push(b'\n');
        text
    }

    /// Returns the SHA-256 of `slide.json`.
    pub(super) fn sha256(&self) -> String {
        sha256(&self.to_json())
    }

    /// Returns the first property in which two heads differ.
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

/// The record of files of a slide, written after all of them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlideRecord {
    /// SHA-256 of `slide.json`.
    pub head_sha256: String,
    /// Number of objects and parts of cells in the files.
    pub objects: u64,
    /// The files, sorted by path.
    pub files: Vec<FileRecord>,
    /// SHA-256 of the record as compact JSON in which this field is empty.
    pub sha256: String,
}

impl SlideRecord {
    pub(super) fn new(head_sha256: String, mut files: Vec<FileRecord>, objects: u64) -> Self {
        files.sort_by(|a, b| a.path.cmp(&b.path));
        Self { head_sha256, objects, files, sha256: String::new() }.sealed()
    }

    fn sealed(self) -> Self {
        let open = Self { sha256: String::new(), ..self };
        Self { sha256: sha256(&bytes::json(&open)), ..open }
    }

    pub(super) fn to_json(&self) -> Vec<u8> {
        json_lines(self)
    }

    /// Parses a record.
    ///
    /// # Errors
    /// If it is invalid, was changed after it was written, or lists a file outside the slide.
    pub fn from_json(bytes: &[u8]) -> Result<Self, InputError> {
        let record: Self = serde_json::from_slice(bytes)?;
        let invalid = |message: &str| Err(InputError::broken("JSON", message));
        if !record.files.iter().all(|file| is_inside(&file.path)) {
            return invalid("lists a file outside the slide");
        }
        if record.clone().sealed().sha256 != record.sha256 {
            return invalid("its content was changed: the SHA-256 differs");
        }
        if record.to_json() != bytes {
            return invalid("was reformatted: the content is equal, but not the bytes");
        }
        Ok(record)
    }
}

const CHUNK: usize = 512;

pub(super) const IMAGE: &str = "slide.ome.zarr";

/// Name of the label image with the number of cytoplasms.
pub(super) const LAYERS: &str = "layers";

/// The pyramids of image and labels.
#[derive(Debug)]
pub(super) struct Pyramids {
    pub(super) image: Pyramid,
    pub(super) labels: Pyramid,
    pub(super) layers: Pyramid,
}

impl Pyramids {
    pub(super) fn new(head: &SlideHead) -> Result<Self, papsynth_zarr::Error> {
        let (width, height) = (head.width_px as usize, head.height_px as usize);
        let form = |kind, channels, planes| {
            let form = PyramidShape {
                kind,
                channels,
                planes,
                height,
                width,
                tiling: Tiling { chunk: CHUNK, shard: head.shard_px as usize, planes: 1 },
                levels: levels_until(CHUNK, width, height),
            };
            Pyramid::new(&form)
        };
        let kind = if head.bits <= 8 { DataType::U8 } else { DataType::U16 };
        let planes = (head.planes_um.len() > 1).then_some(head.planes_um.len());
        let channels = (head.channels > 1).then_some(head.channels);
        Ok(Self {
            image: form(kind, channels, planes)?,
            labels: form(DataType::U32, None, None)?,
            layers: form(DataType::U16, None, None)?,
        })
    }

    /// Returns the metadata documents of the image with their paths in the folder.
    pub(super) fn documents(&self, head: &SlideHead) -> Result<Vec<(String, Vec<u8>)>, papsynth_zarr::Error> {
        let labels = |name: &str, pyramid: &Pyramid| Labels {
            name: name.to_owned(),
            pyramid: pyramid.clone(),
            colors: Vec::new(),
            properties: Vec::new(),
        };
        let planes = &head.planes_um;
        let image = Image {
            name: format!("papsynth slide {} of seed {}", head.slide, head.identity.seed),
            pyramid: self.image.clone(),
            coordinates: Coordinates {
                pixel_um: head.pixel_um,
                step_um: planes.get(1).map_or(1.0, |second| second - planes[0]),
                first_um: planes[0],
            },
            channels: channels(head.channels, head.bits),
            plane: planes.len() / 2,
            labels: Group::ALL
                .iter()
                .map(|group| labels(group.name(), &self.labels))
                .chain([labels(LAYERS, &self.layers)])
                .collect(),
            attributes: Map::from_iter([(
                "papsynth".to_owned(),
                json!({ "seed": head.identity.seed, "slide": head.slide, "recipe_sha256": head.identity.recipe_sha256 }),
            )]),
        };
        let documents = image.documents()?.into_iter();
        Ok(documents.map(|(path, bytes)| (format!("{IMAGE}/{path}"), bytes)).collect())
    }
}

/// Returns the folder of a level of the image, or of labels.
pub(super) fn folder(labels: Option<&str>, level: usize) -> String {
    match labels {
        None => format!("{IMAGE}/{level}"),
        Some(name) => format!("{IMAGE}/labels/{name}/{level}"),
    }
}
