//! Local elimination of Newton's method: restricted systems, and steps with and without it.

use cloth_core::physics::fabric::{Bending, Fabric, Material, Membrane, Rayleigh, Rigidity, Surroundings, terms};
use cloth_core::physics::integrator::{Integrator, Newton, NewtonOptions, StepReport};
use cloth_core::physics::mesh::{Diagonals, Plane, Sheet, SpringNetwork, TriangleMesh};
use cloth_core::physics::wind::Wind;
use cloth_core::scene::Scene;
use cloth_core::{Simulation, physics::Body};
use energy_dsl::{Declaration, Element, Vector3};
use energy_elements::Gravity;
use energy_solve::{
    Character, Curvature, DofMap, Linearisation, LinearisationOptions, Pattern, PlacedTerm, Quantity, State, Stencils,
    StepStart, System, Tally, Term, TermDescription, Weights,
};
use proptest::prelude::*;

const DT: f64 = 0.01;

fn sheet(cells: [usize; 2], size: [f64; 2]) -> TriangleMesh {
    let sheet = Sheet { cells, size, diagonals: Diagonals::Alternating, plane: Plane::Horizontal, pleats: None };
    sheet.mesh().unwrap()
}

/// A body of this mesh in gravity, drag and wind, with vertices pinned where `is_pinned`, and more terms.
fn body(
    mesh: &TriangleMesh,
    (bending, rayleigh): (Bending, Rayleigh),
    is_pinned: impl Fn(usize) -> bool,
    more: Option<Box<dyn Term>>,
) -> Body {
    let membrane = Membrane { stretch_stiffness: 261.0, poisson_ratio: 0.3, bending };
    let fabric = Fabric { rayleigh: Some(rayleigh), ..Fabric::new(0.2, Material::Stvk(membrane)) };
    let surroundings = Surroundings { gravity: [0.0, 0.0, -9.81], drag: 0.5 };
    let springs = SpringNetwork::of_mesh(&cloth_core::physics::mesh::Topology::of(mesh));
    let mut garment = terms(&fabric, mesh, &springs, &surroundings).unwrap();
    let (velocity, gusts) = ([8.0, 0.5, 2.0], Vec::new());
    let wind = Wind { velocity, gusts, density: 1.2, across: 1.2, along: 0.02, steering: None };
    garment.terms.push(wind.term(mesh.triangles()));
    garment.terms.extend(more);
    let pinned: Vec<bool> = (0..mesh.vertices().len()).map(is_pinned).collect();
    let system = System::new(garment.terms, &pinned).unwrap();
    Body { x: mesh.vertices().to_vec(), v: vec![[0.0; 3]; pinned.len()], masses: garment.masses, system }
}

fn plate() -> Bending {
    Bending::Plate(Rigidity::Flexural { rigidity: 2e-5, poisson_ratio: 0.3 })
}

const UNDAMPED: Rayleigh = Rayleigh { stretching: 0.0, bending: 0.0 };

/// Each kind of bending, the second and third with damping.
fn bendings() -> [(Bending, Rayleigh); 3] {
    let damped = Rayleigh { stretching: 0.01, bending: 0.02 };
    [(plate(), UNDAMPED), (Bending::Flat { stiffness: 1e-4 }, damped), (Bending::Bridson { stiffness: 1e-4 }, damped)]
}

/// A smooth field of numbers between −1 and 1.
fn wave(seed: f64) -> impl Fn(usize) -> Vector3<f64> {
    move |vertex| [1.0, 2.0, 3.0].map(|axis: f64| (seed + 1.7 * vertex as f64 * axis).sin())
}

