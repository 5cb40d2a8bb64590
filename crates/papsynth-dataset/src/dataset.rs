//! The folder of a data set: begun, resumed, completed.

use std::fmt::{self, Formatter};
use std::fs;
use std::io;
use std::ops::Range;
use std::path::Path;

use papsynth::model::Model;
use papsynth::recipe::Recipe;

use crate::coco::{Category, categories};
use crate::contents;
use crate::difference;
use crate::error::{Error, Problem};
use crate::files::{Folder, is_temporary};
use crate::formats;
use crate::layout::{self, Layout};
use crate::merge;
use crate::nested;
use crate::read::{self, InputFile};
use crate::record::{Check, FileRecord, FrameSummary, Identity, Manifest, ShardRecord};
use crate::shard_writer::ShardWriter;
use crate::store::Home;

pub use crate::merge::Summary;

/// Largest record of a shard that is read back.
const RECORD_BYTES: u64 = 1 << 28;

/// What a data set is made from.
#[derive(Debug, Clone, Copy)]
pub struct DatasetInfo<'a> {
    /// The recipe, resolved: as the engine got it.
    pub recipe: &'a Recipe,
    /// The model.
    pub model: &'a Model,
    /// The seed.
    pub seed: u64,
    /// The map that the recipe names, if it names one: kept in the data set, so that it can be made again from there.
    pub map: Option<&'a InputFile>,
    /// How it lies in files.
    pub layout: &'a Layout,
}

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
    /// Name of the map that it keeps.
    pub(crate) map: Option<String>,
}

impl Dataset {
    /// Begins a data set in a folder that is empty or not there yet, or goes on with the one in it.
    ///
    /// # Errors
    /// If the folder holds something else, or a data set of another recipe, model, seed or stream version (the message
    /// says which), or the system refuses.
    pub fn create_or_resume(home: impl Into<Home>, info: &DatasetInfo) -> Result<Self, Error> {
        let (identity, recipe, model) = Identity::of(info.recipe, info.model, info.seed);
        let map = info.map.map(|file| file.name.clone());
        let kept = info.map.map(|file| (file.name.clone(), file.bytes.to_vec()));
        let given = [(layout::RECIPE, recipe.into_bytes()), (layout::MODEL, model.into_bytes())];
        let given = given.map(|(name, bytes)| (name.to_owned(), bytes)).into_iter().chain(kept).collect::<Vec<_>>();
        Self::begin(home, identity, info.layout.clone(), categories(info.recipe), map, &given)
    }

    /// The same of what is decided already; `given` is kept in the folder, the recipe first.
    pub(crate) fn begin(
        home: impl Into<Home>,
        identity: Identity,
        layout: Layout,
        categories: Vec<Category>,
        map: Option<String>,
        given: &[(String, Vec<u8>)],
    ) -> Result<Self, Error> {
        let folder = Folder::new(home);
        let path = &folder.shown();
        if path.as_os_str().is_empty() {
            let message = "the folder of the data set has no name; `.` is this one".to_owned();
            return Err(Error::Folder { path: path.to_owned(), message });
        }
        if layout.formats.is_empty() || layout.frames_per_shard == 0 {
            let message = "a data set wants at least one format, and one frame a shard".to_owned();
            return Err(Error::Folder { path: path.to_owned(), message });
        }
        if let Some((feature, what)) = layout.needs() {
            return Err(formats::missing(&what, feature, path));
        }
        let dataset = Self { folder, identity, layout, categories, map };
        dataset.begun(given).map_err(|error| dataset.folder.named(error))?;
        Ok(dataset)
    }

