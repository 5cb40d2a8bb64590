//! Whether a slide is as it was written.

use std::collections::BTreeSet;
use std::path::Path;

use super::{HEAD, SlideSet, UPPER, name_of, record_name};
use crate::error::Error;
use crate::files::is_temporary;
use crate::layout;
use crate::record::{Check, FileRecord};

/// Something wrong with a slide.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlideFinding {
    /// The file, from the slide's folder.
    pub path: String,
    /// What is wrong with it.
    pub message: String,
    /// Whether `papsynth slide` with the same recipe mends it; else the file is one too many.
    pub mended_by_making: bool,
}

impl SlideSet {
    /// Reads every file and says what is missing, cut, changed or too many.
    ///
    /// # Errors
    /// If the system refuses to read.
    pub fn verify(&self) -> Result<Vec<SlideFinding>, Error> {
        let mut findings = Vec::new();
        let mut known: BTreeSet<String> = BTreeSet::new();
        let mut find = |path: &str, message: &str, mended_by_making| {
            findings.push(SlideFinding { path: path.to_owned(), message: message.to_owned(), mended_by_making });
        };
        let own = self.own_files()?;
        for file in &own {
            if let Some(flaw) = self.folder.flaw(file, Check::Hashes)? {
                find(&file.path, &flaw, true);
            }
        }
        known.extend(own.into_iter().map(|file| file.path));
        for name in self.all().map(record_name).chain([UPPER.to_owned()]) {
            known.insert(name.clone());
            let Some(record) = self.record(&name)? else {
                let there = self.folder.path(&name).exists();
                find(&name, if there { "is no record of this slide, or was changed" } else { "is missing" }, true);
                continue;
            };
            for file in &record.files {
                if let Some(flaw) = self.folder.flaw(file, Check::Hashes)? {
                    find(&file.path, &flaw, true);
                }
            }
            known.extend(record.files.into_iter().map(|file| file.path));
        }
        for path in self.files()? {
            let name = path.rsplit('/').next().unwrap_or_default();
            if !known.contains(&path) && !is_temporary(name) {
                find(&path, "is no file of the slide", false);
            }
        }
        Ok(findings)
    }

    /// The files that are no shard's: what they must be follows from `slide.json`.
    fn own_files(&self) -> Result<Vec<FileRecord>, Error> {
        let file = |path: &str, bytes: &[u8]| FileRecord {
            path: path.to_owned(),
            bytes: bytes.len() as u64,
            sha256: crate::files::sha256(bytes),
        };
        let mut files = vec![file(HEAD, &self.head.to_json())];
        files.extend(self.documents()?.iter().map(|(path, bytes)| file(path, bytes)));
        for (path, sha256) in
            [(layout::RECIPE, &self.head.identity.recipe_sha256), (layout::MODEL, &self.head.identity.model_sha256)]
        {
            let bytes = std::fs::metadata(self.folder.path(path)).map_or(0, |found| found.len());
            files.push(FileRecord { path: path.to_owned(), bytes, sha256: sha256.clone() });
        }
        Ok(files)
    }

    /// Every file in the folder, by its path from there; links are not followed.
    fn files(&self) -> Result<Vec<String>, Error> {
        let root = self.path();
        let mut files = Vec::new();
        for folder in self.folder.folders()? {
            for entry in std::fs::read_dir(&folder).map_err(Error::io("read", &folder))? {
                let entry = entry.map_err(Error::io("read", &folder))?;
                if !entry.file_type().map_err(Error::io("read", &folder))?.is_dir() {
                    files.push(relative(root, &entry.path()));
                }
            }
        }
        files.sort();
        Ok(files)
    }

    /// The name of a shard in its files.
    #[must_use]
    pub fn name_of(at: [u32; 2]) -> String {
        name_of(at)
    }
}

fn relative(root: &Path, path: &Path) -> String {
    let inside = path.strip_prefix(root).unwrap_or(path);
    inside.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
}
