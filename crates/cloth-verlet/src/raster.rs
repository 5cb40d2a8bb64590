//! Rasterises a sheet: its thickness along z, exact in area and volume.

use crate::sheet::cross;
use crate::sheet::{Edge, OUTSIDE};
use crate::{Point, Sheet, Vertex};
use multiversion::multiversion;
use std::ops::Range;

/// Position and size of the pixels of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelGrid {
    /// Centre of the first pixel, in the unit of the sheet.
    pub origin: Point,
    /// Width and height of a pixel in the unit of the sheet, above 0.
    pub pixel_size: f64,
}

/// Area in square pixels below which the thickness of a triangle counts as constant: its slope would be a rounding
/// error.
const SLIVER: f64 = 1e-2;
/// Fraction of the greatest thickness below which a pixel is 0: rounding errors beyond the edge of the sheet.
const NEGLIGIBLE: f64 = 1e-11;
/// Projected area in square pixels below which all triangles around a vertex count as vertical.
const MIN_PROJECTED_AREA: f64 = 1e-6;

/// Rows that are integrated at once.
const ROWS_AT_ONCE: usize = 4;
/// Rows of a band, a multiple of [`ROWS_AT_ONCE`]. The image is drawn band by band, because the steps of a large image
/// do not fit into the cache.
const BAND: usize = 64;

/// Coefficients of the thickness p₀ + p₁ x + p₂ y.
type Plane = [f64; 3];

impl Sheet {
    /// Adds to each pixel of `image` (row-major, `width` pixels a row) the mean thickness of the sheet along z, summed
    /// over all layers of a fold. `thickness` is the thickness of the flat sheet as a function of
    /// [`Sheet::rest_radius`]; the unit is the same. Where the sheet is tilted, it becomes thickness/|n_z|.
    ///
    /// The sum over the image times the area of a pixel is [`Sheet::volume`], if the sheet is within the image. Each
    /// vertex gathers a third of the volume of its adjacent triangles and distributes it as a pyramid over their
    /// projections, so that the image has no facets. Pixels at an edge contain the exact fraction.
    ///
    /// # Panics
    ///
    /// If the length of the image is not a multiple of `width`, or the pixel size is not above 0.
    pub fn thickness_into(&self, image: &mut [f32], width: usize, grid: &PixelGrid, thickness: impl Fn(f64) -> f64) {
        assert!(
            width > 0 && image.len().is_multiple_of(width),
            "{} pixels are not a multiple of the width {width}",
            image.len()
        );
        assert!(grid.pixel_size > 0.0, "pixel_size = {}: expected more than 0", grid.pixel_size);
        let scale = 1.0 / grid.pixel_size;
        let [columns, rows] = self.covered_pixels([width, image.len() / width], grid);
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        // In units of pixels; the first covered pixel is 0..1.
        let first = [columns.start as f64, rows.start as f64];
        let shift = [0, 1].map(|axis| grid.origin[axis] + (first[axis] - 0.5) * grid.pixel_size);
        let place = |v: &Vertex| [(v[0] - shift[0]) * scale, (v[1] - shift[1]) * scale];
        let places: Vec<Point> = self.vertices.iter().map(place).collect();
        let profile: Vec<f64> = self.radius.iter().map(|&r| thickness(r)).collect();
        let mut gathered = vec![[0.0; 2]; places.len()];
        for (t, corners) in self.triangles.iter().enumerate() {
            let corners = corners.map(|v| v as usize);
            // A third of the volume, and a third of the projected area.
            let volume = self.rest_area_of(t) * scale * scale * corners.iter().map(|&v| profile[v]).sum::<f64>() / 3.0;
            let projected_area = 0.5 * cross(places[corners[0]], places[corners[1]], places[corners[2]]).abs();
            for v in corners {
                gathered[v][0] += volume;
                gathered[v][1] += projected_area;
            }
        }
        self.redistribute(&mut gathered);
        let density: Vec<f64> =
            gathered.iter().map(|[volume, projected_area]| volume / projected_area.max(MIN_PROJECTED_AREA)).collect();
        let greatest = density.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
        let mut planes = vec![[0.0; 3]; self.triangles.len()];
        fill_planes(&mut planes, &self.triangles, &places, &density);
        let count = rows.len().div_ceil(BAND);
        let numbers: Vec<usize> = places.iter().map(|place| band_of(*place, count)).collect();
        let mut bands: Vec<Vec<&Edge>> = vec![Vec::with_capacity(2 * self.edges.len() / count); count];
        for edge in self.edges.iter() {
            let [a, b] = edge.ends.map(|v| numbers[v as usize]);
            bands[a.min(b)..=a.max(b)].iter_mut().for_each(|band| band.push(edge));
        }
        // One more column holds the remainder beyond the row.
        let stride = columns.len() + 1;
        let mut sums = vec![[0.0; 2]; stride * BAND.min(rows.len().next_multiple_of(ROWS_AT_ONCE))];
        let mut lines = vec![0.0; ROWS_AT_ONCE * columns.len()];
        let image = image[rows.start * width..rows.end * width].chunks_mut(BAND * width);
        for (number, (edges, image)) in bands.iter().zip(image).enumerate() {
            let height = image.len() / width;
            sweep(&mut sums[..stride * height], stride, (number * BAND) as f64, edges, &places, &planes);
            let mut image = image.chunks_exact_mut(width);
            for steps in sums[..stride * height.next_multiple_of(ROWS_AT_ONCE)].chunks_exact_mut(ROWS_AT_ONCE * stride)
            {
                integrate(&mut lines, steps, NEGLIGIBLE * greatest);
                steps.fill([0.0; 2]);
                for (line, row) in lines.chunks_exact(columns.len()).zip(&mut image) {
                    add(&mut row[columns.clone()], line);
                }
            }
        }
    }

