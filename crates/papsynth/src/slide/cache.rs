//! Phantoms of objects at the borders of frames, which several frames image.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::phantom::Phantom;
use crate::scene::{Object, Plot};

/// Largest size of all cached phantoms, bytes: those of the borders between two rows of four frames.
const MAX_BYTES: usize = 32 << 20;

/// Phantoms of objects of a slide, by id. They save time and do not change the output.
#[derive(Debug, Default)]
pub(super) struct PhantomCache {
    kept: Mutex<Kept>,
}

#[derive(Debug, Default)]
struct Kept {
    /// Positions of the plots, in pixels of the frame for which the phantoms were drawn, and the phantoms.
    phantoms: BTreeMap<u32, ([i64; 2], Arc<Phantom>)>,
    /// Ids, the oldest first.
    order: VecDeque<u32>,
    bytes: usize,
}

impl PhantomCache {
    /// Returns the cached phantom of an object, moved to the position of its plot. `n` is the number of grid points
    /// per pixel and axis.
    pub(super) fn get(&self, object: &Object, n: usize) -> Option<Phantom> {
        let Plot { at_px, .. } = object.plot?;
        let (drawn_at_px, phantom) = self.kept().phantoms.get(&object.id).cloned()?;
        let mut phantom = Phantom::clone(&phantom);
        for piece in &mut phantom.pieces {
            let step = (n / piece.step) as i64;
            for tile in [&mut piece.absorbance, &mut piece.coverage] {
                for axis in 0..2 {
                    tile.origin[axis] += (at_px[axis] - drawn_at_px[axis]) * step;
                }
            }
        }
        Some(phantom)
    }

    /// Adds the phantom of an object. The oldest phantoms are removed if the cache is too large.
    pub(super) fn insert(&self, object: &Object, phantom: &Phantom) {
        let Some(Plot { at_px, .. }) = object.plot else { return };
        let phantom = Arc::new(phantom.clone());
        let mut guard = self.kept();
        let kept = &mut *guard;
        let bytes = bytes(&phantom);
        if kept.phantoms.contains_key(&object.id) || bytes > MAX_BYTES {
            return;
        }
        kept.phantoms.insert(object.id, (at_px, phantom));
        kept.order.push_back(object.id);
        kept.bytes += bytes;
        while kept.bytes > MAX_BYTES
            && let Some((_, oldest)) = kept.order.pop_front().and_then(|id| kept.phantoms.remove(&id))
        {
            kept.bytes -= self::bytes(&oldest);
        }
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the size of the tiles of a phantom, bytes.
fn bytes(phantom: &Phantom) -> usize {
    phantom.pieces.iter().map(|piece| 4 * (piece.absorbance.values.len() + piece.coverage.values.len())).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::phantom::tile::Tile;
    use crate::recipe::Preset;
    use crate::{Engine, Inputs};

    #[test]
    fn phantoms_are_moved_with_their_plot_and_the_oldest_are_removed() {
        let mut recipe = Preset::Sparse.recipe();
        (recipe.scan.width_px, recipe.scan.height_px) = (4000, 4000);
        recipe.scan.deposit.radius_um = 60_000.0.into();
        let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default()).unwrap();
        let objects = engine.slide(1, 0).unwrap().objects([0, 0], [2000, 2000]).unwrap();
        let tile = |values| Tile { origin: [3, -5], width: 1, values: vec![0.5; values] };
        let phantom = Phantom::whole(tile(MAX_BYTES / 16), tile(2), 1.0, Default::default());
        let cache = PhantomCache::default();
        let at = |object: &Object, at_px: [i64; 2]| {
            let plot = object.plot.map(|plot| Plot { at_px, ..plot });
            Object { plot, ..object.clone() }
        };
        assert!(cache.get(&objects[0], 2).is_none());
        for object in &objects[..4] {
            cache.insert(&at(object, [10, 20]), &phantom);
        }
        assert!(cache.get(&objects[0], 2).is_none(), "four phantoms are larger than the cache");
        let found = cache.get(&at(&objects[3], [8, 1000]), 2).unwrap();
        for tile in [&found.pieces[0].absorbance, &found.pieces[0].coverage] {
            assert_eq!(tile.origin, [3 - 2 * 2, -5 + 2 * 980]);
        }
        assert_eq!(found.pieces[0].absorbance.values, phantom.pieces[0].absorbance.values);
        assert_eq!(cache.kept().bytes, 3 * bytes(&phantom));
    }
}
