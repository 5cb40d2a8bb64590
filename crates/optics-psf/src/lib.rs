#![doc = include_str!("../README.md")]

mod abbe;
mod border;
mod bright_field;
pub mod calibrate;
mod canvas;
mod error;
mod filter;
mod fir;
mod gaussian;
mod gibson_lanni;
mod grid;
mod kernel;
mod overlap;

mod light;
mod microscope;
mod params;
mod patch;
mod pupil;
mod pyramid;
mod scratch;
mod smooth;
mod spectrum;
mod transfer;
mod transfer_cache;
mod window;

pub use abbe::{Abbe, AbbeParams, Layer, Source};
pub use border::Border;
pub use bright_field::{BrightField, BrightFieldParams, Padding, Specimen};
pub use canvas::MIN_TRANSMITTANCE;
pub use error::Error;
pub use gaussian::{DepthOfFocus, FocusParams, Gaussian, Method};
pub use gibson_lanni::{GibsonLanni, GibsonLanniParams};
pub use grid::fast_length;
pub use light::TransmittedLight;
pub use microscope::Microscope;
pub use params::{MicroscopeParams, Zernike};
pub use patch::{Factor, Focus, Patch, PatchImager, PatchLayer, PatchScratch};
pub use scratch::Scratch;
pub use transfer::Transfer;
