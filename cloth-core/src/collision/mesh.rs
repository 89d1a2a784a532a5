use energy_dsl::Vector3;
use energy_solve::index;

use crate::geometry::{Bounds, norm, subtract};

/// The points, edges and triangles of cloth and hair that can collide.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CollisionMesh {
    points: Vec<u32>,
    edges: Vec<[u32; 2]>,
    triangles: Vec<[u32; 3]>,
    /// The first of the vertices that are sewn to each vertex, or the vertex itself.
    sewn: Vec<u32>,
    /// Whether a seam joins vertices at all.
    has_seams: bool,
    /// The vertices opposite each edge, one for each of its triangles.
    apexes: Vec<Vec<u32>>,
    /// The vertices that share an edge with each vertex.
    neighbours: Vec<Vec<u32>>,
    /// The first triangle at each vertex.
    first_triangles: Vec<Option<[u32; 3]>>,
}

impl CollisionMesh {
    /// Creates the mesh of `vertices` vertices. `segments` are edges without triangles, such as those of hair; `sewn`
    /// are pairs of vertices that a seam joins.
    ///
    /// # Panics
    /// If an index is not below `vertices`.
    #[must_use]
    pub fn new(vertices: usize, triangles: &[[usize; 3]], segments: &[[usize; 2]], sewn: &[[usize; 2]]) -> Self {
        let sides = triangles.iter().flat_map(|&[a, b, c]| [([a, b], Some(c)), ([b, c], Some(a)), ([c, a], Some(b))]);
        let lone = segments.iter().map(|&ends| (ends, None));
        let ascending = |[a, b]: [usize; 2]| [index(a.min(b)), index(a.max(b))];
        let mut sides: Vec<([u32; 2], Option<u32>)> =
            sides.chain(lone).map(|(ends, apex)| (ascending(ends), apex.map(index))).collect();
        sides.sort_unstable();
        let (mut edges, mut apexes, mut neighbours) = (Vec::new(), Vec::new(), vec![Vec::new(); vertices]);
        for same in sides.chunk_by(|a, b| a.0 == b.0) {
            let [a, b] = same[0].0;
            edges.push([a, b]);
            apexes.push(same.iter().filter_map(|(_, apex)| *apex).collect());
            neighbours[a as usize].push(b);
            neighbours[b as usize].push(a);
        }
        let is_used = |vertex: &u32| !neighbours[*vertex as usize].is_empty();
        let points = (0..index(vertices)).filter(is_used).collect();
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|corners| corners.map(index)).collect();
        let mut first_triangles = vec![None; vertices];
        for corners in triangles.iter().rev() {
            corners.iter().for_each(|&corner| first_triangles[corner as usize] = Some(*corners));
        }
        let (sewn, has_seams) = (representatives(vertices, sewn), sewn.iter().any(|[a, b]| a != b));
        Self { has_seams, points, edges, triangles, sewn, apexes, neighbours, first_triangles }
    }

    /// Returns the mesh with vertex i renamed `number[i]`, a permutation.
    #[must_use]
    pub(crate) fn renumbered(&self, number: &[usize]) -> Self {
        let triangles: Vec<_> = self.triangles.iter().map(|corners| corners.map(|c| number[c as usize])).collect();
        let edges: Vec<_> = self.edges.iter().map(|ends| ends.map(|end| number[end as usize])).collect();
        let sewn = self.sewn.iter().enumerate().map(|(vertex, &first)| [number[vertex], number[first as usize]]);
        // Edges of triangles occur twice, which makes no difference.
        Self::new(number.len(), &triangles, &edges, &sewn.collect::<Vec<_>>())
    }

    /// Returns the length of the shortest edge at x, in m.
    #[must_use]
    pub(crate) fn shortest_edge(&self, x: &[Vector3<f64>]) -> f64 {
        let length = |&[a, b]: &[u32; 2]| norm(subtract(x[a as usize], x[b as usize]));
        self.edges.iter().map(length).fold(f64::INFINITY, f64::min)
    }

    /// Returns the mean length of the edges at x, in m.
    #[must_use]
    pub(crate) fn mean_edge(&self, x: &[Vector3<f64>]) -> f64 {
        let length = |&[a, b]: &[u32; 2]| norm(subtract(x[a as usize], x[b as usize]));
        self.edges.iter().map(length).sum::<f64>() / self.edges.len().max(1) as f64
    }

    /// The vertices that belong to an edge or a triangle, ascending.
    #[must_use]
    pub fn points(&self) -> &[u32] {
        &self.points
    }

    /// Every edge once, with the smaller vertex first.
    #[must_use]
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// The triangles.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The vertices opposite an edge, one for each of its triangles.
    pub(crate) fn apexes(&self, edge: usize) -> &[u32] {
        &self.apexes[edge]
    }

    /// The vertices that share an edge with a vertex.
    pub(crate) fn neighbours(&self, vertex: u32) -> &[u32] {
        &self.neighbours[vertex as usize]
    }

    /// The first triangle at a vertex; `None` if it has none.
    pub(crate) fn first_triangle(&self, vertex: u32) -> Option<[u32; 3]> {
        self.first_triangles[vertex as usize]
    }

    /// Whether two features have a vertex in common, or vertices that are sewn together.
    pub(super) fn are_joined(&self, a: &[u32], b: &[u32]) -> bool {
        if !self.has_seams {
            return a.iter().any(|p| b.contains(p));
        }
        let sewn = |vertex: &u32| self.sewn[*vertex as usize];
        a.iter().any(|p| b.iter().any(|q| sewn(p) == sewn(q)))
    }
}

/// Returns the box around some vertices.
pub(super) fn bounds(x: &[Vector3<f64>], vertices: &[u32]) -> Bounds {
    let point = |&vertex: &u32| x[vertex as usize];
    vertices.iter().map(|vertex| Bounds::of(&[point(vertex)])).fold(Bounds::EMPTY, Bounds::around)
}

/// Returns the smallest vertex that each vertex is sewn to, directly or through others.
fn representatives(vertices: usize, sewn: &[[usize; 2]]) -> Vec<u32> {
    let mut first: Vec<usize> = (0..vertices).collect();
    let root = |first: &[usize], mut vertex: usize| {
        while first[vertex] != vertex {
            vertex = first[vertex];
        }
        vertex
    };
    for &[a, b] in sewn {
        let [a, b] = [root(&first, a), root(&first, b)];
        first[a.max(b)] = a.min(b);
    }
    (0..vertices).map(|vertex| index(root(&first, vertex))).collect()
}