    /// Moves the volume of each vertex without projected area to its neighbours that have some. It is lost if no
    /// neighbour has.
    fn redistribute(&self, gathered: &mut [[f64; 2]]) {
        let is_vertical = |projected_area: f64| projected_area < MIN_PROJECTED_AREA;
        if !gathered.iter().any(|g| is_vertical(g[1])) {
            return;
        }
        let both = self.edges.iter().flat_map(|e| [[e.ends[0], e.ends[1]], [e.ends[1], e.ends[0]]]);
        let inherits = |[from, to]: &[usize; 2]| is_vertical(gathered[*from][1]) && !is_vertical(gathered[*to][1]);
        let pairs: Vec<[usize; 2]> = both.map(|pair| pair.map(|v| v as usize)).filter(inherits).collect();
        let mut neighbours = vec![0.0; gathered.len()];
        for &[from, _] in &pairs {
            neighbours[from] += 1.0;
        }
        for &[from, to] in &pairs {
            gathered[to][0] += gathered[from][0] / neighbours[from];
        }
        for (g, neighbours) in gathered.iter_mut().zip(&neighbours) {
            if *neighbours > 0.0 {
                g[0] = 0.0;
            }
        }
    }

    /// Returns the columns and rows of the image that the sheet may cover.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the image")]
    fn covered_pixels(&self, size: [usize; 2], grid: &PixelGrid) -> [Range<usize>; 2] {
        [0, 1].map(|axis| {
            let bounds = |(low, high): (f64, f64), v: &Vertex| (low.min(v[axis]), high.max(v[axis]));
            let (low, high) = self.vertices.iter().fold((f64::INFINITY, f64::NEG_INFINITY), bounds);
            // Half a pixel, from its centre to its border.
            let pixel = |x: f64, end: f64| {
                ((x - grid.origin[axis]) / grid.pixel_size + 0.5 + end).clamp(0.0, size[axis] as f64) as usize
            };
            pixel(low, 0.0)..pixel(high, 1.0)
        })
    }
}

/// Returns the band of a point; points beyond the image are in the first or last band.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
fn band_of(place: Point, bands: usize) -> usize {
    (place[1] as usize / BAND).min(bands - 1)
}

#[multiversion(targets = "simd")]
fn fill_planes(planes: &mut [Plane], triangles: &[[u32; 3]], places: &[Point], density: &[f64]) {
    for (out, corners) in planes.iter_mut().zip(triangles) {
        *out = plane(corners.map(|v| (places[v as usize], density[v as usize])));
    }
}