fn assert_close(found: f64, expected: f64, scale: f64, what: &str) {
    assert!((found - expected).abs() <= 1e-12 * scale, "{what}: {found} for {expected}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// On the chosen rows, forces and blocks are those of the whole system, and energies change by the same.
    #[test]
    fn a_restricted_system_is_the_whole_one_on_its_rows(
        chosen in prop::collection::vec(prop::bool::weighted(0.3), 42),
        kind in 0..3_usize,
        seed in 0.0..6.0_f64,
        threads in 1..3_usize,
    ) {
        let mesh = sheet([6, 5], [0.6, 0.5]);
        let mut body = body(&mesh, bendings()[kind], |vertex| vertex % 9 == 4, None);
        body.system.set_threads(threads);
        let field = wave(seed);
        let displaced = |factor: f64| -> Vec<Vector3<f64>> {
            let along = |x: &Vector3<f64>, by: Vector3<f64>| std::array::from_fn(|axis| x[axis] + factor * by[axis]);
            mesh.vertices().iter().enumerate().map(|(vertex, x)| along(x, field(vertex))).collect()
        };
        let x = displaced(0.01);
        let v: Vec<Vector3<f64>> = (0..x.len()).map(wave(seed + 1.0)).collect();
        let state = State { x: &x, v: &v };
        body.system.begin_step(StepStart { time: 0.0, dt: DT, state }).unwrap();

        let free = body.system.dofs().clone();
        let mut moved = x.clone();
        let farther = displaced(0.015);
        let mut faster = v.clone();
        for vertex in (0..x.len()).filter(|&vertex| chosen[vertex] && free.row(vertex).is_some()) {
            moved[vertex] = farther[vertex];
            faster[vertex] = [0.3, -0.2, 0.1];
        }
        let sums = |system: &mut System| {
            let energy = |system: &mut System, x: &[Vector3<f64>]| -> f64 {
                system.energies(x).unwrap().iter().filter_map(|term| term.energy).sum()
            };
            let lower = energy(system, &x);
            let change = energy(system, &moved) - lower;
            let slower = system.dissipation(state).unwrap();
            let dissipation = system.dissipation(State { x: &x, v: &faster }).unwrap() - slower;
            let matrices = [Curvature::Exact, Curvature::Clamped].map(|curvature| {
                let weights = Weights { position: -DT * DT, velocity: -DT };
                let options = LinearisationOptions::new(weights, curvature);
                let mut matrix = system.matrix();
                // The second time the constant part is known.
                system.linearise_with_masses(state, options, &body.masses, &mut matrix).unwrap();
                let force = system.linearise_with_masses(state, options, &body.masses, &mut matrix).unwrap().force;
                (force, matrix)
            });
            (change, dissipation, system.forces(state).unwrap(), matrices)
        };
        let whole = sums(&mut body.system);
        let mut restricted = body.system.restricted(&chosen).unwrap();
        let part = sums(&mut restricted);

        let rows: Vec<usize> = free.free().iter().copied().filter(|&vertex| chosen[vertex]).collect();
        prop_assert_eq!(restricted.dofs().free(), &rows[..]);
        assert_close(part.0, whole.0, whole.0.abs().max(1.0), "change of energy");
        assert_close(part.1, whole.1, whole.1.abs().max(1.0), "change of dissipation");
        for ((force, matrix), (all_forces, all_blocks)) in part.3.iter().zip(&whole.3) {
            for (row, &i) in rows.iter().enumerate() {
                for axis in 0..3 {
                    assert_close(part.2[i][axis], whole.2[i][axis], 1.0, "force");
                    assert_close(force[i][axis], all_forces[i][axis], 1.0, "force with Jacobians");
                }
                for (column, &j) in rows.iter().enumerate() {
                    let found = matrix.block(row, column);
                    let expected = all_blocks.block(free.row(i).unwrap(), free.row(j).unwrap());
                    for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
                        assert_close(*found, *expected, 1.0, "block");
                    }
                }
            }
        }
        let before: Vec<u64> = body.system.terms().map(|(_, counts)| counts.gradient.evaluated).collect();
        let asked: Vec<u64> = restricted.terms().map(|(_, counts)| counts.gradient.evaluated).collect();
        body.system.rejoin(restricted);
        let after: Vec<u64> = body.system.terms().map(|(_, counts)| counts.gradient.evaluated).collect();
        prop_assert_eq!(before.iter().zip(&asked).map(|(a, b)| a + b).collect::<Vec<_>>(), after);
    }
}

/// A term without elements that cannot be restricted.
#[derive(Debug)]
struct Unrestrictable;

impl TermDescription for Unrestrictable {
    fn name(&self) -> &str {
        "nothing"
    }

    fn declaration(&self) -> &Declaration {
        <Gravity as Element>::DECLARATION
    }

    fn character(&self) -> Character {
        Character { symmetric: true, velocity_dependent: false, quadratic: true, curved: false }
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils::new(1, &[])
    }
}

impl Term for Unrestrictable {
    fn place(self: Box<Self>, _: &DofMap, _: &Pattern) -> Box<dyn PlacedTerm> {
        self
    }
}

impl PlacedTerm for Unrestrictable {
    fn has_energy(&self) -> bool {
        true
    }

    fn energy(&self, _: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        Some((0.0, Tally::default()))
    }

    fn add_force(&self, _: State<'_>, _: &mut [Vector3<f64>]) -> Tally {
        Tally::default()
    }

    fn add_linearisation(&self, _: State<'_>, _: &mut Linearisation<'_>) -> Tally {
        Tally::default()
    }

    fn find_non_finite(&self, _: Quantity, _: State<'_>) -> Option<usize> {
        None
    }
}

