//! Visible masks, label maps and overlap counts, computed from the complete masks.

use super::mask::{Mask, Run, next};
use super::object::Truth;
use super::part::Group;

/// The id of an object at each pixel; 0 where there is none.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelMap {
    /// Columns.
    pub width: usize,
    /// Ids, row by row.
    pub ids: Vec<u32>,
}

/// Returns the visible part of each mask.
///
/// `objects` are `(id, depth, mask)`; a larger depth is nearer to the objective. Of two objects at the same depth, the
/// one with the larger id covers the other.
///
/// # Panics
/// If a mask extends beyond the image.
#[must_use]
pub fn visible_masks(objects: &[(u32, f64, &Mask)], width: usize, height: usize) -> Vec<Mask> {
    visible_masks_in(objects, width, &mut vec![0; width * height])
}

/// [`visible_masks`] with a caller's image of zeros; the image is zero again afterwards.
pub(crate) fn visible_masks_in(objects: &[(u32, f64, &Mask)], width: usize, ids: &mut [u32]) -> Vec<Mask> {
    let mut order: Vec<usize> = (0..objects.len()).collect();
    order.sort_by(|&a, &b| objects[a].1.total_cmp(&objects[b].1).then(objects[a].0.cmp(&objects[b].0)));
    for (id, _, mask) in order.into_iter().map(|index| objects[index]) {
        paint(mask, width, ids, |pixel| *pixel = id);
    }
    let masks = objects.iter().map(|(id, _, mask)| visible(*id, mask, ids, width)).collect();
    for (_, _, mask) in objects {
        paint(mask, width, ids, |pixel| *pixel = 0);
    }
    masks
}

/// Applies a function to every pixel of a mask.
pub(super) fn paint<T>(mask: &Mask, width: usize, image: &mut [T], visit: impl Fn(&mut T)) {
    for run in mask.runs() {
        let row = run.y as usize * width;
        image[row + run.x0 as usize..row + run.x1 as usize].iter_mut().for_each(&visit);
    }
}

impl Truth {
    /// Returns the label map of a group: the id of the visible object at each pixel.
    ///
    /// # Panics
    /// If a mask extends beyond the image.
    #[must_use]
    pub fn labels(&self, group: Group) -> LabelMap {
        let mut ids = Vec::new();
        self.labels_into(group, &mut ids);
        LabelMap { width: self.width, ids }
    }

    /// Writes the ids of [`labels`](Self::labels) to `ids`; previous contents are replaced.
    ///
    /// # Panics
    /// If a mask extends beyond the image.
    pub fn labels_into(&self, group: Group, ids: &mut Vec<u32>) {
        ids.clear();
        ids.resize(self.width * self.height, 0);
        for object in self.objects.iter().filter(|object| object.group() == group) {
            paint(&object.visible, self.width, ids, |pixel| *pixel = object.id);
        }
    }

    /// Returns the number of overlapping cytoplasms at each pixel, row by row.
    ///
    /// # Panics
    /// If a mask extends beyond the image.
    #[must_use]
    pub fn layers(&self) -> Vec<u16> {
        let mut layers = Vec::new();
        self.layers_into(&mut layers);
        layers
    }

    /// Writes [`layers`](Self::layers) to `layers`; previous contents are replaced.
    ///
    /// # Panics
    /// If a mask extends beyond the image.
    pub fn layers_into(&self, layers: &mut Vec<u16>) {
        layers.clear();
        layers.resize(self.width * self.height, 0);
        for object in self.objects.iter().filter(|object| object.group() == Group::Cytoplasm) {
            paint(&object.amodal, self.width, layers, |layer| *layer = layer.saturating_add(1));
        }
    }
}

/// Returns the pixels of a mask at which the image holds its id.
fn visible(id: u32, mask: &Mask, ids: &[u32], width: usize) -> Mask {
    let mut runs: Vec<Run> = Vec::new();
    for run in mask.runs() {
        let row = run.y as usize * width;
        let ids = &ids[row..row + run.x1 as usize];
        let mut x = run.x0 as usize;
        while let Some(x0) = next(ids, x, |other| other == id) {
            let x1 = next(ids, x0, |other| other != id).unwrap_or(ids.len());
            runs.push(Run { y: run.y, x0: column(x0), x1: column(x1) });
            x = x1;
        }
    }
    Mask::from_runs(runs)
}

/// Converts a column; all columns of an image fit.
fn column(x: usize) -> u32 {
    u32::try_from(x).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::random;

    /// Reference: at each pixel the id of the nearest object that covers it.
    fn slow(objects: &[(u32, f64, &Mask)], width: usize, height: usize) -> Vec<u32> {
        (0..width * height)
            .map(|pixel| {
                objects
                    .iter()
                    .filter(|(_, _, mask)| mask.pixels(width).any(|p| p == pixel))
                    .max_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)))
                    .map_or(0, |o| o.0)
            })
            .collect()
    }

    #[test]
    fn the_nearest_object_is_visible_and_visible_masks_partition_the_covered_pixels() {
        let (width, height) = (24, 18);
        let mut rng = Key { seed: 3, index: 0 }.stream("test", 0, "labels");
        let masks: Vec<Mask> = (0..7)
            .map(|_| {
                let tile: Vec<f32> = (0..100).map(|_| random::uniform(&mut rng) as f32).collect();
                let x = random::below(24, &mut rng) as i64 - 5;
                let y = random::below(18, &mut rng) as i64 - 5;
                Mask::from_tile(&tile, 10, [x, y], width, height, |v| v > 0.3)
            })
            .collect();
        let objects: Vec<(u32, f64, &Mask)> =
            masks.iter().enumerate().map(|(i, m)| (i as u32 + 1, f64::from(i as u32 % 3), m)).collect();
        let visible = visible_masks(&objects, width, height);
        let mut ids = vec![0; width * height];
        for ((id, _, _), mask) in objects.iter().zip(&visible) {
            mask.pixels(width).for_each(|pixel| ids[pixel] = *id);
        }
        assert_eq!(ids, slow(&objects, width, height));
        let covered = ids.iter().filter(|&&id| id > 0).count() as u64;
        assert_eq!(visible.iter().map(Mask::area).sum::<u64>(), covered);
    }
}
