use energy_dsl::{Block, triangle_index};
use nalgebra::DMatrix;

use super::Curvature;
use crate::matrix::vector::transposed;

/// Projects the symmetric matrix with the given triangle of blocks: for elements whose coordinates are no
/// independent differences of points, and the reference for all other methods. Returns whether an eigenvalue was changed. A matrix
/// with a non-finite entry is left unchanged.
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
                    // The mean of both halves keeps diagonal blocks exactly symmetric.
                    let (r, c) = (3 * i + row, 3 * j + column);
                    block[row][column] = 0.5 * (changed[(r, c)] + changed[(c, r)]);
                }
            }
        }
    }
    true
}
