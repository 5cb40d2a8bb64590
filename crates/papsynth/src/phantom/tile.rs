//! Tiles, small images at a position in a larger image.

use core::ops::Range;

use multiversion::multiversion;

/// A point in pixels: x right, y down, pixel centres at integers.
pub(crate) type Point = [f64; 2];

/// A small image whose upper left pixel is pixel `origin` of a larger image.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Tile {
    pub(crate) origin: [i64; 2],
    pub(crate) width: usize,
    pub(crate) values: Vec<f32>,
}

impl Tile {
    /// Returns a tile of zeros around points, with a margin in pixels.
    pub(crate) fn around<'a>(points: impl IntoIterator<Item = &'a Point>, margin: f64) -> Self {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for point in points {
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        let bound = |axis: usize| {
            let first = (low[axis] - margin).floor() as i64;
            let last = (high[axis] + margin).ceil() as i64;
            (first, usize::try_from(last - first + 1).unwrap_or(1))
        };
        let ((x, width), (y, height)) = (bound(0), bound(1));
        Self { origin: [x, y], width, values: vec![0.0; width * height] }
    }

    /// Crops the tile to a square around a point with half width `radius`.
    pub(crate) fn cropped(self, centre: Point, radius: f64) -> Self {
        let low = centre.map(|at| (at - radius).floor() as i64);
        let high = centre.map(|at| (at + radius).ceil() as i64 + 1);
        let end = [self.origin[0] + self.width as i64, self.origin[1] + self.height() as i64];
        if (0..2).all(|axis| self.origin[axis] >= low[axis] && end[axis] <= high[axis]) {
            return self;
        }
        let origin = [0, 1].map(|axis| self.origin[axis].clamp(low[axis], high[axis] - 1));
        let length = |axis: usize| usize::try_from(end[axis].min(high[axis]) - origin[axis]).unwrap_or(0).max(1);
        let (width, height) = (length(0), length(1));
        let mut part = Self { origin, width, values: vec![0.0; width * height] };
        overlay(&mut part.values, width, origin, &self, |row, values| row.copy_from_slice(values));
        part
    }

    /// Returns a tile of zeros of the same size and position.
    pub(crate) fn blank(&self) -> Self {
        Self { origin: self.origin, width: self.width, values: vec![0.0; self.values.len()] }
    }

    /// Returns the tile on a grid of pixels `n` times as large: each is the mean of the pixels in it.
    pub(crate) fn coarsened(&self, n: usize) -> Self {
        let side = n as i64;
        let origin = self.origin.map(|at| at.div_euclid(side));
        let length = |axis: usize, length: usize| {
            let end = self.origin[axis] + length as i64;
            usize::try_from((end + side - 1).div_euclid(side) - origin[axis]).unwrap_or(0)
        };
        let (width, height) = (length(0, self.width), length(1, self.height()));
        let mut values = vec![0.0; width * height];
        let weight = 1.0 / (n * n) as f32;
        let at = |axis: usize, place: usize| {
            usize::try_from((self.origin[axis] + place as i64).div_euclid(side) - origin[axis]).unwrap_or(0)
        };
        // Number of pixels in the first coarse pixel, which may begin before the tile.
        let first = (n - usize::try_from(self.origin[0].rem_euclid(side)).unwrap_or(0)).min(self.width);
        for (y, row) in self.values.chunks_exact(self.width).enumerate() {
            let (left, rest) = row.split_at(first);
            let [head, coarse @ ..] = &mut values[at(1, y) * width..][..width] else { continue };
            left.iter().for_each(|value| *head += weight * value);
            match n {
                2 => sum_groups::<2>(coarse, rest, weight),
                3 => sum_groups::<3>(coarse, rest, weight),
                4 => sum_groups::<4>(coarse, rest, weight),
                _ => coarse.iter_mut().zip(rest.chunks(n)).for_each(|(coarse, fine)| add_to(coarse, fine, weight)),
            }
        }
        Self { origin, width, values }
    }

    /// Returns the sum of all values.
    pub(crate) fn sum(&self) -> f64 {
        sum_where(&self.values, &self.values, f32::NEG_INFINITY)
    }

    /// Returns the sum of its values where `other` is at least `min`.
    pub(crate) fn sum_where(&self, other: &Self, min: f32) -> f64 {
        let (columns, others) = intersection(self.origin[0], self.width, other.origin[0], other.width);
        let (rows, other_rows) = intersection(self.origin[1], self.height(), other.origin[1], other.height());
        if columns.is_empty() {
            return 0.0;
        }
        let values = |y: usize| &self.values[y * self.width..][columns.clone()];
        let masks = |y: usize| &other.values[y * other.width..][others.clone()];
        rows.zip(other_rows).map(|(y, other_y)| sum_where(values(y), masks(other_y), min)).sum()
    }

    /// Returns the part of the tile within a rectangle of pixels; an empty pixel if they do not meet.
    pub(crate) fn part(&self, low: [i64; 2], width: usize, height: usize) -> Self {
        let (columns, _) = intersection(self.origin[0], self.width, low[0], width);
        let (rows, _) = intersection(self.origin[1], self.height(), low[1], height);
        if columns.is_empty() || rows.is_empty() {
            return Self { origin: low, width: 1, values: vec![0.0] };
        }
        let origin = [self.origin[0] + columns.start as i64, self.origin[1] + rows.start as i64];
        let values = rows.flat_map(|y| self.values[y * self.width..][columns.clone()].iter().copied()).collect();
        Self { origin, width: columns.len(), values }
    }

    /// Returns the tile on a grid `n` times as fine, with each pixel repeated.
    pub(crate) fn repeated(self, n: usize) -> Self {
        if n == 1 {
            return self;
        }
        let width = self.width * n;
        let mut values = vec![0.0; self.values.len() * n * n];
        for (row, rows) in self.values.chunks_exact(self.width).zip(values.chunks_exact_mut(n * width)) {
            let (first, others) = rows.split_at_mut(width);
            repeat_each(first, row, n);
            others.chunks_exact_mut(width).for_each(|other| other.copy_from_slice(first));
        }
        Self { origin: self.origin.map(|at| at * n as i64), width, values }
    }

    pub(crate) fn height(&self) -> usize {
        self.values.len() / self.width
    }

    /// Calls a function with the position and value of every pixel.
    pub(crate) fn for_each(&mut self, mut visit: impl FnMut(Point, &mut f32)) {
        let (width, [x0, y0]) = (self.width, self.origin);
        for (y, row) in (y0..).zip(self.values.chunks_exact_mut(width)) {
            for (x, value) in (x0..).zip(row) {
                visit([x as f64, y as f64], value);
            }
        }
    }

    /// Calls `blend` with each row segment shared with another tile: the values of this tile and of the other.
    pub(crate) fn blend(&mut self, other: &Self, blend: impl FnMut(&mut [f32], &[f32])) {
        overlay(&mut self.values, self.width, self.origin, other, blend);
    }
}

