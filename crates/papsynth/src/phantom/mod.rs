//! Phantoms of objects: the in-focus absorbance of each object and the exact coverage of its parts.
//!
//! This module draws epithelial cells; [`crate::debris`] draws all other kinds. A phantom depends only on its object
//! and on the random streams of that object.

mod assets;
pub(crate) mod box_sums;
mod cell;
mod cell_context;
mod chromatin;
mod coverage;
mod interpolation;
pub(crate) mod noise_fields;
mod nucleus;
pub(crate) mod parametric_shape;
mod phantom_scene;
pub(crate) mod piece;
mod streaks;
mod texture_pool;
pub(crate) mod tile;

use crate::debris::{ObjectContext, add_coat};
use crate::error::ErrorKind;
use crate::profile::Stage;
use crate::scene::{Body, Object, View};

pub(crate) use assets::{PhantomAssets, PhantomSettings};
use cell_context::CellContext;
pub(crate) use noise_fields::NoiseFields;
pub(crate) use phantom_scene::PhantomScene;
pub(crate) use piece::{Phantom, Piece};

/// Draws the phantoms of a batch of objects.
///
/// Sheets of a batch are simulated in SIMD lanes. The result does not depend on the grouping into batches.
pub(crate) fn make<'a>(
    assets: &'a PhantomAssets,
    scene: &'a PhantomScene,
    noise_fields: &'a NoiseFields<'a>,
    objects: &[&'a Object],
) -> Result<Vec<Phantom>, ErrorKind> {
    let cell = |object: &&'a Object| match &object.body {
        Body::Cell(body) => {
            let across_streaks_rad = streaks::direction_across(object.centre_um, scene.key_of(object));
            Some(CellContext { assets, scene, noise_fields, object, body, across_streaks_rad })
        }
        _ => None,
    };
    let cells: Vec<CellContext<'_>> = objects.iter().filter_map(cell).collect();
    let mut made = cell::make(assets, &cells)?;
    assets.timer.time(Stage::Debris, || {
        for (cell, phantom) in cells.iter().zip(&mut made) {
            if let Some(coat) = &cell.object.coat {
                add_coat(coat, &object_context(scene, noise_fields, cell.object), phantom);
            }
        }
        let mut cells = made.into_iter();
        let mut phantom = |object: &&Object| {
            debris(scene, noise_fields, object).or_else(|| cells.next()).expect("one phantom per cell")
        };
        Ok(objects.iter().map(&mut phantom).collect())
    })
}

/// Draws the phantom of an object other than an epithelial cell.
pub(crate) fn debris(scene: &PhantomScene, noise_fields: &NoiseFields<'_>, object: &Object) -> Option<Phantom> {
    object.body.phantom(&object_context(scene, noise_fields, object))
}

fn object_context<'a>(scene: &PhantomScene, noise_fields: &'a NoiseFields<'a>, object: &Object) -> ObjectContext<'a> {
    let grid = scene.grid();
    ObjectContext {
        dyes: scene.dyes,
        view: scene.view,
        oversampling: scene.oversampling,
        key: scene.key_of(object),
        kind: object.body.kind().name(),
        number: object.number,
        noise_fields,
        pixel_um: grid.pixel_um,
        centre_um: object.centre_um,
        centre: grid.to_px(object.centre_um),
        rotation_deg: object.rotation_deg,
    }
}

/// Number of objects per batch: the SIMD lanes of the sheet simulation.
pub(crate) const BATCH: usize = 16;

impl Phantom {
    /// Returns the phantom of an object of a plot, cropped to the object's maximum radius and moved to the plot's
    /// position.
    ///
    /// `n` is the number of grid points per pixel and axis.
    pub(crate) fn on_slide(mut self, object: &Object, view: View, n: usize) -> Self {
        let Some(plot) = object.plot else { return self };
        let reach_px = object.body.reach_um(view.pixel_um) / view.pixel_um + 2.0;
        let grid = |step: usize| View { pixel_um: view.pixel_um / step as f64, ..view };
        for piece in &mut self.pieces {
            let step = n / piece.step;
            for tile in [&mut piece.absorbance, &mut piece.coverage] {
                let centre = grid(step).to_px(object.centre_um);
                *tile = core::mem::take(tile).cropped(centre, reach_px * step as f64);
                for axis in 0..2 {
                    tile.origin[axis] += plot.at_px[axis] * step as i64;
                }
            }
        }
        self
    }
}
