//! A folder whose files are written atomically: a file gets its name when it is complete on the disk.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::fault;
use super::pending::{FileRecord, Output, Pending, is_desktop_file, is_temporary};
use super::store::{Location, Remote};
use crate::bytes::measure;
use crate::error::{Error, InputError};

/// The extent of a check of files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Check {
    /// Existence and size.
    Sizes,
    /// Existence, size and SHA-256; all files are read.
    Hashes,
}

/// Writes a file atomically: under a temporary name in the same folder, then synced to the disk and renamed.
///
/// # Errors
/// If the path is a folder or cannot be written. An existing file is then unchanged.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    if path.is_dir() {
        return Err(Error::io("write", path)(io::ErrorKind::IsADirectory.into()));
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Folder::new(folder).write(&name, bytes).map(|_| ())
}

/// Returns the entries of a folder; none if it does not exist.
fn entries(path: &Path) -> Result<Vec<fs::DirEntry>, Error> {
    match fs::read_dir(path) {
        Ok(entries) => entries.collect::<Result<_, _>>().map_err(Error::io("read", path)),
        Err(e) if is_absent(&e) => Ok(Vec::new()),
        Err(e) => Err(Error::io("read", path)(e)),
    }
}

/// Returns the part of a name after the last `/`.
pub(crate) fn last_part(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

fn is_absent(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory)
}

/// A folder whose files have relative names with `/` between folders. For a data set in an object store this is the
/// local folder of copies: committed files are uploaded, and files are downloaded before they are read.
#[derive(Debug, Clone)]
pub(crate) struct Folder {
    root: PathBuf,
    remote: Option<Arc<Remote>>,
    /// Names and sizes of the files in the store at one point in time.
    listing: Option<Arc<BTreeMap<String, u64>>>,
}

impl Folder {
    pub(crate) fn new(location: impl Into<Location>) -> Self {
        let Location { root, remote } = location.into();
        Self { root, remote, listing: None }
    }

    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    /// The folder or address, for messages.
    pub(crate) fn shown(&self) -> PathBuf {
        self.remote.as_ref().map_or_else(|| self.root.clone(), |remote| remote.named(&self.root))
    }

    /// Returns this folder with the sizes of all files in the store, requested at once instead of one by one.
    pub(crate) fn listed(&self) -> Result<Self, Error> {
        let listing = self.remote.as_ref().map(|remote| remote.list("")).transpose()?.map(Arc::new);
        Ok(Self { listing, ..self.clone() })
    }

    /// Returns the error with addresses in the store instead of paths of local copies.
    pub(crate) fn named(&self, error: Error) -> Error {
        let Some(remote) = &self.remote else { return error };
        match error {
            Error::Input { path, problem } => Error::Input { path: remote.named(&path), problem },
            Error::Io { action, path, source } => Error::Io { action, path: remote.named(&path), source },
            Error::Folder { path, message } => Error::Folder { path: remote.named(&path), message },
            other => other,
        }
    }

    pub(crate) fn is_remote(&self) -> bool {
        self.remote.is_some()
    }

    pub(crate) fn has(&self, name: &str) -> Result<bool, Error> {
        match &self.remote {
            Some(_) => Ok(self.size(name)?.is_some()),
            None => Ok(self.path(name).exists()),
        }
    }

    fn size(&self, name: &str) -> Result<Option<u64>, Error> {
        match (&self.listing, &self.remote) {
            (Some(listing), _) => Ok(listing.get(name).copied()),
            (None, Some(remote)) => remote.size(name),
            (None, None) => Ok(None),
        }
    }

    pub(crate) fn remove(&self, name: &str) -> Result<(), Error> {
        if let Some(remote) = &self.remote {
            remote.remove(name)?;
        }
        let path = self.path(name);
        match fs::remove_file(&path) {
            Err(e) if !is_absent(&e) => Err(Error::io("remove", &path)(e)),
            _ => Ok(()),
        }
    }

