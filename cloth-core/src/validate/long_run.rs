//! A hundred thousand steps: energy must neither grow nor drift, except as the integrator's theory allows.

use energy_dsl::Vector3;
use energy_solve::System;

use super::equilibrium::Equilibrium;
use super::{Finding, ValidateError};
use crate::Body;
use crate::fabric::{self, Bending, Fabric, Material, Membrane, Surroundings};
use crate::integrator::{ImplicitMidpoint, Integrator, Newton, NewtonOptions, SymplecticEuler, Verlet};
use crate::mesh::{Diagonals, Plane, Sheet, SpringNetwork};

const GRAVITY: f64 = 9.81;

/// A square metre of soft cloth of 8 × 8 cells, upright, held by its upper corners, with the lower edge drawn aside,
/// without damping.
fn hanging() -> Result<Body, ValidateError> {
    let sheet = Sheet {
        cells: [8, 8],
        size: [1.0, 1.0],
        diagonals: Diagonals::Alternating,
        plane: Plane::Vertical,
        pleats: None,
    };
    let mesh = sheet.mesh()?;
    let bending = Bending::Flat { stiffness: 1e-3 };
    let membrane = Membrane { stretch_stiffness: 40.0, poisson_ratio: 0.3, bending };
    let fabric = Fabric::new(0.2, Material::Stvk(membrane));
    let surroundings = Surroundings { gravity: [0.0, 0.0, -GRAVITY], drag: 0.0 };
    let garment = fabric::terms(&fabric, &mesh, &SpringNetwork::default(), &surroundings)?;
    let top = mesh.vertices().iter().fold(f64::NEG_INFINITY, |top, x| top.max(x[2]));
    let drawn = |x: &Vector3<f64>| [x[0], x[1] + 0.2 * (top - x[2]), x[2] + 0.02 * (top - x[2])];
    let x: Vec<Vector3<f64>> = mesh.vertices().iter().map(drawn).collect();
    let mut pinned = vec![false; x.len()];
    for corner in [sheet.vertex(0, 8), sheet.vertex(8, 8)] {
        pinned[corner] = true;
    }
    let system = System::new(garment.terms, &pinned)?;
    Ok(Body { v: vec![[0.0; 3]; x.len()], x, masses: garment.masses, system })
}

/// Returns kinetic plus potential energy, in J.
fn energy(body: &mut Body) -> Result<f64, ValidateError> {
    let potential: f64 = body.system.energies(&body.x)?.iter().filter_map(|term| term.energy).sum();
    Ok(body.kinetic_energy() + potential)
}

/// Returns the energies at the start and after each step.
fn energies(scheme: &mut dyn Integrator, body: &mut Body, dt: f64, steps: usize) -> Result<Vec<f64>, ValidateError> {
    let mut all = vec![energy(body)?];
    for _ in 0..steps {
        scheme.step(body, dt)?;
        all.push(energy(body)?);
    }
    Ok(all)
}

/// Returns the energy of the nearest equilibrium, in J.
fn rest(body: Body) -> Result<f64, ValidateError> {
    let weight = GRAVITY * body.masses.iter().sum::<f64>();
    let mut rest = Equilibrium::find(body.system, body.x, body.masses, weight)?;
    Ok(rest.system.energies(&rest.x)?.iter().filter_map(|term| term.energy).sum())
}

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    // Long steps dissipate more, so fewer of them suffice.
    let (steps, long) = if quick { (1_500, 0.1) } else { (100_000, 0.02) };
    let swing = {
        let mut body = hanging()?;
        energy(&mut body)? - rest(body)?
    };
    dissipating(swing, long, steps, report)?;
    conserving(swing, steps, report)
}

/// Implicit Euler: energy falls monotonically to that of the equilibrium.
fn dissipating(swing: f64, dt: f64, steps: usize, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let exact = NewtonOptions { velocity_tolerance: 1e-9, linear_tolerance: 1e-6, ..NewtonOptions::default() };
    let mut body = hanging()?;
    let all = energies(&mut Newton::with_options(exact), &mut body, dt, steps)?;
    let growth = all.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max) / swing;
    let case = |what: &str| format!("newton, {steps} steps: {what}");
    report(Finding::absolute("long run", case("growth in a step"), growth, 0.0, 1e-12));
    let tenth = &all[all.len() - steps / 10..];
    let spread = tenth.iter().fold(f64::NEG_INFINITY, |most, e| most.max(*e))
        - tenth.iter().fold(f64::INFINITY, |least, e| least.min(*e));
    let end = all[steps];
    report(Finding::absolute("long run", case("change in the last tenth"), spread / swing, 0.0, 1e-9));
    report(Finding::absolute("long run", case("above the equilibrium"), (end - rest(body)?) / swing, 0.0, 1e-9));
    Ok(())
}

/// The other integrators: the energy error of the last tenth equals that of the first, except for the part that follows
/// the motion. The motion develops finer scales and then stays so; the second half shows no trend.
fn conserving(swing: f64, steps: usize, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let exact = NewtonOptions { velocity_tolerance: 1e-10, linear_tolerance: 1e-6, ..NewtonOptions::default() };
    // Symplectic Euler is of first order, so its energy oscillates more.
    let schemes: [(Box<dyn Integrator>, f64); 3] = [
        (Box::new(SymplecticEuler), 0.1),
        (Box::new(Verlet::default()), 0.01),
        (Box::new(ImplicitMidpoint::with_options(exact)), 0.01),
    ];
    for (mut scheme, limit) in schemes {
        let all = energies(&mut *scheme, &mut hanging()?, 1e-3, steps)?;
        let mean = |part: &[f64]| part.iter().map(|e| (e - all[0]) / swing).sum::<f64>() / part.len() as f64;
        let largest = all.iter().map(|e| (e - all[0]).abs() / swing).fold(0.0, f64::max);
        let case = |what: &str| format!("{}, {steps} steps: {what}", scheme.name());
        let tenth = |number: usize| mean(&all[number * steps / 10..(number + 1) * steps / 10]);
        report(Finding::absolute("long run", case("largest error"), largest, 0.0, limit));
        report(Finding::absolute("long run", case("drift"), tenth(9) - tenth(0), 0.0, 0.005));
        report(Finding::absolute("long run", case("drift, second half"), tenth(9) - tenth(5), 0.0, 0.1 * limit));
    }
    Ok(())
}
