//! Iterative solvers against a dense factorisation, and the reasons why they stop.

use std::sync::Arc;

use energy_dsl::Vector3;
use energy_solve::{
    BlockCholesky, BlockMatrix, CholeskyError, OverRelaxation, Pattern, Precision, SolveOptions, SolveReport,
    StopReason, Storage,
};
use nalgebra::{DMatrix, DVector};

const ROWS: usize = 12;

fn pattern(storage: Storage) -> Arc<Pattern> {
    let stencils: Vec<[u32; 3]> = (2..ROWS as u32).map(|row| [row - 2, row - 1, row]).collect();
    Arc::new(Pattern::from_stencils(storage, ROWS, stencils.iter().map(<[u32; 3]>::as_slice)))
}

/// A chain with second neighbours and pseudo-random entries; `skew` is added above the diagonal only.
fn matrix(diagonal: f64, skew: f64) -> BlockMatrix {
    let pattern = pattern(if skew == 0.0 { Storage::Upper } else { Storage::Whole });
    let mut matrix = BlockMatrix::zeros(Arc::clone(&pattern));
    let mut random = fastrand::Rng::with_seed(1);
    let mut number = || random.f64() - 0.5;
    for row in 0..ROWS {
        for column in (row..ROWS).filter(|&column| pattern.slot(row, column).is_some()) {
            for i in 0..3 {
                for j in if row == column { i } else { 0 }..3 {
                    let entry = number() + if (row, i) == (column, j) { diagonal } else { 0.0 };
                    let [(upper, _), (lower, turned)] =
                        [(row, column), (column, row)].map(|(row, column)| pattern.slot(row, column).unwrap());
                    matrix.values_mut()[upper][i][j] = entry + skew;
                    if !turned {
                        matrix.values_mut()[lower][j][i] = entry;
                    }
                }
            }
        }
    }
    matrix
}

fn dense(matrix: &BlockMatrix) -> DMatrix<f64> {
    DMatrix::from_fn(3 * ROWS, 3 * ROWS, |row, column| matrix.block(row / 3, column / 3)[row % 3][column % 3])
}

fn right_hand_side() -> Vec<Vector3<f64>> {
    (0..ROWS).map(|row| [1.0, row as f64, (row as f64).sin()]).collect()
}

type Solver = fn(&BlockMatrix, &[Vector3<f64>], &mut [Vector3<f64>], &SolveOptions) -> SolveReport;

fn over_relaxation(
    matrix: &BlockMatrix,
    b: &[Vector3<f64>],
    x: &mut [Vector3<f64>],
    options: &SolveOptions,
) -> SolveReport {
    let mut solver = OverRelaxation::<f64>::new(matrix.pattern());
    solver.scale(matrix).unwrap();
    solver.solve(b, x, options)
}

fn bicgstab(matrix: &BlockMatrix, b: &[Vector3<f64>], x: &mut [Vector3<f64>], options: &SolveOptions) -> SolveReport {
    x.fill([0.0; 3]);
    energy_solve::bicgstab(matrix, b, x, options).unwrap()
}

/// Solves from a start that over-relaxation must ignore.
fn solve(
    solver: Solver,
    matrix: &BlockMatrix,
    b: &[Vector3<f64>],
    options: &SolveOptions,
) -> (Vec<Vector3<f64>>, SolveReport) {
    let mut x = vec![[7.0; 3]; b.len()];
    let report = solver(matrix, b, &mut x, options);
    (x, report)
}

fn assert_solves(solver: Solver, matrix: &BlockMatrix) {
    let b = right_hand_side();
    let options = SolveOptions::new(1e-12);
    let (x, report) = solve(solver, matrix, &b, &options);
    assert!(report.converged(), "{report:?}");
    let expected = dense(matrix).lu().solve(&DVector::from_iterator(3 * ROWS, b.into_iter().flatten())).unwrap();
    for (got, expected) in x.iter().flatten().zip(expected.iter()) {
        assert!((got - expected).abs() < 1e-10, "{got} {expected}");
    }
}

