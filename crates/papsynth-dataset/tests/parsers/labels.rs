//! Arbitrary bytes as a label image.

use papsynth_dataset::read::{Limits, components, label_map};

/// A decoded label image is complete, and each labelled pixel is in one component.
pub(crate) fn check(bytes: &[u8]) {
    let limits = Limits { max_side_px: 2048, max_pixels: 1 << 18, max_regions: 10_000, ..Limits::default() };
    let Ok(labels) = label_map(bytes, &limits) else {
        return;
    };
    assert!(labels.width > 0 && labels.ids.len() % labels.width == 0);
    let Ok(components) = components(&labels, &limits) else {
        return;
    };
    let inside: usize =
        components.iter().map(|component| component.tile().0.iter().filter(|&&v| v > 0.0).count()).sum();
    assert_eq!(inside, labels.ids.iter().filter(|&&id| id > 0).count());
}
