#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

mod error;
mod field;
#[cfg(feature = "noise")]
mod interop;
mod params;
mod spectrum;

pub use error::Error;
pub use field::SpectralField;
#[cfg(feature = "noise")]
pub use interop::DrawnField;
pub use params::{FieldParams, Padding};
pub use rand_core::Rng;
pub use spectrum::Spectrum;
