//! What a folder holds already: another data set or slide, one around it, or one of another recipe.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::record::FORMAT;
use crate::error::Error;
use crate::files::{Folder, is_temporary};
use crate::formats::names;

/// What a slide's head is called, and the format it names.
pub(crate) const SLIDE: [&str; 2] = ["slide.json", "papsynth-slide"];

/// Refuses a folder that lies within a data set or a slide: of that its files would be strays.
pub(crate) fn refuse_nested(folder: &Folder) -> Result<(), Error> {
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

fn is_ours(folder: &Path) -> bool {
    [[names::MANIFEST, FORMAT], SLIDE].iter().any(|[name, format]| {
        // The format stands at the beginning of what may be a long file.
        let mut begin = Vec::new();
        let read = File::open(folder.join(name)).and_then(|file| file.take(64).read_to_end(&mut begin));
        read.is_ok() && String::from_utf8_lossy(&begin).contains(&format!("\"{format}\""))
    })
}

/// The first of these files that is the head of a data set or slide in a folder below.
pub(crate) fn nested_below<'n>(folder: &Folder, names: impl IntoIterator<Item = &'n String>) -> Option<PathBuf> {
    names.into_iter().find_map(|name| {
        let (inner, file) = name.rsplit_once('/')?;
        let inner = folder.path(inner);
        ([names::MANIFEST, SLIDE[0]].contains(&file) && is_ours(&inner)).then_some(inner)
    })
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
            return Err(Error::folder(path, is));
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

/// Where the recipe in the folder first differs, in brackets; nothing where that cannot be told.
pub(crate) fn recipe_difference(folder: &Folder, recipe: &str) -> String {
    let there = folder.inside(names::RECIPE).ok().and_then(|path| fs::read_to_string(path).ok());
    let read = |text: &str| toml::from_str::<toml::Table>(text).ok();
    let both = there.and_then(|there| read(&there)).zip(read(recipe));
    let difference = both.and_then(|(there, here)| difference("", &there, &here));
    difference.map_or_else(String::new, |difference| format!(" ({difference})"))
}

/// The first field in which two recipes differ, and its values.
fn difference(section: &str, there: &toml::Table, here: &toml::Table) -> Option<String> {
    let names: BTreeSet<&String> = there.keys().chain(here.keys()).collect();
    names.into_iter().find_map(|name| {
        let field = if section.is_empty() { name.clone() } else { format!("{section}.{name}") };
        match (there.get(name), here.get(name)) {
            (Some(toml::Value::Table(there)), Some(toml::Value::Table(here))) => difference(&field, there, here),
            (there, here) if there == here => None,
            (there, here) => {
                let shown = |value: Option<&toml::Value>| value.map_or("nothing".to_owned(), toml::Value::to_string);
                Some(format!("`{field}` is {} there, {} here", shown(there), shown(here)))
            }
        }
    })
}
