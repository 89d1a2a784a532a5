use energy_dsl::Vector3;

use super::topology::Hinge;
use super::triangle_mesh::has_area;
use super::{MeshError, TriangleMesh, Warp, dihedral_angle};
use crate::geometry::{add_scaled, cross, dot, norm, subtract};

/// Rest shapes of single triangles, where they are not those between the vertices: sewing patterns, texture
/// coordinates, or shrunk groups. Neighbours need not fit together.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Patterns {
    /// The corners of each triangle, in m.
    corners: Vec<[Vector3<f64>; 3]>,
    /// The same before shrinking, which tells the angles between triangles.
    unscaled: Vec<[Vector3<f64>; 3]>,
}

/// The largest distance of two ends of an edge that count as the same position, over the length of the edge.
const SAME_PLACE: f64 = 1e-6;

impl Patterns {
    pub(super) fn corners(&self, triangle: usize) -> [Vector3<f64>; 3] {
        self.corners[triangle]
    }

    /// Returns the patterns of some of the triangles.
    pub(super) fn selected(&self, triangles: impl Iterator<Item = usize> + Clone) -> Self {
        let of = |all: &[[Vector3<f64>; 3]]| triangles.clone().map(|triangle| all[triangle]).collect();
        Self { corners: of(&self.corners), unscaled: of(&self.unscaled) }
    }

    /// Returns the patterns scaled by a factor.
    pub(super) fn scaled(mut self, factor: f64) -> Self {
        let all = self.corners.iter_mut().chain(&mut self.unscaled);
        all.flatten().flatten().for_each(|coordinate| *coordinate *= factor);
        self
    }
}

impl TriangleMesh {
    /// Returns the mesh with a rest shape for each triangle, in m.
    ///
    /// # Errors
    /// Returns an error if a coordinate is not finite or a triangle has no area.
    pub fn with_patterns(self, corners: Vec<[Vector3<f64>; 3]>) -> Result<Self, MeshError> {
        self.check_patterns(&corners)?;
        Ok(self.with_valid_patterns(Some(Patterns { unscaled: corners.clone(), corners })))
    }

    /// Returns the mesh with the rest shape of each triangle scaled by `factors` along warp and weft.
    ///
    /// # Errors
    /// Returns the number of a triangle without a warp direction, or the error of the scaled shapes.
    pub fn with_scaled_patterns(self, factors: &[[f64; 2]], warp: Warp) -> Result<Self, ScaleError> {
        let all = 0..self.triangles().len();
        let unscaled: Vec<[Vector3<f64>; 3]> = all.clone().map(|triangle| self.corners(triangle)).collect();
        let scaled = |triangle: usize| {
            let factors = factors[triangle];
            if factors == [1.0; 2] {
                return Ok(unscaled[triangle]);
            }
            // A uniform factor needs no direction.
            let along = if factors[0] == factors[1] { [1.0, 0.0, 0.0] } else { self.warp_of(triangle, warp)? };
            Ok(stretched(unscaled[triangle], along, factors))
        };
        let corners = all.map(scaled).collect::<Result<Vec<_>, ScaleError>>()?;
        self.check_patterns(&corners)?;
        Ok(self.with_valid_patterns(Some(Patterns { corners, unscaled })))
    }

    /// Returns the unit vector along the warp in the plane of a triangle.
    fn warp_of(&self, triangle: usize, warp: Warp) -> Result<Vector3<f64>, ScaleError> {
        let direction = match warp {
            Warp::Direction(direction) => Some(direction),
            Warp::Uv => self.warps().and_then(|warps| warps.get(triangle).copied()),
        };
        let [a, b, c] = self.corners(triangle);
        let normal = unit(cross(subtract(b, a), subtract(c, a)));
        let across = direction.map(|direction| cross(normal, unit(direction)));
        let across = across.filter(|across| norm(*across) > 1e-6);
        across.map(|across| cross(unit(across), normal)).ok_or(ScaleError::NoWarp { triangle })
    }

    fn check_patterns(&self, corners: &[[Vector3<f64>; 3]]) -> Result<(), MeshError> {
        for (triangle, (pattern, &corners)) in corners.iter().zip(self.triangles()).enumerate() {
            if !has_area(*pattern) {
                return Err(MeshError::ZeroArea { triangle, corners });
            }
        }
        Ok(())
    }

    /// Returns the points of a hinge at rest: its two apexes, then the ends of its edge. If its triangles have rest
    /// shapes of their own, they are joined along an edge of mean length, at the angle that they have at rest, or flat
    /// if they are apart there.
    #[must_use]
    pub fn hinge_at_rest(&self, hinge: &Hinge) -> [Vector3<f64>; 4] {
        let Some(patterns) = self.patterns() else { return hinge.vertices.map(|vertex| self.vertices()[vertex]) };
        // For each triangle: its apex and the ends of the edge.
        let points = |of: &[[Vector3<f64>; 3]]| -> [[Vector3<f64>; 3]; 2] {
            [0, 1].map(|side| {
                let triangle = hinge.triangles[side];
                [hinge.vertices[side], hinge.vertices[2], hinge.vertices[3]].map(|vertex| {
                    let corner = self.triangles()[triangle].iter().position(|&corner| corner == vertex);
                    of[triangle][corner.unwrap_or(0)]
                })
            })
        };
        let angle = angle_between(points(&patterns.unscaled));
        joined(points(&patterns.corners), angle)
    }
}

