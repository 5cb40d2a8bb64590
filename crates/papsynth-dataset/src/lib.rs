#![doc = include_str!("../README.md")]

mod coco;
mod dataset;
mod error;
mod files;
mod frame_writer;
mod generate;
mod inspect;
mod layout;
mod merge;
mod picture;
pub mod read;
mod record;
pub mod rle;
#[cfg(test)]
#[path = "../tests/support/mod.rs"]
mod support;
mod table;
mod write;

pub use dataset::{Dataset, DatasetInfo, Summary};
pub use error::{Error, Problem};
pub use files::write_file;
pub use frame_writer::FrameWriter;
pub use generate::{Outcome, Progress, Run};
pub use inspect::{Defect, Overview, inspect};
pub use picture::Picture;
pub use record::{Check, FileRecord, FrameRecord, FrameSummary, Identity, Manifest};
