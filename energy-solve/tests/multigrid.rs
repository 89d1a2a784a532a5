//! Multigrid and sparse Cholesky factorisation on stretched and crumpled sheets.

use std::sync::Arc;

use energy_dsl::Vector3;
use energy_solve::{
    BlockCholesky, BlockMatrix, CholeskyError, Multigrid, OverRelaxation, Pattern, Precision, SolveOptions,
    SolveReport, StopReason, Storage,
};
use nalgebra::{DMatrix, DVector};

/// A slightly crumpled sheet with `cells` cells per side, stiff springs along edges and diagonals, and soft ones across
/// two cells. Each spring adds k n nᵀ + 0.02 · 1; the total mass is 100.
fn sheet(cells: usize, stiffness: f64) -> BlockMatrix {
    let vertex = |i: usize, j: usize| (j * (cells + 1) + i) as u32;
    let rows = (cells + 1) * (cells + 1);
    let row = |v: u32| {
        let (i, j) = (v as usize % (cells + 1), v as usize / (cells + 1));
        let [x, y] = [i, j].map(|k| k as f64 / cells as f64);
        [x, y, 0.05 * (7.0 * x + 3.0 * y).sin() + 0.02 * (23.0 * y).cos()]
    };
    let mut links = Vec::new();
    for j in 0..=cells {
        for i in 0..=cells {
            let ends = [(i + 1, j), (i, j + 1), (i + 1, j + 1), (i + 2, j), (i, j + 2)];
            for (number, (k, l)) in ends.into_iter().enumerate().filter(|(_, (k, l))| *k <= cells && *l <= cells) {
                links.push(([vertex(i, j), vertex(k, l)], if number < 3 { stiffness } else { 0.0 }));
            }
        }
    }
    let pattern = Arc::new(Pattern::from_stencils(Storage::Upper, rows, links.iter().map(|(ends, _)| ends.as_slice())));
    let mut matrix = BlockMatrix::zeros(Arc::clone(&pattern));
    let mass = 100.0 / rows as f64;
    for row in 0..rows {
        for axis in 0..3 {
            matrix.diagonal_mut(row)[axis][axis] = mass;
        }
    }
    for ([a, b], k) in links {
        let (p, q) = (row(a), row(b));
        let d: Vector3<f64> = std::array::from_fn(|axis| q[axis] - p[axis]);
        let square: f64 = d.iter().map(|x| x * x).sum();
        let (slot, _) = pattern.slot(a as usize, b as usize).unwrap();
        for i in 0..3 {
            for j in 0..3 {
                let entry = k * d[i] * d[j] / square + if i == j { 0.02 } else { 0.0 };
                matrix.values_mut()[slot][i][j] -= entry;
                matrix.diagonal_mut(a as usize)[i][j] += entry;
                matrix.diagonal_mut(b as usize)[i][j] += entry;
            }
        }
    }
    matrix
}

/// A load along x at one edge, and downwards everywhere.
fn load(rows: usize) -> Vec<Vector3<f64>> {
    let side = (rows as f64).sqrt() as usize;
    (0..rows).map(|row| [if row % side == side - 1 { 1.0 } else { 0.0 }, 0.0, -0.1]).collect()
}

fn solved<T: Precision>(matrix: &BlockMatrix, tolerance: f64, threads: usize) -> (Vec<Vector3<f64>>, SolveReport) {
    let mut multigrid = Multigrid::<T>::with_threads(matrix.pattern(), threads);
    multigrid.take_over(matrix).unwrap();
    let b = load(matrix.pattern().rows());
    let mut x = vec![[0.0; 3]; b.len()];
    let options = SolveOptions::new(tolerance).with_iteration_limit(200);
    let report = multigrid.solve(&b, &mut x, &options);
    (x, report)
}

fn relative_residual(matrix: &BlockMatrix, b: &[Vector3<f64>], x: &[Vector3<f64>]) -> f64 {
    let mut product = vec![[0.0; 3]; b.len()];
    matrix.multiply(x, &mut product);
    let difference: f64 = product.iter().flatten().zip(b.iter().flatten()).map(|(p, b)| (p - b).powi(2)).sum();
    (difference / b.iter().flatten().map(|b| b * b).sum::<f64>()).sqrt()
}

