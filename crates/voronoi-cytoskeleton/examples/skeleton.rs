//! Draws the figure of the README: `cargo run --release --example skeleton [path]`.
//!
//! Left: uniform random sites and their diagram. Centre: after two passes of Lloyd's algorithm. Right: the trees.

use image::GrayImage;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use voronoi_cytoskeleton::{
    DescentPath, Diagram, LineParams, PathEnd, Point, Skeleton, SkeletonParams, Window, draw_into,
};

const SIDE: usize = 256;
const GAP: usize = 4;
const WIDTH: usize = 3 * SIDE + 2 * GAP;
const SEED: u64 = 3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/voronoi-cytoskeleton.png".into());
    let outline = outline();
    let window = Window::around(&outline)?;
    let skeleton = Skeleton::new(&SkeletonParams::default())?;
    let unrelaxed = Skeleton::new(&SkeletonParams { lloyd_passes: 0, ..SkeletonParams::default() })?;
    let rng = || Xoshiro256PlusPlus::seed_from_u64(SEED);

    let before = unrelaxed.diagram(&window, &mut rng())?;
    let after = skeleton.diagram(&window, &mut rng())?;
    let trees = skeleton.grow(&outline, &mut rng())?;

    let mut figure = vec![0.0; WIDTH * SIDE];
    let fine = LineParams { width_px: 1.2, taper: 0.0, ..LineParams::default() };
    let faint = LineParams { peak: 0.3, ..fine };
    for (column, diagram) in [&before, &after].into_iter().enumerate() {
        let lines: Vec<DescentPath> = edges(diagram).chain(sites(diagram)).collect();
        draw_panel(&mut figure, column, &lines, &fine)?;
    }
    draw_panel(&mut figure, 2, &edges(&after).collect::<Vec<_>>(), &faint)?;
    draw_panel(&mut figure, 2, &[closed(&outline)], &fine)?;
    let bold = LineParams { width_px: 3.0, ..LineParams::default() };
    draw_panel(&mut figure, 2, &trees, &bold)?;

    let bytes = figure.into_iter().map(grey).collect();
    GrayImage::from_raw(u32::try_from(WIDTH)?, u32::try_from(SIDE)?, bytes)
        .ok_or("the buffer has the size of the figure")?
        .save(path)?;
    Ok(())
}

/// Returns the outline of a cell: a wavy ellipse.
fn outline() -> Vec<Point> {
    (0..420)
        .map(|k| {
            let angle = core::f64::consts::TAU * f64::from(k) / 420.0;
            let wave = 0.06 * libm::cos(3.0 * angle) + 0.03 * libm::sin(7.0 * angle);
            let radius = 112.0 * (1.0 + wave);
            [128.0 + radius * libm::cos(angle), 128.0 + 0.9 * radius * libm::sin(angle)]
        })
        .collect()
}

fn edges(diagram: &Diagram) -> impl Iterator<Item = DescentPath> + '_ {
    diagram.edges().iter().map(|edge| line(&edge.ends.map(|vertex| diagram.vertices()[vertex])))
}

fn sites(diagram: &Diagram) -> impl Iterator<Item = DescentPath> + '_ {
    diagram.sites().iter().map(|&site| line(&[site, site]))
}

fn closed(outline: &[Point]) -> DescentPath {
    let mut points = outline.to_vec();
    points.extend(outline.first());
    line(&points)
}

/// Returns a polyline as a path.
fn line(points: &[Point]) -> DescentPath {
    DescentPath { points: points.to_vec(), heights: vec![1.0; points.len()], end: PathEnd::Border }
}

fn draw_panel(
    figure: &mut [f32],
    column: usize,
    lines: &[DescentPath],
    params: &LineParams,
) -> Result<(), voronoi_cytoskeleton::Error> {
    let mut panel = vec![0.0; SIDE * SIDE];
    draw_into(&mut panel, SIDE, lines, params)?;
    for (row, line) in panel.chunks(SIDE).enumerate() {
        let start = row * WIDTH + column * (SIDE + GAP);
        for (pixel, value) in figure[start..].iter_mut().zip(line) {
            *pixel = pixel.max(*value);
        }
    }
    Ok(())
}

/// Returns the grey level of dark lines on white.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "values are in 0..=1")]
fn grey(value: f32) -> u8 {
    (255.0 - value * 255.0).round() as u8
}