#[test]
fn a_step_with_elimination_equals_one_without() {
    let mesh = sheet([15, 10], [0.6, 0.4]);
    let sheet = |more| body(&mesh, (plate(), UNDAMPED), |vertex| mesh.vertices()[vertex][0] < -0.299, more);
    let (mut body, mut other) = (sheet(None), sheet(Some(Box::new(Unrestrictable))));
    // A corner folds over.
    for (x, v) in mesh.vertices().iter().zip(&mut body.v).filter(|(x, _)| x[0] + x[1] > 0.4) {
        *v = [-4.0, -4.0, 10.0 * (x[0] + x[1] - 0.4)];
    }
    let options = NewtonOptions { velocity_tolerance: 1e-6, ..NewtonOptions::default() };
    let mut total = StepReport::default();
    for step in 0..40 {
        (other.x, other.v) = (body.x.clone(), body.v.clone());
        let reports = [&mut body, &mut other].map(|body| {
            let state = State { x: &body.x, v: &body.v };
            body.system.begin_step(StepStart { time: DT * f64::from(step), dt: DT, state }).unwrap();
            Newton::with_options(options).step(body, DT).unwrap()
        });
        assert_eq!((reports[1].local_solves, reports[1].local_vertices), (0, 0));
        total += reports[0];
        let apart = body.x.iter().flatten().zip(other.x.iter().flatten()).map(|(a, b)| (a - b).abs());
        let apart = apart.fold(0.0, f64::max);
        assert!(apart < 10.0 * DT * options.velocity_tolerance, "step {step}: {apart:e} m");
    }
    assert!(total.local_solves > 20, "{total:?}");
}

/// A flag at a pole.
fn flag(contact: &str) -> Scene {
    let text = format!(
        "dt = 0.01\nduration = 1.0\nintegrator = \"newton\"\ncontact = \"{contact}\"\nadaptive = true\n\
         tolerances.velocity = 1e-3\n\
         [[garment]]\nname = \"flag\"\n\
         mesh.sheet = {{ cells = [15, 10], size = [0.6, 0.4], plane = \"vertical\" }}\n\
         fabric = {{ density = 0.128, material.stvk = {{ stretch_stiffness = 261.0, poisson_ratio = 0.243, \
         bending.plate.flexural = {{ rigidity = 4e-5, poisson_ratio = 0.2 }} }} }}\n\
         [[pins]]\nbox = {{ min = [-0.301, -0.1, -1.0], max = [-0.299, 0.1, 1.0] }}\n\
         [wind]\nvelocity = [8.0, 0.5, 0.0]\ngusts = [{{ amplitude = [0.0, 2.0, 0.0], period = 0.3 }}]\n\
         [[obstacles]]\nname = \"pole\"\n\
         capsule = {{ from = [-0.33, 0.0, -0.5], to = [-0.33, 0.0, 0.3], radius = 0.02 }}\n"
    );
    Scene::parse(&text, "test.toml".as_ref()).unwrap_or_else(|error| panic!("{error}"))
}

/// Returns the number of local solves.
fn run(simulation: &mut Simulation, steps: usize) -> u64 {
    let step = |step| simulation.step().unwrap_or_else(|error| panic!("step {step}: {error}")).local_solves;
    (0..steps).map(step).sum()
}

#[test]
fn cloth_is_eliminated_with_and_without_contact() {
    for contact in ["off", "obstacles", "on"] {
        let mut simulation = Simulation::new(&flag(contact)).unwrap();
        run(&mut simulation, 15);
        let totals = simulation.summary().unwrap().totals;
        assert!(totals.local_solves > 0, "{contact}: {totals:?}");
        // At most 15 % of the vertices, and their neighbours.
        assert!(totals.local_vertices <= totals.local_solves * 100, "{contact}: {totals:?}");
        let line = simulation.summary().unwrap().to_string();
        assert!(line.contains("vertices on average, not among them"), "{line}");
    }
}

#[test]
fn threads_and_resumed_runs_change_no_bit() {
    for contact in ["obstacles", "on"] {
        threads_and_resumed_runs_agree(contact);
    }
}

fn threads_and_resumed_runs_agree(contact: &str) {
    let scene = flag(contact);
    let new = |threads| Simulation::new(&scene).unwrap().with_threads(threads);
    let (mut one, mut two, mut resumed) = (new(1), new(2), new(1));
    assert!(run(&mut one, 14) > 0);
    resumed.restore(one.save()).unwrap();
    let last = run(&mut one, 10);
    assert!(last > 0);
    assert_eq!(run(&mut resumed, 10), last);
    run(&mut two, 24);
    assert!(one.positions() == two.positions(), "one thread and two");
    assert!(one.positions() == resumed.positions(), "resumed");
}
