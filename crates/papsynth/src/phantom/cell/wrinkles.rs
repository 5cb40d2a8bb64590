//! Wrinkles: ridges and pleats of the cytoplasm, along the rim, across the cell, or forked; rolled stretches of the rim
//! and ridges along the edges of flaps.

mod path;
mod segment;

use path::{MEMORY, across_cell, along_rim, at_steps, beside, forked, random_part, side_of};
use portable_numerics::rounding::round_to_count;
pub(super) use segment::LANES;
use segment::{PLEAT, RIDGE, SLOPE_WIDTH, Segment, add_and_clear, paint};

use super::autoregression::Autoregression;
use crate::key::Stream;
use crate::phantom::cell_context::CellContext;
use crate::phantom::tile::{Point, Tile};
use crate::random;

/// Distance between the points of a wrinkle, µm.
const STEP_UM: f64 = 0.5;

/// Fraction of wrinkles that are a rolled stretch of the rim. This and the next three numbers were set so that lines
/// along rims are about as frequent as in real fields (docs/decisions.md, "Rolled rims"), and as dark, by eye.
const ROLLED: f64 = 0.125;
/// Thickness of a rolled stretch relative to that of a wrinkle: minimum, maximum.
const ROLLED_THICKNESS: [f64; 2] = [0.4, 1.6];
/// Width of a rolled stretch (standard deviation of its profile), µm: minimum, maximum.
const ROLLED_UM: [f64; 2] = [0.4, 0.9];
/// Distance of a rolled stretch from the rim, in radii of the cell: minimum, maximum.
const ROLLED_INSET: [f64; 2] = [0.015, 0.08];

/// Thickness of the ridge along the edge of a flap relative to that of a wrinkle, and its width, µm: minimum, maximum.
const EDGE_THICKNESS: [f64; 2] = [0.4, 2.0];
const EDGE_UM: [f64; 2] = [0.35, 0.8];

/// Fraction of the wrinkles other than rolled stretches that follow the rim.
const ALONG_RIM: f64 = 0.4;

/// Width from which a ridge has its full thickness; a narrower one is thinner in proportion. Set by eye: most
/// dark folds of real cells are wide.
const WIDE_UM: f64 = 0.6;

/// Thickness of a wrinkle other than a rolled stretch, relative to `wrinkle_thickness` of its cell: minimum, maximum.
const THICKNESS: [f64; 2] = [0.4, 1.6];
/// Width of a wrinkle other than a rolled stretch, relative to `wrinkle_um` of its cell: minimum, maximum.
const WIDTH: [f64; 2] = [0.6, 1.6];
/// Fraction that fork off a previous wrinkle, of the wrinkles that neither are rolled stretches nor follow the rim. The
/// rest of them begin at the rim and cross the cell.
const FORKED: f64 = 0.35;

/// Fraction of pleats among the wrinkles that are neither rolled stretches nor bundles: two dark lines with a paler
/// band between, instead of a ridge. This and the next two numbers were set by eye, beside cells of real fields.
const PLEATS: f64 = 0.08;
/// Width of a pleat relative to that of a ridge: minimum, maximum.
const PLEAT_WIDTH: [f64; 2] = [0.8, 2.5];
/// Fraction of wrinkles that are a bundle of fine ridges side by side, instead of one ridge or pleat: of the wrinkles
/// that follow the rim, and of all others, which include rolled stretches. These numbers and those of the next four
/// constants were set by eye, beside cells of real fields.
const BUNDLED: [f64; 2] = [0.1, 0.35];
/// Number of ridges beside the first one of a bundle: minimum, and range above it.
const BESIDE: [usize; 2] = [1, 3];
/// Distance between the ridges of a bundle, µm: minimum, maximum.
const APART_UM: [f64; 2] = [0.9, 2.2];
/// Width of these ridges (standard deviation of the profile), µm: minimum, maximum.
const FINE_UM: [f64; 2] = [0.25, 0.5];
/// Thickness of a ridge beside the first one, relative to it if both have the same width: minimum, maximum.
const FAINTER: [f64; 2] = [0.25, 0.9];

/// Width of a wrinkle at its ends relative to its middle.
const END_WIDTH: f64 = 0.4;

/// Largest fraction of a wrinkle's length over which it rises. It fades over at most the rest.
const TAPER: f64 = 0.3;

/// A wrinkle before it is drawn.
struct Wrinkle {
    path: Vec<Point>,
    profile: WrinkleProfile,
}