/// Returns the linear thickness through three corners; negated for a back-facing triangle, so that the sweep adds it as
/// positive.
#[inline(always)]
fn plane([(a, da), (b, db), (c, dc)]: [(Point, f64); 3]) -> Plane {
    let area = cross(a, b, c);
    let plane = if area.abs() < 2.0 * SLIVER {
        [(da + db + dc) / 3.0, 0.0, 0.0]
    } else {
        let per_area = 1.0 / area;
        let px = ((db - da) * (c[1] - a[1]) - (dc - da) * (b[1] - a[1])) * per_area;
        let py = ((dc - da) * (b[0] - a[0]) - (db - da) * (c[0] - a[0])) * per_area;
        [da - px * a[0] - py * a[1], px, py]
    };
    if area < 0.0 { plane.map(|p| -p) } else { plane }
}

/// Contribution of an edge to a pixel: to its thickness, and to the increase of thickness from column to column.
type Step = [f64; 2];

/// Integrates the steps of [`ROWS_AT_ONCE`] rows from left to right; each has one column more than its line. Values up
/// to `negligible` become 0.
#[multiversion(targets = "simd")]
fn integrate(lines: &mut [f64], steps: &[Step], negligible: f64) {
    let width = lines.len() / ROWS_AT_ONCE;
    let (mut value, mut growth) = ([0.0; ROWS_AT_ONCE], [0.0; ROWS_AT_ONCE]);
    let mut rows = steps.chunks_exact(width + 1);
    let rows: [&[Step]; ROWS_AT_ONCE] = std::array::from_fn(|_| rows.next().map_or(&[][..], |row| &row[..width]));
    let mut out = lines.chunks_exact_mut(width);
    let out: [&mut [f64]; ROWS_AT_ONCE] = std::array::from_fn(|_| out.next().unwrap_or_default());
    // Each sum depends on the previous one; several rows hide that latency.
    for column in 0..width {
        for k in 0..ROWS_AT_ONCE {
            let [value_step, slope] = rows[k][column];
            value[k] += growth[k] + value_step;
            growth[k] += slope;
            out[k][column] = value[k];
        }
    }
    for value in lines {
        *value = if value.abs() > negligible { *value } else { 0.0 };
    }
}

#[multiversion(targets = "simd")]
#[expect(clippy::cast_possible_truncation, reason = "rounding to the image's precision")]
fn add(pixels: &mut [f32], values: &[f64]) {
    for (pixel, value) in pixels.iter_mut().zip(values) {
        *pixel += *value as f32;
    }
}

// This compiles to one vector instruction; `f64::max` also handles NaN.
#[inline(always)]
fn at_least(value: f64, low: f64) -> f64 {
    if value > low { value } else { low }
}

/// Edges that are added at once.
const LANES: usize = 8;

/// Edges are sorted by the number of pixels that they cross, into this many batches with this range of numbers, so that
/// the edges of a batch end at about the same time.
const LENGTHS: (usize, usize) = (8, 2);

/// One number for each edge of a batch.
type Lane = [f64; LANES];

/// Edges within the image, each with the plane that it adds to the region on its right.
struct EdgeBatch {
    /// x and y of the upper end.
    from: [Lane; 2],
    /// x and y of the lower end.
    to: [Lane; 2],
    plane: [Lane; 3],
    /// Column and row of the pixel with the upper end.
    pixel: [Lane; 2],
    /// Index of the same pixel.
    at: [usize; LANES],
    len: usize,
    /// Most pixels that an edge crosses.
    most: usize,
}

impl EdgeBatch {
    const EMPTY: Self = Self {
        from: [[0.0; LANES]; 2],
        to: [[0.0; LANES]; 2],
        plane: [[0.0; LANES]; 3],
        pixel: [[0.0; LANES]; 2],
        at: [0; LANES],
        len: 0,
        most: 0,
    };

