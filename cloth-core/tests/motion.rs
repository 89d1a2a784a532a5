//! Conservation laws and the orders of the integrators.

use cloth_core::physics::fabric::{Surroundings, terms};
use cloth_core::physics::integrator::{ImplicitEuler, Integrator, Newton, NewtonOptions, StepReport, SymplecticEuler};
use cloth_core::physics::mesh::{SpringNetwork, Topology, TriangleMesh};
use cloth_core::scene::Scene;
use cloth_core::{Simulation, physics::Body};
use energy_solve::{Curvature, LinearisationOptions, SolveOptions, State, System, Weights};

fn scene(head: &str, fabric: &str) -> Scene {
    let text = format!("{head}\n[mesh.sheet]\ncells = [6, 5]\nsize = [0.6, 0.5]\n[fabric]\ndensity = 0.2\n{fabric}");
    Scene::parse(&text, "test.toml".as_ref()).unwrap()
}

const STVK: &str = "[fabric.material.stvk]\nstretch_stiffness = 40.0\npoisson_ratio = 0.3\n\
                    [fabric.material.stvk.bending.bridson]\nstiffness = 1e-4\n";
const NEO_HOOKEAN: &str = "[fabric.material.neo-hookean]\nstretch_stiffness = 40.0\npoisson_ratio = 0.3\n\
                           [fabric.material.neo-hookean.bending.flat]\nstiffness = 1e-4\n";
const PRINTED: &str = "[fabric.material.stvk]\nstretch_stiffness = 40.0\npoisson_ratio = 0.3\n\
                       [fabric.material.stvk.bending.bridson-force]\nstiffness = 1e-4\ndamping = 1e-5\n";
const SPRINGS: &str = "[fabric.material.mass-spring]\nstructural = 40.0\nshear = 20.0\nbending = 1.0\ndamping = 0.01\n";
const CORNER: &str = "[[pins]]\nnearest = [-0.3, 0.25, 0.0]\n";

fn finished(scene: &Scene) -> Simulation {
    let mut simulation = Simulation::new(scene).unwrap();
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    simulation
}

#[test]
fn a_sheet_falls_like_a_point_mass() {
    for fabric in [STVK, PRINTED, SPRINGS] {
        for integrator in ["implicit-euler", "symplectic-euler", "newton"] {
            if integrator == "newton" && fabric != STVK {
                continue; // their damping has no energy
            }
            let head = format!("dt = 0.001\nduration = 0.05\nintegrator = \"{integrator}\"");
            let simulation = finished(&scene(&head, fabric));
            let (n, h) = (50.0, 0.001);
            let drop = 9.81 * h * h * n * (n + 1.0) / 2.0;
            for (now, rest) in simulation.positions().iter().zip(simulation.mesh(0).unwrap().vertices()) {
                // Implicit steps are as accurate as their linear solves.
                let tolerance = if integrator == "symplectic-euler" { 1e-13 } else { 1e-5 * drop };
                let fell = rest[2] - now[2];
                assert!((fell - drop).abs() < tolerance, "{integrator}: fell {fell}, not {drop}");
                assert!((now[0] - rest[0]).abs() < tolerance);
            }
        }
    }
}

#[test]
fn drag_is_taken_at_the_end_of_an_implicit_step() {
    let simulation = finished(&scene("dt = 0.02\nduration = 0.4\ndrag = 5.0", STVK));
    // v' = (v − h g)/(1 + h c), twenty times.
    let speed = 9.81 / 5.0 * (1.0 - (1.0 + 0.02_f64 * 5.0).powi(-20));
    for v in simulation.velocities() {
        assert!((v[2] + speed).abs() < 1e-4 * speed, "{} {speed}", -v[2]);
    }
}

/// A free sheet, wrinkled and stretched, initially at rest, without gravity.
fn distorted(fabric: &str) -> Body {
    distorted_under(fabric, &Surroundings { gravity: [0.0; 3], drag: 0.0 })
}

