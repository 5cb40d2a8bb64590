#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod card;
mod clean;
mod coco;
mod compare;
mod contents;
mod convert;
mod dataset;
mod difference;
mod error;
mod files;
mod flatten;
mod formats;
mod frames;
mod generate;
mod image_of;
mod inspect;
mod layers;
mod layout;
pub mod memory;
mod merge;
mod nested;
#[cfg_attr(not(feature = "parquet"), path = "no_parquet.rs")]
mod parquet;
mod picture;
mod polygon;
pub mod read;
mod record;
pub mod rle;
mod shard_writer;
#[cfg(feature = "zarr")]
pub mod slide;
mod splits;
mod store;
#[cfg(test)]
#[path = "../tests/support/mod.rs"]
mod support;
mod table;
mod verify;
mod write;

pub use clean::{Cleaned, clean};
pub use coco::Category;
pub use compare::{frames_of, images_of, truth_differs};
pub use convert::convert;
pub use dataset::{Dataset, DatasetInfo, Summary};
pub use error::{Error, Problem};
pub use files::write_file;
pub use flatten::Flatten;
pub use formats::Format;
pub use frames::FramePlace;
pub use generate::{Outcome, Progress, Run, Share};
pub use inspect::{Defect, Overview, inspect, shards_to_make};
pub use layout::Layout;
pub use picture::Picture;
pub use picture::write_png;
pub use record::{Check, FileRecord, FrameSummary, Identity, Manifest, ShardRecord};
pub use shard_writer::ShardWriter;
pub use store::{Home, Store};
pub use table::{Column, columns};
pub use verify::{Finding, Mend, Verdict, verify};
