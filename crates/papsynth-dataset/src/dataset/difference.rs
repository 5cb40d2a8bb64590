//! In what the recipe of a run differs from the one that a folder was begun with.

use std::collections::BTreeSet;
use std::fs;

use crate::files::Folder;
use crate::formats::names;

/// Where the recipe in the folder first differs, in brackets; nothing where that cannot be told.
pub(crate) fn of_recipe(folder: &Folder, recipe: &str) -> String {
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
