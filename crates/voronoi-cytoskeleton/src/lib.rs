#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod diagram;
mod draw;
mod error;
mod geometry;
#[cfg(any(feature = "mint", feature = "nalgebra"))]
mod interop;
mod lloyd;
mod outline;
mod path;
mod skeleton;
#[cfg(test)]
mod testing;
mod torus;
mod window;

pub use diagram::{Diagram, Edge};
pub use draw::{LineParams, Profile, draw_into};
pub use error::Error;
pub use geometry::Point;
pub use path::{DescentPath, PathEnd};
pub use rand_core::Rng;
pub use skeleton::{Skeleton, SkeletonParams};
pub use torus::Torus;
pub use window::Window;
