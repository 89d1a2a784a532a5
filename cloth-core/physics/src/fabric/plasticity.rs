//! Plastic flow of membranes and hinges: rest shapes that follow what is strained beyond a limit.
//!
//! Flow is rate-independent and perfectly plastic. At the end of each step, the rest shape of every element beyond its
//! limit moves until the element is at the limit (return mapping). The energy released by that is dissipated.

use std::fmt;

use energy_dsl::{PackedPotential, RestError, Vector3};
use energy_elements::BridsonBending;
use energy_solve::{DrivenLaw, Stencils};

use crate::geometry::{cross, dot, norm, subtract};
use crate::mesh::{Hinge, MaterialTriangle, TriangleMesh, dihedral_angle};

/// Creates the element of a triangle, given its index and its rest shape.
pub(super) type MembraneElement<E> = Box<dyn Fn(usize, MaterialTriangle) -> Result<E, RestError> + Send + Sync>;

/// Membrane triangles that yield where a principal stretch exceeds a limit.
pub(super) struct PlasticMembrane<E> {
    rest: Vec<MaterialTriangle>,
    elements: Vec<E>,
    element: MembraneElement<E>,
    /// The largest principal stretch; above 1.
    limit: f64,
}

impl<E> PlasticMembrane<E> {
    pub(super) fn new(rest: Vec<MaterialTriangle>, elements: Vec<E>, element: MembraneElement<E>, limit: f64) -> Self {
        Self { rest, elements, element, limit }
    }
}

impl<E> fmt::Debug for PlasticMembrane<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PlasticMembrane").field("limit", &self.limit).finish_non_exhaustive()
    }
}

impl<E: PackedPotential<f64> + fmt::Debug + Send + Sync + 'static> DrivenLaw for PlasticMembrane<E> {
    type Element = E;

    fn element(&self, stencil: usize, _: f64) -> E {
        self.elements[stencil]
    }

    fn advance(&mut self, stencils: Stencils<'_>, x: &[Vector3<f64>]) -> bool {
        let mut flows = false;
        for triangle in 0..self.rest.len() {
            let corners = [0, 1, 2].map(|point| x[stencils.vertex(triangle, point) as usize]);
            let Some(rest) = flowed(self.rest[triangle], corners, self.limit) else { continue };
            // A rest shape that the element refuses is not taken.
            if let Ok(element) = (self.element)(triangle, rest) {
                (self.rest[triangle], self.elements[triangle]) = (rest, element);
                flows = true;
            }
        }
        flows
    }

    fn history(&self) -> Vec<f64> {
        self.rest.iter().flat_map(|rest| rest.as_flattened().to_vec()).collect()
    }

    fn restore(&mut self, history: &[f64]) {
        let all = self.rest.iter_mut().zip(&mut self.elements).zip(history.chunks_exact(6));
        for (triangle, ((rest, element), numbers)) in all.enumerate() {
            let saved = [[numbers[0], numbers[1]], [numbers[2], numbers[3]], [numbers[4], numbers[5]]];
            if let Ok(restored) = (self.element)(triangle, saved) {
                (*rest, *element) = (saved, restored);
            }
        }
    }
}

/// Returns the rest shape that a triangle flows to; `None` if no principal stretch exceeds the limit.
pub(super) fn flowed(rest: MaterialTriangle, [a, b, c]: [Vector3<f64>; 3], limit: f64) -> Option<MaterialTriangle> {
    let [u, v] = [1, 2].map(|corner| [0, 1].map(|axis| rest[corner][axis] - rest[0][axis]));
    let determinant = u[0] * v[1] - v[0] * u[1];
    let (base, side) = (subtract(b, a), subtract(c, a));
    // The columns of F = D_s D_m⁻¹, and the Cauchy–Green tensor C = FᵀF.
    let column = |p: f64, q: f64| -> Vector3<f64> {
        std::array::from_fn(|axis| (p * base[axis] + q * side[axis]) / determinant)
    };
    let (first, second) = (column(v[1], -u[1]), column(-v[0], u[0]));
    let (uu, uv, vv) = (dot(first, first), dot(first, second), dot(second, second));
    let (middle, radius) = (0.5 * (uu + vv), (0.5 * (uu - vv)).hypot(uv));
    let stretches = [(middle + radius).sqrt(), (middle - radius).max(0.0).sqrt()];
    if stretches[0].is_nan() || stretches[0] <= limit {
        return None;
    }
    let angle = 0.5 * (2.0 * uv).atan2(uu - vv);
    let factors = stretches.map(|stretch| (stretch / limit).max(1.0));
    let (sine, cosine) = angle.sin_cos();
    let moved = |point: [f64; 2]| {
        let along = factors[0] * (cosine * point[0] + sine * point[1]);
        let across = factors[1] * (cosine * point[1] - sine * point[0]);
        [cosine * along - sine * across, sine * along + cosine * across]
    };
    Some([[0.0; 2], moved(u), moved(v)])
}

