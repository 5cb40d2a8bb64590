//! Clipped Voronoi diagrams.
//!
//! Every Voronoi edge is clipped against the window and stored under the index of its Delaunay edge. A cell is then a
//! walk around its site: neighbouring edges share a vertex, or are connected along the border.

use crate::error::{Error, require_coordinates};
use crate::geometry::{Moments, Point, along, dot, sub};
use crate::window::Window;
use spade::handles::DirectedEdgeHandle;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

/// An edge of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    /// The two vertices; `cell` is on the left of the edge if y points up, and on the right if y points down.
    pub ends: [usize; 2],
    /// The cell on that side.
    pub cell: usize,
    /// The cell on the other side; none on the border of the window.
    pub neighbour: Option<usize>,
}

/// The Voronoi diagram of sites in a convex window.
///
/// Cells have the indices of their sites and fill the window: their areas sum to its area, and vertices − edges + cells
/// = 1.
#[derive(Debug, Clone)]
pub struct Diagram {
    pub(crate) window: Window,
    pub(crate) sites: Vec<Point>,
    pub(crate) vertices: Vec<Point>,
    pub(crate) inner: usize,
    pub(crate) edges: Vec<Edge>,
    pub(crate) cell_ends: Vec<usize>,
    pub(crate) cell_vertices: Vec<usize>,
}

impl Diagram {
    /// Computes the diagram of `sites` in `window`.
    ///
    /// # Errors
    /// [`Error::Sites`] without sites or if sites coincide, [`Error::SiteOutside`], [`Error::Coordinate`].
    pub fn new(sites: &[Point], window: &Window) -> Result<Self, Error> {
        require_coordinates("site", sites)?;
        if let Some(index) = sites.iter().position(|&site| !window.contains(site)) {
            return Err(Error::SiteOutside { index, point: sites[index] });
        }
        build(sites.to_vec(), window.clone())
    }

    /// Moves every site to the centroid of its cell: one pass of Lloyd's algorithm
    /// ([doi:10.1137/S0036144599352836](https://doi.org/10.1137/S0036144599352836), the paper's reference 27).
    ///
    /// # Differences from the paper
    /// The centroids are exact; the released program estimates them from 2000 random points.
    pub fn relax(&mut self) {
        let centroids = (0..self.sites.len())
            .map(|cell| {
                let site = self.sites[cell];
                let Moments { area, first, .. } = self.moments(cell);
                let centroid = [site[0] + first[0] / area, site[1] + first[1] / area];
                // A cell too thin for an accurate centroid keeps its site.
                if self.window.contains(centroid) { centroid } else { site }
            })
            .collect();
        // Cells are disjoint and convex, so that centroids differ; if two coincide by rounding, the diagram is kept.
        if let Ok(relaxed) = build(centroids, self.window.clone()) {
            *self = relaxed;
        }
    }

    /// Returns the window.
    pub fn window(&self) -> &Window {
        &self.window
    }

    /// Returns the sites.
    pub fn sites(&self) -> &[Point] {
        &self.sites
    }

    /// Returns the vertices: first those inside the window, where three cells meet, then those on its border.
    pub fn vertices(&self) -> &[Point] {
        &self.vertices
    }

    /// Returns whether a vertex is on the border of the window.
    pub fn is_on_border(&self, vertex: usize) -> bool {
        vertex >= self.inner
    }

    /// Returns the edges: first those between two cells, then those on the border of the window.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Returns the vertices around a cell, oriented from x towards y.
    ///
    /// # Panics
    /// If `cell` is out of range.
    pub fn cell(&self, cell: usize) -> &[usize] {
        let start = cell.checked_sub(1).map_or(0, |last| self.cell_ends[last]);
        &self.cell_vertices[start..self.cell_ends[cell]]
    }

    /// Returns the corners of a cell, oriented from x towards y.
    ///
    /// # Panics
    /// If `cell` is out of range.
    pub fn corners(&self, cell: usize) -> impl DoubleEndedIterator<Item = Point> + ExactSizeIterator + Clone {
        self.cell(cell).iter().map(|&vertex| self.vertices[vertex])
    }

    /// Returns the area of a cell.
    ///
    /// # Panics
    /// If `cell` is out of range.
    pub fn area(&self, cell: usize) -> f64 {
        self.moments(cell).area
    }

    /// Returns the energy that relaxation reduces: the integral of the squared distance to the nearest site over the
    /// window.
    pub fn energy(&self) -> f64 {
        (0..self.sites.len()).map(|cell| self.moments(cell).second).sum()
    }

    pub(crate) fn moments(&self, cell: usize) -> Moments {
        Moments::of(self.corners(cell), self.sites[cell])
    }
}

