use crate::error::{Error, require_coordinates};
use crate::geometry::{Moments, Point, bounds, dot, length, single, sub};

/// Distances from a closed polygon: the paper's "radial distance transform … from the edge".
///
/// Segments are grouped into blocks. The chord of a block and its maximum deviation from the chord bound the distance
/// so closely that only one or two blocks are evaluated for a point. The y range of a block determines whether it can
/// contain a crossing.
#[derive(Debug)]
pub(crate) struct Outline {
    /// Origin and unit of the single-precision distances to chords: centre and diagonal of the bounding box.
    centre: Point,
    size: f64,
    blocks: Vec<Block>,
    groups: Vec<Group>,
}

/// Segments of a block, one in each vector lane.
const LANES: usize = 8;

type Lanes = [f64; LANES];

/// Blocks of a group, one in each vector lane.
const CHORDS: usize = 16;

type Chords = [f32; CHORDS];

/// Margin for rounding errors of single precision, relative to the lengths.
const SLACK: f64 = 1e-5;

/// Segments from a to b = a + d.
#[derive(Debug)]
struct Block {
    ax: Lanes,
    ay: Lanes,
    dx: Lanes,
    dy: Lanes,
    by: Lanes,
    /// 1 / d², or 0 for a point.
    inverse: Lanes,
    /// dx / dy, or 0 for a horizontal segment.
    slope: Lanes,
}

/// Bounds of several blocks.
#[derive(Debug)]
struct Group {
    /// Start and vector of the chord, and 1 / squared length, or 0.
    start: [Chords; 2],
    along: [Chords; 2],
    inverse: Chords,
    /// Maximum distance of the block from its chord.
    bulge: Chords,
    /// Range of y.
    low: Chords,
    high: Chords,
}

impl Outline {
    pub(crate) fn new(points: &[Point]) -> Result<Self, Error> {
        require_coordinates("outline point", points)?;
        let area = points.first().map_or(0.0, |&about| Moments::of(points.iter().copied(), about).area);
        if points.len() < 3 || area == 0.0 {
            return Err(Error::Flat { what: "outline", count: points.len(), area });
        }
        // The points of a block and the first of the next; an incomplete block repeats its last point.
        let chains: Vec<[Point; LANES + 1]> = (0..points.len())
            .step_by(LANES)
            .map(|first| {
                let last = (first + LANES).min(points.len());
                core::array::from_fn(|i| points[(first + i).min(last) % points.len()])
            })
            .collect();
        let [low, high] = bounds(points);
        let centre = [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0];
        let size = length(sub(high, low));
        Ok(Self {
            centre,
            size,
            blocks: chains.iter().map(Block::new).collect(),
            groups: chains.chunks(CHORDS).map(|chains| Group::new(chains, centre, size)).collect(),
        })
    }

    /// Returns the distance to the polygon, positive inside (by the even-odd rule) and negative outside.
    pub(crate) fn height(&self, point: Point) -> f64 {
        self.heights(&[point])[0]
    }

    pub(crate) fn heights(&self, points: &[Point]) -> Vec<f64> {
        let mut heights = vec![0.0; points.len()];
        measure(self, points, &mut heights);
        heights
    }
}

#[multiversion::multiversion(targets = "simd")]
fn measure(outline: &Outline, points: &[Point], heights: &mut [f64]) {
    let Outline { centre, size, blocks, groups } = outline;
    let mut distances = vec![[0.0; CHORDS]; groups.len()];
    for (&point, height) in points.iter().zip(heights) {
        let [x, y] = sub(point, *centre).map(|way| way / size);
        let place = [single(x), single(y)];
        let mut bounds = [f32::INFINITY; CHORDS];
        for (group, distance) in groups.iter().zip(&mut distances) {
            *distance = group.distances(place);
            for (i, bound) in bounds.iter_mut().enumerate() {
                let most = distance[i] + group.bulge[i];
                *bound = if most < *bound { most } else { *bound };
            }
        }
        let slack = single(SLACK * (1.0 + x.abs() + y.abs()));
        let bound = slack + bounds.into_iter().fold(f32::INFINITY, |a, b| if b < a { b } else { a });

        let mut nearest = [f64::INFINITY; LANES];
        let mut inside = false;
        for ((group, distance), blocks) in groups.iter().zip(&distances).zip(blocks.chunks(CHORDS)) {
            let near = bits(|i| distance[i] - group.bulge[i] <= bound);
            let level = bits(|i| (group.low[i] - slack <= place[1]) & (place[1] <= group.high[i] + slack));
            for i in ones(near) {
                nearest = smaller(nearest, blocks[i].distance2(point));
            }
            for i in ones(level) {
                inside ^= blocks[i].crosses(point);
            }
        }
        let distance = nearest.into_iter().fold(f64::INFINITY, |a, b| if b < a { b } else { a }).sqrt();
        *height = if inside { distance } else { -distance };
    }
}