    /// Appends an edge, with the pixel of its upper end and the number of pixels that it crosses.
    #[inline(always)]
    fn push(&mut self, [a, b]: [Point; 2], plane: Plane, [column, row, at]: [usize; 3], pixels: usize) {
        let l = self.len;
        for axis in 0..2 {
            self.from[axis][l] = a[axis];
            self.to[axis][l] = b[axis];
        }
        for (own, p) in self.plane.iter_mut().zip(plane) {
            own[l] = p;
        }
        self.pixel[0][l] = column as f64;
        self.pixel[1][l] = row as f64;
        self.at[l] = at;
        self.most = self.most.max(pixels);
        self.len += 1;
    }

    /// Adds the edges and removes them from the batch. All lanes move from pixel to pixel at the same time; a lane at
    /// the lower end of its edge adds zeros.
    #[inline(always)]
    fn add_to(&mut self, sums: &mut [Step], stride: usize) {
        // Unused lanes add zeros.
        self.plane.iter_mut().for_each(|p| p[self.len..].fill(0.0));
        let Self { from, to, plane, .. } = *self;
        let ([mut left, top], mut at) = (self.pixel, self.at);
        let [mut x, mut y] = from;
        let (mut way, mut inverse) = ([0.0; LANES], [[0.0; LANES]; 2]);
        // The next borders between columns and between rows.
        let (mut side, mut floor) = (left, top);
        for l in 0..LANES {
            let [dx, dy] = [to[0][l] - from[0][l], to[1][l] - from[1][l]];
            inverse[0][l] = 1.0 / dx;
            inverse[1][l] = 1.0 / dy;
            way[l] = if dx < 0.0 { -1.0 } else { 1.0 };
            side[l] += if dx < 0.0 { 0.0 } else { 1.0 };
            floor[l] += 1.0;
        }
        for _ in 0..self.most {
            let (pixels, mut steps) = (at, [[0.0; LANES]; 3]);
            for l in 0..LANES {
                // Positions of these borders along the edge, from 0 to 1.
                let beside = if (to[0][l] - side[l]) * way[l] > 0.0 {
                    (side[l] - from[0][l]) * inverse[0][l]
                } else {
                    f64::INFINITY
                };
                let below = if to[1][l] > floor[l] { (floor[l] - from[1][l]) * inverse[1][l] } else { f64::INFINITY };
                let (sideways, down) = (beside < below, below <= beside && below < f64::INFINITY);
                let next_x = if sideways {
                    side[l]
                } else if down {
                    from[0][l] + below * (to[0][l] - from[0][l])
                } else {
                    to[0][l]
                };
                let next_y = if sideways {
                    from[1][l] + beside * (to[1][l] - from[1][l])
                } else if down {
                    floor[l]
                } else {
                    to[1][l]
                };
                // The integral right of the piece, over a width r, is r (q − ½ p₁ r), where q is the plane at the
                // right border of the pixel. Along the piece r runs from r̄ − h to r̄ + h and q from q̄ − k to
                // q̄ + k; the mean of their product is r̄ q̄ + h k / 3.
                let [p0, p1, p2] = [plane[0][l], plane[1][l], plane[2][l]];
                let (dy, half) = (next_y - y[l], 0.5 * p1);
                let centre = p0 + half + p1 * left[l] + p2 * (0.5 * (y[l] + next_y));
                let mean = left[l] + 1.0 - 0.5 * (x[l] + next_x);
                let h = 0.5 * (x[l] - next_x);
                let k = 0.5 * p2 * dy;
                let covered = dy * (mean * (centre + half - half * mean) + h * (k - half * h) * (1.0 / 3.0));
                steps[0][l] = covered;
                steps[1][l] = dy * (centre + p1) - covered;
                steps[2][l] = dy * p1;
                (x[l], y[l]) = (next_x, next_y);
                let across = if sideways { way[l] } else { 0.0 };
                side[l] += across;
                left[l] += across;
                // Not a sum, which would be compiled to masked stores that delay the next load.
                floor[l] = at_least(floor[l], if down { floor[l] + 1.0 } else { 0.0 });
                let along = if way[l] < 0.0 { usize::MAX } else { 1 };
                at[l] = at[l].wrapping_add(if sideways {
                    along
                } else if down {
                    stride
                } else {
                    0
                });
            }
            for l in 0..LANES {
                if let Some([here, next]) = sums[pixels[l]..].first_chunk_mut() {
                    here[0] += steps[0][l];
                    next[0] += steps[1][l];
                    next[1] += steps[2][l];
                }
            }
        }
        (self.len, self.most) = (0, 0);
    }
}