/// A free sheet, wrinkled and stretched, with gravity and drag.
fn distorted_under(fabric: &str, surroundings: &Surroundings) -> Body {
    let scene = scene("dt = 1.0\nduration = 1.0", fabric);
    let shape = scene.garments[0].shape(&scene.folder).unwrap();
    let garment = terms(&scene.garments[0].fabric, &shape.mesh, &shape.springs, surroundings).unwrap();
    let wave = |p: &[f64; 3]| [1.1 * p[0], p[1] + 0.05 * p[0], 0.03 * (9.0 * p[0] + 4.0 * p[1]).sin()];
    let x: Vec<[f64; 3]> = shape.start.iter().map(wave).collect();
    let system = System::new(garment.terms, &vec![false; x.len()]).unwrap();
    Body { v: vec![[0.0; 3]; x.len()], x, masses: garment.masses, system }
}

#[test]
fn newton_never_adds_energy() {
    let undamped = SPRINGS.replace("damping = 0.01\n", "");
    for fabric in [STVK, NEO_HOOKEAN, &undamped] {
        let mut body = distorted(fabric);
        let mut newton = Newton::default();
        let energy_of = |body: &mut Body| {
            let energies = body.system.energies(&body.x).unwrap();
            energies.iter().filter_map(|term| term.energy).sum::<f64>() + body.kinetic_energy()
        };
        let mut before = energy_of(&mut body);
        let mut iterations = 0;
        for _ in 0..40 {
            iterations += newton.step(&mut body, 0.01).unwrap().solves;
            let after = energy_of(&mut body);
            assert!(after <= before * (1.0 + 1e-6), "{before} J became {after} J");
            before = after;
        }
        assert!(body.kinetic_energy() > 0.0 && iterations < 40 * 12, "{iterations} iterations");
    }
}

#[test]
fn newton_solves_the_equations_of_implicit_euler() {
    let options = NewtonOptions { velocity_tolerance: 1e-10, linear_tolerance: 1e-6, ..NewtonOptions::default() };
    for fabric in [STVK, NEO_HOOKEAN] {
        let mut body = distorted(fabric);
        let (dt, v0) = (0.01, body.v.clone());
        Newton::with_options(options).step(&mut body, dt).unwrap();
        let (x, v) = (body.x.clone(), body.v.clone());
        let force = body.system.forces(State { x: &x, v: &v }).unwrap();
        let largest = force.as_flattened().iter().fold(0.0_f64, |largest, f| largest.max(f.abs()));
        for vertex in 0..v.len() {
            for axis in 0..3 {
                let lack = body.masses[vertex] * (v[vertex][axis] - v0[vertex][axis]) / dt - force[vertex][axis];
                assert!(lack.abs() < 1e-6 * largest, "vertex {vertex} lacks {lack} N of {largest} N");
            }
        }
    }
}

#[test]
fn newton_starts_from_extrapolated_accelerations() {
    let options = NewtonOptions { impulse_tolerance: 1e-6, velocity_tolerance: 1e-9, ..NewtonOptions::default() };
    let solves = |keep: bool| {
        let mut body = distorted_under(NEO_HOOKEAN, &Surroundings { gravity: [0.0, 0.0, -9.81], drag: 2.0 });
        let mut newton = Newton::with_options(options);
        let mut solves = 0;
        for _ in 0..100 {
            solves += newton.step(&mut body, 0.001).unwrap().solves;
            if !keep {
                newton = Newton::with_options(options);
            }
        }
        solves
    };
    let (kept, forgotten) = (solves(true), solves(false));
    assert!(4 * kept < 3 * forgotten, "{kept} systems, {forgotten} without memory");
}

#[test]
fn newton_uses_every_assembled_hessian() {
    let options = NewtonOptions { impulse_tolerance: 1e-5, velocity_tolerance: 1e-9, ..NewtonOptions::default() };
    let mut body = distorted(NEO_HOOKEAN);
    let mut newton = Newton::with_options(options);
    let mut total = StepReport::default();
    (0..20).for_each(|_| total += newton.step(&mut body, 0.01).unwrap());
    let solves = total.solves;
    let (membrane, counts) = body.system.terms().next().unwrap();
    let elements = membrane.stencils().len() as u64;
    // Local eliminations evaluate at most the six triangles of each of their vertices.
    let needed = solves * elements..=solves * elements + 6 * total.local_vertices;
    assert!(needed.contains(&counts.hessian.evaluated), "of {elements} elements in {total:?}");
    // Steps end by the impulse test, which evaluates forces alone, but not before every system.
    let looked = counts.gradient.evaluated / elements;
    assert!((20..solves).contains(&looked), "{looked} times of {solves}");
}

