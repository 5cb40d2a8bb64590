//! Verification finds every change of a file.

#![allow(clippy::cast_possible_truncation, reason = "the numbers are small")]

mod damage;
mod forged;

use std::path::Path;

use crate::support::{SEED, Scratch, frame, recipe};
use papsynth::model::Model;
use papsynth_dataset::{Check, Dataset, DatasetInfo, Format, Layout, VerifyReport, verify};

/// Generates a data set of a stack and two images in all formats.
fn make(name: &str) -> Scratch {
    let scratch = Scratch::new(name);
    fill(scratch.path(), 2);
    scratch
}

/// Creates or resumes the data set, and merges it.
fn fill(path: &Path, frames_per_shard: usize) {
    let layout = Layout { frames_per_shard: frames_per_shard as u64, ..Layout::new(Format::built()) };
    let info = DatasetInfo { recipe: &recipe(), model: &Model::builtin(), seed: SEED, map: None, layout: &layout };
    let dataset = Dataset::create_or_resume(path, &info).unwrap();
    let frames = [frame(0, 2, 8, 1), frame(1, 1, 8, 1), frame(2, 1, 12, 1)];
    for (shard, frames) in (0..).zip(frames.chunks(frames_per_shard)) {
        if dataset.complete_record(shard, Check::Hashes).unwrap().is_some() {
            continue;
        }
        let mut writer = dataset.shard_writer(shard).unwrap();
        for frame in frames {
            writer.begin(&frame.finished.scene).unwrap();
            frame.planes.iter().for_each(|plane| writer.write_plane(plane).unwrap());
            writer.end(&frame.finished).unwrap();
        }
        writer.commit().unwrap();
    }
    dataset.finish().unwrap();
}

fn look(path: &Path) -> VerifyReport {
    verify(path, Some(0..3)).unwrap()
}

/// Whether the finding is about this file, or about the record or manifest that names it.
fn is_found(report: &VerifyReport, name: &str) -> bool {
    report.root.is_none() && report.findings.iter().any(|finding| finding.path == name)
}