/// A rest shape that cannot be scaled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum ScaleError {
    /// A triangle has no warp direction.
    #[error(
        "triangle {triangle} has no warp direction, which different factors along `warp` and `weft` need; give equal \
         factors, or `warp = \"uv\"` with texture coordinates"
    )]
    NoWarp { triangle: usize },
    /// A scaled triangle is invalid.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

fn unit(vector: Vector3<f64>) -> Vector3<f64> {
    let length = norm(vector);
    vector.map(|component| component / length)
}

/// Scales a triangle about its first corner, along a unit vector in its plane and across it.
fn stretched([a, b, c]: [Vector3<f64>; 3], along: Vector3<f64>, [warp, weft]: [f64; 2]) -> [Vector3<f64>; 3] {
    let moved = |point: Vector3<f64>| {
        let side = subtract(point, a);
        let evenly = add_scaled(a, weft, side);
        add_scaled(evenly, (warp - weft) * dot(side, along), along)
    };
    [a, moved(b), moved(c)]
}

/// Returns the angle between two triangles, each an apex and the ends of the edge; 0 if their edges are apart.
fn angle_between([[first, start, end], [second, other_start, other_end]]: [[Vector3<f64>; 3]; 2]) -> f64 {
    let limit = SAME_PLACE * norm(subtract(end, start));
    let is_shared = norm(subtract(start, other_start)) <= limit && norm(subtract(end, other_end)) <= limit;
    if is_shared { dihedral_angle([first, second, start, end]) } else { 0.0 }
}

/// Joins two triangles, each an apex and the ends of the edge, at an angle.
fn joined(triangles: [[Vector3<f64>; 3]; 2], angle: f64) -> [Vector3<f64>; 4] {
    let lengths = triangles.map(|[_, start, end]| norm(subtract(end, start)));
    let length = 0.5 * (lengths[0] + lengths[1]);
    let [first, second] = [0, 1].map(|side| {
        let [apex, start, end] = triangles[side];
        let (edge, leg) = (subtract(end, start), subtract(apex, start));
        let along = dot(leg, edge) / (lengths[side] * lengths[side]) * length;
        (along, norm(cross(edge, leg)) / lengths[side])
    });
    let (sine, cosine) = angle.sin_cos();
    let apexes = [[first.0, first.1, 0.0], [second.0, -second.1 * cosine, -second.1 * sine]];
    [apexes[0], apexes[1], [0.0; 3], [length, 0.0, 0.0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Topology, lumped_masses, rest_angle};

    /// Two triangles folded by 0.3 rad along their common edge.
    fn folded() -> TriangleMesh {
        let (sine, cosine) = 0.3_f64.sin_cos();
        let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.5, -cosine, -sine]];
        TriangleMesh::new(vertices, vec![[0, 1, 2], [1, 0, 3]]).unwrap()
    }

    #[test]
    fn a_joined_hinge_has_the_shapes_and_the_angle_of_its_triangles() {
        let mesh = folded();
        let hinge = Topology::of(&mesh).hinges[0];
        let corners = [0, 1].map(|triangle| mesh.corners(triangle)).to_vec();
        let same = mesh.clone().with_patterns(corners.clone()).unwrap();
        let distances = |points: [Vector3<f64>; 4]| {
            [(0, 1), (0, 2), (1, 3), (2, 3)].map(|(a, b): (usize, usize)| norm(subtract(points[a], points[b])))
        };
        let pairs = distances(same.hinge_at_rest(&hinge)).into_iter().zip(distances(mesh.hinge_at_rest(&hinge)));
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-14));
        // Patterns that lie apart are sewn flat; shrinking keeps the angle.
        let apart = corners.iter().enumerate().map(|(n, t)| t.map(|[x, y, z]| [x + 5.0 * n as f64, y, z])).collect();
        assert_eq!(rest_angle(&mesh.clone().with_patterns(apart).unwrap(), &hinge), 0.0);
        let shrunk = mesh.with_scaled_patterns(&[[0.5, 1.0], [1.0; 2]], [1.0, 0.0, 0.0].into()).unwrap();
        assert!((rest_angle(&shrunk, &hinge) - 0.3).abs() < 1e-14);
        let edge = shrunk.hinge_at_rest(&hinge);
        assert!((norm(subtract(edge[3], edge[2])) - 0.75).abs() < 1e-14, "the mean of 0.5 and 1");
        let mass: f64 = lumped_masses(&shrunk, 1.0).iter().sum();
        assert!((mass - 0.75).abs() < 1e-14, "half of one triangle is left: {mass}");
    }

    #[test]
    fn only_unequal_factors_need_a_warp() {
        let across = [0.0, 0.0, 1.0].into();
        let message = folded().with_scaled_patterns(&[[0.5, 1.0], [1.0; 2]], across).unwrap_err().to_string();
        assert!(message.starts_with("triangle 0 has no warp direction"), "{message}");
        let smaller = folded().with_scaled_patterns(&[[0.5; 2], [1.0; 2]], across).unwrap();
        assert!((norm(subtract(smaller.corners(0)[1], smaller.corners(0)[0])) - 0.5).abs() < 1e-15);
        let flat = folded().with_patterns(vec![[[0.0; 3]; 3], [[0.0; 3]; 3]]).unwrap_err();
        assert!(flat.to_string().starts_with("triangle 0 "), "{flat}");
    }
}
