//! Connected regions and their shape.

use crate::number::id;

/// Pixels of one object, in the order in which they were found.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Region {
    /// Indices into the image.
    pub(crate) pixels: Vec<u32>,
    /// Columns of the image.
    pub(crate) width: usize,
}

/// Position, size and shape of a region, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Shape {
    pub(crate) area: f64,
    pub(crate) centre: [f64; 2],
    /// √(1 − b²/a²) of the ellipse of the same second moments.
    pub(crate) eccentricity: f64,
    /// Direction of its long axis, radians.
    pub(crate) direction: f64,
    /// Area over that of the convex hull.
    pub(crate) solidity: f64,
    /// 4π area / perimeter².
    pub(crate) circularity: f64,
}

impl Region {
    /// Whether it touches the image's border.
    pub(crate) fn at_border(&self, height: usize) -> bool {
        self.pixels.iter().any(|&p| {
            let (x, y) = self.place(p);
            x == 0 || y == 0 || x + 1 == self.width || y + 1 == height
        })
    }

    pub(crate) fn place(&self, pixel: u32) -> (usize, usize) {
        (pixel as usize % self.width, pixel as usize / self.width)
    }

    /// Left, top, right and bottom, the last two beyond it.
    pub(crate) fn bounds(&self) -> [usize; 4] {
        self.pixels.iter().fold([usize::MAX, usize::MAX, 0, 0], |[l, t, r, b], &p| {
            let (x, y) = self.place(p);
            [l.min(x), t.min(y), r.max(x + 1), b.max(y + 1)]
        })
    }

    /// Its pixels in a box of their own with `margin` pixels around them: whether inside, the width of the box, and the place of
    /// its upper left pixel, which may be outside the image.
    pub(crate) fn tile(&self, margin: usize) -> (Vec<bool>, usize, [i64; 2]) {
        let [left, top, right, bottom] = self.bounds();
        if self.pixels.is_empty() {
            return (Vec::new(), 0, [0, 0]);
        }
        let (wide, high) = (right - left + 2 * margin, bottom - top + 2 * margin);
        let mut inside = vec![false; wide * high];
        for &p in &self.pixels {
            let (x, y) = self.place(p);
            inside[(y - top + margin) * wide + x - left + margin] = true;
        }
        (inside, wide, [left as i64 - margin as i64, top as i64 - margin as i64])
    }

    /// The same without holes.
    pub(crate) fn filled(&self, height: usize) -> Self {
        let (inside, wide, [left, top]) = self.tile(1);
        if wide == 0 {
            return self.clone();
        }
        let mut outside = vec![false; inside.len()];
        flood(0, wide, inside.len(), &mut outside, |p| !inside[p]);
        if outside.iter().zip(&inside).all(|(o, i)| *o != *i) {
            return self.clone();
        }
        let place = |i: usize| {
            let (x, y) = (usize::try_from((i % wide) as i64 + left).ok()?, usize::try_from((i / wide) as i64 + top).ok()?);
            (x < self.width && y < height).then(|| id(y * self.width + x))
        };
        Self { pixels: (0..inside.len()).filter(|&i| !outside[i]).filter_map(place).collect(), width: self.width }
    }

    pub(crate) fn shape(&self) -> Shape {
        let area = self.pixels.len() as f64;
        if area == 0.0 {
            return Shape::default();
        }
        let [mut sx, mut sy, mut sxx, mut sxy, mut syy] = [0.0; 5];
        for &p in &self.pixels {
            let (x, y) = self.place(p);
            let (x, y) = (x as f64, y as f64);
            sx += x;
            sy += y;
            sxx += x * x;
            sxy += x * y;
            syy += y * y;
        }
        let centre = [sx / area, sy / area];
        // A pixel is a square, not a point.
        let (xx, yy) = (sxx / area - centre[0] * centre[0] + 1.0 / 12.0, syy / area - centre[1] * centre[1] + 1.0 / 12.0);
        let xy = sxy / area - centre[0] * centre[1];
        let half = 0.5 * (xx + yy);
        let root = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
        let (long, short) = (half + root, (half - root).max(0.0));
        let outline = self.outline();
        let perimeter = perimeter(&outline);
        let hull = hull_area(&outline);
        Shape {
            area,
            centre,
            eccentricity: (1.0 - short / long).max(0.0).sqrt(),
            direction: 0.5 * libm::atan2(2.0 * xy, xx - yy),
            solidity: (area / hull.max(area)).min(1.0),
            circularity: (4.0 * std::f64::consts::PI * area / (perimeter * perimeter).max(1.0)).min(1.0),
        }
    }

