//! Creation and resumption of data sets.

use std::sync::Arc;

use papsynth::model::Model;
use papsynth::recipe::Recipe;

use super::manifest::Manifest;
use super::merge::{begin_manifest, write_manifest};
use super::occupied::{any_content, recipe_difference, refuse_nested};
use super::record::{Identity, read_record, recorded_shards};
use super::rgb_image::Thumbnails;
use super::set::Dataset;
use crate::error::Error;
use crate::files::{Folder, Location};
use crate::formats::{Layout, names};
use crate::read::InputFile;
use crate::truth::{Category, categories};

/// The inputs of a data set.
#[derive(Debug, Clone, Copy)]
pub struct DatasetInfo<'a> {
    /// The resolved recipe: the one of the engine.
    pub recipe: &'a Recipe,
    /// The model.
    pub model: &'a Model,
    /// The seed.
    pub seed: u64,
    /// The map that the recipe names, if any. The data set stores a copy.
    pub map: Option<&'a InputFile>,
    /// The layout of the files.
    pub layout: &'a Layout,
}

impl Dataset {
    /// Creates a data set in a new or empty folder, or resumes the one in the folder.
    ///
    /// # Errors
    /// If the folder contains other files or a data set with another recipe, model, seed, stream version or layout (the
    /// message states the difference), or cannot be written.
    pub fn create_or_resume(location: impl Into<Location>, info: &DatasetInfo) -> Result<Self, Error> {
        let (identity, recipe, model) = Identity::of(info.recipe, info.model, info.seed);
        let map = info.map.map(|file| file.name.clone());
        let copy = info.map.map(|file| (file.name.clone(), file.bytes.to_vec()));
        let given = [(names::RECIPE, recipe.into_bytes()), (names::MODEL, model.into_bytes())];
        let given = given.map(|(name, bytes)| (name.to_owned(), bytes)).into_iter().chain(copy).collect::<Vec<_>>();
        Self::begin(location, identity, info.layout.clone(), categories(info.recipe), map, &given)
    }

    /// As [`create_or_resume`](Self::create_or_resume), with the identity and the input files `given`, the recipe
    /// first.
    pub(crate) fn begin(
        location: impl Into<Location>,
        identity: Identity,
        layout: Layout,
        categories: Vec<Category>,
        map: Option<String>,
        given: &[(String, Vec<u8>)],
    ) -> Result<Self, Error> {
        let folder = Folder::new(location);
        let path = &folder.shown();
        if path.as_os_str().is_empty() {
            return Err(Error::folder(path, "the path of the data set is empty; `.` is the current folder"));
        }
        if layout.formats.is_empty() || layout.frames_per_shard == 0 {
            return Err(Error::folder(path, "a data set needs at least 1 format and at least 1 frame a shard"));
        }
        if let Some(message) = layout.refusal() {
            return Err(Error::folder(path, message));
        }
        if let Some((feature, what)) = layout.needs() {
            return Err(Error::missing_feature(&what, feature, path));
        }
        let (trusted, thumbnails) = (Arc::default(), Thumbnails::default());
        let dataset = Self { folder, identity, layout, categories, map, trusted, thumbnails };
        dataset.create_or_compare(given).map_err(|error| dataset.folder.named(error))?;
        Ok(dataset)
    }

    fn create_or_compare(&self, given: &[(String, Vec<u8>)]) -> Result<(), Error> {
        let recipe = given.first().map(|(_, bytes)| String::from_utf8_lossy(bytes)).unwrap_or_default();
        let content = any_content(&self.folder)?;
        if content.is_none() {
            refuse_nested(&self.folder)?;
        }
        match content {
            // If several processes start at once, one of them writes the manifest.
            None if begin_manifest(self)? => {}
            None => self.compare_or_restore(&recipe)?,
            Some(_) if self.folder.has(names::MANIFEST)? => self.compare_or_restore(&recipe)?,
            Some(_) if self.restore()? => {}
            Some(name) => {
                let message = match recorded_shards(&self.folder)?.is_empty() {
                    true => format!("the folder contains `{name}` and no data set; choose a new or empty folder"),
                    false => {
                        "manifest.json is missing, and the shards have another recipe, model, seed or layout; use \
                              the original ones"
                            .to_owned()
                    }
                };
                return Err(Error::folder(self.folder.root(), message));
            }
        }
        self.folder.sweep(false)?;
        for (name, bytes) in given {
            self.folder.keep(name, bytes)?;
        }
        Ok(())
    }

    /// As [`compare`](Self::compare). If the manifest is damaged, compares the records of shards and restores it.
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

    /// Rewrites the manifest if a recorded shard belongs to this data set. Returns whether it did.
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

    /// Checks that the folder contains this data set.
    fn compare(&self, recipe: &str) -> Result<(), Error> {
        let manifest = Manifest::read(&self.folder)?;
        let (existing, given) = (manifest.identity, &self.identity);
        let difference = if existing.stream_version != given.stream_version {
            let (existing, given) = (existing.stream_version, given.stream_version);
            Some((
                format!("has stream version {existing}; this program writes {given}"),
                "use the release that wrote it",
            ))
        } else if existing.recipe_sha256 != given.recipe_sha256 {
            let difference = recipe_difference(&self.folder, &existing.recipe_sha256, recipe);
            Some((format!("has another recipe{difference}"), "use its recipe.toml"))
        } else if existing.model_sha256 != given.model_sha256 {
            Some(("has another model".to_owned(), "use its model.json"))
        } else if existing.seed != given.seed {
            Some((format!("has seed {}, not {}", existing.seed, given.seed), "use its seed"))
        } else {
            manifest.layout.difference(&self.layout)
        };
        difference.map_or(Ok(()), |(difference, remedy)| {
            let message = format!("the data set in this folder {difference}; choose another folder, or {remedy}");
            Err(Error::folder(self.path(), message))
        })
    }
}