/// Hinges that yield where their angle differs from that at rest by more than a limit.
#[derive(Debug)]
pub(super) struct PlasticHinges {
    /// K′ of each hinge, in J.
    pub stiffness: Vec<f64>,
    /// Angles at rest.
    pub rest: Vec<f64>,
    /// The largest difference of the angle of each hinge from that at rest.
    pub limits: Vec<f64>,
}

impl DrivenLaw for PlasticHinges {
    type Element = BridsonBending;

    fn element(&self, stencil: usize, _: f64) -> BridsonBending {
        BridsonBending::new(self.stiffness[stencil], self.rest[stencil])
    }

    fn advance(&mut self, stencils: Stencils<'_>, x: &[Vector3<f64>]) -> bool {
        let angle = |hinge: usize| dihedral_angle([0, 1, 2, 3].map(|point| x[stencils.vertex(hinge, point) as usize]));
        let strains: Vec<f64> = self.rest.iter().enumerate().map(|(hinge, rest)| angle(hinge) - rest).collect();
        flow(&mut self.rest, &strains, &self.limits)
    }

    fn history(&self) -> Vec<f64> {
        self.rest.clone()
    }

    fn restore(&mut self, history: &[f64]) {
        if history.len() == self.rest.len() {
            self.rest.copy_from_slice(history);
        }
    }
}

/// Moves angles at rest by the excess of the strains over the limits. Returns whether any moved.
pub(super) fn flow(rest: &mut [f64], strains: &[f64], limits: &[f64]) -> bool {
    let mut flows = false;
    for ((rest, strain), limit) in rest.iter_mut().zip(strains).zip(limits).filter(|((_, s), l)| s.abs() > **l) {
        *rest += strain - limit.copysign(*strain);
        flows = true;
    }
    flows
}

/// Returns the angle of a hinge whose fold has a curvature in 1/m: that times half the sum of the heights of its
/// triangles, which is exact for folds along the edge.
pub(super) fn angle_of_curvature(mesh: &TriangleMesh, hinge: &Hinge, curvature: f64) -> f64 {
    let [first, second, start, end] = mesh.hinge_at_rest(hinge);
    let edge = subtract(end, start);
    let height = |apex: Vector3<f64>| norm(cross(edge, subtract(apex, start))) / norm(edge);
    curvature * 0.5 * (height(first) + height(second))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::add_scaled;

    #[test]
    fn a_triangle_flows_to_its_limit_along_the_principal_stretch_only() {
        let rest = [[0.0, 0.0], [1.0, 0.0], [0.25, 0.75]];
        // Stretched by 1.5 along a direction at 30°, by 0.9 across it, and rotated in space.
        let (sine, cosine) = 30_f64.to_radians().sin_cos();
        let at = |[u, v]: [f64; 2]| -> Vector3<f64> {
            let (along, across) = (1.5 * (cosine * u + sine * v), 0.9 * (cosine * v - sine * u));
            add_scaled(add_scaled([1.0, 2.0, 3.0], along, [0.0, 0.6, 0.8]), across, [0.0, -0.8, 0.6])
        };
        let x = rest.map(at);
        assert_eq!(flowed(rest, x, 1.51), None);
        let plastic = flowed(rest, x, 1.2).unwrap();
        for point in [1, 2] {
            let [u, v] = rest[point];
            let (along, across) = (1.25 * (cosine * u + sine * v), cosine * v - sine * u);
            let expected = [cosine * along - sine * across, sine * along + cosine * across];
            assert!((0..2).all(|axis| (plastic[point][axis] - expected[axis]).abs() < 1e-14), "{plastic:?}");
        }
        // It is at its limit now.
        assert!(flowed(plastic, x, 1.2 * (1.0 + 1e-12)).is_none());
    }

    #[test]
    fn angles_flow_to_their_limits_in_both_directions() {
        let mut rest = [0.1, 0.1, 0.1];
        assert!(flow(&mut rest, &[0.5, -0.5, 0.2], &[0.2; 3]));
        assert!((rest[0] - 0.4).abs() < 1e-15 && (rest[1] + 0.2).abs() < 1e-15 && rest[2] == 0.1);
        assert!(!flow(&mut rest, &[0.2, -0.2, f64::NAN], &[0.2; 3]));
    }
}
