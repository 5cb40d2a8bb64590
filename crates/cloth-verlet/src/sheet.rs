use crate::outline::distance;
use crate::{Point, Vertex};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Marks the missing triangle of a boundary edge.
pub(crate) const OUTSIDE: u32 = u32::MAX;

/// A crumpled sheet: a triangle mesh with its flat rest state, in the unit of the outline.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) rest: Vec<Point>,
    /// Shared by all sheets of one mesh until one of them is folded.
    pub(crate) radius: Arc<Vec<f64>>,
    pub(crate) triangles: Arc<Vec<[u32; 3]>>,
    pub(crate) edges: Arc<Vec<Edge>>,
}

/// An edge from `ends[0]` to `ends[1]` with the triangles on its left and right, or [`OUTSIDE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Edge {
    pub(crate) ends: [u32; 2],
    pub(crate) sides: [u32; 2],
}

impl Edge {
    /// Returns the edge between two vertices with the triangles on the left and right of the way from `a` to `b`.
    pub(crate) fn new([a, b]: [u32; 2], [left, right]: [u32; 2]) -> Edge {
        if a < b { Edge { ends: [a, b], sides: [left, right] } } else { Edge { ends: [b, a], sides: [right, left] } }
    }

    /// Returns the third corners of the one or two triangles, in the order of the triangles.
    pub(crate) fn opposite(&self, triangles: &[[u32; 3]]) -> Vec<u32> {
        let mut sides = self.sides;
        sides.sort_unstable();
        let third = |&t: &u32| triangles.get(t as usize)?.iter().copied().find(|v| !self.ends.contains(v));
        sides.iter().filter_map(third).collect()
    }
}

impl Sheet {
    pub(crate) fn new(vertices: Vec<Vertex>, rest: Vec<Point>, radius: Vec<f64>, triangles: Vec<[u32; 3]>) -> Sheet {
        let edges = Arc::new(edges(&triangles, vertices.len()));
        Sheet { vertices, rest, radius: Arc::new(radius), triangles: Arc::new(triangles), edges }
    }

    /// Allocates memory for more vertices on the rim. Each has one more triangle and two more edges.
    pub(crate) fn reserve(&mut self, vertices: usize) {
        self.vertices.reserve_exact(vertices);
        self.rest.reserve_exact(vertices);
        self.radius = Arc::new(with_room(&self.radius, vertices));
        self.triangles = Arc::new(with_room(&self.triangles, vertices));
        self.edges = Arc::new(with_room(&self.edges, 2 * vertices));
    }

    /// Recomputes the edges, after triangles have been divided.
    pub(crate) fn update_edges(&mut self) {
        self.edges = Arc::new(edges(&self.triangles, self.vertices.len()));
    }

    /// Returns the positions of the vertices. z ≥ 0 is the height above the ground.
    #[must_use]
    pub fn vertices(&self) -> &[Vertex] {
        &self.vertices
    }

    /// Returns the unit normals of the vertices: means of the adjacent triangles, weighted by area; up where the sheet
    /// is flat.
    #[must_use]
    pub fn normals(&self) -> Vec<Vertex> {
        let mut normals = vec![[0.0; 3]; self.vertices.len()];
        for t in self.triangles.iter() {
            let [a, b, c] = t.map(|v| self.vertices[v as usize]);
            let (p, q): (Vertex, Vertex) = (std::array::from_fn(|i| b[i] - a[i]), std::array::from_fn(|i| c[i] - a[i]));
            for v in t {
                for (i, sum) in normals[*v as usize].iter_mut().enumerate() {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    *sum += p[j] * q[k] - p[k] * q[j];
                }
            }
        }
        for normal in &mut normals {
            let length = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
            *normal = if length > 0.0 { normal.map(|c| c / length) } else { [0.0, 0.0, 1.0] };
        }
        normals
    }

    /// Returns the vertex indices of the triangles.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns the position of each vertex in the flat sheet, whose centroid is near the origin.
    #[must_use]
    pub fn rest_positions(&self) -> &[Point] {
        &self.rest
    }

    /// Returns the distance of each vertex from the centre of the flat sheet, relative to that of the rim, 0 to 1.
    #[must_use]
    pub fn rest_radius(&self) -> &[f64] {
        &self.radius
    }

    /// Returns the area of the flat sheet.
    #[must_use]
    pub fn rest_area(&self) -> f64 {
        (0..self.triangles.len()).map(|t| self.rest_area_of(t)).sum()
    }

    pub(crate) fn rest_area_of(&self, t: usize) -> f64 {
        let [a, b, c] = self.triangles[t].map(|v| self.rest[v as usize]);
        0.5 * cross(a, b, c).abs()
    }

