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

pub use clean::{Cleaned, clean, cleanable};
pub use dataset::{
    Dataset, DatasetInfo, Finding, Fix, FrameLocation, Identity, Manifest, Outcome, Overview, Progress, RgbImage, Run,
    ShardRecord, ShardWriter, Summary, Task, VerifyProgress, VerifyReport, convert, field_files, image_paths, inspect,
    missing_shards, truth_difference, verify, verify_with_progress, write_png,
};
pub use error::{Error, InputError};
#[cfg(feature = "cloud")]
pub use files::Bucket;
pub use files::{Check, FileRecord, Location, Store, write_file};
pub use formats::{Extra, Format, Layout};
pub use truth::{Category, Column, Flatten, FrameSummary, columns, rle, truths};
