//! Complete slides on the disk: an OME-Zarr image with labels. Several processes can write its shards; the last step
//! adds the upper levels.
//!
//! | file | content |
//! |---|---|
//! | `slide.json` | inputs, size and shards of the slide |
//! | `recipe.toml`, `model.json` | inputs to generate it again |
//! | `slide.ome.zarr/` | the image and its labels: visible cytoplasm, nucleus and debris, and the number of layers |
//! | `objects/ROW-COLUMN.csv`, `.parquet`, `.geojson` | objects whose centre is in a shard: properties, mask, outline |
//! | `shards/ROW-COLUMN.json` | files of a complete shard with sizes and hashes, written last |
//! | `upper.json` | record of the files that [`SlideSet::finish`] adds: the upper levels, `thumbnail.png`, `README.md` |

mod finish;
mod read;
mod record;
mod set;
mod shard;
mod verify;

pub use finish::SlideSummary;
pub use record::{SlideHead, SlideInfo, SlideRecord};
pub use set::SlideSet;
pub use shard::{SlideProgress, SlideRun};
