//! Whole slides on the disk: an OME-Zarr image with labels, written shard by shard by whoever has time, and closed at the end.
//!
//! | file | content |
//! |---|---|
//! | `slide.json` | what the slide is made from, and how it is cut |
//! | `recipe.toml`, `model.json` | what to make it again with |
//! | `slide.ome.zarr/` | the picture and its labels: front-most cytoplasm, nucleus and debris, and the number of layers |
//! | `objects/ROW-COLUMN.csv`, `.parquet`, `.geojson` | every object whose middle lies in a shard: numbers, mask, outline |
//! | `shards/ROW-COLUMN.json` | files of a shard with sizes and hashes, written last: the shard is whole |
//! | `upper.json` | the same of what [`SlideSet::finish`] adds: the upper levels, `thumbnail.png`, `README.md` |

mod document;
mod finish;
mod objects;
mod record;
mod shard;
mod verify;

use std::fs;
use std::io::Write;
use std::path::Path;

use papsynth::Slide;
use papsynth::model::Model;
use papsynth::recipe::Recipe;
use papsynth_zarr::Shard;

use crate::dataset::stranger;
use crate::error::Error;
use crate::files::Folder;
use crate::layout;
use crate::record::{Check, FileRecord, Identity};

pub use finish::Finished;
pub use record::{SlideHead, SlideRecord};
pub use shard::{SlideProgress, SlideRun};
pub use verify::SlideFinding;

use document::Forms;
use record::RECORD_BYTES;

/// Name of the file that says what a slide is made from.
const HEAD: &str = "slide.json";

/// Name of the record of what was added at the end.
const UPPER: &str = "upper.json";

/// Folder of the image.
const IMAGE: &str = "slide.ome.zarr";

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

/// A slide in a folder. Shards may be written in any order, by several processes; nothing outside the folder is touched.
#[derive(Debug)]
pub struct SlideSet {
    folder: Folder,
    head: SlideHead,
    forms: Forms,
}

impl SlideSet {
    /// Begins a slide in a folder that is empty or not there yet, or goes on with the one in it.
    ///
    /// # Errors
    /// If the folder holds something else, or a slide of another recipe, model, seed, number, stream version or shard size, or the
    /// system refuses.
    pub fn create_or_resume(path: &Path, slide: &Slide, info: &SlideInfo) -> Result<Self, Error> {
        let (identity, recipe, model) = Identity::of(info.recipe, info.model, info.seed);
        let head = SlideHead::new(identity, slide, info);
        if info.objects_parquet && !crate::parquet::IS_HERE {
            return Err(crate::formats::missing("the table of objects as Parquet", "parquet", path));
        }
        let folder = Folder::new(path);
        let forms = Forms::new(&head).map_err(|message| wrong(path, message))?;
        if folder.path(HEAD).exists() {
            let found = SlideHead::read(&folder)?;
            if let Some(what) = found.differs(&head) {
                return Err(wrong(
                    path,
                    format!("holds a slide of another {what}; choose another folder, or give what it was begun with"),
                ));
            }
        } else if let Some(name) = stranger(&folder)? {
            return Err(wrong(
                path,
                format!("the folder holds something else (`{name}`) and no slide; choose another, or a new one"),
            ));
        }
        let set = Self { folder, head, forms };
        set.folder.sweep()?;
        set.folder.keep(layout::RECIPE, recipe.as_bytes())?;
        set.folder.keep(layout::MODEL, model.as_bytes())?;
        for (name, bytes) in set.documents()? {
            set.folder.keep(&name, &bytes)?;
        }
        set.folder.keep(HEAD, &set.head.to_json())?;
        Ok(set)
    }

    /// The slide that lies in a folder.
    ///
    /// # Errors
    /// If there is none, or the system refuses to read.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let folder = Folder::new(path);
        let head = SlideHead::read(&folder)?;
        let forms = Forms::new(&head).map_err(|message| wrong(&folder.path(HEAD), message))?;
        Ok(Self { folder, head, forms })
    }

    /// Whether a folder holds a slide.
    #[must_use]
    pub fn is_in(path: &Path) -> bool {
        path.join(HEAD).is_file()
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

    fn recorded(&self, name: &str, check: Check) -> Result<Option<SlideRecord>, Error> {
        let Some(record) = self.record(name)? else { return Ok(None) };
        for file in &record.files {
            if self.folder.flaw(file, check)?.is_some() {
                return Ok(None);
            }
        }
        Ok(Some(record))
    }

    /// A record, if it is there and of this slide.
    fn record(&self, name: &str) -> Result<Option<SlideRecord>, Error> {
        let path = self.folder.path(name);
        let bytes = match fs::metadata(&path) {
            Ok(found) if found.len() > RECORD_BYTES => return Ok(None),
            Ok(_) => fs::read(&path).map_err(Error::io("read", &path))?,
            Err(_) => return Ok(None),
        };
        let record = SlideRecord::from_json(&bytes).ok();
        Ok(record.filter(|record| record.head_sha256 == self.head.sha256()))
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

    fn write_record(&self, name: &str, files: Vec<FileRecord>, objects: u64) -> Result<(), Error> {
        self.folder.sync_names(&files)?;
        let record = SlideRecord::new(self.head.sha256(), files, objects);
        let written = self.folder.write(name, &record.to_json())?;
        self.folder.sync_names([&written])
    }

    /// Writes a file whose bytes come piece by piece.
    fn write_pieces(
        &self,
        name: &str,
        fill: impl FnOnce(&mut dyn Write) -> Result<(), Error>,
    ) -> Result<FileRecord, Error> {
        let pending = self.folder.pending(name)?;
        let mut handle = pending.handle()?;
        fill(&mut handle)?;
        drop(handle);
        pending.commit()
    }
}

fn record_name([column, row]: [u32; 2]) -> String {
    format!("shards/{}.json", name_of([column, row]))
}

/// The name of a shard: its row and its column.
fn name_of([column, row]: [u32; 2]) -> String {
    format!("{row:04}-{column:04}")
}

/// The place of a shard in an array, in a plane.
fn place([column, row]: [u32; 2], plane: usize) -> Shard {
    Shard { z: plane, y: row as usize, x: column as usize }
}

fn wrong(path: &Path, message: String) -> Error {
    Error::Folder { path: path.to_owned(), message }
}
