use std::collections::BTreeMap;

use energy_dsl::Vector3;

use crate::geometry::{Bounds, Hierarchy, cross, dot, norm, subtract};
use crate::mesh::{TriangleMesh, vertex_angles};

/// A mesh that does not bound a solid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum SurfaceError {
    /// Two neighbouring triangles have opposite orientations.
    #[error(
        "triangles {} and {} traverse their edge {}–{} in the same direction, so one of them points inwards: \
         make the normals consistent",
        .triangles[0], .triangles[1], .edge[0], .edge[1]
    )]
    Inconsistent {
        /// The shared edge.
        edge: [usize; 2],
        triangles: [usize; 2],
    },
    /// A closed surface points inwards.
    #[error(
        "the surface is inside out (it encloses {volume:.3e} m³): flip its normals, so that corners run anticlockwise \
         seen from outside"
    )]
    InsideOut {
        /// The signed volume of the surface, in m³.
        volume: f64,
    },
    /// An open surface without rounding encloses no volume.
    #[error(
        "the surface is open ({edges} edges of one triangle, the first {}–{}), so it has no inside: close it, or give \
         it a thickness with `rounding`, in m",
        .edge[0], .edge[1]
    )]
    Open {
        /// The first boundary edge.
        edge: [usize; 2],
        /// The number of boundary edges.
        edges: usize,
    },
}

/// The boundary of a solid: an outward-pointing triangle mesh, optionally rounded. A rounding radius adds all points
/// within that distance to the solid. An open surface is a shell, which consists of these points only.
///
/// The sign of the distance follows from the angle-weighted normal of the nearest feature (Bærentzen & Aanæs 2005).
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    mesh: TriangleMesh,
    radius: f64,
    is_closed: bool,
    face_normals: Vec<Vector3<f64>>,
    vertex_normals: Vec<Vector3<f64>>,
    /// Normals of the edges from each corner of a triangle to the next.
    edge_normals: Vec<[Vector3<f64>; 3]>,
    hierarchy: Hierarchy,
}

/// The closest feature of a surface, as a primitive with the same distance function nearby.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feature {
    /// A half-space: of a face, or, inside a solid, across the direction to the nearest edge or corner.
    Plane {
        /// A point on the plane, in m.
        point: Vector3<f64>,
        /// Unit normal, pointing out of the solid.
        normal: Vector3<f64>,
    },
    /// An edge between two points, seen from outside.
    Edge([Vector3<f64>; 2]),
    /// A corner, seen from outside.
    Corner(Vector3<f64>),
}

/// The nearest feature and the distance from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Signed distance from the rounded solid, in m; negative inside.
    pub distance: f64,
    /// The nearest feature of the unrounded surface.
    pub feature: Feature,
}

/// The part of a triangle that a closest point lies on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Region {
    Face,
    /// The edge from this corner to the next.
    Edge(usize),
    Corner(usize),
}

impl Surface {
    /// Creates a surface from a mesh, rounded by a radius in m.
    ///
    /// # Errors
    /// Returns an error if orientations are inconsistent, a closed surface is inside out, or an open one has radius 0.
    pub fn new(mesh: TriangleMesh, radius: f64) -> Result<Self, SurfaceError> {
        let rim = rim(&mesh)?;
        let is_closed = rim.is_empty();
        if let (Some(&edge), true) = (rim.first(), radius == 0.0) {
            return Err(SurfaceError::Open { edge, edges: rim.len() });
        }
        let volume = (0..mesh.triangles().len()).map(|triangle| cone(mesh.corners(triangle))).sum::<f64>();
        if is_closed && volume <= 0.0 {
            return Err(SurfaceError::InsideOut { volume });
        }
        Ok(Self::with_normals(mesh, radius, is_closed))
    }

    /// Returns the surface in another shape. Its orientation stays.
    pub(super) fn with_vertices(&self, vertices: Vec<Vector3<f64>>) -> Self {
        Self::with_normals(self.mesh.clone().with_vertices(vertices), self.radius, self.is_closed)
    }

