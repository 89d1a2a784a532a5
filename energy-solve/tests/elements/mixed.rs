//! Elements of mixed unknowns, to test assembly and solvers independently of generated code.

use energy_dsl::{
    Declaration, Element, Field, FieldKind, Flags, Inputs, Lane, Level, MixedGradient, MixedHessian, MixedPotential,
    MixedProduct, NextJacobians, NextState, Outputs, PackedMixed, Real, RestError, Stateful, Stored, Value,
};

use super::jets::{Jet, cross, declared, dot, field, minus, mixed_element, rotated, seeds};

const POINT: FieldKind = FieldKind::Point;
const NUMBERS: FieldKind = FieldKind::Numbers;

const ROD: &[Field] = &[
    field("x0", POINT, 3, false),
    field("x1", POINT, 3, false),
    field("x2", POINT, 3, false),
    field("θ0", NUMBERS, 1, false),
    field("θ1", NUMBERS, 1, false),
];

mixed_element!(
    /// A rod's node with two edges d and e: stretch k/2 (‖d‖ − L)², bending B/2 ‖e − d‖², twist C/2 (θ₁ − θ₀ − τ)² +
    /// C/4 (θ₀² + θ₁²), and a coupling of both, C/4 (θ₀ + θ₁) (e − d)₃.
    Rod[11, 11, 66](stretch, length, bend, twist, rest)
    declared("Rod", ROD, &[]), |p, u| {
        let point = |first: usize| [u[first], u[first + 1], u[first + 2]];
        let (d, e) = (minus(point(3), point(0)), minus(point(6), point(3)));
        let stretch = dot(d, d).sqrt() - p.length;
        let bend = minus(e, d);
        let twist = u[10] - u[9] - p.rest;
        (p.stretch * stretch * stretch + p.bend * dot(bend, bend) + p.twist * twist * twist).times(0.5)
            + (p.twist * ((u[9] + u[10]) * bend[2] + u[9] * u[9] + u[10] * u[10])).times(0.25)
    }
);

const JOINT: &[Field] = &[field("q", FieldKind::Rotation, 4, false), field("x", POINT, 3, false)];

mixed_element!(
    /// k/2 ‖x + R(q) (0, 0, l)‖²: ties a point of a rigid body at x to the origin.
    Joint[7, 6, 21](stiffness, lever)
    declared("Joint", JOINT, &[]), |p, u| {
        let zero = Jet::constant(T::from_f64(0.0));
        let arm = rotated([u[0], u[1], u[2], u[3]], [zero, zero, p.lever]);
        let gap = [u[4] + arm[0], u[5] + arm[1], u[6] + arm[2]];
        (p.stiffness * dot(gap, gap)).times(0.5)
    }
);

const PLANE: &[Field] = &[field("a", NUMBERS, 2, false), field("θ", NUMBERS, 1, false), field("x", POINT, 3, false)];

mixed_element!(
    /// k/2 ((a₁ − θ)² + (a₂ − θ² + x₁)²) + k/2 ‖x‖²: couples a vector of the plane, a scalar and a point.
    Plane[6, 6, 21](stiffness)
    declared("Plane", PLANE, &[]), |p, u| {
        let (first, second) = (u[0] - u[2], u[1] - u[2] * u[2] + u[3]);
        let x = [u[3], u[4], u[5]];
        (p.stiffness * (first * first + second * second + dot(x, x))).times(0.5)
    }
);

const COMMON: &[Field] = &[field("x0", POINT, 3, false), field("x1", POINT, 3, false), field("L", NUMBERS, 1, true)];

mixed_element!(
    /// k/2 (‖x₁ − x₀‖ − L)² with one length L for all springs.
    CommonLength[7, 7, 28](stiffness)
    declared("CommonLength", COMMON, &[]), |p, u| {
        let d = minus([u[3], u[4], u[5]], [u[0], u[1], u[2]]);
        let stretch = dot(d, d).sqrt() - u[6];
        (p.stiffness * stretch * stretch).times(0.5)
    }
);

const LENGTH: &[Field] = &[field("L", NUMBERS, 1, true)];

mixed_element!(
    /// c/2 (L − L₀)² of a shared length alone.
    LengthCost[1, 1, 1](stiffness, length)
    declared("LengthCost", LENGTH, &[]), |p, u| {
        let off = u[0] - p.length;
        (p.stiffness * off * off).times(0.5)
    }
);

const FACE: &[Field] = &[
    field("x0", POINT, 3, false),
    field("x1", POINT, 3, false),
    field("x2", POINT, 3, false),
    field("p", NUMBERS, 1, true),
];

mixed_element!(
    /// −s p V, where V = x₀ · (x₁ × x₂)/6 is the volume between a triangle and the origin.
    Face[10, 10, 55](sign)
    declared("Face", FACE, &[]), |p, u| {
        let [a, b, c] = [0, 3, 6].map(|first| [u[first], u[first + 1], u[first + 2]]);
        -(p.sign * u[9] * dot(a, cross(b, c))).times(1.0 / 6.0)
    }
);

mixed_element!(
    /// p V₀ − κ/2 p²: with the faces, −p (V − V₀) − κ/2 p². Its maximum over p is (V − V₀)²/(2 κ).
    Filling[1, 1, 1](volume, compliance)
    declared("Filling", LENGTH, &[]), |p, u| p.volume * u[0] - (p.compliance * u[0] * u[0]).times(0.5)
);

const LINK: &[Field] = &[field("x0", POINT, 3, false), field("θ", NUMBERS, 1, false), field("x1", POINT, 3, false)];
const RELAXED: &[Field] = &[field("r", NUMBERS, 1, false)];

mixed_element!(
    /// k/2 (‖x₁ − x₀‖ + θ − r)² with the state r, which covers half of the way to the present length in each step.
    Relaxing[7, 7, 28](stiffness, relaxed)
    declared("Relaxing", LINK, RELAXED), |p, u| {
        let d = minus([u[4], u[5], u[6]], [u[0], u[1], u[2]]);
        let stretch = dot(d, d).sqrt() + u[3] - p.relaxed;
        (p.stiffness * stretch * stretch).times(0.5)
    }
);

impl Stateful<f64> for Relaxing {
    type Unknowns = [f64; 7];
    type State = [f64; 1];
    type ByUnknowns = [f64; 7];
    type ByState = [f64; 1];

    fn state(&self) -> [f64; 1] {
        [self.relaxed]
    }

    fn set_state(&mut self, &[relaxed]: &[f64; 1]) {
        self.relaxed = relaxed;
    }

    fn next(&self, u: &[f64; 7]) -> NextState<f64, [f64; 1]> {
        let length = (0..3).map(|i| (u[4 + i] - u[i]).powi(2)).sum::<f64>().sqrt() + u[3];
        NextState { state: [0.5 * (self.relaxed + length)], flags: Flags::clear() }
    }

    fn next_at<L: Level>(&self, u: &[f64; 7]) -> NextState<f64, [f64; 1]> {
        self.next(u)
    }

    fn next_jacobians(&self, _: &[f64; 7]) -> NextJacobians<f64, [f64; 1], [f64; 7], [f64; 1]> {
        unreachable!("steps do not use it")
    }

    fn next_jacobians_at<L: Level>(&self, _: &[f64; 7]) -> NextJacobians<f64, [f64; 1], [f64; 7], [f64; 1]> {
        unreachable!("steps do not use it")
    }
}
