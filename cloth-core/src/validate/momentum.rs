use energy_dsl::Vector3;
use energy_solve::System;

use super::{Finding, ValidateError};
use crate::Body;
use crate::fabric::{self, Bending, Fabric, Material, Membrane, Rigidity, Surroundings};
use crate::geometry::{norm, subtract};
use crate::integrator::{
    Bdf2, ExplicitEuler, ImplicitMidpoint, Integrator, Newton, NewtonOptions, SymplecticEuler, Trapezoid, Verlet,
};
use crate::mesh::{Diagonals, Plane, Sheet, SpringNetwork};

/// A free sheet of 0.3 m × 0.25 m under gravity, with 6 × 5 cells.
fn sheet(gravity: f64) -> Result<Body, ValidateError> {
    let sheet = Sheet {
        cells: [6, 5],
        size: [0.3, 0.25],
        diagonals: Diagonals::Alternating,
        plane: Plane::Horizontal,
        pleats: None,
    };
    let mesh = sheet.mesh()?;
    let plate = Rigidity::Flexural { rigidity: 1e-4, poisson_ratio: 0.3 };
    let membrane = Membrane { stretch_stiffness: 40.0, poisson_ratio: 0.3, bending: Bending::Plate(plate) };
    let fabric = Fabric::new(0.2, Material::Stvk(membrane));
    let surroundings = Surroundings { gravity: [0.0, 0.0, -gravity], drag: 0.0 };
    let garment = fabric::terms(&fabric, &mesh, &SpringNetwork::default(), &surroundings)?;
    let x = mesh.vertices().to_vec();
    let system = System::new(garment.terms, &vec![false; x.len()])?;
    Ok(Body { v: vec![[0.0; 3]; x.len()], x, masses: garment.masses, system })
}

/// A weightless sheet, stretched and wrinkled, that moves and spins at 10 rad/s.
fn spinning() -> Result<Body, ValidateError> {
    let mut body = sheet(0.0)?;
    for (x, v) in body.x.iter_mut().zip(&mut body.v) {
        *x = [1.05 * x[0], x[1] + 0.05 * x[0], 0.01 * (20.0 * x[0] + 9.0 * x[1]).sin()];
        *v = [0.3 - 10.0 * x[1], 10.0 * x[0], 0.1 + 2.0 * x[1]];
    }
    Ok(body)
}

fn exact() -> NewtonOptions {
    NewtonOptions {
        velocity_tolerance: 1e-10,
        impulse_tolerance: 0.0,
        linear_tolerance: 1e-11,
        ..NewtonOptions::default()
    }
}

fn drift(now: Vector3<f64>, before: Vector3<f64>, scale: f64) -> f64 {
    norm(subtract(now, before)) / scale
}

pub(super) fn ask(_: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    momenta(report)?;
    free_fall(report)
}

/// All integrators conserve momentum; some conserve angular momentum.
fn momenta(report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let schemes: [(Box<dyn Integrator>, f64, bool); 5] = [
        (Box::new(SymplecticEuler), 1e-4, true),
        (Box::new(Verlet::default()), 1e-4, true),
        (Box::new(ImplicitMidpoint::with_options(exact())), 2e-3, true),
        (Box::new(Newton::with_options(exact())), 2e-3, false),
        (Box::new(Bdf2::with_options(exact())), 2e-3, false),
    ];
    for (mut scheme, dt, keeps_spin) in schemes {
        let mut body = spinning()?;
        let (momentum, spin) = (body.momentum(), body.angular_momentum());
        let steps = 200;
        for _ in 0..steps {
            scheme.step(&mut body, dt)?;
        }
        let mass: f64 = body.masses.iter().sum();
        let case = format!("spinning sheet, {}, {steps} steps: momentum", scheme.name());
        let scale = norm(momentum).max(mass);
        report(Finding::absolute("momentum", case, drift(body.momentum(), momentum, scale), 0.0, 1e-12));
        let lost = drift(body.angular_momentum(), spin, norm(spin));
        let case = format!("spinning sheet, {}, {steps} steps: spin", scheme.name());
        // The others lose some, in proportion to the step size.
        report(Finding::absolute("momentum", case, lost, 0.0, if keeps_spin { 1e-12 } else { 0.2 }));
    }
    Ok(())
}

/// Free fall after n steps: g h² n (n ± 1)/2 for the Euler methods, g t²/2 for methods of second order.
fn free_fall(report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    // Stable for explicit methods too; otherwise rounding errors would grow.
    let (g, h, n) = (9.81, 2e-4, 100.0);
    let after = g * h * h * n * (n + 1.0) / 2.0;
    let before = g * h * h * n * (n - 1.0) / 2.0;
    let even = g * (h * n) * (h * n) / 2.0;
    let schemes: [(Box<dyn Integrator>, f64); 6] = [
        (Box::new(SymplecticEuler), after),
        (Box::new(Newton::with_options(exact())), after),
        (Box::new(ExplicitEuler::default()), before),
        (Box::new(Verlet::default()), even),
        (Box::new(ImplicitMidpoint::with_options(exact())), even),
        (Box::new(Trapezoid::with_options(exact())), even),
    ];
    for (mut scheme, drop) in schemes {
        let mut body = sheet(g)?;
        for _ in 0..100 {
            scheme.step(&mut body, h)?;
        }
        // The vertex with the largest error.
        let worst = body.x.iter().map(|x| -x[2]).max_by(|a, b| (a - drop).abs().total_cmp(&(b - drop).abs()));
        let case = format!("free fall, {}: drop in m", scheme.name());
        report(Finding::relative("momentum", case, worst.unwrap_or(f64::NAN), drop, 1e-10));
    }
    Ok(())
}
