//! Internal damping as dissipation functions, with the deformation in the middle of each step. They are potentials of
//! the velocities, so Newton's method can minimise them, and symmetric, so conjugate gradients apply.

use energy_dsl::{Potential, Vector3};
use energy_elements::{HingeAngle, HingeRateDissipation, StrainRateDissipation, ZeroLengthSpring};
use energy_solve::{DissipationLaw, StepStart};

use crate::geometry::{add_scaled, subtract};
use crate::mesh::MaterialTriangle;

/// Viscosity of membrane triangles.
#[derive(Debug)]
pub(super) struct MembraneDamping {
    pub triangles: Vec<[usize; 3]>,
    pub rest: Vec<MaterialTriangle>,
    /// η_λ and η_μ, in N s/m.
    pub viscosities: [f64; 2],
}

impl DissipationLaw for MembraneDamping {
    type Element = StrainRateDissipation;

    fn elements(&self, start: &StepStart<'_>, is_free: &[bool]) -> Vec<(usize, StrainRateDissipation)> {
        let element = |triangle: usize| {
            let rest = self.rest[triangle];
            let [a, b, c] = self.triangles[triangle].map(|vertex| midway(start, vertex));
            let [first, second] = columns(rest, subtract(b, a), subtract(c, a));
            let ([u0, u1, u2], [eta_lambda, eta_mu]) = (rest, self.viscosities);
            // Rest shapes were checked when the fabric was applied.
            Some((triangle, StrainRateDissipation::new(u0, u1, u2, first, second, eta_lambda, eta_mu).ok()?))
        };
        (0..self.rest.len()).filter(|&triangle| is_free[triangle]).filter_map(element).collect()
    }
}

/// Returns where a vertex will be in the middle of the step if it keeps its velocity. Implicit integrators take the
/// velocity of the chord, which a rotation turns like the middle of the step: there, its strain rate vanishes.
fn midway(start: &StepStart<'_>, vertex: usize) -> Vector3<f64> {
    add_scaled(start.state.x[vertex], 0.5 * start.dt, start.state.v[vertex])
}

/// Returns the columns of F = D_s D_m⁻¹.
fn columns(rest: MaterialTriangle, base: Vector3<f64>, side: Vector3<f64>) -> [Vector3<f64>; 2] {
    let [u, v] = [1, 2].map(|corner| [0, 1].map(|axis| rest[corner][axis] - rest[0][axis]));
    let determinant = u[0] * v[1] - v[0] * u[1];
    [[v[1], -u[1]], [-v[0], u[0]]]
        .map(|[p, q]| std::array::from_fn(|axis| (p * base[axis] + q * side[axis]) / determinant))
}

/// Viscosity of hinges.
#[derive(Debug)]
pub(super) struct HingeDamping {
    pub hinges: Vec<[usize; 4]>,
    /// c of each hinge, in J s.
    pub viscosities: Vec<f64>,
}

impl DissipationLaw for HingeDamping {
    type Element = HingeRateDissipation;

    fn elements(&self, start: &StepStart<'_>, is_free: &[bool]) -> Vec<(usize, HingeRateDissipation)> {
        let angle = HingeAngle::<f64>::new();
        let element = |hinge: usize| {
            let points = self.hinges[hinge].map(|vertex| midway(start, vertex));
            let [first, second, _, end] = angle.gradient(&points).gradient;
            (hinge, HingeRateDissipation::new(first, second, end, self.viscosities[hinge]))
        };
        (0..self.hinges.len()).filter(|&hinge| is_free[hinge]).map(element).collect()
    }
}

/// Damping of stitches in proportion to their velocity: ½ k_d ‖v_P − v_Q‖².
#[derive(Debug)]
pub struct StitchDamping {
    /// The number of stitches.
    pub stitches: usize,
    /// k_d, in N s/m.
    pub damping: f64,
}

impl DissipationLaw for StitchDamping {
    /// The spring of rest length 0, as a potential of the velocities.
    type Element = ZeroLengthSpring;

    fn elements(&self, _: &StepStart<'_>, is_free: &[bool]) -> Vec<(usize, ZeroLengthSpring)> {
        let stitches = (0..self.stitches).filter(|&stitch| is_free[stitch]);
        stitches.map(|stitch| (stitch, ZeroLengthSpring::new(self.damping, 0.0))).collect()
    }
}

#[cfg(test)]
mod tests {
    use energy_dsl::ForceLaw;
    use energy_elements as elements;
    use energy_solve::State;

    use super::*;

    const X: [Vector3<f64>; 4] = [[0.5, -0.9, 0.3], [0.4, 0.8, 0.1], [0.0, 0.1, -0.1], [1.2, 0.0, 0.2]];
    const V: [Vector3<f64>; 4] = [[0.3, -0.2, 0.7], [-0.5, 0.1, 0.2], [0.9, 0.4, -0.6], [0.2, -0.8, 0.1]];

    #[test]
    fn dissipation_gives_the_forces_of_the_declared_damping() {
        let start = StepStart { time: 0.0, dt: 0.0, state: State { x: &X, v: &V } };
        let near = |gradient: &[Vector3<f64>], force: &[Vector3<f64>]| {
            let pairs = gradient.as_flattened().iter().zip(force.as_flattened());
            assert!(pairs.clone().all(|(g, f)| (g + f).abs() < 1e-13), "{gradient:?} {force:?}");
        };
        let rest = [[0.1, 0.0], [1.0, 0.2], [0.3, 0.8]];
        let membrane = MembraneDamping { triangles: vec![[0, 1, 3]], rest: vec![rest], viscosities: [0.4, 0.7] };
        let (_, element) = membrane.elements(&start, &[true])[0];
        let expected = elements::StrainRateDamping::new(rest[0], rest[1], rest[2], 0.4, 0.7).unwrap();
        let [x, v] = [[X[0], X[1], X[3]], [V[0], V[1], V[3]]];
        near(&element.gradient(&v).gradient, &expected.force(&x, &v).force);
        let hinge = HingeDamping { hinges: vec![[0, 1, 2, 3]], viscosities: vec![0.3] };
        let (_, element) = hinge.elements(&start, &[true])[0];
        near(&element.gradient(&V).gradient, &elements::HingeDamping::new(0.3).force(&X, &V).force);
        assert!(membrane.elements(&start, &[false]).is_empty());
    }
}
