//! The picture of a sheet: its thickness along z, exact in area and in volume.

use crate::mesh::cross;
use crate::sheet::{Edge, OUTSIDE};
use crate::{Point, Sheet, Vertex};
use multiversion::multiversion;

/// Where the picture lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Centre of the first pixel, in the sheet's unit.
    pub origin: Point,
    /// Width and height of a pixel in the sheet's unit, above 0.
    pub pixel: f64,
}

/// Area in square pixels below which a triangle's thickness is taken as even: its slope would be all rounding.
const SLIVER: f64 = 1e-2;
/// Part of the greatest thickness that counts as nothing: what rounding leaves beyond the sheet's edge.
const NOTHING: f64 = 1e-9;
/// Area in square pixels below which all triangles round a vertex stand on edge.
const LEAST_ROOM: f64 = 1e-6;

/// Thickness p₀ + p₁ x + p₂ y.
type Plane = [f64; 3];

impl Sheet {
    /// Adds to each pixel of `image` (row-major, `width` a row) the sheet's mean thickness there along z, in the unit of
    /// `thickness`: all layers of a fold together. `thickness` is the flat sheet's as a function of [`Sheet::rest_radius`]; it
    /// becomes thickness/|n_z| where the sheet is tilted.
    ///
    /// The sum over the image times the pixel's area is [`Sheet::volume`], as far as the sheet lies within the image. Each vertex
    /// gathers a third of the volume of the triangles round it and spreads it as a pyramid over their projections, so that
    /// the picture has no facets; pixels cut by an edge hold their exact share.
    ///
    /// # Panics
    ///
    /// If the image is not made of whole rows, or `view.pixel` is not above 0.
    pub fn thickness_into(&self, image: &mut [f32], width: usize, view: &View, thickness: impl Fn(f64) -> f64) {
        assert!(width > 0 && image.len().is_multiple_of(width), "{} pixels are no whole rows of {width}", image.len());
        self.thickness_rows(width, image.len() / width, view, thickness, |pixel, value| {
            #[expect(clippy::cast_possible_truncation, reason = "rounding to the image's precision")]
            let value = value as f32;
            image[pixel] += value;
        });
    }

    /// Gives the thickness of each pixel that the sheet may touch, by its index.
    fn thickness_rows(
        &self,
        width: usize,
        height: usize,
        view: &View,
        thickness: impl Fn(f64) -> f64,
        mut put: impl FnMut(usize, f64),
    ) {
        assert!(view.pixel > 0.0, "pixel = {}: must be above 0", view.pixel);
        let scale = 1.0 / view.pixel;
        let Some(canvas) = self.canvas(width, height, view) else {
            return;
        };
        // The canvas's first pixel covers 0..1 here, and lengths are in pixels.
        let shift = [0, 1].map(|axis| view.origin[axis] + (canvas.first[axis] - 0.5) * view.pixel);
        let place = |v: &Vertex| [(v[0] - shift[0]) * scale, (v[1] - shift[1]) * scale];
        let places: Vec<Point> = self.vertices.iter().map(place).collect();
        let profile: Vec<f64> = self.radius.iter().map(|&r| thickness(r)).collect();
        let mut gathered = vec![[0.0; 2]; places.len()];
        for (t, corners) in self.triangles.iter().enumerate() {
            let corners = corners.map(|v| v as usize);
            // A third of the volume, and the same third of the room it is spread over.
            let volume = self.rest_area_of(t) * scale * scale * corners.iter().map(|&v| profile[v]).sum::<f64>() / 3.0;
            let room = 0.5 * cross(places[corners[0]], places[corners[1]], places[corners[2]]).abs();
            for v in corners {
                gathered[v][0] += volume;
                gathered[v][1] += room;
            }
        }
        self.make_room(&mut gathered);
        let density: Vec<f64> = gathered.iter().map(|[volume, room]| volume / room.max(LEAST_ROOM)).collect();
        let greatest = density.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
        let planes: Vec<Plane> =
            self.triangles.iter().map(|t| plane(t.map(|v| (places[v as usize], density[v as usize])))).collect();
        // One column more than the canvas takes what goes on beyond it.
        let mut sums = vec![[0.0; 2]; (canvas.width + 1) * canvas.height];
        sweep(&mut sums, canvas.width, &self.edges, &places, &planes);
        for (row, line) in sums.chunks_exact(canvas.width + 1).enumerate() {
            let (mut even, mut slope, mut column) = (0.0, 0.0, 0.0);
            for (pixel, [e, s]) in (canvas.start + row * width..).zip(&line[..canvas.width]) {
                even += e;
                slope += s;
                let value = even + slope * column;
                column += 1.0;
                put(pixel, if value.abs() > NOTHING * greatest { value } else { 0.0 });
            }
        }
    }