    /// Returns the volume of the sheet for a thickness that is a function of [`Sheet::rest_radius`], linear within each
    /// triangle. [`Sheet::thickness_into`] distributes this volume over the image.
    pub fn volume(&self, thickness: impl Fn(f64) -> f64) -> f64 {
        let mean = |t: &[u32; 3]| t.iter().map(|&v| thickness(self.radius[v as usize])).sum::<f64>() / 3.0;
        self.triangles.iter().enumerate().map(|(t, corners)| self.rest_area_of(t) * mean(corners)).sum()
    }

    /// Returns the root mean square of the relative length changes of the edges.
    #[must_use]
    pub fn edge_strain_rms(&self) -> f64 {
        let mut sum = 0.0;
        for &Edge { ends: [a, b], .. } in self.edges.iter() {
            let (p, q) = (self.vertices[a as usize], self.vertices[b as usize]);
            let flat = distance([p[0], p[1]], [q[0], q[1]]);
            let rest = distance(self.rest[a as usize], self.rest[b as usize]);
            let strain = (flat * flat + (p[2] - q[2]) * (p[2] - q[2])).sqrt() / rest - 1.0;
            sum += strain * strain;
        }
        (sum / self.edges.len() as f64).sqrt()
    }
}

/// Returns a copy with room for more values.
fn with_room<T: Copy>(values: &[T], more: usize) -> Vec<T> {
    let mut copy = Vec::with_capacity(values.len() + more);
    copy.extend_from_slice(values);
    copy
}

/// Returns the rim from vertex 0 on: each vertex with the triangle at the boundary edge that starts there.
pub(crate) fn rim(edges: &[Edge]) -> Vec<(u32, u32)> {
    let outer = edges.iter().filter_map(|e| match e.sides {
        [t, OUTSIDE] => Some((e.ends[0], (e.ends[1], t))),
        [OUTSIDE, t] => Some((e.ends[1], (e.ends[0], t))),
        _ => None,
    });
    let next: BTreeMap<u32, (u32, u32)> = outer.collect();
    let mut at = 0;
    let step = |_| next.get(&at).map(|&(to, t)| (std::mem::replace(&mut at, to), t));
    (0..next.len()).map_while(step).collect()
}

/// Returns the edges of all triangles.
pub(crate) fn edges(triangles: &[[u32; 3]], vertices: usize) -> Vec<Edge> {
    // Each vertex has a linked list, through `next`, of the edges whose smaller end it is.
    const NONE: u32 = u32::MAX;
    let mut first = vec![NONE; vertices];
    let mut next: Vec<u32> = Vec::with_capacity(triangles.len() * 2);
    let mut edges: Vec<Edge> = Vec::with_capacity(triangles.len() * 2);
    for (t, &[a, b, c]) in triangles.iter().enumerate() {
        #[expect(clippy::cast_possible_truncation, reason = "counts far below 2^32")]
        let (t, new) = (t as u32, |edges: &Vec<Edge>| edges.len() as u32);
        for (i, j) in [(a, b), (b, c), (c, a)] {
            let (low, high) = (i.min(j), i.max(j));
            // A triangle is left of an edge if it runs from its smaller to its larger end.
            let side = usize::from(i > j);
            let mut at = first[low as usize];
            while at != NONE && edges[at as usize].ends[1] != high {
                at = next[at as usize];
            }
            if at == NONE {
                let mut sides = [OUTSIDE; 2];
                sides[side] = t;
                next.push(first[low as usize]);
                first[low as usize] = new(&edges);
                edges.push(Edge { ends: [low, high], sides });
            } else {
                edges[at as usize].sides[side] = t;
            }
        }
    }
    edges
}

/// Returns twice the signed area of a triangle.
pub(crate) fn cross(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{rng, wavy};
    use crate::{Cloth, ClothParams};

    #[test]
    fn normals_are_means_of_the_adjacent_triangles() {
        let (up, ridge) = ([0.0, 0.0, 1.0], 0.5_f64.sqrt());
        let folded = |height: f64| {
            let vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, height], [1.0, 1.0, height], [2.0, 0.5, height]];
            let rest = vertices.iter().map(|v| [v[0], v[1]]).collect();
            Sheet::new(vertices, rest, vec![0.0; 4], vec![[0, 1, 2], [1, 3, 2]]).normals()
        };
        assert_eq!(folded(0.0), [up; 4]);
        let normals = folded(1.0);
        assert!((normals[0][0] + ridge).abs() < 1e-12 && (normals[0][2] - ridge).abs() < 1e-12);
        assert_eq!(normals[3], up);
        assert!(normals[1][0] < 0.0 && normals[1][2] > ridge && normals[1] == normals[2]);
        let sheet = Cloth::new(&ClothParams { vertices: 300, ..ClothParams::default() }).unwrap();
        let sheet = sheet.crumple(&wavy(3.0, 0.1), &mut rng(1)).unwrap();
        assert!(sheet.normals().iter().filter(|n| n[2] > 0.0).count() * 10 > sheet.vertices().len() * 9);
    }
}
