//! What lies in a data set or slide and does not belong there.

use std::collections::BTreeSet;

use serde::Serialize;

use crate::dataset::{Manifest, nested_below, read_record, recorded_shards};
use crate::error::Error;
use crate::files::{Folder, Home, is_temporary};
use crate::formats::names;
#[cfg(feature = "zarr")]
use crate::slide::SlideSet;

/// What [`clean`] took away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Cleaned {
    /// Files that runs which were killed left behind.
    pub temporary: u64,
    /// Other files that are none of the data set's.
    pub strays: u64,
    /// Files of both kinds that stay: somebody works on them, they are another user's, or their names are no UTF-8.
    pub stayed: u64,
}

/// Removes from a data set or a slide what killed runs left behind and, if wanted, everything else that is none of its files, with
/// the folders that are empty then.
///
/// # Errors
/// If there is neither, strays cannot be told (a record cannot be read, or the work of all shards is not closed yet, so that others may be
/// at it), or the system refuses.
pub fn clean(home: impl Into<Home>, strays: bool) -> Result<Cleaned, Error> {
    let folder = Folder::new(home);
    clean_in(&folder, strays).map_err(|error| folder.named(error))
}

fn clean_in(folder: &Folder, strays: bool) -> Result<Cleaned, Error> {
    let owner = Owner::of(folder)?;
    let [temporary, stayed] = folder.sweep()?;
    let mut cleaned = Cleaned { temporary, strays: 0, stayed };
    if !strays {
        return Ok(cleaned);
    }
    let own = owner.names(folder)?;
    let mut found = folder.names()?;
    // A temporary file that is still there is somebody's work.
    found.retain(|name| !own.contains(name) && !is_temporary(name.rsplit('/').next().unwrap_or(name)));
    if let Some(inner) = nested_below(folder, &found) {
        let message = format!("{} lies within and has files of its own; move it elsewhere first", inner.display());
        return Err(Error::folder(folder.root(), message));
    }
    for name in found {
        if folder.is_remote() || folder.path(&name).symlink_metadata().is_ok() {
            folder.remove(&name)?;
            cleaned.strays += 1;
        } else {
            cleaned.stayed += 1;
        }
    }
    // One may stand where a file belongs.
    folder.remove_empty()?;
    Ok(cleaned)
}

enum Owner {
    Dataset(Manifest),
    #[cfg(feature = "zarr")]
    Slide(SlideSet),
}

impl Owner {
    /// Of a folder that is none of ours there is no owner, which is an error.
    fn of(folder: &Folder) -> Result<Self, Error> {
        #[cfg(feature = "zarr")]
        if !folder.is_remote() && SlideSet::is_in(folder.root()) {
            return SlideSet::open(folder.root()).map(Self::Slide);
        }
        Manifest::read(folder).map(Self::Dataset)
    }

    /// The names of all its files, once its work is closed.
    fn names(&self, folder: &Folder) -> Result<BTreeSet<String>, Error> {
        let manifest = match self {
            Self::Dataset(manifest) => manifest,
            #[cfg(feature = "zarr")]
            Self::Slide(slide) => return slide.own_names(),
        };
        let shards = recorded_shards(folder)?;
        if shards.is_empty() || manifest.shards != shards.len() as u64 {
            let message =
                "what others are writing cannot be told from strays before `papsynth merge` has closed the data set";
            return Err(Error::folder(folder.root(), message));
        }
        let mut names: BTreeSet<String> = manifest.files.iter().map(|file| file.path.clone()).collect();
        names.insert(names::MANIFEST.to_owned());
        for shard in shards {
            names.insert(names::record(shard));
            names.extend(read_record(folder, shard)?.files.into_iter().map(|file| file.path));
        }
        Ok(names)
    }
}