/// Adds `weight` times every group of `N` values of a row to one coarse pixel; the last group may be shorter.
#[multiversion(targets = "simd")]
fn sum_groups<const N: usize>(coarse: &mut [f32], row: &[f32], weight: f32) {
    let (whole, rest) = row.as_chunks::<N>();
    for (coarse, fine) in coarse.iter_mut().zip(whole) {
        add_to(coarse, fine, weight);
    }
    if let Some(last) = coarse.get_mut(whole.len()) {
        add_to(last, rest, weight);
    }
}

#[inline(always)]
fn add_to(coarse: &mut f32, fine: &[f32], weight: f32) {
    fine.iter().for_each(|value| *coarse += weight * value);
}

/// Repeats each value of a row `n` times.
fn repeat_each(fine: &mut [f32], row: &[f32], n: usize) {
    match n {
        1 => fine.copy_from_slice(row),
        2 => repeat::<2>(fine, row),
        _ => fine.chunks_exact_mut(n).zip(row).for_each(|(fine, value)| fine.fill(*value)),
    }
}

#[multiversion(targets = "simd")]
fn repeat<const N: usize>(fine: &mut [f32], row: &[f32]) {
    fine.as_chunks_mut::<N>().0.iter_mut().zip(row).for_each(|(fine, value)| *fine = [*value; N]);
}

/// Returns the sum of the values whose counterparts are at least `min`, in 16 independent partial sums.
#[multiversion(targets = "simd")]
fn sum_where(values: &[f32], others: &[f32], min: f32) -> f64 {
    const PARTS: usize = 16;
    let mut parts = [0.0_f64; PARTS];
    let selected = |value: f32, other: f32| f64::from(if other >= min { value } else { 0.0 });
    let others = &others[..values.len()];
    let ((values, last), (others, others_last)) = (values.as_chunks::<PARTS>(), others.as_chunks::<PARTS>());
    for (values, others) in values.iter().zip(others) {
        for l in 0..PARTS {
            parts[l] += selected(values[l], others[l]);
        }
    }
    let rest: f64 = last.iter().zip(others_last).map(|(value, other)| selected(*value, *other)).sum();
    parts.iter().sum::<f64>() + rest
}

/// Calls `blend` with each row segment that an image and a tile share: the values of the image and of the tile.
///
/// The image has `width` columns and its first pixel is pixel `origin`.
#[inline(always)]
pub(crate) fn overlay(
    image: &mut [f32],
    width: usize,
    origin: [i64; 2],
    tile: &Tile,
    mut blend: impl FnMut(&mut [f32], &[f32]),
) {
    let (columns, own) = intersection(origin[0], width, tile.origin[0], tile.width);
    if columns.is_empty() {
        return;
    }
    let (rows, own_rows) = intersection(origin[1], image.len() / width, tile.origin[1], tile.height());
    let rows = image.chunks_exact_mut(width).skip(rows.start);
    for (row, values) in rows.zip(tile.values.chunks_exact(tile.width).skip(own_rows.start)) {
        blend(&mut row[columns.clone()], &values[own.clone()]);
    }
}