/// The wrinkles of a cell.
pub(super) struct Wrinkles {
    /// Rolled stretches of the rim.
    rolled: Vec<Wrinkle>,
    /// All other wrinkles, and ridges along the edges of flaps.
    others: Vec<Wrinkle>,
}

impl Wrinkles {
    /// Draws the wrinkles of a cell with this outline, and ridges along `edges`, the edges of its flaps. A cell without
    /// wrinkles has no ridges either.
    pub(super) fn new(outline: &[Point], edges: &[Vec<Point>], cell: &CellContext<'_>) -> Self {
        let (detail, pixel_um, rng) = (&cell.body.detail, cell.pixel_um(), &mut cell.stream("wrinkles"));
        let mut wrinkles = Self { rolled: Vec::new(), others: Vec::new() };
        if detail.wrinkles == 0 {
            return wrinkles;
        }
        let step = STEP_UM / pixel_um;
        let rim = fsd_shape::resample_along(outline, round_to_count(fsd_shape::perimeter(outline) / step).max(8));
        for path in edges.iter().map(|edge| at_steps(edge, step)).filter(|path| path.len() > 1) {
            let kind = WrinkleKind { width_um: EDGE_UM, thickness: EDGE_THICKNESS, pleat: false };
            let profile = WrinkleProfile::new(path.len(), &kind, cell, rng);
            wrinkles.others.push(Wrinkle { path, profile });
        }
        for _ in 0..detail.wrinkles {
            let rolled = random::chance(ROLLED, rng);
            let others = &wrinkles.others;
            let follows_rim = !rolled && random::chance(ALONG_RIM, rng);
            let path = if rolled {
                along_rim(outline, &rim, random::between(ROLLED_INSET[0], ROLLED_INSET[1], rng), 0.0, rng)
            } else if follows_rim {
                // Most wrinkles are near the rim, where a thin sheet folds freely.
                let depth = random::uniform(rng);
                along_rim(outline, &rim, 0.015 + 0.25 * depth * depth, random::between(-0.3, 0.3, rng), rng)
            } else if !others.is_empty() && random::chance(FORKED, rng) {
                let stem = &others[random::below(others.len(), rng)];
                forked(&stem.path, outline, step, rng)
            } else {
                across_cell(outline, step, cell.across_streaks_rad, rng)
            };
            let kind = if rolled {
                WrinkleKind { width_um: ROLLED_UM, thickness: ROLLED_THICKNESS, pleat: false }
            } else {
                let width_um = WIDTH.map(|width| width * detail.wrinkle_um);
                WrinkleKind { width_um, thickness: THICKNESS, pleat: random::chance(PLEATS, rng) }
            };
            let mut ridges = if random::chance(BUNDLED[usize::from(!follows_rim)], rng) {
                let right = if rolled || follows_rim {
                    // Inside the rim.
                    side_of(&path, fsd_shape::centroid(outline)) > 0.0
                } else {
                    random::chance(0.5, rng)
                };
                let side = if right { 1.0 } else { -1.0 };
                let kind = WrinkleKind { width_um: FINE_UM, pleat: false, ..kind };
                bundle(path, side, &kind, cell, rng)
            } else {
                let profile = WrinkleProfile::new(path.len(), &kind, cell, rng);
                vec![Wrinkle { path, profile }]
            };
            if rolled {
                // The last ridge of a bundle is the one on the path.
                wrinkles.rolled.extend(ridges.pop());
            }
            wrinkles.others.append(&mut ridges);
        }
        wrinkles
    }

    /// Adds the wrinkles to the thickness of the cell. `canvas` is an image of zeros before and after, of the same
    /// size, with a margin of [`LANES`] values at the end.
    pub(super) fn add(&self, thickness: &mut Tile, coverage: &Tile, canvas: &mut [f32]) {
        for Wrinkle { path, profile } in self.rolled.iter().chain(&self.others) {
            profile.draw(path, thickness, coverage, canvas);
        }
    }

