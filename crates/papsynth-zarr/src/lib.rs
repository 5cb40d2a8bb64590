#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod array;
mod document;
mod error;
mod pyramid;
mod read;
mod sample;
mod shard;

pub use array::{Array, Block, Shard};
pub use document::{Channel, Coordinates, Image, Labels, VERSION};
pub use error::Error;
pub use pyramid::{Pyramid, PyramidShape, Tiling, levels_until};
pub use read::ShardReader;
pub use sample::{DataType, Sample, halved, halved_labels};
pub use shard::{ShardEncoder, shard_bytes};
