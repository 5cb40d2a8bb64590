//! What the examples, the tests and the bench share: outlines made in code, and outlines read from a table.

#![allow(dead_code, reason = "each program uses a part of it")]

use std::collections::BTreeMap;
use std::path::Path;

use fsd_shape::{Point, Rng};

/// Uniform in -1..1.
pub(crate) fn sway<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    f64::from(rng.next_u32()) / f64::from(u32::MAX) * 2.0 - 1.0
}

/// How [`polygon`] shapes an outline.
pub(crate) struct Look {
    /// Relative displacement of the corners, and of the axes.
    pub(crate) sway: f64,
    /// Greatest relative displacement of the middle of a side; each of the first sides takes its own share of it.
    pub(crate) bend: f64,
    /// How often sides are broken up at their middle.
    pub(crate) levels: u32,
}

/// Corners, straight and crenulated sides: a stand-in for a cell.
pub(crate) const CELL: Look = Look { sway: 0.18, bend: 0.16, levels: 5 };
/// Blunt and nearly round: a stand-in for a nucleus.
pub(crate) const NUCLEUS: Look = Look { sway: 0.07, bend: 0.02, levels: 2 };

/// A polygon of 5 to 9 corners round a jittered ellipse, its sides broken up again and again at a displaced middle.
pub(crate) fn polygon<R: Rng + ?Sized>(radius: f64, look: &Look, rng: &mut R) -> Vec<Point> {
    let corners = 5 + rng.next_u32() % 5;
    let stretch = 1.0 + look.sway * sway(rng);
    let turned = libm::sincos(std::f64::consts::PI * sway(rng));
    let rotate = |[x, y]: Point, (sin, cos): (f64, f64)| [x * cos - y * sin, x * sin + y * cos];
    let mut outline: Vec<Point> = (0..corners)
        .map(|k| {
            let place = f64::from(k) + 1.5 * look.sway * sway(rng);
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * place / f64::from(corners));
            let r = radius * (1.0 + look.sway * sway(rng));
            rotate([r * cos * stretch, r * sin / stretch], turned)
        })
        .collect();
    let mut bends: Vec<f64> = outline.iter().map(|_| look.bend * sway(rng).abs()).collect();
    for _ in 0..look.levels {
        let count = outline.len();
        let halves = (0..count).flat_map(|k| {
            let (p, q) = (outline[k], outline[(k + 1) % count]);
            let by = bends[k] * sway(rng);
            let middle = [(p[0] + q[0]) / 2.0 + by * (q[1] - p[1]), (p[1] + q[1]) / 2.0 - by * (q[0] - p[0])];
            [p, middle]
        });
        outline = halves.collect();
        bends = bends.iter().flat_map(|&bend| [bend; 2]).collect();
    }
    outline
}

/// `count` polygons of spread size.
pub(crate) fn polygons<R: Rng + ?Sized>(count: usize, radius: f64, look: &Look, rng: &mut R) -> Vec<Vec<Point>> {
    (0..count)
        .map(|_| {
            let size = radius * libm::exp(0.2 * sway(rng));
            polygon(size, look, rng)
        })
        .collect()
}

/// Outlines from a table with the columns outline, k, x_px, y_px and one line of headings.
pub(crate) fn read_outlines(path: &Path) -> Result<Vec<Vec<Point>>, Box<dyn std::error::Error>> {
    let text = std::fs::read_to_string(path)?;
    let mut outlines: BTreeMap<u32, Vec<Point>> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let [outline, _, x, y] = fields[..] else {
            return Err(format!("not four fields: {line}").into());
        };
        outlines.entry(outline.parse()?).or_default().push([x.parse()?, y.parse()?]);
    }
    Ok(outlines.into_values().collect())
}

/// Mean and standard deviation.
pub(crate) fn mean_and_sd(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (mean, (squares / (n - 1.0)).sqrt())
}
