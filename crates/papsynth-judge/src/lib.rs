//! x
#![allow(dead_code, unused, missing_docs)]
mod background;
mod error;
mod filter;
mod forest;
mod measure;
mod moments;
mod number;
mod nuclei;
mod picture;
mod region;
mod statistics;
mod table;
mod tree;
mod two_sample;
pub use picture::*;
pub use error::Error;
pub use measure::*;
pub use statistics::auc;
pub use table::*;
pub use two_sample::*;
