//! The folder of a slide: creation, resumption, inspection.

use std::fs;
use std::path::Path;

use papsynth::Slide;
use papsynth_zarr::Shard;

use super::record::{HEAD, IMAGE, Pyramids, RECORD_BYTES, SlideHead, SlideInfo, SlideRecord};
use crate::dataset::{Identity, any_content, recipe_difference, refuse_nested};
use crate::error::Error;
use crate::files::{Check, FileRecord, Folder};
use crate::formats::{HAS_PARQUET, names};

/// Name of the record of the files that [`SlideSet::finish`] adds.
pub(super) const UPPER: &str = "upper.json";

pub(super) const THUMBNAIL: &str = "thumbnail.png";
pub(super) const CARD: &str = "README.md";

/// A slide in a folder. Several processes may write shards in any order. No file outside the folder is changed.
#[derive(Debug)]
pub struct SlideSet {
    pub(super) folder: Folder,
    pub(super) head: SlideHead,
    pub(super) pyramids: Pyramids,
}

impl SlideSet {
    /// Creates a slide in a new or empty folder, or resumes the one in the folder. If `slide.json` is missing or
    /// damaged, the records of shards identify the slide.
    ///
    /// # Errors
    /// If the folder contains other files or a slide with another recipe, model, seed, number, stream version or shard
    /// size, objects at the centre of the deposit are larger than `scan.max_object_radius_um`, or a file cannot be read
    /// or written.
    pub fn create_or_resume(path: &Path, slide: &Slide, info: &SlideInfo) -> Result<Self, Error> {
        let (identity, recipe, model) = Identity::of(info.recipe, info.model, info.seed);
        let head = SlideHead::new(identity, slide, info);
        if info.objects_parquet && !HAS_PARQUET {
            return Err(Error::missing_feature("the table of objects as Parquet", "parquet", path));
        }
        let pyramids = Pyramids::new(&head).map_err(|error| Error::folder(path, error.to_string()))?;
        let set = Self { folder: Folder::new(path), head, pyramids };
        let text = set.head.to_json();
        match any_content(&set.folder)? {
            // If several processes start at once, one of them writes the head.
            None => {
                refuse_nested(&set.folder)?;
                check_centre(slide)?;
                if !set.folder.write_new(HEAD, |out| out.bytes(&text))? {
                    set.compare_or_restore(&recipe)?;
                }
            }
            Some(_) if Self::is_in(path) => set.compare_or_restore(&recipe)?,
            Some(name) => {
                let message = format!("the folder contains `{name}` and no slide; choose a new or empty folder");
                return Err(Error::folder(path, message));
            }
        }
        set.folder.sweep(false)?;
        set.folder.keep(HEAD, &text)?;
        set.folder.keep(names::RECIPE, recipe.as_bytes())?;
        set.folder.keep(names::MODEL, model.as_bytes())?;
        for (name, bytes) in set.documents()? {
            set.folder.keep(&name, &bytes)?;
        }
        Ok(set)
    }

    /// Checks that the folder contains this slide.
    fn compare_or_restore(&self, recipe: &str) -> Result<(), Error> {
        let found = match SlideHead::read(&self.folder) {
            Err(Error::Input { .. }) if self.is_recorded()? => return Ok(()),
            Err(Error::Input { problem, .. }) if !self.folder.names_in(names::SHARDS)?.is_empty() => {
                let message = format!(
                    "{HEAD} is missing or damaged ({problem}), and the shards have another recipe, model, seed, size or number; \
                     use the original ones"
                );
                return Err(Error::folder(self.path(), message));
            }
            found => found?,
        };
        let Some(what) = found.differs(&self.head) else { return Ok(()) };
        let same_recipe = found.identity.recipe_sha256 == self.head.identity.recipe_sha256;
        let field = if same_recipe {
            String::new()
        } else {
            recipe_difference(&self.folder, &found.identity.recipe_sha256, recipe)
        };
        let message =
            format!("contains a slide with another {what}{field}; choose another folder, or use the original {what}");
        Err(Error::folder(self.path(), message))
    }

