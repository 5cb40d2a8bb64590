//! Encoders of images. Equal images give equal bytes: settings are fixed, and no time is written.

mod deflate;
mod plain;
mod png;
mod tiff;

pub(crate) use plain::PlainPages;
pub(crate) use png::{label_png, png, rgb_png};
pub(crate) use tiff::{Page, Pages, Pixels, compressed, is_large, label_pages, pyramid};
