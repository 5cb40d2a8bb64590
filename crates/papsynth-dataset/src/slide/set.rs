//! The folder of a slide: begun, resumed, looked at.

use std::fs;
use std::path::Path;

use papsynth::Slide;
use papsynth_zarr::Shard;

use super::record::{Forms, HEAD, IMAGE, RECORD_BYTES, SlideHead, SlideInfo, SlideRecord};
use crate::dataset::{Identity, recipe_difference, refuse_nested, stranger};
use crate::error::Error;
use crate::files::{Check, FileRecord, Folder};
use crate::formats::{HAS_PARQUET, names};

/// Name of the record of what was added at the end.
pub(super) const UPPER: &str = "upper.json";

pub(super) const THUMBNAIL: &str = "thumbnail.png";
pub(super) const CARD: &str = "README.md";

/// A slide in a folder. Shards may be written in any order, by several processes; nothing outside the folder is touched.
#[derive(Debug)]
pub struct SlideSet {
    pub(super) folder: Folder,
    pub(super) head: SlideHead,
    pub(super) forms: Forms,
}

impl SlideSet {
    /// Begins a slide in a folder that is empty or not there yet, or goes on with the one in it. Where `slide.json` is lost or damaged, the
    /// records of shards tell whether it is this one.
    ///
    /// # Errors
    /// If the folder holds something else, or a slide of another recipe, model, seed, number, stream version or shard size, objects in the
    /// middle of the deposit reach farther than `scan.max_object_radius_um`, or the system refuses.
    pub fn create_or_resume(path: &Path, slide: &Slide, info: &SlideInfo) -> Result<Self, Error> {
        let (identity, recipe, model) = Identity::of(info.recipe, info.model, info.seed);
        let head = SlideHead::new(identity, slide, info);
        if info.objects_parquet && !HAS_PARQUET {
            return Err(Error::missing_feature("the table of objects as Parquet", "parquet", path));
        }
        let forms = Forms::new(&head).map_err(|error| Error::folder(path, error.to_string()))?;
        let set = Self { folder: Folder::new(path), head, forms };
        let text = set.head.to_json();
        match stranger(&set.folder)? {
            // Of several that begin at once one is the first.
            None => {
                refuse_nested(&set.folder)?;
                look_at_the_middle(slide)?;
                if !set.folder.write_unless_there(HEAD, |out| out.bytes(&text))? {
                    set.compare_or_restore(&recipe)?;
                }
            }
            Some(_) if Self::is_in(path) => set.compare_or_restore(&recipe)?,
            Some(name) => {
                let message =
                    format!("the folder holds something else (`{name}`) and no slide; choose another, or a new one");
                return Err(Error::folder(path, message));
            }
        }
        set.folder.sweep()?;
        set.folder.keep(HEAD, &text)?;
        set.folder.keep(names::RECIPE, recipe.as_bytes())?;
        set.folder.keep(names::MODEL, model.as_bytes())?;
        for (name, bytes) in set.documents()? {
            set.folder.keep(&name, &bytes)?;
        }
        Ok(set)
    }

    /// The slide in the folder must be this one.
    fn compare_or_restore(&self, recipe: &str) -> Result<(), Error> {
        let found = match SlideHead::read(&self.folder) {
            Err(Error::Input { .. }) if self.is_recorded()? => return Ok(()),
            Err(Error::Input { problem, .. }) if !self.folder.names_in(names::SHARDS)?.is_empty() => {
                let message = format!(
                    "its {HEAD} is lost or damaged ({problem}), and its shards are of another recipe, model, seed, size or number; give what it was \
                     begun with"
                );
                return Err(Error::folder(self.path(), message));
            }
            found => found?,
        };
        let Some(what) = found.differs(&self.head) else { return Ok(()) };
        let same_recipe = found.identity.recipe_sha256 == self.head.identity.recipe_sha256;
        let field = if same_recipe { String::new() } else { recipe_difference(&self.folder, recipe) };
        let message =
            format!("holds a slide of another {what}{field}; choose another folder, or give what it was begun with");
        Err(Error::folder(self.path(), message))
    }