/// Adds edges to a band that begins at row `top`. A triangle is the region right of its upward edges minus the region
/// right of its downward edges. Each edge adds the difference of the planes of its two triangles.
#[multiversion(targets = "simd")]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels of the image")]
fn sweep(sums: &mut [Step], stride: usize, top: f64, edges: &[&Edge], places: &[Point], planes: &[Plane]) {
    let size = [(stride - 1) as f64, (sums.len() / stride) as f64];
    let within = |p: Point| (0..2).all(|axis| p[axis] >= 0.0 && p[axis] < size[axis]);
    let mut batches = [const { EdgeBatch::EMPTY }; LENGTHS.0];
    let mut add = |a: Point, b: Point, plane: Plane| {
        let (column, row) = ((a[0] as usize).min(stride - 2), a[1] as usize);
        let pixels = column.abs_diff(b[0] as usize) + (b[1] as usize - row) + 1;
        let batch = &mut batches[(pixels / LENGTHS.1).min(LENGTHS.0 - 1)];
        batch.push([a, b], plane, [column, row, row * stride + column], pixels);
        if batch.len == LANES {
            batch.add_to(sums, stride);
        }
    };
    for edge in edges {
        let [left, right] = edge.sides.map(|t| if t == OUTSIDE { [0.0; 3] } else { planes[t as usize] });
        let [a, b] = edge.ends.map(|v| [places[v as usize][0], places[v as usize][1] - top]);
        let step = [right[0] - left[0] + top * (right[2] - left[2]), right[1] - left[1], right[2] - left[2]];
        let (a, b, step) = if a[1] < b[1] {
            (a, b, step)
        } else if a[1] > b[1] {
            (b, a, step.map(|p| -p))
        } else {
            continue;
        };
        if within(a) && within(b) {
            add(a, b, step);
        } else {
            clipped(a, b, size, |a, b| add(a, b, step));
        }
    }
    batches.iter_mut().for_each(|batch| batch.add_to(sums, stride));
}

