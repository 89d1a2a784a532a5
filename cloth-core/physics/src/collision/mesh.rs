use std::ops::Range;

use energy_dsl::Vector3;
use energy_solve::index;

use super::{Core, Pair, PairKind};
use crate::geometry::{Bounds, cross, norm, subtract};

/// A triangle is as narrow as an edge of this multiple of its height.
pub const EDGES_PER_HEIGHT: f64 = 1.5;

/// The points, edges and triangles of cloth and hair that can collide, and those of obstacles after them.
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
    /// The number of vertices of cloth and hair. Those of obstacles follow.
    own: usize,
    /// The obstacle of each vertex from `own` on.
    owners: Vec<u32>,
}

/// A side of a triangle with the opposite vertex, or a segment alone. The smaller end comes first.
type Side = ([u32; 2], Option<u32>);

impl CollisionMesh {
    /// Creates the mesh of `vertices` vertices. `segments` are edges without triangles, such as those of hair; `sewn`
    /// are pairs of vertices that a seam joins.
    ///
    /// # Panics
    /// If an index is not below `vertices`.
    #[must_use]
    pub fn new(vertices: usize, triangles: &[[usize; 3]], segments: &[[usize; 2]], sewn: &[[usize; 2]]) -> Self {
        let mut mesh = Self {
            points: Vec::new(),
            edges: Vec::new(),
            triangles: Vec::new(),
            sewn: representatives(vertices, sewn),
            has_seams: sewn.iter().any(|[a, b]| a != b),
            apexes: Vec::new(),
            neighbours: Vec::new(),
            first_triangles: Vec::new(),
            own: vertices,
            owners: Vec::new(),
        };
        mesh.add(0..vertices, triangles, segments);
        mesh
    }

    /// Adds the features of the next vertices.
    fn add(&mut self, vertices: Range<usize>, triangles: &[[usize; 3]], segments: &[[usize; 2]]) {
        self.neighbours.resize(vertices.end, Vec::new());
        for same in sides(triangles, segments).chunk_by(|a, b| a.0 == b.0) {
            let [a, b] = same[0].0;
            self.edges.push([a, b]);
            self.apexes.push(same.iter().filter_map(|(_, apex)| *apex).collect());
            self.neighbours[a as usize].push(b);
            self.neighbours[b as usize].push(a);
        }
        let is_used = |vertex: &usize| !self.neighbours[*vertex].is_empty();
        self.points.extend(vertices.clone().filter(is_used).map(index));
        self.first_triangles.resize(vertices.end, None);
        for corners in triangles.iter().rev().map(|corners| corners.map(index)) {
            corners.iter().for_each(|&corner| self.first_triangles[corner as usize] = Some(corners));
        }
        self.triangles.extend(triangles.iter().map(|corners| corners.map(index)));
    }

    /// Adds the cores of obstacles. Their vertices follow those of cloth and hair, in order.
    #[must_use]
    pub fn with_obstacles(mut self, cores: &[Core]) -> Self {
        for (number, core) in (0..).zip(cores) {
            let first = self.neighbours.len();
            let end = first + core.vertices.len();
            let triangles: Vec<_> = core.triangles.iter().map(|corners| corners.map(|c| first + c)).collect();
            let segments: Vec<_> = core.segments.iter().map(|ends| ends.map(|end| first + end)).collect();
            self.add(first..end, &triangles, &segments);
            self.triangles.extend(core.faces.iter().map(|corners| corners.map(|corner| index(first + corner))));
            self.sewn.extend(index(first)..index(end));
            self.owners.resize(end - self.own, number);
        }
        self
    }

    /// The number of vertices, with those of obstacles.
    pub fn vertices(&self) -> usize {
        self.neighbours.len()
    }

    /// The number of vertices of cloth and hair. Those of obstacles follow.
    pub(crate) fn own_vertices(&self) -> usize {
        self.own
    }

    /// The obstacle that a vertex belongs to; `None` for cloth and hair.
    #[inline]
    pub fn obstacle(&self, vertex: u32) -> Option<usize> {
        (vertex as usize).checked_sub(self.own).map(|number| self.owners[number] as usize)
    }

    /// The obstacle of a pair; `None` for two features of cloth and hair.
    #[inline]
    pub fn obstacle_of(&self, pair: &Pair) -> Option<usize> {
        let [first, second] = [pair.vertices[0], pair.vertices[pair.first()]];
        self.obstacle(first.max(second))
    }

    /// Whether a vertex is the centre of a ball, or the end of a rail.
    #[inline]
    pub(crate) fn is_round(&self, vertex: u32) -> bool {
        vertex as usize >= self.own && self.first_triangles[vertex as usize].is_none()
    }

    /// Whether a pair is a point and a plane of an obstacle. A triangle that stands for a plane has no edges.
    #[inline]
    pub(crate) fn has_plane(&self, pair: &Pair) -> bool {
        let [_, a, b, c] = pair.vertices;
        pair.kind == PairKind::PointTriangle
            && a as usize >= self.own
            && b != c
            && self.neighbours[a as usize].is_empty()
    }