#[test]
fn newton_converges_although_exact_hessians_are_indefinite() {
    // A square of cotton falls into folds, fast enough to buckle everywhere. With exact Hessians only, its 33rd step
    // does not converge.
    let text = "dt = 0.01\nduration = 0.6\nintegrator = \"newton\"\ntolerances.velocity = 1e-3\ndrag = 4.0\n\
                [mesh.sheet]\ncells = [32, 32]\nsize = [0.5, 0.5]\n[fabric]\ndensity = 0.15\n\
                [fabric.material.stvk]\nstretch_stiffness = 50.0\npoisson_ratio = 0.3\nbending.flat.stiffness = 1e-5\n\
                [[pins]]\nnearest = [-0.25, 0.25, 0.0]\n[[pins]]\nnearest = [0.25, 0.25, 0.0]\n";
    let simulation = finished(&Scene::parse(text, "cotton.toml".as_ref()).unwrap());
    assert_eq!(simulation.steps_done(), 60);
}

#[test]
fn newton_rejects_forces_without_energy_by_name() {
    let mut body = distorted(PRINTED);
    let before = body.x.clone();
    let error = Newton::default().step(&mut body, 0.01).unwrap_err();
    assert_eq!(
        error.to_string(),
        "bending: its forces come from no energy that Newton's method could lower; use the integrator implicit-euler"
    );
    assert_eq!(body.x, before);
}

#[test]
fn newton_reports_a_flattened_triangle() {
    // Two corners of the sheet are pushed through each other. Neo-Hookean triangles cannot invert, so the step must
    // report failure.
    let mut body = distorted(NEO_HOOKEAN);
    body.v[0] = [40.0, 30.0, 5.0];
    for _ in 0..20 {
        match Newton::default().step(&mut body, 0.02) {
            Ok(_) => assert!(body.x.as_flattened().iter().all(|coordinate| coordinate.is_finite())),
            Err(error) => panic!("{error}"),
        }
    }
}

#[test]
fn internal_forces_conserve_momentum() {
    let precise = SolveOptions::new(1e-13).with_iteration_limit(10_000);
    for fabric in [STVK, PRINTED, SPRINGS] {
        let schemes: [(Box<dyn Integrator>, f64); 2] =
            [(Box::new(SymplecticEuler), 5e-4), (Box::new(ImplicitEuler::with_options(precise)), 5e-3)];
        for (mut scheme, dt) in schemes {
            let mut body = distorted(fabric);
            for _ in 0..50 {
                scheme.step(&mut body, dt).unwrap();
            }
            let mass: f64 = body.masses.iter().sum();
            let speed = (2.0 * body.kinetic_energy() / mass).sqrt();
            assert!(speed > 0.01, "{}: it must move for this to mean anything: {speed}", scheme.name());
            let relative = body.momentum().map(|component| component / (mass * speed));
            assert!(relative.iter().all(|part| part.abs() < 1e-11), "{}: {relative:?}", scheme.name());
            if scheme.name() == "symplectic-euler" {
                let angular = body.angular_momentum().map(|component| component / (mass * speed * 0.5));
                assert!(angular.iter().all(|part| part.abs() < 1e-11), "{}: {angular:?}", scheme.name());
            }
        }
    }
}

#[test]
fn assembled_jacobians_are_derivatives_of_the_assembled_forces() {
    for fabric in [STVK, PRINTED, SPRINGS] {
        let mut body = distorted(fabric);
        let v: Vec<[f64; 3]> = body.x.iter().map(|x| [x[1], (20.0 * x[0]).sin(), x[0] * x[1]]).collect();
        let mut matrix = body.system.matrix();
        let weights = Weights { position: 1.0, velocity: 0.0 };
        let state = State { x: &body.x, v: &v };
        let options = LinearisationOptions::new(weights, Curvature::Exact);
        body.system.linearise(state, options, &mut matrix).unwrap();
        let scale = (0..42).map(|row| matrix.diagonal(row)[0][0].abs()).fold(0.0, f64::max);
        for (vertex, axis) in [(0, 2), (9, 0), (17, 1), (24, 2)] {
            let mut force_at = |step: f64| {
                let mut x = body.x.clone();
                x[vertex][axis] += step;
                body.system.forces(State { x: &x, v: &v }).unwrap()
            };
            let (after, before) = (force_at(1e-6), force_at(-1e-6));
            for row in 0..42 {
                for component in 0..3 {
                    let expected = (after[row][component] - before[row][component]) / 2e-6;
                    let got = matrix.block(row, vertex)[component][axis];
                    assert!((got - expected).abs() < 1e-7 * scale, "({row}, {vertex}): {got} {expected}\n{fabric}");
                }
            }
        }
    }
}

