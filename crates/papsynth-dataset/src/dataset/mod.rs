//! Data sets: begun and resumed, made, merged, read back, verified.

mod begin;
mod card;
mod compare;
mod contents;
mod convert;
pub(crate) mod difference;
mod fields;
mod generate;
mod images;
mod inspect;
mod listing;
mod manifest;
mod merge;
pub(crate) mod nested;
mod picture;
mod record;
mod set;
mod shard_writer;
mod verify;
mod whole;

pub use begin::DatasetInfo;
#[cfg(feature = "zarr")]
pub(crate) use begin::stranger;
pub use compare::{frames_of, images_of, truth_differs};
pub use convert::convert;
pub use fields::field_files;
pub use generate::{Outcome, Progress, Run, Share};
pub use images::FramePlace;
pub use inspect::{Defect, Overview, inspect, shards_to_make};
pub use manifest::Manifest;
pub use picture::{Picture, write_png};
pub use record::{Identity, ShardRecord};
#[cfg(feature = "zarr")]
pub(crate) use record::{WRITER, lies_inside};
pub use set::{Dataset, Summary};
pub(crate) use set::{read_record, recorded_shards};
pub use shard_writer::ShardWriter;
pub use verify::{Finding, Mend, Verdict, verify};