    /// Removes the local copies of these files.
    pub(crate) fn release<'n>(&self, names: impl IntoIterator<Item = &'n str>) {
        if self.remote.is_some() {
            // A copy that cannot be removed is removed with the folder.
            names.into_iter().for_each(|name| drop(fs::remove_file(self.path(name))));
        }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// Returns the path of a file to be read or written.
    ///
    /// # Errors
    /// If the path contains a symbolic link, which could point outside the folder.
    pub(crate) fn inside(&self, name: &str) -> Result<PathBuf, Error> {
        self.no_link(name)?;
        if let Some(remote) = &self.remote
            && !self.path(name).exists()
        {
            remote.get(name, &self.path(name))?;
        }
        Ok(self.path(name))
    }

    /// Checks that a path contains no symbolic link.
    pub(crate) fn no_link(&self, name: &str) -> Result<(), Error> {
        let mut path = self.root.clone();
        for part in name.split('/') {
            path.push(part);
            match fs::symlink_metadata(&path) {
                Ok(found) if found.is_symlink() => return Err(Error::input(&path)(InputError::Link)),
                Ok(_) => {}
                Err(_) => break,
            }
        }
        Ok(())
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> Result<FileRecord, Error> {
        self.pending(name)?.write_whole(bytes)
    }

    /// Writes a file unless it exists with the same content.
    pub(crate) fn keep(&self, name: &str, bytes: &[u8]) -> Result<FileRecord, Error> {
        let record = FileRecord::of(name, bytes);
        if self.defect(&record, Check::Hashes)?.is_none() { Ok(record) } else { self.write(name, bytes) }
    }

    /// Writes a file in pieces unless it exists with the same content.
    pub(crate) fn write_if_new(
        &self,
        name: &str,
        fill: impl FnOnce(&mut Output) -> Result<(), Error>,
    ) -> Result<FileRecord, Error> {
        let (mut pending, record) = self.filled(name, fill)?;
        if self.defect(&record, Check::Hashes)?.is_some() {
            pending.rename()?;
        }
        Ok(record)
    }

    /// Writes a file unless one of that name exists, and returns whether it was written. If two processes try at once,
    /// one of them writes, except in an object store.
    pub(crate) fn write_new(
        &self,
        name: &str,
        fill: impl FnOnce(&mut Output) -> Result<(), Error>,
    ) -> Result<bool, Error> {
        self.filled(name, fill)?.0.rename_new()
    }

    fn filled(
        &self,
        name: &str,
        fill: impl FnOnce(&mut Output) -> Result<(), Error>,
    ) -> Result<(Pending, FileRecord), Error> {
        let mut output = Output::new(self.pending(name)?)?;
        fill(&mut output)?;
        output.sealed()
    }

    /// Creates a temporary file. Its commit gives it this name.
    pub(crate) fn pending(&self, name: &str) -> Result<Pending, Error> {
        // A symbolic link of this name is replaced and not followed.
        if let Some((folders, _)) = name.rsplit_once('/') {
            self.inside(folders)?;
        }
        Pending::open(self.path(name), name, self.remote.clone())
    }

    /// Compares a file with its record and returns the difference.
    pub(crate) fn defect(&self, record: &FileRecord, check: Check) -> Result<Option<String>, Error> {
        let missing = || Ok(Some("missing".to_owned()));
        if self.remote.is_some() {
            match self.size(&record.path)? {
                None => return missing(),
                Some(size) if size == record.bytes && check == Check::Sizes => return Ok(None),
                Some(_) => {}
            }
        }
        let path = match self.inside(&record.path) {
            Err(Error::Input { problem, .. }) => return Ok(Some(problem.to_string())),
            path => path?,
        };
        let size = match fs::metadata(&path) {
            Ok(found) if found.is_file() => found.len(),
            Ok(_) => return Ok(Some("not a file".to_owned())),
            Err(e) if is_absent(&e) => return missing(),
            Err(e) => return Err(Error::io("read", &path)(e)),
        };
        Ok(if size != record.bytes {
            Some(format!("has {size} bytes; expected {}", record.bytes))
        } else if check == Check::Hashes && self.record(&record.path)?.sha256 != record.sha256 {
            Some("changed: the SHA-256 differs".to_owned())
        } else {
            None
        })
    }

    /// Returns the path of the first file that differs from its record, and the difference.
    pub(crate) fn first_defect<'f>(
        &self,
        files: &'f [FileRecord],
        check: Check,
    ) -> Result<Option<(&'f str, String)>, Error> {
        for file in files {
            if let Some(message) = self.defect(file, check)? {
                return Ok(Some((&file.path, message)));
            }
        }
        Ok(None)
    }

    pub(crate) fn record(&self, name: &str) -> Result<FileRecord, Error> {
        let path = self.inside(name)?;
        let measured = File::open(&path).and_then(|mut file| measure(&mut file));
        let (bytes, sha256) = measured.map_err(Error::io("read", &path))?;
        Ok(FileRecord { path: name.to_owned(), bytes, sha256 })
    }

    /// Returns the root and all its subfolders. Symbolic links are not followed.
    pub(crate) fn folders(&self) -> Result<Vec<PathBuf>, Error> {
        let mut found = vec![self.root.clone()];
        let mut next = 0;
        while let Some(path) = found.get(next).cloned() {
            next += 1;
            for entry in entries(&path)? {
                if entry.file_type().map_err(Error::io("read", &path))?.is_dir() {
                    found.push(entry.path());
                }
            }
        }
        Ok(found)
    }

    /// Removes all empty subfolders. Folders that cannot be removed stay.
    pub(crate) fn remove_empty(&self) -> Result<(), Error> {
        // Subfolders come after their parent: the reverse order removes them first.
        self.folders()?.iter().skip(1).rev().for_each(|path| drop(fs::remove_dir(path)));
        Ok(())
    }

    /// Returns the name of a file below the folder.
    fn name_of(&self, path: &Path) -> String {
        let below = path.strip_prefix(&self.root).unwrap_or(path);
        let parts: Vec<_> = below.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
        parts.join("/")
    }

    /// Returns the names of all files, sorted, without those of the desktop ([`is_desktop_file`]). Symbolic links count
    /// as files.
    pub(crate) fn names(&self) -> Result<Vec<String>, Error> {
        if let Some(remote) = &self.remote {
            let names = remote.list("")?.into_keys();
            return Ok(names.filter(|name| !is_desktop_file(last_part(name))).collect());
        }
        let mut found = Vec::new();
        for path in self.folders()? {
            for entry in entries(&path)? {
                let is_folder = entry.file_type().map_err(Error::io("read", &path))?.is_dir();
                if is_folder || is_desktop_file(&entry.file_name().to_string_lossy()) {
                    continue;
                }
                found.push(self.name_of(&entry.path()));
            }
        }
        found.sort();
        Ok(found)
    }

    /// Returns the file names in a folder, without those of subfolders; none if the folder does not exist.
    pub(crate) fn names_in(&self, folder: &str) -> Result<Vec<String>, Error> {
        if let Some(remote) = &self.remote {
            let requested;
            let found = match &self.listing {
                Some(listing) => &**listing,
                None => {
                    requested = remote.list(folder)?;
                    &requested
                }
            };
            let below = format!("{folder}/");
            let names = found.range(below.clone()..).map_while(|(name, _)| name.strip_prefix(&below));
            return Ok(names.filter(|name| !name.contains('/')).map(str::to_owned).collect());
        }
        let path = self.inside(folder)?;
        let entries = match fs::read_dir(&path) {
            Ok(entries) => entries,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(e) => return Err(Error::io("read", &path)(e)),
        };
        let name =
            |entry: io::Result<fs::DirEntry>| entry.map(|entry| entry.file_name().to_string_lossy().into_owned());
        entries.map(name).collect::<Result<_, _>>().map_err(Error::io("read", &path))
    }

    /// Removes temporary files of killed processes. Returns the names of removed files, sorted, and the number of
    /// skipped files: those that another process has locked or that may not be opened. A dry run removes nothing.
    pub(crate) fn sweep(&self, is_dry_run: bool) -> Result<(Vec<String>, u64), Error> {
        let (mut removed, mut skipped) = (Vec::new(), 0);
        for path in self.folders()? {
            for entry in entries(&path)? {
                if !is_temporary(&entry.file_name().to_string_lossy()) {
                    continue;
                }
                // A symbolic link is removed without opening its target.
                let is_link = entry.file_type().is_ok_and(|kind| kind.is_symlink());
                let open =
                    || File::options().write(true).open(entry.path()).ok().filter(|file| file.try_lock().is_ok());
                // The lock is held until the file is removed, so that no other process can lock it in between.
                let lock = if is_link { None } else { open() };
                let is_gone = (is_link || lock.is_some()) && (is_dry_run || fs::remove_file(entry.path()).is_ok());
                if is_gone {
                    removed.push(self.name_of(&entry.path()));
                } else {
                    skipped += u64::from(entry.path().symlink_metadata().is_ok());
                }
            }
        }
        removed.sort();
        Ok((removed, skipped))
    }

    /// Syncs the folders of these files, so that their names survive a power failure.
    pub(crate) fn sync_names<'f>(&self, files: impl IntoIterator<Item = &'f FileRecord>) -> Result<(), Error> {
        let mut folders: Vec<PathBuf> =
            files.into_iter().filter_map(|file| self.path(&file.path).parent().map(Path::to_owned)).collect();
        folders.sort_unstable();
        folders.dedup();
        folders.iter().try_for_each(|folder| {
            // Not every system can open a folder.
            match File::open(folder) {
                Ok(opened) => fault::sync(&opened).map_err(Error::io("write", folder)),
                Err(_) => Ok(()),
            }
        })
    }
}
