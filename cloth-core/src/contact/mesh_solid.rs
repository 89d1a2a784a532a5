//! A solid made of triangles. What is nearest to a vertex is a face, an edge or a corner, each with its declared element: three solids, each of which is
//! felt where its features are nearest.

use std::sync::{Arc, Mutex, PoisonError};

use energy_dsl::Vector3;
use energy_elements::{CapsuleContact, PlaneContact, SphereContact};

use super::solid::Solid;
use super::surface::{Feature, Nearest, Surface};
use crate::geometry::{Pose, norm, subtract};

/// A surface of triangles, somewhere.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshSolid {
    surface: Arc<Surface>,
    pose: Pose,
}

impl MeshSolid {
    /// The solid within a surface, where the surface is.
    #[must_use]
    pub fn new(surface: Surface) -> Self {
        Self { surface: Arc::new(surface), pose: Pose::REST }
    }

    /// The surface, where it was.
    #[must_use]
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Where a point of it is now, in m.
    #[must_use]
    pub fn placed(&self, point: Vector3<f64>) -> Vector3<f64> {
        self.pose.applied(point)
    }

    pub(super) fn moved(&self, pose: &Pose) -> Self {
        Self { surface: Arc::clone(&self.surface), pose: self.pose.then(pose) }
    }

    /// The signed distance of a point, in m, with the feature that it is measured from, where it is now.
    #[must_use]
    pub fn nearest(&self, x: Vector3<f64>) -> Nearest {
        self.placed_nearest(self.surface.nearest(self.pose.undone(x)))
    }

    /// What is nearest to a point where the surface was, where it is now.
    fn placed_nearest(&self, Nearest { distance, feature }: Nearest) -> Nearest {
        let feature = match feature {
            Feature::Plane { point, normal } => {
                Feature::Plane { point: self.placed(point), normal: self.pose.turned_direction(normal) }
            }
            Feature::Edge(ends) => Feature::Edge(ends.map(|end| self.placed(end))),
            Feature::Corner(corner) => Feature::Corner(self.placed(corner)),
        };
        Nearest { distance, feature }
    }
}

/// A solid as the vertices of a cloth feel it. Of each vertex it remembers where it was looked for last, and what was nearest: no distance changes faster
/// than a vertex moves (unless the surface cuts itself, and is not that of a solid), so that most of them need not be looked for again, and those near by only once for faces, edges and corners.
#[derive(Clone, Debug)]
pub(super) struct Felt {
    solid: MeshSolid,
    /// By vertex; the same for all clones, wherever they moved, since positions are those relative to the surface.
    found: Arc<Mutex<Vec<Option<Found>>>>,
}

#[derive(Clone, Copy, Debug)]
struct Found {
    at: Vector3<f64>,
    nearest: Nearest,
}

impl Felt {
    /// By so many vertices.
    pub fn new(solid: MeshSolid, vertices: usize) -> Self {
        Self { solid, found: Arc::new(Mutex::new(vec![None; vertices])) }
    }

    fn moved(&self, pose: &Pose) -> Self {
        Self { solid: self.solid.moved(pose), found: Arc::clone(&self.found) }
    }

    /// By how much it is rounded, in m.
    fn radius(&self) -> f64 {
        self.solid.surface.radius()
    }

    /// What is nearest to a vertex, if that is nearer than the thickness.
    fn nearest_within(&self, vertex: usize, x: Vector3<f64>, thickness: f64) -> Option<Nearest> {
        let (surface, at) = (&self.solid.surface, self.solid.pose.undone(x));
        let mut found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        let nearest = match found[vertex] {
            Some(known) if known.at == at => known.nearest,
            Some(known) if known.nearest.distance - norm(subtract(at, known.at)) >= thickness => return None,
            _ if surface.at_least(at) >= thickness => return None,
            _ => {
                let nearest = surface.nearest(at);
                found[vertex] = Some(Found { at, nearest });
                nearest
            }
        };
        (nearest.distance < thickness).then(|| self.solid.placed_nearest(nearest))
    }
}

/// Its faces; from inside also its edges and corners.
#[derive(Clone, Debug)]
pub(super) struct Faces(pub Felt);

/// Its edges, from outside.
#[derive(Clone, Debug)]
pub(super) struct Edges(pub Felt);

