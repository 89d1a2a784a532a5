//! Triangle meshes: reading, building, validation and topology.

mod disc;
mod obj;
mod pieces;
mod rest;
mod sheet;
mod strip;
mod topology;
mod triangle_mesh;

pub use disc::Disc;
pub use obj::{ObjError, read_obj};
pub(crate) use pieces::Groups;
pub use rest::{MaterialTriangle, lumped_masses, material_triangle, rest_angle, thread_triangle, vertex_angles};
pub use sheet::{Diagonals, Plane, Pleats, PleatsError, Sheet};
pub use strip::Strip;
pub use topology::{Hinge, SpringNetwork, Topology};
pub use triangle_mesh::{MeshError, TriangleMesh};

use energy_dsl::Vector3;

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
