//! Verification of a data set.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::ops::Range;

use papsynth::key::STREAM_VERSION;
use papsynth::recipe::Recipe;
use serde::Serialize;

use super::contents::{Finding, Fix};
use super::manifest::{Entry, Manifest};
use super::merge::{self, manifest_sha256};
use super::record::{WRITER, read_record, recorded_shards};
use super::set::{Dataset, INPUT_BYTES, map_of};
use crate::bytes::sha256;
use crate::error::Error;
use crate::files::{Check, FileRecord, Folder, Location};
use crate::formats::names;
use crate::read;
use crate::truth::categories;

/// The result of [`verify`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct VerifyReport {
    /// SHA-256 of the manifest, which lists the SHA-256 of every file: data sets with equal roots are equal. `None` if
    /// there are findings.
    pub root: Option<String>,
    /// Number of complete frames.
    pub frames: u64,
    /// Number of files of the data set.
    pub files: u64,
    /// Frames before the last one that a merged data set does not contain: it was generated from other ranges.
    pub not_generated: Vec<Range<u64>>,
    /// All findings, sorted by path.
    pub findings: Vec<Finding>,
}

/// The progress of a verification.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VerifyProgress {
    /// Checked shards; for a slide checked files.
    pub done: u64,
    /// All of them.
    pub total: u64,
}

/// Verifies a data set: reads every file, checks that the files of each shard are consistent, and recomputes the merged
/// files. With `expected`, every frame of that range must exist; otherwise every frame that was merged, and before the
/// merge every frame up to the last. Files of the desktop, such as `.DS_Store`, are ignored.
///
/// # Errors
/// If there is no data set, or a file cannot be read.
pub fn verify(location: impl Into<Location>, expected: Option<Range<u64>>) -> Result<VerifyReport, Error> {
    verify_with_progress(location, expected, &|_| ())
}

/// As [`verify`]; calls `report` after each shard.
///
/// # Errors
/// As [`verify`].
pub fn verify_with_progress(
    location: impl Into<Location>,
    expected: Option<Range<u64>>,
    report: &dyn Fn(VerifyProgress),
) -> Result<VerifyReport, Error> {
    let location = location.into();
    let folder = Folder::new(&location).listed()?;
    verify_in(&folder, location, expected, report).map_err(|error| folder.named(error))
}

