use energy_dsl::{Baseline, Block, triangle_index};

use super::square::{AnySquare, Square};
use super::{Curvature, add_to, fill_scaled, jacobi};

/// Projects the symmetric matrix with the given triangle of blocks: for elements whose coordinates are not independent
/// differences of points. Returns whether an eigenvalue was changed. A matrix with a non-finite entry is left
/// unchanged.
pub fn change_dense(triangle: &mut [Block<f64>], points: usize, curvature: Curvature) -> bool {
    if !triangle.iter().flatten().flatten().all(|entry| entry.is_finite()) {
        return false;
    }
    let n = 3 * points;
    let entry = |row: usize, column: usize| triangle[triangle_index(points, row / 3, column / 3)][row % 3][column % 3];
    let upper: Vec<f64> = (0..n).flat_map(|row| (row..n).map(move |column| entry(row, column))).collect();
    let mut a = AnySquare::zeros_of(n);
    let scale = fill_scaled(&mut a, &upper);
    let (difference, changed) = jacobi::difference::<Baseline, f64, _>(&mut a, curvature);
    if !changed {
        return false;
    }
    for (i, j) in (0..points).flat_map(|i| (i..points).map(move |j| (i, j))) {
        let block = &mut triangle[triangle_index(points, i, j)];
        for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
            block[row][column] += difference.at(3 * i + row, 3 * j + column) / scale;
        }
    }
    true
}

/// Projects the symmetric n×n matrix with this upper triangle, row by row. Returns whether an eigenvalue was changed. A
/// matrix with a non-finite entry is left unchanged.
pub(crate) fn change_upper(upper: &mut [f64], n: usize, curvature: Curvature) -> bool {
    if !upper.iter().all(|entry| entry.is_finite()) {
        return false;
    }
    let mut a = AnySquare::zeros_of(n);
    let scale = fill_scaled(&mut a, upper);
    let (difference, changed) = jacobi::difference::<Baseline, f64, _>(&mut a, curvature);
    if changed {
        add_to(upper, &difference, scale, true);
    }
    changed
}
