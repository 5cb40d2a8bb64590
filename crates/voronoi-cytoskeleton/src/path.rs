use crate::diagram::Diagram;
use crate::geometry::{Point, length, sub};

/// The end of a [`DescentPath`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PathEnd {
    /// On the border of the window, or where the height is 0: the outline.
    Border,
    /// On a path of another tree, which it joins.
    Junction,
}

/// A path of steepest descent along the edges of a diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct DescentPath {
    /// Two or more points, from the highest to the lowest.
    pub points: Vec<Point>,
    /// Height of each point relative to the largest height of the diagram: strictly descending, 1 to 0.
    pub heights: Vec<f64>,
    /// The kind of its end.
    pub end: PathEnd,
}

impl DescentPath {
    /// Returns the length.
    pub fn length(&self) -> f64 {
        self.points.windows(2).map(|pair| length(sub(pair[1], pair[0]))).sum()
    }
}

/// Number of edges at a vertex of the diagram, which is adjacent to three cells.
pub(crate) const DEGREE: usize = 3;

/// Heights at the vertices of a graph, and the trees of descent paths on it.
pub(crate) struct HeightField<H> {
    graph: Graph,
    height: H,
    heights: Vec<f64>,
    highest: f64,
    /// Trees of vertices (union-find), and which vertices are part of a path.
    parents: Vec<usize>,
    on_path: Vec<bool>,
}

/// The graph of the vertices and edges of a diagram in a window.
pub(crate) struct Graph {
    pub(crate) vertices: Vec<Point>,
    /// Number of vertices inside the window; those on its border or beyond come after.
    pub(crate) inner: usize,
    /// Neighbours of each vertex along the edges inside the window; filled from the front.
    pub(crate) neighbours: Vec<[Option<u32>; DEGREE]>,
}

impl Graph {
    pub(crate) fn of(diagram: &Diagram) -> Self {
        let vertices = diagram.vertices.clone();
        let mut neighbours = vec![[None; DEGREE]; vertices.len()];
        for [a, b] in diagram.edges.iter().filter(|edge| edge.neighbour.is_some()).map(|edge| edge.ends) {
            for (from, to) in [(a, b), (b, a)] {
                if let Some(free) = neighbours[from].iter_mut().find(|way| way.is_none()) {
                    *free = u32::try_from(to).ok();
                }
            }
        }
        Self { vertices, inner: diagram.inner, neighbours }
    }
}

impl<H: Fn(Point) -> f64> HeightField<H> {
    /// Creates a height field on a graph; `heights` are the heights at its vertices.
    pub(crate) fn new(graph: Graph, height: H, heights: Vec<f64>) -> Self {
        let highest = heights.iter().copied().fold(0.0, f64::max);
        let (parents, on_path) = ((0..heights.len()).collect(), vec![false; heights.len()]);
        Self { graph, height, heights, highest, parents, on_path }
    }

    /// Returns the vertices inside the window with a height above 0 and of at least a fraction of the largest height.
    pub(crate) fn start_vertices(&self, fraction: f64) -> Vec<usize> {
        let lowest = fraction * self.highest;
        (0..self.graph.inner).filter(|&vertex| self.heights[vertex] > 0.0 && self.heights[vertex] >= lowest).collect()
    }

    /// Computes a path from a start vertex, and its branches. `branches` is called once for every vertex of a path but
    /// the last.
    pub(crate) fn run(
        &mut self,
        start_vertex: usize,
        branches: &mut impl FnMut() -> bool,
        paths: &mut Vec<DescentPath>,
    ) {
        if self.on_path[start_vertex] {
            return;
        }
        let mut starts = vec![(start_vertex, None)];
        while let Some((start, first)) = starts.pop() {
            let Some((vertices, end)) = self.descend(start, first) else { continue };
            for pair in vertices.windows(2) {
                self.join(pair[0], pair[1]);
            }
            for pair in vertices.windows(2) {
                if branches() {
                    let others = self.below(pair[0]).filter(|&way| way != pair[1]);
                    starts.extend(others.map(|way| (pair[0], Some(way))));
                }
            }
            paths.push(self.path(&vertices, end));
        }
    }

    /// Returns the neighbours lower than a vertex.
    fn below(&self, vertex: usize) -> impl Iterator<Item = usize> + '_ {
        self.graph.neighbours[vertex]
            .iter()
            .flatten()
            .map(|&way| way as usize)
            .filter(move |&way| self.heights[way] < self.heights[vertex])
    }

    /// Returns the path of steepest descent from `start`, with the second vertex `first` if given. None if it ends in a
    /// local minimum or can only return to its own tree.
    fn descend(&self, start: usize, first: Option<usize>) -> Option<(Vec<usize>, PathEnd)> {
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
            if self.heights[way] <= 0.0 || way >= self.graph.inner {
                return Some((vertices, PathEnd::Border));
            }
            if self.on_path[way] {
                return Some((vertices, PathEnd::Junction));
            }
            vertex = way;
        }
    }

    fn slope(&self, from: usize, to: usize) -> f64 {
        let [a, b] = [from, to].map(|vertex| self.graph.vertices[vertex]);
        (self.heights[from] - self.heights[to]) / length(sub(b, a))
    }

    fn path(&self, vertices: &[usize], end: PathEnd) -> DescentPath {
        let mut points: Vec<Point> = vertices.iter().map(|&vertex| self.graph.vertices[vertex]).collect();
        let mut heights: Vec<f64> = vertices.iter().map(|&vertex| self.heights[vertex] / self.highest).collect();
        // The last edge ends at height 0.
        if let ([.., above, below], [.., from, to]) = (&mut points[..], &mut heights[..])
            && *to < 0.0
        {
            *below = self.zero_crossing(*above, *below, *from * self.highest, *to * self.highest);
            *to = 0.0;
        }
        DescentPath { points, heights, end }
    }

    /// Returns the point of height 0 between a point above and one below 0: regula falsi with the Illinois rule.
    fn zero_crossing(&self, above: Point, below: Point, mut from: f64, mut to: f64) -> Point {
        /// Sufficient for full precision of a smooth height; at least every second step halves the range.
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
        // Point `b` directly to the root, so that chains stay short.
        self.parents[b_root] = a_root;
        self.parents[b] = a_root;
        self.on_path[a] = true;
        self.on_path[b] = true;
    }
}
