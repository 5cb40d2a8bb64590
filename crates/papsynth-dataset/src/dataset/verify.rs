//! Whether a data set is whole to the last bit.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::ops::Range;

use papsynth::key::STREAM_VERSION;
use papsynth::recipe::{self, Recipe};
use serde::Serialize;

use super::contents::{Finding, Mend};
use super::manifest::{Entry, Manifest};
use super::merge::{self, manifest_sha256};
use super::record::{WRITER, read_record, recorded_shards};
use super::set::Dataset;
use crate::bytes::sha256;
use crate::error::Error;
use crate::files::{Check, FileRecord, Folder, Home};
use crate::formats::names;
use crate::read;
use crate::truth::categories;

/// Largest recipe that is read back.
const GIVEN_BYTES: u64 = 1 << 28;

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

/// Reads every file of a data set, compares the files of each shard with each other, and makes again what is merged of them. With `expected`, every frame of that range must be there; without, every frame up to the last.
///
/// # Errors
/// If there is no data set, or the system refuses to read.
pub fn verify(home: impl Into<Home>, expected: Option<Range<u64>>) -> Result<Verdict, Error> {
    let home = home.into();
    let folder = Folder::new(&home).listed()?;
    verify_in(&folder, home, expected).map_err(|error| folder.named(error))
}

fn verify_in(folder: &Folder, home: Home, expected: Option<Range<u64>>) -> Result<Verdict, Error> {
    let mut findings = Vec::new();
    let dataset = match Dataset::open(&home) {
        Ok(dataset) => Dataset { folder: folder.clone(), ..dataset },
        // Where there is a manifest, there is a data set: its first finding is that the manifest is broken.
        Err(Error::Input { problem, path }) if path == folder.shown().join(names::MANIFEST) => {
            let findings = vec![Finding::made_wrong(names::MANIFEST, problem.to_string())];
            return Ok(Verdict { root: None, frames: 0, files: 1, findings });
        }
        Err(error) => return Err(error),
    };
    let manifest = folder.record(names::MANIFEST)?;
    let Manifest { writer, files: merged, frames: known, shards: closed, .. } = Manifest::read(folder)?;
    let mut listed: BTreeSet<String> = BTreeSet::from([names::MANIFEST.to_owned()]);
    let (mut frames, mut there, mut is_damaged) = (0, Vec::new(), false);
    let recorded = recorded_shards(folder)?;
    if (recorded.len() as u64) < closed {
        // What a lost record vouched for is no stray, and what was merged was made of it.
        is_damaged = true;
        listed.extend(names_of_lost(folder, &recorded)?);
    }
    for &shard in &recorded {
        listed.insert(names::record(shard));
        match dataset.whole_or_flaw(shard, Check::Hashes)? {
            Ok(record) => {
                frames += record.frames.len() as u64;
                there.extend(record.frames.iter().map(|frame| frame.index));
                folder.release(record.files.iter().map(|file| file.path.as_str()));
                listed.extend(record.files.into_iter().map(|file| file.path));
            }
            Err(flaw) => {
                // What else it has is no stray, and its frames are not missing.
                there.extend(dataset.frames_of_shard(shard));
                if let Ok(record) = read_record(folder, shard) {
                    listed.extend(record.files.into_iter().map(|file| file.path));
                }
                is_damaged = true;
                findings.push(flaw);
            }
        }
    }
    let expected = expected.unwrap_or_else(|| 0..there.last().map_or(0, |last: &u64| last + 1).max(known));
    for gap in gaps(&there, &expected) {
        let message = match gap.end - gap.start {
            1 => format!("is missing with frame {}", gap.start),
            _ => format!("is missing with frame {}, as are all up to frame {}", gap.start, gap.end - 1),
        };
        findings.push(Finding::made_wrong(names::record(gap.start / dataset.layout.frames_per_shard), message));
    }
    for file in &merged {
        listed.insert(file.path.clone());
        let flaw = folder.flaw(file, Check::Hashes)?;
        findings.extend(flaw.map(|message| Finding::made_wrong(&file.path, message)));
    }
    if merged.is_empty() {
        listed.extend(dataset.given().map(str::to_owned).chain(named_map(folder)));
    }
    let given = given_flaws(&dataset, &merged)?;
    let is_known = given.is_empty();
    findings.extend(given);
    // What is merged is made again and compared, and then the list of files, if all are there to make them from.
    let is_closed = closed >= recorded.len() as u64 && !merged.is_empty();
    if is_known && !is_damaged && is_closed {
        let found: BTreeSet<String> = findings.iter().map(|finding| finding.path.clone()).collect();
        for flaw in merged_flaws(&dataset, &writer, &merged)? {
            listed.insert(flaw.path.clone());
            findings.extend((!found.contains(&flaw.path)).then_some(flaw));
        }
    }
    if !is_closed {
        let message = match recorded.is_empty() {
            true => "no frame is made yet".to_owned(),
            false => format!("{} of {} shards are merged", closed, recorded.len()),
        };
        findings.push(Finding { path: names::MANIFEST.to_owned(), message, mend: Mend::Merge });
    }
    if findings.is_empty() && manifest_sha256(&dataset, &writer, &merged)? != manifest.sha256 {
        findings.push(Finding::made_wrong(names::MANIFEST, "does not name the files that are there"));
    }
    let files = listed.len() as u64;
    let there = folder.names()?;
    findings.extend(there.iter().filter(|path| !listed.contains(*path)).map(|path| Finding::stray(path, "data set")));
    findings.sort();
    let root = findings.is_empty().then_some(manifest.sha256);
    Ok(Verdict { root, frames, files, findings })
}

