//! Data sets and slides within others.

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use super::record::FORMAT;
use crate::error::Error;
use crate::files::Folder;
use crate::formats::names;

/// What a slide's head is called, and the format it names.
pub(crate) const SLIDE: [&str; 2] = ["slide.json", "papsynth-slide"];

/// Refuses a folder that lies within a data set or a slide: of that its files would be strays.
pub(crate) fn refuse(folder: &Folder) -> Result<(), Error> {
    if folder.is_remote() {
        return Ok(());
    }
    match around(folder.root()) {
        Some(outer) => {
            let message =
                format!("lies within {}, which has files of its own; choose a folder beside it", outer.display());
            Err(Error::folder(folder.root(), message))
        }
        None => Ok(()),
    }
}

/// The data set or slide around a path, whether there is something at the path or not.
fn around(path: &Path) -> Option<PathBuf> {
    let path = std::path::absolute(path).ok()?;
    let (known, is_itself) = match fs::canonicalize(&path) {
        Ok(known) => (known, true),
        Err(_) => (path.ancestors().skip(1).find_map(|above| fs::canonicalize(above).ok())?, false),
    };
    known.ancestors().skip(usize::from(is_itself)).find(|folder| is_ours(folder)).map(Path::to_owned)
}

/// Whether a folder holds a data set or a slide.
fn is_ours(folder: &Path) -> bool {
    [[names::MANIFEST, FORMAT], SLIDE].iter().any(|[name, format]| {
        // The format stands at the beginning of what may be a long file.
        let mut begin = Vec::new();
        let read = File::open(folder.join(name)).and_then(|file| file.take(64).read_to_end(&mut begin));
        read.is_ok() && String::from_utf8_lossy(&begin).contains(&format!("\"{format}\""))
    })
}

/// The first of these files that is the head of a data set or slide in a folder below.
pub(crate) fn below<'n>(folder: &Folder, names: impl IntoIterator<Item = &'n String>) -> Option<PathBuf> {
    names.into_iter().find_map(|name| {
        let (inner, file) = name.rsplit_once('/')?;
        let inner = folder.path(inner);
        ([names::MANIFEST, SLIDE[0]].contains(&file) && is_ours(&inner)).then_some(inner)
    })
}