#[test]
fn iterations_hardly_grow_with_the_mesh() {
    let iterations = |cells: usize| {
        let matrix = sheet(cells, 30.0);
        let (_, multigrid) = solved::<f32>(&matrix, 1e-3, 1);
        let mut relaxed = OverRelaxation::<f32>::new(matrix.pattern());
        relaxed.scale(&matrix).unwrap();
        let b = load(matrix.pattern().rows());
        let options = SolveOptions::new(1e-3);
        let relaxed = relaxed.solve(&b, &mut vec![[0.0; 3]; b.len()], &options);
        assert!(multigrid.converged() && relaxed.converged(), "{multigrid:?} {relaxed:?}");
        [multigrid.iterations, relaxed.iterations]
    };
    let (coarse, fine) = (iterations(32), iterations(64));
    assert!((fine[0] as f64) < 1.3 * coarse[0] as f64, "{coarse:?} {fine:?}");
    assert!(fine[1] as f64 > 1.5 * coarse[1] as f64 && fine[1] > 3 * fine[0], "{coarse:?} {fine:?}");
}

#[test]
fn multigrid_solves_to_full_precision() {
    let matrix = sheet(40, 30.0);
    let (x, report) = solved::<f64>(&matrix, 1e-12, 1);
    assert!(report.converged(), "{report:?}");
    let residual = relative_residual(&matrix, &load(x.len()), &x);
    assert!(residual < 1e-10, "{residual:e}");
}

#[test]
fn levels_and_complexity() {
    let multigrid = Multigrid::<f32>::new(sheet(64, 30.0).pattern());
    assert_eq!(multigrid.levels(), 3);
    assert!(multigrid.operator_complexity() > 1.0 && multigrid.operator_complexity() < 1.3);
}

#[test]
fn threads_do_not_change_a_bit() {
    // Enough rows for two domains.
    let matrix = sheet(135, 30.0);
    let (one, report) = solved::<f32>(&matrix, 1e-3, 1);
    assert!(report.converged() && relative_residual(&matrix, &load(one.len()), &one) < 0.1, "{report:?}");
    for threads in [2, 3] {
        let (several, other) = solved::<f32>(&matrix, 1e-3, threads);
        assert!(one == several && report == other, "{threads} threads: {report:?} {other:?}");
    }
}

/// An order of rows that separates coupled rows, so that nearly all couplings are between domains.
#[test]
fn multigrid_solves_for_any_order_of_rows() {
    let matrix = sheet(135, 30.0);
    let rows = matrix.pattern().rows();
    let moved = |row: usize| (row * 7919) % rows;
    let pairs: Vec<[u32; 2]> = (0..rows)
        .flat_map(|row| matrix.pattern().row(row).map(move |(_, column)| [moved(row) as u32, moved(column) as u32]))
        .collect();
    let pattern = Arc::new(Pattern::from_stencils(Storage::Upper, rows, pairs.iter().map(<[u32; 2]>::as_slice)));
    let mut shuffled = BlockMatrix::zeros(Arc::clone(&pattern));
    for row in 0..rows {
        for (slot, column) in matrix.pattern().row(row) {
            let (new_slot, turned) = pattern.slot(moved(row), moved(column)).unwrap();
            let block = matrix.values()[slot];
            shuffled.values_mut()[new_slot] =
                std::array::from_fn(|i| std::array::from_fn(|j| if turned { block[j][i] } else { block[i][j] }));
        }
    }
    let (x, report) = solved::<f64>(&shuffled, 1e-8, 2);
    assert!(relative_residual(&shuffled, &load(rows), &x) < 1e-5);
    let (_, ordered) = solved::<f64>(&matrix, 1e-8, 2);
    assert!(report.converged() && report.iterations < 3 * ordered.iterations, "{report:?} {ordered:?}");
}

/// Uncoupled rows, pairs of rows, and an empty matrix.
#[test]
fn small_and_disconnected_matrices() {
    for (rows, pairs) in [(0, vec![]), (1, vec![]), (40, vec![[3, 4], [8, 20], [20, 30]]), (2, vec![[0, 1]])] {
        let stencils = pairs.iter().map(<[u32; 2]>::as_slice);
        let pattern = Arc::new(Pattern::from_stencils(Storage::Upper, rows, stencils));
        let mut matrix = BlockMatrix::zeros(Arc::clone(&pattern));
        for row in 0..rows {
            *matrix.diagonal_mut(row) = [[2.0, 0.5, 0.0], [0.5, 3.0, 0.1], [0.0, 0.1, 4.0 + row as f64]];
        }
        for [a, b] in &pairs {
            let (slot, _) = pattern.slot(*a as usize, *b as usize).unwrap();
            matrix.values_mut()[slot] = [[-1.0, 0.2, 0.0], [0.0, -0.5, 0.0], [0.1, 0.0, -1.0]];
        }
        let (x, report) = solved::<f64>(&matrix, 1e-12, 2);
        assert!(report.converged() && report.iterations < 20, "{rows} rows: {report:?}");
        assert!(rows == 0 || relative_residual(&matrix, &load(rows), &x) < 1e-10, "{rows} rows");
    }
}

