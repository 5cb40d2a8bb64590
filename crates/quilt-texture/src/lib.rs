#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod candidates;
mod canvas;
mod distance;
mod draw;
mod error;
#[cfg(feature = "image")]
mod interop;
mod params;
mod quilter;
mod scan;
mod seam;
mod source;
mod spectral;
mod texture;

pub use error::Error;
pub use params::{Acceptance, CentreBias, QuiltParams, Seam, Search};
pub use quilter::Quilter;
pub use rand_core::Rng;
pub use source::Source;
pub use texture::{Origin, Texture};