/// Returns the intersection of two pixel ranges, given by first pixel and length, as index ranges into each.
fn intersection(first: i64, length: usize, other: i64, other_length: usize) -> (Range<usize>, Range<usize>) {
    let low = first.max(other);
    let high = (first + length as i64).min(other + other_length as i64).max(low);
    let from = |first: i64| (low - first) as usize..(high - first) as usize;
    (from(first), from(other))
}

/// Scales a polygon about a point.
pub(crate) fn scaled_about(polygon: &[Point], about: Point, factor: f64) -> Vec<Point> {
    polygon.iter().map(|p| [about[0] + factor * (p[0] - about[0]), about[1] + factor * (p[1] - about[1])]).collect()
}

/// Returns the area of a simple polygon, px².
pub(crate) fn area(polygon: &[Point]) -> f64 {
    fsd_shape::signed_area(polygon).abs()
}

/// Returns the radius of a circle with this area.
pub(crate) fn radius_of(area: f64) -> f64 {
    (area / core::f64::consts::PI).sqrt()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::phantom) fn disc(centre: Point, radius: f64) -> Vec<Point> {
        (0..400)
            .map(|i| {
                let angle = core::f64::consts::TAU * f64::from(i) / 400.0;
                [centre[0] + radius * libm::cos(angle), centre[1] + radius * libm::sin(angle)]
            })
            .collect()
    }

    pub(in crate::phantom) fn tile(origin: [i64; 2], width: usize, height: usize) -> Tile {
        Tile { origin, width, values: (0..width * height).map(|i| ((i * 37) % 101) as f32 / 101.0).collect() }
    }

    /// Returns the value of a tile at a pixel of the larger image.
    pub(in crate::phantom) fn at(tile: &Tile, [x, y]: [i64; 2]) -> f32 {
        let place = usize::try_from(x - tile.origin[0]).ok().zip(usize::try_from(y - tile.origin[1]).ok());
        let place = place.filter(|(x, y)| *x < tile.width && *y < tile.height());
        place.map_or(0.0, |(x, y)| tile.values[y * tile.width + x])
    }

    #[test]
    fn sum_where_adds_values_where_the_other_tile_reaches_the_minimum() {
        let mut own = tile([3, -2], 40, 17);
        for origin in [[3, -2], [-9, 4], [20, -11], [1, -3], [70, 0], [3, 30]] {
            let other = tile(origin, 25, 21);
            let mut slow = 0.0;
            own.for_each(|p, value| {
                slow += if at(&other, p.map(|c| c as i64)) >= 0.5 { f64::from(*value) } else { 0.0 };
            });
            let found = own.sum_where(&other, 0.5);
            assert!((found - slow).abs() < 1e-9 * slow.max(1.0), "{origin:?}: {found} {slow}");
        }
    }

    #[test]
    fn sum_and_coarsened_preserve_the_total() {
        for (origin, width, height) in [([0, 0], 7, 30), ([-21, 3], 60, 5), ([2, -9], 3, 41), ([1, 1], 1, 1)] {
            let tile = tile(origin, width, height);
            let sum: f64 = tile.values.iter().map(|v| f64::from(*v)).sum();
            assert!((tile.sum() - sum).abs() < 1e-9);
            for n in [1, 2, 3, 4, 5] {
                let mut coarse = tile.coarsened(n);
                let side = n as i64;
                coarse.for_each(|p, value| {
                    let corner = p.map(|at| at as i64 * side);
                    let places = (0..side * side).map(|i| [corner[0] + i % side, corner[1] + i / side]);
                    let expected = places.map(|p| at(&tile, p)).sum::<f32>() / (n * n) as f32;
                    assert!((*value - expected).abs() < 1e-5, "{origin:?} {n}");
                });
                assert!((coarse.sum() * (n * n) as f64 - sum).abs() < 1e-4, "{n}");
            }
        }
    }

    #[test]
    fn blend_clips_at_every_side() {
        for (x, y, width, height) in
            [(-2, -3, 9, 8), (3, 2, 2, 2), (5, 4, 9, 9), (-4, 1, 4, 2), (0, 6, 3, 3), (8, 0, 2, 2), (-9, -9, 40, 40)]
        {
            let other = tile([x, y], width, height);
            let mut image = Tile { origin: [-1, 2], width: 8, values: vec![0.5; 48] };
            image.blend(&other, |row, values| row.iter_mut().zip(values).for_each(|(pixel, value)| *pixel += value));
            image.for_each(|p, pixel| assert_eq!(*pixel, 0.5 + at(&other, p.map(|c| c as i64)), "{x} {y} {p:?}"));
        }
    }
}
