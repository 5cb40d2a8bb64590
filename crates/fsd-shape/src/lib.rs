#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

mod crossing;
mod descriptors;
mod error;
#[cfg(feature = "fit")]
mod fit;
#[cfg(any(feature = "image", feature = "mint", feature = "nalgebra"))]
mod interop;
mod model;
mod outline;
#[cfg(feature = "fit")]
mod roughness;
mod sample;
mod statistics;
mod steps;
mod trace;

pub use crossing::self_intersects;
pub use descriptors::Descriptors;
pub use error::Error;
#[cfg(feature = "fit")]
pub use fit::{CovarianceModel, ShapeModelParams};
#[cfg(feature = "image")]
pub use interop::trace_image;
pub use model::{DrawnShape, ShapeModel};
pub use outline::{Point, centroid, circularity, perimeter, resample, resample_along, signed_area};
pub use rand_core::Rng;
pub use statistics::{PrincipalComponent, Residual, ShapeStatistics};
pub use trace::trace;
