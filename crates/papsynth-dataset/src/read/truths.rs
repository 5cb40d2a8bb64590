//! The truth of data sets, read back.

use papsynth::truth::Truth;

use crate::coco::Document;
use crate::error::Problem;
use crate::record::broken;

/// The truth of every frame of a COCO document of a data set (`shards/*.coco.json`, `coco.json`), with the index of the frame, in the order of
/// its images.
///
/// # Errors
/// If the bytes are no such document, or boxes and areas are not those of the masks.
pub fn truths(bytes: &[u8]) -> Result<Vec<(u64, Truth)>, Problem> {
    let document: Document = serde_json::from_slice(bytes).map_err(broken)?;
    document.images.iter().map(|image| Ok((image.index(), document.truth(image.index())?))).collect()
}
