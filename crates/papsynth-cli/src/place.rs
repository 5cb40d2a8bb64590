//! Where a data set lies: a folder, or an object store.

use std::path::Path;

use papsynth_dataset::Home;

use crate::args::Verb;
use crate::exit::{Complaint, Failure};

/// The data set at a path or an address.
#[cfg(feature = "cloud")]
pub(crate) fn home(path: &Path) -> Result<Home, Failure> {
    Ok(papsynth_cloud::Bucket::home(path)?)
}

/// The data set at a path.
#[cfg(not(feature = "cloud"))]
pub(crate) fn home(path: &Path) -> Result<Home, Failure> {
    match Home::is_address(path) {
        true => {
            let message = format!("{}: object stores need a build of papsynth with `--features cloud`", path.display());
            Err(Failure::input(Complaint::new(message)))
        }
        false => Ok(Home::from(path)),
    }
}

/// An address where only folders are known would become a folder of that name.
pub(crate) fn check(verb: &Verb, words: impl IntoIterator<Item = std::ffi::OsString>) -> Result<(), Failure> {
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
            Err(Failure::input(Complaint::new(message).help(help)))
        }
        None => Ok(()),
    }
}
