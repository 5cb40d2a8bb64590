//! Writes the image of the crate documentation: a notched disc at five depths, and the intensity along a line across
//! its slits. Optional argument: the output path.

use std::error::Error;

use image::GrayImage;
use optics_psf::{DepthOfFocus, FocusParams, Gaussian};

/// Size of the tile around the disc, and of a panel of the image.
const TILE: usize = 96;
const PANEL: usize = 150;

/// Column of the profile in a panel; it crosses all slits.
const SLITS: usize = 65;

const DEPTHS_UM: [f64; 5] = [0.0, 1.0, 2.0, 4.0, 8.0];
const ABSORBANCE: f32 = 0.5;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/depth.png".to_owned());
    let focus = DepthOfFocus::new(&FocusParams::paper())?;
    let disc = notched_disc();
    let mut panels = vec![255; PANEL * DEPTHS_UM.len() * 2 * PANEL];
    for (i, depth_um) in DEPTHS_UM.into_iter().enumerate() {
        let (tile, margin) = Gaussian::new(focus.sigma_px(depth_um))?.blur_expanded(&disc, TILE);
        let light = transmitted(&tile, TILE + 2 * margin);
        let light = Gaussian::new(focus.sigma_xy_px())?.blur(&light, PANEL, Default::default());
        let row_of = |y| y * PANEL * DEPTHS_UM.len() + i * PANEL;
        for (y, row) in light.chunks(PANEL).enumerate() {
            row.iter().enumerate().for_each(|(x, &v)| panels[row_of(y) + x] = grey(v));
        }
        let height = |y: usize| usize::from(255 - grey(light[y * PANEL + SLITS])) * 3 / 4;
        for y in 1..PANEL {
            let (a, b) = (height(y - 1), height(y));
            (a.min(b)..=a.max(b)).for_each(|h| panels[row_of(PANEL + h) + y] = 0);
        }
    }
    let (width, height) = (PANEL * DEPTHS_UM.len(), 2 * PANEL);
    let panels = GrayImage::from_raw(u32::try_from(width)?, u32::try_from(height)?, panels);
    panels.ok_or("the image has the wrong size")?.save(path)?;
    Ok(())
}

/// Returns the absorbance of a disc with slits of one to five pixels, cut from the left.
fn notched_disc() -> Vec<f32> {
    let centre = (TILE as f32 - 1.0) / 2.0;
    let pixel = |i: usize| {
        let (x, y) = ((i % TILE) as f32 - centre, (i / TILE) as f32 - centre);
        let inside = (centre - 4.0 - (x * x + y * y).sqrt() + 0.5).clamp(0.0, 1.0);
        let slit = [(-27.0, 1.0), (-16.0, 2.0), (-3.0, 3.0), (11.0, 4.0), (25.0, 5.0)]
            .iter()
            .any(|(top, thickness)| y > *top && y <= top + thickness && x < 12.0);
        if slit { 0.0 } else { ABSORBANCE * inside }
    };
    (0..TILE * TILE).map(pixel).collect()
}

/// Returns the tile at the centre of a panel, or its centre, as transmitted light (Eq. 11).
fn transmitted(tile: &[f32], width: usize) -> Vec<f32> {
    let shift = (PANEL as isize - width as isize) / 2;
    let pixel = |i: usize| {
        let at = |p: usize| usize::try_from(p as isize - shift).ok().filter(|&p| p < width);
        let absorbance = at(i % PANEL).zip(at(i / PANEL)).map_or(0.0, |(x, y)| tile[y * width + x]);
        libm::exp10f(-absorbance)
    };
    (0..PANEL * PANEL).map(pixel).collect()
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0..=1 to 8 bits")]
fn grey(light: f32) -> u8 {
    (light * 240.0 + 0.5) as u8
}