/// Its corners, from outside.
#[derive(Clone, Debug)]
pub(super) struct Corners(pub Felt);

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

    /// Exactly one of the three feels a point, with k (δ − d)²/δ along the way on which the distance grows fastest.
    fn push(solid: &MeshSolid, x: Vector3<f64>) -> (&'static str, Vector3<f64>) {
        let (k, thickness) = (3.0, 0.5);
        let solid_felt = Felt::new(solid.clone(), 1);
        let [faces, edges, corners] = [solid_felt.clone(), solid_felt.clone(), solid_felt];
        let felt = [
            ("face", Faces(faces).touched(0, x, k, thickness).map(|one| one.gradient(&[x]).gradient[0])),
            ("edge", Edges(edges).touched(0, x, k, thickness).map(|one| one.gradient(&[x]).gradient[0])),
            ("corner", Corners(corners).touched(0, x, k, thickness).map(|one| one.gradient(&[x]).gradient[0])),
        ];
        let mut felt = felt.into_iter().filter_map(|(name, gradient)| Some((name, gradient?)));
        let (name, gradient) = felt.next().unwrap();
        assert!(felt.next().is_none());
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
        let pose = Pose::turned([0.3, -1.0, 0.5], 40.0, [0.1; 3]).shifted([0.5, 0.2, -0.1]);
        for radius in [0.0, 0.05] {
            let still = solid(radius);
            let moved = still.moved(&pose);
            for (x, name) in [
                ([0.2, 0.2, -0.1], "face"),
                ([0.5, -0.1, -0.1], "edge"),
                ([-0.1, -0.1, -0.05], "corner"),
                ([0.1, 0.2, 0.15], "face"),
            ] {
                let (felt, push_still) = push(&still, x);
                assert_eq!(felt, name);
                let (felt, push_moved) = push(&moved, pose.applied(x));
                assert_eq!(felt, name);
                assert!(norm(subtract(push_moved, pose.turned_direction(push_still))) < 1e-12);
            }
        }
        // A pose after a pose.
        let again = Pose::turned([0.0, 0.0, 1.0], 25.0, [0.0; 3]);
        let twice = solid(0.0).moved(&pose).moved(&again);
        let x = again.applied(pose.applied([0.2, 0.2, -0.1]));
        assert!((twice.nearest(x).distance - 0.1).abs() < 1e-12);
        assert!(Felt::new(solid(0.0), 1).nearest_within(0, [9.0, 0.0, 0.0], 7.0).is_none());
    }

    proptest! {
        /// Whatever is remembered, of this vertex or another, of this pose or an earlier one.
        #[test]
        fn what_is_remembered_changes_nothing(
            walk in prop::collection::vec((0..2_usize, prop::array::uniform3(-0.4..0.4_f64), 0.0..30.0_f64, any::<bool>()), 1..40),
        ) {
            let still = Felt::new(solid(0.02), 2);
            let mut x = [[0.3; 3], [-0.5; 3]];
            for (vertex, step, angle, straight) in walk {
                let pose = Pose::turned([1.0, 2.0, -1.0], angle, [0.0; 3]);
                let felt = still.moved(&pose);
                // Straight to the surface, as fast as the distance can fall, or any other way.
                let Nearest { distance, feature } = felt.solid.nearest(x[vertex]);
                let step = match feature {
                    Feature::Plane { normal, .. } if straight => normal.map(|component| (0.05 - distance) * component),
                    _ => step,
                };
                (0..3).for_each(|axis| x[vertex][axis] = (x[vertex][axis] + step[axis]).clamp(-1.5, 1.5));
                for thickness in [0.1, 0.3] {
                    let nearest = felt.solid.nearest(x[vertex]);
                    let expected = (nearest.distance < thickness).then_some(nearest);
                    prop_assert_eq!(felt.nearest_within(vertex, x[vertex], thickness), expected);
                }
            }
        }
    }

    #[test]
    fn vertices_that_stay_far_are_looked_for_once() {
        let felt = Felt::new(solid(0.0), 1);
        let at = |felt: &Felt| felt.found.lock().unwrap()[0].map(|found| found.at);
        assert!(felt.nearest_within(0, [0.6; 3], 0.1).is_none());
        assert_eq!(at(&felt), Some([0.6; 3]));
        assert!(felt.nearest_within(0, [0.55; 3], 0.1).is_none());
        assert_eq!(at(&felt), Some([0.6; 3]));
        assert!(felt.nearest_within(0, [0.35; 3], 0.1).is_some());
        assert_eq!(at(&felt), Some([0.35; 3]));
    }
}
