//! The manifest: what a data set is made from, and every file.

use std::fmt::{self, Formatter};
use std::fs::File;
use std::io::{self, BufReader, Read};

use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use super::record::{FORMAT, Identity, inside, version};
use crate::bytes::{json, sha256};
use crate::error::{Error, Problem};
use crate::files::{FileRecord, Folder};
use crate::formats::{Layout, names};
use crate::truth::Category;

/// The head of `manifest.json`, and of its list of files those of the whole data set; those of shards are in their records.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Manifest {
    /// What wrote it.
    pub writer: String,
    /// What the data set is made from.
    pub identity: Identity,
    /// How it lies in files.
    pub layout: Layout,
    /// What there may be in its images.
    pub categories: Vec<Category>,
    /// Number of frames when it was written; the files of later ones are not in it.
    pub frames: u64,
    /// Number of shards that they lie in.
    pub shards: u64,
    /// The files that are no shard's.
    pub files: Vec<FileRecord>,
}

/// The file: written without its list, which follows piece by piece.
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
    /// SHA-256 of the head as compact JSON in which this is empty.
    pub(super) head_sha256: String,
    #[serde(skip_serializing, deserialize_with = "of_no_shard")]
    pub(super) files: Vec<FileRecord>,
}

impl ManifestFile {
    /// With the SHA-256 of the head.
    pub(super) fn sealed(mut self) -> Self {
        self.head_sha256 = String::new();
        self.head_sha256 = sha256(&json(&self));
        self
    }
}

/// Of a list of files, which may be longer than memory, those that belong to no shard: they come first, before the first record.
fn of_no_shard<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<FileRecord>, D::Error> {
    struct Top;

    impl<'de> Visitor<'de> for Top {
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

    deserializer.deserialize_seq(Top)
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    pub(crate) path: String,
    pub(crate) bytes: u64,
    pub(crate) sha256: String,
    /// The shard it is of, if it is of one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) shard: Option<u64>,
}

impl Manifest {
    /// Parses a manifest.
    ///
    /// # Errors
    /// If it is none, or of another version.
    pub fn from_json(bytes: &[u8]) -> Result<Self, Problem> {
        Self::from_reader(&mut &*bytes)
    }

    pub(crate) fn read(folder: &Folder) -> Result<Self, Error> {
        let path = folder.inside(names::MANIFEST)?;
        let file = File::open(&path).map_err(|e| match e.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
                Error::folder(folder.root(), "holds no data set: there is no manifest.json")
            }
            _ => Error::io("read", &path)(e),
        })?;
        Self::from_reader(&mut BufReader::new(file)).map_err(Error::input(&path))
    }

    fn from_reader(reader: &mut dyn Read) -> Result<Self, Problem> {
        let file: ManifestFile = serde_json::from_reader(reader)?;
        if file.format != FORMAT {
            let message = format!("format is `{}`; `{FORMAT}` is wanted", file.format.escape_default());
            return Err(Problem::broken("JSON", message));
        }
        version(file.version)?;
        inside(&file.files)?;
        file.layout.check()?;
        let said = file.head_sha256.clone();
        let ManifestFile { writer, identity, layout, frames, shards, categories, files, head_sha256, .. } =
            file.sealed();
        match head_sha256 == said {
            true => Ok(Self { writer, identity, layout, categories, frames, shards, files }),
            false => Err(Problem::broken("JSON", "is not as it was written: the SHA-256 of its head is another")),
        }
    }
}
