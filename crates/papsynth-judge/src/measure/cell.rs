//! Features of free cells and their cytoplasm.

use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;

use super::maps::{Maps, width_at};
use crate::number::{nearest, whole};
use crate::region::{Region, Shape, components, distance, smoothed};
use crate::statistics::{deviation, mean, of_sorted, sorted};
use crate::table::{FeatureKind, Row};

/// Minimum absorbance of cells, after a Gaussian of 1 pixel.
pub(crate) const COVERED: f32 = 0.03;

/// Range of the areas of cells, µm².
const AREAS_UM2: RangeInclusive<f64> = 150.0..=8000.0;

/// Minimum solidity of a cell; less solid objects are clumps.
const SOLID: f64 = 0.75;

/// Rings from the border to the centre of a free cell.
pub const PROFILE: usize = 10;

/// Margin around the nucleus that is not counted as cytoplasm, pixels.
const NUCLEUS_MARGIN: f32 = 3.0;

/// Length of the chords whose angle defines corners and straight parts, µm.
const CHORD_UM: f64 = 3.0;

/// Minimum angle between two chords at a corner, degrees.
const CORNER_DEG: f64 = 45.0;

/// Maximum angle between two chords of a straight part, degrees.
const STRAIGHT_DEG: f64 = 6.0;

/// Sectors around the centre.
const SECTORS: usize = 8;

/// A free and complete cell with one nucleus.
pub(crate) struct Cell<'a> {
    region: Region,
    pub(crate) shape: Shape,
    nucleus: &'a Region,
    pub(crate) outline: Outline,
    /// Pixels of cytoplasm with their distances to the border, relative to the largest distance.
    cytoplasm: Vec<(usize, f64)>,
    /// Sorted absorbances of the cytoplasm.
    sorted: Vec<f64>,
}

/// Corners and straight parts of an outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Outline {
    /// Number of convex corners.
    pub(crate) corners: f64,
    /// Number of concave corners.
    pub(crate) notches: f64,
    /// Straight fraction of the outline.
    pub(crate) straight: f64,
}

/// Returns the free cells of an image; `ids` holds the number of the nucleus of each pixel, from 1.
pub(crate) fn cells<'a>(maps: &Maps, ids: &[u32], nuclei: &'a [Region], pixel_um: f64) -> Vec<Cell<'a>> {
    let covered: Vec<bool> = maps.smooth.iter().map(|a| *a > COVERED).collect();
    let um2 = pixel_um * pixel_um;
    let free = |region: Region| -> Option<Cell<'a>> {
        let area = region.pixels.len() as f64 * um2;
        if !AREAS_UM2.contains(&area) || region.at_border() {
            return None;
        }
        let mut within = region.pixels.iter().map(|p| ids[*p as usize]).filter(|id| *id > 0);
        let first = within.next()?;
        let alone = within.all(|id| id == first);
        alone.then(|| Cell::new(maps, ids, region.filled(), &nuclei[first as usize - 1], pixel_um))
    };
    let cells = components(&covered, maps.width).into_iter().filter_map(free);
    cells.filter(|cell| cell.shape.solidity >= SOLID && !cell.cytoplasm.is_empty()).collect()
}

impl<'a> Cell<'a> {
    fn new(maps: &Maps, ids: &[u32], region: Region, nucleus: &'a Region, pixel_um: f64) -> Self {
        let (tile, own) = (region.tile(1), ids[nucleus.pixels[0] as usize]);
        let (inside, depths) = (&tile.inside, tile.depths());
        let deepest = depths.iter().fold(1.0_f32, |a, d| a.max(*d));
        let away = tile.distances(|i| tile.place(i).is_none_or(|p| ids[p] != own));
        let place = |i: usize| {
            let place = tile.place(i).filter(|_| inside[i] && away[i] > NUCLEUS_MARGIN)?;
            Some((place, f64::from(depths[i] / deepest)))
        };
        let cytoplasm: Vec<(usize, f64)> = (0..inside.len()).filter_map(place).collect();
        let sorted = sorted(cytoplasm.iter().map(|(p, _)| f64::from(maps.absorbance[*p])));
        let outline = Outline::new(&region.outline(), CHORD_UM / pixel_um);
        Self { shape: region.shape(), region, nucleus, outline, cytoplasm, sorted }
    }

