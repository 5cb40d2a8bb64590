//! An image of the user, decoded in memory.

use papsynth_dataset::read::{LevelImage, Limits};
use serde_json::json;

use super::rendering::framed;
use crate::server::Reply;

/// Returns the size and the samples of a PNG, JPEG or TIFF file.
pub(super) fn decoded(bytes: &[u8]) -> Result<Reply, Reply> {
    let image = LevelImage::decode(bytes, &Limits::default()).map_err(|error| Reply::error(422, &error.to_string()))?;
    let bits = if image.white > u16::from(u8::MAX) { u16::BITS } else { u8::BITS };
    let head = json!({ "width": image.width, "height": image.height(), "channels": image.channels, "bits": bits });
    Ok(framed(&head, &image.levels, bits))
}
