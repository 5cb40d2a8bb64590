//! Statistics of a data set.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

use serde::Serialize;

use super::contents::Finding;
use super::manifest::Manifest;
use super::record::recorded_shards;
use super::set::Dataset;
use crate::error::Error;
use crate::files::{Check, Folder};

/// Statistics of a data set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Overview {
    /// The manifest. Its number of frames is that of the last merge: if it differs from [`frames`](Self::frames), the
    /// merged files are out of date.
    pub manifest: Manifest,
    /// Number of complete frames.
    pub frames: u64,
    /// Ranges of indices without a complete frame, below the largest index.
    pub missing: Vec<Range<u64>>,
    /// First defect of each damaged shard. The frames of these shards are missing.
    pub damaged_shards: Vec<Finding>,
    /// Defects of merged files, for example `coco.json`.
    pub damaged_files: Vec<Finding>,
    /// Number of objects and parts of cells by category.
    pub objects: BTreeMap<String, u64>,
    /// Number of them that are partly outside their image.
    pub truncated: u64,
    /// Sizes of the images: columns and rows.
    pub sizes: BTreeSet<[usize; 2]>,
    /// Smallest and largest size of a pixel, µm.
    pub pixel_um: [f64; 2],
    /// Numbers of focal planes of the frames.
    pub planes: BTreeSet<usize>,
    /// Bits of a grey level.
    pub bits: BTreeSet<u32>,
    /// Size of the files of all complete frames.
    pub bytes: u64,
}

/// Reads the statistics of the data set in a folder.
///
/// # Errors
/// If there is none, or a file cannot be read.
pub fn inspect(path: &Path, check: Check) -> Result<Overview, Error> {
    let folder = Folder::new(path);
    let manifest = Manifest::read(&folder)?;
    let dataset = Dataset::of(folder.clone(), manifest.clone());
    let mut overview = Overview {
        manifest,
        frames: 0,
        missing: Vec::new(),
        damaged_shards: Vec::new(),
        damaged_files: Vec::new(),
        objects: BTreeMap::new(),
        truncated: 0,
        sizes: BTreeSet::new(),
        pixel_um: [f64::INFINITY, 0.0],
        planes: BTreeSet::new(),
        bits: BTreeSet::new(),
        bytes: 0,
    };
    for file in &overview.manifest.files {
        let flaw = folder.flaw(file, check)?;
        overview.damaged_files.extend(flaw.map(|message| Finding::damaged(&file.path, message)));
    }
    let (mut next, mut last_damaged) = (0, None);
    for shard in recorded_shards(&folder)? {
        let record = match dataset.record_or_finding(shard, check)? {
            Ok(record) => record,
            Err(finding) => {
                overview.damaged_shards.push(finding);
                last_damaged = Some(shard);
                continue;
            }
        };
        overview.bytes += record.files.iter().map(|f| f.bytes).sum::<u64>();
        for frame in record.frames {
            if next < frame.index {
                overview.missing.push(next..frame.index);
            }
            next = frame.index + 1;
            overview.frames += 1;
            for (category, count) in frame.objects {
                *overview.objects.entry(category).or_insert(0) += count;
            }
            overview.truncated += frame.truncated;
            overview.sizes.insert([frame.width, frame.height]);
            let [least, most] = overview.pixel_um;
            overview.pixel_um = [least.min(frame.pixel_um), most.max(frame.pixel_um)];
            overview.planes.insert(frame.planes_um.len());
            overview.bits.insert(frame.bits);
        }
    }
    // The frames of a damaged last shard are unknown: all that it can contain count as missing.
    let each = overview.manifest.layout.frames_per_shard;
    let last = last_damaged.map(|shard| shard.saturating_add(1).saturating_mul(each));
    if let Some(last) = last.filter(|last| *last > next) {
        overview.missing.push(next..last);
    }
    Ok(overview)
}

/// Returns the shards that are incomplete or lack a frame of a range. It reads only records and files of shards, so
/// that it can run while other processes write.
///
/// # Errors
/// If a file cannot be read.
pub fn missing_shards(dataset: &Dataset, frames: Range<u64>, check: Check) -> Result<Vec<Range<u64>>, Error> {
    let each = dataset.layout.frames_per_shard;
    let dataset = &Dataset { folder: dataset.folder.listed()?, ..dataset.clone() };
    let all = frames.start / each..frames.end.div_ceil(each);
    let (mut missing, mut next) = (Vec::new(), all.start);
    for shard in recorded_shards(&dataset.folder)?.into_iter().filter(|shard| all.contains(shard)) {
        let own = dataset.frames_of_shard(shard);
        let wanted = own.start.max(frames.start)..own.end.min(frames.end);
        if dataset.complete_record(shard, check)?.is_some_and(|record| record.covers(&wanted)) {
            missing.extend((next < shard).then_some(next..shard));
            next = shard + 1;
        }
    }
    missing.extend((next < all.end).then_some(next..all.end));
    Ok(missing)
}
