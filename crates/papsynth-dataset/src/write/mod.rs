//! Encoders of images. Equal images give equal bytes: settings are fixed, and no time is written.

mod png;
mod tiff;

pub(crate) use png::{label_png, png, rgb_png};
pub(crate) use tiff::{Page, PageWriter, Pages, Pixels, compressed, fits_16_bits, is_large, label_pages};