    /// Whether a record in the folder belongs to this slide.
    fn is_recorded(&self) -> Result<bool, Error> {
        let shards = self.folder.names_in(names::SHARDS)?.into_iter().map(|name| format!("{}/{name}", names::SHARDS));
        for name in shards.chain([UPPER.to_owned()]) {
            if self.record(&name)?.is_some() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Opens the slide in a folder.
    ///
    /// # Errors
    /// If there is none, or `slide.json` cannot be read.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let folder = Folder::new(path);
        let head = SlideHead::read(&folder)?;
        let pyramids = Pyramids::new(&head).map_err(|error| Error::folder(&folder.path(HEAD), error.to_string()))?;
        Ok(Self { folder, head, pyramids })
    }

    /// Whether a folder contains a slide, even without `slide.json`.
    #[must_use]
    pub fn is_in(path: &Path) -> bool {
        [HEAD, UPPER, IMAGE].iter().any(|name| path.join(name).exists())
    }

    /// Whether [`finish`](Self::finish) has completed the slide, and its files still exist.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn is_finished(&self) -> Result<bool, Error> {
        Ok(self.recorded(UPPER, Check::Sizes)?.is_some())
    }

    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.root()
    }

    /// The head.
    #[must_use]
    pub fn head(&self) -> &SlideHead {
        &self.head
    }

    /// Number of columns and rows of shards.
    #[must_use]
    pub fn shard_grid(&self) -> [u32; 2] {
        [self.head.width_px, self.head.height_px].map(|side| side.div_ceil(self.head.shard_px))
    }

    /// Column and row of every shard, row by row.
    pub fn all_shards(&self) -> impl Iterator<Item = [u32; 2]> + use<> {
        let [columns, rows] = self.shard_grid();
        (0..rows).flat_map(move |row| (0..columns).map(move |column| [column, row]))
    }

    /// Returns the record of a shard if the shard is complete: the record belongs to this slide, and all its files
    /// match it.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn complete_record(&self, at: [u32; 2], check: Check) -> Result<Option<SlideRecord>, Error> {
        self.recorded(&record_name(at), check)
    }

    pub(super) fn recorded(&self, name: &str, check: Check) -> Result<Option<SlideRecord>, Error> {
        let Some(record) = self.record(name)? else { return Ok(None) };
        Ok(self.folder.first_defect(&record.files, check)?.is_none().then_some(record))
    }

    /// Returns a record if it exists and belongs to this slide.
    pub(super) fn record(&self, name: &str) -> Result<Option<SlideRecord>, Error> {
        let path = self.folder.path(name);
        let bytes = match fs::metadata(&path) {
            Ok(found) if found.len() > RECORD_BYTES => return Ok(None),
            Ok(_) => fs::read(&path).map_err(Error::io("read", &path))?,
            Err(_) => return Ok(None),
        };
        let record = SlideRecord::from_json(&bytes).ok();
        Ok(record.filter(|record| record.head_sha256 == self.head.sha256()))
    }

    /// Returns the metadata documents of the image with their paths in the folder.
    pub(super) fn documents(&self) -> Result<Vec<(String, Vec<u8>)>, Error> {
        self.pyramids.documents(&self.head).map_err(|error| Error::folder(self.path(), error.to_string()))
    }

    /// Returns the shards that are not complete.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn missing(&self, check: Check) -> Result<Vec<[u32; 2]>, Error> {
        let mut missing = Vec::new();
        for at in self.all_shards() {
            if self.complete_record(at, check)?.is_none() {
                missing.push(at);
            }
        }
        Ok(missing)
    }

    pub(super) fn write_record(&self, name: &str, files: Vec<FileRecord>, objects: u64) -> Result<(), Error> {
        self.folder.sync_names(&files)?;
        let record = SlideRecord::new(self.head.sha256(), files, objects);
        let written = self.folder.write(name, &record.to_json())?;
        self.folder.sync_names([&written])
    }
}

/// Checks the objects at the centre of the deposit, or at the nearest point of the slide: the largest objects are
/// there.
fn check_centre(slide: &Slide) -> Result<(), Error> {
    let (side, size, deposit_um) = (slide.side_px(), slide.size_px(), slide.deposit_um());
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a position on the slide")]
    let origin = [0, 1].map(|axis| {
        let last = size[axis].saturating_sub(side);
        (deposit_um[axis] / slide.pixel_um()).clamp(0.0, f64::from(last)) as u32
    });
    slide.objects(origin, size.map(|px| px.min(side)))?;
    Ok(())
}

pub(super) fn record_name([column, row]: [u32; 2]) -> String {
    format!("{}/{}.json", names::SHARDS, name_of([column, row]))
}

/// Returns the name of a shard: row and column.
pub(super) fn name_of([column, row]: [u32; 2]) -> String {
    format!("{row:04}-{column:04}")
}

/// Returns the position of a shard in an array.
pub(super) fn place([column, row]: [u32; 2], plane: usize) -> Shard {
    Shard { z: plane, y: row as usize, x: column as usize }
}
