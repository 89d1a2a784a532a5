//! Time of Newton's method for rods of 1,000 and 10,000 nodes: points and twists by turns, 10 off-diagonals.
//!
//! `cargo bench -p energy-solve --bench rods`
#![allow(confusable_idents, mixed_script_confusables)]

use std::time::{Duration, Instant};

use energy_dsl::energy;
use energy_solve::{
    BandOrder, BorderedSolver, Curvature, Inertia, KindSolver, MixedBody, MixedIntegrator, MixedNewtonError,
    MixedNewtonOptions, MixedNewtonReport, MixedScheme, MixedState, MixedSystem, MixedTerm, UnknownKind,
};

/// Runs of each measurement, of which the fastest counts.
const RUNS: usize = 15;

const BAND: KindSolver = KindSolver::Band(BandOrder::Narrowest);

/// Distance of nodes, in m.
const SPACING: f64 = 0.01;

energy! {
    /// A node of a discrete elastic rod (Bergou, Wardetzky, Robinson, Audoly and Grinspun 2008) with fixed reference
    /// directors u and v of its two edges: stretch of the first one, bending by material curvatures, twist, and weight.
    energy Rod(
        x0, x1, x2: Point, θ0, θ1: Scalar[rad];
        u0, v0, u1, v1: Vec3, k: Scalar[N/m], B: Scalar[J*m], C: Scalar[J*m], l: Scalar[m], w: Scalar[N]
    ) {
        let d = x1 - x0;
        let e = x2 - x1;
        let κb = 2 * cross(d, e) / (norm(d) * norm(e) + dot(d, e));
        let κ1 = dot(κb, cos(θ0) * v0 - sin(θ0) * u0 + cos(θ1) * v1 - sin(θ1) * u1) / 2;
        let κ2 = dot(κb, cos(θ0) * u0 + sin(θ0) * v0 + cos(θ1) * u1 + sin(θ1) * v1) / 2;
        k / 2 * (norm(d) - l)^2 + B / (2 * l) * (κ1^2 + 2 * κ2^2) + C / (2 * l) * (θ1 - θ0)^2 + w * x1.z
    }
}

/// A rod along x, clamped at its first edge.
fn rod(nodes: usize) -> (MixedSystem, Vec<f64>) {
    let kind = |i: usize| if i.is_multiple_of(2) { UnknownKind::Vector3 } else { UnknownKind::Scalar };
    let kinds: Vec<UnknownKind> = (0..2 * nodes - 1).map(kind).collect();
    let body = MixedBody::new(&kinds, SPACING).with_fixed(&[0, 1, 2]).expect("these unknowns exist");
    let (y, z) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let element = Rod::new(y, z, y, z, 1e3, 1e-4, 1e-4, SPACING, 1e-4);
    let stencils: Vec<[usize; 5]> = (0..nodes - 2).map(|i| 2 * i).map(|i| [i, i + 2, i + 4, i + 1, i + 3]).collect();
    let term = MixedTerm::new("rod", vec![element; nodes - 2], &stencils).expect("a stencil per element");
    let system = MixedSystem::new(body, vec![term]).expect("stencils fit");
    let point = |i: usize| [SPACING * i as f64, 1e-3 * (i as f64).sin(), 0.0];
    let u = (0..2 * nodes - 1)
        .flat_map(|i| if i % 2 == 0 { point(i / 2).to_vec() } else { vec![1e-3 * (i as f64).cos()] })
        .collect();
    (system, u)
}

/// Returns the time of the fastest run.
fn fastest(mut run: impl FnMut()) -> Duration {
    let timed = |()| {
        let start = Instant::now();
        run();
        start.elapsed()
    };
    (0..RUNS).map(|_| ()).map(timed).min().expect("some runs")
}

/// The parts of one Newton step and a whole one, in ns per node.
fn measure(nodes: usize) -> [f64; 4] {
    let (mut system, u) = rod(nodes);
    let mut matrix = system.matrix();
    let mut solver = BorderedSolver::new(system.pattern(), &BAND);
    assert_eq!(solver.half_bandwidth(), Some(10));
    let energy = fastest(|| assert!(system.energy(&u).is_ok()));
    let assembly = fastest(|| assert!(system.linearise(&u, Curvature::Exact, &mut matrix).is_ok()));
    // Inertia makes the matrix definite, as in a time step of 1 ms.
    for row in 0..system.pattern().unknowns() {
        let inertia = if system.pattern().size(row) == 1 { 1.0 } else { 1e3 };
        matrix.kinds_mut().add(row, row, |i, j| if i == j { inertia } else { 0.0 });
    }
    let right = vec![1.0; matrix.rows()];
    let mut x = right.clone();
    let solve = fastest(|| assert!(solver.solve(&matrix, &right, &mut x).is_ok()));
    // Newton steps that never meet the tolerance: the difference of 8 and 2 is 6.
    let [few, more] = [2, 8].map(|limit| newton_steps(nodes, limit));
    [energy, assembly, solve, (more - few) / 6].map(|time| time.as_secs_f64() * 1e9 / nodes as f64)
}

/// Whether all steps were full ones, with the exact Hessian.
fn is_plain(report: &MixedNewtonReport) -> bool {
    report.projected == 0 && report.halvings == 0
}

/// Returns the time of a search with this many Newton steps.
fn newton_steps(nodes: usize, limit: usize) -> Duration {
    let (system, u) = rod(nodes);
    let inertia = (0..2 * nodes - 1).map(|i| Inertia::Mass(if i % 2 == 0 { 1e-3 } else { 1e-6 })).collect();
    let options = MixedNewtonOptions::new(0.0).with_iteration_limit(limit);
    let mut integrator =
        MixedIntegrator::new(system, inertia, MixedScheme::ImplicitEuler, &BAND, options).expect("masses fit");
    let mut state = MixedState::at_rest(integrator.system(), u);
    fastest(|| match integrator.step(&mut state, 1e-3) {
        Err(MixedNewtonError::NotConverged(report)) if is_plain(&report) && report.iterations == limit => {}
        outcome => panic!("expected {limit} full steps with the exact Hessian, got {outcome:?}"),
    })
}

fn main() {
    println!("{:>8} {:>10} {:>10} {:>10} {:>16}", "ns/node", "energy", "assembly", "solve", "Newton step");
    let [short, long] = [1_000, 10_000].map(|nodes| {
        let [energy, assembly, solve, iteration] = measure(nodes);
        println!("{nodes:>8} {energy:>10.0} {assembly:>10.0} {solve:>10.0} {iteration:>16.0}");
        iteration
    });
    println!(
        "10,000 nodes: {:.2} ms per Newton step, {:.2} times the time per node of 1,000",
        long / 100.0,
        long / short
    );
}