    /// Returns the median absorbance of the cytoplasm.
    pub(crate) fn middle(&self) -> f64 {
        of_sorted(&self.sorted, 0.5)
    }

    /// Returns the absorbance in rings from border to centre over the median of the cell; NaN if the nucleus fills a
    /// ring.
    pub(crate) fn profile(&self, maps: &Maps) -> [f64; PROFILE] {
        let (mut sums, mut counts) = ([0.0; PROFILE], [0.0; PROFILE]);
        for (p, depth) in &self.cytoplasm {
            let bin = nearest(depth * PROFILE as f64 - 0.5).min(PROFILE - 1);
            sums[bin] += f64::from(maps.absorbance[*p]);
            counts[bin] += 1.0;
        }
        let middle = self.middle().max(0.01);
        std::array::from_fn(|i| if counts[i] > 0.0 { sums[i] / counts[i] / middle } else { f64::NAN })
    }

    /// Returns the features of the cell.
    pub(crate) fn features(&self, maps: &Maps, pixel_um: f64) -> Row {
        let mut row = Row::default();
        let um2 = pixel_um * pixel_um;
        let shape = self.shape;
        let radius = (shape.area / PI).sqrt();
        row.put(FeatureKind::Shape, "cell area, um2", shape.area * um2);
        row.put(FeatureKind::Shape, "cell eccentricity", shape.eccentricity);
        row.put(FeatureKind::Shape, "cell solidity", shape.solidity);
        row.put(FeatureKind::Shape, "cell circularity", shape.circularity);
        row.put(FeatureKind::Shape, "corners", self.outline.corners);
        row.put(FeatureKind::Shape, "notches", self.outline.notches);
        row.put(FeatureKind::Shape, "straight part of the outline", self.outline.straight);
        let nucleus = self.nucleus.shape();
        row.put(FeatureKind::Shape, "nucleus over cell area", nucleus.area / shape.area);
        row.put(FeatureKind::Shape, "nucleus off centre, radii", distance(nucleus.centre, shape.centre) / radius);

        let middle = self.middle();
        let unit = middle.max(0.01);
        let at = |q: f64| of_sorted(&self.sorted, q) / unit;
        row.put(FeatureKind::Absorbance, "cytoplasm absorbance", middle);
        row.put(FeatureKind::Absorbance, "cytoplasm sd over median", deviation(&self.sorted) / unit);
        for q in [0.05, 0.25, 0.75, 0.9, 0.99] {
            row.put(FeatureKind::Absorbance, format!("cytoplasm quantile {q} over median"), at(q));
        }
        for (i, a) in self.profile(maps).into_iter().enumerate() {
            row.put(FeatureKind::Absorbance, format!("rim to centre, bin {} of {PROFILE}", i + 1), a);
        }

        let pixels = || self.cytoplasm.iter().map(|c| c.0);
        for (band, name) in ["1", "2", "4", "8", "16"].into_iter().enumerate() {
            let power = maps.power(pixels(), band) / unit;
            row.put(FeatureKind::Texture, format!("cytoplasm power at {name} px over median"), power);
        }
        let inner = || self.cytoplasm.iter().filter(|c| c.1 > 0.2).map(|c| c.0);
        let slopes: Vec<f64> = inner().map(|p| f64::from(maps.slope[p])).collect();
        row.put(FeatureKind::Texture, "cytoplasm slope over median", mean(&slopes) / unit);
        let [dark, pale] = maps.extrema(inner());
        row.put(FeatureKind::Texture, "dark spots in cytoplasm, um-2", dark / um2);
        row.put(FeatureKind::Texture, "pale spots in cytoplasm, um-2", pale / um2);
        let of_sector = |s: usize| {
            let own = pixels().filter(|p| self.sector(*p, maps.width) == s);
            super::mean_of(own.map(|p| f64::from(maps.absorbance[p]))) / unit
        };
        let sectors: Vec<f64> = (0..SECTORS).map(of_sector).filter(|v| v.is_finite()).collect();
        row.put(FeatureKind::Texture, "unevenness between sectors", deviation(&sectors));
        row.put(FeatureKind::Texture, "darkest sector over median", sectors.iter().copied().fold(f64::NAN, f64::max));

        let near = self.border();
        let rim = sorted(maps.edges.iter().filter(|e| near.binary_search(&e.pixel).is_ok()).map(|e| e.sigma));
        for q in [0.25, 0.5] {
            let name = format!("sigma of the cell's rim, px, quantile {q}");
            row.put(FeatureKind::Edges, name, width_at(&rim, q));
        }
        row.put(FeatureKind::Edges, "steep part of the rim", rim.len() as f64 / (TAU * radius));
        row
    }

