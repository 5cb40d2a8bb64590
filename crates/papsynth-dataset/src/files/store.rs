//! Where a data set lies: a folder, or an object store.

use std::collections::BTreeMap;
use std::fmt::{self, Debug, Formatter};
use std::fs;
use std::hash::{BuildHasher, RandomState};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::Error;

/// Keeps whole files under names, such as a bucket of an object store. There is nothing to rename: a file appears whole by being put, or not at all.
///
/// Names are relative, with `/` between their parts, as those of the files of a data set.
pub trait Store: Send + Sync {
    /// Where it is, for messages: `s3://bucket/prefix`.
    fn url(&self) -> String;

    /// Size of a file; none if there is no such file.
    ///
    /// # Errors
    /// If the store does not answer.
    fn size(&self, name: &str) -> io::Result<Option<u64>>;

    /// Copies a file to a path and says whether there is one.
    ///
    /// # Errors
    /// If the store does not answer, or the file cannot be written.
    fn get(&self, name: &str, to: &Path) -> io::Result<bool>;

    /// Puts a file there, whole, in place of a former one.
    ///
    /// # Errors
    /// If the store does not take it; then there is no such file, or still the former one.
    fn put(&self, name: &str, from: &Path) -> io::Result<()>;

    /// Removes a file, if there is one.
    ///
    /// # Errors
    /// If the store does not answer.
    fn remove(&self, name: &str) -> io::Result<()>;

    /// Names and sizes of all files whose names begin with a folder's and `/`; of all, if that is empty.
    ///
    /// # Errors
    /// If the store does not answer.
    fn list(&self, folder: &str) -> io::Result<BTreeMap<String, u64>>;
}

/// Where a data set lies: a folder, or an object store.
///
/// Whatever takes a home takes a path too.
#[derive(Clone, Debug)]
pub struct Home {
    pub(crate) root: PathBuf,
    pub(crate) remote: Option<Arc<Remote>>,
}

impl Home {
    /// Whether a path is meant as the address of an object store, known or not: it begins with a scheme such as `s3://`.
    #[must_use]
    pub fn is_address(path: &Path) -> bool {
        let scheme = path.to_str().and_then(|text| text.split_once("://")).map(|(scheme, _)| scheme);
        scheme
            .is_some_and(|scheme| !scheme.is_empty() && scheme.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'+'))
    }

    /// A data set in an object store. Files are written and read in a folder of their own below the system's folder for temporary files
    /// (`TMPDIR`), which holds as much as the shards that are made at once and vanishes with the last use of this home.
    ///
    /// # Errors
    /// If that folder cannot be made.
    pub fn in_store(store: impl Store + 'static) -> Result<Self, Error> {
        let unique = RandomState::new().hash_one(std::process::id());
        let root = std::env::temp_dir().join(format!("papsynth-{unique:016x}"));
        fs::create_dir_all(&root).map_err(Error::io("write", &root))?;
        let remote = Remote { url: store.url(), store: Box::new(store), scratch: root.clone() };
        Ok(Self { root, remote: Some(Arc::new(remote)) })
    }
}

impl<P: AsRef<Path> + ?Sized> From<&P> for Home {
    fn from(folder: &P) -> Self {
        Self { root: folder.as_ref().to_owned(), remote: None }
    }
}

impl From<&Home> for Home {
    fn from(home: &Home) -> Self {
        home.clone()
    }
}

/// An object store, and the folder where its files are worked on.
pub(crate) struct Remote {
    store: Box<dyn Store>,
    url: String,
    scratch: PathBuf,
}

impl Remote {
    pub(crate) fn shown(&self, name: &str) -> PathBuf {
        PathBuf::from(format!("{}/{name}", self.url))
    }

    /// A path in the folder for temporary files as one in the store; another stays as it is.
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

    /// Copies a file to a path below the folder for temporary files.
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
        // What stays behind is in the folder for temporary files.
        let _ = fs::remove_dir_all(&self.scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_told_from_folders() {
        for address in ["s3://bucket/a", "gs://b/c", "ftp://x"] {
            assert!(Home::is_address(Path::new(address)), "{address}");
        }
        for folder in ["out", "/a/b", "C:\\out", "a b://c", "://x", "s3:/a"] {
            assert!(!Home::is_address(Path::new(folder)), "{folder}");
        }
    }
}
