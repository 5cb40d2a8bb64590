#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod colour;
mod curve;
mod dye;
mod light;
mod params;
mod rows;
mod srgb;

pub use colour::{Channel, Colour, Node};
pub use curve::Curve;
pub use dye::{Amounts, DYES, Dye, absorbance, amounts};
pub use light::{Lamp, Sensor};
pub use params::{ColourParams, Error, Mixing};
pub use srgb::{encode_srgb, tone_curve};
