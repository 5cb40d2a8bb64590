//! Verification of a slide.

use std::collections::BTreeSet;

use papsynth::truth::Group;
use papsynth_zarr::Shard;

use super::record::{HEAD, LAYERS, Pyramids, folder};
use super::set::{CARD, SlideSet, THUMBNAIL, UPPER, name_of, place, record_name};
use crate::dataset::{Finding, VerifyProgress};
use crate::error::Error;
use crate::files::{Check, FileRecord};
use crate::formats::names;

impl SlideSet {
    /// Verifies a slide: reads every file, and returns missing, truncated, changed and untracked files, sorted by path.
    /// Files of the desktop, such as `.DS_Store`, are ignored.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn verify(&self) -> Result<Vec<Finding>, Error> {
        self.verify_with_progress(&|_| ())
    }

    /// As [`verify`](Self::verify); calls `report` after each file.
    ///
    /// # Errors
    /// As [`verify`](Self::verify).
    pub fn verify_with_progress(&self, report: &dyn Fn(VerifyProgress)) -> Result<Vec<Finding>, Error> {
        let mut findings = Vec::new();
        let (files, unrecorded) = self.listed()?;
        for name in &unrecorded {
            let there = self.folder.path(name).exists();
            let message = if there { "changed, or the record of another slide" } else { "missing" };
            findings.push(Finding::damaged(name, message));
        }
        for (done, file) in (1..).zip(&files) {
            let flaw = self.folder.flaw(file, Check::Hashes)?;
            findings.extend(flaw.map(|message| Finding::damaged(&file.path, message)));
            report(VerifyProgress { done, total: files.len() as u64 });
        }
        let mut known = self.names_of(&files);
        // Files of a lost record are not untracked.
        known.extend(unrecorded.iter().flat_map(|name| self.files_of_record(name)));
        let there = self.folder.names()?;
        findings
            .extend(there.iter().filter(|path| !known.contains(*path)).map(|path| Finding::untracked(path, "slide")));
        findings.sort();
        Ok(findings)
    }

    /// Returns the names of all files of a finished slide.
    ///
    /// # Errors
    /// If the slide is not finished, or a record cannot be read.
    pub(crate) fn own_names(&self) -> Result<BTreeSet<String>, Error> {
        let (files, unrecorded) = self.listed()?;
        match unrecorded.first() {
            None => Ok(self.names_of(&files)),
            Some(name) => {
                let message =
                    format!("untracked files can be removed only after `papsynth slide finalize` (missing: {name})");
                Err(Error::folder(self.path(), message))
            }
        }
    }

    /// Returns all files except records, and the names of missing or invalid records.
    fn listed(&self) -> Result<(Vec<FileRecord>, Vec<String>), Error> {
        let (mut files, mut unrecorded) = (self.given()?, Vec::new());
        for name in self.record_names() {
            match self.record(&name)? {
                Some(record) => files.extend(record.files),
                None => unrecorded.push(name),
            }
        }
        Ok((files, unrecorded))
    }

    /// Returns the names of the files that a record must list.
    fn files_of_record(&self, record: &str) -> Vec<String> {
        let at = self.all_shards().find(|&at| record_name(at) == record);
        let mut names = match at {
            Some(at) => {
                ["csv", "geojson", "parquet"].map(|ending| format!("objects/{}.{ending}", name_of(at))).to_vec()
            }
            None => vec![CARD.to_owned(), THUMBNAIL.to_owned()],
        };
        let Pyramids { image, labels, layers } = &self.pyramids;
        let labels = Group::ALL.map(|group| (Some(group.name()), labels));
        for (labels, pyramid) in labels.into_iter().chain([(None, image), (Some(LAYERS), layers)]) {
            for (level, array) in pyramid.levels().iter().enumerate() {
                let shards: Vec<Shard> = match at {
                    Some(at) if level < pyramid.with_shard() => {
                        (0..array.shape()[1]).map(|plane| place(at, plane)).collect()
                    }
                    None if level >= pyramid.with_shard() => array.shards().collect(),
                    _ => continue,
                };
                names.extend(shards.into_iter().map(|at| format!("{}/{}", folder(labels, level), array.file(at))));
            }
        }
        names
    }

    fn record_names(&self) -> impl Iterator<Item = String> + use<> {
        self.all_shards().map(record_name).chain([UPPER.to_owned()])
    }

    fn names_of(&self, files: &[FileRecord]) -> BTreeSet<String> {
        files.iter().map(|file| file.path.clone()).chain(self.record_names()).collect()
    }

    /// Returns the expected records of the files that belong to no shard, from `slide.json`.
    fn given(&self) -> Result<Vec<FileRecord>, Error> {
        let mut files = vec![FileRecord::of(HEAD, &self.head.to_json())];
        files.extend(self.documents()?.iter().map(|(path, bytes)| FileRecord::of(path, bytes)));
        for (path, sha256) in
            [(names::RECIPE, &self.head.identity.recipe_sha256), (names::MODEL, &self.head.identity.model_sha256)]
        {
            let bytes = std::fs::metadata(self.folder.path(path)).map_or(0, |found| found.len());
            files.push(FileRecord { path: path.to_owned(), bytes, sha256: sha256.clone() });
        }
        Ok(files)
    }

    /// Returns the name of a shard in file names.
    #[must_use]
    pub fn shard_name(at: [u32; 2]) -> String {
        name_of(at)
    }
}
