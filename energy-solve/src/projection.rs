use energy_dsl::{Block, triangle_index};
use nalgebra::DMatrix;

use crate::vector::transposed;

/// The nearest positive semi-definite matrix (in the Frobenius norm) to the symmetric one whose triangle of blocks is given:
/// its negative eigenvalues become zero. Changes the triangle in place; one that is not finite is left as it is.
pub fn project_to_positive(triangle: &mut [Block<f64>], points: usize) {
    if !triangle.iter().flatten().flatten().all(|entry| entry.is_finite()) {
        return;
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
    if eigen.eigenvalues.iter().all(|&value| value >= 0.0) {
        return;
    }
    eigen.eigenvalues.iter_mut().for_each(|value| *value = value.max(0.0));
    let projected = eigen.recompose();
    for i in 0..points {
        for j in i..points {
            let block = &mut triangle[triangle_index(points, i, j)];
            for row in 0..3 {
                for column in 0..3 {
                    // The mean of both halves, so that diagonal blocks stay exactly symmetric.
                    let (r, c) = (3 * i + row, 3 * j + column);
                    block[row][column] = 0.5 * (projected[(r, c)] + projected[(c, r)]);
                }
            }
        }
    }
}