    /// Whether something in the folder is recorded as part of this slide.
    fn is_recorded(&self) -> Result<bool, Error> {
        let shards = self.folder.names_in(names::SHARDS)?.into_iter().map(|name| format!("{}/{name}", names::SHARDS));
        for name in shards.chain([UPPER.to_owned()]) {
            if self.record(&name)?.is_some() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The slide that lies in a folder.
    ///
    /// # Errors
    /// If there is none, or the system refuses to read.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let folder = Folder::new(path);
        let head = SlideHead::read(&folder)?;
        let forms = Forms::new(&head).map_err(|error| Error::folder(&folder.path(HEAD), error.to_string()))?;
        Ok(Self { folder, head, forms })
    }

    /// Whether a folder holds a slide, be it one that lost its `slide.json`.
    #[must_use]
    pub fn is_in(path: &Path) -> bool {
        [HEAD, UPPER, IMAGE].iter().any(|name| path.join(name).exists())
    }

    /// Whether [`finish`](Self::finish) has closed it, and what that wrote is still there.
    ///
    /// # Errors
    /// If the system refuses to tell.
    pub fn is_finished(&self) -> Result<bool, Error> {
        Ok(self.recorded(UPPER, Check::Sizes)?.is_some())
    }

    /// Where it lies.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.root()
    }

    /// What it is made from.
    #[must_use]
    pub fn head(&self) -> &SlideHead {
        &self.head
    }

    /// Columns and rows of shards.
    #[must_use]
    pub fn shards(&self) -> [u32; 2] {
        [self.head.width_px, self.head.height_px].map(|side| side.div_ceil(self.head.shard_px))
    }

    /// Every shard, as its column and row, row by row.
    pub fn all(&self) -> impl Iterator<Item = [u32; 2]> + use<> {
        let [columns, rows] = self.shards();
        (0..rows).flat_map(move |row| (0..columns).map(move |column| [column, row]))
    }

    /// The record of a shard if it is whole: its record is there, is of this slide, and all its files are as it says.
    ///
    /// # Errors
    /// If the system refuses to tell.
    pub fn whole(&self, at: [u32; 2], check: Check) -> Result<Option<SlideRecord>, Error> {
        self.recorded(&record_name(at), check)
    }

    pub(super) fn recorded(&self, name: &str, check: Check) -> Result<Option<SlideRecord>, Error> {
        let Some(record) = self.record(name)? else { return Ok(None) };
        Ok(self.folder.first_flaw(&record.files, check)?.is_none().then_some(record))
    }

    /// A record, if it is there and of this slide.
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

    /// The documents of the image, by their paths in the slide's folder.
    pub(super) fn documents(&self) -> Result<Vec<(String, Vec<u8>)>, Error> {
        self.forms.documents(&self.head).map_err(|error| Error::folder(self.path(), error.to_string()))
    }

    /// Shards that are not whole.
    ///
    /// # Errors
    /// If the system refuses to tell.
    pub fn missing(&self, check: Check) -> Result<Vec<[u32; 2]>, Error> {
        let mut missing = Vec::new();
        for at in self.all() {
            if self.whole(at, check)?.is_none() {
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

/// Looks through the middle of the deposit, or where the slide is nearest to it: what a recipe asks too much of shows there first.
fn look_at_the_middle(slide: &Slide) -> Result<(), Error> {
    let (side, size, deposit_um) = (slide.side_px(), slide.size_px(), slide.deposit_um());
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place on the slide")]
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

/// The name of a shard: its row and its column.
pub(super) fn name_of([column, row]: [u32; 2]) -> String {
    format!("{row:04}-{column:04}")
}

/// The place of a shard in an array, in a plane.
pub(super) fn place([column, row]: [u32; 2], plane: usize) -> Shard {
    Shard { z: plane, y: row as usize, x: column as usize }
}