#[test]
fn symplectic_euler_conserves_energy_and_implicit_euler_dissipates_it() {
    let after = |scheme: &mut dyn Integrator, dt: f64| {
        let mut body = distorted(STVK);
        let total = |body: &mut Body| {
            let kinetic = body.kinetic_energy();
            let potential = body.system.energies(&body.x).unwrap();
            kinetic + potential.iter().filter_map(|term| term.energy).sum::<f64>()
        };
        let before = total(&mut body);
        for _ in 0..(0.2 / dt) as usize {
            scheme.step(&mut body, dt).unwrap();
        }
        total(&mut body) / before
    };
    let kept = after(&mut SymplecticEuler, 2e-4);
    assert!((kept - 1.0).abs() < 0.02, "{kept}");
    let left = after(&mut ImplicitEuler::default(), 5e-3);
    assert!((0.0..0.9).contains(&left), "{left}");
}

#[test]
fn a_creased_mesh_is_at_rest_in_its_own_shape() {
    let vertices = vec![[0.0; 3], [0.1, 0.0, 0.0], [0.05, 0.1, 0.0], [0.05, -0.06, 0.07]];
    let mesh = TriangleMesh::new(vertices, vec![[0, 1, 2], [1, 0, 3]]).unwrap();
    let springs = SpringNetwork::of_mesh(&Topology::of(&mesh));
    let nothing = Surroundings { gravity: [0.0; 3], drag: 0.0 };
    for fabric in [STVK, PRINTED, SPRINGS] {
        let garment =
            terms(&scene("dt = 1.0\nduration = 1.0", fabric).garments[0].fabric, &mesh, &springs, &nothing).unwrap();
        let mut system = System::new(garment.terms, &[false; 4]).unwrap();
        let force = system.forces(State { x: mesh.vertices(), v: &[[0.0; 3]; 4] }).unwrap();
        assert!(force.iter().flatten().all(|component| component.abs() < 1e-15), "{force:?}");
        let mut bent = mesh.vertices().to_vec();
        bent[3][2] += 0.01;
        let force = system.forces(State { x: &bent, v: &[[0.0; 3]; 4] }).unwrap();
        assert!(force[3][2] < -1e-6, "{force:?}");
    }
}

#[test]
fn schemes_are_of_first_order() {
    for (integrator, fabric) in [("implicit-euler", STVK), ("implicit-euler", SPRINGS), ("symplectic-euler", STVK)] {
        let height = |dt: f64| {
            let head = format!("dt = {dt}\nduration = 0.05\nintegrator = \"{integrator}\"");
            let simulation = finished(&scene(&head, &format!("{fabric}{CORNER}")));
            simulation.positions()[6][2] // the corner across
        };
        let heights = [0.002, 0.001, 0.0005].map(height);
        let order = ((heights[0] - heights[1]) / (heights[1] - heights[2])).abs().log2();
        assert!((order - 1.0).abs() < 0.15, "{integrator}: order {order}, heights {heights:?}");
    }
}

#[test]
fn schemes_and_bending_forms_agree_at_small_steps() {
    let height = |integrator: &str, fabric: &str| {
        let head = format!("dt = 0.0002\nduration = 0.1\nintegrator = \"{integrator}\"");
        finished(&scene(&head, &format!("{fabric}{CORNER}"))).positions()[6][2]
    };
    let fine = height("symplectic-euler", STVK);
    assert!(fine < -0.02);
    assert!((height("implicit-euler", STVK) / fine - 1.0).abs() < 0.01);
    // Bending hardly matters here, so the two forms must agree closely.
    assert!((height("implicit-euler", PRINTED) / fine - 1.0).abs() < 0.02);
}

