#![doc = include_str!("../README.md")]

mod detect;
mod engine;
mod error;
mod exp10;
mod frame;
pub mod key;
pub mod learn;
pub mod model;
mod phantom;
mod random;
pub mod recipe;
mod render;
pub mod scene;
mod threads;
mod transmit;
pub mod truth;

pub use engine::{Arithmetic, Engine, Inputs};
pub use error::Error;
pub use frame::{Finished, Frame, Plane};
pub use threads::Threads;
