//! The folder of a data set: begun, resumed, completed.

use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::Path;

use papsynth::key::STREAM_VERSION;
use papsynth::model::Model;
use papsynth::recipe::Recipe;
use papsynth::scene::Scene;

use crate::coco::{Category, categories};
use crate::error::{Error, Problem};
use crate::files::{Folder, is_temporary, sha256};
use crate::frame_writer::FrameWriter;
use crate::layout;
use crate::merge;
use crate::read::{self, InputFile};
use crate::record::{Check, FrameRecord, Identity, Manifest};

pub use crate::merge::Summary;

/// Largest record of a frame that is read back.
const RECORD_BYTES: u64 = 1 << 26;

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
}

/// A data set in a folder.
///
/// Frames may be written in any order, by several threads, and by several processes; each is whole when its record
/// (`frames/N.json`) is there. Nothing outside the folder is touched.
#[derive(Debug)]
pub struct Dataset {
    pub(crate) folder: Folder,
    pub(crate) identity: Identity,
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
    pub fn create_or_resume(path: &Path, info: &DatasetInfo) -> Result<Self, Error> {
        let (recipe, model) = (info.recipe.to_toml(), info.model.to_json());
        let identity = Identity {
            seed: info.seed,
            stream_version: STREAM_VERSION,
            recipe_version: info.recipe.version,
            model_version: info.model.version,
            recipe_sha256: sha256(recipe.as_bytes()),
            model_sha256: sha256(model.as_bytes()),
        };
        let folder = Folder::new(path);
        let map = info.map.map(|file| file.name.clone());
        let dataset = Self { folder, identity, categories: categories(info.recipe), map };
        match stranger(path)? {
            None => merge::write_manifest(&dataset, &[], &[]).map(|_| ())?,
            Some(_) if dataset.folder.path(layout::MANIFEST).exists() => dataset.compare(&recipe)?,
            Some(name) => {
                return Err(Error::Folder {
                    path: path.to_owned(),
                    message: format!(
                        "the folder holds something else (`{name}`) and no data set; choose another, or a new one"
                    ),
                });
            }
        }
        for name in layout::FOLDERS.into_iter().chain([""]) {
            dataset.folder.sweep(name)?;
        }
        let kept = info.map.map(|file| (file.name.as_str(), &file.bytes[..]));
        for (name, bytes) in
            [(layout::RECIPE, recipe.as_bytes()), (layout::MODEL, model.as_bytes())].into_iter().chain(kept)
        {
            dataset.folder.keep(name, bytes)?;
        }
        Ok(dataset)
    }

