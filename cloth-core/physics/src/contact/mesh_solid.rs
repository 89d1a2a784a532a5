//! A solid bounded by a triangle mesh. The feature nearest to a vertex is a face, an edge or a corner, each with its
//! own declared element. The mesh acts as three solids, each active where its features are nearest.

use std::sync::{Arc, Mutex, PoisonError};

use energy_dsl::Vector3;
use energy_elements::{CapsuleContact, PlaneContact, SphereContact};

use super::solid::Solid;
use super::surface::{Feature, Nearest, Surface};
use crate::geometry::{Pose, norm, subtract};

/// A solid bounded by a triangle mesh, with a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshSolid {
    surface: Arc<Surface>,
    pose: Pose,
}

impl MeshSolid {
    /// Creates the solid of a surface, at the pose of the surface.
    #[must_use]
    pub fn new(surface: Surface) -> Self {
        Self { surface: Arc::new(surface), pose: Pose::IDENTITY }
    }

    /// Returns the solid with its surface in another shape.
    pub(super) fn with_vertices(&self, vertices: Vec<Vector3<f64>>) -> Self {
        Self { surface: Arc::new(self.surface.with_vertices(vertices)), pose: self.pose }
    }

    /// The surface before its motion.
    #[must_use]
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Returns the current position of a point of the surface, in m.
    #[must_use]
    pub fn transform(&self, point: Vector3<f64>) -> Vector3<f64> {
        self.pose.transform(point)
    }

    pub(super) fn moved(&self, pose: &Pose) -> Self {
        Self { surface: Arc::clone(&self.surface), pose: self.pose.then(pose) }
    }

    /// Returns the signed distance of a point, in m, and the nearest feature at its current pose.
    #[must_use]
    pub fn nearest(&self, x: Vector3<f64>) -> Nearest {
        self.transform_nearest(self.surface.nearest(self.pose.inverse_transform(x)))
    }

    /// Moves a feature from the pose of the surface to the current pose.
    fn transform_nearest(&self, Nearest { distance, feature }: Nearest) -> Nearest {
        let feature = match feature {
            Feature::Plane { point, normal } => {
                Feature::Plane { point: self.transform(point), normal: self.pose.rotate(normal) }
            }
            Feature::Edge(ends) => Feature::Edge(ends.map(|end| self.transform(end))),
            Feature::Corner(corner) => Feature::Corner(self.transform(corner)),
        };
        Nearest { distance, feature }
    }
}

/// A mesh solid with a cache of the last query of each vertex.
///
/// A distance changes by at most the motion of the vertex, so most queries are answered from the cache. Nearby vertices
/// are searched once for faces, edges and corners. The bound does not hold for a surface that intersects itself, which
/// bounds no solid.
#[derive(Clone, Debug)]
pub(super) struct CachedMesh {
    solid: MeshSolid,
    /// One entry per vertex, shared by all clones. Positions are relative to the surface, so moving the solid keeps
    /// entries valid.
    found: Arc<Mutex<Vec<Option<CachedQuery>>>>,
}

#[derive(Clone, Copy, Debug)]
struct CachedQuery {
    at: Vector3<f64>,
    nearest: Nearest,
}

impl CachedMesh {
    /// Creates an empty cache for `vertices` vertices.
    pub fn new(solid: MeshSolid, vertices: usize) -> Self {
        Self { solid, found: Arc::new(Mutex::new(vec![None; vertices])) }
    }

    fn moved(&self, pose: &Pose) -> Self {
        Self { solid: self.solid.moved(pose), found: Arc::clone(&self.found) }
    }

    /// The radius of the rounding, in m.
    fn radius(&self) -> f64 {
        self.solid.surface.radius()
    }

