//! Results are bit-identical for any number of threads.

use energy_dsl::{Block, Vector3};
use energy_elements::{Gravity, NeoHookean, QuadraticHinge, ViscousDrag};
use energy_solve::{
    BlockMatrix, Counts, Curvature, ElementList, ForceTerm, LinearisationOptions, OverRelaxation, PotentialTerm,
    Precision, SolveOptions, State, System, Term, Weights,
};

/// Cells per side: enough vertices for three threads.
const CELLS: usize = 140;

fn vertex(i: usize, j: usize) -> usize {
    j * (CELLS + 1) + i
}

/// A crumpled sheet with pinned vertices.
fn sheet() -> (System, Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let mut triangles = Vec::new();
    let mut hinges = Vec::new();
    for j in 0..CELLS {
        for i in 0..CELLS {
            let [a, b, c, d] = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
            hinges.push([b, d, a, c]);
        }
    }
    // Elements should not be in the order of the vertices.
    triangles.reverse();
    let u: Vec<[f64; 2]> =
        (0..=CELLS).flat_map(|j| (0..=CELLS).map(move |i| [i as f64, j as f64].map(|k| k / CELLS as f64))).collect();
    let fold = |x: f64| 2e-3 * (97.0 * x).sin();
    let x: Vec<Vector3<f64>> = u.iter().map(|&[u, v]| [u + fold(v), v - fold(u), fold(u + 2.0 * v)]).collect();
    let v = u.iter().map(|&[u, v]| [v, u * v, (31.0 * u).cos()]).collect();
    let membrane = triangles.iter().map(|t| NeoHookean::new(u[t[0]], u[t[1]], u[t[2]], 40.0, 50.0).unwrap()).collect();
    let bending = hinges.iter().map(|_| QuadraticHinge::new(1e-5, 0.1)).collect();
    let points: Vec<[usize; 1]> = (0..u.len()).map(|point| [point]).collect();
    let weights = points.iter().map(|_| Gravity::new(1e-3, [0.0, 0.0, -9.81])).collect();
    let drag = points.iter().map(|_| ViscousDrag::new(1e-3)).collect();
    let terms: Vec<Box<dyn Term>> = vec![
        Box::new(PotentialTerm::<NeoHookean>::new(ElementList::new("membrane", membrane, &triangles).unwrap())),
        Box::new(ForceTerm::<ViscousDrag>::new(ElementList::new("drag", drag, &points).unwrap())),
        Box::new(PotentialTerm::<QuadraticHinge>::new(ElementList::new("bending", bending, &hinges).unwrap())),
        Box::new(PotentialTerm::<Gravity>::new(ElementList::new("gravity", weights, &points).unwrap())),
    ];
    let pinned: Vec<bool> = (0..u.len()).map(|vertex| vertex % 11 == 0 || vertex < 200).collect();
    (System::new(terms, &pinned).unwrap(), x, v)
}

struct Sums {
    energies: Vec<Option<f64>>,
    forces: Vec<Vector3<f64>>,
    linear: Vec<Vector3<f64>>,
    product: Vec<Vector3<f64>>,
    blocks: Vec<Block<f64>>,
    counts: Vec<Counts>,
    matrix: BlockMatrix,
}

fn sums(threads: usize) -> Sums {
    let (mut system, x, v) = sheet();
    system.set_threads(threads);
    assert_eq!(system.threads(), threads);
    let state = State { x: &x, v: &v };
    let energies = system.energies(&x).unwrap().into_iter().map(|term| term.energy).collect();
    let forces = system.forces(state).unwrap();
    let mut matrix = system.matrix();
    let weights = Weights { position: -1e-4, velocity: -1e-2 };
    let options = LinearisationOptions::new(weights, Curvature::Clamped).with_stiffness_times_velocity(true);
    let product = system.linearise(state, options, &mut matrix).unwrap().stiffness_times_velocity;
    let options = options.with_stiffness_times_velocity(false);
    let linear = system.linearise(state, options, &mut matrix).unwrap().force;
    let counts = system.terms().map(|(_, counts)| counts).collect();
    Sums { energies, forces, linear, product, blocks: matrix.values().to_vec(), counts, matrix }
}

#[test]
fn sums_do_not_depend_on_the_number_of_threads() {
    let one = sums(1);
    for threads in [2, 3] {
        let several = sums(threads);
        assert_eq!(one.energies, several.energies, "{threads} threads");
        assert!(one.forces == several.forces && one.linear == several.linear, "{threads} threads");
        assert!(one.product == several.product, "{threads} threads");
        assert!(one.blocks == several.blocks, "{threads} threads");
        assert_eq!(one.counts, several.counts, "{threads} threads");
    }
    assert!(one.counts[0].hessian.projected > 100, "{:?}", one.counts[0]);
}

fn solution<T: Precision>(matrix: &BlockMatrix, threads: usize) -> (Vec<Vector3<f64>>, usize) {
    let mut matrix = matrix.clone();
    let rows = matrix.pattern().rows();
    (0..rows).for_each(|row| (0..3).for_each(|axis| matrix.diagonal_mut(row)[axis][axis] += 1e-3));
    let mut solver = OverRelaxation::<T>::with_threads(matrix.pattern(), threads);
    solver.scale(&matrix).unwrap();
    let b: Vec<Vector3<f64>> = (0..rows).map(|row| [row as f64, 1.0, 0.1 * row as f64].map(f64::cos)).collect();
    let mut x = vec![[0.0; 3]; rows];
    let options = SolveOptions::new(1e-3);
    let report = solver.solve(&b, &mut x, &options);
    assert!(report.converged(), "{report:?}");
    (x, report.iterations)
}

#[test]
fn solutions_do_not_depend_on_the_number_of_threads() {
    let matrix = sums(2).matrix;
    let one = solution::<f32>(&matrix, 1);
    for threads in [2, 5] {
        assert!(one == solution::<f32>(&matrix, threads), "{threads} threads");
    }
    let (exact, _) = solution::<f64>(&matrix, 2);
    let largest = exact.iter().flatten().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let apart = exact.iter().flatten().zip(one.0.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 0.01 * largest, "{apart} of {largest}");
}
