//! An image of the user, decoded in memory.

use papsynth_dataset::read::{LevelImage, Limits};
use serde_json::json;

use super::rendering::framed;
use crate::server::{Reply, Request};

/// Content type of image files: browsers do not let pages of other sites send it without asking.
const BINARY: &[u8] = b"application/octet-stream";

/// Returns the size and the samples of a PNG, JPEG or TIFF file.
pub(super) fn decoded(request: &Request) -> Result<Reply, Reply> {
    if request.content_type != Some(BINARY) {
        return Err(Reply::error(415, "expected content type application/octet-stream"));
    }
    let image = LevelImage::decode(request.body, &Limits::default());
    let image = image.map_err(|error| Reply::error(422, &error.to_string()))?;
    let bits = if image.white > u16::from(u8::MAX) { u16::BITS } else { u8::BITS };
    let head = json!({ "width": image.width, "height": image.height(), "channels": image.channels, "bits": bits });
    Ok(framed(&head, &image.levels, bits))
}