    fn begun(&self, given: &[(String, Vec<u8>)]) -> Result<(), Error> {
        let recipe = given.first().map(|(_, bytes)| String::from_utf8_lossy(bytes)).unwrap_or_default();
        let stranger = stranger(&self.folder)?;
        if stranger.is_none() {
            nested::refuse(&self.folder)?;
        }
        match stranger {
            // Of several that begin at once one is the first.
            None if merge::begin_manifest(self)? => {}
            None => self.compare_or_restore(&recipe)?,
            Some(_) if self.folder.has(layout::MANIFEST)? => self.compare_or_restore(&recipe)?,
            Some(_) if self.restore()? => {}
            Some(name) => {
                let message = match recorded_shards(&self.folder)?.is_empty() {
                    true => format!("the folder holds something else (`{name}`) and no data set; choose another, or a new one"),
                    false => "its manifest.json is lost, and its shards are of another recipe, model, seed or layout; give what it was made from".to_owned(),
                };
                return Err(Error::Folder { path: self.folder.root().to_owned(), message });
            }
        }
        self.folder.sweep()?;
        for (name, bytes) in given {
            self.folder.keep(name, bytes)?;
        }
        Ok(())
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

    /// The record of a shard if it is whole: its record is there, is of this data set, and all its files are as it says.
    ///
    /// # Errors
    /// If the system refuses to tell.
    pub fn whole(&self, shard: u64, check: Check) -> Result<Option<ShardRecord>, Error> {
        let whole = self.whole_or_flaw(shard, check).map_err(|error| self.folder.named(error));
        Ok(whole?.ok())
    }

    /// The same, or what the shard lacks.
    pub(crate) fn whole_or_flaw(&self, shard: u64, check: Check) -> Result<Result<ShardRecord, Flaw>, Error> {
        whole_record(&self.folder, &self.identity, &self.layout, &self.categories, shard, check)
    }

    /// Where the image of a frame lies and, of a stack, the one with everything in focus.
    pub(crate) fn images_of(&self, frame: &FrameSummary, shard: u64) -> [Option<String>; 2] {
        self.layout.images_of(self.identity.seed, shard, frame)
    }

    /// How many frames [`finish`](Self::finish) has merged; none of a data set that was only begun.
    ///
    /// # Errors
    /// If the manifest cannot be read.
    pub fn merged_frames(&self) -> Result<u64, Error> {
        Ok(Manifest::read(&self.folder)?.frames)
    }

    /// Whether [`finish`](Self::finish) has merged all frames that are recorded, and its files are still there.
    ///
    /// # Errors
    /// If the system refuses to tell.
    pub fn is_finished(&self) -> Result<bool, Error> {
        let manifest = Manifest::read(&self.folder)?;
        if manifest.frames == 0 || manifest.shards != recorded_shards(&self.folder)?.len() as u64 {
            return Ok(false);
        }
        for file in &manifest.files {
            if self.folder.flaw(file, Check::Sizes)?.is_some() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Writes a shard, whose frames will follow one by one.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn shard_writer(&self, shard: u64) -> Result<ShardWriter<'_>, Error> {
        ShardWriter::new(self, shard)
    }

    /// Merges what is known of all whole shards into `manifest.json`, the data card, `croissant.json` and `splits.csv`, `contact-sheet.png` and, where every frame
    /// is a shard, `objects.csv` and `coco.json`; one shard at a time in their order. What is there already and the same is left untouched.
    ///
    /// # Errors
    /// If a file of a shard cannot be read any more, or the system refuses.
    pub fn finish(&self) -> Result<Summary, Error> {
        let listed = Self { folder: self.folder.listed()?, ..self.clone() };
        merge::merge(&listed).map_err(|error| self.folder.named(error))
    }

    /// The data set that lies in a folder.
    ///
    /// # Errors
    /// If there is none, or the system refuses to read.
    pub fn open(home: impl Into<Home>) -> Result<Self, Error> {
        let folder = Folder::new(home);
        let manifest = Manifest::read(&folder).map_err(|error| folder.named(error))?;
        let own = [
            layout::RECIPE,
            layout::MODEL,
            layout::TABLE,
            layout::OBJECTS,
            layout::COCO,
            layout::SPLITS,
            layout::SHEET,
        ];
        let own = [own.as_slice(), &[layout::CARD, layout::CROISSANT]].concat();
        let is_map = |file: &&FileRecord| !file.path.contains('/') && !own.contains(&file.path.as_str());
        let map = manifest.files.iter().find(is_map).map(|file| file.path.clone());
        let Manifest { identity, layout, categories, .. } = manifest;
        Ok(Self { folder, identity, layout, categories, map })
    }

    /// As [`compare`](Self::compare); where the manifest was damaged, the shards say what the data set is.
    fn compare_or_restore(&self, recipe: &str) -> Result<(), Error> {
        match self.compare(recipe) {
            Err(damaged @ Error::Input { .. }) => {
                if self.restore()? {
                    Ok(())
                } else {
                    Err(damaged)
                }
            }
            compared => compared,
        }
    }

    /// Writes the manifest anew if the shards that are recorded are of this data set.
    fn restore(&self) -> Result<bool, Error> {
        for shard in recorded_shards(&self.folder)? {
            let Ok(record) = read_record(&self.folder, shard) else { continue };
            if record.identity == self.identity && record.layout == self.layout {
                merge::write_manifest(self, &[], &[], 0)?;
                return Ok(true);
            }
        }
        Ok(false)
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
            return Err(Error::Folder { path: self.path().to_owned(), message });
        }
        Ok(shards)
    }

    /// The data set that lies in the folder must be this one.
    fn compare(&self, recipe: &str) -> Result<(), Error> {
        let manifest = Manifest::read(&self.folder)?;
        let (there, here) = (manifest.identity, &self.identity);
        let difference = if there.stream_version != here.stream_version {
            Some(format!("is of stream version {}, this program writes {}", there.stream_version, here.stream_version))
        } else if there.recipe_sha256 != here.recipe_sha256 {
            Some(format!("is of another recipe{}", difference::of_recipe(&self.folder, recipe)))
        } else if there.model_sha256 != here.model_sha256 {
            Some("is of another model".to_owned())
        } else if there.seed != here.seed {
            Some(format!("is of seed {}, not {}", there.seed, here.seed))
        } else if manifest.layout != self.layout {
            Some(format!("lies in files in another way ({}, not {})", manifest.layout, self.layout))
        } else {
            None
        };
        difference.map_or(Ok(()), |difference| {
            Err(Error::Folder {
                path: self.path().to_owned(),
                message: format!(
                    "the data set in this folder {difference}; choose another folder, or what it was made from"
                ),
            })
        })
    }
}

/// Something in a folder, if it is there and not empty. What was never finished does not count.
pub(crate) fn stranger(folder: &Folder) -> Result<Option<String>, Error> {
    if folder.is_remote() {
        return Ok(folder.names()?.into_iter().next());
    }
    let path = folder.root();
    let entries = match fs::read_dir(path) {
        Ok(entries) => entries,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(e) if e.kind() == io::ErrorKind::NotADirectory => {
            let is =
                if path.exists() { "is a file; a folder is wanted" } else { "lies below a file; a folder is wanted" };
            return Err(Error::Folder { path: path.to_owned(), message: is.to_owned() });
        }
        Err(e) => return Err(Error::io("read", path)(e)),
    };
    for entry in entries {
        let name = entry.map_err(Error::io("read", path))?.file_name().to_string_lossy().into_owned();
        if !is_temporary(&name) {
            return Ok(Some(name));
        }
    }
    Ok(None)
}

/// The record of a shard; a missing one is an [`Problem::Missing`].
pub(crate) fn read_record(folder: &Folder, shard: u64) -> Result<ShardRecord, Error> {
    let path = folder.inside(&layout::record(shard))?;
    let record = ShardRecord::from_json(&read::bytes(&path, RECORD_BYTES)?).map_err(Error::input(&path))?;
    if record.shard != shard {
        let message = format!("is the record of shard {}", record.shard);
        return Err(Error::input(&path)(Problem::Broken { format: "JSON", message }));
    }
    Ok(record)
}

/// What is wrong with a file of a shard.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Flaw {
    pub(crate) path: String,
    pub(crate) message: String,
}

