//! Mesh-independent plate bending: a curvature tensor per triangle, from dihedral angles.
//!
//! On a triangle T with area A, edges of length ‖e‖ and outward in-plane normals n,
//!
//! A κ = Σ ‖e‖ p n ⊗ n,  p = ½ (θ − θ̄) ± φ,  U = Σ ½ A κᵀ D κ,
//!
//! where p is the angle between the normal of T and the normal of the surface at the midpoint of the edge, and θ is the
//! dihedral angle of [`ArcAngle`](energy_elements::ArcAngle), an arc over the facets.
//!
//! This is the lowest-order element of Hellan, Herrmann and Johnson (Comodi 1989), in which the normal at an edge is an
//! independent unknown. In Grinspun, Gingold, Reisman and Zorin 2006 that normal bisects those of the two triangles
//! (φ = 0), and only regular lattices bend like the plate. Here the *tilt* φ is chosen such that it is exact for every
//! quadratic height field. It is a combination of nearby dihedral angles, φ = Σ c (θ − θ̄), with c of minimal norm
//! ([`Tilts`]). Then
//!
//! * κ is the exact curvature tensor wherever that is constant, and so is the energy;
//! * the moment that leaves a triangle through an edge enters its neighbour (± φ): in a state of constant curvature, no
//!   interior vertex feels a force.
//!
//! Both together are the patch test: a flat sheet has the rigidity D in every direction on every mesh, for any D. At
//! free edges the natural condition, zero bending moment, eliminates p.

mod assembly;
mod friction;
mod patch;
mod rigidity;
mod term;
mod tilt;

pub use rigidity::{Rigidity, RigidityError};
pub use term::{PlateError, PlateTerm};
pub use tilt::Tilts;

use crate::mesh::{Topology, TriangleMesh, Warp, area, material_triangle};

/// A triangle without a warp direction.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("triangle {triangle} {}", match .warp {
    Warp::Direction(warp) => format!(
        "stands across the warp direction {warp:?}; choose a warp direction along the cloth, or `warp = \"uv\"` if \
         its OBJ file has texture coordinates"
    ),
    Warp::Uv => "has no texture coordinates that tell its warp; export UVs without collapsed faces".to_owned(),
})]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub struct ThreadError {
    pub triangle: usize,
    /// The direction of the warp.
    pub warp: Warp,
}

/// The curvature of one triangle as a function of dihedral angles: κ = Σ b (θ − θ̄).
#[derive(Clone, Debug, PartialEq)]
pub struct Curvature {
    /// Rest area, in m².
    pub area: f64,
    /// Hinges and their b, in 1/m: the components (κ_uu, κ_vv, 2κ_uv) along warp and weft.
    pub angles: Vec<(usize, [f64; 3])>,
    /// ‖e‖/A n ⊗ n of the free edges, in 1/m, in the same components.
    pub free: Vec<[f64; 3]>,
}

/// Returns the curvatures of all triangles, in terms of the hinges of `topology`. Without a warp, components are along
/// each triangle's first edge.
///
/// # Errors
/// Returns an error if a triangle is perpendicular to the warp, or two neighbours have opposite fronts.
pub fn curvatures(mesh: &TriangleMesh, topology: &Topology, warp: Option<Warp>) -> Result<Vec<Curvature>, PlateError> {
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

/// Maps a triangle to its plane, with the first axis along the warp or along the first edge.
fn material_coordinates(
    mesh: &TriangleMesh,
    triangle: usize,
    warp: Option<Warp>,
) -> Result<[[f64; 2]; 3], ThreadError> {
    match warp {
        None => Ok(material_triangle(mesh.corners(triangle))),
        Some(warp) => mesh.thread_triangle(triangle, warp).ok_or(ThreadError { triangle, warp }),
    }
}
