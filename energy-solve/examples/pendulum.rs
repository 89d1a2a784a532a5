//! Swings a rigid body on a hinge and compares its period with the exact one:
//! `cargo run -p energy-solve --example pendulum`.

use energy_dsl::energy;
use energy_elements::Gravity;
use energy_solve::{
    Inertia, KindSolver, MixedBody, MixedIntegrator, MixedNewtonOptions, MixedScheme, MixedState, MixedSystem,
    MixedTerm, UnknownKind,
};

energy! {
    /// A stiff spring between the origin and a point of a rigid body. `arm` is the way to it from the centre of mass x,
    /// in the frame of the body; q is the body's orientation.
    pub energy Hinge(q: Rotation, x: Point; k: Scalar[N/m], arm: Vec3[m]) {
        k / 2 * norm_squared(x + rotate(q, arm))
    }
}

/// Mass, in kg, distance of centre and hinge, in m, and moments of inertia about the centre, in kg m².
const MASS: f64 = 2.0;
const ARM: f64 = 0.5;
const MOMENTS: [f64; 3] = [0.04, 0.06, 0.02];
/// Acceleration of gravity, in m/s², and time step, in s.
const GRAVITY: f64 = 9.81;
const STEP: f64 = 1e-3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // An orientation and a centre. A radian counts as a move by the length of the arm.
    let body = MixedBody::new(&[UnknownKind::Rotation, UnknownKind::Vector3], ARM);
    let hinge = MixedTerm::new("hinge", vec![Hinge::new(1e7, [0.0, 0.0, ARM])], &[[0, 1]])?;
    let weight = MixedTerm::of_points("weight", vec![Gravity::new(MASS, [0.0, 0.0, -GRAVITY])], &[[1]])?;
    let system = MixedSystem::new(body, vec![hinge, weight])?;
    let tensor = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { MOMENTS[i] } else { 0.0 }));
    let inertia = vec![Inertia::Tensor(tensor), Inertia::Mass(MASS)];
    let (scheme, options) = (MixedScheme::ImplicitMidpoint, MixedNewtonOptions::new(1e-11));
    let mut integrator = MixedIntegrator::new(system, inertia, scheme, &KindSolver::Automatic, options)?;

    // Released at 60° from below, turned about x.
    let angle = std::f64::consts::FRAC_PI_3;
    let (sine, cosine) = (0.5 * angle).sin_cos();
    let u = vec![cosine, sine, 0.0, 0.0, 0.0, ARM * angle.sin(), -ARM * angle.cos()];
    let mut state = MixedState::at_rest(integrator.system(), u);
    let (mut time, mut passes) = (0.0, Vec::new());
    while passes.len() < 2 {
        let before = state.u[5];
        integrator.step(&mut state, STEP)?;
        if before * state.u[5] <= 0.0 {
            passes.push(time + STEP * before / (before - state.u[5]));
        }
        time += STEP;
    }
    let period = 2.0 * (passes[1] - passes[0]);

    // T = 4 √(I/mgd) K(sin φ/2), with K = π/2 over the arithmetic-geometric mean of 1 and cos φ/2.
    let (mut a, mut b) = (1.0, cosine);
    while a - b > 1e-15 {
        (a, b) = (0.5 * (a + b), f64::sqrt(a * b));
    }
    let exact =
        4.0 * ((MOMENTS[0] + MASS * ARM * ARM) / (MASS * GRAVITY * ARM)).sqrt() * std::f64::consts::FRAC_PI_2 / a;
    println!("period: {period:.6} s, exact: {exact:.6} s");
    assert!((period / exact - 1.0).abs() < 1e-5, "the periods agree");
    Ok(())
}
