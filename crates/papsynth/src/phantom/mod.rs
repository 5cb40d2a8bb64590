//! From a scene to phantoms: what each object absorbs when it is in focus, and the exact cover of its parts.
//!
//! Cells are made here, everything else in the file of its kind, in [`crate::debris`]. A phantom depends on its object and on the object's own streams alone.

mod cell;
mod chromatin;
mod making;
mod nucleus;
pub(crate) mod piece;
pub(crate) mod pools;
mod studio;
pub(crate) mod tile;
pub(crate) mod wobble;

use crate::debris::{Site, cover};
use crate::error::Cause;
use crate::profile::Stage;
use crate::scene::{Body, Object, Scene, View};

use making::Cell;
pub(crate) use piece::{Phantom, Piece};
pub(crate) use pools::Pools;
pub(crate) use studio::Studio;

/// Makes the phantoms of a run of objects.
///
/// Objects are handed over in batches because sheets are pressed side by side in SIMD lanes; the result is the same
/// for any grouping.
pub(crate) fn make<'a>(
    studio: &'a Studio,
    scene: &'a Scene,
    pools: &'a Pools<'a>,
    objects: &[&'a Object],
) -> Result<Vec<Phantom>, Cause> {
    let cell = |object: &&'a Object| match &object.body {
        Body::Cell(body) => Some(Cell { studio, scene, pools, object, body }),
        _ => None,
    };
    let cells: Vec<Cell<'_>> = objects.iter().filter_map(cell).collect();
    let mut made = cell::make(studio, &cells)?;
    studio.watch.time(Stage::Debris, || {
        for (cell, phantom) in cells.iter().zip(&mut made) {
            if let Some(coat) = &cell.object.coat {
                cover(coat, &site(scene, pools, cell.object), phantom);
            }
        }
        let mut cells = made.into_iter();
        let mut phantom =
            |object: &&Object| debris(scene, pools, object).or_else(|| cells.next()).expect("every cell was made");
        Ok(objects.iter().map(&mut phantom).collect())
    })
}

/// The phantom of an object that is no cell.
pub(crate) fn debris(scene: &Scene, pools: &Pools<'_>, object: &Object) -> Option<Phantom> {
    object.body.phantom(&site(scene, pools, object))
}

fn site<'a>(scene: &Scene, pools: &'a Pools<'a>, object: &Object) -> Site<'a> {
    let grid = scene.grid();
    Site {
        dyes: scene.dyes,
        view: scene.view,
        oversampling: scene.oversampling(),
        key: scene.key_of(object),
        kind: object.body.kind().name(),
        number: object.number,
        pools,
        pixel_um: grid.pixel_um,
        centre_um: object.centre_um,
        centre: grid.to_px(object.centre_um),
        rotation_deg: object.rotation_deg,
    }
}

/// Number of objects that are worth making together: the lanes of a batch of sheets.
pub(crate) const BATCH: usize = 16;

impl Phantom {
    /// The phantom of an object of a plot, made as if the plot were the image: cut off where the object may reach no further, then
    /// moved to where the plot lies. `n` are the grid points along a pixel.
    pub(crate) fn on_slide(mut self, object: &Object, view: View, n: usize) -> Self {
        let Some(plot) = object.plot else { return self };
        let reach_px = object.body.reach_um(view.pixel_um) / view.pixel_um + 2.0;
        let grid = |step: usize| View { pixel_um: view.pixel_um / step as f64, ..view };
        for piece in &mut self.pieces {
            for (tile, step) in [(&mut piece.absorbance, n), (&mut piece.coverage, n / piece.cover_step)] {
                let centre = grid(step).to_px(object.centre_um);
                *tile = core::mem::take(tile).within(centre, reach_px * step as f64);
                for axis in 0..2 {
                    tile.origin[axis] += plot.at_px[axis] * step as i64;
                }
            }
        }
        self
    }
}
