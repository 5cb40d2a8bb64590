use crate::error::{Error, require_coordinates};
use crate::geometry::{Moments, Point, dot, length, sub};

/// A closed polygon, ready for distances: the paper's "radial distance transform … from the edge".
///
/// Its segments stand in blocks, each with the circle and the band of y around it, so that a point looks closely only at
/// blocks that may hold the nearest segment or a crossing.
#[derive(Debug)]
pub(crate) struct Outline {
    blocks: Vec<Block>,
    groups: Vec<Group>,
}

/// Segments in a block, and blocks in a group: what is worked on side by side.
const LANES: usize = 8;

type Lanes = [f64; LANES];

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
    /// dx / dy, or 0 for a level segment.
    slope: Lanes,
}

/// What bounds each of some blocks.
#[derive(Debug)]
struct Group {
    /// A point of the outline.
    start: [Lanes; 2],
    /// The circle around the block.
    centre: [Lanes; 2],
    radius: Lanes,
    /// The values of y that it spans.
    low: Lanes,
    high: Lanes,
}

impl Outline {
    pub(crate) fn new(points: &[Point]) -> Result<Self, Error> {
        require_coordinates("outline point", points)?;
        let area = points.first().map_or(0.0, |&about| Moments::of(points.iter().copied(), about).area);
        if points.len() < 3 || area == 0.0 {
            return Err(Error::Flat { what: "outline", count: points.len(), area });
        }
        // The points of a block and the first of the next; a block that is not full repeats its end.
        let chains: Vec<[Point; LANES + 1]> = (0..points.len())
            .step_by(LANES)
            .map(|first| {
                let last = (first + LANES).min(points.len());
                core::array::from_fn(|i| points[(first + i).min(last) % points.len()])
            })
            .collect();
        Ok(Self {
            blocks: chains.iter().map(Block::new).collect(),
            groups: chains.chunks(LANES).map(Group::new).collect(),
        })
    }

    /// Distance to the polygon, positive inside (by the even-odd rule) and negative outside.
    pub(crate) fn height(&self, point: Point) -> f64 {
        height(&self.groups, &self.blocks, point)
    }
}

#[multiversion::multiversion(targets = "simd")]
fn height(groups: &[Group], blocks: &[Block], point: Point) -> f64 {
    let mut bounds = [f64::INFINITY; LANES];
    for group in groups {
        bounds = smaller(bounds, squares(group.start, point));
    }
    let bound = smallest(bounds).sqrt();

    let mut nearest = [f64::INFINITY; LANES];
    let mut inside = false;
    for (group, blocks) in groups.iter().zip(blocks.chunks(LANES)) {
        let distance2 = squares(group.centre, point);
        let near: [bool; LANES] = core::array::from_fn(|i| {
            let reach = bound + group.radius[i];
            distance2[i] <= reach * reach
        });
        let level: [bool; LANES] = core::array::from_fn(|i| (group.low[i] <= point[1]) & (point[1] < group.high[i]));
        for i in set(near) {
            nearest = smaller(nearest, blocks[i].distance2(point));
        }
        for i in set(level) {
            inside ^= blocks[i].crosses(point);
        }
    }
    let distance = smallest(nearest).sqrt();
    if inside { distance } else { -distance }
}

#[inline(always)]
fn squares(places: [Lanes; 2], point: Point) -> Lanes {
    core::array::from_fn(|i| {
        let (dx, dy) = (places[0][i] - point[0], places[1][i] - point[1]);
        dx * dx + dy * dy
    })
}

#[inline(always)]
fn smaller(a: Lanes, b: Lanes) -> Lanes {
    core::array::from_fn(|i| if b[i] < a[i] { b[i] } else { a[i] })
}

#[inline(always)]
fn smallest(lanes: Lanes) -> f64 {
    lanes.into_iter().fold(f64::INFINITY, |a, b| if b < a { b } else { a })
}

/// The indices of flags that are set. Few are, and a walk over bits has no branch to guess for the others.
#[inline(always)]
fn set(flags: [bool; LANES]) -> impl Iterator<Item = usize> {
    let mut bits = 0u32;
    for (i, flag) in flags.into_iter().enumerate() {
        bits |= u32::from(flag) << i;
    }
    core::iter::from_fn(move || {
        let next = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (next < LANES).then_some(next)
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

    /// Squared distance to each segment.
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

    /// Whether an odd number of segments crosses the ray from `point` to the right.
    #[inline(always)]
    fn crosses(&self, point: Point) -> bool {
        let crossed: [bool; LANES] = core::array::from_fn(|i| {
            let spans = (self.ay[i] <= point[1]) != (self.by[i] <= point[1]);
            let x = self.ax[i] + (point[1] - self.ay[i]) * self.slope[i];
            spans & (point[0] < x)
        });
        crossed.into_iter().fold(false, |odd, crossed| odd ^ crossed)
    }
}

impl Group {
    /// A group that is not full ends in blocks that no point is near.
    fn new(chains: &[[Point; LANES + 1]]) -> Self {
        let mut group = Self {
            start: [[f64::INFINITY; LANES]; 2],
            centre: [[f64::INFINITY; LANES]; 2],
            radius: [0.0; LANES],
            low: [f64::INFINITY; LANES],
            high: [f64::NEG_INFINITY; LANES],
        };
        for (i, chain) in chains.iter().enumerate() {
            let [[left, right], [low, high]] = [0, 1].map(|axis| {
                let values = chain.iter().map(|point| point[axis]);
                [values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max)]
            });
            for (start, from) in group.start.iter_mut().zip(chain[0]) {
                start[i] = from;
            }
            group.centre[0][i] = (left + right) / 2.0;
            group.centre[1][i] = (low + high) / 2.0;
            group.radius[i] = length([right - left, high - low]) / 2.0;
            (group.low[i], group.high[i]) = (low, high);
        }
        group
    }
}

#[cfg(test)]
mod tests;
