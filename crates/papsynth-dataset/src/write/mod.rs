//! Encoders of images. Equal images give equal bytes: settings are fixed, and no time is written.

mod deflate;
mod png;
mod tiff;

pub(crate) use png::{label_png, png, rgb_png};
pub(crate) use tiff::{Page, PageWriter, Pages, Pixels, compressed, is_large, label_pages};
