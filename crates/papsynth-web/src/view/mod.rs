//! Data sets and slides, with their truth over them.

mod encode;
mod fields;
mod grid;
mod labels;
mod levels;
mod site;
#[cfg(feature = "zarr")]
mod slide;
mod source;

pub use site::View;
