//! Features of a nucleus.

use std::f64::consts::{PI, TAU};

use portable_numerics::statistics::correlation;

use super::maps::Maps;
use super::mean_of;
use crate::moments::{DESCRIPTORS, descriptors};
use crate::number::{nearest, whole};
use crate::region::Region;
use crate::statistics::{deviation, mean, median, of_sorted, sorted};
use crate::table::{FeatureKind, Row};

/// Width of the blurred border that is not part of the core, pixels.
pub(crate) const RIM_PX: f64 = 2.0;

/// Rings from the border to the centre.
const BINS: usize = 5;

/// Sectors around the centre.
const SECTORS: usize = 12;

/// Distances of correlations, pixels.
const LAGS: [usize; 5] = [1, 2, 3, 4, 6];

/// Inner and outer distance of the surroundings from the border, µm.
const BESIDE_UM: [f64; 2] = [0.8, 2.5];

/// Inner and outer distance of the outer surroundings, µm.
const BEYOND_UM: [f64; 2] = [2.5, 5.0];

/// Length of radial profiles on each side of the border, pixels.
const PROFILE_PX: i32 = 4;

/// A pixel in or around a nucleus.
struct Pixel {
    index: usize,
    x: f64,
    y: f64,
    a: f64,
    /// Distance from the border, pixels; positive inside.
    depth: f64,
    sector: usize,
}

/// Returns the features of a nucleus; `ids` is above 0 in all nuclei.
pub(crate) fn features(maps: &Maps, region: &Region, ids: &[u32], pixel_um: f64) -> Row {
    let shape = region.shape();
    let pixels = pixels(maps, region, ids, shape.centre, whole(BEYOND_UM[1] / pixel_um) + 2);
    let deepest = pixels.iter().map(|p| p.depth).fold(0.0, f64::max);
    let rim = RIM_PX.min(0.4 * deepest);
    let core: Vec<&Pixel> = pixels.iter().filter(|p| p.depth > rim).collect();
    let ring =
        |[from, to]: [f64; 2]| pixels.iter().filter(move |p| -p.depth > from / pixel_um && -p.depth <= to / pixel_um);
    let core_a = sorted(core.iter().map(|p| p.a));
    let beside: Vec<f64> = ring(BESIDE_UM).map(|p| p.a).collect();
    let beyond: Vec<f64> = ring(BEYOND_UM).map(|p| p.a).collect();
    let (inner, middle) = (mean(&core_a), of_sorted(&core_a, 0.5));
    let outer = if beside.is_empty() { f64::NAN } else { median(&mut beside.clone()) };
    let contrast = inner - outer;
    let sd = deviation(&core_a);
    let mut row = Row::default();

    let um2 = pixel_um * pixel_um;
    row.put(FeatureKind::Shape, "nucleus area, um2", shape.area * um2);
    row.put(FeatureKind::Shape, "nucleus eccentricity", shape.eccentricity);
    row.put(FeatureKind::Shape, "nucleus solidity", shape.solidity);
    row.put(FeatureKind::Shape, "nucleus circularity", shape.circularity);
    row.put(FeatureKind::Shape, "nucleus outline roughness", roughness(region, &shape));

    row.put(FeatureKind::Absorbance, "core absorbance", inner);
    row.put(FeatureKind::Absorbance, "core above surroundings", contrast);
    row.put(FeatureKind::Surroundings, "absorbance beside", outer);
    row.put(FeatureKind::Surroundings, "absorbance further out less beside", mean(&beyond) - mean(&beside));
    row.put(FeatureKind::Surroundings, "spread beside", deviation(&beside));
    let beside_of = |s: usize| mean_of(ring(BESIDE_UM).filter(|p| p.sector == s).map(|p| p.a));
    row.put(FeatureKind::Surroundings, "unevenness around", deviation(&known((0..SECTORS).map(beside_of))));

    row.put(FeatureKind::Texture, "core sd", sd);
    row.put(FeatureKind::Texture, "core sd over contrast", sd / contrast.max(0.02));
    row.put(FeatureKind::Texture, "core skewness", standard_moment(&core_a, inner, sd, 3));
    row.put(FeatureKind::Texture, "core kurtosis", standard_moment(&core_a, inner, sd, 4));
    row.put(FeatureKind::Texture, "core dark tail", (of_sorted(&core_a, 0.95) - middle) / sd.max(1e-3));
    row.put(FeatureKind::Texture, "core pale tail", (middle - of_sorted(&core_a, 0.05)) / sd.max(1e-3));

    // From border to centre: 0 in the surroundings, 1 in the core.
    for bin in 0..BINS {
        let of = |d: f64| nearest(BINS as f64 * d / deepest - 0.5).min(BINS - 1);
        let a = mean_of(pixels.iter().filter(|p| p.depth > 0.0 && of(p.depth) == bin).map(|p| p.a));
        row.put(
            FeatureKind::Border,
            format!("rim to centre, bin {} of {BINS}", bin + 1),
            (a - outer) / contrast.max(0.02),
        );
    }
    let at_depth = |d: f64| mean_of(pixels.iter().filter(|p| (p.depth - d).abs() < 0.75).map(|p| p.a));
    let profile: Vec<f64> = (-PROFILE_PX..PROFILE_PX).map(|d| at_depth(f64::from(d) + 0.5)).collect();
    let steepest = profile.windows(2).map(|w| w[1] - w[0]).filter(|s| s.is_finite()).fold(1e-3, f64::max);
    // The maximum gradient of a step of height 1 that is blurred by σ is 1/(σ √(2π)).
    row.put(FeatureKind::Border, "rim sigma, px", contrast / (steepest * TAU.sqrt()));
    let inwards = profile.iter().skip(profile.len() / 2).filter(|v| v.is_finite());
    let membrane = inwards.copied().fold(f64::NEG_INFINITY, f64::max);
    row.put(FeatureKind::Border, "darkest depth over core", (membrane - inner) / contrast.max(0.02));
    let rim_slope = |s: usize| {
        mean_of(pixels.iter().filter(|p| p.depth.abs() < 1.5 && p.sector == s).map(|p| f64::from(maps.slope[p.index])))
    };
    let slopes = known((0..SECTORS).map(rim_slope));
    row.put(FeatureKind::Border, "rim slope over contrast", mean(&slopes) / contrast.max(0.02));
    row.put(FeatureKind::Border, "rim unevenness", deviation(&slopes) / mean(&slopes).max(1e-3));

    let rests = detrended(&core);
    let at = |index: usize| core.binary_search_by_key(&index, |p| p.index).ok().map(|i| rests[i]);
    // Correlation with the pixels so many columns to the right and rows below.
    let correlated = |across: usize, down: usize| {
        let inside = core.iter().zip(&rests).filter(|(p, _)| p.index % maps.width + across < maps.width);
        let pairs = inside.filter_map(|(p, rest)| Some((*rest, at(p.index + down * maps.width + across)?)));
        let (a, b): (Vec<f64>, Vec<f64>) = pairs.filter(|(a, b)| a.is_finite() && b.is_finite()).unzip();
        if a.len() < 8 { f64::NAN } else { correlation(&a, &b) }
    };
    for lag in LAGS {
        let both = [correlated(lag, 0), correlated(0, lag)];
        row.put(FeatureKind::Texture, format!("core correlation at {lag} px"), mean(&both));
        if lag <= 2 {
            row.put(FeatureKind::Noise, format!("core correlation down less across at {lag} px"), both[1] - both[0]);
        }
    }
    let rest = deviation(&rests);
    row.put(FeatureKind::Texture, "core sd without trend", rest);
    for (band, name) in [(0, "1"), (1, "2"), (2, "4")] {
        row.put(
            FeatureKind::Texture,
            format!("core power at {name} px"),
            maps.power(core.iter().map(|p| p.index), band),
        );
    }
    let slope_inside = mean_of(core.iter().map(|p| f64::from(maps.slope[p.index])));
    row.put(FeatureKind::Texture, "core slope", slope_inside);
    row.put(FeatureKind::Texture, "core slope over sd", slope_inside / rest.max(1e-3));
    let [spots, holes] = maps.extrema(core.iter().map(|p| p.index));
    row.put(FeatureKind::Texture, "dark spots, um-2", spots / um2);
    row.put(FeatureKind::Texture, "pale spots, um-2", holes / um2);

    let grey = descriptors(core.iter().map(|p| maps.grey[p.index]));
    DESCRIPTORS.into_iter().zip(grey).for_each(|(name, value)| row.put(FeatureKind::Texture, name, value));
    row
}

