//! Works by the names under which other programs ask for them.

use std::path::Path;

use cloth_verlet::ClothParams;

use crate::cell::SHEETS;
use crate::{
    FRAME, Size, Work, at_density, blur, cytoskeleton, default_files, default_recipe, exposure, fields, gibson_lanni,
    peer_recipe, perlin, sheets, texture,
};

/// A work, and into how many parts its time is divided.
pub struct Timed {
    /// The work.
    pub work: Work,
    /// Parts of equal length.
    pub parts: f64,
}

/// The work of a name; none if there is no such work.
///
/// `pixels-SIDE` is the default recipe on a square of that side, `cells-COUNT` the peer's recipe on a field for that many
/// cells, both with as much of everything per area. Files are written below `folder`.
#[must_use]
pub fn named(name: &str, folder: &Path) -> Option<Timed> {
    let whole = |work| Some(Timed { work, parts: 1.0 });
    let sheet = ClothParams::paper();
    match name {
        "default-frame" => whole(default_files(folder)),
        // A sheet.
        "cloth-538" => Some(Timed { work: sheets(&sheet), parts: f64::from(SHEETS) }),
        // A step of a sheet.
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

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size that someone has typed")]
fn square(side: f64) -> Size {
    [side as usize; 2]
}

/// The size of a field, of the same form as the peer's, with room for so many cells at the peer's density.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size that someone has typed")]
fn room_for(cells: f64) -> Size {
    const CELLS: f64 = 30.0;
    FRAME.map(|side| (side as f64 * (cells / CELLS).sqrt()).round() as usize)
}