    /// Hands the volume of each vertex without room to its neighbours that have some. Only what stands on edge all around is lost.
    fn make_room(&self, gathered: &mut [[f64; 2]]) {
        let cramped = |room: f64| room < LEAST_ROOM;
        if !gathered.iter().any(|g| cramped(g[1])) {
            return;
        }
        let both = self.edges.iter().flat_map(|e| [[e.ends[0], e.ends[1]], [e.ends[1], e.ends[0]]]);
        let inherits = |[from, to]: &[usize; 2]| cramped(gathered[*from][1]) && !cramped(gathered[*to][1]);
        let pairs: Vec<[usize; 2]> = both.map(|pair| pair.map(|v| v as usize)).filter(inherits).collect();
        let mut shares = vec![0.0; gathered.len()];
        for &[from, _] in &pairs {
            shares[from] += 1.0;
        }
        for &[from, to] in &pairs {
            gathered[to][0] += gathered[from][0] / shares[from];
        }
    }

    /// The part of the image that the sheet may touch.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "clamped to the image"
    )]
    fn canvas(&self, width: usize, height: usize, view: &View) -> Option<Canvas> {
        let size = [width, height];
        let [(left, right), (top, bottom)] = [0, 1].map(|axis| {
            let extent = self
                .vertices
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v[axis]), h.max(v[axis])));
            // Half a pixel, as pixels reach that far from their centres.
            let pixel = |x: f64, end: f64| {
                ((x - view.origin[axis]) / view.pixel + 0.5 + end).clamp(0.0, size[axis] as f64) as usize
            };
            (pixel(extent.0, 0.0), pixel(extent.1, 1.0))
        });
        (left < right && top < bottom).then(|| Canvas {
            first: [left as f64, top as f64],
            start: top * width + left,
            width: right - left,
            height: bottom - top,
        })
    }
}

/// A part of an image.
struct Canvas {
    /// Column and row of its first pixel, and that pixel's index.
    first: Point,
    start: usize,
    width: usize,
    height: usize,
}

/// The linear thickness through three corners, negative where the triangle shows its back, so that the sweep adds it all the same.
fn plane([(a, da), (b, db), (c, dc)]: [(Point, f64); 3]) -> Plane {
    let area = cross(a, b, c);
    let plane = if area.abs() < 2.0 * SLIVER {
        [(da + db + dc) / 3.0, 0.0, 0.0]
    } else {
        let px = ((db - da) * (c[1] - a[1]) - (dc - da) * (b[1] - a[1])) / area;
        let py = ((dc - da) * (b[0] - a[0]) - (db - da) * (c[0] - a[0])) / area;
        [da - px * a[0] - py * a[1], px, py]
    };
    if area < 0.0 { plane.map(|p| -p) } else { plane }
}

/// Adds all edges. A triangle is what lies right of its edges that run up, less what lies right of those that run down; each edge
/// stands for both its triangles by the difference of their planes.
#[multiversion(targets = "simd")]
fn sweep(sums: &mut [[f64; 2]], width: usize, edges: &[Edge], places: &[Point], planes: &[Plane]) {
    for edge in edges {
        let [left, right] = edge.sides.map(|t| if t == OUTSIDE { [0.0; 3] } else { planes[t as usize] });
        let [a, b] = edge.ends.map(|v| places[v as usize]);
        let step = [right[0] - left[0], right[1] - left[1], right[2] - left[2]];
        if a[1] < b[1] {
            add_edge(sums, width, a, b, step);
        } else if a[1] > b[1] {
            add_edge(sums, width, b, a, step.map(|p| -p));
        }
    }
}

/// Adds `plane` over all that lies right of the edge from `a` down to `b`, row by row.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "rows clipped to the image"
)]
fn add_edge(sums: &mut [[f64; 2]], width: usize, a: Point, b: Point, plane: Plane) {
    let row_length = width + 1;
    let height = sums.len() / row_length;
    let slope = (b[0] - a[0]) / (b[1] - a[1]);
    // Unused where the edge is upright.
    let per_column = 1.0 / slope;
    let (top, bottom) = (a[1].max(0.0), b[1].min(height as f64));
    if top >= bottom {
        return;
    }
    let mut from = [if top > a[1] { a[0] + (top - a[1]) * slope } else { a[0] }, top];
    let mut row = top as usize;
    while row < height {
        let floor = (row + 1) as f64;
        let to = if floor < b[1] { [a[0] + (floor - a[1]) * slope, floor] } else { b };
        let line = &mut sums[row * row_length..(row + 1) * row_length];
        add_run(line, from, to, per_column, plane);
        if floor >= bottom {
            break;
        }
        from = to;
        row += 1;
    }
}

