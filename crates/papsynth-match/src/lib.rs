#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod compare;
mod distance;
mod error;
mod fit;
mod halo;
mod hues;
mod measured;
mod noise;
mod objects;
mod parameter;
mod posterior;
mod recipe;
mod regression;
mod sampler;
mod simulate;
mod summary;
mod text;

pub use compare::{Refinement, Success};
pub use distance::{Distance, Statistic};
pub use error::Error;
pub use fit::{Fit, Match, MatchParams, Origin, ParameterFit, PixelSize};
pub use measured::{Measured, measure, measure_with};
pub use parameter::{Level, PARAMETERS, Parameter, Prior, Scale, Source, Values};
pub use posterior::Estimate;
pub use recipe::{Setting, recipe};
pub use sampler::{MakeEngine, Sampler};
pub use summary::Summary;
