//! Connected regions and their shapes.

use crate::number::id;

/// Pixels of one object.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Region {
    /// Indices into the image.
    pub(crate) pixels: Vec<u32>,
    /// Width of the image.
    pub(crate) width: usize,
    /// Height of the image.
    pub(crate) height: usize,
}

/// Position, size and shape of a region, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shape {
    pub(crate) area: f64,
    pub(crate) centre: [f64; 2],
    /// √(1 − b²/a²) of the ellipse of the same second moments.
    pub(crate) eccentricity: f64,
    /// Direction of the long axis, radians.
    pub(crate) direction: f64,
    /// Area over that of the convex hull.
    pub(crate) solidity: f64,
    /// 4π area / perimeter².
    pub(crate) circularity: f64,
}

/// Sums over pixels of 1, x, y, x², xy and y².
#[derive(Clone, Copy, Default)]
pub(crate) struct Sums([f64; 6]);

impl Sums {
    pub(crate) fn add(&mut self, x: usize, y: usize) {
        let (x, y) = (x as f64, y as f64);
        self.join(&Self([1.0, x, y, x * x, x * y, y * y]));
    }

    pub(crate) fn join(&mut self, other: &Self) {
        self.0.iter_mut().zip(other.0).for_each(|(sum, v)| *sum += v);
    }

    pub(crate) fn area(&self) -> f64 {
        self.0[0]
    }

    pub(crate) fn centre(&self) -> [f64; 2] {
        let [n, x, y, ..] = self.0;
        [x / n, y / n]
    }

    /// Returns the second central moments xx, xy and yy of square pixels.
    pub(crate) fn second(&self) -> [f64; 3] {
        let ([n, _, _, xx, xy, yy], [x, y]) = (self.0, self.centre());
        [xx / n - x * x + 1.0 / 12.0, xy / n - x * y, yy / n - y * y + 1.0 / 12.0]
    }
}

/// The bounding box of a region, with a margin.
pub(crate) struct Tile<'a> {
    region: &'a Region,
    /// Whether a pixel of the box is in the region.
    pub(crate) inside: Vec<bool>,
    wide: usize,
    /// Position of the upper left pixel, which may be outside the image.
    corner: [i64; 2],
}

impl Tile<'_> {
    /// Returns the index in the image of a pixel of the box; none outside the image.
    pub(crate) fn place(&self, i: usize) -> Option<usize> {
        let x = usize::try_from((i % self.wide) as i64 + self.corner[0]).ok()?;
        let y = usize::try_from((i / self.wide) as i64 + self.corner[1]).ok()?;
        (x < self.region.width && y < self.region.height).then(|| y * self.region.width + x)
    }

    /// Returns the distance of each inner pixel to the nearest outer one; 0 outside.
    pub(crate) fn depths(&self) -> Vec<f32> {
        distance_inside(&self.inside, self.wide)
    }

    /// Returns the distance of each outer pixel to the nearest inner one; 0 inside.
    pub(crate) fn heights(&self) -> Vec<f32> {
        self.distances(|i| !self.inside[i])
    }

    /// Returns the distance of each pixel for which `counts` is true to the nearest one for which it is false.
    pub(crate) fn distances(&self, counts: impl Fn(usize) -> bool) -> Vec<f32> {
        distance_inside(&(0..self.inside.len()).map(counts).collect::<Vec<_>>(), self.wide)
    }
}

impl Region {
    /// Returns whether the region touches the border of the image.
    pub(crate) fn at_border(&self) -> bool {
        self.pixels.iter().any(|&p| {
            let (x, y) = self.place(p);
            x == 0 || y == 0 || x + 1 == self.width || y + 1 == self.height
        })
    }

    fn place(&self, pixel: u32) -> (usize, usize) {
        (pixel as usize % self.width, pixel as usize / self.width)
    }

