#![doc = include_str!("../README.md")]

mod camera;
mod error;
mod field;
mod hash;
mod normal;
mod params;
mod poisson;

pub use camera::Camera;
pub use error::Error;
pub use field::NoiseField;
pub use params::{CameraParams, PhotonNoise};
pub use rand_core::Rng;