impl fmt::Display for Flaw {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.path, self.message)
    }
}

/// The record of a shard that is whole, or what it lacks.
pub(crate) fn whole_record(
    folder: &Folder,
    identity: &Identity,
    layout: &Layout,
    categories: &[Category],
    shard: u64,
    check: Check,
) -> Result<Result<ShardRecord, Flaw>, Error> {
    let flaw = |message: String| Ok(Err(Flaw { path: layout::record(shard), message }));
    let record = match read_record(folder, shard) {
        Ok(record) => record,
        Err(Error::Input { problem, .. }) => return flaw(problem.to_string()),
        Err(failure) => return Err(failure),
    };
    if record.identity != *identity || record.layout != *layout {
        return flaw("is of another data set".to_owned());
    }
    for file in &record.files {
        if let Some(message) = folder.flaw(file, check)? {
            return Ok(Err(Flaw { path: file.path.clone(), message }));
        }
    }
    if check == Check::Hashes
        && let Some(flaw) = contents::flaw(folder, layout, categories, &record)?
    {
        return Ok(Err(flaw));
    }
    Ok(Ok(record))
}

/// Numbers of all shards with a record, in order.
pub(crate) fn recorded_shards(folder: &Folder) -> Result<Vec<u64>, Error> {
    let names = folder.names_in(layout::SHARDS)?;
    let mut found: Vec<u64> = names.iter().filter_map(|name| layout::number_of_record(name)).collect();
    found.sort_unstable();
    Ok(found)
}