#[test]
fn a_hanging_cloth_comes_to_rest_with_its_weight_on_the_pins() {
    let head = "dt = 0.02\nduration = 12.0\ndrag = 4.0";
    let pins = "[[pins]]\nbox = { min = [-1.0, 0.249, -1.0], max = [1.0, 1.0, 1.0] }\n";
    let mut simulation = finished(&scene(head, &format!("{SPRINGS}{pins}")));
    let summary = simulation.summary().unwrap();
    let held: f64 = simulation.masses().iter().take(7 * 5).sum(); // all rows but the pinned one
    assert!(summary.kinetic_energy < 1e-8, "{}", summary.kinetic_energy);
    assert!((summary.pin_force[2] + 9.81 * held).abs() < 1e-3 * 9.81 * held, "{:?}", summary.pin_force);
    assert!(simulation.positions()[0][2] < -0.45);
}

#[test]
fn runs_of_the_same_scene_are_bit_identical() {
    let scene = scene("dt = 0.01\nduration = 0.3", &format!("{STVK}{CORNER}"));
    let (a, b) = (finished(&scene), finished(&scene));
    assert_eq!(a.positions(), b.positions());
    assert_eq!(a.velocities(), b.velocities());
}

#[test]
fn too_large_explicit_steps_give_a_warning_and_an_error() {
    let text = format!("{STVK}{CORNER}");
    let small =
        Simulation::new(&scene("dt = 0.001\nduration = 1.0\nintegrator = \"symplectic-euler\"", &text)).unwrap();
    assert!(small.warnings().is_empty(), "{:?}", small.warnings());
    let large = scene("dt = 0.02\nduration = 100.0\nintegrator = \"symplectic-euler\"", &text);
    let mut simulation = Simulation::new(&large).unwrap();
    assert!(simulation.warnings()[0].contains("may blow up"));
    let error = loop {
        if let Err(error) = simulation.step() {
            break error.to_string();
        }
        assert!(!simulation.is_finished(), "an unstable run must not end as if nothing were wrong");
    };
    assert!(error.starts_with("step ") && (error.contains("vertex") || error.contains("vertices")), "{error}");
    assert!(simulation.positions().iter().flatten().all(|coordinate| coordinate.is_finite()));
}

#[test]
fn a_failed_linear_solve_leaves_the_state_unchanged() {
    let mut body = distorted(STVK);
    let before = body.x.clone();
    let hasty = SolveOptions::new(1e-12).with_iteration_limit(1);
    let error = ImplicitEuler::with_options(hasty).step(&mut body, 0.01).unwrap_err();
    assert_eq!(error.advice().unwrap(), "Try a smaller dt");
    let error = error.to_string();
    assert!(error.contains("stopped after 1 iterations: iteration limit reached"), "{error}");
    assert!(error.contains("the worst at vertex"), "{error}");
    assert_eq!(body.x, before);
}

#[test]
fn compressed_cloth_is_solved_again_with_projected_curvature() {
    // Compressed to 60 % in its plane, a membrane without bending stiffness is unstable: the exact system is
    // indefinite.
    let mut body = distorted(STVK);
    for x in &mut body.x {
        *x = [0.6 * x[0], 0.6 * x[1], x[2] * 1e-3];
    }
    let report = ImplicitEuler::default().step(&mut body, 0.05).unwrap();
    assert!(report.projected && report.solves == 2, "{report:?}");
    // One linear solve from so far away overshoots, but the cloth returns to its size.
    for _ in 0..30 {
        ImplicitEuler::default().step(&mut body, 0.05).unwrap();
    }
    assert!(body.x.iter().flatten().all(|coordinate| coordinate.abs() < 0.4));
}

#[test]
fn zero_stiffness_leaves_the_term_out() {
    let fabric = "[fabric.material.mass-spring]\nstructural = 40.0\nshear = 0.0\nbending = 0.0\n";
    let mut simulation = finished(&scene("dt = 0.01\nduration = 0.05\ngravity = [0.0, 0.0, 0.0]", fabric));
    let summary = simulation.summary().unwrap();
    assert_eq!(summary.terms.iter().map(|term| term.element.as_str()).collect::<Vec<_>>(), ["HookeSpring"]);
    assert_eq!(summary.left_out, ["shear springs: zero", "bending springs: zero", "gravity: zero", "drag: zero"]);
}
