//! Workloads for the parts of a cell: its sheet, the texture of its nucleus, its cytoskeleton.

use std::hint::black_box;

use cloth_verlet::{Cloth, ClothParams, Crease, FoldKind, PixelGrid};
use quilt_texture::{QuiltParams, Quilter, Source};
use voronoi_cytoskeleton::{LineParams, Skeleton, SkeletonParams, draw_into};

use crate::{Workload, noise, rng};

/// Sheets pressed together, one per SIMD lane.
pub(crate) const SHEETS: u8 = 16;

/// Image size of a nucleus in pixels.
const NUCLEUS_PX: usize = 40;

/// Image size of a cell in pixels.
const CELL_PX: usize = 200;

/// Image size of a sheet in pixels.
const SHEET_PX: usize = 220;

/// Returns a closed curve around the origin, about 100 pixels from it.
fn outline(points: u32, waves: f64) -> Vec<[f64; 2]> {
    (0..points)
        .map(|k| std::f64::consts::TAU * f64::from(k) / f64::from(points))
        .map(|angle| (100.0 * (1.0 + 0.1 * libm::cos(waves * angle)), angle))
        .map(|(r, angle)| [r * libm::cos(angle), r * libm::sin(angle)])
        .collect()
}

/// Presses sixteen sheets, each into its own outline.
#[must_use]
pub fn sheets(params: &ClothParams) -> Workload {
    let cloth = Cloth::new(params).expect("the parameters are valid");
    let outlines: Vec<_> = (0..SHEETS).map(|k| outline(200, f64::from(2 + k % 5))).collect();
    let rngs: Vec<_> = (0..SHEETS).map(|k| rng(k.into())).collect();
    Box::new(move || {
        let outlines: Vec<&[_]> = outlines.iter().map(Vec::as_slice).collect();
        black_box(cloth.crumple_many(&outlines, &mut rngs.clone()));
    })
}

/// Draws the thickness of a folded sheet.
#[must_use]
pub fn thickness() -> Workload {
    let cloth = Cloth::new(&ClothParams { steps: 12, ..ClothParams::default() }).expect("the parameters are valid");
    let mut sheet = cloth.crumple(&outline(200, 3.0), &mut rng(1)).expect("the outline has an area");
    let crease = Crease::straight([30.0, 10.0], 1.0, 4.0, FoldKind::Flap);
    sheet.fold(&crease).expect("the crease meets the sheet");
    let view = PixelGrid { origin: [-110.0, -110.0], pixel_size: 1.0 };
    let mut image = vec![0.0; SHEET_PX * SHEET_PX];
    Box::new(move || {
        sheet.thickness_into(&mut image, SHEET_PX, &view, |r| 1.5 - r * r);
        black_box(&image);
    })
}

/// Synthesises the texture of a nucleus of 40 x 40 pixels from three donors, with the paper's parameters.
#[must_use]
pub fn texture() -> Workload {
    let offset = |i: usize| (2 * i + 1) as f32 / NUCLEUS_PX as f32 - 1.0;
    let inside = |x: f32, y: f32| if x * x + y * y < 1.0 { 1.0 } else { 0.0 };
    let mask: Vec<f32> =
        (0..NUCLEUS_PX * NUCLEUS_PX).map(|i| inside(offset(i % NUCLEUS_PX), offset(i / NUCLEUS_PX))).collect();
    let sources: Vec<_> =
        (0..3).map(|seed| Source::new(&donor(seed), &mask, NUCLEUS_PX).expect("a patch fits into the disc")).collect();
    let mut rng = rng(1);
    let params = QuiltParams::paper();
    Box::new(move || {
        let sources: Vec<&Source> = sources.iter().collect();
        let quilter = Quilter::new(&sources, &params).expect("the parameters are valid");
        black_box(quilter.synthesise(&mask, NUCLEUS_PX, &mut rng));
    })
}

/// Returns white noise averaged over 3 x 3 pixels, with a standard deviation of about 17 grey levels.
fn donor(seed: u64) -> Vec<f32> {
    let noise = noise(NUCLEUS_PX * NUCLEUS_PX, seed);
    let at = |x: usize, y: usize| noise[y % NUCLEUS_PX * NUCLEUS_PX + x % NUCLEUS_PX];
    let mean = |i: usize| {
        let (x, y) = (i % NUCLEUS_PX, i / NUCLEUS_PX);
        (0..9).map(|k| at(x + k % 3, y + k / 3)).sum::<f32>() / 9.0
    };
    (0..NUCLEUS_PX * NUCLEUS_PX).map(|i| 177.0 * mean(i)).collect()
}

/// Grows and draws the cytoskeleton of a cell 200 pixels wide.
#[must_use]
pub fn cytoskeleton() -> Workload {
    let middle = CELL_PX as f64 / 2.0;
    let outline: Vec<_> = outline(420, 3.0).into_iter().map(|[x, y]| [middle + 0.88 * x, middle + 0.88 * y]).collect();
    let skeleton = Skeleton::new(&SkeletonParams::default()).expect("the defaults are valid");
    let line = LineParams::default();
    let mut rng = rng(7);
    let mut image = vec![0.0; CELL_PX * CELL_PX];
    Box::new(move || {
        image.fill(0.0);
        let rivers = skeleton.grow(&outline, &mut rng).expect("the outline has an area");
        draw_into(&mut image, CELL_PX, &rivers, &line).expect("the line is valid");
        black_box(&image);
    })
}
