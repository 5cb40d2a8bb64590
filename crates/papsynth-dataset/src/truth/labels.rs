//! Label images as runs: with one label per pixel, and in layers with all masks complete.

use papsynth::truth::{Group, Mask, ObjectTruth, Run, Truth};
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
            Self::Drop => self.labels(truth, group).labelled() as u64,
        };
        all - shown
    }

    /// Returns the labels of a group.
    pub(crate) fn labels(self, truth: &Truth, group: Group) -> LabelRuns {
        let of_group = || truth.objects.iter().filter(|object| object.group() == group);
        let complete = of_group().map(|object| (object.id, &object.amodal));
        let size = [truth.width, truth.height];
        match self {
            Self::Top => LabelRuns::new(of_group().map(|object| (object.id, &object.visible)), size, first),
            Self::Max => LabelRuns::new(complete, size, |ids| ids.iter().copied().max().unwrap_or(0)),
            Self::Drop => LabelRuns::new(complete, size, |ids| if let [id] = *ids { id } else { 0 }),
        }
    }
}

fn first(ids: &[u32]) -> u32 {
    ids.first().copied().unwrap_or(0)
}

/// Returns the number of overlapping cytoplasms at each pixel.
pub(crate) fn overlaps(truth: &Truth) -> LabelRuns {
    let cytoplasms = truth.objects.iter().filter(|object| object.group() == Group::Cytoplasm);
    let count = |ids: &[u32]| u32::try_from(ids.len()).unwrap_or(u32::MAX);
    LabelRuns::new(cytoplasms.map(|object| (object.id, &object.amodal)), [truth.width, truth.height], count)
}

/// Returns the labels of a group in layers, at least one. Objects of a layer do not overlap, so their masks are
/// complete. Each object goes into the first layer with room for it, in the order of ids.
pub(crate) fn layers(truth: &Truth, group: Group) -> Vec<LabelRuns> {
    let mut layers: Vec<Vec<&ObjectTruth>> = vec![Vec::new()];
    for object in truth.objects.iter().filter(|object| object.group() == group) {
        let is_free = |layer: &Vec<&ObjectTruth>| !layer.iter().any(|other| overlap(&other.amodal, &object.amodal));
        match layers.iter().position(is_free) {
            Some(free) => layers[free].push(object),
            None => layers.push(vec![object]),
        }
    }
    let labels = |layer: Vec<&ObjectTruth>| {
        let masks = layer.into_iter().map(|object| (object.id, &object.amodal));
        LabelRuns::new(masks, [truth.width, truth.height], first)
    };
    layers.into_iter().map(labels).collect()
}

/// Whether two masks have a common pixel.
fn overlap(one: &Mask, other: &Mask) -> bool {
    let (mut one, mut other) = (one.runs(), other.runs());
    while let ([a, rest_of_one @ ..], [b, rest_of_other @ ..]) = (one, other) {
        if a.y == b.y && a.x0 < b.x1 && b.x0 < a.x1 {
            return true;
        }
        if (a.y, a.x1) < (b.y, b.x1) { one = rest_of_one } else { other = rest_of_other }
    }
    false
}

/// A label image as runs of equal labels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct LabelRuns {
    /// Columns.
    pub(crate) width: usize,
    /// Rows.
    pub(crate) height: usize,
    /// Labels and numbers of pixels, in row-major order. The labels of consecutive runs differ.
    runs: Vec<(u32, usize)>,
}

impl LabelRuns {
    /// Returns the image of masks with ids. `label` returns the label of pixels from the ids of the masks that cover
    /// them, in any order.
    fn new<'m>(
        masks: impl Iterator<Item = (u32, &'m Mask)>,
        [width, height]: [usize; 2],
        label: impl Fn(&[u32]) -> u32,
    ) -> Self {
        let mut waiting: Vec<(u32, &[Run])> = masks.map(|(id, mask)| (id, mask.runs())).collect();
        waiting.retain(|(_, runs)| !runs.is_empty());
        waiting.sort_by_key(|(_, runs)| std::cmp::Reverse(runs[0].y));
        let mut all = Self { width, height, runs: Vec::new() };
        // The runs of a row and below, of masks that begin in the row or above.
        let mut begun: Vec<(u32, &[Run])> = Vec::new();
        // Columns at which a mask begins or has ended.
        let mut edges: Vec<(usize, u32, bool)> = Vec::new();
        let mut ids: Vec<u32> = Vec::new();
        for y in 0..height {
            let is_here = |run: &Run| run.y as usize == y;
            while let Some(mask) = waiting.pop_if(|(_, runs)| is_here(&runs[0])) {
                begun.push(mask);
            }
            for (id, runs) in &mut begun {
                while let [run, below @ ..] = *runs
                    && is_here(run)
                {
                    edges.extend([(run.x0 as usize, *id, true), (run.x1 as usize, *id, false)]);
                    *runs = below;
                }
            }
            begun.retain(|(_, runs)| !runs.is_empty());
            edges.sort_unstable_by_key(|edge| edge.0);
            let mut from = 0;
            for (x, id, begins) in edges.drain(..) {
                all.push(label(&ids), x - from);
                from = x;
                if begins {
                    ids.push(id);
                } else if let Some(ended) = ids.iter().position(|other| *other == id) {
                    ids.swap_remove(ended);
                }
            }
            all.push(label(&ids), width - from);
        }
        all
    }

