#![doc = include_str!("../README.md")]

mod border;
mod error;
mod fir;
mod focus;
mod gaussian;
mod kernel;
mod pyramid;
mod scratch;

pub use border::Border;
pub use error::Error;
pub use focus::{DepthOfFocus, FocusParams};
pub use gaussian::{Gaussian, Method};
pub use scratch::Scratch;
