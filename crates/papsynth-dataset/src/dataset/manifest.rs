//! The manifest: the identity of a data set and the list of its files.

use std::fmt::{self, Formatter};
use std::fs::File;
use std::io::{self, BufReader, Read};

use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use super::record::{FORMAT, Identity, check_paths, check_version};
use crate::bytes::{json, sha256};
use crate::error::{Error, InputError};
use crate::files::{FileRecord, Folder};
use crate::formats::{Layout, names};
use crate::truth::Category;

/// The head of `manifest.json` and the merged files of its list. The records of shards list the other files.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Manifest {
    /// Program and version that wrote it.
    pub writer: String,
    /// The identity: seed, versions and hashes of the inputs.
    pub identity: Identity,
    /// The layout of the files.
    pub layout: Layout,
    /// Categories of objects in its images.
    pub categories: Vec<Category>,
    /// Number of frames when it was written; it does not list the files of later frames.
    pub frames: u64,
    /// Number of shards of these frames.
    pub shards: u64,
    /// The files that belong to no shard.
    pub files: Vec<FileRecord>,
}

/// The content of `manifest.json`. The list of files is written separately, entry by entry.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ManifestFile {
    pub(super) format: String,
    pub(super) version: u32,
    pub(super) writer: String,
    pub(super) identity: Identity,
    pub(super) layout: Layout,
    pub(super) frames: u64,
    pub(super) shards: u64,
    pub(super) categories: Vec<Category>,
    /// SHA-256 of the head as compact JSON in which this field is empty.
    pub(super) head_sha256: String,
    #[serde(skip_serializing, deserialize_with = "merged_files")]
    pub(super) files: Vec<FileRecord>,
}

impl ManifestFile {
    /// Returns the head with its SHA-256.
    pub(super) fn sealed(mut self) -> Self {
        self.head_sha256 = String::new();
        self.head_sha256 = sha256(&json(&self));
        self
    }
}

/// Reads the files that belong to no shard from a list that may be larger than the memory.
fn merged_files<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<FileRecord>, D::Error> {
    struct MergedFiles;

    impl<'de> Visitor<'de> for MergedFiles {
        type Value = Vec<FileRecord>;

        fn expecting(&self, f: &mut Formatter<'_>) -> fmt::Result {
            f.write_str("a list of files")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
            let mut found = Vec::new();
            while let Some(entry) = list.next_element::<Entry>()? {
                if entry.shard.is_none() {
                    found.push(FileRecord { path: entry.path, bytes: entry.bytes, sha256: entry.sha256 });
                }
            }
            Ok(found)
        }
    }

    deserializer.deserialize_seq(MergedFiles)
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    pub(crate) path: String,
    pub(crate) bytes: u64,
    pub(crate) sha256: String,
    /// Number of the shard, if the file belongs to one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) shard: Option<u64>,
}

impl Manifest {
    /// Parses a manifest.
    ///
    /// # Errors
    /// If it is invalid or of another version.
    pub fn from_json(bytes: &[u8]) -> Result<Self, InputError> {
        Self::from_reader(&mut &*bytes)
    }

    pub(crate) fn read(folder: &Folder) -> Result<Self, Error> {
        let path = folder.inside(names::MANIFEST)?;
        let file = File::open(&path).map_err(|e| match e.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
                let message = match (folder.is_remote() || folder.root().is_dir(), folder.root().exists()) {
                    (true, _) => "contains no data set: manifest.json is missing",
                    (false, true) => "is a file; expected the folder of a data set",
                    (false, false) => "no such folder; expected the folder of a data set",
                };
                Error::folder(folder.root(), message)
            }
            _ => Error::io("read", &path)(e),
        })?;
        Self::from_reader(&mut BufReader::new(file)).map_err(Error::input(&path))
    }

    fn from_reader(reader: &mut dyn Read) -> Result<Self, InputError> {
        let file: ManifestFile = serde_json::from_reader(reader)?;
        if file.format != FORMAT {
            let message = format!("format: expected `{FORMAT}`, found `{}`", file.format.escape_default());
            return Err(InputError::broken("JSON", message));
        }
        check_version(file.version)?;
        check_paths(&file.files)?;
        file.layout.check()?;
        let expected = file.head_sha256.clone();
        let ManifestFile { writer, identity, layout, frames, shards, categories, files, head_sha256, .. } =
            file.sealed();
        match head_sha256 == expected {
            true => Ok(Self { writer, identity, layout, categories, frames, shards, files }),
            false => Err(InputError::broken("JSON", "its head was changed: the SHA-256 differs")),
        }
    }
}