    /// The numbers of points, triangles and edges of cloth and hair. Those of obstacles follow.
    pub(super) fn own_features(&self) -> [usize; 3] {
        let is_own = |vertex: u32| (vertex as usize) < self.own;
        [
            self.points.partition_point(|&point| is_own(point)),
            self.triangles.partition_point(|corners| is_own(corners[0])),
            self.edges.partition_point(|ends| is_own(ends[0])),
        ]
    }

    /// Returns the features whose vertices are all kept, with vertex i renamed `number[i]`; `None` for a vertex that is
    /// not kept. The mesh has no obstacles yet.
    #[must_use]
    pub fn restricted(&self, number: &[Option<usize>], vertices: usize) -> Self {
        let of = |vertex: u32| number[vertex as usize];
        let triangles = self.triangles.iter().filter_map(|&[a, b, c]| Some([of(a)?, of(b)?, of(c)?]));
        let edges = self.edges.iter().filter_map(|&[a, b]| Some([of(a)?, of(b)?]));
        let sewn = (0..).zip(&self.sewn).filter_map(|(vertex, &first)| Some([of(vertex)?, of(first)?]));
        // Edges of triangles occur twice, which makes no difference.
        let (triangles, edges, sewn): (Vec<_>, Vec<_>, Vec<_>) = (triangles.collect(), edges.collect(), sewn.collect());
        Self::new(vertices, &triangles, &edges, &sewn)
    }

    /// Returns the length of the shortest edge of cloth and hair at x, in m.
    #[must_use]
    pub fn shortest_edge(&self, x: &[Vector3<f64>]) -> f64 {
        let length = |&[a, b]: &[u32; 2]| norm(subtract(x[a as usize], x[b as usize]));
        self.edges[..self.own_features()[2]].iter().map(length).fold(f64::INFINITY, f64::min)
    }

    /// Returns, for each vertex, the length of the shortest edge of cloth and hair that it or a triangle with it has at
    /// x, in m; infinity for a vertex without edges. A triangle that is lower than two thirds of its edges counts by
    /// 1.5 times its height: its apex is that close to the triangle beyond.
    #[must_use]
    pub(crate) fn shortest_edges(&self, x: &[Vector3<f64>]) -> Vec<f64> {
        let mut shortest = vec![f64::INFINITY; self.vertices()];
        let mut note = |vertex: u32, length: f64| {
            let known = &mut shortest[vertex as usize];
            *known = known.min(length);
        };
        for (number, &[a, b]) in self.own_edges().iter().enumerate() {
            let along = subtract(x[b as usize], x[a as usize]);
            let length = norm(along);
            [a, b].iter().chain(self.apexes(number)).for_each(|&vertex| note(vertex, length));
            for &apex in self.apexes(number) {
                let height = norm(cross(along, subtract(x[apex as usize], x[a as usize]))) / length;
                [a, b, apex].into_iter().for_each(|vertex| note(vertex, EDGES_PER_HEIGHT * height));
            }
        }
        shortest
    }

    /// The edges of cloth and hair.
    #[must_use]
    pub(crate) fn own_edges(&self) -> &[[u32; 2]] {
        &self.edges[..self.own_features()[2]]
    }

    /// Returns the mean length of the edges of cloth and hair at x, in m.
    #[must_use]
    pub(crate) fn mean_edge(&self, x: &[Vector3<f64>]) -> f64 {
        let length = |&[a, b]: &[u32; 2]| norm(subtract(x[a as usize], x[b as usize]));
        let own = &self.edges[..self.own_features()[2]];
        own.iter().map(length).sum::<f64>() / own.len().max(1) as f64
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

    /// The vertices of each triangle.
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

    /// The first triangle at a vertex; `None` if no triangle has it.
    pub(crate) fn first_triangle(&self, vertex: u32) -> Option<[u32; 3]> {
        self.first_triangles[vertex as usize]
    }

    /// Whether two features have a vertex in common, or vertices that are sewn together.
    #[inline]
    pub(super) fn are_adjacent<const M: usize, const N: usize>(&self, a: &[u32; M], b: &[u32; N]) -> bool {
        let mut adjacent = false;
        for p in a {
            for q in b {
                adjacent |= p == q;
            }
        }
        adjacent || self.has_seams && self.are_sewn(a, b)
    }

    fn are_sewn(&self, a: &[u32], b: &[u32]) -> bool {
        let sewn = |vertex: &u32| self.sewn[*vertex as usize];
        a.iter().any(|p| b.iter().any(|q| sewn(p) == sewn(q)))
    }
}

/// Returns the sides of triangles, and segments, in order.
fn sides(triangles: &[[usize; 3]], segments: &[[usize; 2]]) -> Vec<Side> {
    let sides = triangles.iter().flat_map(|&[a, b, c]| [([a, b], Some(c)), ([b, c], Some(a)), ([c, a], Some(b))]);
    let lone = segments.iter().map(|&ends| (ends, None));
    let ascending = |[a, b]: [usize; 2]| [index(a.min(b)), index(a.max(b))];
    let mut sides: Vec<Side> = sides.chain(lone).map(|(ends, apex)| (ascending(ends), apex.map(index))).collect();
    sides.sort_unstable();
    sides
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