fn pixels(maps: &Maps, region: &Region, ids: &[u32], centre: [f64; 2], margin: usize) -> Vec<Pixel> {
    let tile = region.tile(margin);
    let (depths, heights) = (tile.depths(), tile.heights());
    let pixel = |i: usize| {
        let index = tile.place(i)?;
        if ids[index] > 0 && !tile.inside[i] {
            return None;
        }
        // The border is half a pixel outside the centre of the outermost pixel.
        let depth = if tile.inside[i] { f64::from(depths[i]) - 0.5 } else { 0.5 - f64::from(heights[i]) };
        let (x, y) = ((index % maps.width) as f64, (index / maps.width) as f64);
        let turn = libm::atan2(y - centre[1], x - centre[0]) / TAU + 0.5;
        let sector = whole(turn * SECTORS as f64).min(SECTORS - 1);
        Some(Pixel { index, x, y, a: f64::from(maps.absorbance[index]), depth, sector })
    };
    (0..tile.inside.len()).filter_map(pixel).collect()
}

fn known(values: impl Iterator<Item = f64>) -> Vec<f64> {
    values.filter(|v| v.is_finite()).collect()
}

fn standard_moment(values: &[f64], mean: f64, sd: f64, n: i32) -> f64 {
    let sd = sd.max(1e-4);
    mean_of(values.iter().map(|v| libm::pow((v - mean) / sd, f64::from(n))))
}

/// Returns the standard deviation of the radii of the outline over those of the ellipse of the same moments.
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

/// Returns the absorbance of the core minus a fitted quadratic surface.
fn detrended(core: &[&Pixel]) -> Vec<f64> {
    let (mx, my) = (mean_of(core.iter().map(|p| p.x)), mean_of(core.iter().map(|p| p.y)));
    let size = core.iter().map(|p| (p.x - mx).abs().max((p.y - my).abs())).fold(1.0, f64::max);
    let place = |p: &Pixel| [(p.x - mx) / size, (p.y - my) / size];
    let points: Vec<([f64; 2], f64)> = core.iter().map(|p| (place(p), p.a)).collect();
    let surface = crate::background::Surface::fit(&points, 0.0);
    core.iter().map(|p| p.a - surface.at(place(p))).collect()
}
