#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod error;
mod guard;
mod leaf;
mod pages;
mod reader;
mod schema;
mod shape;
mod thrift;
mod value;
mod writer;

pub use error::Error;
pub use reader::{Limits, Reader, Rows};
pub use schema::{Column, Kind};
pub use value::Value;
pub use writer::Writer;
