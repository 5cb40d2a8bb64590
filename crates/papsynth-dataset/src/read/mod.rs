//! Reading what users bring: images, masks, label fields, outlines, weight maps.
//!
//! Everything here is a function of bytes, with a twin that reads a file and names it in its errors. Sizes are checked
//! against [`Limits`] before anything is decoded.
//!
//! # What is accepted
//!
//! PNG of 1 to 16 bits and TIFF of 8, 16 or (label images only) 32 bits. An image in colour is refused, but for
//! [`LevelImage`], which keeps its channels: how much light of one wavelength a colour stands for is not known. Fields that
//! are compared are read in green ([`FieldFile`]). A colour file whose pixels are all grey (R = G = B, opaque) is read as
//! grey. In label images and masks a palette is not looked at, its indices are the labels.

mod components;
mod fields;
mod file;
mod image;
mod nucleus;
mod outlines;
mod raster;
mod stack;
mod tiff;
mod weights;

pub use components::{Component, components};
pub use fields::{FieldFile, FieldImage, FieldNuclei};
pub(crate) use fields::{NucleiFile, files_in};
pub use file::Limits;
pub(crate) use file::bytes;
pub(crate) use image::label_pages;
pub use image::{GreyImage, LevelImage, label_map, read_label_map};
pub use nucleus::{NucleusSample, image_files, read_nuclei, read_pairs};
pub use outlines::{Outline, outlines, read_outlines};
pub use stack::{Stack, natural_order};
pub(crate) use tiff::{description, float_pages};
pub use weights::{InputFile, read_inputs};