    /// Returns the feature nearest to a vertex; `None` if it is not within the thickness.
    fn nearest_within(&self, vertex: usize, x: Vector3<f64>, thickness: f64) -> Option<Nearest> {
        let (surface, at) = (&self.solid.surface, self.solid.pose.inverse_transform(x));
        let mut found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        let nearest = match found[vertex] {
            Some(known) if known.at == at => known.nearest,
            Some(known) if known.nearest.distance - norm(subtract(at, known.at)) >= thickness => return None,
            _ if surface.distance_bound(at) >= thickness => return None,
            _ => {
                let nearest = surface.nearest(at);
                found[vertex] = Some(CachedQuery { at, nearest });
                nearest
            }
        };
        (nearest.distance < thickness).then(|| self.solid.transform_nearest(nearest))
    }
}

/// The faces, and from inside also the edges and corners.
#[derive(Clone, Debug)]
pub(super) struct Faces(pub CachedMesh);

/// The edges, from outside.
#[derive(Clone, Debug)]
pub(super) struct Edges(pub CachedMesh);

/// The corners, from outside.
#[derive(Clone, Debug)]
pub(super) struct Corners(pub CachedMesh);

impl Solid for Faces {
    type Contact = PlaneContact;

    fn moved(&self, pose: &Pose) -> Self {
        Self(self.0.moved(pose))
    }

    fn touched(&self, vertex: usize, x: Vector3<f64>, k: f64, thickness: f64) -> Option<PlaneContact> {
        let nearest = self.0.nearest_within(vertex, x, thickness)?;
        let Feature::Plane { point, normal } = nearest.feature else { return None };
        let point = std::array::from_fn(|axis| point[axis] + self.0.radius() * normal[axis]);
        Some(PlaneContact::new(point, normal, k, thickness))
    }
}

impl Solid for Edges {
    type Contact = CapsuleContact;

    fn moved(&self, pose: &Pose) -> Self {
        Self(self.0.moved(pose))
    }

    fn touched(&self, vertex: usize, x: Vector3<f64>, k: f64, thickness: f64) -> Option<CapsuleContact> {
        let Feature::Edge([a, b]) = self.0.nearest_within(vertex, x, thickness)?.feature else { return None };
        Some(CapsuleContact::new(a, b, self.0.radius(), k, thickness))
    }
}

impl Solid for Corners {
    type Contact = SphereContact;

    fn moved(&self, pose: &Pose) -> Self {
        Self(self.0.moved(pose))
    }

