//! Parses bytes as the COCO document of a shard.

use papsynth_dataset::truths;

/// Checks that masks are within their image.
pub(crate) fn check(bytes: &[u8]) {
    let Ok(truths) = truths(bytes) else {
        return;
    };
    for (_, truth) in truths {
        for mask in truth.objects.iter().flat_map(|object| [&object.amodal, &object.front]) {
            assert!(mask.runs().iter().all(|run| (run.x1 as usize) <= truth.width && (run.y as usize) < truth.height));
        }
    }
}
