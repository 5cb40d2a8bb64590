//! Any bytes as the COCO document of a shard.

use papsynth_dataset::truths;

/// Masks that are read lie in their image.
pub(crate) fn check(bytes: &[u8]) {
    let Ok(truths) = truths(bytes) else {
        return;
    };
    for (_, truth) in truths {
        for mask in truth.objects.iter().flat_map(|object| [&object.amodal, &object.visible]) {
            assert!(mask.runs().iter().all(|run| (run.x1 as usize) <= truth.width && (run.y as usize) < truth.height));
        }
    }
}
