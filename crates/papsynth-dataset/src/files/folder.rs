//! Whole files or none: a file gets its name only when all of it is on the disk.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::fault;
use super::pending::{FileRecord, Output, Pending, is_temporary};
use super::store::{Home, Remote};
use crate::bytes::measure;
use crate::error::{Error, Problem};

/// How carefully files are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Check {
    /// They are there and of the right size.
    Sizes,
    /// Their SHA-256 is right, too; all are read.
    Hashes,
}

/// Writes a file under a temporary name in the same folder, brings it to the disk, and renames it.
///
/// # Errors
/// If there is a folder of that name, or the system refuses; then there is no such file, or still the former one.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    if path.is_dir() {
        return Err(Error::io("write", path)(io::ErrorKind::IsADirectory.into()));
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Folder::new(folder).write(&name, bytes).map(|_| ())
}

/// What lies in a folder; nothing if it is not there.
fn entries(path: &Path) -> Result<Vec<fs::DirEntry>, Error> {
    match fs::read_dir(path) {
        Ok(entries) => entries.collect::<Result<_, _>>().map_err(Error::io("read", path)),
        Err(e) if is_absent(&e) => Ok(Vec::new()),
        Err(e) => Err(Error::io("read", path)(e)),
    }
}

fn is_absent(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory)
}

/// A folder into which files are written by names relative to it, with `/` between folders. Of a data set in an object store it is where
/// its files are worked on: what gets its name is put into the store, and what is read is copied from there first.
#[derive(Debug, Clone)]
pub(crate) struct Folder {
    root: PathBuf,
    remote: Option<Arc<Remote>>,
    /// Names and sizes of the files in the store at one moment.
    listing: Option<Arc<BTreeMap<String, u64>>>,
}

impl Folder {
    pub(crate) fn new(home: impl Into<Home>) -> Self {
        let Home { root, remote } = home.into();
        Self { root, remote, listing: None }
    }

    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    /// Where it is, for messages.
    pub(crate) fn shown(&self) -> PathBuf {
        self.remote.as_ref().map_or_else(|| self.root.clone(), |remote| remote.named(&self.root))
    }

    /// The same folder, with the sizes of all files in the store asked for once instead of one by one.
    pub(crate) fn listed(&self) -> Result<Self, Error> {
        let listing = self.remote.as_ref().map(|remote| remote.list("")).transpose()?.map(Arc::new);
        Ok(Self { listing, ..self.clone() })
    }

    /// An error that names files in the store, and not their copies.
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

