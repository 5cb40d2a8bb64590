//! Images as bytes, the same for the same image: no time, fixed settings.

mod page;
mod pages;
mod png;
mod pyramid;
mod tiff;

pub(crate) use page::{Page, Pixels};
pub(crate) use pages::Pages;
pub(crate) use png::{label_png, png, rgb_png};
pub(crate) use pyramid::is_large;
pub(crate) use tiff::{PageWriter, compressed, fits_16_bits, label_pages, label_tiff};
