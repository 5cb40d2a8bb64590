//! Arbitrary bytes as a table of outlines.

use papsynth_dataset::read::outlines;

/// Parsed outlines have a positive area and finite points.
pub(crate) fn check(bytes: &[u8]) {
    let Ok(outlines) = outlines(bytes) else {
        return;
    };
    for outline in outlines {
        assert!(outline.points.len() >= 3);
        assert!(outline.points.iter().flatten().all(|coordinate| coordinate.is_finite()));
    }
}