/// Passes the parts of the edge from `a` down to `b` that are within the image to `add`. Parts beyond its left or right
/// border are moved to the border, with the same region of the image on their right.
fn clipped(a: Point, b: Point, [width, height]: [f64; 2], mut add: impl FnMut(Point, Point)) {
    let slope = (b[0] - a[0]) / (b[1] - a[1]);
    let (top, bottom) = (a[1].max(0.0), b[1].min(height));
    let x = |y: f64| if y < b[1] { a[0] + (y - a[1]) * slope } else { b[0] };
    // A vertical edge has no crossing: infinity and NaN become an end.
    let crossing = |x: f64| (a[1] + (x - a[0]) / slope).max(top).min(bottom);
    let (left, right) = (crossing(0.0), crossing(width));
    let cuts = [top, left.min(right), left.max(right), bottom];
    for (&from, &to) in cuts.iter().zip(&cuts[1..]).filter(|(from, to)| from < to) {
        add([x(from).clamp(0.0, width), from], [x(to).clamp(0.0, width), to]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{rng, wavy};
    use crate::{Cloth, ClothParams};
    use portable_numerics::random::uniform;

    const GRID: PixelGrid = PixelGrid { origin: [-90.0, -140.0], pixel_size: 1.3 };
    const PLAIN: PixelGrid = PixelGrid { origin: [0.0, 0.0], pixel_size: 1.0 };

    fn profile(r: f64) -> f64 {
        1.4 - r * r
    }

    fn crumpled() -> Sheet {
        Cloth::new(&ClothParams::default()).unwrap().crumple(&wavy(3.0, 0.15), &mut rng(3)).unwrap()
    }

    fn rendered(
        sheet: &Sheet,
        [width, height]: [usize; 2],
        grid: &PixelGrid,
        thickness: impl Fn(f64) -> f64,
    ) -> Vec<f64> {
        let mut image = vec![0.0_f32; width * height];
        sheet.thickness_into(&mut image, width, grid, thickness);
        image.into_iter().map(f64::from).collect()
    }

    /// Returns a square of two triangles, tilted about y, with its corner at (10, 10).
    fn square(side: f64, slope: f64) -> Sheet {
        let rest = [[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]];
        let cos = 1.0 / (1.0 + slope * slope).sqrt();
        let vertices = rest.map(|[x, y]| [10.0 + x * cos, 10.0 + y, x * cos * slope]).to_vec();
        Sheet::new(vertices, rest.to_vec(), vec![0.5; 4], vec![[0, 1, 2], [0, 2, 3]])
    }

    #[test]
    fn the_image_contains_the_volume_of_the_sheet() {
        // Triangles at the rim have no area at corners of the outline.
        let outline = [[10.0, 5.0], [90.0, 12.0], [70.0, 40.0], [95.0, 80.0], [30.0, 90.0], [4.0, 50.0]];
        let cloth = Cloth::new(&ClothParams { vertices: 400, ..ClothParams::default() }).unwrap();
        let cornered = (0..6).map(|seed| (cloth.crumple(&outline, &mut rng(seed)).unwrap(), [100; 2], PLAIN));
        for (sheet, size, grid) in cornered.chain([(crumpled(), [190, 185], GRID)]) {
            let image = rendered(&sheet, size, &grid, profile);
            let sum = image.iter().sum::<f64>() * grid.pixel_size * grid.pixel_size;
            assert!((sum / sheet.volume(profile) - 1.0).abs() < 1e-7, "{sum}");
            assert!(image.iter().all(|&v| v >= 0.0));
        }
    }

    #[test]
    fn a_flat_sheet_is_uniform() {
        let mut sheet = crumpled();
        for (v, r) in sheet.vertices.iter_mut().zip(&sheet.rest) {
            *v = [30.0 + r[0], -20.0 + r[1], 0.0];
        }
        let image = rendered(&sheet, [190, 185], &GRID, |_| 0.7);
        let (inside, rim): (Vec<f64>, Vec<f64>) = image.iter().filter(|&&v| v > 0.0).partition(|&&v| v > 0.7 - 1e-6);
        assert!(inside.len() > 15_000 && rim.len() < 1000, "{} {}", inside.len(), rim.len());
        assert!(inside.iter().all(|v| (v - 0.7).abs() < 1e-6));
    }

    #[test]
    fn a_tilted_plane_is_thicker_by_its_normal_and_edge_pixels_are_exact() {
        for (slope, side) in [(0.0, 1.5), (0.5, 1.5), (3.0, 7.0)] {
            // A square with its corner a quarter into a pixel.
            let grid = PixelGrid { origin: [10.25, 10.25], pixel_size: 1.0 };
            // |n_z| = 1 / √(1 + slope²)
            let steep = libm::sqrt(1.0 + slope * slope);
            let part = |k: usize, side: f64| (side + 0.25 - k as f64).clamp(0.0, if k == 0 { 0.75 } else { 1.0 });
            for (k, value) in rendered(&square(side, slope), [9; 2], &grid, |_| 0.3).iter().enumerate() {
                let wanted = 0.3 * steep * part(k % 9, side / steep) * part(k / 9, side);
                assert!((value - wanted).abs() < 1e-6, "{k}: {value} {wanted}");
            }
        }
    }

    /// Compares with many sample points in each triangle, some of which are back-facing.
    #[test]
    fn the_sweep_agrees_with_sampling() {
        let mut rng = rng(4);
        let mut value = |scale: f64| scale * uniform(&mut rng);
        let sheet = Sheet::new(
            (0..9).map(|_| [value(14.0) - 2.0, value(14.0) - 2.0, 0.0]).collect(),
            (0..9).map(|k| [f64::from(k % 3), f64::from(k / 3)]).collect(),
            (0..9).map(|_| value(1.0)).collect(),
            vec![[0, 1, 4], [4, 3, 0], [1, 2, 5], [5, 4, 1], [3, 4, 7], [6, 3, 7], [4, 5, 8], [7, 4, 8]],
        );
        let image = rendered(&sheet, [10; 2], &PLAIN, |r| 1.0 + r);
        let places: Vec<Point> = sheet.vertices.iter().map(|v| [v[0], v[1]]).collect();
        let mut gathered = [[0.0; 2]; 9];
        for (t, corners) in sheet.triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|v| places[v as usize]);
            let mean = corners.iter().map(|&v| 1.0 + sheet.radius[v as usize]).sum::<f64>() / 3.0;
            for &v in corners {
                gathered[v as usize][0] += sheet.rest_area_of(t) * mean / 3.0;
                gathered[v as usize][1] += cross(a, b, c).abs() / 6.0;
            }
        }
        let mut sampled = vec![0.0; 100];
        for corners in sheet.triangles.iter() {
            let [a, b, c] = corners.map(|v| places[v as usize]);
            let [da, db, dc] = corners.map(|v| gathered[v as usize][0] / gathered[v as usize][1]);
            let steps = 600;
            for (i, j) in (0..steps).flat_map(|i| (0..steps - i).map(move |j| (i, j))) {
                let [u, v] = [i, j].map(|k| (f64::from(k) + 1.0 / 3.0) / f64::from(steps));
                let mix = |p: f64, q: f64, r: f64| p + u * (q - p) + v * (r - p);
                let [x, y] = [0, 1].map(|axis| (mix(a[axis], b[axis], c[axis]) + 0.5).floor());
                if (0.0..10.0).contains(&x) && (0.0..10.0).contains(&y) {
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 99")]
                    let pixel = (y * 10.0 + x) as usize;
                    sampled[pixel] += mix(da, db, dc) * cross(a, b, c).abs() / f64::from(steps * (steps + 1));
                }
            }
        }
        let greatest = sampled.iter().fold(0.0_f64, |m, v| m.max(*v));
        for (a, b) in image.iter().zip(&sampled) {
            assert!((a - b).abs() < 5e-3 * greatest, "{a} {b}");
        }
    }

    #[test]
    fn a_window_of_the_image_is_rendered_alone() {
        let sheet = crumpled();
        let whole = rendered(&sheet, [190, 185], &GRID, profile);
        let grid = PixelGrid {
            origin: [GRID.origin[0] + 70.0 * GRID.pixel_size, GRID.origin[1] + 60.0 * GRID.pixel_size],
            ..GRID
        };
        for (k, value) in rendered(&sheet, [50, 40], &grid, profile).iter().enumerate() {
            let wanted = whole[(60 + k / 50) * 190 + 70 + k % 50];
            assert!((value - wanted).abs() < 1e-5, "{k}: {value} {wanted}");
        }
        let away = rendered(&sheet, [10; 2], &PixelGrid { origin: [1e4, 0.0], pixel_size: 1.0 }, profile);
        assert_eq!(away, [0.0; 100]);
    }

    #[test]
    fn a_vertical_triangle_passes_its_volume_to_its_neighbours() {
        let Sheet { vertices, rest, triangles, .. } = square(10.0, 0.0);
        // A vertical triangle at the corner of the square.
        let sheet = Sheet::new(
            [&vertices[..], &[[10.0, 10.0, 7.0], [10.0, 10.0, 9.0]]].concat(),
            [&rest[..], &[[-1.0, 0.0], [0.0, -1.0]]].concat(),
            vec![0.5; 6],
            [&triangles[..], &[[0, 4, 5]]].concat(),
        );
        let sum: f64 = rendered(&sheet, [30; 2], &PLAIN, |_| 1.0).iter().sum();
        assert!((sum - 100.5).abs() < 1e-4, "{sum}");
    }

    #[test]
    #[should_panic(expected = "not a multiple")]
    fn a_partial_row_is_rejected() {
        square(1.0, 0.0).thickness_into(&mut [0.0; 10], 3, &GRID, |_| 1.0);
    }

    #[test]
    #[should_panic(expected = "pixel_size = 0")]
    fn a_pixel_size_of_zero_is_rejected() {
        square(1.0, 0.0).thickness_into(&mut [0.0; 9], 3, &PixelGrid { pixel_size: 0.0, ..GRID }, |_| 1.0);
    }
}
