//! Workloads by name.

use std::path::Path;

use cloth_verlet::ClothParams;

use crate::cell::SHEETS;
use crate::{
    FRAME, Size, Workload, at_density, blur, cytoskeleton, default_files, default_recipe, exposure, fields,
    gibson_lanni, peer_recipe, perlin, sheets, texture,
};

/// A workload and the number of parts that its time is divided by.
pub struct Timed {
    /// The workload.
    pub work: Workload,
    /// Number of equal parts.
    pub parts: f64,
}

/// Returns the workload of a name, or `None` for an unknown name.
///
/// `pixels-SIDE` is the default recipe on a square of this size. `cells-COUNT` is the peer's recipe on a field for this
/// many cells. Both keep the density of objects. Files are written to `folder`.
#[must_use]
pub fn named(name: &str, folder: &Path) -> Option<Timed> {
    let whole = |work| Some(Timed { work, parts: 1.0 });
    let sheet = ClothParams::paper();
    match name {
        "default-frame" => whole(default_files(folder)),
        // Per sheet.
        "cloth-538" => Some(Timed { work: sheets(&sheet), parts: f64::from(SHEETS) }),
        // Per step of a sheet.
        "cloth-10000" => {
            let params = ClothParams { vertices: 10_000, outline_points: 330, ..sheet };
            Some(Timed { work: sheets(&params), parts: f64::from(SHEETS) * params.steps as f64 })
        }
        "noise" => whole(exposure(FRAME)),
        "nucleus" => whole(texture()),
        "cytoskeleton" => whole(cytoskeleton()),
        "perlin" => whole(perlin(FRAME)),
        "gibson-lanni" => whole(gibson_lanni()),
        _ => {
            let (kind, number) = name.split_once('-')?;
            let number: f64 = number.parse().ok().filter(|n| *n > 0.0)?;
            match kind {
                "blur" => whole(blur(FRAME, number)),
                "pixels" => whole(fields(&at_density(default_recipe(), square(number)))),
                "cells" => whole(fields(&at_density(peer_recipe(), room_for(number)))),
                _ => None,
            }
        }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size from the command line")]
fn square(side: f64) -> Size {
    [side as usize; 2]
}

/// Returns the size of a field with the peer's aspect ratio and cell density for a number of cells.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size from the command line")]
fn room_for(cells: f64) -> Size {
    const CELLS: f64 = 30.0;
    FRAME.map(|side| (side as f64 * (cells / CELLS).sqrt()).round() as usize)
}
