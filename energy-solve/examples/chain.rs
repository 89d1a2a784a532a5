//! Finds the shape of a hanging chain by Newton's method on assembled Hessians:
//! `cargo run -p energy-solve --example chain`.

use energy_dsl::Vector3;
use energy_elements::{Gravity, HookeSpring};
use energy_solve::{
    BlockCholesky, Curvature, ElementList, LinearisationOptions, PotentialTerm, State, System, Term, Weights,
};

const LINKS: usize = 8;

/// Returns the energy in J.
fn energy(system: &mut System, x: &[Vector3<f64>]) -> Result<f64, Box<dyn std::error::Error>> {
    Ok(system.energies(x)?.into_iter().filter_map(|term| term.energy).sum())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Springs of 100 N/m, 0.1 m long at rest, between points of 50 g. Both ends are pinned.
    let springs: Vec<HookeSpring> = (0..LINKS).map(|_| HookeSpring::new(100.0, 0.1)).collect();
    let edges: Vec<[usize; 2]> = (0..LINKS).map(|link| [link, link + 1]).collect();
    let weights: Vec<Gravity> = (0..=LINKS).map(|_| Gravity::new(0.05, [0.0, 0.0, -9.81])).collect();
    let points: Vec<[usize; 1]> = (0..=LINKS).map(|point| [point]).collect();
    let terms: Vec<Box<dyn Term>> = vec![
        Box::new(PotentialTerm::new(ElementList::new("springs", springs, &edges)?)),
        Box::new(PotentialTerm::new(ElementList::new("weight", weights, &points)?)),
    ];
    let pinned: Vec<bool> = (0..=LINKS).map(|point| point == 0 || point == LINKS).collect();
    let mut system = System::new(terms, &pinned)?;

    // The Hessian of the energy is −∂f/∂x. Clamping makes the search direction a descent direction.
    let options = LinearisationOptions::new(Weights { position: -1.0, velocity: 0.0 }, Curvature::Clamped);
    let mut x: Vec<Vector3<f64>> = (0..=LINKS).map(|point| [0.125 * point as f64, 0.0, 0.0]).collect();
    let v = vec![[0.0; 3]; x.len()];
    let mut hessian = system.matrix();
    let mut solver = BlockCholesky::new(hessian.pattern())?;
    for iteration in 0..30 {
        system.linearise(State { x: &x, v: &v }, options, &mut hessian)?;
        let forces = system.forces(State { x: &x, v: &v })?;
        let free = system.dofs().free().to_vec();
        let force = system.dofs().gather(&forces);
        let residual = force.iter().flatten().fold(0.0_f64, |most, f| most.max(f.abs()));
        let before = energy(&mut system, &x)?;
        println!("iteration {iteration}: energy {before:.9} J, largest force {residual:.1e} N");
        if residual < 1e-10 {
            break;
        }
        solver.factor(&hessian)?;
        let mut direction = vec![[0.0; 3]; force.len()];
        solver.solve(&force, &mut direction);
        // Backtracking: halve the step until the energy does not increase.
        let mut step = 1.0;
        x = loop {
            let mut next = x.clone();
            for (&vertex, d) in free.iter().zip(&direction) {
                for axis in 0..3 {
                    next[vertex][axis] += step * d[axis];
                }
            }
            if energy(&mut system, &next)? <= before + 1e-12 || step < 1e-6 {
                break next;
            }
            step /= 2.0;
        };
    }
    println!("sag: {:.1} mm", -1e3 * x[LINKS / 2][2]);
    let forces = system.forces(State { x: &x, v: &v })?;
    assert!(forces[1..LINKS].iter().flatten().all(|f| f.abs() < 1e-9), "the chain is in equilibrium");
    Ok(())
}
