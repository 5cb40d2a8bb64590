//! Label images: with one label per pixel, and in layers with all masks complete.

use papsynth::truth::{Group, Truth};
use serde::{Deserialize, Serialize};

/// The label of a pixel where objects of a group overlap, in formats with one label per pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Flatten {
    /// The object nearest to the objective.
    #[default]
    Top,
    /// Background.
    Drop,
    /// The object with the largest id.
    Max,
}

impl Flatten {
    /// All policies.
    pub const ALL: [Self; 3] = [Self::Top, Self::Drop, Self::Max];

    /// Returns the name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Top => "top",
            Self::Drop => "drop",
            Self::Max => "max",
        }
    }

    /// Returns the number of pixels of the masks of a group that the labels do not show.
    pub(crate) fn occluded(self, truth: &Truth, group: Group) -> u64 {
        let of_group = || truth.objects.iter().filter(|object| object.group() == group);
        let all: u64 = of_group().map(|object| object.amodal.area()).sum();
        let shown = match self {
            // One object per pixel: the counts of both policies are equal.
            Self::Top | Self::Max => of_group().map(|object| object.visible.area()).sum(),
            Self::Drop => self.labels(truth, group).iter().filter(|&&id| id > 0).count() as u64,
        };
        all - shown
    }

    /// Returns the labels of a group in row-major order.
    pub(crate) fn labels(self, truth: &Truth, group: Group) -> Vec<u32> {
        let mut ids = Vec::new();
        let mut objects: Vec<_> = truth.objects.iter().filter(|object| object.group() == group).collect();
        objects.sort_by_key(|object| object.id);
        match self {
            Self::Top => truth.labels_into(group, &mut ids),
            Self::Max => {
                ids.resize(truth.width * truth.height, 0);
                for object in &objects {
                    object.amodal.pixels(truth.width).for_each(|pixel| ids[pixel] = object.id);
                }
            }
            Self::Drop => {
                ids.resize(truth.width * truth.height, 0);
                let mut shared = Vec::new();
                for object in &objects {
                    for pixel in object.amodal.pixels(truth.width) {
                        if ids[pixel] == 0 {
                            ids[pixel] = object.id;
                        } else {
                            shared.push(pixel);
                        }
                    }
                }
                shared.into_iter().for_each(|pixel| ids[pixel] = 0);
            }
        }
        ids
    }
}

/// Returns the labels of a group in layers, at least one, each in row-major order. Objects of a layer do not overlap,
/// so their masks are complete. Each object goes into the first layer with room for it, in the order of ids.
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
    use papsynth::truth::Mask;

    use super::*;
    use crate::support::{HEIGHT, WIDTH, frame};

    /// The labels, pixel by pixel from the masks.
    fn slow(policy: Flatten, truth: &Truth, group: Group) -> Vec<u32> {
        (0..WIDTH * HEIGHT)
            .map(|pixel| {
                let here = |mask: &Mask| mask.pixels(WIDTH).any(|p| p == pixel);
                let of_group = || truth.objects.iter().filter(|o| o.group() == group);
                let ids: Vec<u32> = of_group().filter(|o| here(&o.amodal)).map(|o| o.id).collect();
                match policy {
                    Flatten::Top => of_group().find(|o| here(&o.visible)).map_or(0, |o| o.id),
                    Flatten::Drop if ids.len() > 1 => 0,
                    Flatten::Drop | Flatten::Max => ids.into_iter().max().unwrap_or(0),
                }
            })
            .collect()
    }

    #[test]
    fn policies_equal_the_slow_version_and_count_occluded_pixels() {
        let truth = frame(0, 1, 8, 1).finished.truth;
        for (policy, group) in Flatten::ALL.into_iter().flat_map(|p| Group::ALL.map(|g| (p, g))) {
            let (ids, occluded) = (policy.labels(&truth, group), policy.occluded(&truth, group));
            assert_eq!(ids, slow(policy, &truth, group), "{policy:?} {group:?}");
            let masks: u64 = truth.objects.iter().filter(|o| o.group() == group).map(|o| o.amodal.area()).sum();
            assert_eq!(occluded, masks - ids.iter().filter(|&&id| id > 0).count() as u64);
        }
        let overlap = |policy: Flatten| policy.occluded(&truth, Group::Cytoplasm);
        assert!(overlap(Flatten::Top) > 50 && overlap(Flatten::Drop) == 2 * overlap(Flatten::Top));
    }

    #[test]
    fn every_mask_is_complete_in_one_layer() {
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