    fn with_normals(mesh: TriangleMesh, radius: f64, is_closed: bool) -> Self {
        let corners = |triangle: usize| mesh.corners(triangle);
        let count = mesh.triangles().len();
        let face_normals: Vec<Vector3<f64>> = (0..count).map(|triangle| unit_normal(corners(triangle))).collect();
        let mut vertex_normals = vec![[0.0; 3]; mesh.vertices().len()];
        let mut sums: BTreeMap<[usize; 2], Vector3<f64>> = BTreeMap::new();
        for (triangle, vertices) in mesh.triangles().iter().enumerate() {
            let angles = vertex_angles(corners(triangle));
            for corner in 0..3 {
                let (from, to) = (vertices[corner], vertices[(corner + 1) % 3]);
                add(&mut vertex_normals[from], angles[corner], face_normals[triangle]);
                add(sums.entry([from.min(to), from.max(to)]).or_default(), 1.0, face_normals[triangle]);
            }
        }
        let edge_normal = |from: usize, to: usize| sums.get(&[from.min(to), from.max(to)]).copied().unwrap_or_default();
        let edge_normals =
            mesh.triangles().iter().map(|&[a, b, c]| [edge_normal(a, b), edge_normal(b, c), edge_normal(c, a)]);
        let edge_normals = edge_normals.collect();
        let bounds: Vec<Bounds> = (0..count).map(|triangle| Bounds::of(&corners(triangle))).collect();
        let hierarchy = Hierarchy::new(&bounds);
        Self { mesh, radius, is_closed, face_normals, vertex_normals, edge_normals, hierarchy }
    }

    /// The mesh, without rounding.
    #[must_use]
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// The radius of the rounding, in m.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Whether the mesh has no boundary edges.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// Returns a cheap lower bound on the distance of a point, in m: the distance from the bounding box.
    #[must_use]
    pub fn distance_bound(&self, x: Vector3<f64>) -> f64 {
        self.hierarchy.distance(x) - self.radius
    }

    /// Returns the signed distance of a point, and the feature that it refers to.
    #[must_use]
    pub fn nearest(&self, x: Vector3<f64>) -> Nearest {
        let found = self.hierarchy.nearest(x, |triangle| {
            let (closest, region) = closest(self.mesh.corners(triangle), x);
            let offset = subtract(x, closest);
            (dot(offset, offset), (triangle, closest, region))
        });
        // A mesh has at least one triangle, so this never happens.
        let Some((_, (triangle, closest, region))) = found else {
            return Nearest { distance: f64::INFINITY, feature: Feature::Corner(x) };
        };
        let offset = subtract(x, closest);
        let outwards = match region {
            Region::Face => self.face_normals[triangle],
            Region::Edge(edge) => self.edge_normals[triangle][edge],
            Region::Corner(corner) => self.vertex_normals[self.mesh.triangles()[triangle][corner]],
        };
        let is_inside = dot(offset, outwards) < 0.0;
        let corners = self.mesh.corners(triangle);
        let length = norm(offset);
        let (distance, feature) = match region {
            // The distance from the plane equals the length, without cancellation if the length is small.
            Region::Face => {
                let height = dot(outwards, subtract(x, corners[0]));
                let side = if is_inside && !self.is_closed { -1.0 } else { 1.0 };
                let normal = outwards.map(|component| side * component);
                (side * height, Feature::Plane { point: corners[0], normal })
            }
            _ if is_inside && self.is_closed => {
                (-length, Feature::Plane { point: closest, normal: offset.map(|component| -component / length) })
            }
            Region::Edge(edge) => (length, Feature::Edge([corners[edge], corners[(edge + 1) % 3]])),
            Region::Corner(corner) => (length, Feature::Corner(corners[corner])),
        };
        Nearest { distance: distance - self.radius, feature }
    }
}

fn add(sum: &mut Vector3<f64>, weight: f64, vector: Vector3<f64>) {
    (0..3).for_each(|axis| sum[axis] += weight * vector[axis]);
}

fn unit_normal([a, b, c]: [Vector3<f64>; 3]) -> Vector3<f64> {
    let normal = cross(subtract(b, a), subtract(c, a));
    normal.map(|component| component / norm(normal))
}

/// The signed volume of the tetrahedron between a triangle and the origin.
fn cone([a, b, c]: [Vector3<f64>; 3]) -> f64 {
    dot(a, cross(b, c)) / 6.0
}

/// Returns the edges with one triangle. Returns an error if two triangles traverse an edge in the same direction.
fn rim(mesh: &TriangleMesh) -> Result<Vec<[usize; 2]>, SurfaceError> {
    let mut along: BTreeMap<[usize; 2], usize> = BTreeMap::new();
    for (triangle, &[a, b, c]) in mesh.triangles().iter().enumerate() {
        for edge in [[a, b], [b, c], [c, a]] {
            if let Some(other) = along.insert(edge, triangle) {
                return Err(SurfaceError::Inconsistent { edge, triangles: [other, triangle] });
            }
        }
    }
    Ok(along.keys().filter(|[from, to]| !along.contains_key(&[*to, *from])).copied().collect())
}

