#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod calibration;
mod camera;
mod condenser;
mod edge;
mod error;
mod find;
mod focus;
mod instrument;
mod nucleus;
mod recipe;

pub use calibration::Calibration;
pub use camera::{Camera, Flats, Frame, Level, Saturation};
pub use ccd_noise::calibrate::LightLevel;
pub use condenser::{Bound, Condenser};
pub use edge::{Edge, EdgeAt};
pub use error::Error;
pub use focus::{Focus, FocusParams, LineFit, NucleiAt, Offset};
pub use instrument::Instrument;
pub use nucleus::Nucleus;
pub use optics_psf::calibrate::Window;
pub use recipe::PREFIX as RECIPE_PREFIX;
