//! What is true of a frame, in the forms that files hold: numbers, tables, COCO, outlines, labels.

mod category;
mod coco;
mod flatten;
mod frame;
mod geojson;
mod layers;
mod polygon;
pub mod rle;
mod splits;
mod table;

pub use category::Category;
pub(crate) use category::categories;
#[cfg(feature = "zarr")]
pub(crate) use category::category_name;
pub use coco::truths;
pub(crate) use coco::{Annotation, Document, Image, Info};
pub use flatten::Flatten;
pub use frame::FrameSummary;
pub(crate) use frame::{Form, Geometry};
pub(crate) use geojson::collection;
pub(crate) use layers::layers;
pub(crate) use polygon::outlines;
pub(crate) use splits::Split;
#[cfg(feature = "parquet")]
pub(crate) use table::part;
pub(crate) use table::{Cell, Sort, table, typed_cells, typed_columns};
pub use table::{Column, columns};
#[cfg(feature = "zarr")]
pub(crate) use table::{slide_cells, slide_columns, slide_table};