#[test]
fn units_do_not_matter() {
    let matrix = sheet(30, 30.0);
    let (x, report) = solved::<f32>(&matrix, 1e-3, 1);
    let mut tiny = matrix.clone();
    tiny.values_mut().iter_mut().flatten().flatten().for_each(|entry| *entry *= 2.0_f64.powi(-160));
    let (y, scaled) = solved::<f32>(&tiny, 1e-3, 1);
    assert_eq!(report.iterations, scaled.iterations);
    let expected: Vec<_> = x.iter().map(|row| row.map(|entry| entry * 2.0_f64.powi(160))).collect();
    assert_eq!(expected, y);
}

#[test]
fn indefinite_matrices_are_reported() {
    let mut matrix = sheet(30, 30.0);
    let solve = |matrix: &BlockMatrix| solved::<f32>(matrix, 1e-6, 1);
    // Negative masses: each diagonal block is positive definite, the matrix is not.
    for row in 0..matrix.pattern().rows() {
        for axis in 0..3 {
            matrix.diagonal_mut(row)[axis][axis] -= 0.11;
        }
    }
    let (x, report) = solve(&matrix);
    assert_eq!(report.stopped, StopReason::IndefiniteCurvature, "{report:?}");
    assert!(x.iter().flatten().all(|entry| entry.is_finite()));
    // An indefinite diagonal block.
    matrix.diagonal_mut(17)[1][1] = -1.0;
    assert_eq!(Multigrid::<f32>::new(matrix.pattern()).take_over(&matrix).unwrap_err().row, 17);
    // NaN in the load.
    let matrix = sheet(30, 30.0);
    let mut multigrid = Multigrid::<f32>::new(matrix.pattern());
    multigrid.take_over(&matrix).unwrap();
    let mut b = load(matrix.pattern().rows());
    b[5][1] = f64::NAN;
    let mut x = vec![[0.0; 3]; b.len()];
    assert_eq!(multigrid.solve(&b, &mut x, &SolveOptions::default()).stopped, StopReason::NonFinite);
    // A zero load.
    b.fill([0.0; 3]);
    let report = multigrid.solve(&b, &mut x, &SolveOptions::default());
    assert!(report.converged() && report.iterations == 0 && x == b);
}

#[test]
fn cholesky_agrees_with_a_dense_solve_and_with_multigrid() {
    let matrix = sheet(12, 30.0);
    let rows = matrix.pattern().rows();
    let dense = DMatrix::from_fn(3 * rows, 3 * rows, |i, j| matrix.block(i / 3, j / 3)[i % 3][j % 3]);
    let b = load(rows);
    let expected = dense.cholesky().unwrap().solve(&DVector::from_iterator(3 * rows, b.iter().flatten().copied()));
    let mut cholesky = BlockCholesky::new(matrix.pattern()).unwrap();
    let mut x = vec![[0.0; 3]; rows];
    // The second factorisation reuses the analysis of the pattern.
    for factor in [3.0, 1.0] {
        let mut scaled = matrix.clone();
        scaled.values_mut().iter_mut().flatten().flatten().for_each(|entry| *entry *= factor);
        cholesky.factor(&scaled).unwrap();
        assert!(cholesky.solve(&b, &mut x).converged());
        let size = expected.amax() / factor;
        for (got, expected) in x.iter().flatten().zip(expected.iter()) {
            assert!((got - expected / factor).abs() < 1e-12 * size, "{got} {expected}");
        }
    }
    let (by_cycles, _) = solved::<f64>(&matrix, 1e-13, 1);
    for (got, expected) in by_cycles.iter().flatten().zip(expected.iter()) {
        assert!((got - expected).abs() < 1e-9 * expected.abs().max(1.0), "{got} {expected}");
    }
}

#[test]
fn cholesky_reports_indefinite_matrices() {
    let mut matrix = sheet(12, 30.0);
    let mut cholesky = BlockCholesky::new(matrix.pattern()).unwrap();
    matrix.diagonal_mut(40)[1][1] -= 1e3;
    assert_eq!(cholesky.factor(&matrix), Err(CholeskyError::NotPositiveDefinite));
    let mut x = load(matrix.pattern().rows());
    x[3][0] = f64::NAN;
    cholesky.factor(&identity_like(&matrix)).unwrap();
    assert_eq!(cholesky.solve(&x.clone(), &mut x).stopped, StopReason::NonFinite);
}

/// Returns the identity with the pattern of a matrix.
fn identity_like(matrix: &BlockMatrix) -> BlockMatrix {
    let mut identity = BlockMatrix::zeros(Arc::clone(matrix.pattern()));
    for row in 0..matrix.pattern().rows() {
        (0..3).for_each(|axis| identity.diagonal_mut(row)[axis][axis] = 1.0);
    }
    identity
}
