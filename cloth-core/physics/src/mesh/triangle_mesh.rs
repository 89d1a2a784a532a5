use energy_dsl::Vector3;

use super::patterns::Patterns;
use crate::geometry::{Pose, cross, norm, subtract};

/// The largest number of triangles that a message lists.
const SHOWN: usize = 5;

/// Why vertices and triangles do not form a valid mesh. Indices start from 0.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum MeshError {
    /// The mesh has no triangles.
    #[error("the mesh has {vertices} vertices and {triangles} triangles; at least one triangle is needed")]
    Empty { vertices: usize, triangles: usize },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} is not finite: {position:?}")]
    NonFiniteVertex { vertex: usize, position: Vector3<f64> },
    /// A triangle refers to a vertex that does not exist.
    #[error("triangle {triangle} refers to vertex {vertex}, but there are only {vertices} vertices")]
    VertexOutOfRange { triangle: usize, vertex: usize, vertices: usize },
    /// A triangle has no area, so its rest shape is undefined.
    #[error("triangle {triangle} (vertices {corners:?}) has no area; remove it or move a corner")]
    ZeroArea { triangle: usize, corners: [usize; 3] },
    /// An edge belongs to more than two triangles.
    #[error(
        "edge {}–{} is shared by {} triangles {:?}{}; a surface has at most two along an edge",
        .edge[0], .edge[1], .triangles.len(), &.triangles[..SHOWN.min(.triangles.len())],
        if .triangles.len() > SHOWN { " and more" } else { "" }
    )]
    NonManifoldEdge { edge: [usize; 2], triangles: Vec<usize> },
    /// A vertex belongs to no triangle, so it would have no mass.
    #[error("vertex {vertex} belongs to no triangle, so it would have no mass ({count} such vertices); remove it")]
    Unreferenced {
        /// The first such vertex.
        vertex: usize,
        /// The number of such vertices.
        count: usize,
    },
}

/// A validated triangle mesh: finite coordinates, no degenerate triangles, at most two triangles per edge, no unused
/// vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    vertices: Vec<Vector3<f64>>,
    triangles: Vec<[usize; 3]>,
    /// The warp direction of each triangle, from texture coordinates; `None` without them.
    warps: Option<Vec<Vector3<f64>>>,
    /// Rest shapes of the triangles; `None` if they are those between the vertices.
    patterns: Option<Patterns>,
}

impl TriangleMesh {
    /// Creates a mesh from rest positions in m and triangles, anticlockwise seen from the front.
    ///
    /// # Errors
    /// Returns the first problem found; see [`MeshError`].
    pub fn new(vertices: Vec<Vector3<f64>>, triangles: Vec<[usize; 3]>) -> Result<Self, MeshError> {
        if triangles.is_empty() {
            return Err(MeshError::Empty { vertices: vertices.len(), triangles: 0 });
        }
        let is_finite = |position: &Vector3<f64>| position.iter().all(|coordinate| coordinate.is_finite());
        if let Some(vertex) = vertices.iter().position(|position| !is_finite(position)) {
            return Err(MeshError::NonFiniteVertex { vertex, position: vertices[vertex] });
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            check_triangle(triangle, *corners, &vertices)?;
        }
        check_edges(&triangles)?;
        check_references(vertices.len(), &triangles)?;
        Ok(Self { vertices, triangles, warps: None, patterns: None })
    }

    /// Creates a mesh without validation, from parts of a valid one.
    pub(super) fn from_valid(vertices: Vec<Vector3<f64>>, triangles: Vec<[usize; 3]>) -> Self {
        Self { vertices, triangles, warps: None, patterns: None }
    }

    /// Returns the mesh with a warp direction for each triangle.
    pub fn with_warps(self, warps: Option<Vec<Vector3<f64>>>) -> Self {
        Self { warps, ..self }
    }

    /// The warp direction of each triangle, from texture coordinates; `None` without them.
    pub(crate) fn warps(&self) -> Option<&[Vector3<f64>]> {
        self.warps.as_deref()
    }

    /// Returns the mesh with rest shapes of single triangles, which were validated.
    pub(super) fn with_valid_patterns(self, patterns: Option<Patterns>) -> Self {
        Self { patterns, ..self }
    }

    /// Rest shapes of single triangles; `None` if they are those between the vertices.
    pub(super) fn patterns(&self) -> Option<&Patterns> {
        self.patterns.as_ref()
    }

    /// Whether triangles have rest shapes other than those between the vertices, so that [`TriangleMesh::vertices`] are
    /// not at rest.
    #[must_use]
    pub fn has_patterns(&self) -> bool {
        self.patterns.is_some()
    }

    /// Returns the mesh scaled by a factor.
    ///
    /// # Errors
    /// Returns an error if the scaled mesh is invalid, because a number overflows or a triangle loses its area.
    pub fn scaled(self, factor: f64) -> Result<Self, MeshError> {
        let larger = |vertex: Vector3<f64>| vertex.map(|coordinate| factor * coordinate);
        let scaled = Self::new(self.vertices.into_iter().map(larger).collect(), self.triangles)?;
        let patterns = self.patterns.map(|patterns| patterns.scaled(factor));
        Ok(scaled.with_warps(self.warps).with_valid_patterns(patterns))
    }

    /// Returns the mesh after a rigid motion.
    #[must_use]
    pub fn moved(self, pose: &Pose) -> Self {
        Self { vertices: self.vertices.iter().map(|&vertex| pose.transform(vertex)).collect(), ..self }
    }

