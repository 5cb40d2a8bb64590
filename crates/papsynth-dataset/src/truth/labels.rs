//! Label images: with one label a pixel where several objects may lie, and in layers that lose nothing.

use papsynth::truth::{Group, Truth};
use serde::{Deserialize, Serialize};

/// What a pixel shows that belongs to several objects of a group, where a format has room for one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Flatten {
    /// The object nearest to the objective.
    #[default]
    Top,
    /// None: the pixel counts as background.
    Drop,
    /// The object with the largest id.
    Max,
}

impl Flatten {
    /// All policies.
    pub const ALL: [Self; 3] = [Self::Top, Self::Drop, Self::Max];

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Top => "top",
            Self::Drop => "drop",
            Self::Max => "max",
        }
    }

    /// How many pixels of the masks of a group its labels do not show.
    pub(crate) fn lost(self, truth: &Truth, group: Group) -> u64 {
        let of_group = || truth.objects.iter().filter(|object| object.group() == group);
        let all: u64 = of_group().map(|object| object.amodal.area()).sum();
        let shown = match self {
            // One object a pixel, whichever it is.
            Self::Top | Self::Max => of_group().map(|object| object.visible.area()).sum(),
            Self::Drop => self.labels(truth, group).iter().filter(|&&id| id > 0).count() as u64,
        };
        all - shown
    }

    /// The labels of a group, row by row.
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
    use papsynth::truth::Mask;

    use super::*;
    use crate::support::{HEIGHT, WIDTH, frame};

    /// Pixel by pixel from the masks.
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
    fn every_policy_is_as_pixel_by_pixel_and_counts_what_it_loses() {
        let truth = frame(0, 1, 8, 1).finished.truth;
        for (policy, group) in Flatten::ALL.into_iter().flat_map(|p| Group::ALL.map(|g| (p, g))) {
            let (ids, lost) = (policy.labels(&truth, group), policy.lost(&truth, group));
            assert_eq!(ids, slow(policy, &truth, group), "{policy:?} {group:?}");
            let masks: u64 = truth.objects.iter().filter(|o| o.group() == group).map(|o| o.amodal.area()).sum();
            assert_eq!(lost, masks - ids.iter().filter(|&&id| id > 0).count() as u64);
        }
        let overlap = |policy: Flatten| policy.lost(&truth, Group::Cytoplasm);
        assert!(overlap(Flatten::Top) > 50 && overlap(Flatten::Drop) == 2 * overlap(Flatten::Top));
    }

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
