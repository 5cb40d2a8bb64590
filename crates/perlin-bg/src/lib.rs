#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod background;
mod error;
mod fractal;
mod illumination;
#[cfg(feature = "noise")]
mod interop;
mod kernel;
mod perlin;
mod rows;

pub use background::{Background, BackgroundParams, BackgroundTexture, UnitRange, stretch_to_unit};
pub use error::Error;
pub use fractal::{Fractal, FractalParams};
pub use illumination::Illumination;
pub use perlin::{Fade, Perlin, PerlinParams};
pub use rows::Window;
