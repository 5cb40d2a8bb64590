//! Atomic writes of files in folders and object stores.

#[cfg(feature = "cloud")]
mod cloud;
pub(crate) mod fault;
mod folder;
mod pending;
mod store;

#[cfg(feature = "cloud")]
pub use cloud::Bucket;
pub use folder::{Check, write_file};
pub(crate) use folder::{Folder, last_part};
pub use pending::FileRecord;
pub(crate) use pending::{Output, Pending, is_desktop_file, is_temporary};
pub use store::{Location, Store};

use std::path::Path;

use crate::error::Error;

impl Location {
    /// The location of a data set at a path, or at an address such as `s3://bucket/prefix` in a build with the feature
    /// `cloud`.
    ///
    /// # Errors
    /// If an address is not that of an object store, this build lacks the feature `cloud`, or the folder for temporary
    /// files cannot be created.
    pub fn at(path: &Path) -> Result<Self, Error> {
        if !Self::is_address(path) {
            return Ok(Self::from(path));
        }
        #[cfg(feature = "cloud")]
        return Self::in_store(Bucket::open(&path.to_string_lossy())?);
        #[cfg(not(feature = "cloud"))]
        Err(Error::folder(path, "object stores need a build of papsynth with `--features cloud`"))
    }
}
