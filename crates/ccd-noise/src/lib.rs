#![doc = include_str!("../README.md")]

mod binning;
mod bloom;
pub mod calibrate;
mod camera;
mod chain;
mod error;
mod exposure;
mod field;
mod hash;
mod jpeg;
mod params;
mod poisson;

pub use binning::Binning;
pub use camera::Camera;
pub use error::Error;
pub use exposure::{Exposure, SaturatedRun};
pub use field::NoiseField;
pub use jpeg::{Jpeg, JpegParams, Subsampling};
pub use params::{Blooming, CameraParams, PhotonNoise, ReadNoise};
pub use rand_core::Rng;