    /// Returns the roughness of the rim at a point relative to the rest of the rim: a rolled stretch is smooth.
    pub(super) fn roughness(&self, at: Point, pixel_um: f64) -> f64 {
        /// Roughness along a rolled stretch.
        const SMOOTH: f64 = 0.15;
        /// Distances from a rolled stretch at which the roughness begins to rise and is that of the rest, µm.
        const REACH_UM: [f64; 2] = [2.0, 6.0];
        let [near, far] = REACH_UM.map(|um| um / pixel_um);
        // Every fourth point of a path is close enough.
        let points = self.rolled.iter().flat_map(|rolled| rolled.path.iter().step_by(4));
        let square = |p: &Point| (p[0] - at[0]) * (p[0] - at[0]) + (p[1] - at[1]) * (p[1] - at[1]);
        let distance = points.map(square).fold(far * far, f64::min).sqrt();
        SMOOTH + (1.0 - SMOOTH) * ((distance - near) / (far - near)).max(0.0)
    }
}

/// Draws a bundle of ridges along a path: ridges beside it on one side, each along a part of it, then the one on it.
/// `side` is 1 if they are on the right of the path, where y points down, and −1 if on the left.
fn bundle(path: Vec<Point>, side: f64, kind: &WrinkleKind, cell: &CellContext<'_>, rng: &mut Stream) -> Vec<Wrinkle> {
    /// Shortest ridge beside the first one, relative to the path.
    const SHORTEST: f64 = 0.35;
    /// Largest change of the distance of ridges over the length of the path, relative to its mean.
    const FAN: f64 = 0.7;
    let mut first = WrinkleProfile::new(path.len(), kind, cell, rng);
    // The gentle slope of the first ridge is outside the bundle.
    first.side = -side;
    let (fan, mut distance, pixel_um) = (random::between(-FAN, FAN, rng), 0.0, cell.pixel_um());
    let mut ridges = Vec::new();
    for _ in 0..BESIDE[0] + random::below(BESIDE[1], rng) {
        distance += side * random::between(APART_UM[0], APART_UM[1], rng) / pixel_um;
        let path = random_part(&beside(&path, distance, fan), random::between(SHORTEST, 1.0, rng), rng);
        let profile = WrinkleProfile::new(path.len(), kind, cell, rng);
        let relative = relative_thickness(profile.width * pixel_um) / relative_thickness(first.width * pixel_um);
        let strength = first.strength * relative * random::between(FAINTER[0], FAINTER[1], rng);
        ridges.push(Wrinkle { path, profile: WrinkleProfile { strength, side, ..profile } });
    }
    ridges.push(Wrinkle { path, profile: first });
    ridges
}

/// Draws random factors with a mean of about 1 and a correlation length of a few micrometres.
fn random_factors(count: usize, rng: &mut Stream) -> Vec<f64> {
    let mut noise = Autoregression::new(MEMORY, 0.35, rng);
    (0..count).map(|_| (0.9 + noise.next(rng)).clamp(0.0, 2.5)).collect()
}

/// Returns the thickness of a ridge of this width relative to that of wide ones.
fn relative_thickness(width_um: f64) -> f64 {
    (width_um / WIDE_UM).min(1.0)
}

/// Extent of a wrinkle to both sides of its crest, relative to its width; the second is that of the slope.
const EXTENT: [f64; 2] = [3.0, 2.2 * SLOPE_WIDTH];

/// Largest number of steps between points that are drawn as one straight segment.
const SEGMENT: usize = 3;

/// Length by which each segment of a wrinkle overlaps the next one, relative to its width: the crest has no gaps in
/// usual bends, and those of the slope are at its faint end.
const OVERLAP: f64 = 0.5;

/// The size, strength and interruptions of a wrinkle.
struct WrinkleProfile {
    /// Standard deviation of the crest in the middle of the wrinkle, px.
    width: f64,
    /// Whether the wrinkle is a pleat.
    pleat: bool,
    /// Thickness added at the crest, relative to a flat sheet.
    strength: f64,
    /// The side of the slope: 1 or −1.
    side: f64,
    /// Fraction of the length over which it rises.
    rise: f64,
    /// Fraction of the length over which it fades.
    fall: f64,
    /// Factor on the strength at each point; those at the ends of segments count. Parts of a wrinkle are faint.
    factors: Vec<f64>,
}

/// A kind of wrinkle.
struct WrinkleKind {
    /// Minimum and maximum of the width of the crest, µm.
    width_um: [f64; 2],
    /// Minimum and maximum of the thickness relative to the wrinkles of the cell, before the reduction of narrow ridges
    /// ([`WIDE_UM`]).
    thickness: [f64; 2],
    /// Whether the wrinkle is a pleat.
    pleat: bool,
}

