//! Data sets: begun and resumed, made, merged, read back, verified.

mod begin;
mod card;
mod contents;
mod convert;
mod generate;
mod images;
mod inspect;
mod manifest;
mod merge;
mod picture;
mod record;
mod set;
mod shard_writer;
mod taken;
mod verify;

pub use begin::DatasetInfo;
pub use contents::{Finding, Mend};
pub use convert::convert;
pub use generate::{Outcome, Progress, Run, Share};
pub use images::{FramePlace, field_files, images_of, truth_differs};
pub use inspect::{Defect, Overview, inspect, shards_to_make};
pub use manifest::Manifest;
pub use picture::{Picture, write_png};
pub use record::{Identity, ShardRecord};
#[cfg(feature = "zarr")]
pub(crate) use record::{WRITER, lies_inside};
pub(crate) use record::{read_record, recorded_shards};
pub use set::{Dataset, Summary};
pub use shard_writer::ShardWriter;
pub(crate) use taken::nested_below;
#[cfg(feature = "zarr")]
pub(crate) use taken::{SLIDE, recipe_difference, refuse_nested, stranger};
pub use verify::{Verdict, verify};
