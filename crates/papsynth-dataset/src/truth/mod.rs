//! Ground truth of frames in the forms of files: summaries, tables, COCO, outlines, labels.

mod coco;
mod frame;
mod labels;
mod polygon;
pub mod rle;
mod splits;
mod table;

pub use coco::truths;
pub(crate) use coco::{AmodalMask, Document, Image, Info, extends_beyond};
pub(crate) use frame::categories;
#[cfg(feature = "zarr")]
pub(crate) use frame::category_name;
pub use frame::{Category, FrameSummary};
pub use labels::Flatten;
pub(crate) use labels::{LabelRuns, layers, overlaps};
pub(crate) use polygon::{Collection, collection, outlines};
pub(crate) use splits::Split;
#[cfg(feature = "parquet")]
pub(crate) use table::{Cell, Head, Kind, part};
pub use table::{Column, columns};
pub(crate) use table::{Named, Row, table, typed_columns};
#[cfg(feature = "zarr")]
pub(crate) use table::{slide_columns, slide_table};
