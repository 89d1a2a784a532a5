use cloth_physics::Body;
use cloth_physics::integrator::{Bdf2, ImplicitEuler, Integrator, Scheme};
use energy_elements::{HookeSpring, ViscousDrag};
use energy_solve::{ElementList, ForceTerm, PotentialTerm, SolveOptions, State, System, Term};

/// Returns the error of a damped oscillation after 1 s: a mass m between a spring k and a damper c. With γ = c/2m
/// and ω² = k/m − γ², x = e^(−γt) (x₀ cos ωt + (v₀ + γ x₀)/ω sin ωt).
fn error_after_one_second(scheme: Scheme, steps: u32) -> f64 {
    let (m, k, c, x, v) = (2.0, 18.0, 0.8, [1.0, -0.5, 0.2], [0.3, 2.0, -1.0]);
    let spring = ElementList::new("spring", vec![HookeSpring::new(k, 0.0)], &[[0, 1]]).unwrap();
    let drag = ElementList::new("drag", vec![ViscousDrag::new(c)], &[[1]]).unwrap();
    let terms: Vec<Box<dyn Term>> = vec![Box::new(PotentialTerm::new(spring)), Box::new(ForceTerm::new(drag))];
    let system = System::new(terms, &[true, false]).unwrap();
    let mut body = Body { x: vec![[0.0; 3], x], v: vec![[0.0; 3], v], masses: vec![1.0, m], system };
    let mut integrator = scheme.integrator();
    for _ in 0..steps {
        integrator.step(&mut body, 1.0 / f64::from(steps)).unwrap();
    }
    let gamma: f64 = 0.5 * c / m;
    let omega = (k / m - gamma * gamma).sqrt();
    let (sine, cosine) = omega.sin_cos();
    let errors = (0..3).map(|axis| {
        let exact = (-gamma).exp() * (x[axis] * cosine + (v[axis] + gamma * x[axis]) / omega * sine);
        (body.x[1][axis] - exact).abs()
    });
    errors.fold(0.0, f64::max)
}

#[test]
fn schemes_converge_to_the_damped_oscillation_in_their_order() {
    for scheme in Scheme::ALL {
        let order = match scheme {
            Scheme::ImplicitEuler | Scheme::Newton | Scheme::SymplecticEuler | Scheme::ExplicitEuler => 1,
            Scheme::Bdf2 | Scheme::ImplicitMidpoint | Scheme::Trapezoid | Scheme::Verlet => 2,
            Scheme::ExplicitEulerAsPrinted => continue, // lacks a factor h
        };
        let [coarse, fine] = [100, 200].map(|steps| error_after_one_second(scheme, steps));
        let found = (coarse / fine).log2();
        assert!((found - f64::from(order)).abs() < 0.1 && fine < 0.05, "{scheme:?}: {found}, {fine:e} m");
    }
}

/// Forces of springs without rest length and of drag are linear: their linearised step is the implicit one.
#[test]
fn a_step_of_implicit_euler_under_linear_forces_solves_the_implicit_equations() {
    let springs = vec![HookeSpring::new(40.0, 0.0), HookeSpring::new(25.0, 0.0)];
    let springs = PotentialTerm::new(ElementList::new("springs", springs, &[[0, 1], [1, 2]]).unwrap());
    let drag = vec![ViscousDrag::new(3.0), ViscousDrag::new(5.0)];
    let drag = ForceTerm::new(ElementList::new("drag", drag, &[[1], [2]]).unwrap());
    let system = System::new(vec![Box::new(springs), Box::new(drag)], &[true, false, false]).unwrap();
    let x = vec![[0.0; 3], [1.0, 0.2, 0.0], [1.5, -0.4, 0.7]];
    let v = vec![[0.1, 0.0, -0.2], [0.0, 3.0, 1.0], [1.0, -2.0, 0.5]];
    let mut body = Body { x, v: v.clone(), masses: vec![1.0, 2.0, 3.0], system };
    let dt = 0.1;
    let mut scheme = ImplicitEuler::with_options(SolveOptions::new(1e-13));
    scheme.step(&mut body, dt).unwrap();
    let force = body.system.forces(State { x: &body.x, v: &body.v }).unwrap();
    for vertex in [1, 2] {
        for axis in 0..3 {
            let gained = body.masses[vertex] * (body.v[vertex][axis] - v[vertex][axis]);
            assert!((gained - dt * force[vertex][axis]).abs() < 1e-11, "vertex {vertex}: {gained} N s");
        }
    }
}

/// A vertex that a spring ties to a pin, which moves, and one that flies freely.
fn pulled_and_flying() -> Body {
    let spring = ElementList::new("spring", vec![HookeSpring::new(40.0, 0.8)], &[[0, 1]]).unwrap();
    let system = System::new(vec![Box::new(PotentialTerm::new(spring))], &[true, false, false]).unwrap();
    let x = vec![[0.0; 3], [1.0, 0.2, 0.0], [0.0, 0.0, 5.0]];
    Body { x, v: vec![[0.1, 0.0, -0.2], [0.0, 0.3, 0.1], [1.0, -2.0, 0.5]], masses: vec![1.0, 2.0, 3.0], system }
}

#[test]
fn steps_solve_the_equations_of_the_backward_differentiation_formula() {
    let (mut body, mut scheme, dt) = (pulled_and_flying(), Bdf2::default(), 0.02);
    let start = (body.x.clone(), body.v.clone());
    let mut states = Vec::new();
    for step in 1..=6 {
        states.push((body.x.clone(), body.v.clone()));
        scheme.step(&mut body, dt).unwrap();
        for vertex in [0, 2] {
            for axis in 0..3 {
                let expected = start.0[vertex][axis] + f64::from(step) * dt * start.1[vertex][axis];
                assert!((body.x[vertex][axis] - expected).abs() < 1e-13, "step {step}: vertex {vertex}");
            }
        }
        let [.., before, here] = &states[..] else { continue };
        let (x, v) = (body.x.clone(), body.v.clone());
        let force = body.system.forces(State { x: &x, v: &v }).unwrap();
        for axis in 0..3 {
            // y' = (4 y − y₋₁)/3 + ⅔ h ẏ', for positions and velocities.
            let next = |here: f64, before: f64, rate: f64| (4.0 * here - before) / 3.0 + 2.0 / 3.0 * dt * rate;
            let x = next(here.0[1][axis], before.0[1][axis], body.v[1][axis]);
            let v = next(here.1[1][axis], before.1[1][axis], force[1][axis] / body.masses[1]);
            let [x_error, v_error] = [body.x[1][axis] - x, body.v[1][axis] - v].map(f64::abs);
            assert!(x_error < 1e-14 && v_error < 1e-6, "step {step}: {x_error:e} m, {v_error:e} m/s");
        }
    }
}
