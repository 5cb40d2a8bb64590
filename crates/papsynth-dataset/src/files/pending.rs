//! A file that is being written: whole under its name, or not at all.

use std::fs::{self, File, TryLockError};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::fault;
use super::store::Remote;
use crate::bytes::{json, measure, sha256};
use crate::error::Error;

/// A file of a data set.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileRecord {
    /// Path relative to the data set, with `/` between folders.
    pub path: String,
    /// Size in bytes.
    pub bytes: u64,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
}

impl FileRecord {
    pub(crate) fn of(path: &str, bytes: &[u8]) -> Self {
        Self { path: path.to_owned(), bytes: bytes.len() as u64, sha256: sha256(bytes) }
    }
}

const TEMPORARY_ENDING: &str = ".tmp";

/// Temporary files that are made for one file, until one is neither locked nor removed by another process.
const MOST_ATTEMPTS: u32 = 16;

/// Whether a file of this name is one that was never finished.
pub(crate) fn is_temporary(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(TEMPORARY_ENDING)
}

/// A file without its name yet. Dropped before it is committed, it vanishes.
#[derive(Debug)]
pub(crate) struct Pending {
    file: File,
    temporary: PathBuf,
    path: PathBuf,
    name: String,
    committed: bool,
    /// The store that the file is put into.
    remote: Option<Arc<Remote>>,
}

impl Pending {
    /// Opens a file that will have this path once it is committed, and this name in the folder.
    pub(super) fn open(path: PathBuf, name: &str, remote: Option<Arc<Remote>>) -> Result<Self, Error> {
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let file_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut attempts = 0;
        loop {
            attempts += 1;
            // A number that no other process has: it keeps two writers of the same file apart and reaches no output.
            let unique = RandomState::new().hash_one(&path);
            let temporary = folder.join(format!(".{file_name}.{unique:016x}{TEMPORARY_ENDING}"));
            let open = || {
                fault::point()?;
                File::options().read(true).write(true).create_new(true).open(&temporary)
            };
            let file = open().or_else(|e| match e.kind() {
                io::ErrorKind::NotFound => fs::create_dir_all(&folder).and_then(|()| open()),
                _ => Err(e),
            });
            let file = file.map_err(Error::io("write", &path))?;
            // The lock keeps `Folder::sweep` of another process away. If that was faster, the file is lost and another one is
            // made. File systems without locks do without.
            let is_locked_by_other = matches!(file.try_lock(), Err(TryLockError::WouldBlock));
            let is_gone = || temporary.symlink_metadata().is_err_and(|e| e.kind() == io::ErrorKind::NotFound);
            if attempts == MOST_ATTEMPTS || (!is_locked_by_other && !is_gone()) {
                let name = name.to_owned();
                return Ok(Self { file, temporary, path, name, committed: false, remote });
            }
        }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes to the file. Nothing is held back: what is written through a handle is written when the call returns.
    pub(crate) fn handle(&self) -> Result<Handle, Error> {
        self.file.try_clone().map(Handle).map_err(Error::io("write", &self.path))
    }

    /// Brings the file to the disk and gives it its name.
    pub(crate) fn commit(mut self) -> Result<FileRecord, Error> {
        let record = self.seal()?;
        self.rename()?;
        Ok(record)
    }

    /// The same of a file with this content.
    pub(super) fn write_whole(mut self, bytes: &[u8]) -> Result<FileRecord, Error> {
        let written = self.handle()?.write_all(bytes).and_then(|()| fault::sync(&self.file));
        written.map_err(Error::io("write", &self.path))?;
        self.rename()?;
        Ok(FileRecord::of(&self.name, bytes))
    }

    /// As [`commit`](Self::commit), if there is no such file. Says whether there was none.
    pub(super) fn commit_unless_there(mut self) -> Result<bool, Error> {
        self.seal()?;
        if self.remote.is_none() {
            match fault::point().and_then(|()| fs::hard_link(&self.temporary, &self.path)) {
                // The temporary name goes with this.
                Ok(()) => return Ok(true),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Ok(false),
                // Not every file system has a second name for a file.
                Err(_) => {}
            }
        }
        self.rename().map(|()| true)
    }

    /// Brings the file to the disk, and says what is in it.
    pub(super) fn seal(&mut self) -> Result<FileRecord, Error> {
        let sealed = fault::sync(&self.file)
            // Read back: what counts is what is there, however it was written.
            .and_then(|()| self.file.seek(SeekFrom::Start(0)))
            .and_then(|_| measure(&mut self.file));
        let (bytes, sha256) = sealed.map_err(Error::io("write", &self.path))?;
        Ok(FileRecord { path: self.name.clone(), bytes, sha256 })
    }

    pub(super) fn rename(&mut self) -> Result<(), Error> {
        let rename = || fault::point().and_then(|()| fs::rename(&self.temporary, &self.path));
        let renamed = rename().or_else(|error| match error.kind() {
            // A folder in the file's place gives way if there is nothing in it.
            io::ErrorKind::IsADirectory if fs::remove_dir(&self.path).is_ok() => rename(),
            _ => Err(error),
        });
        renamed.map_err(Error::io("write", &self.path))?;
        self.committed = true;
        self.remote.as_ref().map_or(Ok(()), |remote| remote.put(&self.name, &self.path))
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        if !self.committed {
            // Nothing more can be done about a file that cannot be removed.
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

pub(crate) struct Output {
    writer: BufWriter<Handle>,
    pending: Pending,
}

impl Output {
    pub(crate) fn new(pending: Pending) -> Result<Self, Error> {
        Ok(Self { writer: BufWriter::new(pending.handle()?), pending })
    }

    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.writer.write_all(bytes).map_err(Error::io("write", &self.pending.path))
    }

    pub(crate) fn json(&mut self, value: &impl Serialize) -> Result<(), Error> {
        self.bytes(&json(value))
    }

    pub(crate) fn into_pending(mut self) -> Result<Pending, Error> {
        self.writer.flush().map_err(Error::io("write", &self.pending.path))?;
        Ok(self.pending)
    }
}

#[derive(Debug)]
pub(crate) struct Handle(File);

impl Write for Handle {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        fault::point()?;
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl Seek for Handle {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.0.seek(position)
    }
}