    /// Returns the bounding box with a margin.
    pub(crate) fn tile(&self, margin: usize) -> Tile<'_> {
        // Left and top inclusive, right and bottom exclusive.
        let around = [usize::MAX, usize::MAX, 0, 0];
        let [left, top, right, bottom] = self.pixels.iter().fold(around, |[l, t, r, b], &p| {
            let (x, y) = self.place(p);
            [l.min(x), t.min(y), r.max(x + 1), b.max(y + 1)]
        });
        let (wide, high) = (right - left + 2 * margin, bottom - top + 2 * margin);
        let mut inside = vec![false; wide * high];
        for &p in &self.pixels {
            let (x, y) = self.place(p);
            inside[(y - top + margin) * wide + x - left + margin] = true;
        }
        Tile { region: self, inside, wide, corner: [left, top].map(|v| v as i64 - margin as i64) }
    }

    /// Returns the region without holes.
    pub(crate) fn filled(&self) -> Self {
        let tile = self.tile(1);
        let inside = &tile.inside;
        let mut outside = vec![false; inside.len()];
        flood(0, tile.wide, &mut outside, |p| !inside[p]);
        if outside.iter().zip(inside).all(|(o, i)| *o != *i) {
            return self.clone();
        }
        let pixels = (0..inside.len()).filter(|&i| !outside[i]).filter_map(|i| tile.place(i).map(id)).collect();
        Self { pixels, ..*self }
    }

    pub(crate) fn shape(&self) -> Shape {
        let mut sums = Sums::default();
        for &p in &self.pixels {
            let (x, y) = self.place(p);
            sums.add(x, y);
        }
        let (area, [xx, xy, yy]) = (sums.area(), sums.second());
        let half = 0.5 * (xx + yy);
        let root = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
        let (long, short) = (half + root, (half - root).max(0.0));
        let outline = self.outline();
        let perimeter = perimeter(&outline);
        Shape {
            area,
            centre: sums.centre(),
            eccentricity: (1.0 - short / long).max(0.0).sqrt(),
            direction: 0.5 * libm::atan2(2.0 * xy, xx - yy),
            solidity: (area / hull_area(&outline).max(area)).min(1.0),
            circularity: (4.0 * std::f64::consts::PI * area / (perimeter * perimeter).max(1.0)).min(1.0),
        }
    }

    /// Returns the pixel corners along the outer border, anticlockwise on the screen.
    pub(crate) fn outline(&self) -> Vec<[f64; 2]> {
        let Tile { inside, wide, corner: [left, top], .. } = self.tile(1);
        // The leftmost pixel of the topmost row: the pixel above is outside.
        let start = inside.iter().position(|i| *i).unwrap_or(0);
        let at = |x: i64, y: i64| -> bool {
            usize::try_from(y * wide as i64 + x).ok().and_then(|i| inside.get(i)).is_some_and(|i| *i)
        };
        let first = [(start % wide) as i64, (start / wide) as i64];
        // The path keeps the region to the left, and starts downwards.
        let mut corner = first;
        let mut step: [i64; 2] = [0, 1];
        let mut points = Vec::new();
        loop {
            points.push([(corner[0] + left) as f64 - 0.5, (corner[1] + top) as f64 - 0.5]);
            corner = [corner[0] + step[0], corner[1] + step[1]];
            // The two pixels ahead, to the left and to the right of the path.
            let (dx, dy) = (step[0], step[1]);
            let ahead_left = at(corner[0] + (dx + dy - 1) / 2, corner[1] + (dy - dx - 1) / 2);
            let ahead_right = at(corner[0] + (dx - dy - 1) / 2, corner[1] + (dy + dx - 1) / 2);
            if !ahead_left {
                step = [dy, -dx];
            } else if ahead_right {
                step = [-dy, dx];
            }
            if (corner == first && step == [0, 1]) || points.len() > 4 * inside.len() {
                return points;
            }
        }
    }
}

/// Number of corners over which an outline is smoothed before its length is measured, because pixel steps are too long.
const STEPS: usize = 5;

/// Returns the length of a smoothed closed outline.
fn perimeter(outline: &[[f64; 2]]) -> f64 {
    let smooth = smoothed(outline, STEPS);
    let next = smooth.iter().cycle().skip(1);
    smooth.iter().zip(next).map(|(a, b)| distance(*a, *b)).sum()
}

