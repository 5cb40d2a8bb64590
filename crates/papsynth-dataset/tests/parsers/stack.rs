//! Arbitrary bytes as an image with one or several planes, grey or in colour.

use papsynth_dataset::read::{LevelImage, Limits, Stack};

/// A decoded image, and every plane of a stack, is complete and within the limits.
pub(crate) fn check(bytes: &[u8]) {
    let limits = Limits { max_side_px: 2048, max_pixels: 1 << 18, ..Limits::default() };
    if let Ok(image) = LevelImage::decode(bytes, &limits) {
        assert!(image.width > 0 && [1, 3].contains(&image.channels));
        assert_eq!(image.levels.len(), image.width * image.height() * image.channels);
    }
    if let Ok(stack) = Stack::decode(bytes, &limits) {
        assert!(stack.width > 0 && !stack.planes.is_empty());
        assert!(stack.planes.iter().all(|plane| plane.len() == stack.planes[0].len()));
    }
}
