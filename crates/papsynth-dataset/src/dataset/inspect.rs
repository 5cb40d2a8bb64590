//! What is in a folder.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

use serde::Serialize;

use super::manifest::Manifest;
use super::record::recorded_shards;
use super::set::Dataset;
use crate::error::Error;
use crate::files::{Check, Folder};

/// What a data set holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Overview {
    /// What it is made from. Its number of frames is that of the last merge: if it is not [`frames`](Self::frames),
    /// the merged files do not know all.
    pub manifest: Manifest,
    /// Number of whole frames.
    pub frames: u64,
    /// Ranges of indices without a whole frame, below the largest index there is.
    pub missing: Vec<Range<u64>>,
    /// Shards of which something is wrong; their frames are among the missing.
    pub defects: Vec<Defect>,
    /// What is wrong with the files of the whole data set, such as `coco.json`.
    pub flaws: Vec<String>,
    /// Number of objects and parts of cells by category.
    pub objects: BTreeMap<String, u64>,
    /// How many of them lie partly outside their image.
    pub truncated: u64,
    /// Columns and rows of the images.
    pub sizes: BTreeSet<[usize; 2]>,
    /// Smallest and largest size of a pixel, µm.
    pub pixel_um: [f64; 2],
    /// Numbers of focal planes.
    pub planes: BTreeSet<usize>,
    /// Bits of a grey level.
    pub bits: BTreeSet<u32>,
    /// Size of the files of all whole frames.
    pub bytes: u64,
}

/// Why a shard is not whole.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Defect {
    /// Number of the shard.
    pub shard: u64,
    /// What is wrong.
    pub message: String,
}

/// Looks at the data set in a folder.
///
/// # Errors
/// If there is none, or the system refuses to read.
pub fn inspect(path: &Path, check: Check) -> Result<Overview, Error> {
    let folder = Folder::new(path);
    let manifest = Manifest::read(&folder)?;
    let dataset = Dataset::of(folder.clone(), manifest.clone());
    let mut overview = Overview {
        manifest,
        frames: 0,
        missing: Vec::new(),
        defects: Vec::new(),
        flaws: Vec::new(),
        objects: BTreeMap::new(),
        truncated: 0,
        sizes: BTreeSet::new(),
        pixel_um: [f64::INFINITY, 0.0],
        planes: BTreeSet::new(),
        bits: BTreeSet::new(),
        bytes: 0,
    };
    for file in &overview.manifest.files {
        overview.flaws.extend(folder.flaw(file, check)?.map(|message| format!("{} {message}", file.path)));
    }
    let mut next = 0;
    for shard in recorded_shards(&folder)? {
        let record = match dataset.whole_or_flaw(shard, check)? {
            Ok(record) => record,
            Err(flaw) => {
                overview.defects.push(Defect { shard, message: flaw.to_string() });
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
    // What a damaged shard at the end had is not known; it has room for these.
    let each = overview.manifest.layout.frames_per_shard;
    let last = overview.defects.last().map(|d| d.shard.saturating_add(1).saturating_mul(each));
    if let Some(last) = last.filter(|last| *last > next) {
        overview.missing.push(next..last);
    }
    Ok(overview)
}

/// The shards that lack a frame of a range, or that are not whole by the sizes of their files: from their records alone, so that it can be asked
/// while others write.
///
/// # Errors
/// If the system refuses to read.
pub fn shards_to_make(dataset: &Dataset, frames: Range<u64>, check: Check) -> Result<Vec<Range<u64>>, Error> {
    let each = dataset.layout.frames_per_shard;
    let dataset = &Dataset { folder: dataset.folder.listed()?, ..dataset.clone() };
    let all = frames.start / each..frames.end.div_ceil(each);
    let (mut missing, mut next) = (Vec::new(), all.start);
    // Most that are missing are known by that alone.
    for shard in recorded_shards(&dataset.folder)?.into_iter().filter(|shard| all.contains(shard)) {
        let room = dataset.frames_of_shard(shard);
        let wanted = room.start.max(frames.start)..room.end.min(frames.end);
        if dataset.whole(shard, check)?.is_some_and(|record| record.covers(&wanted)) {
            missing.extend((next < shard).then_some(next..shard));
            next = shard + 1;
        }
    }
    missing.extend((next < all.end).then_some(next..all.end));
    Ok(missing)
}