    /// The copies of these files are wanted no longer.
    pub(crate) fn release<'n>(&self, names: impl IntoIterator<Item = &'n str>) {
        if self.remote.is_some() {
            // One that cannot be removed goes with the folder.
            names.into_iter().for_each(|name| drop(fs::remove_file(self.path(name))));
        }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// The path of a file that is read or written: neither it nor a folder on the way is a link, which could lead outside.
    pub(crate) fn inside(&self, name: &str) -> Result<PathBuf, Error> {
        self.no_link(name)?;
        if let Some(remote) = &self.remote
            && !self.path(name).exists()
        {
            remote.get(name, &self.path(name))?;
        }
        Ok(self.path(name))
    }

    /// Neither a file or folder nor a folder on the way to it is a link.
    pub(crate) fn no_link(&self, name: &str) -> Result<(), Error> {
        let mut path = self.root.clone();
        for part in name.split('/') {
            path.push(part);
            match fs::symlink_metadata(&path) {
                Ok(found) if found.is_symlink() => return Err(Error::input(&path)(Problem::Link)),
                Ok(_) => {}
                // What is not there leads nowhere.
                Err(_) => break,
            }
        }
        Ok(())
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> Result<FileRecord, Error> {
        self.pending(name)?.write_whole(bytes)
    }

    /// Writes a whole file, unless there is one of the same content.
    pub(crate) fn keep(&self, name: &str, bytes: &[u8]) -> Result<FileRecord, Error> {
        let record = FileRecord::of(name, bytes);
        if self.flaw(&record, Check::Hashes)?.is_none() { Ok(record) } else { self.write(name, bytes) }
    }

    /// Writes a file piece by piece, unless there is one of the same content.
    pub(crate) fn write_if_new(
        &self,
        name: &str,
        fill: impl FnOnce(&mut Output) -> Result<(), Error>,
    ) -> Result<FileRecord, Error> {
        let mut pending = self.filled(name, fill)?;
        let record = pending.seal()?;
        if self.flaw(&record, Check::Hashes)?.is_some() {
            pending.rename()?;
        }
        Ok(record)
    }

    /// Writes a file unless there is one of that name. Says whether it did; of two that try at once one does, but in an object store.
    pub(crate) fn write_unless_there(
        &self,
        name: &str,
        fill: impl FnOnce(&mut Output) -> Result<(), Error>,
    ) -> Result<bool, Error> {
        self.filled(name, fill)?.commit_unless_there()
    }

    fn filled(&self, name: &str, fill: impl FnOnce(&mut Output) -> Result<(), Error>) -> Result<Pending, Error> {
        let mut output = Output::new(self.pending(name)?)?;
        fill(&mut output)?;
        output.into_pending()
    }

    /// Opens a file that will have this name once it is committed.
    pub(crate) fn pending(&self, name: &str) -> Result<Pending, Error> {
        // A link that has the name itself is replaced, and not followed.
        if let Some((folders, _)) = name.rsplit_once('/') {
            self.inside(folders)?;
        }
        Pending::open(self.path(name), name, self.remote.clone())
    }

    pub(crate) fn flaw(&self, record: &FileRecord, check: Check) -> Result<Option<String>, Error> {
        let missing = || Ok(Some("is missing".to_owned()));
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
            Ok(_) => return Ok(Some("is no file".to_owned())),
            Err(e) if is_absent(&e) => return missing(),
            Err(e) => return Err(Error::io("read", &path)(e)),
        };
        Ok(if size != record.bytes {
            Some(format!("has {size} bytes, not {}", record.bytes))
        } else if check == Check::Hashes && self.record(&record.path)?.sha256 != record.sha256 {
            Some("has another content than it was written with".to_owned())
        } else {
            None
        })
    }

    /// The first of these files of which something is wrong, and what.
    pub(crate) fn first_flaw<'f>(
        &self,
        files: &'f [FileRecord],
        check: Check,
    ) -> Result<Option<(&'f str, String)>, Error> {
        for file in files {
            if let Some(message) = self.flaw(file, check)? {
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

    /// Every folder from the root down, but none that a link leads to.
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

    /// Removes folders in which there is nothing, or only such folders. The root stays, and so does what the system keeps.
    pub(crate) fn remove_empty(&self) -> Result<(), Error> {
        // From the inmost: what lies within a folder comes after it.
        self.folders()?.iter().skip(1).rev().for_each(|path| drop(fs::remove_dir(path)));
        Ok(())
    }

    /// Every file, by its name, in order. Links are files: nothing of ours is one.
    pub(crate) fn names(&self) -> Result<Vec<String>, Error> {
        if let Some(remote) = &self.remote {
            return Ok(remote.list("")?.into_keys().collect());
        }
        let mut found = Vec::new();
        for path in self.folders()? {
            for entry in entries(&path)? {
                if entry.file_type().map_err(Error::io("read", &path))?.is_dir() {
                    continue;
                }
                let below = entry.path();
                let below = below.strip_prefix(&self.root);
                let below = below.expect("what is found in folders from the root down lies below it");
                let parts: Vec<_> = below.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
                found.push(parts.join("/"));
            }
        }
        found.sort();
        Ok(found)
    }

    /// Last parts of the names of the files that lie in a folder itself; none if there is no such folder.
    pub(crate) fn names_in(&self, folder: &str) -> Result<Vec<String>, Error> {
        if let Some(remote) = &self.remote {
            let asked;
            let found = match &self.listing {
                Some(listing) => &**listing,
                None => {
                    asked = remote.list(folder)?;
                    &asked
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

    /// Removes what killed processes left behind and says how many files went and how many stayed: a temporary file that somebody works on
    /// is locked, and somebody else's may not be opened.
    pub(crate) fn sweep(&self) -> Result<[u64; 2], Error> {
        let [mut removed, mut stayed] = [0; 2];
        for path in self.folders()? {
            for entry in entries(&path)? {
                if !is_temporary(&entry.file_name().to_string_lossy()) {
                    continue;
                }
                // A link is nobody's work, and what it leads to is none of ours.
                let is_link = entry.file_type().is_ok_and(|kind| kind.is_symlink());
                let open =
                    || File::options().write(true).open(entry.path()).ok().filter(|file| file.try_lock().is_ok());
                // The lock is held until the file is removed, so that no other process can take the file in between.
                let lock = if is_link { None } else { open() };
                let is_gone = (is_link || lock.is_some()) && fs::remove_file(entry.path()).is_ok();
                removed += u64::from(is_gone);
                // Gone by another's hand is as good.
                stayed += u64::from(!is_gone && entry.path().symlink_metadata().is_ok());
            }
        }
        Ok([removed, stayed])
    }

    /// Brings the names of these files to the disk: what is recorded afterwards is there even if the power fails.
    pub(crate) fn sync_names<'f>(&self, files: impl IntoIterator<Item = &'f FileRecord>) -> Result<(), Error> {
        let mut folders: Vec<PathBuf> =
            files.into_iter().filter_map(|file| self.path(&file.path).parent().map(Path::to_owned)).collect();
        folders.sort_unstable();
        folders.dedup();
        folders.iter().try_for_each(|folder| {
            // Not every system opens a folder; one that does must bring it to the disk.
            match File::open(folder) {
                Ok(opened) => fault::sync(&opened).map_err(Error::io("write", folder)),
                Err(_) => Ok(()),
            }
        })
    }
}
