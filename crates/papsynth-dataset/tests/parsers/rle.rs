//! Arbitrary bytes as the counts of a mask, after two bytes for the size of its image.

use papsynth_dataset::rle;

/// A parsed mask is inside its image and has a lossless round trip.
pub(crate) fn check(bytes: &[u8]) {
    let [width, height, counts @ ..] = bytes else { return };
    let (width, height) = (usize::from(*width), usize::from(*height));
    let Ok(counts) = std::str::from_utf8(counts) else { return };
    let Ok(mask) = rle::decode(counts, width, height) else { return };
    assert!(mask.area() <= (width * height) as u64);
    assert!(mask.runs().iter().all(|run| (run.x1 as usize) <= width && (run.y as usize) < height));
    let again = rle::decode(&rle::encode(&mask, width, height), width, height).expect("a mask reads back");
    assert_eq!(again, mask);
}
