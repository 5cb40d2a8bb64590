#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod lanes;
mod plane;
mod transform;

pub use lanes::{Lanes, Real, Square, ZERO, transposed};
pub use num_complex::Complex;
pub use plane::{ComplexPlane, PlaneScratch};
pub use transform::{LaneFft, Plans};
