//! Whole slides on the disk: an OME-Zarr image with labels, written shard by shard by whoever has time, and closed at the end.
//!
//! | file | content |
//! |---|---|
//! | `slide.json` | what the slide is made from, and how it is cut |
//! | `recipe.toml`, `model.json` | what to make it again with |
//! | `slide.ome.zarr/` | the picture and its labels: front-most cytoplasm, nucleus and debris, and the number of layers |
//! | `objects/ROW-COLUMN.csv`, `.parquet`, `.geojson` | every object whose middle lies in a shard: numbers, mask, outline |
//! | `shards/ROW-COLUMN.json` | files of a shard with sizes and hashes, written last: the shard is whole |
//! | `upper.json` | the same of what [`SlideSet::finish`] adds: the upper levels, `thumbnail.png`, `README.md` |

mod finish;
mod read;
mod record;
mod set;
mod shard;
mod verify;

pub use finish::Finished;
pub use record::{SlideHead, SlideInfo, SlideRecord};
pub use set::SlideSet;
pub use shard::{SlideProgress, SlideRun};
