//! Label images that lose nothing: objects that overlap lie in different layers.

use papsynth::truth::{Group, Truth};

/// The labels of a group in as few layers as a first fit in the order of ids needs, at least one; each row by row. No two objects of a layer share
/// a pixel, so that each shows its complete mask.
pub(crate) fn layers(truth: &Truth, group: Group) -> Vec<Vec<u32>> {
    let empty = || vec![0_u32; truth.width * truth.height];
    let mut layers = vec![empty()];
    for object in truth.objects.iter().filter(|object| object.group() == group) {
        let is_free = |layer: &Vec<u32>| object.amodal.pixels(truth.width).all(|pixel| layer[pixel] == 0);
        let free = layers.iter().position(is_free).unwrap_or_else(|| {
            layers.push(empty());
            layers.len() - 1
        });
        object.amodal.pixels(truth.width).for_each(|pixel| layers[free][pixel] = object.id);
    }
    layers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::{WIDTH, frame};

    #[test]
    fn every_mask_stands_whole_in_one_layer() {
        let truth = frame(0, 1, 8, 1).finished.truth;
        for (group, count) in [(Group::Cytoplasm, 2), (Group::Nucleus, 1), (Group::Debris, 1)] {
            let layers = layers(&truth, group);
            assert_eq!(layers.len(), count, "{group:?}");
            for object in truth.objects.iter().filter(|object| object.group() == group) {
                let shown: Vec<Vec<usize>> = layers
                    .iter()
                    .map(|layer| (0..layer.len()).filter(|&pixel| layer[pixel] == object.id).collect())
                    .collect();
                let whole = object.amodal.pixels(WIDTH).collect::<Vec<_>>();
                assert_eq!(shown.iter().filter(|pixels| **pixels == whole).count(), 1);
                assert_eq!(shown.iter().filter(|pixels| pixels.is_empty()).count(), layers.len() - 1);
            }
        }
    }
}
