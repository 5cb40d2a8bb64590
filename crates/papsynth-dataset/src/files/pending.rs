//! Atomic writes: a file appears complete under its name, or not at all.

use std::fs::{self, File, TryLockError};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::fault;
use super::store::Remote;
use crate::bytes::{hex, json_into, measure, sha256};
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

/// Largest number of temporary files tried for one file, until one is neither locked nor removed by another process.
const MAX_ATTEMPTS: u32 = 16;

/// Whether this is the name of a temporary file.
pub(crate) fn is_temporary(name: &str) -> bool {
    name.starts_with('.') && name.ends_with(TEMPORARY_ENDING)
}

/// Whether the desktop of macOS or Windows writes files of this name into folders that it shows.
pub(crate) fn is_desktop_file(name: &str) -> bool {
    let is = |known: &str| name.eq_ignore_ascii_case(known);
    is(".DS_Store") || is("Thumbs.db") || is("desktop.ini") || (name.starts_with("._") && !is_temporary(name))
}

/// A temporary file that gets its name when it is committed. Dropping it before removes it.
#[derive(Debug)]
pub(crate) struct Pending {
    file: File,
    temporary: PathBuf,
    path: PathBuf,
    name: String,
    committed: bool,
    /// The store that receives the file.
    remote: Option<Arc<Remote>>,
}

impl Pending {
    /// Creates a temporary file. Its commit gives it this path and this name in the folder.
    pub(super) fn open(path: PathBuf, name: &str, remote: Option<Arc<Remote>>) -> Result<Self, Error> {
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let file_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut attempts = 0;
        loop {
            attempts += 1;
            // A random number separates two writers of the same file. It reaches no output.
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
            // The lock protects the file from `Folder::sweep` of another process. If that process was faster, another
            // file is created. File systems without locks skip this protection.
            let is_locked_by_other = matches!(file.try_lock(), Err(TryLockError::WouldBlock));
            let is_gone = || temporary.symlink_metadata().is_err_and(|e| e.kind() == io::ErrorKind::NotFound);
            if attempts == MAX_ATTEMPTS || (!is_locked_by_other && !is_gone()) {
                let name = name.to_owned();
                return Ok(Self { file, temporary, path, name, committed: false, remote });
            }
        }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Returns an unbuffered writer to the file.
    pub(crate) fn handle(&self) -> Result<Handle, Error> {
        self.file.try_clone().map(Handle).map_err(Error::io("write", &self.path))
    }

    /// Syncs the file to the disk and renames it to its name. The file is read for its hash.
    pub(crate) fn commit(mut self) -> Result<FileRecord, Error> {
        let sealed = fault::sync(&self.file)
            .and_then(|()| self.file.seek(SeekFrom::Start(0)))
            .and_then(|_| measure(&mut self.file));
        let (bytes, sha256) = sealed.map_err(Error::io("write", &self.path))?;
        self.rename()?;
        Ok(FileRecord { path: self.name.clone(), bytes, sha256 })
    }

    /// Writes `bytes` and commits the file.
    pub(super) fn write_whole(mut self, bytes: &[u8]) -> Result<FileRecord, Error> {
        let written = self.handle()?.write_all(bytes).and_then(|()| fault::sync(&self.file));
        written.map_err(Error::io("write", &self.path))?;
        self.rename()?;
        Ok(FileRecord::of(&self.name, bytes))
    }

    /// Renames the synced file to its name, but only if no file has the name. Returns whether it was renamed.
    pub(super) fn rename_new(mut self) -> Result<bool, Error> {
        if self.remote.is_none() {
            match fault::point().and_then(|()| fs::hard_link(&self.temporary, &self.path)) {
                // Dropping `self` removes the temporary name.
                Ok(()) => return Ok(true),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Ok(false),
                // Not every file system has hard links.
                Err(_) => {}
            }
        }
        self.rename().map(|()| true)
    }

    pub(super) fn rename(&mut self) -> Result<(), Error> {
        let rename = || fault::point().and_then(|()| fs::rename(&self.temporary, &self.path));
        let renamed = rename().or_else(|error| match error.kind() {
            // Replaces an empty folder of the same name.
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
            // An error here has no caller to report to.
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

/// Largest number of bytes that are written and hashed in one step: they stay in the processor's cache between the two.
const STEP_BYTES: usize = 1 << 20;

/// A file that is written from front to back, and hashed while it is written.
pub(crate) struct Output {
    writer: BufWriter<Handle>,
    hash: Sha256,
    bytes: u64,
    /// Buffer for JSON.
    text: Vec<u8>,
    pending: Pending,
}

impl Output {
    pub(crate) fn new(pending: Pending) -> Result<Self, Error> {
        Ok(Self { writer: BufWriter::new(pending.handle()?), hash: Sha256::new(), bytes: 0, text: Vec::new(), pending })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.pending.path
    }

    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.write_all(bytes).map_err(|error| Error::io("write", self.path())(error))
    }

    pub(crate) fn json(&mut self, value: &impl Serialize) -> Result<(), Error> {
        // The buffer is reused.
        let mut text = std::mem::take(&mut self.text);
        text.clear();
        json_into(value, &mut text);
        let written = self.bytes(&text);
        self.text = text;
        written
    }

    /// Syncs the file to the disk and renames it to its name.
    pub(crate) fn commit(self) -> Result<FileRecord, Error> {
        let (mut pending, record) = self.sealed()?;
        pending.rename()?;
        Ok(record)
    }

    /// Syncs the file to the disk.
    pub(super) fn sealed(mut self) -> Result<(Pending, FileRecord), Error> {
        let Self { pending, hash, bytes, .. } = self;
        let sealed = self.writer.flush().and_then(|()| fault::sync(&pending.file));
        sealed.map_err(Error::io("write", &pending.path))?;
        let record = FileRecord { path: pending.name.clone(), bytes, sha256: hex(&hash.finalize()) };
        Ok((pending, record))
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.writer.write(&bytes[..bytes.len().min(STEP_BYTES)])?;
        self.hash.update(&bytes[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
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
