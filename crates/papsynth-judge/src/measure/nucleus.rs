//! What a nucleus looks like.

use std::f64::consts::{PI, TAU};

use portable_numerics::statistics::correlation;

use super::maps::Maps;
use crate::moments::Histogram;
use crate::number::{nearest, whole};
use crate::region::{Region, distance_inside};
use crate::statistics::{deviation, mean, median, of_sorted};
use crate::table::{Family, Row};

/// The rim, which is blurred, is left out of the core: pixels.
pub(crate) const RIM_PX: f64 = 2.0;

/// Bins from the rim to the centre.
const BINS: usize = 5;

/// Sectors that are compared around the rim.
const SECTORS: usize = 12;

/// Distances at which grey levels are compared, pixels.
const LAGS: [usize; 5] = [1, 2, 3, 4, 6];

/// The surroundings begin and end so far from the rim, µm.
const BESIDE_UM: [f64; 2] = [0.8, 2.5];

/// And further out.
const BEYOND_UM: [f64; 2] = [2.5, 5.0];

/// Radial profiles reach so far to either side of the rim, pixels.
const REACH_PX: i32 = 4;

/// A pixel in or around a nucleus.
struct Pixel {
    index: usize,
    x: f64,
    y: f64,
    a: f64,
    /// Distance from the rim, pixels; positive inside.
    depth: f64,
    sector: usize,
}