    fn sector(&self, pixel: usize, width: usize) -> usize {
        let (x, y) = ((pixel % width) as f64 - self.shape.centre[0], (pixel / width) as f64 - self.shape.centre[1]);
        whole((libm::atan2(y, x) / TAU + 0.5) * SECTORS as f64).min(SECTORS - 1)
    }

    /// Returns the sorted pixels at most 3 pixels from the border of the cell.
    fn border(&self) -> Vec<usize> {
        const NEAR: f32 = 3.0;
        let tile = self.region.tile(whole(f64::from(NEAR)) + 1);
        let (inner, outer) = (tile.depths(), tile.heights());
        let near = (0..inner.len()).filter(|&i| inner[i] <= NEAR && outer[i] <= NEAR);
        near.filter_map(|i| tile.place(i)).collect()
    }
}

impl Outline {
    /// Measures a closed line along pixel corners; `chord` in pixels.
    pub(crate) fn new(line: &[[f64; 2]], chord: f64) -> Self {
        let line = smoothed(line, nearest(chord / 2.0).max(3));
        let n = line.len();
        let step = nearest(chord).max(2);
        if n < 4 * step {
            return Self { corners: f64::NAN, notches: f64::NAN, straight: f64::NAN };
        }
        let turn = |i: usize| {
            let (a, b, c) = (line[(i + n - step) % n], line[i], line[(i + step) % n]);
            let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]);
            // The line runs anticlockwise on the screen and y points downwards, so convex turns are negative.
            -libm::atan2(u[0] * v[1] - u[1] * v[0], u[0] * v[0] + u[1] * v[1]).to_degrees()
        };
        let turns: Vec<f64> = (0..n).map(turn).collect();
        let count = |sign: f64| {
            let is_corner = |i: &usize| {
                let own = sign * turns[*i];
                let others = (1..=step).flat_map(|k| [(*i + k) % n, (*i + n - k) % n]);
                own > CORNER_DEG
                    && others
                        .enumerate()
                        .all(|(k, j)| if k % 2 == 0 { own >= sign * turns[j] } else { own > sign * turns[j] })
            };
            (0..n).filter(is_corner).count() as f64
        };
        let straight = turns.iter().filter(|t| t.abs() < STRAIGHT_DEG).count() as f64 / n as f64;
        Self { corners: count(1.0), notches: count(-1.0), straight }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::ids;
    use crate::region::Region;

    const PIXEL_UM: f64 = 0.33;

    /// Returns the maps of an image of this absorbance.
    fn maps(a: impl Fn(f64, f64) -> f64) -> Maps {
        Maps::drawn(260, 220, |x, y| 240.0 * libm::pow(10.0, -a(x, y)))
    }

    fn disc(maps: &Maps, x: f64, y: f64, radius: f64) -> Region {
        let inside: Vec<bool> = (0..maps.absorbance.len())
            .map(|i| distance([(i % maps.width) as f64, (i / maps.width) as f64], [x, y]) < radius)
            .collect();
        components(&inside, maps.width).remove(0)
    }

    #[test]
    fn profile_size_and_nucleus_of_a_free_cell_are_measured() {
        // Thin at the border, and twice as dark in the centre.
        let depth = |x: f64, y: f64| 1.0 - distance([x, y], [120.0, 110.0]) / 70.0;
        let maps = maps(|x, y| {
            if depth(x, y) > 0.0 {
                0.1 + 0.1 * depth(x, y) + if distance([x, y], [127.0, 110.0]) < 10.0 { 0.4 } else { 0.0 }
            } else {
                0.0
            }
        });
        let nuclei = [disc(&maps, 127.0, 110.0, 10.0)];
        let cells = cells(&maps, &ids(&maps, &nuclei), &nuclei, PIXEL_UM);
        assert_eq!(cells.len(), 1);
        let cell = &cells[0];
        assert!((cell.shape.area - PI * 4900.0).abs() < 400.0, "{:?}", cell.shape);
        let profile = cell.profile(&maps);
        for (i, value) in profile.iter().enumerate().take(8) {
            let wanted = (0.1 + 0.1 * (i as f64 + 0.5) / 10.0) / cell.middle();
            // Grey levels are rounded, and the outermost ring includes empty slide.
            assert!((value - wanted).abs() < if i == 0 { 0.12 } else { 0.04 }, "{i}: {value}, not {wanted}");
        }
        let table: crate::table::FeatureTable =
            std::iter::once((cell.features(&maps, PIXEL_UM), cell.shape.centre)).collect();
        let value = |name: &str| table.column(name).next().unwrap();
        assert!((value("nucleus off centre, radii") - 0.1).abs() < 0.02);
        assert!((value("nucleus over cell area") - 1.0 / 49.0).abs() < 0.002);
        assert_eq!((value("corners"), value("notches")), (0.0, 0.0));
    }

    #[test]
    fn cells_with_two_nuclei_without_nucleus_or_at_the_border_are_ignored() {
        let body = |x: f64, y: f64| {
            if distance([x, y], [120.0, 110.0]) < 60.0 || distance([x, y], [0.0, 0.0]) < 50.0 { 0.2 } else { 0.0 }
        };
        let maps = maps(body);
        let count = |nuclei: &[Region]| cells(&maps, &ids(&maps, nuclei), nuclei, PIXEL_UM).len();
        let own = disc(&maps, 120.0, 110.0, 9.0);
        assert_eq!(count(&[]), 0);
        assert_eq!(count(std::slice::from_ref(&own)), 1);
        assert_eq!(count(&[own, disc(&maps, 150.0, 110.0, 9.0)]), 0);
        assert_eq!(count(&[disc(&maps, 15.0, 15.0, 9.0)]), 0);
    }

    #[test]
    fn corners_notches_and_straight_parts_are_counted() {
        let outline = |inside: &dyn Fn(f64, f64) -> bool| {
            let all: Vec<bool> = (0..200 * 200).map(|i| inside(f64::from(i % 200), f64::from(i / 200))).collect();
            Outline::new(&components(&all, 200)[0].outline(), CHORD_UM / PIXEL_UM)
        };
        let within = |v: f64, low: f64, high: f64| v >= low && v < high;
        let square = outline(&|x, y| within(x, 40.0, 160.0) && within(y, 40.0, 160.0));
        assert_eq!((square.corners, square.notches), (4.0, 0.0));
        assert!(square.straight > 0.6, "{square:?}");
        let cross = outline(&|x, y| {
            (within(x, 20.0, 180.0) && within(y, 70.0, 130.0)) || (within(y, 20.0, 180.0) && within(x, 70.0, 130.0))
        });
        assert_eq!((cross.corners, cross.notches), (8.0, 4.0));
        let disc = outline(&|x, y| distance([x, y], [100.0, 100.0]) < 40.0);
        assert_eq!((disc.corners, disc.notches), (0.0, 0.0));
        assert!(disc.straight < 0.35, "{disc:?}");
    }
}
