//! Checks of a folder for output: existing content, enclosing data sets or slides, differences of recipes.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::record::FORMAT;
use crate::bytes::sha256;
use crate::error::Error;
use crate::files::{Folder, is_desktop_file, is_temporary};
use crate::formats::names;

/// File name and format name of the head of a slide.
pub(crate) const SLIDE: [&str; 2] = ["slide.json", "papsynth-slide"];

/// Refuses a folder inside a data set or slide, in which its files would be untracked.
pub(crate) fn refuse_nested(folder: &Folder) -> Result<(), Error> {
    if folder.is_remote() {
        return Ok(());
    }
    match enclosing(folder.root()) {
        Some(outer) => {
            let message = format!("is inside the data set or slide {}; choose a folder outside it", outer.display());
            Err(Error::folder(folder.root(), message))
        }
        None => Ok(()),
    }
}

/// Returns the data set or slide that contains a path. The path itself need not exist.
fn enclosing(path: &Path) -> Option<PathBuf> {
    let path = std::path::absolute(path).ok()?;
    let (known, is_itself) = match fs::canonicalize(&path) {
        Ok(known) => (known, true),
        Err(_) => (path.ancestors().skip(1).find_map(|above| fs::canonicalize(above).ok())?, false),
    };
    known.ancestors().skip(usize::from(is_itself)).find(|folder| is_output(folder)).map(Path::to_owned)
}

/// Whether a folder is a data set or slide.
fn is_output(folder: &Path) -> bool {
    [[names::MANIFEST, FORMAT], SLIDE].iter().any(|[name, format]| {
        // The format is at the beginning of a file that may be long.
        let mut begin = Vec::new();
        let path = folder.join(name);
        // Opening a pipe could block forever.
        let read = path.is_file() && File::open(&path).and_then(|f| f.take(64).read_to_end(&mut begin)).is_ok();
        read && String::from_utf8_lossy(&begin).contains(&format!("\"{format}\""))
    })
}

/// Returns the first subfolder that is a data set or slide, from the names of files.
pub(crate) fn nested_below<'n>(folder: &Folder, names: impl IntoIterator<Item = &'n String>) -> Option<PathBuf> {
    names.into_iter().find_map(|name| {
        let (inner, file) = name.rsplit_once('/')?;
        let inner = folder.path(inner);
        ([names::MANIFEST, SLIDE[0]].contains(&file) && is_output(&inner)).then_some(inner)
    })
}

/// Returns the name of any file or folder in a folder, or `None` if it is empty or missing. Temporary files and files
/// of the desktop do not count.
pub(crate) fn any_content(folder: &Folder) -> Result<Option<String>, Error> {
    if folder.is_remote() {
        return Ok(folder.names()?.into_iter().next());
    }
    let path = folder.root();
    let entries = match fs::read_dir(path) {
        Ok(entries) => entries,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(e) if e.kind() == io::ErrorKind::NotADirectory => {
            let is = if path.exists() {
                "expected a folder, found a file"
            } else {
                "a parent of this path is a file; expected a folder"
            };
            return Err(Error::folder(path, is));
        }
        Err(e) => return Err(Error::io("read", path)(e)),
    };
    for entry in entries {
        let name = entry.map_err(Error::io("read", path))?.file_name().to_string_lossy().into_owned();
        if !is_temporary(&name) && !is_desktop_file(&name) {
            return Ok(Some(name));
        }
    }
    Ok(None)
}

/// Returns the first difference between the recipe in the folder and `recipe`, in parentheses; an empty string if it is
/// unknown. `expected` is the SHA-256 of the recipe at the time of generation.
pub(crate) fn recipe_difference(folder: &Folder, expected: &str, recipe: &str) -> String {
    let existing = folder.inside(names::RECIPE).ok().and_then(|path| fs::read_to_string(path).ok());
    if existing.as_ref().is_some_and(|existing| sha256(existing.as_bytes()) != expected) {
        return format!(" ({} was changed after generation)", names::RECIPE);
    }
    let read = |text: &str| toml::from_str::<toml::Table>(text).ok();
    let both = existing.and_then(|existing| read(&existing)).zip(read(recipe));
    // A setting that only one recipe has is the consequence of another one, such as `kind`.
    let difference = both.and_then(|(existing, given)| {
        difference("", &existing, &given, false).or_else(|| difference("", &existing, &given, true))
    });
    difference.map_or_else(String::new, |difference| format!(" ({difference})"))
}

/// Returns the first field in which two recipes differ, with its values; with `unset`, also a field of one of them.
fn difference(section: &str, existing: &toml::Table, given: &toml::Table, unset: bool) -> Option<String> {
    let names: BTreeSet<(bool, &String)> =
        existing.keys().chain(given.keys()).map(|name| (name != "kind", name)).collect();
    names.into_iter().find_map(|(_, name)| {
        let field = if section.is_empty() { name.clone() } else { format!("{section}.{name}") };
        match (existing.get(name), given.get(name)) {
            (Some(toml::Value::Table(existing)), Some(toml::Value::Table(given))) => {
                difference(&field, existing, given, unset)
            }
            (existing, given) if existing == given || (!unset && (existing.is_none() || given.is_none())) => None,
            (existing, given) => {
                let shown = |value: Option<&toml::Value>| value.map_or("unset".to_owned(), toml::Value::to_string);
                Some(format!(
                    "`{field}` is {} in the existing recipe and {} in the given one",
                    shown(existing),
                    shown(given)
                ))
            }
        }
    })
}