/// All features of a nucleus; `others` is true in every pixel of any nucleus.
pub(crate) fn features(maps: &Maps, region: &Region, others: &[bool], pixel_um: f64) -> Row {
    let shape = region.shape();
    let pixels = pixels(maps, region, others, shape.centre, whole(BEYOND_UM[1] / pixel_um) + 2);
    let deepest = pixels.iter().map(|p| p.depth).fold(0.0, f64::max);
    let rim = RIM_PX.min(0.4 * deepest);
    let core: Vec<&Pixel> = pixels.iter().filter(|p| p.depth > rim).collect();
    let ring =
        |[from, to]: [f64; 2]| pixels.iter().filter(move |p| -p.depth > from / pixel_um && -p.depth <= to / pixel_um);
    let mut core_a: Vec<f64> = core.iter().map(|p| p.a).collect();
    core_a.sort_unstable_by(f64::total_cmp);
    let beside: Vec<f64> = ring(BESIDE_UM).map(|p| p.a).collect();
    let beyond: Vec<f64> = ring(BEYOND_UM).map(|p| p.a).collect();
    let (inner, middle) = (mean(&core_a), of_sorted(&core_a, 0.5));
    let outer = if beside.is_empty() { f64::NAN } else { median(&mut beside.clone()) };
    let contrast = inner - outer;
    let sd = deviation(&core_a);
    let mut row = Row::default();

    let um2 = pixel_um * pixel_um;
    row.put(Family::Shape, "nucleus area, um2", shape.area * um2);
    row.put(Family::Shape, "nucleus eccentricity", shape.eccentricity);
    row.put(Family::Shape, "nucleus solidity", shape.solidity);
    row.put(Family::Shape, "nucleus circularity", shape.circularity);
    row.put(Family::Shape, "nucleus outline roughness", roughness(region, &shape));

    row.put(Family::Stain, "core absorbance", inner);
    row.put(Family::Stain, "core above surroundings", contrast);
    row.put(Family::Surroundings, "absorbance beside", outer);
    row.put(Family::Surroundings, "absorbance further out less beside", mean(&beyond) - mean(&beside));
    row.put(Family::Surroundings, "spread beside", deviation(&beside));
    let beside_of = |s: usize| mean_of(ring(BESIDE_UM).filter(|p| p.sector == s).map(|p| p.a));
    row.put(Family::Surroundings, "unevenness around", deviation(&known((0..SECTORS).map(beside_of))));

    row.put(Family::Texture, "core sd", sd);
    row.put(Family::Texture, "core sd over contrast", sd / contrast.max(0.02));
    row.put(Family::Texture, "core skewness", standard_moment(&core_a, inner, sd, 3));
    row.put(Family::Texture, "core kurtosis", standard_moment(&core_a, inner, sd, 4));
    row.put(Family::Texture, "core dark tail", (of_sorted(&core_a, 0.95) - middle) / sd.max(1e-3));
    row.put(Family::Texture, "core pale tail", (middle - of_sorted(&core_a, 0.05)) / sd.max(1e-3));

    // From the rim to the centre, against the surroundings and the core.
    for bin in 0..BINS {
        let of = |d: f64| nearest(BINS as f64 * d / deepest - 0.5).min(BINS - 1);
        let a = mean_of(pixels.iter().filter(|p| p.depth > 0.0 && of(p.depth) == bin).map(|p| p.a));
        row.put(Family::Rim, format!("rim to centre, bin {} of {BINS}", bin + 1), (a - outer) / contrast.max(0.02));
    }
    let profile: Vec<f64> = (-REACH_PX..REACH_PX)
        .map(|d| f64::from(d) + 0.5)
        .map(|d| mean_of(pixels.iter().filter(|p| (p.depth - d).abs() < 0.75).map(|p| p.a)))
        .collect();
    let steepest = profile.windows(2).map(|w| w[1] - w[0]).filter(|s| s.is_finite()).fold(1e-3, f64::max);
    // The step of an edge blurred by σ has the slope 1/(σ √(2π)) of its height.
    row.put(Family::Rim, "rim sigma, px", contrast / (steepest * TAU.sqrt()));
    let membrane = profile[whole(f64::from(REACH_PX))..]
        .iter()
        .copied()
        .filter(|v| v.is_finite())
        .fold(f64::NEG_INFINITY, f64::max);
    row.put(Family::Rim, "darkest depth over core", (membrane - inner) / contrast.max(0.02));
    let rim_slope = |s: usize| {
        mean_of(pixels.iter().filter(|p| p.depth.abs() < 1.5 && p.sector == s).map(|p| f64::from(maps.slope[p.index])))
    };
    let slopes = known((0..SECTORS).map(rim_slope));
    row.put(Family::Rim, "rim slope over contrast", mean(&slopes) / contrast.max(0.02));
    row.put(Family::Rim, "rim unevenness", deviation(&slopes) / mean(&slopes).max(1e-3));

    let rests = detrended(&core);
    let tile = Tile::new(&core, &rests);
    for lag in LAGS {
        let both = [tile.correlation(lag, 0), tile.correlation(0, lag)];
        row.put(Family::Texture, format!("core correlation at {lag} px"), mean(&both));
        if lag <= 2 {
            row.put(Family::Noise, format!("core correlation down less across at {lag} px"), both[1] - both[0]);
        }
    }
    let rest = deviation(&rests);
    row.put(Family::Texture, "core sd without trend", rest);
    for (band, name) in [(0, "1"), (1, "2"), (2, "4")] {
        row.put(Family::Texture, format!("core power at {name} px"), maps.power(core.iter().map(|p| p.index), band));
    }
    let slope_inside = mean_of(core.iter().map(|p| f64::from(maps.slope[p.index])));
    row.put(Family::Texture, "core slope", slope_inside);
    row.put(Family::Texture, "core slope over sd", slope_inside / rest.max(1e-3));
    let [spots, holes] = maps.extrema(core.iter().map(|p| p.index));
    row.put(Family::Texture, "dark spots, um-2", spots / um2);
    row.put(Family::Texture, "pale spots, um-2", holes / um2);

    let histogram = Histogram::new(core.iter().map(|p| maps.grey[p.index]));
    for n in 2..=6 {
        row.put(Family::Texture, format!("log moment {n}"), histogram.log_moment(n));
    }
    row.put(Family::Texture, "entropy, bits", histogram.entropy());
    row
}

fn pixels(maps: &Maps, region: &Region, others: &[bool], centre: [f64; 2], margin: usize) -> Vec<Pixel> {
    let (inside, wide, [left, top]) = region.tile(margin);
    let outside: Vec<bool> = inside.iter().map(|i| !i).collect();
    let (depths, heights) = (distance_inside(&inside, wide), distance_inside(&outside, wide));
    let mut pixels = Vec::with_capacity(inside.len());
    for i in 0..inside.len() {
        let (x, y) = ((i % wide) as i64 + left, (i / wide) as i64 + top);
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { continue };
        if x >= maps.width || y >= maps.height {
            continue;
        }
        let index = y * maps.width + x;
        if others[index] && !inside[i] {
            continue;
        }
        // The rim lies half a pixel outside the outermost pixel's centre.
        let depth = if inside[i] { f64::from(depths[i]) - 0.5 } else { 0.5 - f64::from(heights[i]) };
        let (x, y) = (x as f64, y as f64);
        let turn = libm::atan2(y - centre[1], x - centre[0]) / TAU + 0.5;
        let sector = whole(turn * SECTORS as f64).min(SECTORS - 1);
        pixels.push(Pixel { index, x, y, a: f64::from(maps.absorbance[index]), depth, sector });
    }
    pixels
}

fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_usize), |(s, n), v| (s + v, n + 1));
    if count == 0 { f64::NAN } else { sum / count as f64 }
}

fn known(values: impl Iterator<Item = f64>) -> Vec<f64> {
    values.filter(|v| v.is_finite()).collect()
}

fn standard_moment(values: &[f64], mean: f64, sd: f64, n: i32) -> f64 {
    let sd = sd.max(1e-4);
    mean_of(values.iter().map(|v| libm::pow((v - mean) / sd, f64::from(n))))
}

/// How far the outline's radii differ from those of the ellipse of the same moments, as a part of the radius.
fn roughness(region: &Region, shape: &crate::region::Shape) -> f64 {
    let outline = crate::region::smoothed(&region.outline(), 5);
    let long = (shape.area / PI / (1.0 - shape.eccentricity * shape.eccentricity).max(0.01).sqrt()).sqrt();
    let short = shape.area / PI / long;
    let (sin, cos) = (libm::sin(shape.direction), libm::cos(shape.direction));
    let ratio = |p: &[f64; 2]| {
        let (x, y) = (p[0] - shape.centre[0], p[1] - shape.centre[1]);
        let (u, v) = ((x * cos + y * sin) / long, (y * cos - x * sin) / short);
        (u * u + v * v).sqrt()
    };
    deviation(&outline.iter().map(ratio).collect::<Vec<_>>())
}

/// What is left of the core's absorbance without a quadratic surface.
fn detrended(core: &[&Pixel]) -> Vec<f64> {
    let (mx, my) = (mean_of(core.iter().map(|p| p.x)), mean_of(core.iter().map(|p| p.y)));
    let size = core.iter().map(|p| (p.x - mx).abs().max((p.y - my).abs())).fold(1.0, f64::max);
    let place = |p: &Pixel| [(p.x - mx) / size, (p.y - my) / size];
    let points: Vec<([f64; 2], f64)> = core.iter().map(|p| (place(p), p.a)).collect();
    let surface = crate::background::Surface::fit(&points, 0.0);
    core.iter().map(|p| p.a - surface.at(place(p))).collect()
}

/// Values in a rectangle, to be compared with their neighbours.
struct Tile {
    width: usize,
    values: Vec<f64>,
}

impl Tile {
    fn new(core: &[&Pixel], rests: &[f64]) -> Self {
        let low = core.iter().fold([f64::INFINITY; 2], |l, p| [l[0].min(p.x), l[1].min(p.y)]);
        let high = core.iter().fold([0.0_f64; 2], |h, p| [h[0].max(p.x), h[1].max(p.y)]);
        let size = [0, 1].map(|i| whole(high[i] - low[i]) + 1);
        let mut values = vec![f64::NAN; if core.is_empty() { 0 } else { size[0] * size[1] }];
        for (p, rest) in core.iter().zip(rests) {
            values[whole(p.y - low[1]) * size[0] + whole(p.x - low[0])] = *rest;
        }
        Self { width: size[0], values }
    }

    /// Correlation with what lies `across` pixels to the right and `down` below.
    fn correlation(&self, across: usize, down: usize) -> f64 {
        let (mut a, mut b) = (Vec::new(), Vec::new());
        for (i, v) in self.values.iter().enumerate() {
            let other = i + down * self.width + across;
            if i % self.width + across < self.width
                && let Some(w) = self.values.get(other)
                && v.is_finite()
                && w.is_finite()
            {
                a.push(*v);
                b.push(*w);
            }
        }
        if a.len() < 8 { f64::NAN } else { correlation(&a, &b) }
    }
}
