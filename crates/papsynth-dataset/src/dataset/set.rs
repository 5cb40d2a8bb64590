//! A data set in a folder, and the reading of its shards.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Mutex};

use papsynth::recipe::{self, Recipe};
use papsynth::truth::Truth;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::manifest::Manifest;
use super::record::{Identity, read_record, recorded_shards};
use super::rgb_image::Thumbnails;
use crate::bytes::sha256;
use crate::error::{Error, InputError};
use crate::files::{FileRecord, Folder, Location};
use crate::formats::{Layout, names};
use crate::read;
use crate::truth::{Category, Document, FrameSummary};

/// Largest file of a shard that is read, bytes.
pub(super) const SHARD_FILE_BYTES: u64 = 1 << 32;

/// Largest recipe, model or map that is read, bytes.
pub(super) const INPUT_BYTES: u64 = 1 << 30;

/// A data set in a folder.
///
/// Several threads and processes may write shards in any order. A shard is complete when its record (`shards/N.json`)
/// exists. No file outside the folder is changed.
#[derive(Debug, Clone)]
pub struct Dataset {
    pub(crate) folder: Folder,
    pub(crate) identity: Identity,
    pub(crate) layout: Layout,
    pub(crate) categories: Vec<Category>,
    pub(crate) map: Option<String>,
    /// Files whose SHA-256 was compared with their record.
    pub(super) trusted: Arc<Mutex<BTreeSet<String>>>,
    pub(super) thumbnails: Thumbnails,
}

/// Counts of a data set.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Number of complete frames.
    pub frames: u64,
    /// Number of objects and parts of cells by category of `coco.json`.
    pub objects: BTreeMap<String, u64>,
    /// Shards with a missing file or a file of wrong size. The merged files do not include them.
    pub damaged: Vec<u64>,
    /// Pixels of masks, by group, that are occluded in formats with one label a pixel.
    pub occluded_px: BTreeMap<String, u64>,
    /// Names of the splits by slide without frames ("train", "val", "test"). Small data sets have few slides.
    pub empty_splits: Vec<String>,
    /// SHA-256 of the manifest, which lists the SHA-256 of every file: data sets with equal roots are equal.
    pub root: String,
}

impl Dataset {
    /// Opens the data set in a folder.
    ///
    /// # Errors
    /// If there is none, or its manifest cannot be read.
    pub fn open(location: impl Into<Location>) -> Result<Self, Error> {
        let folder = Folder::new(location);
        let manifest = Manifest::read(&folder).map_err(|error| folder.named(error))?;
        Ok(Self::of(folder, manifest))
    }

    pub(super) fn of(folder: Folder, manifest: Manifest) -> Self {
        let is_map =
            |file: &&FileRecord| !file.path.contains('/') && !names::OF_EVERY_SET.contains(&file.path.as_str());
        let listed = manifest.files.iter().find(is_map).map(|file| file.path.clone());
        // The manifest lists no file before the first merge, and earlier merges of tasks did not list the map.
        let map = listed.or_else(|| named_map(&folder));
        let Manifest { identity, layout, categories, .. } = manifest;
        Self { folder, identity, layout, categories, map, trusted: Arc::default(), thumbnails: Thumbnails::default() }
    }