fn verify_in(
    folder: &Folder,
    location: Location,
    expected: Option<Range<u64>>,
    report: &dyn Fn(VerifyProgress),
) -> Result<VerifyReport, Error> {
    let mut findings = Vec::new();
    let dataset = match Dataset::open(&location) {
        Ok(dataset) => Dataset { folder: folder.clone(), ..dataset },
        // A broken manifest is the only finding: without it, nothing else can be checked.
        Err(Error::Input { problem, path }) if path == folder.shown().join(names::MANIFEST) => {
            let findings = vec![Finding::damaged(names::MANIFEST, problem.to_string())];
            return Ok(VerifyReport { root: None, frames: 0, files: 1, not_generated: Vec::new(), findings });
        }
        Err(error) => return Err(error),
    };
    let manifest = folder.record(names::MANIFEST)?;
    let Manifest { writer, files: merged, frames: known, shards: closed, .. } = Manifest::read(folder)?;
    let mut listed: BTreeSet<String> = BTreeSet::from([names::MANIFEST.to_owned()]);
    let (mut frames, mut present, mut is_damaged) = (0, Vec::new(), false);
    let mut unreadable = BTreeSet::new();
    let recorded = recorded_shards(folder)?;
    if (recorded.len() as u64) < closed {
        is_damaged = true;
        // Files of a lost record are not untracked.
        listed.extend(listed_files(folder, |shard| recorded.binary_search(&shard).is_err())?);
    }
    for (done, &shard) in (1..).zip(&recorded) {
        listed.insert(names::record(shard));
        match dataset.record_or_finding(shard, Check::Hashes)? {
            Ok(record) => {
                frames += record.frames.len() as u64;
                present.extend(record.frames.iter().map(|frame| frame.index));
                folder.release(record.files.iter().map(|file| file.path.as_str()));
                listed.extend(record.files.into_iter().map(|file| file.path));
            }
            Err(finding) => {
                // Its other files are not untracked, and its frames are not missing.
                present.extend(dataset.frames_of_shard(shard));
                match read_record(folder, shard) {
                    Ok(record) => listed.extend(record.files.into_iter().map(|file| file.path)),
                    Err(_) => drop(unreadable.insert(shard)),
                }
                is_damaged = true;
                findings.push(finding);
            }
        }
        report(VerifyProgress { done, total: recorded.len() as u64 });
    }
    if !unreadable.is_empty() {
        listed.extend(listed_files(folder, |shard| unreadable.contains(&shard))?);
    }
    // A merged data set that lists exactly these shards is complete, also if its ranges have gaps.
    let is_merged = expected.is_none() && closed == recorded.len() as u64 && !merged.is_empty();
    let expected = expected.unwrap_or_else(|| 0..present.last().map_or(0, |last: &u64| last + 1).max(known));
    let (not_generated, missing) = match is_merged {
        true => (gaps(&present, &(0..expected.end)), Vec::new()),
        false => (Vec::new(), gaps(&present, &expected)),
    };
    for gap in missing {
        let message = match gap.end - gap.start {
            1 => format!("missing: frame {}", gap.start),
            _ => format!("missing: frames {}–{}", gap.start, gap.end - 1),
        };
        findings.push(Finding::damaged(names::record(gap.start / dataset.layout.frames_per_shard), message));
    }
    for file in &merged {
        listed.insert(file.path.clone());
        let defect = folder.defect(file, Check::Hashes)?;
        findings.extend(defect.map(|message| Finding::damaged(&file.path, message)));
    }
    // The input files belong to the data set, also before the first merge.
    listed.extend(dataset.given().map(str::to_owned));
    let inputs = input_findings(&dataset, &merged)?;
    let inputs_match = inputs.is_empty();
    findings.extend(inputs);
    // The merged files and the list of files are recomputed only if all shards are complete.
    let is_closed = closed >= recorded.len() as u64 && !merged.is_empty();
    if inputs_match && !is_damaged && is_closed {
        let found: BTreeSet<String> = findings.iter().map(|finding| finding.path.clone()).collect();
        let expected = expected_files(&dataset, &writer, &merged)?;
        for finding in merged_findings(&expected, &merged) {
            listed.insert(finding.path.clone());
            findings.extend((!found.contains(&finding.path)).then_some(finding));
        }
        if manifest_sha256(&dataset, &writer, &expected)? != manifest.sha256 {
            findings.push(Finding::damaged(names::MANIFEST, "its list of files differs from the shards"));
        }
    }
    if !is_closed {
        let message = match recorded.is_empty() {
            true => "no frame is written yet".to_owned(),
            false => format!("merged shards: {closed} of {}", recorded.len()),
        };
        findings.push(Finding { path: names::MANIFEST.to_owned(), message, fix: Fix::Merge });
    }
    let files = listed.len() as u64;
    let is_known = |path: &String| {
        listed.contains(path) || shard_of(path, &dataset).is_some_and(|shard| unreadable.contains(&shard))
    };
    let there = folder.names()?;
    findings.extend(there.iter().filter(|path| !is_known(path)).map(|path| Finding::untracked(path, "data set")));
    findings.sort();
    let root = findings.is_empty().then_some(manifest.sha256);
    Ok(VerifyReport { root, frames, files, not_generated, findings })
}

/// Returns the shard that a file belongs to by its name: `images/000003.png` belongs to the shard of frame 3.
fn shard_of(path: &str, dataset: &Dataset) -> Option<u64> {
    const OF_FRAMES: [&str; 6] = ["images", "preview", "labels", "noise-free", "all-in-focus", "scenes"];
    let (top, name) = path.split_once('/')?;
    let format = dataset.layout.formats.iter().find(|format| format.name() == top);
    let is_of_shard = [names::SHARDS, names::TABLES].contains(&top) || format.is_some_and(|format| format.is_sharded());
    if !is_of_shard && format.is_none() && !OF_FRAMES.contains(&top) {
        return None;
    }
    // Numbers of frames and shards have at least 6 digits.
    let mut numbers = name.split(|c: char| !c.is_ascii_digit()).filter(|digits| digits.len() >= 6);
    let number: u64 = numbers.next_back()?.parse().ok()?;
    Some(if is_of_shard { number } else { number / dataset.layout.frames_per_shard })
}

/// Returns the files, with the record, that the manifest lists for selected shards.
fn listed_files(folder: &Folder, is_selected: impl Fn(u64) -> bool) -> Result<Vec<String>, Error> {
    let path = folder.inside(names::MANIFEST)?;
    let failed = |e| Error::io("read", &path)(e);
    let mut names = Vec::new();
    // One file a line.
    for line in BufReader::new(File::open(&path).map_err(failed)?).lines() {
        let line = line.map_err(failed)?;
        let entry = line.strip_suffix(',').or(line.strip_suffix("]}")).unwrap_or(&line);
        let Ok(entry) = serde_json::from_str::<Entry>(entry) else { continue };
        if entry.shard.is_some_and(&is_selected) {
            names.push(entry.path);
        }
    }
    Ok(names)
}