    /// Where it lies.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.root()
    }

    /// What it is made from.
    #[must_use]
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Whether a frame is whole: its record is there, is of this data set, and all its files are as it says.
    ///
    /// # Errors
    /// If the system refuses to tell.
    pub fn is_whole(&self, index: u64, check: Check) -> Result<bool, Error> {
        Ok(whole_record(&self.folder, &self.identity, index, check)?.is_ok())
    }

    /// Whether [`finish`](Self::finish) has merged all frames that are recorded, and its files are still there.
    ///
    /// # Errors
    /// If the system refuses to tell.
    pub fn is_finished(&self) -> Result<bool, Error> {
        let manifest = read_manifest(&self.folder)?;
        if manifest.frames == 0 || manifest.frames != recorded_frames(&self.folder)?.len() as u64 {
            return Ok(false);
        }
        for file in &manifest.files {
            if self.folder.flaw(file, Check::Sizes)?.is_some() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Writes the frame of a scene, whose planes will follow one by one.
    ///
    /// # Errors
    /// If the scene is not one of this data set, or the system refuses.
    pub fn frame_writer(&self, scene: &Scene) -> Result<FrameWriter<'_>, Error> {
        FrameWriter::new(self, scene)
    }

    /// Merges what is known of all whole frames into `objects.csv`, `coco.json`, `contact-sheet.png` and
    /// `manifest.json`, one frame at a time in the order of their indices. What is there already and the same is left untouched.
    ///
    /// # Errors
    /// If a file of a frame cannot be read any more, or the system refuses.
    pub fn finish(&self) -> Result<Summary, Error> {
        merge::merge(self)
    }

    /// The data set that lies in the folder must be this one.
    fn compare(&self, recipe: &str) -> Result<(), Error> {
        let there = read_manifest(&self.folder)?.identity;
        let here = &self.identity;
        let difference = if there.stream_version != here.stream_version {
            Some(format!("is of stream version {}, this program writes {}", there.stream_version, here.stream_version))
        } else if there.recipe_sha256 != here.recipe_sha256 {
            Some(format!("is of another recipe{}", self.first_difference(recipe)))
        } else if there.model_sha256 != here.model_sha256 {
            Some("is of another model".to_owned())
        } else if there.seed != here.seed {
            Some(format!("is of seed {}, not {}", there.seed, here.seed))
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

    /// Where the recipe in the folder first differs.
    fn first_difference(&self, recipe: &str) -> String {
        let Ok(there) = fs::read_to_string(self.folder.path(layout::RECIPE)) else { return String::new() };
        let mut section = "";
        for (there, here) in there.lines().zip(recipe.lines()) {
            if there != here {
                return format!(
                    " ({section}{}`{there}` there, `{here}` here)",
                    if section.is_empty() { "" } else { ": " }
                );
            }
            if here.starts_with('[') {
                section = here;
            }
        }
        String::new()
    }
}

/// Something in a folder, if it is there and not empty. What was never finished does not count.
fn stranger(path: &Path) -> Result<Option<String>, Error> {
    let entries = match fs::read_dir(path) {
        Ok(entries) => entries,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(e) if e.kind() == io::ErrorKind::NotADirectory => {
            return Err(Error::Folder { path: path.to_owned(), message: "is a file; a folder is wanted".to_owned() });
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

/// The manifest in a folder.
pub(crate) fn read_manifest(folder: &Folder) -> Result<Manifest, Error> {
    let path = folder.path(layout::MANIFEST);
    let file = File::open(&path).map_err(|e| match e.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => Error::Folder {
            path: folder.root().to_owned(),
            message: "holds no data set: there is no manifest.json".to_owned(),
        },
        _ => Error::io("read", &path)(e),
    })?;
    Manifest::from_reader(BufReader::new(file)).map_err(|problem| Error::Input { path, problem })
}

/// The record of a frame; a missing one is an [`Problem::Missing`].
pub(crate) fn read_record(folder: &Folder, index: u64) -> Result<FrameRecord, Error> {
    let path = folder.path(&layout::record(index));
    let record = FrameRecord::from_json(&read::bytes(&path, RECORD_BYTES)?).map_err(Error::input(&path))?;
    if record.summary.index != index {
        let message = format!("is the record of frame {}", record.summary.index);
        return Err(Error::input(&path)(Problem::Broken { format: "JSON", message }));
    }
    Ok(record)
}

/// The record of a frame that is whole, or what it lacks.
pub(crate) fn whole_record(
    folder: &Folder,
    identity: &Identity,
    index: u64,
    check: Check,
) -> Result<Result<FrameRecord, String>, Error> {
    let record = match read_record(folder, index) {
        Ok(record) => record,
        Err(Error::Input { problem, .. }) => return Ok(Err(format!("{}: {problem}", layout::record(index)))),
        Err(failure) => return Err(failure),
    };
    if record.identity != *identity {
        return Ok(Err(format!("{} is of another data set", layout::record(index))));
    }
    for file in &record.files {
        if let Some(flaw) = folder.flaw(file, check)? {
            return Ok(Err(flaw));
        }
    }
    Ok(Ok(record))
}

/// Indices of all frames with a record, in order.
pub(crate) fn recorded_frames(folder: &Folder) -> Result<Vec<u64>, Error> {
    let path = folder.path(layout::FRAMES);
    let entries = match fs::read_dir(&path) {
        Ok(entries) => entries,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(e) => return Err(Error::io("read", &path)(e)),
    };
    let mut found = Vec::new();
    for entry in entries {
        let name = entry.map_err(Error::io("read", &path))?.file_name();
        found.extend(name.to_str().and_then(layout::index_of_record));
    }
    found.sort_unstable();
    Ok(found)
}
