//! Vector arithmetic, rigid motions, boxes and hierarchies of boxes.

mod bounds;
mod hierarchy;
mod pose;

use energy_dsl::Vector3;

pub(crate) use bounds::Bounds;
pub(crate) use hierarchy::Hierarchy;
pub use pose::Pose;

pub(crate) fn subtract(a: Vector3<f64>, b: Vector3<f64>) -> Vector3<f64> {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

pub(crate) fn cross(a: Vector3<f64>, b: Vector3<f64>) -> Vector3<f64> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn dot(a: Vector3<f64>, b: Vector3<f64>) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn norm(a: Vector3<f64>) -> f64 {
    dot(a, a).sqrt()
}

/// a + s b.
#[inline]
pub(crate) fn add_scaled(a: Vector3<f64>, s: f64, b: Vector3<f64>) -> Vector3<f64> {
    std::array::from_fn(|axis| a[axis] + s * b[axis])
}
