//! Data sets: creation and resumption, generation, merging, reading, verification.

mod begin;
mod card;
mod contents;
mod convert;
mod generate;
mod images;
mod inspect;
mod manifest;
mod merge;
mod occupied;
mod record;
mod rgb_image;
mod set;
mod shard_writer;
mod verify;

pub use begin::DatasetInfo;
pub use contents::{Finding, Fix};
pub use convert::convert;
pub use generate::{Outcome, Progress, Run, Task};
pub use images::{FrameLocation, field_files, image_paths, truth_difference};
pub use inspect::{Overview, inspect, missing_shards};
pub use manifest::Manifest;
pub(crate) use occupied::nested_below;
#[cfg(feature = "zarr")]
pub(crate) use occupied::{SLIDE, any_content, recipe_difference, refuse_nested};
pub use record::{Identity, ShardRecord};
#[cfg(feature = "zarr")]
pub(crate) use record::{WRITER, is_inside};
pub(crate) use record::{read_record, recorded_shards};
pub use rgb_image::{RgbImage, write_png};
pub(crate) use set::named_map;
pub use set::{Dataset, Summary};
pub use shard_writer::ShardWriter;
pub use verify::{VerifyProgress, VerifyReport, verify, verify_with_progress};