    /// Returns the mesh with its vertices at other positions, in m.
    pub(crate) fn with_vertices(self, vertices: Vec<Vector3<f64>>) -> Self {
        Self { vertices, ..self }
    }

    /// Rest positions, in m; initial positions if the mesh [has patterns](TriangleMesh::has_patterns).
    #[must_use]
    pub fn vertices(&self) -> &[Vector3<f64>] {
        &self.vertices
    }

    /// The corners of each triangle, as vertex indices.
    #[must_use]
    pub fn triangles(&self) -> &[[usize; 3]] {
        &self.triangles
    }

    /// Returns the rest positions of a triangle's corners, in m.
    #[must_use]
    pub fn corners(&self, triangle: usize) -> [Vector3<f64>; 3] {
        if let Some(patterns) = &self.patterns {
            return patterns.corners(triangle);
        }
        self.triangles[triangle].map(|corner| self.vertices[corner])
    }
}

fn check_triangle(triangle: usize, corners: [usize; 3], positions: &[Vector3<f64>]) -> Result<(), MeshError> {
    let vertices = positions.len();
    if let Some(&vertex) = corners.iter().find(|&&corner| corner >= vertices) {
        return Err(MeshError::VertexOutOfRange { triangle, vertex, vertices });
    }
    if has_area(corners.map(|corner| positions[corner])) {
        Ok(())
    } else {
        Err(MeshError::ZeroArea { triangle, corners })
    }
}

/// Whether a triangle has an area; `false` for NaN.
pub(super) fn has_area([a, b, c]: [Vector3<f64>; 3]) -> bool {
    let longest = norm(subtract(b, a)).max(norm(subtract(c, b))).max(norm(subtract(a, c)));
    // Relative to the size of the triangle: below this, rounding decides the shape.
    norm(cross(subtract(b, a), subtract(c, a))) > 1e-14 * longest * longest && longest.is_finite()
}

fn check_edges(triangles: &[[usize; 3]]) -> Result<(), MeshError> {
    // Short numbers: these are the most memory that a mesh takes. No memory holds 2³² triangles.
    let ends = |a: usize, b: usize| [a.min(b) as u32, a.max(b) as u32];
    let mut along: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * triangles.len());
    for (triangle, &[a, b, c]) in triangles.iter().enumerate() {
        along.extend([ends(a, b), ends(b, c), ends(c, a)].map(|edge| (edge, triangle as u32)));
    }
    along.sort_unstable();
    match along.chunk_by(|a, b| a.0 == b.0).find(|along| along.len() > 2) {
        Some(along) => {
            let triangles = along.iter().map(|&(_, triangle)| triangle as usize).collect();
            Err(MeshError::NonManifoldEdge { edge: along[0].0.map(|vertex| vertex as usize), triangles })
        }
        None => Ok(()),
    }
}

fn check_references(vertices: usize, triangles: &[[usize; 3]]) -> Result<(), MeshError> {
    let mut used = vec![false; vertices];
    triangles.iter().flatten().for_each(|&corner| used[corner] = true);
    match used.iter().position(|&used| !used) {
        Some(vertex) => Err(MeshError::Unreferenced { vertex, count: used.iter().filter(|&&used| !used).count() }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Vec<Vector3<f64>> {
        vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
    }

    #[test]
    fn invalid_meshes_are_rejected_with_indices() {
        let message = |vertices, triangles| TriangleMesh::new(vertices, triangles).unwrap_err().to_string();
        assert!(message(square(), vec![]).contains("0 triangles"));
        assert!(message(square(), vec![[0, 1, 2], [0, 2, 9]]).starts_with("triangle 1 refers to vertex 9"));
        let mut broken = square();
        broken[3][2] = f64::NAN;
        assert!(message(broken, vec![[0, 1, 2], [0, 2, 3]]).starts_with("vertex 3 is not finite"));
        let mut line = square();
        line[3] = [0.5, 0.5, 0.0];
        assert!(message(line, vec![[0, 1, 2], [0, 2, 3]]).starts_with("triangle 1 (vertices [0, 2, 3]) has no area"));
        assert!(message(square(), vec![[0, 1, 2]]).starts_with("vertex 3 belongs to no triangle"));
        assert!(message(square(), vec![[0, 1, 1], [1, 2, 3]]).contains("no area"));
    }

    #[test]
    fn a_third_triangle_along_an_edge_is_rejected() {
        let mut vertices = square();
        vertices.push([0.5, 0.5, 1.0]);
        let error = TriangleMesh::new(vertices, vec![[0, 1, 2], [0, 2, 3], [0, 2, 4]]).unwrap_err();
        assert_eq!(error, MeshError::NonManifoldEdge { edge: [0, 2], triangles: vec![0, 1, 2] });
        assert!(error.to_string().starts_with("edge 0–2 is shared by 3 triangles [0, 1, 2]"));
    }

    #[test]
    fn a_triangle_is_thicker_than_the_rounding_of_its_corners() {
        let sliver = |height: f64| has_area([[0.0; 3], [1.0, 0.0, 0.0], [0.5, height, 0.0]]);
        assert!(sliver(1e-13) && !sliver(20.0 * f64::EPSILON) && !sliver(f64::NAN));
    }

    #[test]
    fn tiny_but_well_shaped_triangles_are_accepted() {
        let vertices = square().into_iter().map(|p| p.map(|c| c * 1e-9)).collect();
        assert!(TriangleMesh::new(vertices, vec![[0, 1, 2], [0, 2, 3]]).is_ok());
    }
}