    /// Appends pixels of a label.
    fn push(&mut self, label: u32, count: usize) {
        match self.runs.last_mut() {
            _ if count == 0 => {}
            Some(last) if last.0 == label => last.1 += count,
            _ => self.runs.push((label, count)),
        }
    }

    pub(crate) fn fits_16_bits(&self) -> bool {
        self.largest() <= u16::MAX.into()
    }

    /// Returns the largest label.
    pub(crate) fn largest(&self) -> u32 {
        self.runs.iter().map(|(label, _)| *label).max().unwrap_or(0)
    }

    /// Returns the number of pixels with a label.
    fn labelled(&self) -> usize {
        self.runs.iter().filter(|(label, _)| *label > 0).map(|(_, count)| count).sum()
    }

    /// Returns the label of each pixel, in row-major order.
    pub(crate) fn pixels(&self) -> Vec<u32> {
        let mut pixels = Vec::with_capacity(self.width * self.height);
        for &(label, count) in &self.runs {
            pixels.resize(pixels.len() + count, label);
        }
        pixels
    }

    /// Splits the runs into parts of a number of pixels; the last part may have fewer.
    pub(crate) fn parts(&self, pixels: usize) -> Vec<Vec<(u32, usize)>> {
        let (mut parts, mut part, mut room) = (Vec::new(), Vec::new(), pixels);
        for &(label, mut count) in &self.runs {
            while count > 0 {
                let taken = count.min(room);
                part.push((label, taken));
                (count, room) = (count - taken, room - taken);
                if room == 0 {
                    parts.push(std::mem::take(&mut part));
                    room = pixels;
                }
            }
        }
        parts.extend((!part.is_empty()).then_some(part));
        parts
    }
}

#[cfg(test)]
mod tests {
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
            let (ids, occluded) = (policy.labels(&truth, group).pixels(), policy.occluded(&truth, group));
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
            let layers: Vec<Vec<u32>> = layers(&truth, group).iter().map(LabelRuns::pixels).collect();
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

    #[test]
    fn overlaps_are_counted_and_parts_are_the_whole() {
        let truth = frame(0, 1, 8, 1).finished.truth;
        let overlaps = overlaps(&truth);
        assert_eq!(overlaps.pixels(), truth.layers().into_iter().map(u32::from).collect::<Vec<_>>());
        assert_eq!(overlaps.largest(), 2);
        for pixels in [1, 7, WIDTH, 3 * WIDTH, 2 * WIDTH * HEIGHT] {
            let parts = overlaps.parts(pixels);
            let sizes: Vec<usize> = parts.iter().map(|part| part.iter().map(|run| run.1).sum()).collect();
            assert!(sizes[..sizes.len() - 1].iter().all(|&size| size == pixels), "{pixels}: {sizes:?}");
            let all = parts.concat().into_iter().flat_map(|(label, count)| vec![label; count]);
            assert!(all.eq(overlaps.pixels()), "{pixels}");
        }
    }

    #[test]
    fn masks_overlap_if_they_share_a_pixel() {
        let mask = |runs: &[(u32, u32, u32)]| {
            Mask::from_runs(runs.iter().map(|&(y, x0, x1)| Run { y, x0, x1 }).collect::<Vec<_>>())
        };
        let one = mask(&[(1, 2, 4), (1, 6, 9), (3, 0, 5)]);
        for (other, expected) in [
            (mask(&[]), false),
            (mask(&[(1, 0, 2), (1, 4, 6), (1, 9, 12), (2, 0, 20), (3, 5, 6)]), false),
            (mask(&[(0, 0, 20), (1, 8, 20)]), true),
            (mask(&[(1, 0, 2), (3, 4, 5)]), true),
            (one.clone(), true),
        ] {
            assert_eq!([overlap(&one, &other), overlap(&other, &one)], [expected; 2], "{other:?}");
        }
    }
}
