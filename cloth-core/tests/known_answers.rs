//! The faster validation questions, and the adaptive step.

use cloth_core::physics::integrator::{Adaptive, Integrator, Newton, NewtonOptions, StepError};
use cloth_core::scene::Scene;
use cloth_core::validate::{self, Cantilever, MeshKind};
use cloth_core::{Simulation, physics::Body};

fn all_pass(questions: &[&str]) {
    let names: Vec<String> = questions.iter().map(|name| (*name).to_owned()).collect();
    let findings = validate::ask(&names, true, |_| {}).unwrap();
    let missed: Vec<String> = findings.iter().filter(|one| !one.passed()).map(validate::line).collect();
    assert!(!findings.is_empty() && missed.is_empty(), "{}\n{}", validate::head(), missed.join("\n"));
}

#[test]
fn integrators_have_their_orders_and_conserve_momentum() {
    all_pass(&["orders", "momentum"]);
}

/// The full question, a hundred thousand steps of each integrator, is `cloth validate long-run`.
#[test]
fn energy_does_not_drift_over_many_steps() {
    all_pass(&["long-run"]);
}

#[test]
fn a_short_strip_on_a_random_mesh_bends_like_the_elastica() {
    let strip = Cantilever {
        gamma: 5.0,
        poisson_ratio: 0.0,
        aspect: 0.2,
        mesh: MeshKind::Random,
        orientation: 0.0,
        segments: 20,
    };
    let fitted = strip.fit().unwrap();
    assert!((fitted / 5.0 - 1.0).abs() < 0.01, "{fitted}");
}

fn squeezed() -> Body {
    let scene = "dt = 0.1\nduration = 0.1\nadaptive = true\nintegrator = \"newton\"\n[mesh.sheet]\ncells = [4, 4]\n\
                 size = [0.4, 0.4]\n\
                 [fabric]\ndensity = 0.2\n[fabric.material.neo-hookean]\nstretch_stiffness = 100.0\n\
                 poisson_ratio = 0.3\n\
                 [[pins]]\nnearest = [-0.2, 0.2, 0.0]\n";
    let scene = Scene::parse(scene, "scene.toml".as_ref()).unwrap();
    let shape = scene.garments[0].shape(&scene.folder).unwrap();
    let nothing = cloth_core::physics::fabric::Surroundings { gravity: [0.0, 0.0, -9.81], drag: 0.0 };
    let garment =
        cloth_core::physics::fabric::terms(&scene.garments[0].fabric, &shape.mesh, &shape.springs, &nothing).unwrap();
    let x: Vec<[f64; 3]> = shape.start.iter().map(|p| [0.7 * p[0], 0.8 * p[1], 0.01 * (30.0 * p[0]).sin()]).collect();
    let system = energy_solve::System::new(garment.terms, &vec![false; x.len()]).unwrap();
    assert!(Simulation::new(&scene).unwrap().step().is_ok());
    Body { v: vec![[0.0; 3]; x.len()], x, masses: garment.masses, system }
}

#[test]
fn a_failed_step_is_halved_until_it_succeeds_and_reports_why() {
    let hasty = |limit| NewtonOptions { iteration_limit: limit, ..NewtonOptions::default() };
    let mut body = squeezed();
    let plain = Newton::with_options(hasty(6)).step(&mut body, 0.1);
    assert!(matches!(plain, Err(StepError::NotConverged { .. })), "{plain:?}");
    let mut adaptive = Adaptive::new(Box::new(Newton::with_options(hasty(6))));
    let report = adaptive.step(&mut body, 0.1).unwrap();
    assert!(report.rejected > 0 && report.solves > 6, "{report:?}");
    let rejection = adaptive.last_rejection().unwrap();
    assert!(rejection.dt < 0.1 + 1e-12 && matches!(rejection.reason, StepError::NotConverged { .. }));
    let smallest = adaptive.part();
    // The step size grows back once steps succeed.
    for _ in 0..20 {
        adaptive.step(&mut body, 0.02).unwrap();
    }
    assert!(adaptive.part() >= smallest && adaptive.part() > 0.2, "{}", adaptive.part());

    let mut hopeless = Adaptive::new(Box::new(Newton::with_options(hasty(0))));
    let before = body.x.clone();
    let error = hopeless.step(&mut body, 0.1).unwrap_err().to_string();
    assert!(error.starts_with("rejected down to a step of 9.537e-8 s: Newton's method did not converge"), "{error}");
    assert_eq!(body.x, before);
}
