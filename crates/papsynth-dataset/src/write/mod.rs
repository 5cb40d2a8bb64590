//! Images as bytes, the same for the same image: no time, fixed settings.

mod ome;
mod pages;
mod png;
mod pyramid;
mod tiff;

pub(crate) use ome::{description, of_labels, of_picture};
pub(crate) use pages::Pages;
pub(crate) use png::{label_png, png, rgb_png};
#[cfg(feature = "zarr")]
pub(crate) use pyramid::LARGE;
pub(crate) use tiff::{
    PageWriter, Pixels, as_io, compressed, label_tiff, narrow, ome_labels, ome_picture, picture_tiff,
};