#[test]
fn over_relaxation_agrees_with_a_dense_solve() {
    assert_solves(over_relaxation, &matrix(6.0, 0.0));
}

#[test]
fn bicgstab_agrees_with_a_dense_solve_on_an_unsymmetric_matrix() {
    assert_solves(bicgstab, &matrix(6.0, 0.3));
}

#[test]
fn tolerance_is_relative_to_the_right_hand_side() {
    let matrix = matrix(6.0, 0.0);
    let b = right_hand_side();
    let tiny: Vec<_> = b.iter().map(|row| row.map(|entry| entry * 2.0_f64.powi(-200))).collect();
    let options = SolveOptions::new(1e-6);
    for solver in [over_relaxation as Solver, bicgstab] {
        let ((x, whole), (y, scaled)) = (solve(solver, &matrix, &b, &options), solve(solver, &matrix, &tiny, &options));
        assert_eq!(whole.iterations, scaled.iterations);
        let expected: Vec<_> = x.iter().map(|row| row.map(|entry| entry * 2.0_f64.powi(-200))).collect();
        assert_eq!(expected, y);
    }
}

#[test]
fn indefinite_curvature_is_reported() {
    // Every diagonal block is positive definite, but a chain with links this strong is not.
    let mut linked = BlockMatrix::zeros(pattern(Storage::Upper));
    for row in 0..ROWS {
        *linked.diagonal_mut(row) = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for column in [row.wrapping_sub(1), row + 1] {
            if column < ROWS {
                let slot = linked.pattern().slot(row, column).unwrap().0;
                linked.values_mut()[slot][0][0] = -2.0;
            }
        }
    }
    let (x, report) = solve(over_relaxation, &linked, &right_hand_side(), &SolveOptions::default());
    assert_eq!(report.stopped, StopReason::IndefiniteCurvature);
    assert!(x.iter().flatten().all(|entry| entry.is_finite()));
}

#[test]
fn a_breakdown_of_the_recurrence_is_reported() {
    // With r = b, r · A r is 2 · 3 − 2 · 3 = 0 in the first iteration, although A is invertible.
    let pattern = Arc::new(Pattern::from_stencils(Storage::Whole, 2, [[0, 1].as_slice()]));
    let mut matrix = BlockMatrix::zeros(Arc::clone(&pattern));
    for axis in 0..3 {
        matrix.diagonal_mut(0)[axis][axis] = 1.0;
        matrix.diagonal_mut(1)[axis][axis] = 1.0;
        matrix.values_mut()[pattern.slot(0, 1).unwrap().0][axis][axis] = -2.0;
    }
    let (x, report) = solve(bicgstab, &matrix, &[[1.0; 3]; 2], &SolveOptions::default());
    assert_eq!((report.stopped, report.iterations), (StopReason::Breakdown, 0));
    assert_eq!(x, [[0.0; 3]; 2]);
}

#[test]
fn limits_zero_loads_and_broken_numbers_are_reported() {
    let matrix = matrix(6.0, 0.0);
    let few = SolveOptions::new(1e-14).with_iteration_limit(2);
    let mut broken = right_hand_side();
    broken[3][1] = f64::NAN;
    for solver in [over_relaxation as Solver, bicgstab] {
        let (_, limited) = solve(solver, &matrix, &right_hand_side(), &few);
        assert_eq!((limited.stopped, limited.iterations), (StopReason::IterationLimit, 2));
        let (x, idle) = solve(solver, &matrix, &[[0.0; 3]; ROWS], &few);
        assert!(idle.converged() && idle.iterations == 0 && x == vec![[0.0; 3]; ROWS]);
        assert_eq!(solve(solver, &matrix, &broken, &few).1.stopped, StopReason::NonFinite);
        let mut holed = matrix.clone();
        let (slot, _) = matrix.pattern().slot(3, 4).unwrap();
        holed.values_mut()[slot][0][1] = f64::NAN;
        assert_eq!(solve(solver, &holed, &right_hand_side(), &few).1.stopped, StopReason::NonFinite);
    }
}

