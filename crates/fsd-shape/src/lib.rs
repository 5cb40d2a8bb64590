#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

mod complex;
mod crossing;
mod descriptors;
mod error;
mod fit;
mod model;
mod outline;
mod pca;
mod roughness;
mod sample;
mod statistics;
mod steps;
mod trace;

pub use crossing::self_intersects;
pub use descriptors::Descriptors;
pub use error::Error;
pub use fit::{ShapeModelParams, Spread};
pub use model::{Draw, ShapeModel};
pub use outline::{Point, centroid, circularity, perimeter, resample, resample_along, signed_area};
pub use rand_core::Rng;
pub use statistics::{PrincipalComponent, Residual, ShapeStatistics};
pub use trace::trace;
