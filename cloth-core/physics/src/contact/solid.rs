//! Solids, their signed distances, and the declared elements of contact with them.

use energy_dsl::{Potential, Vector3};
use energy_elements::{BoxContact, CapsuleContact, PlaneContact, SphereContact};

use crate::geometry::{Pose, dot, norm, subtract};

/// A solid that acts on nearby vertices.
pub(super) trait Solid: Clone + std::fmt::Debug + Send + Sync + 'static {
    /// The declared element of contact.
    type Contact: Potential<f64, Points = [Vector3<f64>; 1]>;
    /// Returns the solid after a rigid motion.
    fn moved(&self, pose: &Pose) -> Self;
    /// Returns the element for a vertex at x with stiffness k (N/m); `None` if the vertex is not within the thickness
    /// (m).
    fn touched(&self, vertex: usize, x: Vector3<f64>, k: f64, thickness: f64) -> Option<Self::Contact>;
}

/// A solid with a closed formula for its signed distance.
pub(super) trait Shape: Clone + std::fmt::Debug + Send + Sync + 'static {
    /// The declared element of contact.
    type Contact: Potential<f64, Points = [Vector3<f64>; 1]>;
    /// Returns the shape after a rigid motion.
    fn moved(&self, pose: &Pose) -> Self;
    /// Returns the distance of a point from the surface, in m; negative inside.
    fn signed_distance(&self, x: Vector3<f64>) -> f64;
    /// Returns the element with stiffness k (N/m) and thickness δ (m).
    fn contact(&self, k: f64, thickness: f64) -> Self::Contact;
}

impl<S: Shape> Solid for S {
    type Contact = S::Contact;

    fn moved(&self, pose: &Pose) -> Self {
        Shape::moved(self, pose)
    }

    fn touched(&self, _vertex: usize, x: Vector3<f64>, k: f64, thickness: f64) -> Option<S::Contact> {
        (self.signed_distance(x) < thickness).then(|| self.contact(k, thickness))
    }
}

/// Everything below a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// A point on the plane, in m.
    pub point: Vector3<f64>,
    /// Unit normal, pointing out of the solid.
    pub normal: Vector3<f64>,
}

/// All points within a radius of a centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// The centre, in m.
    pub centre: Vector3<f64>,
    /// The radius, in m.
    pub radius: f64,
}

/// A capsule: all points within a radius of a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// Ends of the segment, in m.
    pub ends: [Vector3<f64>; 2],
    /// The radius, in m.
    pub radius: f64,
}

/// A rounded box: all points within a radius of a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundedBox {
    /// The centre, in m.
    pub centre: Vector3<f64>,
    /// Unit vectors along the edges.
    pub axes: [Vector3<f64>; 3],
    /// Half the edge lengths of the inner box, in m.
    pub half: Vector3<f64>,
    /// The radius of the rounding, in m.
    pub radius: f64,
}

impl Shape for HalfSpace {
    type Contact = PlaneContact;

    fn moved(&self, pose: &Pose) -> Self {
        Self { point: pose.transform(self.point), normal: pose.rotate(self.normal) }
    }

    fn signed_distance(&self, x: Vector3<f64>) -> f64 {
        dot(self.normal, subtract(x, self.point))
    }

    fn contact(&self, k: f64, thickness: f64) -> PlaneContact {
        PlaneContact::new(self.point, self.normal, k, thickness)
    }
}

impl Shape for Ball {
    type Contact = SphereContact;

    fn moved(&self, pose: &Pose) -> Self {
        Self { centre: pose.transform(self.centre), ..*self }
    }

    fn signed_distance(&self, x: Vector3<f64>) -> f64 {
        norm(subtract(x, self.centre)) - self.radius
    }

    fn contact(&self, k: f64, thickness: f64) -> SphereContact {
        SphereContact::new(self.centre, self.radius, k, thickness)
    }
}

impl Shape for Capsule {
    type Contact = CapsuleContact;