#[test]
fn singular_diagonal_blocks_are_named() {
    let mut matrix = matrix(6.0, 0.0);
    *matrix.diagonal_mut(7) = [[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let solved = energy_solve::bicgstab(&matrix, &right_hand_side(), &mut [[0.0; 3]; ROWS], &SolveOptions::default());
    assert_eq!(solved.unwrap_err().row, 7);
}

#[test]
fn cholesky_of_a_strand_has_no_fill_in_and_is_exact() {
    let matrix = matrix(6.0, 0.0);
    assert!(!matrix.pattern().fills_in() && sheet(3).pattern().fills_in());
    let mut factor = BlockCholesky::new(matrix.pattern()).unwrap();
    // A panel stores its square, and merged panels a few zeros.
    assert!(factor.entries() < 3 * 9 * matrix.pattern().blocks(), "{} entries", factor.entries());
    factor.factor(&matrix).unwrap();
    let b = right_hand_side();
    let mut x = vec![[7.0; 3]; ROWS];
    assert!(factor.solve(&b, &mut x).converged());
    let mut product = vec![[0.0; 3]; ROWS];
    matrix.multiply(&x, &mut product);
    for (found, expected) in product.iter().flatten().zip(b.iter().flatten()) {
        assert!((found - expected).abs() < 1e-13 * 12.0, "{found} {expected}");
    }
}

#[test]
fn an_indefinite_strand_has_no_factor() {
    let mut broken = matrix(6.0, 0.0);
    let mut factor = BlockCholesky::new(broken.pattern()).unwrap();
    factor.factor(&broken).unwrap();
    broken.diagonal_mut(4)[1][1] = -6.0;
    assert_eq!(factor.factor(&broken), Err(CholeskyError::NotPositiveDefinite));
    // Positive definite diagonal blocks with links too strong for them.
    let mut linked = matrix(0.6, 0.0);
    for row in 0..ROWS {
        *linked.diagonal_mut(row) = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    }
    let (slot, _) = linked.pattern().slot(0, 1).unwrap();
    linked.values_mut()[slot] = [[-1.2, 0.0, 0.0], [0.0; 3], [0.0; 3]];
    let mut factor = BlockCholesky::new(linked.pattern()).unwrap();
    assert_eq!(factor.factor(&linked), Err(CholeskyError::NotPositiveDefinite));
}

/// A sheet of springs with `side` light vertices per side.
fn sheet(side: usize) -> BlockMatrix {
    let vertex = |i: usize, j: usize| (i * side + j) as u32;
    let mut links = Vec::new();
    for i in 0..side {
        for j in 0..side {
            let right = (j + 1 < side).then(|| [vertex(i, j), vertex(i, j + 1)]);
            let down = (i + 1 < side).then(|| [vertex(i, j), vertex(i + 1, j)]);
            let across = (i + 1 < side && j + 1 < side).then(|| [vertex(i, j), vertex(i + 1, j + 1)]);
            links.extend([right, down, across].into_iter().flatten());
        }
    }
    let pattern = Pattern::from_stencils(Storage::Upper, side * side, links.iter().map(<[u32; 2]>::as_slice));
    let mut matrix = BlockMatrix::zeros(Arc::new(pattern));
    for row in 0..side * side {
        *matrix.diagonal_mut(row) = [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]];
    }
    for [p, q] in links.iter().map(|link| link.map(|vertex| vertex as usize)) {
        let (slot, _) = matrix.pattern().slot(p, q).unwrap();
        for axis in 0..3 {
            let stiffness = [1.0, 0.7, 0.1][axis];
            matrix.diagonal_mut(p)[axis][axis] += stiffness;
            matrix.diagonal_mut(q)[axis][axis] += stiffness;
            matrix.values_mut()[slot][axis][axis] -= stiffness;
        }
    }
    matrix
}

/// Solves for a right-hand side with all wavelengths.
fn relaxed<T: Precision>(matrix: &BlockMatrix, scale: f64, tolerance: f64) -> (Vec<Vector3<f64>>, SolveReport) {
    let rows = matrix.pattern().rows();
    let mut solver = OverRelaxation::<T>::new(matrix.pattern());
    solver.scale(matrix).unwrap();
    let b: Vec<_> = (0..rows).map(|row| [row as f64, 1.0, 0.1 * row as f64].map(|phase| scale * phase.cos())).collect();
    let mut x = vec![[0.0; 3]; rows];
    let options = SolveOptions::new(tolerance);
    let report = solver.solve(&b, &mut x, &options);
    assert!(report.converged(), "{report:?}");
    (x, report)
}

#[test]
fn over_relaxation_saves_iterations_and_serves_in_single_precision() {
    let matrix = sheet(64);
    let (exact, double) = relaxed::<f64>(&matrix, 1.0, 1e-3);
    let (rounded, single) = relaxed::<f32>(&matrix, 1.0, 1e-3);
    assert!(double.iterations.abs_diff(single.iterations) <= 1, "{double:?} {single:?}");
    let b: Vec<_> = (0..64 * 64).map(|row| [row as f64, 1.0, 0.1 * row as f64].map(f64::cos)).collect();
    let options = SolveOptions::new(1e-3);
    // An iteration of BiCGSTAB takes two products with the matrix.
    let (_, unrelaxed) = solve(bicgstab, &matrix, &b, &options);
    let [few, many] = [double.iterations, 2 * unrelaxed.iterations];
    assert!(unrelaxed.converged() && 3 * few < many, "{few} iterations, {many} products of BiCGSTAB");
    let largest = exact.iter().flatten().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    for (exact, rounded) in exact.iter().flatten().zip(rounded.iter().flatten()) {
        assert!((exact - rounded).abs() < 1e-3 * largest, "{exact} {rounded}");
    }
}

#[test]
fn single_precision_suffices_in_any_unit() {
    let mut light = sheet(9);
    let (expected, _) = relaxed::<f32>(&light, 1.0, 1e-4);
    // A power of two changes no rounding.
    let unit = 2.0_f64.powi(-150);
    light.values_mut().as_flattened_mut().as_flattened_mut().iter_mut().for_each(|entry| *entry *= unit);
    let (found, report) = relaxed::<f32>(&light, unit.powi(2), 1e-4);
    for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
        assert!((found / unit - expected).abs() <= 1e-12 * expected.abs(), "{found} {expected}: {report:?}");
    }
}

