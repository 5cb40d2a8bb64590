//! What is written as Parquet: tables of objects, and the format `huggingface`.

mod failed;
mod features;
mod frames;
mod images;
mod schema;
mod table;
mod writer;

pub(crate) use frames::{card, sink};
pub(crate) use images::images;
pub(crate) use table::Table;
