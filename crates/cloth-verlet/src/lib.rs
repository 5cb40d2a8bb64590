#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod batch;
mod cloth;
mod coarse;
mod crease;
mod delaunay;
mod error;
#[cfg(any(feature = "mint", feature = "nalgebra"))]
mod interop;
mod lanes;
mod mesh;
mod outline;
mod params;
mod raster;
mod refine;
mod rest;
mod ring;
mod sheet;
#[cfg(test)]
mod testing;

pub use cloth::{Cloth, SheetSpec};
pub use crease::{Crease, FoldKind, Wave, crease_outline};
pub use error::Error;
pub use params::{ClothParams, RestShape, Smoothing, Solver, VerletParams, XpbdParams};
pub use rand_core::Rng;
pub use raster::PixelGrid;
pub use sheet::Sheet;

/// A point or vector in the plane: x right, y down, in the unit of the outline.
pub type Point = [f64; 2];

/// A point in space: x right, y down, z up from the ground, in the unit of the outline.
pub type Vertex = [f64; 3];
