//! Readers of the users' files: images, masks, label images, outlines, weight maps.
//!
//! Each format has a function that parses bytes and one that reads a file; errors of the second name the file. Sizes
//! are checked against [`Limits`] before an image is decoded. Only regular files are read.
//!
//! # Accepted images
//!
//! - PNG of 1 to 16 bits.
//! - TIFF of 8, 16 or (label images only) 32 bits: uncompressed, LZW, Deflate, PackBits or JPEG.
//! - JPEG, grey or in colour. Label images and masks in JPEG are an error, because lossy compression changes labels.
//!   The EXIF orientation is not applied.
//!
//! Colour images are an error, because the response of a colour camera at one wavelength is unknown. Two readers accept
//! colour: [`LevelImage`] keeps the channels, and [`FieldFile`] takes the green one. A colour file in which all pixels
//! are grey (R = G = B, opaque) is read as grey. In label images and masks with a palette the indices are the labels.

mod components;
mod fields;
mod file;
mod image;
mod jpeg;
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
