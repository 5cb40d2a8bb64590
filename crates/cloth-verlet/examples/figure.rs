//! Draws the steps from an outline to an image: outline, flat mesh, crumpled mesh, thickness; then the paper's method,
//! a flap, a rolled rim, and a sheet folded in from both sides. Usage: `figure [path]`, default
//! `target/cloth-verlet.png`.

use cloth_verlet::{Cloth, ClothParams, Crease, FoldKind, PixelGrid, Point, Sheet};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{GrayImage, Luma};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::error::Error;

const PANEL: u32 = 244;
const COLUMNS: u32 = 4;
const PAPER_WHITE: f32 = 235.0;
/// Step of the grey levels: invisible, and the file stays small.
const GREY_STEP: f32 = 3.0;
/// Absorbance at the centre of the flat sheet.
const ABSORBANCE: f64 = 0.16;

/// An irregular outline, about 220 px across, around the origin.
const OUTLINE: [Point; 20] = [
    [-98.0, -18.0],
    [-80.0, -60.0],
    [-52.0, -88.0],
    [-20.0, -98.0],
    [8.0, -86.0],
    [30.0, -92.0],
    [66.0, -84.0],
    [88.0, -56.0],
    [92.0, -30.0],
    [85.0, -6.0],
    [84.0, 16.0],
    [104.0, 38.0],
    [92.0, 66.0],
    [58.0, 76.0],
    [40.0, 94.0],
    [6.0, 90.0],
    [-26.0, 98.0],
    [-62.0, 82.0],
    [-72.0, 52.0],
    [-94.0, 30.0],
];

/// Panels side by side, in grey levels.
struct Figure {
    levels: Vec<f32>,
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "grey levels and pixel numbers are in range"
)]
impl Figure {
    const WIDTH: u32 = PANEL * COLUMNS;

    /// Draws the segment from `a` to `b`, about one pixel wide, relative to the centre of a panel.
    fn line(&mut self, panel: u32, a: Point, b: Point, ink: f32) {
        let middle = f64::from(PANEL) / 2.0;
        let steps = ((b[0] - a[0]).abs() + (b[1] - a[1]).abs()) * 2.0 + 1.0;
        let mut step = 0.0;
        while step <= steps {
            let t = step / steps;
            let (x, y) = (a[0] + t * (b[0] - a[0]) + middle, a[1] + t * (b[1] - a[1]) + middle);
            let (left, top) = (x.floor(), y.floor());
            for (column, row, part) in [
                (left, top, (1.0 - x + left) * (1.0 - y + top)),
                (left + 1.0, top, (x - left) * (1.0 - y + top)),
                (left, top + 1.0, (1.0 - x + left) * (y - top)),
                (left + 1.0, top + 1.0, (x - left) * (y - top)),
            ] {
                let (column, row) = (column as u32 + panel % COLUMNS * PANEL, row as u32 + panel / COLUMNS * PANEL);
                self.levels[(row * Self::WIDTH + column) as usize] -= ink * part as f32;
            }
            step += 1.0;
        }
    }

    fn mesh(&mut self, panel: u32, sheet: &Sheet, place: impl Fn(usize) -> Point) {
        for t in sheet.triangles() {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                self.line(panel, place(a as usize), place(b as usize), 16.0);
            }
        }
    }

    fn thickness(&mut self, panel: u32, sheet: &Sheet) {
        let middle = f64::from(PANEL) / 2.0;
        let mut tile = vec![0.0_f32; (PANEL * PANEL) as usize];
        sheet.thickness_into(
            &mut tile,
            PANEL as usize,
            &PixelGrid { origin: [-middle, -middle], pixel_size: 1.0 },
            |r| 1.0 - 0.45 * r * r,
        );
        let (left, top) = (panel % COLUMNS * PANEL, panel / COLUMNS * PANEL);
        for (row, line) in (top..).zip(tile.chunks_exact(PANEL as usize)) {
            for (column, &t) in (left..).zip(line) {
                let dark = libm::pow(10.0, -ABSORBANCE * f64::from(t));
                self.levels[(row * Self::WIDTH + column) as usize] = PAPER_WHITE * dark as f32;
            }
        }
    }

    fn image(&self) -> GrayImage {
        let height = self.levels.len() as u32 / Self::WIDTH;
        let grey = |level: f32| (level.clamp(0.0, 255.0) / GREY_STEP).round() * GREY_STEP;
        GrayImage::from_fn(Self::WIDTH, height, |x, y| Luma([grey(self.levels[(y * Self::WIDTH + x) as usize]) as u8]))
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/cloth-verlet.png".to_owned());
    let cloth = Cloth::new(&ClothParams::default())?;
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
    let sheet = cloth.crumple(&OUTLINE, &mut rng)?;
    let paper = Cloth::new(&ClothParams::paper())?.crumple(&OUTLINE, &mut rng)?;

    let mut figure = Figure { levels: vec![PAPER_WHITE; (Figure::WIDTH * PANEL * 2) as usize] };
    for k in 0..OUTLINE.len() {
        figure.line(0, OUTLINE[k], OUTLINE[(k + 1) % OUTLINE.len()], 80.0);
    }
    figure.mesh(1, &sheet, |v| sheet.rest_positions()[v]);
    figure.mesh(2, &sheet, |v| [sheet.vertices()[v][0], sheet.vertices()[v][1]]);
    figure.thickness(3, &sheet);

    figure.thickness(4, &paper);
    let flap = Crease::straight([42.0, -20.0], -1.0, 3.0, FoldKind::Flap);
    let roll = Crease::straight([0.0, 70.0], 0.15, 2.5, FoldKind::Roll { turns: 2 });
    let sides = [
        Crease::straight([35.0, 0.0], -1.4, 7.0, FoldKind::Flap),
        Crease::straight([-30.0, 0.0], 1.8, 6.0, FoldKind::Flap),
    ];
    for (panel, creases) in [(5, &[flap][..]), (6, &[roll]), (7, &sides)] {
        let mut folded = sheet.clone();
        for crease in creases {
            folded.fold(crease)?;
        }
        figure.thickness(panel, &folded);
    }
    let file = std::fs::File::create(path)?;
    figure.image().write_with_encoder(PngEncoder::new_with_quality(file, CompressionType::Best, FilterType::Up))?;
    Ok(())
}