/// Checks the input files (recipe, model, map) and their entries in the manifest.
fn input_findings(dataset: &Dataset, merged: &[FileRecord]) -> Result<Vec<Finding>, Error> {
    let folder = &dataset.folder;
    let record = |name: &str| merged.iter().find(|file| file.path == name);
    let mut findings = Vec::new();
    let identity = &dataset.identity;
    for (name, sha256) in [(names::RECIPE, &identity.recipe_sha256), (names::MODEL, &identity.model_sha256)] {
        // The manifest lists them after a merge.
        let is_it = match merged.is_empty() {
            true => folder.has(name)? && folder.record(name)?.sha256 == *sha256,
            false => record(name).is_some_and(|file| file.sha256 == *sha256),
        };
        if !is_it {
            let message = match folder.has(name)? {
                true => "changed: the SHA-256 differs from the one in manifest.json",
                false => "missing",
            };
            findings.push(Finding::damaged(name, message));
        }
    }
    if !findings.is_empty() || merged.is_empty() || identity.stream_version != STREAM_VERSION {
        return Ok(findings);
    }
    // A recipe of this stream version can be read; the categories follow from it.
    let path = folder.inside(names::RECIPE)?;
    let text = match read::bytes(&path, INPUT_BYTES) {
        Ok(text) if sha256(&text) == identity.recipe_sha256 => text,
        // It is missing or damaged, which is a finding already.
        Ok(_) | Err(Error::Input { .. }) => return Ok(findings),
        Err(failure) => return Err(failure),
    };
    let Ok(recipe) = Recipe::from_toml(&String::from_utf8_lossy(&text)) else {
        findings.push(Finding::damaged(names::RECIPE, "not a valid recipe"));
        return Ok(findings);
    };
    if dataset.categories != categories(&recipe) {
        findings.push(Finding::damaged(names::MANIFEST, "its categories differ from those of the recipe"));
    }
    let named = map_of(&recipe);
    if let Some(kept) = &dataset.map
        && named != Some(kept)
    {
        findings.push(Finding::damaged(kept, "listed in manifest.json, but not written by papsynth"));
    } else if let Some(named) = named {
        match record(named) {
            None => findings.push(Finding::damaged(named, "missing from the list of files in manifest.json")),
            // The name of a map contains the first digits of its SHA-256.
            Some(file) if !named.contains(&format!("{:.16}", file.sha256)) => {
                findings.push(Finding::damaged(named, "not the map that the recipe names"));
            }
            Some(_) => {}
        }
    }
    Ok(findings)
}

/// Returns the records of the merged files, computed from the shards. Texts and compressed bytes depend on the release
/// that wrote them, so those of another release are as listed in the manifest.
fn expected_files(dataset: &Dataset, writer: &str, merged: &[FileRecord]) -> Result<Vec<FileRecord>, Error> {
    const OF_RELEASE: [&str; 5] =
        [names::CARD, names::CROISSANT, names::SHEET, names::OBJECTS, names::HUGGINGFACE_CARD];
    let given: Vec<&str> = dataset.given().collect();
    let given = merged.iter().filter(|file| given.contains(&file.path.as_str())).cloned().collect();
    let expected = merge::expected(dataset, writer, given)?.into_iter().map(|file| {
        let of_release = writer != WRITER && OF_RELEASE.contains(&file.path.as_str());
        let listed = merged.iter().find(|listed| of_release && listed.path == file.path);
        listed.cloned().unwrap_or(file)
    });
    Ok(expected.collect())
}

/// Returns the merged files that differ from those computed from the shards.
fn merged_findings(expected: &[FileRecord], merged: &[FileRecord]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for file in expected {
        let message = match merged.iter().find(|found| found.path == file.path) {
            Some(found) if found == file => continue,
            Some(_) => "differs from the shards",
            None => "missing from the list of files in manifest.json",
        };
        findings.push(Finding::damaged(&file.path, message));
    }
    for file in merged.iter().filter(|file| expected.iter().all(|expected| expected.path != file.path)) {
        findings.push(Finding::damaged(&file.path, "listed in manifest.json, but not written by papsynth"));
    }
    findings
}

/// Returns the parts of a range that contain none of the sorted indices.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_the_missing_ranges() {
        assert_eq!(gaps(&[1, 2, 5, 9], &(0..8)), [0..1, 3..5, 6..8]);
        assert_eq!(gaps(&[3], &(3..6)).first(), Some(&(4..6)));
        assert!(gaps(&[0, 1], &(0..2)).is_empty() && gaps(&[], &(0..0)).is_empty());
    }
}
