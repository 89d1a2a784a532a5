//! Known answers of rigid bodies: a compound pendulum and a heavy top.

use energy_dsl::energy;
use energy_elements::{BodyAnchor, Gravity};
use energy_solve::{
    Inertia, KindSolver, MixedBody, MixedIntegrator, MixedNewtonOptions, MixedScheme, MixedState, MixedSystem,
    MixedTerm, UnknownKind,
};

use super::{Finding, ValidateError};

/// Answers the question `bodies`: at 400 steps a swing, and the order of the error from 200.
pub(super) fn ask(_quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let exact = exact_period();
    let [coarse, fine] = [period(200)?, period(400)?];
    report(Finding::relative("bodies", "compound pendulum, period".into(), fine, exact, 5e-3));
    report(Finding::order("bodies", "compound pendulum, period", [coarse, fine].map(|found| found - exact), 2.0));
    let case = "rod let go, force of the hinge over the weight".into();
    report(Finding::relative("bodies", case, released_force()?, 0.25, 5e-3));
    for (part, exact) in [(1.02, 1.0), (0.98, 0.0)] {
        let case = format!("sleeping top at {part} of the critical spin: stays upright");
        let upright = f64::from(u8::from(stays_upright(part)?));
        report(Finding::absolute("bodies", case, upright, exact, 0.0));
    }
    Ok(())
}

/// Mass, length and weight of a uniform rod that hangs from one end.
const MASS: f64 = 2.0;
const LENGTH: f64 = 0.8;
const GRAVITY: f64 = 9.81;
/// The largest angle of its swing, from below.
const SWING: f64 = 2.0;

/// Returns the rod at rest at an angle from below: orientation, centre, and the hinge at the origin, which is fixed.
fn pendulum(angle: f64, scheme: MixedScheme) -> Result<(MixedIntegrator, MixedState), ValidateError> {
    let kinds = [UnknownKind::Vector3, UnknownKind::Rotation, UnknownKind::Vector3];
    let body = MixedBody::new(&kinds, LENGTH).with_fixed(&[2])?;
    let anchor = BodyAnchor::new([0.0, 0.0, 0.5 * LENGTH], STIFFNESS, 0.0);
    let terms = vec![
        MixedTerm::new("hinge", vec![anchor], &[[0, 1, 2]])?,
        MixedTerm::of_points("weight", vec![Gravity::new(MASS, [0.0, 0.0, -GRAVITY])], &[[0]])?,
    ];
    let system = MixedSystem::new(body, terms)?;
    let across = MASS * LENGTH * LENGTH / 12.0;
    let tensor = [[across, 0.0, 0.0], [0.0, across, 0.0], [0.0, 0.0, 1e-2 * across]];
    let inertia = vec![Inertia::Mass(MASS), Inertia::Tensor(tensor), Inertia::None];
    let options = MixedNewtonOptions::new(1e-11 * LENGTH);
    let integrator = MixedIntegrator::new(system, inertia, scheme, &KindSolver::Automatic, options)?;
    // Turned about x.
    let ((sine, cosine), (half_sine, half_cosine)) = (angle.sin_cos(), (0.5 * angle).sin_cos());
    let arm = 0.5 * LENGTH;
    let u = vec![0.0, arm * sine, -arm * cosine, half_cosine, half_sine, 0.0, 0.0, 0.0, 0.0, 0.0];
    let state = MixedState::at_rest(integrator.system(), u);
    Ok((integrator, state))
}

/// Stiffness of the hinge, in N/m: it gives by less than 10⁻⁷ of the length.
const STIFFNESS: f64 = 1e9;

/// T = 4 √(I/mgd) K(sin φ/2), with K = π/2 over the arithmetic-geometric mean of 1 and cos φ/2.
fn exact_period() -> f64 {
    let (mut a, mut b) = (1.0, (0.5 * SWING).cos());
    while a - b > 1e-15 {
        (a, b) = (0.5 * (a + b), f64::sqrt(a * b));
    }
    4.0 * (LENGTH / (1.5 * GRAVITY)).sqrt() * std::f64::consts::FRAC_PI_2 / a
}

/// Returns the period by the implicit midpoint rule: twice the time between two passes below the hinge.
fn period(steps: usize) -> Result<f64, ValidateError> {
    let (mut integrator, mut state) = pendulum(SWING, MixedScheme::ImplicitMidpoint)?;
    let step = exact_period() / steps as f64;
    let mut passes = Vec::new();
    for number in 0..2 * steps {
        let before = state.u[1];
        integrator.step(&mut state, step)?;
        if before * state.u[1] <= 0.0 {
            passes.push(step * (number as f64 + before / (before - state.u[1])));
        }
    }
    Ok(if passes.len() < 2 { f64::NAN } else { 2.0 * (passes[1] - passes[0]) })
}

/// Returns the force of the hinge on a level rod just after it was let go, over the weight.
fn released_force() -> Result<f64, ValidateError> {
    let (mut integrator, mut state) = pendulum(std::f64::consts::FRAC_PI_2, MixedScheme::ImplicitEuler)?;
    integrator.step(&mut state, 1e-3)?;
    // The hinge holds its point against this gradient.
    let stretch = end_of_rod(&state.u).iter().map(|x| x * x).sum::<f64>().sqrt();
    Ok(STIFFNESS * stretch / (MASS * GRAVITY))
}

/// Returns where the upper end of the rod is.
fn end_of_rod(u: &[f64]) -> [f64; 3] {
    let [w, x, y, z] = [u[3], u[4], u[5], u[6]];
    let arm = 0.5 * LENGTH;
    // The third column of the rotation matrix.
    let along = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
    std::array::from_fn(|axis| u[axis] + arm * along[axis])
}

energy! {
    /// Weight of a top whose point is fixed: M g l times the height of its axis.
    energy TopWeight(q: Rotation; W: Scalar[J]) { W * rotate(q, vector(0, 0, 1)).z }
}

/// Whether a top that spins about its upright axis stays upright, at a part of the critical spin 2 √(I₁ m g l)/I₃. It
/// starts tilted by 10⁻⁶ and is watched while the slower top would fall from e²⁰ times less.
fn stays_upright(part: f64) -> Result<bool, ValidateError> {
    let (across, along, weight) = (1.0, 0.5, 1.0);
    let body = MixedBody::new(&[UnknownKind::Rotation], 1.0);
    let system = MixedSystem::new(body, vec![MixedTerm::new("weight", vec![TopWeight::new(weight)], &[[0]])?])?;
    let inertia = vec![Inertia::Tensor([[across, 0.0, 0.0], [0.0, across, 0.0], [0.0, 0.0, along]])];
    let (scheme, options) = (MixedScheme::ImplicitMidpoint, MixedNewtonOptions::new(1e-13));
    let mut integrator = MixedIntegrator::new(system, inertia, scheme, &KindSolver::Automatic, options)?;
    let tilt: f64 = 1e-6;
    let u = vec![(0.5 * tilt).cos(), (0.5 * tilt).sin(), 0.0, 0.0];
    let mut state = MixedState::at_rest(integrator.system(), u);
    state.rates[2] = part * 2.0 * f64::sqrt(across * weight) / along;
    let mut steepest = 0.0_f64;
    for _ in 0..4_000 {
        integrator.step(&mut state, 0.03)?;
        steepest = steepest.max(f64::hypot(state.u[1], state.u[2]));
    }
    Ok(steepest < 1e-3)
}
