use energy_dsl::Vector3;
use energy_solve::{BlockMatrix, Curvature, LinearisationOptions, State, System, Term, Weights};

use cloth_physics::fabric::{PlateTerm, Rigidity};
use cloth_physics::mesh::{Diagonals, Plane, Sheet, TriangleMesh};

const YARNS: Rigidity = Rigidity::Orthotropic { warp: 9e-6, weft: 4e-6, bias: 5e-6, poisson_ratio: 0.1 };
const RUBBING: Rigidity = Rigidity::Flexural { rigidity: 2e-5, poisson_ratio: 0.0 };
const MOMENT: f64 = 2e-4;

/// A sheet of 10 × 10 cm whose inner vertices are shifted at random.
fn irregular(seed: u64) -> TriangleMesh {
    let (diagonals, plane) = (Diagonals::Regular, Plane::Horizontal);
    let mesh = Sheet { cells: [6; 2], size: [0.1; 2], diagonals, plane, pleats: None }.mesh().unwrap();
    let mut random = fastrand::Rng::with_seed(seed);
    let mut shift = |at: f64| if at.abs() < 0.049 { at + 4e-3 * (random.f64() - 0.5) } else { at };
    let vertices = mesh.vertices().iter().map(|&[x, y, z]| [shift(x), shift(y), z]).collect();
    TriangleMesh::new(vertices, mesh.triangles().to_vec()).unwrap()
}

/// Two plates in one term, and in two.
fn joined_and_apart(mesh: &TriangleMesh) -> [System; 2] {
    let warp = [0.8, 0.6, 0.0];
    let elastic = || PlateTerm::new("bending", mesh, &YARNS, warp).unwrap();
    let rubbing = PlateTerm::new("rubbing", mesh, &RUBBING, warp).unwrap().with_plastic_curvature(MOMENT);
    let joined: Vec<Box<dyn Term>> = vec![Box::new(elastic().with_friction(&RUBBING, MOMENT).unwrap())];
    let apart: Vec<Box<dyn Term>> = vec![Box::new(elastic()), Box::new(rubbing)];
    [joined, apart].map(|terms| System::new(terms, &vec![false; mesh.vertices().len()]).unwrap())
}

fn folded(mesh: &TriangleMesh, seed: u64) -> Vec<Vector3<f64>> {
    let mut random = fastrand::Rng::with_seed(seed);
    let lifted = |&[x, y, z]: &Vector3<f64>| [x, y, z + 40.0 * x * x - 60.0 * x * y].map(|c| c + 1e-3 * random.f64());
    mesh.vertices().iter().map(lifted).collect()
}

/// Returns energy, forces, and two products of the Hessian: those of the matrix and of the rates.
fn evaluated(system: &mut System, x: &[Vector3<f64>], curvature: Curvature) -> (f64, [Vec<Vector3<f64>>; 3]) {
    let v: Vec<Vector3<f64>> = x.iter().map(|&[x, y, z]| [y, z - x, 0.1 + x * y]).collect();
    let mut matrix: BlockMatrix<f64> = system.matrix();
    let options = LinearisationOptions::new(Weights { position: -1.0, velocity: 0.0 }, curvature);
    let options = options.with_stiffness_times_velocity(true);
    let found = system.linearise(State { x, v: &v }, options, &mut matrix).unwrap();
    let mut product = vec![[0.0; 3]; x.len()];
    matrix.multiply(&v, &mut product);
    let energy = system.energies(x).unwrap().iter().filter_map(|term| term.energy).sum();
    (energy, [found.force, found.stiffness_times_velocity, product])
}

#[test]
fn friction_joins_a_plate_without_changing_it() {
    let mesh = irregular(1);
    let mut systems = joined_and_apart(&mesh);
    for step in 0..4 {
        let x = folded(&mesh, step);
        for curvature in [Curvature::Exact, Curvature::Clamped] {
            let [joined, apart] = systems.each_mut().map(|system| evaluated(system, &x, curvature));
            assert!((joined.0 / apart.0 - 1.0).abs() < 1e-12, "{} for {}", joined.0, apart.0);
            for (joined, apart) in joined.1.iter().zip(&apart.1) {
                let largest = apart.as_flattened().iter().fold(0.0_f64, |largest, one| largest.max(one.abs()));
                assert!(largest > 0.0);
                for (a, b) in joined.as_flattened().iter().zip(apart.as_flattened()) {
                    assert!((a - b).abs() < 1e-11 * largest, "{a} for {b} at step {step}");
                }
            }
        }
        let still = vec![[0.0; 3]; x.len()];
        systems.iter_mut().for_each(|system| system.end_step(State { x: &x, v: &still }).unwrap());
        assert!(systems[0].histories()[0].iter().any(|plastic| plastic.abs() > 0.0));
    }
}