    fn moved(&self, pose: &Pose) -> Self {
        Self { ends: self.ends.map(|end| pose.transform(end)), ..*self }
    }

    fn signed_distance(&self, x: Vector3<f64>) -> f64 {
        let [a, b] = self.ends;
        let (offset, edge) = (subtract(x, a), subtract(b, a));
        let along = (dot(offset, edge) / dot(edge, edge)).clamp(0.0, 1.0);
        norm(std::array::from_fn(|axis| offset[axis] - along * edge[axis])) - self.radius
    }

    fn contact(&self, k: f64, thickness: f64) -> CapsuleContact {
        let [a, b] = self.ends;
        CapsuleContact::new(a, b, self.radius, k, thickness)
    }
}

impl Shape for RoundedBox {
    type Contact = BoxContact;

    fn moved(&self, pose: &Pose) -> Self {
        Self { centre: pose.transform(self.centre), axes: self.axes.map(|axis| pose.rotate(axis)), ..*self }
    }

    fn signed_distance(&self, x: Vector3<f64>) -> f64 {
        let offset = subtract(x, self.centre);
        let beyond: Vector3<f64> = std::array::from_fn(|i| dot(self.axes[i], offset).abs() - self.half[i]);
        let deepest = beyond.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let distance = if deepest > 0.0 { norm(beyond.map(|part| part.max(0.0))) } else { deepest };
        distance - self.radius
    }

    fn contact(&self, k: f64, thickness: f64) -> BoxContact {
        let [e1, e2, e3] = self.axes;
        BoxContact::new(self.centre, e1, e2, e3, self.half, self.radius, k, thickness)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that the element's force is k (δ − d)²/δ along the gradient of the signed distance.
    fn agrees(solid: impl Shape, x: Vector3<f64>, distance: f64) {
        let pose = Pose::rotation([0.3, -1.0, 0.5], 40.0, [0.1; 3]).translated([0.5, 0.2, -0.1]);
        let (k, thickness) = (3.0, 0.5);
        let moved = solid.moved(&pose);
        for (solid, x) in [(solid, x), (moved, pose.transform(x))] {
            let signed = solid.signed_distance(x);
            assert!((signed - distance).abs() < 1e-12, "got {signed}, expected {distance}");
            let push = solid.contact(k, thickness).gradient(&[x]).gradient[0].map(|component| -component);
            let size = k * (thickness - distance).max(0.0).powi(2) / thickness;
            assert!((norm(push) - size).abs() < 1e-12, "{push:?}");
            if size > 0.0 {
                let step: Vector3<f64> = std::array::from_fn(|axis| x[axis] + 1e-6 * push[axis] / size);
                assert!((solid.signed_distance(step) - distance - 1e-6).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn distances_and_elements_are_of_the_same_solid() {
        agrees(HalfSpace { point: [0.0, 0.0, 1.0], normal: [0.0, 0.0, 1.0] }, [5.0, 3.0, 1.2], 0.2);
        agrees(HalfSpace { point: [0.0, 0.0, 1.0], normal: [0.0, 0.0, 1.0] }, [5.0, 3.0, 2.2], 1.2);
        agrees(Ball { centre: [1.0, 0.0, 0.0], radius: 2.0 }, [1.0, 1.75, 0.0], -0.25);
        let capsule = Capsule { ends: [[0.0; 3], [4.0, 0.0, 0.0]], radius: 0.5 };
        agrees(capsule, [1.0, 0.8, 0.0], 0.3);
        agrees(capsule, [4.3, 0.0, 0.4], 0.0);
        let block = RoundedBox {
            centre: [0.0; 3],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            half: [1.0, 2.0, 3.0],
            radius: 0.1,
        };
        agrees(block, [0.2, 0.3, 3.3], 0.2);
        agrees(block, [1.3, 2.4, 0.3], 0.4);
        agrees(block, [0.5, 0.0, 0.1], -0.6);
    }
}
