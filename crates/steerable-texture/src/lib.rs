#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

mod autocorrelation;
mod correlation;
mod error;
mod filters;
mod matrix;
mod measure;
mod moments;
mod params;
mod plane;
mod pyramid;
mod region;
mod statistics;
mod sums;
mod synthesis;

pub use error::Error;
pub use measure::Analyzer;
pub use moments::Moments;
pub use params::{PyramidParams, SynthesisParams, TextureParams};
pub use pyramid::{Band, Bands, Pyramid};
pub use rand_core::Rng;
pub use statistics::{LowPassStatistics, ScaleStatistics, Statistics};
pub use synthesis::Synthesizer;