/// Returns the closest point of a triangle and the part that it lies on (Ericson, Real-Time Collision Detection,
/// §5.1.5).
fn closest([a, b, c]: [Vector3<f64>; 3], x: Vector3<f64>) -> (Vector3<f64>, Region) {
    let (ab, ac, ax) = (subtract(b, a), subtract(c, a), subtract(x, a));
    let (d1, d2) = (dot(ab, ax), dot(ac, ax));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (a, Region::Corner(0));
    }
    let bx = subtract(x, b);
    let (d3, d4) = (dot(ab, bx), dot(ac, bx));
    if d3 >= 0.0 && d4 <= d3 {
        return (b, Region::Corner(1));
    }
    let on = |from: Vector3<f64>, offset: Vector3<f64>, part: f64| std::array::from_fn(|i| from[i] + part * offset[i]);
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (on(a, ab, d1 / (d1 - d3)), Region::Edge(0));
    }
    let cx = subtract(x, c);
    let (d5, d6) = (dot(ab, cx), dot(ac, cx));
    if d6 >= 0.0 && d5 <= d6 {
        return (c, Region::Corner(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (on(a, ac, d2 / (d2 - d6)), Region::Edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return (on(b, subtract(c, b), (d4 - d3) / ((d4 - d3) + (d5 - d6))), Region::Edge(1));
    }
    let sum = va + vb + vc;
    let (v, w) = (vb / sum, vc / sum);
    (std::array::from_fn(|i| a[i] + v * ab[i] + w * ac[i]), Region::Face)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// An L-shaped prism, with convex and reflex edges and corners.
    fn bracket() -> TriangleMesh {
        let outline = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let at = |z: f64| outline.map(|[x, y]| [x, y, z]);
        let vertices: Vec<Vector3<f64>> = at(0.0).into_iter().chain(at(1.0)).collect();
        // A triangulation of the outline.
        let top = [[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]];
        let mut triangles: Vec<[usize; 3]> = top.iter().map(|corners| corners.map(|corner| 6 + corner)).collect();
        triangles.extend(top.iter().map(|&[a, b, c]| [a, c, b]));
        for corner in 0..6 {
            let next = (corner + 1) % 6;
            triangles.extend([[corner, next, 6 + next], [corner, 6 + next, 6 + corner]]);
        }
        TriangleMesh::new(vertices, triangles).unwrap()
    }

    /// The exact signed distance: the smallest distance from its rectangles, with the sign from a union of two boxes.
    fn exact(x: Vector3<f64>) -> f64 {
        let within = |low: [f64; 3], high: [f64; 3]| (0..3).all(|i| x[i] >= low[i] && x[i] <= high[i]);
        let inside = within([0.0; 3], [2.0, 1.0, 1.0]) || within([0.0; 3], [1.0, 2.0, 1.0]);
        let sides = [
            ([0.0, 0.0, 0.0], [2.0, 0.0, 1.0]),
            ([2.0, 0.0, 0.0], [2.0, 1.0, 1.0]),
            ([1.0, 1.0, 0.0], [2.0, 1.0, 1.0]),
            ([1.0, 1.0, 0.0], [1.0, 2.0, 1.0]),
            ([0.0, 2.0, 0.0], [1.0, 2.0, 1.0]),
            ([0.0, 0.0, 0.0], [0.0, 2.0, 1.0]),
            ([0.0, 0.0, 0.0], [2.0, 1.0, 0.0]),
            ([0.0, 0.0, 0.0], [1.0, 2.0, 0.0]),
            ([0.0, 0.0, 1.0], [2.0, 1.0, 1.0]),
            ([0.0, 0.0, 1.0], [1.0, 2.0, 1.0]),
        ];
        let from =
            |&(low, high): &([f64; 3], [f64; 3])| norm(std::array::from_fn(|i| x[i] - x[i].clamp(low[i], high[i])));
        let least = sides.iter().map(from).fold(f64::INFINITY, f64::min);
        if inside { -least } else { least }
    }

    proptest! {
        #[test]
        fn distances_match_the_exact_solid(
            x in -1.0..3.0_f64, y in -1.0..3.0_f64, z in -1.0..2.0_f64, radius in 0.0..0.3_f64,
        ) {
            let surface = Surface::new(bracket(), radius).unwrap();
            let Nearest { distance, feature } = surface.nearest([x, y, z]);
            prop_assert!((distance - (exact([x, y, z]) - radius)).abs() < 1e-12, "{distance} {feature:?}");
            prop_assert!(surface.distance_bound([x, y, z]) <= distance.max(0.0) + 1e-12);
            // The feature alone gives the same distance.
            let alone = match feature {
                Feature::Plane { point, normal } => dot(normal, subtract([x, y, z], point)),
                Feature::Edge([a, b]) => {
                    let (offset, edge) = (subtract([x, y, z], a), subtract(b, a));
                    let part = (dot(offset, edge) / dot(edge, edge)).clamp(0.0, 1.0);
                    norm(std::array::from_fn(|i| offset[i] - part * edge[i]))
                }
                Feature::Corner(corner) => norm(subtract([x, y, z], corner)),
            };
            prop_assert!((alone - radius - distance).abs() < 1e-12, "{alone} {distance} {feature:?}");
        }

        /// Next to a sharp edge, the normal of one face gives the wrong sign.
        #[test]
        fn sharp_edges_and_corners_have_an_inside(x in -0.5..1.5_f64, y in -0.3..0.3_f64, z in -0.3..1.3_f64) {
            let vertices: Vec<Vector3<f64>> = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.5, 0.1, 0.0], [0.4, 0.0, 1.0]];
            let triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
            let wedge = Surface::new(TriangleMesh::new(vertices, triangles).unwrap(), 0.0).unwrap();
            let height = |triangle: usize| {
                dot(wedge.face_normals[triangle], subtract([x, y, z], wedge.mesh.corners(triangle)[0]))
            };
            // The wedge is convex: inside means below all planes.
            let highest = (0..4).map(height).fold(f64::NEG_INFINITY, f64::max);
            let distance = wedge.nearest([x, y, z]).distance;
            prop_assert_eq!(distance > 0.0, highest > 0.0, "{} {}", distance, highest);
        }

        /// Compares with a search over all triangles.
        #[test]
        fn the_hierarchy_finds_the_nearest_triangle(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 9..60),
            x in prop::array::uniform3(-2.0..2.0_f64),
        ) {
            let triangles: Vec<[Vector3<f64>; 3]> = points.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
            let bounds: Vec<Bounds> = triangles.iter().map(|corners| Bounds::of(corners)).collect();
            let square = |triangle: usize| {
                let offset = subtract(x, closest(triangles[triangle], x).0);
                dot(offset, offset)
            };
            let found = Hierarchy::new(&bounds).nearest(x, |triangle| (square(triangle), ())).unwrap().0;
            let least = (0..triangles.len()).map(square).fold(f64::INFINITY, f64::min);
            prop_assert_eq!(found, least);
            // Every other point of the triangle is at least as far away.
            for corners in &triangles {
                let (near, _) = closest(*corners, x);
                let least = norm(subtract(x, near));
                for i in 0..=8 {
                    for j in 0..=8 - i {
                        let [u, v] = [f64::from(i) / 8.0, f64::from(j) / 8.0];
                        let w = 1.0 - u - v;
                        let p = std::array::from_fn(|k| u * corners[0][k] + v * corners[1][k] + w * corners[2][k]);
                        prop_assert!(norm(subtract(x, p)) >= least - 1e-12);
                    }
                }
            }
        }
    }

    #[test]
    fn an_open_surface_is_a_symmetric_shell() {
        let square = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = TriangleMesh::new(square, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let shell = Surface::new(mesh.clone(), 0.1).unwrap();
        assert!(!shell.is_closed());
        for (z, distance) in [(0.3, 0.2), (-0.3, 0.2), (0.05, -0.05), (-0.05, -0.05)] {
            let nearest = shell.nearest([0.7, 0.2, z]);
            assert!((nearest.distance - distance).abs() < 1e-15, "{nearest:?}");
        }
        assert!((shell.nearest([1.3, 0.5, -0.4]).distance - 0.4).abs() < 1e-15);
        let message = Surface::new(mesh, 0.0).unwrap_err().to_string();
        assert!(
            message.contains("open (4 edges of one triangle, the first 0–1)") && message.contains("`rounding`"),
            "{message}"
        );
    }

    #[test]
    fn wrong_orientations_are_rejected() {
        let mesh = bracket();
        let flipped: Vec<[usize; 3]> = mesh.triangles().iter().map(|&[a, b, c]| [a, c, b]).collect();
        let turned = TriangleMesh::new(mesh.vertices().to_vec(), flipped).unwrap();
        let message = Surface::new(turned, 0.0).unwrap_err().to_string();
        assert!(message.contains("inside out (it encloses -3.000e0 m³): flip its normals"), "{message}");
        let mut triangles = mesh.triangles().to_vec();
        triangles[1].swap(0, 1);
        let mixed = TriangleMesh::new(mesh.vertices().to_vec(), triangles).unwrap();
        let message = Surface::new(mixed, 0.0).unwrap_err().to_string();
        assert!(
            message.contains("traverse their edge") && message.contains("make the normals consistent"),
            "{message}"
        );
    }
}
