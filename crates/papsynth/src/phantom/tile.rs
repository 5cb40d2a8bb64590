//! Small images at a place of the large one, and exact coverage of polygons.

use ab_glyph_rasterizer::{Rasterizer, point};

/// A point in pixels: x right, y down, pixel centres at whole numbers.
pub(crate) type Point = [f64; 2];

/// A small image whose upper left pixel is pixel `origin` of the large one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tile {
    pub(crate) origin: [i64; 2],
    pub(crate) width: usize,
    pub(crate) values: Vec<f32>,
}

impl Tile {
    /// A tile of zeros that holds all these points and `margin` pixels round them.
    pub(crate) fn around<'a>(points: impl IntoIterator<Item = &'a Point>, margin: f64) -> Self {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for point in points {
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "places on a slide are far below 2⁶³ pixels")]
        let bound = |axis: usize| {
            let first = (low[axis] - margin).floor() as i64;
            let last = (high[axis] + margin).ceil() as i64;
            (first, usize::try_from(last - first + 1).unwrap_or(1))
        };
        let ((x, width), (y, height)) = (bound(0), bound(1));
        Self { origin: [x, y], width, values: vec![0.0; width * height] }
    }

    /// A tile of zeros of the same size at the same place.
    pub(crate) fn blank(&self) -> Self {
        Self { origin: self.origin, width: self.width, values: vec![0.0; self.values.len()] }
    }

    pub(crate) fn height(&self) -> usize {
        self.values.len() / self.width
    }

    /// Applies a function of position to every pixel.
    pub(crate) fn for_each(&mut self, mut visit: impl FnMut(Point, &mut f32)) {
        let (width, [x0, y0]) = (self.width, self.origin);
        for (y, row) in (y0..).zip(self.values.chunks_exact_mut(width)) {
            for (x, value) in (x0..).zip(row) {
                visit([x as f64, y as f64], value);
            }
        }
    }

    /// Raises every pixel to the share of its area that a simple polygon covers, if that is more.
    pub(crate) fn cover(&mut self, polygon: &[Point]) {
        let mut rasterizer = Rasterizer::new(self.width, self.height());
        // Pixel (0, 0) of the rasteriser is the unit square whose corner, not centre, is at zero.
        let shift = |p: Point| {
            let x = p[0] - self.origin[0] as f64 + 0.5;
            let y = p[1] - self.origin[1] as f64 + 0.5;
            point(x as f32, y as f32)
        };
        for (index, &from) in polygon.iter().enumerate() {
            let to = polygon[(index + 1) % polygon.len()];
            rasterizer.draw_line(shift(from), shift(to));
        }
        let values = &mut self.values;
        rasterizer.for_each_pixel(|index, share| values[index] = values[index].max(share.min(1.0)));
    }
}

/// Adds a tile to an image of `width` x `height` whose upper left pixel is pixel `origin` of the large image.
pub(crate) fn add_tile(image: &mut [f32], width: usize, height: usize, origin: [i64; 2], tile: &Tile) {
    let Some((columns, rows)) = overlap(width, height, origin, tile) else { return };
    for row in rows {
        let y = usize::try_from(tile.origin[1] + row as i64 - origin[1]).unwrap_or(0);
        let x = usize::try_from(tile.origin[0] + columns.start as i64 - origin[0]).unwrap_or(0);
        let source = &tile.values[row * tile.width + columns.start..row * tile.width + columns.end];
        let target = &mut image[y * width + x..][..source.len()];
        for (target, source) in target.iter_mut().zip(source) {
            *target += source;
        }
    }
}

/// The columns and rows of a tile that lie within an image.
fn overlap(
    width: usize,
    height: usize,
    origin: [i64; 2],
    tile: &Tile,
) -> Option<(core::ops::Range<usize>, core::ops::Range<usize>)> {
    let span = |axis: usize, length: usize, whole: usize| {
        let first = (origin[axis] - tile.origin[axis]).max(0);
        let last = (origin[axis] + whole as i64 - tile.origin[axis]).min(length as i64);
        (first < last).then(|| usize::try_from(first).unwrap_or(0)..usize::try_from(last).unwrap_or(0))
    };
    Some((span(0, tile.width, width)?, span(1, tile.height(), height)?))
}

/// Area of a simple polygon, pixels².
pub(crate) fn area(polygon: &[Point]) -> f64 {
    fsd_shape::signed_area(polygon).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(centre: Point, radius: f64) -> Vec<Point> {
        (0..400)
            .map(|i| {
                let angle = core::f64::consts::TAU * f64::from(i) / 400.0;
                [centre[0] + radius * libm::cos(angle), centre[1] + radius * libm::sin(angle)]
            })
            .collect()
    }

    #[test]
    fn coverage_is_exact_area() {
        let polygon = disc([-3.3, 17.8], 6.4);
        let mut tile = Tile::around(&polygon, 2.0);
        tile.cover(&polygon);
        let sum: f64 = tile.values.iter().map(|v| f64::from(*v)).sum();
        assert!((sum - area(&polygon)).abs() < 1e-3, "{sum} {}", area(&polygon));
        let (mut x, mut y) = (0.0, 0.0);
        tile.clone().for_each(|p, v| {
            x += p[0] * f64::from(*v);
            y += p[1] * f64::from(*v);
        });
        // A pixel covered in part counts at its centre: right to a hundredth, where a shifted grid would be off by a half.
        assert!((x / sum + 3.3).abs() < 1e-2 && (y / sum - 17.8).abs() < 1e-2, "pixel centres at whole numbers");
    }

    #[test]
    fn covering_twice_adds_nothing() {
        let polygon = disc([10.0, 10.0], 4.0);
        let mut tile = Tile::around(&polygon, 2.0);
        tile.cover(&polygon);
        let once = tile.clone();
        tile.cover(&polygon);
        assert_eq!(once, tile);
    }

    #[test]
    fn adding_clips_at_every_side() {
        let mut image = vec![0.0; 12];
        let tile = Tile { origin: [-1, -1], width: 6, values: vec![1.0; 36] };
        add_tile(&mut image, 4, 3, [0, 0], &tile);
        assert_eq!(image, vec![1.0; 12]);
        add_tile(&mut image, 4, 3, [0, 0], &Tile { origin: [3, 2], ..tile.clone() });
        assert_eq!(image[11], 2.0);
        assert_eq!(image.iter().sum::<f32>(), 13.0);
        add_tile(&mut image, 4, 3, [0, 0], &Tile { origin: [4, 0], ..tile });
        assert_eq!(image.iter().sum::<f32>(), 13.0);
    }
}