impl WrinkleProfile {
    /// Draws the profile of a wrinkle with this number of points.
    fn new(points: usize, kind: &WrinkleKind, cell: &CellContext<'_>, rng: &mut Stream) -> Self {
        let factor = if kind.pleat { random::between(PLEAT_WIDTH[0], PLEAT_WIDTH[1], rng) } else { 1.0 };
        let [width_um, thickness] =
            [kind.width_um, kind.thickness].map(|range| random::between(range[0], range[1], rng));
        Self {
            width: factor * width_um / cell.pixel_um(),
            pleat: kind.pleat,
            strength: cell.body.detail.wrinkle_thickness * thickness * relative_thickness(factor * width_um),
            side: if random::chance(0.5, rng) { 1.0 } else { -1.0 },
            rise: random::between(0.05, TAPER, rng),
            fall: random::between(0.2, 1.0 - TAPER, rng),
            factors: random_factors(points, rng),
        }
    }

    /// Adds the wrinkle where the cell covers. `canvas` is zero before and after, with a margin of [`LANES`] values.
    fn draw(&self, path: &[Point], thickness: &mut Tile, coverage: &Tile, canvas: &mut [f32]) {
        let (width, height) = (thickness.width, thickness.height());
        let origin = thickness.origin.map(|at| at as f64);
        // Column range of the wrinkle in each row.
        let mut touched = vec![width..0; height];
        // At least two segments, since the strength is 0 at both ends of the path.
        let last = path.len() - 1;
        let segments = last.div_ceil(SEGMENT).max(2).min(last);
        for segment in 0..segments {
            let ends = [segment, segment + 1].map(|end| end * last / segments);
            let rises = ends.map(|index| {
                let t = index as f64 / last as f64;
                let fade = (t / self.rise).min((1.0 - t) / self.fall).min(1.0);
                fade * (2.0 - fade)
            });
            let strengths = [0, 1].map(|end| self.strength * rises[end] * self.factors[ends[end]]);
            if strengths[0] + strengths[1] > 0.0 {
                let crest_width = self.width * (END_WIDTH + (1.0 - END_WIDTH) * 0.5 * (rises[0] + rises[1]));
                let ends = ends.map(|index| [0, 1].map(|axis| path[index][axis] - origin[axis]));
                paint(&self.segment(ends, crest_width, strengths), canvas, width, &mut touched);
            }
        }
        for (y, columns) in touched.into_iter().enumerate().filter(|(_, columns)| !columns.is_empty()) {
            let row = y * width + columns.start..y * width + columns.end;
            add_and_clear(&mut thickness.values[row.clone()], &coverage.values[row.clone()], &mut canvas[row]);
        }
    }