/// A site with its index, because the triangulation sorts its vertices.
#[derive(Debug, Clone, Copy)]
struct Numbered {
    position: Point2<f64>,
    site: usize,
}

impl HasPosition for Numbered {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.position
    }
}

type Delaunay = DelaunayTriangulation<Numbered>;
type Directed<'a> = DirectedEdgeHandle<'a, Numbered, (), (), ()>;

/// Coordinates below this are replaced by 0, because spade rejects them as too small.
const NEGLIGIBLE: f64 = 1e-40;

/// Fraction of the perimeter below which a step backwards counts as a rounding error.
const ROUNDING: f64 = 1e-9;

/// Builds the diagram of sites inside the window.
pub(crate) fn build(sites: Vec<Point>, window: Window) -> Result<Diagram, Error> {
    let flushed = |c: f64| if c.abs() < NEGLIGIBLE { 0.0 } else { c };
    let numbered = sites
        .iter()
        .enumerate()
        .map(|(site, &[x, y])| Numbered { position: Point2::new(flushed(x), flushed(y)), site })
        .collect();
    let refused = |distinct: usize| Error::Sites { given: sites.len(), distinct };
    let delaunay = Delaunay::bulk_load(numbered).map_err(|_| refused(0))?;
    if sites.is_empty() || delaunay.num_vertices() != sites.len() {
        return Err(refused(delaunay.num_vertices()));
    }
    let mut builder = Builder::new(sites, window, &delaunay);
    builder.clip_edges();
    builder.walk_cells();
    Ok(builder.diagram)
}

struct Builder<'a> {
    delaunay: &'a Delaunay,
    /// The diagram under construction; cells are in the order of their sites.
    diagram: Diagram,
    /// Vertex of each Delaunay triangle with its circumcentre inside.
    centres: Vec<Option<usize>>,
    /// Arc length of each vertex on the border.
    arc_lengths: Vec<f64>,
    /// Vertices of the corners of the window, as far as used.
    corners: Vec<Option<usize>>,
    /// Index of the Voronoi edge dual to each Delaunay edge, if part of it is inside.
    duals: Vec<Option<usize>>,
}

impl<'a> Builder<'a> {
    fn new(sites: Vec<Point>, window: Window, delaunay: &'a Delaunay) -> Self {
        let (count, edges) = (sites.len(), delaunay.num_undirected_edges());
        let mut centres = vec![None; delaunay.num_all_faces()];
        let mut vertices = Vec::with_capacity(centres.len() + count);
        for face in delaunay.inner_faces() {
            let Point2 { x, y } = face.circumcenter();
            if window.contains([x, y]) {
                centres[face.fix().index()] = Some(vertices.len());
                vertices.push([x, y]);
            }
        }
        let corners = vec![None; window.corners().len()];
        let diagram = Diagram {
            window,
            sites,
            inner: vertices.len(),
            vertices,
            edges: Vec::with_capacity(edges + count),
            cell_ends: Vec::with_capacity(count),
            cell_vertices: Vec::with_capacity(7 * count),
        };
        Self { delaunay, diagram, centres, arc_lengths: Vec::new(), corners, duals: Vec::with_capacity(edges) }
    }

    /// Clips the Voronoi edges, each from the triangle on the right to the triangle on the left of the Delaunay edge.
    fn clip_edges(&mut self) {
        for edge in self.delaunay.undirected_edges() {
            let edge = edge.as_directed();
            let dual = self.clip_edge(edge).map(|ends| {
                self.diagram.edges.push(Edge {
                    ends,
                    cell: edge.from().data().site,
                    neighbour: Some(edge.to().data().site),
                });
                self.diagram.edges.len() - 1
            });
            self.duals.push(dual);
        }
    }

