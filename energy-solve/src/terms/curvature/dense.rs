use energy_dsl::{Block, triangle_index};
use nalgebra::DMatrix;

use super::Curvature;
use crate::matrix::vector::transposed;

/// Changes the eigenvalues of the symmetric matrix whose triangle of blocks is given: the way of elements with more coordinates
/// than lanes are used for, and the measure of all others. Returns whether there was a change; a matrix that is not finite
/// stays as it is.
pub fn change_dense(triangle: &mut [Block<f64>], points: usize, curvature: Curvature) -> bool {
    if !triangle.iter().flatten().flatten().all(|entry| entry.is_finite()) {
        return false;
    }
    let dense = DMatrix::from_fn(3 * points, 3 * points, |row, column| {
        let (i, j) = (row / 3, column / 3);
        let block = if i <= j {
            triangle[triangle_index(points, i, j)]
        } else {
            transposed(&triangle[triangle_index(points, j, i)])
        };
        block[row % 3][column % 3]
    });
    let mut eigen = dense.symmetric_eigen();
    if eigen.eigenvalues.iter().all(|&value| curvature.change(value) == 0.0) {
        return false;
    }
    eigen.eigenvalues.iter_mut().for_each(|value| *value += curvature.change(*value));
    let changed = eigen.recompose();
    for i in 0..points {
        for j in i..points {
            let block = &mut triangle[triangle_index(points, i, j)];
            for row in 0..3 {
                for column in 0..3 {
                    // The mean of both halves, so that diagonal blocks stay exactly symmetric.
                    let (r, c) = (3 * i + row, 3 * j + column);
                    block[row][column] = 0.5 * (changed[(r, c)] + changed[(c, r)]);
                }
            }
        }
    }
    true
}