/// Returns the running mean of a closed line over `count` points.
pub(crate) fn smoothed(line: &[[f64; 2]], count: usize) -> Vec<[f64; 2]> {
    let n = line.len();
    if n <= count {
        return line.to_vec();
    }
    let mean = |i: usize| {
        let sum = (0..count).map(|k| line[(i + k) % n]).fold([0.0; 2], |s, p| [s[0] + p[0], s[1] + p[1]]);
        sum.map(|v| v / count as f64)
    };
    (0..n).map(mean).collect()
}

pub(crate) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    (dx * dx + dy * dy).sqrt()
}

/// Returns the area of the convex hull of points, by Andrew's monotone chain.
fn hull_area(points: &[[f64; 2]]) -> f64 {
    let mut points = points.to_vec();
    points.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let cross = |o: [f64; 2], a: [f64; 2], b: [f64; 2]| (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    let chain = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut hull: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while hull.len() >= 2 && cross(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0 {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut points.iter().copied());
    hull.extend(chain(&mut points.iter().rev().copied()));
    let next = hull.iter().cycle().skip(1);
    0.5 * hull.iter().zip(next).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>().abs()
}

/// Returns the 4-connected regions of equal values, except the default value, in the order of their first pixels.
pub(crate) fn components<T: PartialEq + Default>(values: &[T], width: usize) -> Vec<Region> {
    let mut seen = vec![false; values.len()];
    let mut regions = Vec::new();
    for (start, value) in values.iter().enumerate() {
        if *value != T::default() && !seen[start] {
            regions.push(flood(start, width, &mut seen, |p| values[p] == *value));
        }
    }
    regions
}

/// Returns the pixels left, right, above and below a pixel.
pub(crate) fn neighbours(p: usize, width: usize, length: usize) -> impl Iterator<Item = usize> {
    let x = p % width;
    let around = [
        (x > 0).then(|| p - 1),
        (x + 1 < width).then(|| p + 1),
        p.checked_sub(width),
        Some(p + width).filter(|q| *q < length),
    ];
    around.into_iter().flatten()
}

/// Returns the 4-connected region of a pixel in which `inside` is true.
pub(crate) fn flood(start: usize, width: usize, seen: &mut [bool], inside: impl Fn(usize) -> bool) -> Region {
    let mut pixels = vec![id(start)];
    seen[start] = true;
    let mut next = 0;
    while let Some(&pixel) = pixels.get(next) {
        next += 1;
        for q in neighbours(pixel as usize, width, seen.len()) {
            if !seen[q] && inside(q) {
                seen[q] = true;
                pixels.push(id(q));
            }
        }
    }
    Region { pixels, width, height: seen.len() / width }
}

/// Returns the exact distance of each pixel to the nearest one outside, 0 outside. Pixels beyond the image count as
/// inside (Felzenszwalb and Huttenlocher, doi:10.4086/toc.2012.v008a019).
fn distance_inside(inside: &[bool], width: usize) -> Vec<f32> {
    let height = inside.len() / width.max(1);
    let far = ((width + height) * (width + height)) as f64;
    let mut squares: Vec<f64> = inside.iter().map(|i| if *i { far } else { 0.0 }).collect();
    let mut line = vec![0.0; width.max(height)];
    let mut hull = Vec::new();
    for x in 0..width {
        for y in 0..height {
            line[y] = squares[y * width + x];
        }
        transform(&line[..height], &mut hull, |y, v| squares[y * width + x] = v);
    }
    for row in squares.chunks_exact_mut(width) {
        line[..width].copy_from_slice(row);
        transform(&line[..width], &mut hull, |x, v| row[x] = v);
    }
    squares.iter().map(|s| crate::number::single(s.sqrt())).collect()
}

/// Computes squared distances along a line from the lower envelope of parabolas. `hull` holds the vertex of each
/// parabola and the start of its interval.
fn transform(values: &[f64], hull: &mut Vec<(usize, f64)>, mut put: impl FnMut(usize, f64)) {
    hull.clear();
    for (q, value) in values.iter().enumerate() {
        let from = loop {
            let Some(&(p, from)) = hull.last() else { break f64::NEG_INFINITY };
            let (a, b) = (p as f64, q as f64);
            let meet = ((value + b * b) - (values[p] + a * a)) / (2.0 * (b - a));
            if meet > from {
                break meet;
            }
            hull.pop();
        };
        hull.push((q, from));
    }
    let mut k = 0;
    for q in 0..values.len() {
        while k + 1 < hull.len() && hull[k + 1].1 < q as f64 {
            k += 1;
        }
        let d = q as f64 - hull[k].0 as f64;
        put(q, d * d + values[hull[k].0]);
    }
}

#[cfg(test)]
mod tests {
    use rand_core::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    fn region(width: usize, height: usize, inside: impl Fn(f64, f64) -> bool) -> Region {
        let inside: Vec<bool> = (0..width * height).map(|i| inside((i % width) as f64, (i / width) as f64)).collect();
        let mut regions = components(&inside, width);
        assert_eq!(regions.len(), 1);
        regions.remove(0)
    }

    #[test]
    fn area_centre_and_shape_of_ellipses_are_exact() {
        let (sin, cos) = (libm::sin(0.5), libm::cos(0.5));
        for (a, b) in [(30.0, 30.0), (40.0, 20.0)] {
            let inside = |x: f64, y: f64| {
                let (u, v) = ((x - 60.3) * cos + (y - 49.9) * sin, (y - 49.9) * cos - (x - 60.3) * sin);
                u * u / (a * a) + v * v / (b * b) < 1.0
            };
            let shape = region(120, 100, inside).shape();
            assert!((shape.area - a * b * std::f64::consts::PI).abs() < 15.0, "{shape:?}");
            assert!(distance(shape.centre, [60.3, 49.9]) < 0.07, "{shape:?}");
            if a > b {
                assert!((shape.eccentricity - 0.75_f64.sqrt()).abs() < 0.005, "{shape:?}");
                assert!((shape.direction - 0.5).abs() < 0.01, "{shape:?}");
            } else {
                assert!(shape.eccentricity < 0.1 && shape.solidity > 0.975 && shape.circularity > 0.96, "{shape:?}");
            }
        }
    }

    #[test]
    fn circularity_of_a_square_and_solidity_of_a_cross_are_exact() {
        let square = region(60, 60, |x, y| (10.0..40.0).contains(&x) && (10.0..40.0).contains(&y));
        assert!((square.shape().circularity - std::f64::consts::FRAC_PI_4).abs() < 0.06, "{:?}", square.shape());
        assert_eq!(square.outline().len(), 120);
        assert!((square.shape().solidity - 1.0).abs() < 1e-12);
        let cross = region(60, 60, |x, y| {
            (20.0..40.0).contains(&x) != (20.0..40.0).contains(&y) || (x - 30.0).abs().max((y - 30.0).abs()) < 10.5
        });
        let area = cross.shape().area;
        assert!((cross.shape().solidity - area / (3600.0 - 4.0 * 200.0)).abs() < 0.02, "{:?}", cross.shape());
    }

    #[test]
    fn holes_are_filled_and_one_pixel_is_a_region() {
        let ring = region(40, 40, |x, y| (100.0..256.0).contains(&((x - 20.0) * (x - 20.0) + (y - 20.0) * (y - 20.0))));
        let disc = region(40, 40, |x, y| (x - 20.0) * (x - 20.0) + (y - 20.0) * (y - 20.0) < 256.0);
        let sorted = |region: &Region| {
            let mut pixels = region.pixels.clone();
            pixels.sort_unstable();
            pixels
        };
        assert_eq!(sorted(&ring.filled()), sorted(&disc));
        assert_eq!(sorted(&disc.filled()), sorted(&disc));
        let one = region(3, 3, |x, y| x == 1.0 && y == 1.0);
        assert_eq!((one.shape().area, one.outline().len()), (1.0, 4));
    }

    #[test]
    fn distances_equal_a_search_over_all_pixels() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        let (width, height) = (23, 17);
        let inside: Vec<bool> = (0..width * height).map(|_| rng.next_u64() % 9 != 0).collect();
        let distances = distance_inside(&inside, width);
        for (i, d) in distances.iter().enumerate() {
            let at = |i: usize| [(i % width) as f64, (i / width) as f64];
            let slow =
                (0..inside.len()).filter(|j| !inside[*j]).map(|j| distance(at(i), at(j))).fold(f64::INFINITY, f64::min);
            assert!((f64::from(*d) - slow).abs() < 1e-5, "{i}: {d}, not {slow}");
        }
    }
}
