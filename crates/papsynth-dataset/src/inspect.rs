//! What is in a folder.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

use serde::Serialize;

use crate::dataset::{read_manifest, recorded_frames, whole_record};
use crate::error::Error;
use crate::files::Folder;
use crate::record::{Check, Manifest};

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
    /// Frames of which something is wrong; they are among the missing.
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

/// Why a frame is not whole.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Defect {
    /// Index of the frame.
    pub index: u64,
    /// What is wrong.
    pub message: String,
}

/// Looks at the data set in a folder.
///
/// # Errors
/// If there is none, or the system refuses to read.
pub fn inspect(path: &Path, check: Check) -> Result<Overview, Error> {
    let folder = Folder::new(path);
    let manifest = read_manifest(&folder)?;
    let identity = manifest.identity.clone();
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
        overview.flaws.extend(folder.flaw(file, check)?);
    }
    let mut next = 0;
    for index in recorded_frames(&folder)? {
        let record = match whole_record(&folder, &identity, index, check)? {
            Ok(record) => record,
            Err(message) => {
                overview.defects.push(Defect { index, message });
                continue;
            }
        };
        if next < index {
            overview.missing.push(next..index);
        }
        next = index + 1;
        overview.frames += 1;
        overview.bytes += record.files.iter().map(|f| f.bytes).sum::<u64>();
        let frame = record.summary;
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
    if let Some(last) = overview.defects.last().filter(|d| d.index >= next) {
        overview.missing.push(next..last.index + 1);
    }
    Ok(overview)
}
