//! A data set that lies in a folder, and what is read of its shards.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Mutex};

use papsynth::truth::Truth;
use serde::Serialize;

use super::manifest::Manifest;
use super::record::{Identity, recorded_shards};
use crate::error::Error;
use crate::files::{FileRecord, Folder, Home};
use crate::formats::{Layout, names};
use crate::read;
use crate::truth::{Category, Document, FrameSummary};

/// What was written for one shard is read whole.
pub(super) const SHARD_FILE_BYTES: u64 = 1 << 32;

/// A data set in a folder.
///
/// Shards may be written in any order, by several threads, and by several processes; each is whole when its record
/// (`shards/N.json`) is there. Nothing outside the folder is touched.
#[derive(Debug, Clone)]
pub struct Dataset {
    pub(crate) folder: Folder,
    pub(crate) identity: Identity,
    pub(crate) layout: Layout,
    pub(crate) categories: Vec<Category>,
    pub(crate) map: Option<String>,
    /// Files whose SHA-256 has been compared with their record.
    pub(super) trusted: Arc<Mutex<BTreeSet<String>>>,
}

/// A data set in a few numbers.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Number of whole frames.
    pub frames: u64,
    /// Number of objects and parts of cells by category, as `coco.json` names it.
    pub objects: BTreeMap<String, u64>,
    /// Shards that were begun, but of which a file is missing or of another size: they are not in the merged files.
    pub damaged: Vec<u64>,
    /// Pixels of masks, by group, that formats with one label a pixel do not show.
    pub occluded_px: BTreeMap<String, u64>,
    /// Names of the splits by slide without frames ("train", "val", "test"). Small data sets have few slides.
    pub empty_splits: Vec<String>,
    /// SHA-256 of the manifest that was written, which names every file with its own: two data sets with the same are the same.
    pub root: String,
}

impl Dataset {
    /// The data set that lies in a folder.
    ///
    /// # Errors
    /// If there is none, or the system refuses to read.
    pub fn open(home: impl Into<Home>) -> Result<Self, Error> {
        let folder = Folder::new(home);
        let manifest = Manifest::read(&folder).map_err(|error| folder.named(error))?;
        Ok(Self::of(folder, manifest))
    }

    pub(super) fn of(folder: Folder, manifest: Manifest) -> Self {
        let is_map =
            |file: &&FileRecord| !file.path.contains('/') && !names::OF_EVERY_SET.contains(&file.path.as_str());
        let map = manifest.files.iter().find(is_map).map(|file| file.path.clone());
        let Manifest { identity, layout, categories, .. } = manifest;
        Self { folder, identity, layout, categories, map, trusted: Arc::default() }
    }

    /// Where it lies; of one in an object store, where its files are worked on.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.root()
    }

    /// What it is made from.
    #[must_use]
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// How it lies in files.
    #[must_use]
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Indices of the frames that a shard has room for.
    #[must_use]
    pub fn frames_of_shard(&self, shard: u64) -> Range<u64> {
        let frames = self.layout.frames_per_shard;
        shard.saturating_mul(frames)..shard.saturating_add(1).saturating_mul(frames)
    }

    /// Where the image of a frame lies and, of a stack, the one with everything in focus.
    pub(crate) fn images_of(&self, frame: &FrameSummary, shard: u64) -> (String, Option<String>) {
        self.layout.images_of(self.identity.seed, shard, frame)
    }

    /// How many frames [`finish`](Self::finish) has merged; none of a data set that was only begun.
    ///
    /// # Errors
    /// If the manifest cannot be read.
    pub fn merged_frames(&self) -> Result<u64, Error> {
        Ok(Manifest::read(&self.folder)?.frames)
    }

    /// Numbers of all recorded shards, in order.
    ///
    /// # Errors
    /// If there are fewer than were merged, or the system refuses to read.
    pub(crate) fn shards(&self) -> Result<Vec<u64>, Error> {
        let (merged, shards) = (Manifest::read(&self.folder)?.shards, recorded_shards(&self.folder)?);
        if (shards.len() as u64) < merged {
            let lost = merged - shards.len() as u64;
            let message = format!("{lost} of {merged} shards have lost their records; `papsynth verify` says which");
            return Err(Error::folder(self.path(), message));
        }
        Ok(shards)
    }

    pub(super) fn given(&self) -> impl Iterator<Item = &str> {
        [names::MODEL, names::RECIPE].into_iter().chain(self.map.as_deref())
    }

    pub(super) fn document(&self, shard: u64) -> Result<Document, Error> {
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
