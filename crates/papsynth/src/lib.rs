#![doc = include_str!("../README.md")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "pixels are f32, and the recipe check bounds all sizes and positions far below the integer range"
)]

mod debris;
mod detect;
mod engine;
mod error;
mod frame;
mod fuse;
pub mod key;
#[cfg(feature = "learn")]
pub mod learn;
pub mod live;
pub mod model;
mod phantom;
pub mod profile;
pub mod recipe;
mod render;
pub mod scene;
pub mod slide;
mod threads;
mod transmit;
pub mod truth;
mod words;

use portable_numerics::random;

pub use engine::{Engine, Inputs};
pub use error::{Error, ErrorKind, NucleusError};
pub use frame::{Finished, Frame, Plane, white_level};
pub use fuse::clipped_noise;
pub use slide::Slide;
pub use threads::Threads;
