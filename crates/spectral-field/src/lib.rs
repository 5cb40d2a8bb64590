#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

mod error;
mod field;
mod params;
mod spectrum;

pub use error::Error;
#[cfg(feature = "noise")]
pub use field::DrawnField;
pub use field::SpectralField;
pub use params::{FieldParams, Padding};
pub use rand_core::Rng;
pub use spectrum::Spectrum;
