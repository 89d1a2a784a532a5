//! A solid made of triangles. What is nearest to a vertex is a face, an edge or a corner, each with its declared element: three solids, each of which is
//! felt where its features are nearest.

use std::sync::Arc;

use energy_dsl::Vector3;
use energy_elements::{CapsuleContact, PlaneContact, SphereContact};

use super::solid::Solid;
use super::surface::{Feature, Nearest, Surface};
use crate::motion::Pose;

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
        let Nearest { distance, feature } = self.surface.nearest(self.pose.undone(x));
        let feature = match feature {
            Feature::Plane { point, normal } => {
                Feature::Plane { point: self.placed(point), normal: self.pose.turned_direction(normal) }
            }
            Feature::Edge(ends) => Feature::Edge(ends.map(|end| self.placed(end))),
            Feature::Corner(corner) => Feature::Corner(self.placed(corner)),
        };
        Nearest { distance, feature }
    }

    /// The distance, where a feature of some kind is the nearest; elsewhere infinite, and far from everything, where most of a cloth is, a lower bound.
    fn distance_if(&self, x: Vector3<f64>, is_mine: impl Fn(&Feature) -> bool) -> f64 {
        let at_least = self.surface.at_least(self.pose.undone(x));
        if at_least > 0.0 {
            return at_least;
        }
        let Nearest { distance, feature } = self.nearest(x);
        if is_mine(&feature) { distance } else { f64::INFINITY }
    }
}

/// Its faces; from inside also its edges and corners.
#[derive(Clone, Debug)]
pub(super) struct Faces(pub MeshSolid);

/// Its edges, from outside.
#[derive(Clone, Debug)]
pub(super) struct Edges(pub MeshSolid);

/// Its corners, from outside.
#[derive(Clone, Debug)]
pub(super) struct Corners(pub MeshSolid);

impl Solid for Faces {
    type Contact = PlaneContact;

    fn moved(&self, pose: &Pose) -> Self {
        Self(self.0.moved(pose))
    }

    fn signed_distance(&self, x: Vector3<f64>) -> f64 {
        self.0.distance_if(x, |feature| matches!(feature, Feature::Plane { .. }))
    }

    fn contact(&self, x: Vector3<f64>, k: f64, thickness: f64) -> Option<PlaneContact> {
        let Feature::Plane { point, normal } = self.0.nearest(x).feature else { return None };
        let radius = self.0.surface.radius();
        let point = std::array::from_fn(|axis| point[axis] + radius * normal[axis]);
        Some(PlaneContact::new(point, normal, k, thickness))
    }
}

impl Solid for Edges {
    type Contact = CapsuleContact;

    fn moved(&self, pose: &Pose) -> Self {
        Self(self.0.moved(pose))
    }

    fn signed_distance(&self, x: Vector3<f64>) -> f64 {
        self.0.distance_if(x, |feature| matches!(feature, Feature::Edge(_)))
    }

    fn contact(&self, x: Vector3<f64>, k: f64, thickness: f64) -> Option<CapsuleContact> {
        let Feature::Edge([a, b]) = self.0.nearest(x).feature else { return None };
        Some(CapsuleContact::new(a, b, self.0.surface.radius(), k, thickness))
    }
}

impl Solid for Corners {
    type Contact = SphereContact;

    fn moved(&self, pose: &Pose) -> Self {
        Self(self.0.moved(pose))
    }

    fn signed_distance(&self, x: Vector3<f64>) -> f64 {
        self.0.distance_if(x, |feature| matches!(feature, Feature::Corner(_)))
    }

    fn contact(&self, x: Vector3<f64>, k: f64, thickness: f64) -> Option<SphereContact> {
        let Feature::Corner(corner) = self.0.nearest(x).feature else { return None };
        Some(SphereContact::new(corner, self.0.surface.radius(), k, thickness))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{TriangleMesh, norm, subtract};
    use energy_dsl::Potential;

    /// A tetrahedron with a corner at the origin and edges along the axes.
    fn solid(radius: f64) -> MeshSolid {
        let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mesh = TriangleMesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap();
        MeshSolid::new(Surface::new(mesh, radius).unwrap())
    }

    /// Exactly one of the three feels a point, with k (δ − d)²/δ along the way on which the distance grows fastest.
    fn push(solid: &MeshSolid, x: Vector3<f64>) -> (&'static str, Vector3<f64>) {
        let (k, thickness) = (3.0, 0.5);
        let felt = [
            ("face", Faces(solid.clone()).contact(x, k, thickness).map(|one| one.gradient(&[x]).gradient[0])),
            ("edge", Edges(solid.clone()).contact(x, k, thickness).map(|one| one.gradient(&[x]).gradient[0])),
            ("corner", Corners(solid.clone()).contact(x, k, thickness).map(|one| one.gradient(&[x]).gradient[0])),
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
        assert!(Faces(solid(0.0)).signed_distance([9.0, 0.0, 0.0]) >= 7.9);
    }
}