    /// The folder; for a data set in an object store, the folder of local copies.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.root()
    }

    /// The identity: seed, versions and hashes of the inputs.
    #[must_use]
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// The layout of the files.
    #[must_use]
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Indices of the frames that a shard can contain.
    #[must_use]
    pub fn frames_of_shard(&self, shard: u64) -> Range<u64> {
        let frames = self.layout.frames_per_shard;
        shard.saturating_mul(frames)..shard.saturating_add(1).saturating_mul(frames)
    }

    /// Returns the paths of the image of a frame and, for a stack, of its extended-depth-of-field image.
    pub(crate) fn image_paths(&self, frame: &FrameSummary, shard: u64) -> (String, Option<String>) {
        self.layout.images_of(self.identity.seed, shard, frame)
    }

    /// Returns the range of frames that [`finish`](Self::finish) merged; an empty range before the first merge. If
    /// records are missing, the range begins at 0.
    ///
    /// # Errors
    /// If the manifest or the last record cannot be read.
    pub fn merged_frames(&self) -> Result<Range<u64>, Error> {
        let Manifest { frames, shards, .. } = Manifest::read(&self.folder)?;
        let recorded = recorded_shards(&self.folder)?;
        let (Some(&first), Some(&last)) = (recorded.first(), recorded.last()) else { return Ok(0..frames) };
        if recorded.len() as u64 != shards {
            return Ok(0..frames);
        }
        let end = match read_record(&self.folder, last) {
            Ok(record) => record.frames.last().map_or(frames, |frame| frame.index + 1),
            Err(Error::Input { .. }) => self.frames_of_shard(last).end,
            Err(failure) => return Err(failure),
        };
        Ok(self.frames_of_shard(first).start..end)
    }

    /// Returns the numbers of all recorded shards, sorted.
    ///
    /// # Errors
    /// If records of merged shards are missing, or a file cannot be read.
    pub(crate) fn shards(&self) -> Result<Vec<u64>, Error> {
        let (merged, shards) = (Manifest::read(&self.folder)?.shards, recorded_shards(&self.folder)?);
        if (shards.len() as u64) < merged {
            let lost = merged - shards.len() as u64;
            let message = format!("missing records of shards: {lost} of {merged}; `papsynth verify` lists them");
            return Err(Error::folder(self.path(), message));
        }
        Ok(shards)
    }

    /// Checks that `recipe.toml`, `model.json` and the map are those that the data set was generated from.
    ///
    /// # Errors
    /// If one of them was changed after generation, is missing, or cannot be read.
    pub fn check_inputs(&self) -> Result<(), Error> {
        let inputs = [(names::RECIPE, &self.identity.recipe_sha256), (names::MODEL, &self.identity.model_sha256)];
        let map = match &self.map {
            Some(map) => Manifest::read(&self.folder)?.files.into_iter().find(|file| file.path == *map),
            None => None,
        };
        let inputs = inputs.into_iter().chain(map.as_ref().map(|file| (file.path.as_str(), &file.sha256)));
        for (name, expected) in inputs {
            let path = self.folder.inside(name).map_err(|error| self.folder.named(error))?;
            let found = sha256(&read::bytes(&path, INPUT_BYTES).map_err(|error| self.folder.named(error))?);
            let message = || {
                format!(
                    "was changed after generation: its SHA-256 is {found:.16}…, manifest.json lists {expected:.16}…; \
                     restore the original file"
                )
            };
            if found != *expected {
                return Err(self.folder.named(Error::input(&path)(InputError::unfit(message()))));
            }
        }
        Ok(())
    }

    /// Names of the input files. Before the first merge, the map is the one that the recipe names.
    pub(super) fn given(&self) -> impl Iterator<Item = &str> {
        [names::MODEL, names::RECIPE].into_iter().chain(self.map.as_deref())
    }

    pub(super) fn document(&self, shard: u64) -> Result<Document, Error> {
        self.part_of_document(shard)
    }

    /// Reads the COCO document of a shard, or the fields of it that `T` has.
    pub(super) fn part_of_document<T: DeserializeOwned>(&self, shard: u64) -> Result<T, Error> {
        let (folder, name) = (&self.folder, names::coco(shard));
        let path = folder.inside(&name)?;
        let bytes = read::bytes(&path, SHARD_FILE_BYTES)?;
        folder.release([name.as_str()]);
        serde_json::from_slice(&bytes).map_err(|error| Error::input(&path)(error.into()))
    }

    pub(super) fn truth_in(&self, document: &Document, shard: u64, index: u64) -> Result<Truth, Error> {
        document.truth(index).map_err(Error::input(&self.folder.path(&names::coco(shard))))
    }
}

/// Returns the map that a recipe names.
pub(super) fn map_of(recipe: &Recipe) -> Option<&String> {
    match &recipe.layout {
        recipe::Layout::DensityMap { path } | recipe::Layout::Labels(recipe::Labels { path, .. }) => Some(path),
        _ => None,
    }
}

/// Returns the map that the recipe in a folder names, if the recipe is valid. Maps lie beside the recipe.
pub(crate) fn named_map(folder: &Folder) -> Option<String> {
    let text = read::bytes(&folder.inside(names::RECIPE).ok()?, INPUT_BYTES).ok()?;
    let recipe = Recipe::from_toml(&String::from_utf8_lossy(&text)).ok()?;
    map_of(&recipe).filter(|name| !name.contains(['/', '\\'])).cloned()
}
