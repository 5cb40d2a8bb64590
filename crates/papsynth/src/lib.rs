#![doc = include_str!("../README.md")]

mod engine;
mod error;
mod frame;
pub mod key;
pub mod model;
mod random;
pub mod recipe;
pub mod scene;
pub mod truth;

pub use engine::{Engine, Inputs, Threads};
pub use error::Error;
pub use frame::{Finished, Frame, Plane};
