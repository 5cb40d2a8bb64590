//! Locations of data sets: folders and object stores.

use std::collections::BTreeMap;
use std::fmt::{self, Debug, Formatter};
use std::fs;
use std::hash::{BuildHasher, RandomState};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::Error;

/// An object store, for example a bucket. [`put`](Self::put) is atomic: a file appears complete or not at all.
///
/// Names are relative paths with `/` between their parts.
pub trait Store: Send + Sync {
    /// Returns the address for messages: `s3://bucket/prefix`.
    fn url(&self) -> String;

    /// Returns the size of a file in bytes, or `None` if it does not exist.
    ///
    /// # Errors
    /// If the store does not respond.
    fn size(&self, name: &str) -> io::Result<Option<u64>>;

    /// Copies a file to a path. Returns whether the file exists.
    ///
    /// # Errors
    /// If the store does not respond, or the file cannot be written.
    fn get(&self, name: &str, to: &Path) -> io::Result<bool>;

    /// Uploads a file and replaces an existing one.
    ///
    /// # Errors
    /// If the store rejects it. An existing file is then unchanged.
    fn put(&self, name: &str, from: &Path) -> io::Result<()>;

    /// Removes a file if it exists.
    ///
    /// # Errors
    /// If the store does not respond.
    fn remove(&self, name: &str) -> io::Result<()>;

    /// Returns names and sizes of all files in a folder and its subfolders; of all files if `folder` is empty.
    ///
    /// # Errors
    /// If the store does not respond.
    fn list(&self, folder: &str) -> io::Result<BTreeMap<String, u64>>;
}

/// The location of a data set: a folder or an object store.
///
/// Paths convert into locations.
#[derive(Clone, Debug)]
pub struct Location {
    pub(crate) root: PathBuf,
    pub(crate) remote: Option<Arc<Remote>>,
}

impl Location {
    /// Whether a path is an address: it begins with a scheme such as `s3://`, supported or not.
    #[must_use]
    pub fn is_address(path: &Path) -> bool {
        let scheme = path.to_str().and_then(|text| text.split_once("://")).map(|(scheme, _)| scheme);
        scheme
            .is_some_and(|scheme| !scheme.is_empty() && scheme.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'+'))
    }

    /// A data set in an object store. Files are written and read in a new subfolder of the system's folder for
    /// temporary files (`TMPDIR`). It holds at most the shards in work and is removed when the last copy of this value
    /// is dropped.
    ///
    /// # Errors
    /// If that folder cannot be created.
    pub fn in_store(store: impl Store + 'static) -> Result<Self, Error> {
        let unique = RandomState::new().hash_one(std::process::id());
        let root = std::env::temp_dir().join(format!("papsynth-{unique:016x}"));
        fs::create_dir_all(&root).map_err(Error::io("write", &root))?;
        let remote = Remote { url: store.url(), store: Box::new(store), scratch: root.clone() };
        Ok(Self { root, remote: Some(Arc::new(remote)) })
    }
}

impl<P: AsRef<Path> + ?Sized> From<&P> for Location {
    fn from(folder: &P) -> Self {
        Self { root: folder.as_ref().to_owned(), remote: None }
    }
}

impl From<&Location> for Location {
    fn from(home: &Location) -> Self {
        home.clone()
    }
}

/// An object store with the local folder for copies of its files.
pub(crate) struct Remote {
    store: Box<dyn Store>,
    url: String,
    scratch: PathBuf,
}

impl Remote {
    pub(crate) fn shown(&self, name: &str) -> PathBuf {
        PathBuf::from(format!("{}/{name}", self.url))
    }

    /// Returns the address of a local copy. Other paths are returned unchanged.
    pub(crate) fn named(&self, path: &Path) -> PathBuf {
        match path.strip_prefix(&self.scratch) {
            Ok(below) if below.as_os_str().is_empty() => PathBuf::from(&self.url),
            Ok(below) => self.shown(&below.to_string_lossy()),
            Err(_) => path.to_owned(),
        }
    }

    pub(crate) fn size(&self, name: &str) -> Result<Option<u64>, Error> {
        self.store.size(name).map_err(Error::io("read", &self.shown(name)))
    }

    /// Copies a file to a path in the folder for temporary files.
    pub(crate) fn get(&self, name: &str, to: &Path) -> Result<bool, Error> {
        let folder = to.parent().unwrap_or(&self.scratch);
        fs::create_dir_all(folder).map_err(Error::io("write", folder))?;
        self.store.get(name, to).map_err(Error::io("read", &self.shown(name)))
    }

    pub(crate) fn put(&self, name: &str, from: &Path) -> Result<(), Error> {
        self.store.put(name, from).map_err(Error::io("write", &self.shown(name)))
    }

    pub(crate) fn remove(&self, name: &str) -> Result<(), Error> {
        self.store.remove(name).map_err(Error::io("remove", &self.shown(name)))
    }

    pub(crate) fn list(&self, folder: &str) -> Result<BTreeMap<String, u64>, Error> {
        self.store.list(folder).map_err(Error::io("read", &self.shown(folder)))
    }
}

impl Debug for Remote {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.url)
    }
}

impl Drop for Remote {
    fn drop(&mut self) {
        // Files that cannot be removed stay in the folder for temporary files.
        let _ = fs::remove_dir_all(&self.scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_and_folders_are_distinguished() {
        for address in ["s3://bucket/a", "gs://b/c", "ftp://x"] {
            assert!(Location::is_address(Path::new(address)), "{address}");
        }
        for folder in ["out", "/a/b", "C:\\out", "a b://c", "://x", "s3:/a"] {
            assert!(!Location::is_address(Path::new(folder)), "{folder}");
        }
    }
}
