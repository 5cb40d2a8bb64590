use crate::diagram::Diagram;
use crate::geometry::{Point, length, sub};

/// Where a river ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mouth {
    /// On the border of the window, or where the height reaches zero: the outline.
    Border,
    /// In a river of another tree, of which it becomes part.
    Confluence,
}

/// A line that runs down along the edges of a diagram, from a spring or from a branching to its mouth.
#[derive(Debug, Clone, PartialEq)]
pub struct River {
    /// Its points, from the highest to the lowest: two or more.
    pub points: Vec<Point>,
    /// The height of each point over the largest height of the diagram: strictly falling, 1 to 0.
    pub heights: Vec<f64>,
    /// Where it ends.
    pub mouth: Mouth,
}

impl River {
    /// Its length.
    pub fn length(&self) -> f64 {
        self.points.windows(2).map(|pair| length(sub(pair[1], pair[0]))).sum()
    }
}

/// Edges that leave a vertex of the diagram: three cells meet in it.
pub(crate) const DEGREE: usize = 3;

/// The landscape in which rivers run: heights at vertices, ways between them, and which tree holds which vertex.
pub(crate) struct Landscape<H> {
    net: Net,
    height: H,
    heights: Vec<f64>,
    highest: f64,
    /// Which vertices hang together (union-find), and which are part of a river.
    parents: Vec<usize>,
    taken: Vec<bool>,
}

/// The vertices of a diagram in a window, and which of them an edge joins.
pub(crate) struct Net {
    pub(crate) vertices: Vec<Point>,
    /// Number of vertices inside the window; those on its border, or beyond, follow.
    pub(crate) inner: usize,
    /// Neighbours of each vertex along the edges inside the window; filled from the front.
    pub(crate) ways: Vec<[Option<u32>; DEGREE]>,
}

impl Net {
    pub(crate) fn of(diagram: &Diagram) -> Self {
        let vertices = diagram.vertices.clone();
        let mut ways = vec![[None; DEGREE]; vertices.len()];
        for [a, b] in diagram.edges.iter().filter(|edge| edge.neighbour.is_some()).map(|edge| edge.ends) {
            for (from, to) in [(a, b), (b, a)] {
                if let Some(free) = ways[from].iter_mut().find(|way| way.is_none()) {
                    *free = u32::try_from(to).ok();
                }
            }
        }
        Self { vertices, inner: diagram.inner, ways }
    }
}

impl<H: Fn(Point) -> f64> Landscape<H> {
    /// A landscape on a net of the given height, which `heights` are at its vertices.
    pub(crate) fn new(net: Net, height: H, heights: Vec<f64>) -> Self {
        let highest = heights.iter().copied().fold(0.0, f64::max);
        let (parents, taken) = ((0..heights.len()).collect(), vec![false; heights.len()]);
        Self { net, height, heights, highest, parents, taken }
    }

    /// The vertices inside the window that lie above zero, and at least at a share of the largest height.
    pub(crate) fn springs(&self, share: f64) -> Vec<usize> {
        let lowest = share * self.highest;
        (0..self.net.inner).filter(|&vertex| self.heights[vertex] > 0.0 && self.heights[vertex] >= lowest).collect()
    }

    /// Runs a river from a spring, and its branches. `branches` is asked once for every vertex of a river but its last.
    pub(crate) fn run(&mut self, spring: usize, branches: &mut impl FnMut() -> bool, rivers: &mut Vec<River>) {
        if self.taken[spring] {
            return;
        }
        let mut starts = vec![(spring, None)];
        while let Some((start, first)) = starts.pop() {
            let Some((course, mouth)) = self.descend(start, first) else { continue };
            for pair in course.windows(2) {
                self.join(pair[0], pair[1]);
            }
            for pair in course.windows(2) {
                if branches() {
                    let others = self.below(pair[0]).filter(|&way| way != pair[1]);
                    starts.extend(others.map(|way| (pair[0], Some(way))));
                }
            }
            rivers.push(self.river(&course, mouth));
        }
    }

    /// Neighbours lower than a vertex.
    fn below(&self, vertex: usize) -> impl Iterator<Item = usize> + '_ {
        self.net.ways[vertex]
            .iter()
            .flatten()
            .map(|&way| way as usize)
            .filter(move |&way| self.heights[way] < self.heights[vertex])
    }

    /// The way of steepest descent from `start`, by way of `first` if there is one. None if it ends in a pit or cannot
    /// but run back into its own tree.
    fn descend(&self, start: usize, first: Option<usize>) -> Option<(Vec<usize>, Mouth)> {
        let tree = self.root(start);
        let open = |way: usize| self.root(way) != tree;
        let mut vertices = vec![start];
        let mut vertex = start;
        let mut next = first.filter(|&way| open(way));
        loop {
            let way = match next.take() {
                Some(way) => way,
                None if vertex == start && first.is_some() => return None,
                None => self
                    .below(vertex)
                    .filter(|&way| open(way))
                    .max_by(|&a, &b| self.slope(vertex, a).total_cmp(&self.slope(vertex, b)))?,
            };
            vertices.push(way);
            if self.heights[way] <= 0.0 || way >= self.net.inner {
                return Some((vertices, Mouth::Border));
            }
            if self.taken[way] {
                return Some((vertices, Mouth::Confluence));
            }
            vertex = way;
        }
    }

    fn slope(&self, from: usize, to: usize) -> f64 {
        let [a, b] = [from, to].map(|vertex| self.net.vertices[vertex]);
        (self.heights[from] - self.heights[to]) / length(sub(b, a))
    }

    fn river(&self, course: &[usize], mouth: Mouth) -> River {
        let mut points: Vec<Point> = course.iter().map(|&vertex| self.net.vertices[vertex]).collect();
        let mut heights: Vec<f64> = course.iter().map(|&vertex| self.heights[vertex] / self.highest).collect();
        // The last edge ends where the height does.
        if let ([.., above, below], [.., from, to]) = (&mut points[..], &mut heights[..])
            && *to < 0.0
        {
            *below = self.shore(*above, *below, *from * self.highest, *to * self.highest);
            *to = 0.0;
        }
        River { points, heights, mouth }
    }

    /// The point of height zero between one above and one below it: false position with the Illinois rule.
    fn shore(&self, above: Point, below: Point, mut from: f64, mut to: f64) -> Point {
        /// Enough for full precision where the height is smooth; each at least halves the range every other time.
        const STEPS: usize = 40;
        let at = |t: f64| [0, 1].map(|axis| above[axis] + t * (below[axis] - above[axis]));
        let precision = self.highest * f64::EPSILON * 16.0;
        let (mut high, mut low) = (0.0, 1.0);
        let mut last = 0.0;
        for _ in 0..STEPS {
            let t = high + (low - high) * from / (from - to);
            let height = (self.height)(at(t));
            if height.abs() <= precision {
                return at(t);
            }
            if height > 0.0 {
                (high, from) = (t, height);
                if last > 0.0 {
                    to /= 2.0;
                }
            } else {
                (low, to) = (t, height);
                if last < 0.0 {
                    from /= 2.0;
                }
            }
            last = height;
        }
        at(low)
    }

    fn root(&self, mut vertex: usize) -> usize {
        while self.parents[vertex] != vertex {
            vertex = self.parents[vertex];
        }
        vertex
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a_root, b_root) = (self.root(a), self.root(b));
        // Every vertex that joins finds its root at once: chains stay short.
        self.parents[b_root] = a_root;
        self.parents[b] = a_root;
        self.taken[a] = true;
        self.taken[b] = true;
    }
}