    /// The corners of its outer border between pixels, anticlockwise on the screen, of its part with the first pixel.
    pub(crate) fn outline(&self) -> Vec<[f64; 2]> {
        let (inside, wide, [left, top]) = self.tile(1);
        if wide == 0 {
            return Vec::new();
        }
        // The topmost pixel's leftmost: above it there is nothing.
        let Some(start) = inside.iter().position(|i| *i) else { return Vec::new() };
        let at = |x: i64, y: i64| -> bool {
            usize::try_from(y * wide as i64 + x).ok().and_then(|i| inside.get(i)).is_some_and(|i| *i)
        };
        let first = [(start % wide) as i64, (start / wide) as i64];
        // Corners of pixels are walked along with the inside to the left hand: down first.
        let mut corner = first;
        let mut step: [i64; 2] = [0, 1];
        let mut points = Vec::new();
        loop {
            points.push([(corner[0] + left) as f64 - 0.5, (corner[1] + top) as f64 - 0.5]);
            corner = [corner[0] + step[0], corner[1] + step[1]];
            // The two pixels ahead, to the left and to the right of the way.
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

/// The outline smoothed over this many of its corners before it is measured: steps of pixels are no perimeter.
const STEPS: usize = 5;

/// Length of a closed line of pixels' corners, without its steps.
pub(crate) fn perimeter(outline: &[[f64; 2]]) -> f64 {
    let smooth = smoothed(outline, STEPS);
    let next = smooth.iter().cycle().skip(1);
    smooth.iter().zip(next).map(|(a, b)| distance(*a, *b)).sum()
}

/// The running mean of a closed line over `count` of its points.
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

/// Area of the convex hull of points, by Andrew's monotone chain.
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

/// The connected regions where `inside` holds, by edges, in the order of their first pixels.
pub(crate) fn components(inside: &[bool], width: usize) -> Vec<Region> {
    let mut seen = vec![false; inside.len()];
    let mut regions = Vec::new();
    for start in 0..inside.len() {
        if inside[start] && !seen[start] {
            regions.push(flood(start, width, inside.len(), &mut seen, |p| inside[p]));
        }
    }
    regions
}

/// What is connected with a pixel through its edges, of those where `inside` holds.
pub(crate) fn flood(start: usize, width: usize, length: usize, seen: &mut [bool], inside: impl Fn(usize) -> bool) -> Region {
    let mut pixels = vec![id(start)];
    seen[start] = true;
    let mut next = 0;
    while let Some(&pixel) = pixels.get(next) {
        next += 1;
        let p = pixel as usize;
        let x = p % width;
        let around = [(x > 0).then(|| p - 1), (x + 1 < width).then(|| p + 1), p.checked_sub(width), Some(p + width).filter(|q| *q < length)];
        for q in around.into_iter().flatten() {
            if !seen[q] && inside(q) {
                seen[q] = true;
                pixels.push(id(q));
            }
        }
    }
    Region { pixels, width }
}

/// Distance of every pixel to the nearest one where `inside` does not hold, pixels, 0 there; what is beyond the image counts as
/// inside. Exact (Felzenszwalb and Huttenlocher, doi:10.4086/toc.2012.v008a019).
pub(crate) fn distance_inside(inside: &[bool], width: usize) -> Vec<f32> {
    let height = inside.len() / width.max(1);
    let far = ((width + height) * (width + height)) as f64;
    let mut squares: Vec<f64> = inside.iter().map(|i| if *i { far } else { 0.0 }).collect();
    let mut line = vec![0.0; width.max(height)];
    let mut hull = Envelope::default();
    for x in 0..width {
        for y in 0..height {
            line[y] = squares[y * width + x];
        }
        hull.transform(&line[..height], |y, v| squares[y * width + x] = v);
    }
    for row in squares.chunks_exact_mut(width) {
        line[..width].copy_from_slice(row);
        hull.transform(&line[..width], |x, v| row[x] = v);
    }
    squares.iter().map(|s| crate::number::single(s.sqrt())).collect()
}

/// The lower envelope of parabolas.
#[derive(Default)]
struct Envelope {
    places: Vec<usize>,
    from: Vec<f64>,
}

impl Envelope {
    fn transform(&mut self, values: &[f64], mut put: impl FnMut(usize, f64)) {
        self.places.clear();
        self.from.clear();
        for (q, value) in values.iter().enumerate() {
            loop {
                let Some(&p) = self.places.last() else {
                    self.from.push(f64::NEG_INFINITY);
                    break;
                };
                let (a, b) = (p as f64, q as f64);
                let meet = ((value + b * b) - (values[p] + a * a)) / (2.0 * (b - a));
                if meet > *self.from.last().unwrap_or(&f64::NEG_INFINITY) {
                    self.from.push(meet);
                    break;
                }
                self.places.pop();
                self.from.pop();
            }
            self.places.push(q);
        }
        let mut k = 0;
        for q in 0..values.len() {
            while k + 1 < self.places.len() && self.from[k + 1] < q as f64 {
                k += 1;
            }
            let d = q as f64 - self.places[k] as f64;
            put(q, d * d + values[self.places[k]]);
        }
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
    fn a_disc_has_the_area_and_shape_of_one() {
        let shape = region(90, 80, |x, y| (x - 40.3) * (x - 40.3) + (y - 38.9) * (y - 38.9) < 900.0).shape();
        assert!((shape.area - 900.0 * std::f64::consts::PI).abs() < 15.0, "{shape:?}");
        assert!((shape.centre[0] - 40.3).abs() < 0.05 && (shape.centre[1] - 38.9).abs() < 0.05, "{shape:?}");
        assert!(shape.eccentricity < 0.1 && shape.solidity > 0.975 && shape.circularity > 0.96, "{shape:?}");
    }

    #[test]
    fn an_ellipse_has_its_eccentricity_and_direction() {
        let (sin, cos) = (libm::sin(0.5), libm::cos(0.5));
        let inside = |x: f64, y: f64| {
            let (u, v) = ((x - 60.0) * cos + (y - 50.0) * sin, (y - 50.0) * cos - (x - 60.0) * sin);
            u * u / 1600.0 + v * v / 400.0 < 1.0
        };
        let shape = region(120, 100, inside).shape();
        assert!((shape.eccentricity - 0.75_f64.sqrt()).abs() < 0.005 && (shape.direction - 0.5).abs() < 0.01, "{shape:?}");
    }

    #[test]
    fn a_square_is_less_round_and_a_cross_less_solid() {
        let square = region(60, 60, |x, y| (10.0..40.0).contains(&x) && (10.0..40.0).contains(&y));
        assert!((square.shape().circularity - std::f64::consts::FRAC_PI_4).abs() < 0.06, "{:?}", square.shape());
        assert_eq!(square.outline().len(), 120);
        assert!((square.shape().solidity - 1.0).abs() < 1e-12);
        let cross = region(60, 60, |x, y| (20.0..40.0).contains(&x) != (20.0..40.0).contains(&y) || (x - 30.0).abs().max((y - 30.0).abs()) < 10.5);
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
        assert_eq!(sorted(&ring.filled(40)), sorted(&disc));
        assert_eq!(sorted(&disc.filled(40)), sorted(&disc));
        let one = region(3, 3, |x, y| x == 1.0 && y == 1.0);
        assert_eq!((one.shape().area, one.outline().len()), (1.0, 4));
        assert_eq!(Region::default().shape(), Shape::default());
    }

    #[test]
    fn distances_are_those_to_the_nearest_pixel_outside() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        let (width, height) = (23, 17);
        let inside: Vec<bool> = (0..width * height).map(|_| rng.next_u64() % 9 != 0).collect();
        let distances = distance_inside(&inside, width);
        for (i, d) in distances.iter().enumerate() {
            let at = |i: usize| [(i % width) as f64, (i / width) as f64];
            let slow = (0..inside.len()).filter(|j| !inside[*j]).map(|j| distance(at(i), at(j))).fold(f64::INFINITY, f64::min);
            assert!((f64::from(*d) - slow).abs() < 1e-5, "{i}: {d}, not {slow}");
        }
    }
}
