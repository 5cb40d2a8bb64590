#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod canvas;
mod draw;
mod error;
#[cfg(feature = "image")]
mod interop;
mod params;
mod quilter;
mod scan;
mod source;
mod spectral;

pub use canvas::{Origin, Texture};
pub use error::Error;
pub use params::{Acceptance, CentreBias, QuiltParams, Seam, Search};
pub use quilter::Quilter;
pub use rand_core::Rng;
pub use source::Source;