/// The part of an edge within one row, pixel by pixel.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "columns clipped to the image")]
fn add_run(line: &mut [[f64; 2]], from: Point, to: Point, per_column: f64, plane: Plane) {
    let last_column = line.len() as i64 - 1;
    let (low, high) = (from[0].min(to[0]), from[0].max(to[0]));
    let column = |x: f64| (x.clamp(-1.0, last_column as f64 + 1.0) + 1.0) as i64 - 1;
    let (first, last) = (column(low), column(high));
    if first == last {
        add_piece(line, first, from, to, plane);
        return;
    }
    let (mut at, end, forward) = if from[0] < to[0] { (first, last, true) } else { (last, first, false) };
    let mut here = from;
    while at != end {
        // The border to the next pixel on the way.
        let x = if forward { (at + 1) as f64 } else { at as f64 };
        let there = [x, from[1] + (x - from[0]) * per_column];
        add_piece(line, at, here, there, plane);
        here = there;
        at += if forward { 1 } else { -1 };
    }
    add_piece(line, end, here, to, plane);
}

/// The part of an edge within one pixel: its share there, and all of what lies further right.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "columns clipped to the image"
)]
fn add_piece(line: &mut [[f64; 2]], column: i64, a: Point, b: Point, [p0, p1, p2]: Plane) {
    let dy = b[1] - a[1];
    let mean_y = 0.5 * (a[1] + b[1]);
    // A whole pixel in column i gets dy (p₀ + p₂ ȳ + p₁ (i + ½)): an even part and one that grows with i.
    let even = dy * (p0 + p2 * mean_y + 0.5 * p1);
    if column < 0 {
        line[0][0] += even;
        line[0][1] += dy * p1;
    } else if (column as usize) < line.len() - 1 {
        let left = column as f64;
        let (u, v) = (a[0] - left, b[0] - left);
        // ∫(1−u)(p + p₂ y) dy + ½ p₁ ∫(1−u²) dy along the piece, p = p₀ + p₁ i.
        let mean_u = 0.5 * (u + v);
        let mean_uu = (u * u + u * v + v * v) / 3.0;
        let mean_uy = (2.0 * (u * a[1] + v * b[1]) + u * b[1] + v * a[1]) / 6.0;
        let share = dy * ((p0 + p1 * left) * (1.0 - mean_u) + p2 * (mean_y - mean_uy) + 0.5 * p1 * (1.0 - mean_uu));
        let here = column as usize;
        line[here][0] += share;
        line[here + 1][0] += even - share;
        line[here + 1][1] += dy * p1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::Parts;
    use crate::testing::{rng, wavy};
    use crate::{Cloth, ClothParams};
    use rand_core::Rng;

    const VIEW: View = View { origin: [-90.0, -140.0], pixel: 1.3 };
    const SIZE: (usize, usize) = (190, 185);

    fn profile(r: f64) -> f64 {
        1.4 - r * r
    }

    fn crumpled() -> Sheet {
        Cloth::new(&ClothParams::default()).unwrap().crumple(&wavy(3.0, 0.15), &mut rng(3)).unwrap()
    }

    fn picture(sheet: &Sheet, thickness: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut image = vec![0.0; SIZE.0 * SIZE.1];
        sheet.thickness_rows(SIZE.0, SIZE.1, &VIEW, thickness, |pixel, value| image[pixel] += value);
        image
    }

    /// A square of two triangles, tilted about y, with its corner at (10, 10).
    fn square(side: f64, slope: f64) -> Sheet {
        let rest = [[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]];
        let cos = 1.0 / (1.0 + slope * slope).sqrt();
        Sheet::new(Parts {
            vertices: rest.map(|[x, y]| [10.0 + x * cos, 10.0 + y, x * cos * slope]).to_vec(),
            rest: rest.to_vec(),
            radius: vec![0.5; 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        })
    }

    #[test]
    fn law_25_the_picture_holds_the_sheets_volume() {
        let sheet = crumpled();
        let volume = sheet.volume(profile);
        let sum: f64 = picture(&sheet, profile).iter().sum::<f64>() * VIEW.pixel * VIEW.pixel;
        assert!((sum / volume - 1.0).abs() < 1e-9, "{sum} {volume}");
        let mut image = vec![0.0_f32; SIZE.0 * SIZE.1];
        sheet.thickness_into(&mut image, SIZE.0, &VIEW, profile);
        let sum: f64 = image.iter().map(|&v| f64::from(v)).sum::<f64>() * VIEW.pixel * VIEW.pixel;
        assert!((sum / volume - 1.0).abs() < 1e-7, "{sum} {volume}");
        assert!(image.iter().all(|&v| v >= 0.0));
    }

    #[test]
    fn law_25_a_flat_sheet_is_even() {
        let mut sheet = crumpled();
        for (v, r) in sheet.vertices.iter_mut().zip(&sheet.rest) {
            *v = [30.0 + r[0], -20.0 + r[1], 0.0];
        }
        let image = picture(&sheet, |_| 0.7);
        let (inside, rim): (Vec<f64>, Vec<f64>) = image.iter().filter(|&&v| v > 0.0).partition(|&&v| v > 0.7 - 1e-6);
        assert!(inside.len() > 15_000 && rim.len() < 1000, "{} {}", inside.len(), rim.len());
        assert!(inside.iter().all(|v| (v - 0.7).abs() < 1e-6));
    }

    #[test]
    fn law_25_a_tilted_plane_is_thicker_by_its_normal() {
        for slope in [0.0, 0.5, 3.0] {
            let sheet = square(40.0, slope);
            let mut image = vec![0.0_f32; 60 * 60];
            sheet.thickness_into(&mut image, 60, &View { origin: [0.0, 0.0], pixel: 1.0 }, |_| 0.3);
            // |n_z| = 1 / √(1 + slope²)
            let wanted = 0.3 * libm::sqrt(1.0 + slope * slope);
            assert!((f64::from(image[30 * 60 + 15]) - wanted).abs() < 1e-6 * wanted);
        }
    }

    #[test]
    fn law_25_the_order_of_triangles_does_not_matter() {
        let sheet = crumpled();
        let mut triangles = sheet.triangles.clone();
        triangles.reverse();
        for t in triangles.iter_mut().step_by(2) {
            t.rotate_left(1);
        }
        let other = Sheet::new(Parts {
            vertices: sheet.vertices.clone(),
            rest: sheet.rest.clone(),
            radius: sheet.radius.clone(),
            triangles,
        });
        for (a, b) in picture(&sheet, profile).iter().zip(picture(&other, profile)) {
            assert!((a - b).abs() < 1e-9);
        }
    }

    #[test]
    fn pixels_hold_their_exact_share() {
        // A square of side 1.5 pixels whose corner lies a quarter into a pixel.
        let sheet = square(1.5, 0.0);
        let mut image = vec![0.0_f32; 9];
        sheet.thickness_into(&mut image, 3, &View { origin: [10.25, 10.25], pixel: 1.0 }, |_| 1.0);
        let part = [0.75, 0.75, 0.0];
        for (k, value) in image.iter().enumerate() {
            assert!((f64::from(*value) - part[k % 3] * part[k / 3]).abs() < 1e-6, "{k}: {value}");
        }
    }

    /// The picture by brute force: many points in each triangle.
    #[test]
    fn the_sweep_agrees_with_sampling() {
        let mut rng = rng(4);
        let mut value = |scale: f64| scale * f64::from(rng.next_u32()) / f64::from(u32::MAX);
        let parts = Parts {
            vertices: (0..9).map(|_| [value(14.0) - 2.0, value(14.0) - 2.0, 0.0]).collect(),
            rest: (0..9).map(|k| [f64::from(k % 3), f64::from(k / 3)]).collect(),
            radius: (0..9).map(|_| value(1.0)).collect(),
            triangles: vec![[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [3, 4, 7], [3, 7, 6], [4, 5, 8], [4, 8, 7]],
        };
        let sheet = Sheet::new(parts);
        let mut image = vec![0.0; 100];
        sheet.thickness_rows(
            10,
            10,
            &View { origin: [0.0, 0.0], pixel: 1.0 },
            |r| 1.0 + r,
            |pixel, value| image[pixel] = value,
        );
        let mut gathered = [[0.0; 2]; 9];
        for (t, corners) in sheet.triangles.iter().enumerate() {
            let places = corners.map(|v| [sheet.vertices[v as usize][0], sheet.vertices[v as usize][1]]);
            for &v in corners {
                gathered[v as usize][0] +=
                    sheet.rest_area_of(t) * corners.iter().map(|&v| 1.0 + sheet.radius[v as usize]).sum::<f64>() / 9.0;
                gathered[v as usize][1] += cross(places[0], places[1], places[2]).abs() / 6.0;
            }
        }
        let mut sampled = vec![0.0; 100];
        for corners in &sheet.triangles {
            let [a, b, c] =
                corners.map(|v| (sheet.vertices[v as usize], gathered[v as usize][0] / gathered[v as usize][1]));
            let area = 0.5 * cross([a.0[0], a.0[1]], [b.0[0], b.0[1]], [c.0[0], c.0[1]]).abs();
            let steps = 600;
            for (i, j) in (0..steps).flat_map(|i| (0..steps - i).map(move |j| (i, j))) {
                let (u, v) =
                    ((f64::from(i) + 1.0 / 3.0) / f64::from(steps), (f64::from(j) + 1.0 / 3.0) / f64::from(steps));
                let mix = |p: f64, q: f64, r: f64| p + u * (q - p) + v * (r - p);
                let (x, y) = ((mix(a.0[0], b.0[0], c.0[0]) + 0.5).floor(), (mix(a.0[1], b.0[1], c.0[1]) + 0.5).floor());
                if (0.0..10.0).contains(&x) && (0.0..10.0).contains(&y) {
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 99")]
                    let pixel = (y * 10.0 + x) as usize;
                    sampled[pixel] += mix(a.1, b.1, c.1) * area * 2.0 / f64::from(steps * (steps + 1));
                }
            }
        }
        let greatest = sampled.iter().fold(0.0_f64, |m, v| m.max(*v));
        for (a, b) in image.iter().zip(&sampled) {
            assert!((a - b).abs() < 5e-3 * greatest, "{a} {b}");
        }
    }

    #[test]
    fn a_part_of_the_picture_is_the_part_of_the_picture() {
        let sheet = crumpled();
        let whole = picture(&sheet, profile);
        let mut part = vec![0.0_f32; 50 * 40];
        let view = View { origin: [VIEW.origin[0] + 70.0 * VIEW.pixel, VIEW.origin[1] + 60.0 * VIEW.pixel], ..VIEW };
        sheet.thickness_into(&mut part, 50, &view, profile);
        for (k, value) in part.iter().enumerate() {
            let wanted = whole[(60 + k / 50) * SIZE.0 + 70 + k % 50];
            assert!((f64::from(*value) - wanted).abs() < 1e-5, "{k}: {value} {wanted}");
        }
        let mut away = vec![0.0_f32; 100];
        sheet.thickness_into(&mut away, 10, &View { origin: [1e4, 0.0], pixel: 1.0 }, profile);
        assert!(away.iter().all(|&v| v == 0.0));
    }

    #[test]
    fn a_corner_on_edge_leaves_its_volume_to_its_neighbours() {
        let mut sheet = square(10.0, 0.0);
        // A triangle that stands on the square's corner like a flag on its pole.
        sheet = Sheet::new(Parts {
            vertices: [&sheet.vertices[..], &[[10.0, 10.0, 7.0], [10.0, 10.0, 9.0]]].concat(),
            rest: [&sheet.rest[..], &[[-1.0, 0.0], [0.0, -1.0]]].concat(),
            radius: vec![0.5; 6],
            triangles: [&sheet.triangles[..], &[[0, 4, 5]]].concat(),
        });
        let mut image = vec![0.0_f32; 30 * 30];
        sheet.thickness_into(&mut image, 30, &View { origin: [0.0, 0.0], pixel: 1.0 }, |_| 1.0);
        let sum: f64 = image.iter().map(|&v| f64::from(v)).sum();
        assert!((sum - 100.5).abs() < 1e-4, "{sum}");
    }

    #[test]
    #[should_panic(expected = "no whole rows")]
    fn an_image_has_whole_rows() {
        square(1.0, 0.0).thickness_into(&mut [0.0; 10], 3, &VIEW, |_| 1.0);
    }

    #[test]
    #[should_panic(expected = "pixel = 0")]
    fn pixels_have_a_size() {
        square(1.0, 0.0).thickness_into(&mut [0.0; 9], 3, &View { pixel: 0.0, ..VIEW }, |_| 1.0);
    }
}
