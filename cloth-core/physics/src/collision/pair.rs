use energy_dsl::Vector3;

use crate::geometry::add_scaled;

/// The kind of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PairKind {
    /// Vertex 0 is the point; the others are the corners of the triangle.
    PointTriangle,
    /// Vertices 0 and 1 are the ends of one edge, 2 and 3 those of the other.
    EdgeEdge,
}

impl PairKind {
    /// The number of vertices of the first feature; the second has the others.
    #[inline]
    pub const fn first(self) -> usize {
        match self {
            Self::PointTriangle => 1,
            Self::EdgeEdge => 2,
        }
    }
}

/// Two features that may touch. Pairs are ordered by kind, then by features.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pair {
    /// The kinds of the two features.
    pub kind: PairKind,
    /// The numbers of the two features in the mesh's lists of points, triangles and edges.
    pub features: [u32; 2],
    /// The vertices of the first feature, then those of the second.
    pub vertices: [u32; 4],
}

impl Pair {
    /// The number of vertices of the first feature; the second has the others.
    #[inline]
    pub fn first(&self) -> usize {
        self.kind.first()
    }

    /// Returns an entry for each vertex.
    #[inline]
    pub fn of<T: Copy>(&self, all: &[T]) -> [T; 4] {
        self.vertices.map(|vertex| all[vertex as usize])
    }

    /// Whether one of its vertices is among these.
    #[inline]
    pub fn has_any(&self, vertices: &[bool]) -> bool {
        self.of(vertices).contains(&true)
    }

    /// The distance within which it is near, if `halves` has half of it at each vertex.
    #[inline(always)]
    pub fn reach(&self, halves: &[f64]) -> f64 {
        halves[self.vertices[0] as usize] + halves[self.vertices[self.first()] as usize]
    }

    /// The largest decrease of the distance by these excursions of the vertices.
    #[inline]
    pub fn approach(&self, excursions: &[f64]) -> f64 {
        let [a, b, c, d] = self.of(excursions);
        match self.kind {
            PairKind::PointTriangle => a + b.max(c).max(d),
            PairKind::EdgeEdge => a.max(b) + c.max(d),
        }
    }

    /// Returns the positions of its vertices.
    #[inline]
    pub fn corners(&self, x: &[Vector3<f64>]) -> [Vector3<f64>; 4] {
        self.of(x)
    }

    /// Adds a vector to those of its vertices, times their coefficients.
    #[inline]
    pub fn add(&self, weights: [f64; 4], vector: Vector3<f64>, all: &mut [Vector3<f64>]) {
        for (&vertex, weight) in self.vertices.iter().zip(weights) {
            let own = &mut all[vertex as usize];
            *own = add_scaled(*own, weight, vector);
        }
    }
}
