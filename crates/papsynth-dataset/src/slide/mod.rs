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
mod read;
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
use crate::difference;
use crate::error::Error;
use crate::files::Folder;
use crate::layout;
use crate::nested;
use crate::record::{Check, FileRecord, Identity};

pub use finish::Finished;
pub use record::{SlideHead, SlideRecord};
pub use shard::{SlideProgress, SlideRun};

use document::Forms;
use record::RECORD_BYTES;

/// Name of the file that says what a slide is made from.
const HEAD: &str = crate::nested::SLIDE[0];

/// Name of the record of what was added at the end.
const UPPER: &str = "upper.json";

/// Names of the small picture and of the card.
const THUMBNAIL: &str = "thumbnail.png";
const CARD: &str = "README.md";

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
    /// Begins a slide in a folder that is empty or not there yet, or goes on with the one in it. Where `slide.json` is lost or damaged, the
    /// records of shards tell whether it is this one.
    ///
    /// # Errors
    /// If the folder holds something else, or a slide of another recipe, model, seed, number, stream version or shard size, objects in the
    /// middle of the deposit reach farther than `scan.reach_um`, or the system refuses.
    pub fn create_or_resume(path: &Path, slide: &Slide, info: &SlideInfo) -> Result<Self, Error> {
        let (identity, recipe, model) = Identity::of(info.recipe, info.model, info.seed);
        let head = SlideHead::new(identity, slide, info);
        if info.objects_parquet && !crate::parquet::IS_HERE {
            return Err(crate::formats::missing("the table of objects as Parquet", "parquet", path));
        }
        let forms = Forms::new(&head).map_err(|message| wrong(path, message))?;
        let set = Self { folder: Folder::new(path), head, forms };
        let text = set.head.to_json();
        match stranger(&set.folder)? {
            // Of several that begin at once one is the first.
            None => {
                nested::refuse(&set.folder)?;
                look_at_the_middle(slide)?;
                if !set.folder.write_unless_there(HEAD, |out| out.bytes(&text))? {
                    set.compare_or_restore(&recipe)?;
                }
            }
            Some(_) if Self::is_in(path) => set.compare_or_restore(&recipe)?,
            Some(name) => {
                let message =
                    format!("the folder holds something else (`{name}`) and no slide; choose another, or a new one");
                return Err(wrong(path, message));
            }
        }
        set.folder.sweep()?;
        set.folder.keep(HEAD, &text)?;
        set.folder.keep(layout::RECIPE, recipe.as_bytes())?;
        set.folder.keep(layout::MODEL, model.as_bytes())?;
        for (name, bytes) in set.documents()? {
            set.folder.keep(&name, &bytes)?;
        }
        Ok(set)
    }

    /// The slide in the folder must be this one.
    fn compare_or_restore(&self, recipe: &str) -> Result<(), Error> {
        let found = match SlideHead::read(&self.folder) {
            Err(Error::Input { .. }) if self.is_recorded()? => return Ok(()),
            Err(Error::Input { problem, .. }) if !self.folder.names_in(layout::SHARDS)?.is_empty() => {
                let message = format!(
                    "its {HEAD} is lost or damaged ({problem}), and its shards are of another recipe, model, seed, size or number; give what it was \
                     begun with"
                );
                return Err(wrong(self.path(), message));
            }
            found => found?,
        };
        let Some(what) = found.differs(&self.head) else { return Ok(()) };
        let same_recipe = found.identity.recipe_sha256 == self.head.identity.recipe_sha256;
        let field = if same_recipe { String::new() } else { difference::of_recipe(&self.folder, recipe) };
        let message =
            format!("holds a slide of another {what}{field}; choose another folder, or give what it was begun with");
        Err(wrong(self.path(), message))
    }

    /// Whether something in the folder is recorded as part of this slide.
    fn is_recorded(&self) -> Result<bool, Error> {
        let shards = self.folder.names_in(layout::SHARDS)?.into_iter().map(|name| format!("{}/{name}", layout::SHARDS));
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
        let forms = Forms::new(&head).map_err(|message| wrong(&folder.path(HEAD), message))?;
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

fn record_name([column, row]: [u32; 2]) -> String {
    format!("{}/{}.json", layout::SHARDS, name_of([column, row]))
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

#[cfg(test)]
mod tests {
    use std::io;
    use std::sync::atomic::AtomicBool;

    use papsynth::recipe::Preset;
    use papsynth::{Engine, Inputs, Threads};

    use super::*;
    use crate::files::fault;
    use crate::generate::Share;
    use crate::support::{Scratch, contents};

    #[test]
    fn wherever_the_disk_fails_no_file_is_partial_and_the_next_run_completes_the_slide() {
        let mut recipe = Preset::Sparse.recipe();
        (recipe.scan.width_px, recipe.scan.height_px, recipe.scan.frame_px) = (600, 64, 256);
        recipe.cells.clear();
        let model = Model::builtin();
        let engine = Engine::new(&recipe, &model, &Inputs::default()).unwrap();
        let slide = engine.slide(1, 0).unwrap();
        let info = SlideInfo {
            recipe: &recipe,
            model: &model,
            seed: 1,
            shard_px: 512,
            objects_parquet: crate::parquet::IS_HERE,
        };
        let make = |path: &Path| {
            let set = SlideSet::create_or_resume(path, &slide, &info)?;
            let stop = AtomicBool::new(false);
            let run = SlideRun { share: Share::ALL, threads: Threads::One, check: Check::Sizes, stop: &stop };
            set.make(&slide, &run, &|_| ())?;
            set.finish(Check::Sizes)
        };
        let good = Scratch::new("slide-faults-none");
        make(good.path()).unwrap();
        let expected = contents(good.path());
        let mut failures = 0;
        for passed in (0..60).chain((60..).step_by(7)) {
            let scratch = Scratch::new("slide-faults");
            let kinds = [io::ErrorKind::StorageFull, io::ErrorKind::PermissionDenied, io::ErrorKind::Other];
            fault::KIND.set(kinds[failures % 3]);
            fault::LEFT.set(Some(passed));
            let result = make(scratch.path());
            fault::LEFT.set(None);
            let Err(error) = result else { break };
            failures += 1;
            assert!(error.is_io() && error.to_string().contains(&*scratch.path().to_string_lossy()), "{error}");
            let there = contents(scratch.path());
            assert!(there.iter().all(|file| expected.contains(file)), "after {passed} calls");
            make(scratch.path()).unwrap();
            assert_eq!(contents(scratch.path()), expected, "after {passed} calls");
        }
        assert!(failures > 60, "{failures}");
    }
}
