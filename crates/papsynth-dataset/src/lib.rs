#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod bytes;
mod clean;
mod dataset;
mod error;
mod files;
mod formats;
pub mod memory;
pub mod read;
#[cfg(feature = "zarr")]
pub mod slide;
#[cfg(test)]
#[path = "../tests/support/mod.rs"]
mod support;
mod truth;
mod write;

pub use clean::{Cleaned, clean};
pub use dataset::{
    Dataset, DatasetInfo, Defect, Finding, FramePlace, Identity, Manifest, Mend, Outcome, Overview, Picture, Progress,
    Run, ShardRecord, ShardWriter, Share, Summary, Verdict, convert, field_files, images_of, inspect, shards_to_make,
    truth_differs, verify, write_png,
};
pub use error::{Error, Problem};
#[cfg(feature = "cloud")]
pub use files::Bucket;
pub use files::{Check, FileRecord, Home, Store, write_file};
pub use formats::{Format, Layout};
pub use truth::{Category, Column, Flatten, FrameSummary, columns, rle, truths};