    fn clip_edge(&mut self, edge: Directed<'_>) -> Option<[usize; 2]> {
        let inside = |face: Directed<'_>| self.centres[face.face().fix().index()];
        let (start, end) = (inside(edge.rev()), inside(edge));
        if let (Some(start), Some(end)) = (start, end) {
            return Some([start, end]);
        }
        let [a, b] = edge.positions().map(|p| [p.x, p.y]);
        // Perpendicular to a → b, in the order of the triangles around a.
        let direction = [a[1] - b[1], b[0] - a[0]];
        match (start, end) {
            (Some(start), None) => Some([start, self.exit(start, direction)]),
            (None, Some(end)) => Some([self.exit(end, [-direction[0], -direction[1]]), end]),
            _ => {
                let middle = [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0];
                let place = |face: Directed<'_>, outer: f64| {
                    face.face().as_inner().map_or(outer, |face| {
                        let Point2 { x, y } = face.circumcenter();
                        dot(sub([x, y], middle), direction) / dot(direction, direction)
                    })
                };
                let range = [place(edge.rev(), f64::NEG_INFINITY), place(edge, f64::INFINITY)];
                let cuts = self.diagram.window.clip(middle, direction, range)?;
                Some(cuts.map(|t| self.border_at(along(middle, direction, t))))
            }
        }
    }

    /// Adds the vertex where a ray from a vertex inside leaves the window.
    fn exit(&mut self, from: usize, direction: Point) -> usize {
        let origin = self.diagram.vertices[from];
        let t = self.diagram.window.clip(origin, direction, [0.0, f64::INFINITY]).map_or(0.0, |[_, exit]| exit);
        self.border_at(along(origin, direction, t))
    }

    /// Adds a vertex on the border.
    fn border_at(&mut self, point: Point) -> usize {
        self.arc_lengths.push(self.diagram.window.arc_length_of(point));
        self.diagram.vertices.push(point);
        self.diagram.vertices.len() - 1
    }

    /// Returns the vertex of a corner of the window.
    fn corner(&mut self, corner: usize) -> usize {
        if let Some(vertex) = self.corners[corner] {
            return vertex;
        }
        self.arc_lengths.push(self.diagram.window.arc_length[corner]);
        self.diagram.vertices.push(self.diagram.window.corners()[corner]);
        self.corners[corner] = Some(self.diagram.vertices.len() - 1);
        self.diagram.vertices.len() - 1
    }

    fn walk_cells(&mut self) {
        // Cells are in the order of sites, which differs from that of the triangulation.
        let mut by_site = vec![None; self.delaunay.num_vertices()];
        for vertex in self.delaunay.vertices() {
            by_site[vertex.data().site] = Some(vertex.fix());
        }
        for (site, vertex) in by_site.into_iter().enumerate() {
            let Some(vertex) = vertex else { continue };
            let start = self.diagram.cell_vertices.len();
            let delaunay = self.delaunay;
            for edge in delaunay.vertex(vertex).out_edges() {
                let Some(dual) = self.duals[edge.as_undirected().fix().index()] else { continue };
                let [mut from, mut to] = self.diagram.edges[dual].ends;
                if self.diagram.edges[dual].cell != site {
                    (from, to) = (to, from);
                }
                let last = self.diagram.cell_vertices[start..].last().copied();
                if last != Some(from) {
                    if let Some(last) = last {
                        self.walk_border(site, last, from);
                    }
                    self.diagram.cell_vertices.push(from);
                }
                self.diagram.cell_vertices.push(to);
            }
            self.close(site, start);
            self.diagram.cell_ends.push(self.diagram.cell_vertices.len());
        }
    }

    /// Closes a walk.
    fn close(&mut self, site: usize, start: usize) {
        match self.diagram.cell_vertices[start..] {
            [] => {
                // The cell of a single site is the window.
                let corners: Vec<usize> = (0..self.corners.len()).map(|c| self.corner(c)).collect();
                self.diagram.cell_vertices.extend_from_slice(&corners);
                for i in 0..corners.len() {
                    self.add_border_edge(site, corners[i], corners[(i + 1) % corners.len()]);
                }
            }
            [first, .., last] if first == last => {
                self.diagram.cell_vertices.pop();
            }
            [first, .., last] => self.walk_border(site, last, first),
            [_] => {}
        }
    }

    /// Adds the corners between two border vertices to the cell, and the border edges to the edges.
    fn walk_border(&mut self, site: usize, from: usize, to: usize) {
        let perimeter = self.diagram.window.arc_length[self.corners.len()];
        let [start, end] = [from, to].map(|vertex| self.arc_lengths[vertex - self.diagram.inner]);
        let ahead = |arc_length: f64| {
            let way = arc_length - start;
            if way < 0.0 { way + perimeter } else { way }
        };
        let way = ahead(end);
        let mut last = from;
        if way < perimeter * (1.0 - ROUNDING) {
            let count = self.corners.len();
            let next = (0..count).find(|&corner| self.diagram.window.arc_length[corner] > start).unwrap_or(0);
            for corner in (next..count).chain(0..next) {
                let distance = ahead(self.diagram.window.arc_length[corner]);
                if distance >= way {
                    break;
                }
                if distance > 0.0 {
                    let vertex = self.corner(corner);
                    self.diagram.cell_vertices.push(vertex);
                    self.add_border_edge(site, last, vertex);
                    last = vertex;
                }
            }
        }
        self.add_border_edge(site, last, to);
    }

    fn add_border_edge(&mut self, site: usize, from: usize, to: usize) {
        self.diagram.edges.push(Edge { ends: [from, to], cell: site, neighbour: None });
    }
}

#[cfg(test)]
mod tests;
