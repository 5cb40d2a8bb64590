#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod encode;
mod error;
mod fields;
mod grid;
mod labels;
mod levels;
mod refusal;
mod site;
#[cfg(feature = "zarr")]
mod slide;
mod source;

pub use error::Error;
pub use site::View;
