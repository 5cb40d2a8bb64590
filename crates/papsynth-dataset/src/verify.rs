//! Whether a data set is whole to the last bit.

use std::collections::BTreeSet;
use std::fs;
use std::ops::Range;
use std::path::Path;

use serde::Serialize;

use crate::dataset::{Dataset, read_record, recorded_shards, whole_record};
use crate::error::{Error, Problem};
use crate::files::{Folder, is_temporary};
use crate::layout;
use crate::merge;
use crate::record::{Check, Manifest};

/// What is wrong with a data set, if anything is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// SHA-256 of the manifest, which names every file with its own: two data sets with the same are the same. Only of one that is
    /// whole.
    pub root: Option<String>,
    /// Number of whole frames.
    pub frames: u64,
    /// Number of files that were read.
    pub files: u64,
    /// Everything that is wrong, by path.
    pub findings: Vec<Finding>,
}

/// One thing that is wrong.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Finding {
    /// The file, relative to the data set.
    pub path: String,
    /// What is wrong with it.
    pub message: String,
    /// What mends it.
    pub mend: Mend,
}

/// What mends a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mend {
    /// `papsynth generate --verify` with the same recipe makes it again.
    Generate,
    /// `papsynth clean` takes it away.
    Clean,
}

/// Reads every file of a data set. With `expected`, every frame of that range must be there; without, every frame up to the last.
///
/// # Errors
/// If there is no data set, or the system refuses to read.
pub fn verify(path: &Path, expected: Option<Range<u64>>) -> Result<Verdict, Error> {
    let folder = Folder::new(path);
    let mut findings = Vec::new();
    let mut find = |path: String, message: String, mend| findings.push(Finding { path, message, mend });
    let dataset = match Dataset::open(path) {
        Ok(dataset) => dataset,
        // Where there is a manifest, there is a data set: its first finding is that the manifest is broken.
        Err(Error::Input { problem, path }) if path == folder.path(layout::MANIFEST) => {
            find(layout::MANIFEST.to_owned(), problem.to_string(), Mend::Generate);
            return Ok(Verdict { root: None, frames: 0, files: 1, findings });
        }
        Err(error) => return Err(error),
    };
    let manifest = folder.record(layout::MANIFEST)?;
    let mut listed: BTreeSet<String> = BTreeSet::from([layout::MANIFEST.to_owned()]);
    let (mut frames, mut there) = (0, Vec::new());
    for shard in recorded_shards(&folder)? {
        listed.insert(layout::record(shard));
        match whole_record(&folder, &dataset.identity, &dataset.layout, shard, Check::Hashes)? {
            Ok(record) => {
                frames += record.frames.len() as u64;
                there.extend(record.frames.iter().map(|frame| frame.index));
                listed.extend(record.files.into_iter().map(|file| file.path));
            }
            Err(flaw) => {
                // What else it has is no stray, and its frames are not missing.
                there.extend(dataset.frames_of_shard(shard));
                if let Ok(record) = read_record(&folder, shard) {
                    listed.extend(record.files.into_iter().map(|file| file.path));
                }
                find(flaw.path, flaw.message, Mend::Generate);
            }
        }
    }
    let expected = expected.unwrap_or_else(|| 0..there.last().map_or(0, |last: &u64| last + 1));
    for gap in gaps(&there, &expected) {
        let message = match gap.end - gap.start {
            1 => format!("is missing with frame {}", gap.start),
            _ => format!("is missing with frame {}, as are all up to frame {}", gap.start, gap.end - 1),
        };
        find(layout::record(gap.start / dataset.layout.frames_per_shard), message, Mend::Generate);
    }
    let merged = Manifest::read(&folder)?.files;
    for file in &merged {
        listed.insert(file.path.clone());
        if let Some(message) = folder.flaw(file, Check::Hashes)? {
            find(file.path.clone(), message, Mend::Generate);
        }
    }
    // The list of files is made again and compared, if all are there to make it from.
    if findings.is_empty() && merge::manifest_sha256(&dataset, &merged)? != manifest.sha256 {
        let message = "does not name the files that are there".to_owned();
        findings.push(Finding { path: layout::MANIFEST.to_owned(), message, mend: Mend::Generate });
    }
    let files = listed.len() as u64;
    for path in files_below(&folder)? {
        if !listed.contains(&path) {
            let message = match is_temporary(path.rsplit('/').next().unwrap_or(&path)) {
                true => "was left behind by a run that was killed",
                false => "is no file of the data set",
            };
            findings.push(Finding { path, message: message.to_owned(), mend: Mend::Clean });
        }
    }
    findings.sort();
    let root = findings.is_empty().then_some(manifest.sha256);
    Ok(Verdict { root, frames, files, findings })
}

