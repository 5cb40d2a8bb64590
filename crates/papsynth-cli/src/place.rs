//! Where a data set lies: a folder, or an object store.

use std::path::Path;

use papsynth_dataset::Home;

use crate::args::Verb;
use crate::exit::Failure;

/// An address where only folders are known would become a folder of that name, and so would one that is mistyped.
pub(crate) fn check(verb: &Verb, words: impl IntoIterator<Item = std::ffi::OsString>) -> Result<(), Failure> {
    let words: Vec<_> = words.into_iter().collect();
    if let Some((word, address)) = words.iter().find_map(|word| Some((word, mistyped(word.to_str()?)?))) {
        let message = format!("{}: begins as an address of an object store and is none", word.display());
        let help = format!("write {address} for an object store, ./{} for a folder", word.display());
        return Err(Failure::wrong(message, help));
    }
    if matches!(
        verb,
        Verb::Generate(_) | Verb::Status(_) | Verb::Merge(_) | Verb::Verify(_) | Verb::Clean(_) | Verb::Submit(_)
    ) {
        return Ok(());
    }
    match words.into_iter().find(|word| Home::is_address(Path::new(word))) {
        Some(word) => {
            let message = format!("{}: a folder or file is wanted here", Path::new(&word).display());
            let help = "generate, status, merge, verify and clean work on object stores";
            Err(Failure::wrong(message, help))
        }
        None => Ok(()),
    }
}

/// The address of an object store that was meant by one with too few strokes.
fn mistyped(word: &str) -> Option<String> {
    let (scheme, rest) = word.split_once(":/")?;
    let is_store = matches!(scheme, "s3" | "gs" | "az") && !rest.starts_with('/');
    is_store.then(|| format!("{scheme}://{rest}"))
}
