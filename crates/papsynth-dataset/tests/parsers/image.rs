//! Arbitrary bytes as an image.

use papsynth_dataset::read::{GreyImage, Limits};

/// A decoded image is complete, within the limits, and in its range.
pub(crate) fn check(bytes: &[u8]) {
    let limits = Limits { max_side_px: 2048, max_pixels: 1 << 18, ..Limits::default() };
    let Ok(image) = GreyImage::decode(bytes, &limits) else {
        return;
    };
    assert!(image.width > 0 && image.width <= 2048 && image.grey.len() <= 1 << 18);
    assert_eq!(image.width * image.height(), image.grey.len());
    assert!(image.fractions().iter().all(|fraction| (0.0..=1.0).contains(fraction)));
}