    fn touched(&self, vertex: usize, x: Vector3<f64>, k: f64, thickness: f64) -> Option<SphereContact> {
        let Feature::Corner(corner) = self.0.nearest_within(vertex, x, thickness)?.feature else { return None };
        Some(SphereContact::new(corner, self.0.radius(), k, thickness))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriangleMesh;
    use energy_dsl::Potential;
    use proptest::prelude::*;

    /// A tetrahedron with a corner at the origin and edges along the axes.
    fn solid(radius: f64) -> MeshSolid {
        let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mesh = TriangleMesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap();
        MeshSolid::new(Surface::new(mesh, radius).unwrap())
    }

    /// Checks that exactly one of the three solids acts on a point, with force k (δ − d)²/δ along the gradient of the
    /// distance.
    fn push(solid: &MeshSolid, x: Vector3<f64>) -> (&'static str, Vector3<f64>) {
        let (k, thickness) = (3.0, 0.5);
        let solid_felt = CachedMesh::new(solid.clone(), 1);
        let [faces, edges, corners] = [solid_felt.clone(), solid_felt.clone(), solid_felt];
        let cached = [
            ("face", Faces(faces).touched(0, x, k, thickness).map(|one| one.gradient(&[x]).gradient[0])),
            ("edge", Edges(edges).touched(0, x, k, thickness).map(|one| one.gradient(&[x]).gradient[0])),
            ("corner", Corners(corners).touched(0, x, k, thickness).map(|one| one.gradient(&[x]).gradient[0])),
        ];
        let mut cached = cached.into_iter().filter_map(|(name, gradient)| Some((name, gradient?)));
        let (name, gradient) = cached.next().unwrap();
        assert!(cached.next().is_none());
        let push = gradient.map(|component| -component);
        let distance = solid.nearest(x).distance;
        let size = k * (thickness - distance).max(0.0).powi(2) / thickness;
        assert!((norm(push) - size).abs() < 1e-12, "{name} at {x:?}: {push:?}, {distance}");
        let step = std::array::from_fn(|axis| x[axis] + 1e-6 * push[axis] / size);
        assert!((solid.nearest(step).distance - distance - 1e-6).abs() < 1e-10);
        (name, push)
    }

    #[test]
    fn each_feature_pushes_along_the_distance() {
        let pose = Pose::rotation([0.3, -1.0, 0.5], 40.0, [0.1; 3]).translated([0.5, 0.2, -0.1]);
        for radius in [0.0, 0.05] {
            let still = solid(radius);
            let moved = still.moved(&pose);
            for (x, name) in [
                ([0.2, 0.2, -0.1], "face"),
                ([0.5, -0.1, -0.1], "edge"),
                ([-0.1, -0.1, -0.05], "corner"),
                ([0.1, 0.2, 0.15], "face"),
            ] {
                let (cached, push_still) = push(&still, x);
                assert_eq!(cached, name);
                let (cached, push_moved) = push(&moved, pose.transform(x));
                assert_eq!(cached, name);
                assert!(norm(subtract(push_moved, pose.rotate(push_still))) < 1e-12);
            }
        }
        // A pose composed with a pose.
        let again = Pose::rotation([0.0, 0.0, 1.0], 25.0, [0.0; 3]);
        let twice = solid(0.0).moved(&pose).moved(&again);
        let x = again.transform(pose.transform([0.2, 0.2, -0.1]));
        assert!((twice.nearest(x).distance - 0.1).abs() < 1e-12);
        assert!(CachedMesh::new(solid(0.0), 1).nearest_within(0, [9.0, 0.0, 0.0], 7.0).is_none());
    }

    proptest! {
        /// The cache gives correct results after any sequence of vertices and poses.
        #[test]
        fn what_is_remembered_changes_nothing(
            walk in prop::collection::vec(
                (0..2_usize, prop::array::uniform3(-0.4..0.4_f64), 0.0..30.0_f64, any::<bool>()),
                1..40,
            ),
        ) {
            let still = CachedMesh::new(solid(0.02), 2);
            let mut x = [[0.3; 3], [-0.5; 3]];
            for (vertex, step, angle, straight) in walk {
                let pose = Pose::rotation([1.0, 2.0, -1.0], angle, [0.0; 3]);
                let cached = still.moved(&pose);
                // Straight to the surface, where the distance falls fastest, or in any other direction.
                let Nearest { distance, feature } = cached.solid.nearest(x[vertex]);
                let step = match feature {
                    Feature::Plane { normal, .. } if straight => normal.map(|component| (0.05 - distance) * component),
                    _ => step,
                };
                (0..3).for_each(|axis| x[vertex][axis] = (x[vertex][axis] + step[axis]).clamp(-1.5, 1.5));
                for thickness in [0.1, 0.3] {
                    let nearest = cached.solid.nearest(x[vertex]);
                    let expected = (nearest.distance < thickness).then_some(nearest);
                    prop_assert_eq!(cached.nearest_within(vertex, x[vertex], thickness), expected);
                }
            }
        }
    }

    #[test]
    fn vertices_that_stay_far_are_looked_for_once() {
        let cached = CachedMesh::new(solid(0.0), 1);
        let at = |cached: &CachedMesh| cached.found.lock().unwrap()[0].map(|found| found.at);
        assert!(cached.nearest_within(0, [0.6; 3], 0.1).is_none());
        assert_eq!(at(&cached), Some([0.6; 3]));
        assert!(cached.nearest_within(0, [0.55; 3], 0.1).is_none());
        assert_eq!(at(&cached), Some([0.6; 3]));
        assert!(cached.nearest_within(0, [0.35; 3], 0.1).is_some());
        assert_eq!(at(&cached), Some([0.35; 3]));
    }
}
