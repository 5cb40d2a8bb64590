#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

#[cfg(any(feature = "image", feature = "mint", feature = "nalgebra"))]
mod convert;
mod coordinates;
mod crossing;
mod descriptors;
mod dft;
mod error;
#[cfg(feature = "fit")]
mod fit;
mod model;
mod outline;
#[cfg(feature = "fit")]
mod pca;
#[cfg(feature = "fit")]
mod roughness;
mod sample;
mod statistics;
mod steps;
mod trace;

#[cfg(feature = "image")]
pub use convert::trace_image;
pub use crossing::self_intersects;
pub use descriptors::Descriptors;
pub use error::Error;
#[cfg(feature = "fit")]
pub use fit::{ShapeModelParams, Spread};
pub use model::{Draw, ShapeModel};
pub use outline::{Point, centroid, circularity, perimeter, resample, resample_along, signed_area};
pub use rand_core::Rng;
pub use statistics::{PrincipalComponent, Residual, ShapeStatistics};
pub use trace::trace;
