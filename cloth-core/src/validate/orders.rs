use energy_dsl::Vector3;
use energy_elements::{Gravity, HookeSpring};
use energy_solve::{ElementList, PotentialTerm, State, System};

use super::{Finding, ValidateError};
use crate::Body;
use crate::integrator::{
    Bdf2, ExplicitEuler, ImplicitEuler, ImplicitMidpoint, Integrator, Newton, NewtonOptions, SymplecticEuler,
    Trapezoid, Verlet,
};
use energy_solve::SolveOptions;

/// A spring pendulum: 1 kg on a spring of 1 m and 400 N/m, released from the horizontal.
fn pendulum() -> Result<Body, ValidateError> {
    let springs = PotentialTerm::new(ElementList::new("rod", vec![HookeSpring::new(400.0, 1.0)], &[[0, 1]])?);
    let weight = PotentialTerm::new(ElementList::new("weight", vec![Gravity::new(1.0, [0.0, 0.0, -9.81])], &[[1]])?);
    let system = System::new(vec![Box::new(springs), Box::new(weight)], &[true, false])?;
    Ok(Body { x: vec![[0.0; 3], [1.0, 0.0, 0.0]], v: vec![[0.0; 3]; 2], masses: vec![0.0, 1.0], system })
}

/// 4 × 4 masses joined by springs along and across their squares, held by a corner, sheared and moving.
fn patch() -> Result<Body, ValidateError> {
    let at = |column: usize, row: usize| 4 * row + column;
    let x: Vec<Vector3<f64>> = (0..16).map(|k| [0.1 * (k % 4) as f64, 0.1 * (k / 4) as f64, 0.0]).collect();
    let (mut pairs, mut springs) = (Vec::new(), Vec::new());
    for row in 0..4 {
        for column in 0..4_usize {
            let mut join = |other: usize, stiffness: f64, length: f64| {
                pairs.push([at(column, row), other]);
                springs.push(HookeSpring::new(stiffness, length));
            };
            if column < 3 {
                join(at(column + 1, row), 40.0, 0.1);
            }
            if row < 3 {
                join(at(column, row + 1), 40.0, 0.1);
            }
            if row < 3 && column < 3 {
                join(at(column + 1, row + 1), 20.0, 0.02_f64.sqrt());
            }
        }
    }
    let vertices: Vec<[usize; 1]> = (0..16).map(|vertex| [vertex]).collect();
    let weights = vec![Gravity::new(0.02, [0.0, 0.0, -9.81]); 16];
    let mut held = vec![false; 16];
    held[0] = true;
    let system = System::new(
        vec![
            Box::new(PotentialTerm::new(ElementList::new("springs", springs, &pairs)?)),
            Box::new(PotentialTerm::new(ElementList::new("weights", weights, &vertices)?)),
        ],
        &held,
    )?;
    let mut v: Vec<Vector3<f64>> = x.iter().map(|p| [0.0, 2.0 * p[2], 3.0 * p[0] - 2.0 * p[1]]).collect();
    v[0] = [0.0; 3];
    Ok(Body { v, x, masses: vec![0.02; 16], system })
}

/// The classical Runge–Kutta method of fourth order; the reference at small steps.
pub(crate) fn runge_kutta(body: &mut Body, time: f64, steps: usize) -> Result<(), ValidateError> {
    let h = time / steps as f64;
    let free = body.system.dofs().free().to_vec();
    let masses = body.masses.clone();
    type Rates = (Vec<Vector3<f64>>, Vec<Vector3<f64>>);
    let rates = |system: &mut System, x: &[Vector3<f64>], v: &[Vector3<f64>]| -> Result<Rates, ValidateError> {
        let mut force = system.forces(State { x, v })?;
        let mut acceleration = vec![[0.0; 3]; x.len()];
        for &vertex in &free {
            acceleration[vertex] = std::mem::take(&mut force[vertex]).map(|f| f / masses[vertex]);
        }
        Ok((v.to_vec(), acceleration))
    };
    let along = |y: &[Vector3<f64>], k: &[Vector3<f64>], part: f64| -> Vec<Vector3<f64>> {
        y.iter().zip(k).map(|(y, k)| std::array::from_fn(|axis| y[axis] + part * k[axis])).collect()
    };
    for _ in 0..steps {
        let (x, v) = (body.x.clone(), body.v.clone());
        let mut stages: Vec<Rates> = Vec::with_capacity(4);
        for part in [0.0, 0.5 * h, 0.5 * h, h] {
            let (x, v) = match stages.last() {
                Some((dx, dv)) => (along(&x, dx, part), along(&v, dv, part)),
                None => (x.clone(), v.clone()),
            };
            stages.push(rates(&mut body.system, &x, &v)?);
        }
        for ((dx, dv), weight) in stages.iter().zip([1.0, 2.0, 2.0, 1.0]) {
            body.x = along(&body.x, dx, weight * h / 6.0);
            body.v = along(&body.v, dv, weight * h / 6.0);
        }
    }
    Ok(())
}

/// Returns the integrators with their orders and tolerances, solved so accurately that only their own error remains.
fn schemes() -> Vec<(Box<dyn Integrator>, f64, f64)> {
    let exact = NewtonOptions {
        velocity_tolerance: 1e-11,
        impulse_tolerance: 0.0,
        linear_tolerance: 1e-9,
        ..NewtonOptions::default()
    };
    let linear = SolveOptions::new(1e-12).with_iteration_limit(1000);
    vec![
        (Box::new(ExplicitEuler::default()), 1.0, 0.05),
        (Box::new(SymplecticEuler), 1.0, 0.05),
        (Box::new(ImplicitEuler::with_options(linear)), 1.0, 0.05),
        (Box::new(Newton::with_options(exact)), 1.0, 0.05),
        (Box::new(Verlet::default()), 2.0, 0.05),
        (Box::new(ImplicitMidpoint::with_options(exact)), 2.0, 0.05),
        (Box::new(Trapezoid::with_options(exact)), 2.0, 0.05),
        (Box::new(Bdf2::with_options(exact)), 2.0, 0.05),
    ]
}

/// Simulated time, in s.
const TIME: f64 = 0.2;

fn error(body: &mut Body, scheme: &mut dyn Integrator, steps: usize, truth: &Body) -> Result<f64, ValidateError> {
    for _ in 0..steps {
        scheme.step(body, TIME / steps as f64)?;
    }
    let apart = body.x.as_flattened().iter().zip(truth.x.as_flattened()).map(|(a, b)| (a - b).abs());
    Ok(apart.fold(0.0, f64::max))
}

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    type Make = fn() -> Result<Body, ValidateError>;
    let steps = if quick { 800 } else { 1600 };
    for (name, make) in [("pendulum", pendulum as Make), ("4 × 4 springs", patch as Make)] {
        let mut truth = make()?;
        runge_kutta(&mut truth, TIME, 4 * steps)?;
        for (mut scheme, order, limit) in schemes() {
            let coarse = error(&mut make()?, &mut *scheme, steps / 2, &truth)?;
            let fine = error(&mut make()?, &mut *scheme, steps, &truth)?;
            let case = format!("{name}, {}, {} to {steps} steps", scheme.name(), steps / 2);
            report(Finding::absolute("order", case, (coarse / fine).log2(), order, limit));
        }
    }
    Ok(())
}
