//! An image of the user, in memory.

use papsynth::white_level;
use papsynth_dataset::read::{LevelImage, Limits};
use serde_json::json;

use super::rendering::framed;
use crate::server::{Reply, Request};

/// Content type of image files: browsers do not let pages of other sites send it without asking.
const BINARY: &[u8] = b"application/octet-stream";

/// Bit depths of cameras whose images have 16 bits: the smallest that holds the brightest pixel is assumed.
const DEEP: [u32; 3] = [12, 14, 16];

/// An image of the user.
pub(super) struct RealImage {
    pub(super) image: LevelImage,
    /// Bit depth of its grey levels.
    pub(super) bits: u32,
}

impl RealImage {
    /// Returns the file in a request.
    pub(super) fn encoded(request: &Request) -> Result<Vec<u8>, Reply> {
        match request.content_type == Some(BINARY) {
            true => Ok(request.body.to_vec()),
            false => Err(Reply::error(415, "expected content type application/octet-stream")),
        }
    }

    /// Decodes a PNG, JPEG or TIFF file.
    pub(super) fn decode(file: &[u8]) -> Result<Self, Reply> {
        let image = LevelImage::decode(file, &Limits::default());
        let image = image.map_err(|error| Reply::error(422, &error.to_string()))?;
        let brightest = image.levels.iter().copied().max().unwrap_or(0);
        let bits = match image.white > u16::from(u8::MAX) {
            true => DEEP.into_iter().find(|bits| white_level(*bits) >= brightest).unwrap_or(u16::BITS),
            false => u8::BITS,
        };
        Ok(Self { image, bits })
    }

    /// Returns its size and its samples.
    pub(super) fn reply(&self) -> Reply {
        let Self { image, bits } = self;
        let head = json!({ "width": image.width, "height": image.height(), "channels": image.channels, "bits": bits });
        framed(&head, &image.levels, *bits)
    }
}
