//! Data sets begun and resumed.

use std::sync::Arc;

use papsynth::model::Model;
use papsynth::recipe::Recipe;

use super::manifest::Manifest;
use super::merge::{begin_manifest, write_manifest};
use super::record::{Identity, read_record, recorded_shards};
use super::set::Dataset;
use super::taken::{recipe_difference, refuse_nested, stranger};
use crate::error::Error;
use crate::files::{Folder, Home};
use crate::formats::{Layout, names};
use crate::read::InputFile;
use crate::truth::{Category, categories};

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
        let given = [(names::RECIPE, recipe.into_bytes()), (names::MODEL, model.into_bytes())];
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
            return Err(Error::folder(path, message));
        }
        if layout.formats.is_empty() || layout.frames_per_shard == 0 {
            let message = "a data set wants at least one format, and one frame a shard".to_owned();
            return Err(Error::folder(path, message));
        }
        if let Some((feature, what)) = layout.needs() {
            return Err(Error::missing_feature(&what, feature, path));
        }
        let dataset = Self { folder, identity, layout, categories, map, trusted: Arc::default() };
        dataset.begun(given).map_err(|error| dataset.folder.named(error))?;
        Ok(dataset)
    }

    fn begun(&self, given: &[(String, Vec<u8>)]) -> Result<(), Error> {
        let recipe = given.first().map(|(_, bytes)| String::from_utf8_lossy(bytes)).unwrap_or_default();
        let stranger = stranger(&self.folder)?;
        if stranger.is_none() {
            refuse_nested(&self.folder)?;
        }
        match stranger {
            // Of several that begin at once one is the first.
            None if begin_manifest(self)? => {}
            None => self.compare_or_restore(&recipe)?,
            Some(_) if self.folder.has(names::MANIFEST)? => self.compare_or_restore(&recipe)?,
            Some(_) if self.restore()? => {}
            Some(name) => {
                let message = match recorded_shards(&self.folder)?.is_empty() {
                    true => format!("the folder holds something else (`{name}`) and no data set; choose another, or a new one"),
                    false => "its manifest.json is lost, and its shards are of another recipe, model, seed or layout; give what it was made from".to_owned(),
                };
                return Err(Error::folder(self.folder.root(), message));
            }
        }
        self.folder.sweep()?;
        for (name, bytes) in given {
            self.folder.keep(name, bytes)?;
        }
        Ok(())
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
                write_manifest(self, &[], &[], 0)?;
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The data set that lies in the folder must be this one.
    fn compare(&self, recipe: &str) -> Result<(), Error> {
        let manifest = Manifest::read(&self.folder)?;
        let (there, here) = (manifest.identity, &self.identity);
        let difference = if there.stream_version != here.stream_version {
            Some(format!("is of stream version {}, this program writes {}", there.stream_version, here.stream_version))
        } else if there.recipe_sha256 != here.recipe_sha256 {
            Some(format!("is of another recipe{}", recipe_difference(&self.folder, recipe)))
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
            let message =
                format!("the data set in this folder {difference}; choose another folder, or what it was made from");
            Err(Error::folder(self.path(), message))
        })
    }
}