/// The files that the manifest lists of shards whose records are gone, the records too.
fn names_of_lost(folder: &Folder, recorded: &[u64]) -> Result<Vec<String>, Error> {
    let path = folder.inside(names::MANIFEST)?;
    let failed = |e| Error::io("read", &path)(e);
    let mut names = Vec::new();
    // A file a line.
    for line in BufReader::new(File::open(&path).map_err(failed)?).lines() {
        let line = line.map_err(failed)?;
        let entry = line.strip_suffix(',').or(line.strip_suffix("]}")).unwrap_or(&line);
        let Ok(entry) = serde_json::from_str::<Entry>(entry) else { continue };
        if entry.shard.is_some_and(|shard| recorded.binary_search(&shard).is_err()) {
            names.push(entry.path);
        }
    }
    Ok(names)
}

/// What is wrong with the files that the data set was begun with, and with what the manifest says of them.
fn given_flaws(dataset: &Dataset, merged: &[FileRecord]) -> Result<Vec<Finding>, Error> {
    let folder = &dataset.folder;
    let record = |name: &str| merged.iter().find(|file| file.path == name);
    let mut flaws = Vec::new();
    let identity = &dataset.identity;
    for (name, sha256) in [(names::RECIPE, &identity.recipe_sha256), (names::MODEL, &identity.model_sha256)] {
        // A data set that was only begun lists none; of one that is merged, none is left out.
        let is_it = match merged.is_empty() {
            true => folder.has(name)? && folder.record(name)?.sha256 == *sha256,
            false => record(name).is_some_and(|file| file.sha256 == *sha256),
        };
        if !is_it {
            flaws.push(Finding::made_wrong(name, "is not what the manifest says the data set is made from"));
        }
    }
    if !flaws.is_empty() || merged.is_empty() || identity.stream_version != STREAM_VERSION {
        return Ok(flaws);
    }
    // Of these streams the recipe is one that this program reads: what there may be in the images follows from it.
    let path = folder.inside(names::RECIPE)?;
    let text = match read::bytes(&path, GIVEN_BYTES) {
        Ok(text) if sha256(&text) == identity.recipe_sha256 => text,
        // It is missing or damaged, which has been found already.
        Ok(_) | Err(Error::Input { .. }) => return Ok(flaws),
        Err(failure) => return Err(failure),
    };
    let Ok(recipe) = Recipe::from_toml(&String::from_utf8_lossy(&text)) else {
        flaws.push(Finding::made_wrong(names::RECIPE, "is no recipe that this program reads"));
        return Ok(flaws);
    };
    if dataset.categories != categories(&recipe) {
        flaws.push(Finding::made_wrong(names::MANIFEST, "names other categories than the recipe gives"));
    }
    let named = map_of(&recipe);
    match (named, &dataset.map) {
        (Some(named), None) => flaws.push(Finding::made_wrong(named, "is missing from the list of files")),
        (_, Some(kept)) if named != Some(kept) => {
            flaws.push(Finding::made_wrong(kept, "follows neither from recipe nor from shards"));
        }
        // The name of a map begins with the hash of its content.
        (Some(named), Some(_))
            if record(named).is_some_and(|file| !named.contains(&format!("{:.16}", file.sha256))) =>
        {
            flaws.push(Finding::made_wrong(named, "is another map than the recipe names"));
        }
        _ => {}
    }
    Ok(flaws)
}

fn map_of(recipe: &Recipe) -> Option<&String> {
    match &recipe.layout {
        recipe::Layout::DensityMap { path } | recipe::Layout::Labels(recipe::Labels { path, .. }) => Some(path),
        _ => None,
    }
}

/// The map that the recipe in a folder names, if there is a recipe that this program reads.
fn named_map(folder: &Folder) -> Option<String> {
    let text = read::bytes(&folder.inside(names::RECIPE).ok()?, GIVEN_BYTES).ok()?;
    map_of(&Recipe::from_toml(&String::from_utf8_lossy(&text)).ok()?).cloned()
}

/// Merged files that are not as the shards make them.
fn merged_flaws(dataset: &Dataset, writer: &str, merged: &[FileRecord]) -> Result<Vec<Finding>, Error> {
    let given: Vec<&str> = dataset.given().collect();
    let given = merged.iter().filter(|file| given.contains(&file.path.as_str())).cloned().collect();
    let expected = merge::expected(dataset, writer, given)?;
    let mut flaws = Vec::new();
    for file in &expected {
        // The words of a card and the bytes of what is compressed are those of one program.
        let of_program = [names::CARD, names::CROISSANT, names::SHEET, names::OBJECTS, names::HUGGINGFACE_CARD];
        let is_ours = writer == WRITER || !of_program.contains(&file.path.as_str());
        let message = match merged.iter().find(|found| found.path == file.path) {
            Some(found) if found == file || !is_ours => continue,
            Some(_) => "is not what the shards make it",
            None => "is missing from the list of files",
        };
        flaws.push(Finding::made_wrong(&file.path, message));
    }
    for file in merged.iter().filter(|file| expected.iter().all(|expected| expected.path != file.path)) {
        flaws.push(Finding::made_wrong(&file.path, "follows neither from recipe nor from shards"));
    }
    Ok(flaws)
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