#[test]
fn over_relaxation_says_why_it_stops() {
    let options = SolveOptions::new(1e-10).with_iteration_limit(2);
    let good = matrix(6.0, 0.0);
    let mut solver = OverRelaxation::<f64>::new(good.pattern());
    solver.scale(&good).unwrap();
    let mut x = vec![[0.0; 3]; ROWS];
    let mut solve = |b: &[Vector3<f64>]| solver.solve(b, &mut x, &options);
    assert_eq!(solve(&right_hand_side()).stopped, StopReason::IterationLimit);
    let idle = solve(&[[0.0; 3]; ROWS]);
    assert!(idle.converged() && idle.iterations == 0 && idle.final_residual == 0.0);
    let mut broken = right_hand_side();
    broken[3][1] = f64::NAN;
    assert_eq!(solve(&broken).stopped, StopReason::NonFinite);
    // An indefinite diagonal block; then links too strong for positive definite ones.
    let mut indefinite = matrix(6.0, 0.0);
    indefinite.diagonal_mut(4)[1][1] = -6.0;
    assert_eq!(OverRelaxation::<f64>::new(indefinite.pattern()).scale(&indefinite).unwrap_err().row, 4);
    let linked = matrix(0.6, 0.0);
    let mut positive = linked.clone();
    (0..ROWS).for_each(|row| *positive.diagonal_mut(row) = [[0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.2]]);
    let mut solver = OverRelaxation::<f64>::new(positive.pattern());
    solver.scale(&positive).unwrap();
    let options = SolveOptions::default();
    assert_eq!(solver.solve(&right_hand_side(), &mut x, &options).stopped, StopReason::IndefiniteCurvature);
}
