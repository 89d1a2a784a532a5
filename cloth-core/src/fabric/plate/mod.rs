//! Mesh-independent plate bending: a curvature tensor for each triangle, made of dihedral angles.
//!
//! On triangle T with area A, edges of length ‖e‖ and normals n in its plane that point outwards,
//!
//! A κ = Σ ‖e‖ p n ⊗ n,  p = ½ (θ − θ̄) ± φ,  U = Σ ½ A κᵀ D κ,
//!
//! p the angle between T's own normal and the surface's normal at the middle of the edge, and θ the dihedral angle as the arc over the facets has it
//! ([`ArcAngle`](energy_elements::ArcAngle)). That is the lowest element of Hellan, Herrmann
//! and Johnson (Comodi 1989), where the normal at an edge is an unknown of its own; in Grinspun, Gingold, Reisman and Zorin 2006 it
//! is half-way between the two triangles' (φ = 0), with which only regular lattices bend as the plate does. Here the *tilt* φ is what it
//! must be for every quadratic height field, written with the dihedral angles θ near the edge: φ = Σ c (θ − θ̄), c of least norm
//! ([`Tilts`]). So
//!
//! * κ is the curvature tensor wherever that is constant: the energy is exact there;
//! * what leaves a triangle through an edge enters its neighbour (± φ): in a state of constant curvature no inner vertex feels a force.
//!
//! Both together are the patch test: a flat sheet has the rigidity D in every direction on every mesh, for any D. At free edges p is eliminated
//! by its natural condition, no bending moment.

mod assembly;
mod rigidity;
mod term;
mod tilt;

pub use rigidity::{Rigidity, RigidityError};
pub use term::{PlateError, PlateTerm};
pub use tilt::Tilts;

use crate::mesh::{Topology, TriangleMesh, area, material_triangle, thread_triangle};
use energy_dsl::Vector3;

/// A mesh whose triangles cannot be given the directions of the threads.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("triangle {triangle} stands across the warp direction {warp:?}; choose a warp direction along the cloth")]
pub struct ThreadError {
    /// The triangle.
    pub triangle: usize,
    /// The direction of the warp.
    pub warp: Vector3<f64>,
}

/// How the curvature of one triangle depends on dihedral angles: κ = Σ b (θ − θ̄).
#[derive(Clone, Debug, PartialEq)]
pub struct Curvature {
    /// The triangle's area at rest, in m².
    pub area: f64,
    /// The hinges and their b, in 1/m, on (κ_uu, κ_vv, 2κ_uv) along warp and weft.
    pub angles: Vec<(usize, [f64; 3])>,
    /// ‖e‖/A n ⊗ n of the free edges, in 1/m, laid out likewise.
    pub free: Vec<[f64; 3]>,
}

/// The curvatures of all triangles by the hinges of `topology`; along each triangle's first edge where there is no warp.
///
/// # Errors
/// When the warp stands across a triangle.
pub fn curvatures(
    mesh: &TriangleMesh,
    topology: &Topology,
    warp: Option<Vector3<f64>>,
) -> Result<Vec<Curvature>, ThreadError> {
    let tilts = Tilts::of(mesh, topology, warp)?;
    let mut curvatures = Vec::with_capacity(mesh.triangles().len());
    for (triangle, sides) in tilts.sides.iter().enumerate() {
        let area = area(mesh.corners(triangle));
        let mut curvature = Curvature { area, angles: Vec::new(), free: Vec::new() };
        for side in sides {
            let [n, m] = side.normal;
            let weight = [n * n, m * m, 2.0 * n * m].map(|product| side.length / area * product);
            let Some(hinge) = side.hinge else {
                curvature.free.push(weight);
                continue;
            };
            add(&mut curvature.angles, hinge, 0.5, weight);
            let sign = if topology.hinges[hinge].triangles[0] == triangle { 1.0 } else { -1.0 };
            for &(other, part) in &tilts.tilts[hinge] {
                add(&mut curvature.angles, other, sign * part, weight);
            }
        }
        curvature.angles.retain(|(_, b)| b.iter().any(|component| component.abs() > 1e-12 * weight_scale(sides, area)));
        curvatures.push(curvature);
    }
    Ok(curvatures)
}

fn weight_scale(sides: &[tilt::Side; 3], area: f64) -> f64 {
    sides.iter().map(|side| side.length).fold(0.0, f64::max) / area
}

fn add(angles: &mut Vec<(usize, [f64; 3])>, hinge: usize, scale: f64, weight: [f64; 3]) {
    let part = weight.map(|component| scale * component);
    match angles.iter_mut().find(|(known, _)| *known == hinge) {
        Some((_, sum)) => (0..3).for_each(|component| sum[component] += part[component]),
        None => angles.push((hinge, part)),
    }
}

/// The corners laid in the plane: along warp and weft, or along the first edge.
fn laid(mesh: &TriangleMesh, triangle: usize, warp: Option<Vector3<f64>>) -> Result<[[f64; 2]; 3], ThreadError> {
    let corners = mesh.corners(triangle);
    match warp {
        None => Ok(material_triangle(corners)),
        Some(warp) => thread_triangle(corners, warp).ok_or(ThreadError { triangle, warp }),
    }
}
