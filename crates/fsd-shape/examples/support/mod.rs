//! Synthetic outlines, and outlines read from a table, for examples, tests and benchmarks.

#![allow(dead_code, reason = "not every program uses all functions")]

use std::collections::BTreeMap;
use std::path::Path;

use fsd_shape::{Point, Rng};

/// Returns a uniform number in -1..1.
pub(crate) fn jitter<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    f64::from(rng.next_u32()) / f64::from(u32::MAX) * 2.0 - 1.0
}

/// Style of the outlines of [`polygon`].
pub(crate) struct PolygonStyle {
    /// Maximum relative displacement of the corners and axes.
    pub(crate) jitter: f64,
    /// Maximum relative displacement of the midpoint of a side; each initial side draws its own.
    pub(crate) bend: f64,
    /// Number of midpoint subdivisions of the sides.
    pub(crate) levels: u32,
}

/// An outline like that of a cell, with corners and with straight and crenulated sides.
pub(crate) const CELL: PolygonStyle = PolygonStyle { jitter: 0.18, bend: 0.16, levels: 5 };
/// An outline like that of a nucleus, smooth and nearly round.
pub(crate) const NUCLEUS: PolygonStyle = PolygonStyle { jitter: 0.07, bend: 0.02, levels: 2 };

/// Returns a polygon of 5 to 9 corners on a jittered ellipse, whose sides are subdivided at displaced midpoints.
pub(crate) fn polygon<R: Rng + ?Sized>(radius: f64, style: &PolygonStyle, rng: &mut R) -> Vec<Point> {
    let corners = 5 + rng.next_u32() % 5;
    let stretch = 1.0 + style.jitter * jitter(rng);
    let turned = libm::sincos(std::f64::consts::PI * jitter(rng));
    let rotate = |[x, y]: Point, (sin, cos): (f64, f64)| [x * cos - y * sin, x * sin + y * cos];
    let mut outline: Vec<Point> = (0..corners)
        .map(|k| {
            let place = f64::from(k) + 1.5 * style.jitter * jitter(rng);
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * place / f64::from(corners));
            let r = radius * (1.0 + style.jitter * jitter(rng));
            rotate([r * cos * stretch, r * sin / stretch], turned)
        })
        .collect();
    let mut bends: Vec<f64> = outline.iter().map(|_| style.bend * jitter(rng).abs()).collect();
    for _ in 0..style.levels {
        let count = outline.len();
        let halves = (0..count).flat_map(|k| {
            let (p, q) = (outline[k], outline[(k + 1) % count]);
            let by = bends[k] * jitter(rng);
            let middle = [(p[0] + q[0]) / 2.0 + by * (q[1] - p[1]), (p[1] + q[1]) / 2.0 - by * (q[0] - p[0])];
            [p, middle]
        });
        outline = halves.collect();
        bends = bends.iter().flat_map(|&bend| [bend; 2]).collect();
    }
    outline
}

/// Returns `count` polygons of varying size.
pub(crate) fn polygons<R: Rng + ?Sized>(
    count: usize,
    radius: f64,
    style: &PolygonStyle,
    rng: &mut R,
) -> Vec<Vec<Point>> {
    (0..count)
        .map(|_| {
            let size = radius * libm::exp(0.2 * jitter(rng));
            polygon(size, style, rng)
        })
        .collect()
}

/// Reads outlines from a table with the columns outline, k, x_px, y_px and a header line.
pub(crate) fn read_outlines(path: &Path) -> Result<Vec<Vec<Point>>, Box<dyn std::error::Error>> {
    let text = std::fs::read_to_string(path)?;
    let mut outlines: BTreeMap<u32, Vec<Point>> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let [outline, _, x, y] = fields[..] else {
            return Err(format!("expected 4 fields: {line}").into());
        };
        outlines.entry(outline.parse()?).or_default().push([x.parse()?, y.parse()?]);
    }
    Ok(outlines.into_values().collect())
}

/// Returns mean and standard deviation.
pub(crate) fn mean_and_sd(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (mean, (squares / (n - 1.0)).sqrt())
}
