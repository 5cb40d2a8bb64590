//! Whether a slide is as it was written.

use std::collections::BTreeSet;

use papsynth::truth::Group;
use papsynth_zarr::Shard;

use super::record::{Forms, HEAD, LAYERS, folder};
use super::set::{CARD, SlideSet, THUMBNAIL, UPPER, name_of, place, record_name};
use crate::dataset::Finding;
use crate::error::Error;
use crate::files::{Check, FileRecord};
use crate::formats::names;

impl SlideSet {
    /// Reads every file and says what is missing, cut, changed or too many, by path.
    ///
    /// # Errors
    /// If the system refuses to read.
    pub fn verify(&self) -> Result<Vec<Finding>, Error> {
        let mut findings = Vec::new();
        let (files, unrecorded) = self.listed()?;
        for name in &unrecorded {
            let there = self.folder.path(name).exists();
            let message = if there { "is no record of this slide, or was changed" } else { "is missing" };
            findings.push(Finding::made_wrong(name, message));
        }
        for file in &files {
            let flaw = self.folder.flaw(file, Check::Hashes)?;
            findings.extend(flaw.map(|message| Finding::made_wrong(&file.path, message)));
        }
        let mut known = self.names_of(&files);
        // What a lost record vouched for is no stray.
        known.extend(unrecorded.iter().flat_map(|name| self.vouched_for(name)));
        let there = self.folder.names()?;
        findings.extend(there.iter().filter(|path| !known.contains(*path)).map(|path| Finding::stray(path, "slide")));
        findings.sort();
        Ok(findings)
    }

    /// The names of all files that a slide has which is closed.
    ///
    /// # Errors
    /// If it is not closed, so that others may be at work, a record cannot be read, or the system refuses.
    pub(crate) fn own_names(&self) -> Result<BTreeSet<String>, Error> {
        let (files, unrecorded) = self.listed()?;
        match unrecorded.first() {
            None => Ok(self.names_of(&files)),
            Some(name) => {
                let message = format!(
                    "what others are writing cannot be told from strays before `papsynth slide finalize` has closed the slide ({name} is missing)"
                );
                Err(Error::folder(self.path(), message))
            }
        }
    }

    /// All files but the records, and the records that are missing or are none of this slide.
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

    /// The names of the files that a record must name.
    fn vouched_for(&self, record: &str) -> Vec<String> {
        let at = self.all().find(|&at| record_name(at) == record);
        let mut names = match at {
            Some(at) => {
                ["csv", "geojson", "parquet"].map(|ending| format!("objects/{}.{ending}", name_of(at))).to_vec()
            }
            None => vec![CARD.to_owned(), THUMBNAIL.to_owned()],
        };
        let Forms { image, labels, layers } = &self.forms;
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
        self.all().map(record_name).chain([UPPER.to_owned()])
    }

    fn names_of(&self, files: &[FileRecord]) -> BTreeSet<String> {
        files.iter().map(|file| file.path.clone()).chain(self.record_names()).collect()
    }

    /// The files that are no shard's: what they must be follows from `slide.json`.
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

    /// The name of a shard in its files.
    #[must_use]
    pub fn name_of(at: [u32; 2]) -> String {
        name_of(at)
    }
}
