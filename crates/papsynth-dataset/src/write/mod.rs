//! Images as bytes, the same for the same image: no time, fixed settings.

mod png;
mod tiff;

pub(crate) use png::{label_png, png, rgb_png};
pub(crate) use tiff::{Page, PageWriter, Pages, Pixels, compressed, fits_16_bits, is_large, label_pages};
