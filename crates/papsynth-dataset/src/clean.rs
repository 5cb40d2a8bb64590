//! Removal of files that do not belong to a data set or slide.

use std::collections::BTreeSet;

use serde::Serialize;

use crate::dataset::{Manifest, named_map, nested_below, read_record, recorded_shards};
use crate::error::Error;
use crate::files::{Folder, Location, is_temporary, last_part};
use crate::formats::names;
#[cfg(feature = "zarr")]
use crate::slide::SlideSet;

/// The files that [`clean`] removed: paths relative to the data set, sorted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Cleaned {
    /// Temporary files of killed runs.
    pub temporary: Vec<String>,
    /// Untracked files: other files that do not belong to the data set.
    pub untracked: Vec<String>,
    /// Number of files of both kinds that were not removed: another process writes them, another user owns them, or
    /// their names are not UTF-8.
    pub skipped: u64,
}

/// Removes temporary files of killed runs from a data set or slide. With `untracked`, also removes every other file
/// that does not belong to it, and the folders that are then empty. Files of the desktop, such as `.DS_Store`, are
/// ignored.
///
/// # Errors
/// If there is no data set or slide, a file cannot be removed, or untracked files are unknown: a record cannot be read,
/// or the data set is not merged and other processes may still write.
pub fn clean(location: impl Into<Location>, untracked: bool) -> Result<Cleaned, Error> {
    let folder = Folder::new(location);
    clean_in(&folder, untracked, false).map_err(|error| folder.named(error))
}

/// Returns what [`clean`] would remove; removes nothing.
///
/// # Errors
/// As [`clean`].
pub fn cleanable(location: impl Into<Location>, untracked: bool) -> Result<Cleaned, Error> {
    let folder = Folder::new(location);
    clean_in(&folder, untracked, true).map_err(|error| folder.named(error))
}

fn clean_in(folder: &Folder, untracked: bool, is_dry_run: bool) -> Result<Cleaned, Error> {
    let owner = Owner::of(folder)?;
    let (temporary, skipped) = folder.sweep(is_dry_run)?;
    let mut cleaned = Cleaned { temporary, untracked: Vec::new(), skipped };
    if !untracked {
        return Ok(cleaned);
    }
    let own = owner.names(folder)?;
    let mut found = folder.names()?;
    // Another process still writes a temporary file that is left.
    found.retain(|name| !own.contains(name) && !is_temporary(last_part(name)));
    if let Some(inner) = nested_below(folder, &found) {
        let message = format!("contains another data set or slide in {}; move it elsewhere first", inner.display());
        return Err(Error::folder(folder.root(), message));
    }
    for name in found {
        if folder.is_remote() || folder.path(&name).symlink_metadata().is_ok() {
            if !is_dry_run {
                folder.remove(&name)?;
            }
            cleaned.untracked.push(name);
        } else {
            cleaned.skipped += 1;
        }
    }
    // An empty folder may have the name of a file of the data set.
    if !is_dry_run {
        folder.remove_empty()?;
    }
    Ok(cleaned)
}

/// The kind of output in a folder.
enum Owner {
    Dataset(Manifest),
    #[cfg(feature = "zarr")]
    Slide(SlideSet),
}

impl Owner {
    /// Returns the data set or slide in a folder.
    ///
    /// # Errors
    /// If there is none.
    fn of(folder: &Folder) -> Result<Self, Error> {
        #[cfg(feature = "zarr")]
        if !folder.is_remote() && SlideSet::is_in(folder.root()) {
            return SlideSet::open(folder.root()).map(Self::Slide);
        }
        Manifest::read(folder).map(Self::Dataset)
    }

    /// Returns the names of all its files.
    ///
    /// # Errors
    /// If it is not merged.
    fn names(&self, folder: &Folder) -> Result<BTreeSet<String>, Error> {
        let manifest = match self {
            Self::Dataset(manifest) => manifest,
            #[cfg(feature = "zarr")]
            Self::Slide(slide) => return slide.own_names(),
        };
        let shards = recorded_shards(folder)?;
        if shards.is_empty() || manifest.shards != shards.len() as u64 {
            let message = "untracked files can be removed only after `papsynth merge`";
            return Err(Error::folder(folder.root(), message));
        }
        let mut names: BTreeSet<String> = manifest.files.iter().map(|file| file.path.clone()).collect();
        names.insert(names::MANIFEST.to_owned());
        // Also if the manifest does not list it: without the map, the recipe cannot be used.
        names.extend(named_map(folder));
        for shard in shards {
            names.insert(names::record(shard));
            names.extend(read_record(folder, shard)?.files.into_iter().map(|file| file.path));
        }
        Ok(names)
    }
}