/// The parts of a range that are not among these indices, which are sorted.
fn gaps(there: &[u64], expected: &Range<u64>) -> Vec<Range<u64>> {
    let mut gaps = Vec::new();
    let mut next = expected.start;
    for &index in there.iter().filter(|index| expected.contains(index)).chain([&expected.end]) {
        if next < index {
            gaps.push(next..index);
        }
        next = index + 1;
    }
    gaps
}

/// Every file below a folder, by its path from there. Links are files: nothing of ours is one.
fn files_below(folder: &Folder) -> Result<Vec<String>, Error> {
    let mut found = Vec::new();
    for path in folder.folders()? {
        for entry in fs::read_dir(&path).map_err(Error::io("read", &path))? {
            let entry = entry.map_err(Error::io("read", &path))?;
            if entry.file_type().map_err(Error::io("read", &path))?.is_dir() {
                continue;
            }
            let below = entry.path();
            let below = below.strip_prefix(folder.root()).map_err(|_| {
                Error::input(&path)(Problem::Differs { what: "a file lies outside the folder".to_owned() })
            })?;
            let parts: Vec<String> = below.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
            found.push(parts.join("/"));
        }
    }
    found.sort();
    Ok(found)
}

/// What [`clean`] took away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Cleaned {
    /// Files that runs which were killed left behind.
    pub temporary: u64,
    /// Other files that are none of the data set's.
    pub strays: u64,
}

/// Removes from a data set what killed runs left behind and, if wanted, everything else that is none of its files.
///
/// # Errors
/// If there is no data set, a record cannot be read (then strays cannot be told), or the system refuses.
pub fn clean(path: &Path, strays: bool) -> Result<Cleaned, Error> {
    let folder = Folder::new(path);
    let manifest = Manifest::read(&folder)?;
    let mut cleaned = Cleaned { temporary: folder.sweep()?, strays: 0 };
    if !strays {
        return Ok(cleaned);
    }
    let mut listed: BTreeSet<String> = manifest.files.into_iter().map(|file| file.path).collect();
    listed.insert(layout::MANIFEST.to_owned());
    for shard in recorded_shards(&folder)? {
        listed.insert(layout::record(shard));
        listed.extend(read_record(&folder, shard)?.files.into_iter().map(|file| file.path));
    }
    for name in files_below(&folder)? {
        // A temporary file that is still there is somebody's work.
        let file_name = name.rsplit('/').next().unwrap_or(&name);
        if !listed.contains(&name) && !is_temporary(file_name) {
            let path = folder.path(&name);
            fs::remove_file(&path).map_err(Error::io("remove", &path))?;
            cleaned.strays += 1;
        }
    }
    Ok(cleaned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_what_is_not_there() {
        assert_eq!(gaps(&[1, 2, 5, 9], &(0..8)), [0..1, 3..5, 6..8]);
        assert_eq!(gaps(&[3], &(3..6)).first(), Some(&(4..6)));
        assert!(gaps(&[0, 1], &(0..2)).is_empty() && gaps(&[], &(0..0)).is_empty());
    }
}
