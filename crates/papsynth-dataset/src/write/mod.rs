//! Images as bytes, the same for the same image: no time, fixed settings.

mod ome;
mod png;
mod tiff;

pub(crate) use ome::description;
pub(crate) use png::{png, rgb_png};
pub(crate) use tiff::{PageWriter, Pixels, compressed, label_tiff};