    /// Returns a segment of the wrinkle between two points of the tile, with the strengths there.
    fn segment(&self, [a, b]: [Point; 2], width: f64, strengths: [f64; 2]) -> Segment {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = (dx * dx + dy * dy).sqrt().max(f64::MIN_POSITIVE);
        let along = [dx / length, dy / length];
        Segment {
            from: a,
            along,
            off: [-self.side * along[1], self.side * along[0]],
            range: [[-OVERLAP * width, length + OVERLAP * width], [-EXTENT[0] * width, EXTENT[1] * width]],
            strengths,
            per_length: 1.0 / length,
            per_width: 1.0 / width,
            crest: if self.pleat { PLEAT } else { RIDGE },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::segment::SLOPE;
    use super::*;

    fn profile(width: f64, side: f64, pleat: bool) -> WrinkleProfile {
        WrinkleProfile { width, pleat, strength: 1.0, side, rise: 0.1, fall: 0.1, factors: vec![1.0; 40] }
    }

    #[test]
    fn narrow_ridges_are_thinner() {
        assert_eq!([0.3, 0.6, 1.2].map(relative_thickness), [0.5, 1.0, 1.0]);
    }

    #[test]
    fn a_segment_matches_its_profile() {
        let (width, height) = (90, 70);
        let cases = [(1.0, 0.3), (-1.0, 2.0), (1.0, 0.0), (-1.0, -core::f64::consts::FRAC_PI_2)];
        for ((side, direction), pleat) in cases.into_iter().zip([false, true, true, false]) {
            let along = [libm::cos(direction), libm::sin(direction)];
            let [a, length] = [[40.3, 33.8], [7.0, 7.0]];
            let ends = [a, [a[0] + length[0] * along[0], a[1] + length[1] * along[1]]];
            let segment = profile(9.0, side, pleat).segment(ends, 2.3, [0.8, 1.5]);
            let mut canvas = vec![0.0; width * height + LANES];
            let mut touched = vec![width..0; height];
            paint(&segment, &mut canvas, width, &mut touched);
            let mut painted = 0_usize;
            for (index, value) in canvas[..width * height].iter().enumerate() {
                let p = [(index % width) as f64 - a[0], (index / width) as f64 - a[1]];
                let on = p[0] * along[0] + p[1] * along[1];
                let off = side * (p[1] * along[0] - p[0] * along[1]);
                let inside = (-1.15..=8.15).contains(&on) && (-6.9..=20.24).contains(&off);
                let square = off * off / (2.3 * 2.3);
                let fall = libm::exp(if pleat { -0.3 * square * square } else { -0.5 * square });
                let slope = if off > 0.0 { SLOPE * (libm::exp(-off / (SLOPE_WIDTH * 2.3)) - fall) } else { 0.0 };
                let crest = fall * if pleat { 0.55 + 0.9 * square } else { 1.0 };
                let expected = if inside { (0.8 + 0.1 * on).clamp(0.8, 1.5) * (crest + slope) } else { 0.0 };
                assert!((f64::from(*value) - expected).abs() < 1e-5, "{direction}: {p:?} {value} {expected}");
                painted += usize::from(inside);
                assert!(!inside || touched[index / width].contains(&(index % width)), "{touched:?} {index}");
            }
            // The area of the rectangle: 9.3 × 27.1.
            assert!((240..=265).contains(&painted), "{painted}");
        }
    }

    #[test]
    fn the_rim_is_smooth_along_a_rolled_stretch() {
        let path = (0..40).map(|i| [f64::from(i), 0.0]).collect();
        let wrinkles =
            Wrinkles { rolled: vec![Wrinkle { path, profile: profile(2.0, 1.0, false) }], others: Vec::new() };
        let roughness = |x: f64, y: f64| wrinkles.roughness([x, y], 0.5);
        assert!(roughness(20.0, 2.0) == roughness(8.0, 1.0) && roughness(20.0, 2.0) < 0.2);
        assert!(roughness(20.0, 2.0) < roughness(45.0, 1.0) && roughness(45.0, 1.0) < 1.0);
        assert_eq!(roughness(60.0, 0.0), 1.0);
    }

    #[test]
    fn a_wrinkle_is_as_strong_as_its_factors_at_the_ends_of_segments() {
        for points in [3_usize, 4, 5, 8, 24] {
            let mut profile = profile(2.0, 1.0, false);
            profile.factors = (0..points).map(|i| if i < points / 2 { 0.3 } else { 1.5 }).collect();
            // Points two pixels apart along row 20, from column 20 on.
            let path: Vec<Point> = (0..points).map(|i| [20.0 + 2.0 * i as f64, 20.0]).collect();
            let tile = Tile { origin: [0, 0], width: 100, values: vec![1.0; 100 * 40] };
            let mut drawn = Tile { values: vec![0.0; 100 * 40], ..tile.clone() };
            profile.draw(&path, &mut drawn, &tile, &mut vec![0.0; 100 * 40 + LANES]);
            let strongest = drawn.values.iter().copied().fold(0.0, f32::max);
            assert!(strongest > 0.25 && strongest <= 1.5, "{points}: {strongest}");
            // The first quarter of a long path is as faint as its factors.
            let first = (0..100).map(|i| drawn.values[20 * 100 + i]).take(20 + points / 2);
            assert!(points < 24 || first.fold(0.0, f32::max) <= 0.3, "{points}");
        }
    }

    #[test]
    fn parts_outside_the_tile_are_ignored() {
        let profile = profile(2.0, 1.0, false);
        let path: Vec<Point> = (0..40).map(|i| [f64::from(i) - 15.0, 0.4 * f64::from(i) - 9.0]).collect();
        let tile = Tile { origin: [-5, -3], width: 12, values: vec![1.0; 12 * 9] };
        let (mut drawn, mut canvas) = (tile.clone(), vec![0.0; 12 * 9 + LANES]);
        profile.draw(&path, &mut drawn, &tile, &mut canvas);
        assert!(canvas.iter().all(|v| *v == 0.0));
        assert!(drawn.values.iter().any(|v| *v > 1.5) && drawn.values.iter().all(|v| (1.0..=2.0).contains(v)));
        let mut bare = tile.clone();
        profile.draw(&path, &mut bare, &tile.blank(), &mut canvas);
        assert_eq!(bare, tile);
    }
}