#[inline(always)]
fn smaller(a: Lanes, b: Lanes) -> Lanes {
    core::array::from_fn(|i| if b[i] < a[i] { b[i] } else { a[i] })
}

/// Packs flags into the bits of a number.
#[inline(always)]
fn bits(flag: impl Fn(usize) -> bool) -> u32 {
    let mut bits = 0;
    for i in 0..CHORDS {
        bits |= u32::from(flag(i)) << i;
    }
    bits
}

/// Returns the indices of the bits that are 1. There are few, and this loop has no branch for the others.
#[inline(always)]
fn ones(mut bits: u32) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let next = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (next < CHORDS).then_some(next)
    })
}

impl Block {
    fn new(chain: &[Point; LANES + 1]) -> Self {
        let d: [Point; LANES] = core::array::from_fn(|i| sub(chain[i + 1], chain[i]));
        Self {
            ax: core::array::from_fn(|i| chain[i][0]),
            ay: core::array::from_fn(|i| chain[i][1]),
            dx: d.map(|d| d[0]),
            dy: d.map(|d| d[1]),
            by: core::array::from_fn(|i| chain[i + 1][1]),
            inverse: d.map(|d| {
                let square = dot(d, d);
                if square > 0.0 { 1.0 / square } else { 0.0 }
            }),
            slope: d.map(|d| if d[1] == 0.0 { 0.0 } else { d[0] / d[1] }),
        }
    }

    /// Returns the squared distance to each segment.
    #[inline(always)]
    fn distance2(&self, point: Point) -> Lanes {
        core::array::from_fn(|i| {
            let (px, py) = (point[0] - self.ax[i], point[1] - self.ay[i]);
            let along = (px * self.dx[i] + py * self.dy[i]) * self.inverse[i];
            let along = along.clamp(0.0, 1.0);
            let (ex, ey) = (px - along * self.dx[i], py - along * self.dy[i]);
            ex * ex + ey * ey
        })
    }

    /// Returns whether an odd number of segments crosses the ray from `point` to the right.
    #[inline(always)]
    fn crosses(&self, point: Point) -> bool {
        let mut crossings = 0;
        for i in 0..LANES {
            let spans = (self.ay[i] <= point[1]) != (self.by[i] <= point[1]);
            let x = self.ax[i] + (point[1] - self.ay[i]) * self.slope[i];
            crossings += u64::from(spans & (point[0] < x));
        }
        crossings % 2 == 1
    }
}

impl Group {
    /// Creates a group; an incomplete group is filled with blocks far from all points.
    fn new(chains: &[[Point; LANES + 1]], centre: Point, size: f64) -> Self {
        let mut group = Self {
            start: [[0.0; CHORDS]; 2],
            along: [[0.0; CHORDS]; 2],
            inverse: [0.0; CHORDS],
            bulge: [0.0; CHORDS],
            low: [f32::INFINITY; CHORDS],
            high: [f32::NEG_INFINITY; CHORDS],
        };
        group.start[0][chains.len()..].fill(1e15);
        for (i, chain) in chains.iter().enumerate() {
            let chain = chain.map(|point| sub(point, centre).map(|way| way / size));
            let chord = sub(chain[LANES], chain[0]);
            let square = dot(chord, chord);
            // A very short chord counts as a point.
            let inverse = if square > SLACK * SLACK { 1.0 / square } else { 0.0 };
            let beside = |point: &Point| {
                let way = sub(*point, chain[0]);
                let t = (dot(way, chord) * inverse).clamp(0.0, 1.0);
                length([way[0] - t * chord[0], way[1] - t * chord[1]])
            };
            let bulge = chain.iter().map(beside).fold(0.0, f64::max);
            for axis in 0..2 {
                group.start[axis][i] = single(chain[0][axis]);
                group.along[axis][i] = single(chord[axis]);
            }
            group.inverse[i] = single(inverse);
            group.bulge[i] = single(bulge);
            let levels = chain.iter().map(|point| single(point[1]));
            group.low[i] = levels.clone().fold(f32::INFINITY, f32::min);
            group.high[i] = levels.fold(f32::NEG_INFINITY, f32::max);
        }
        group
    }

    #[inline(always)]
    fn distances(&self, point: [f32; 2]) -> Chords {
        let mut distances = [0.0; CHORDS];
        for (i, distance) in distances.iter_mut().enumerate() {
            let (x, y) = (point[0] - self.start[0][i], point[1] - self.start[1][i]);
            let t = ((x * self.along[0][i] + y * self.along[1][i]) * self.inverse[i]).clamp(0.0, 1.0);
            let (x, y) = (x - t * self.along[0][i], y - t * self.along[1][i]);
            *distance = (x * x + y * y).sqrt();
        }
        distances
    }
}

#[cfg(test)]
mod tests;
