use energy_dsl::{Block, triangle_index};

use super::Curvature;

/// Upper limit of the number of sweeps. Convergence is quadratic.
const MOST_SWEEPS: usize = 30;

/// Projects the symmetric matrix with the given triangle of blocks: the fallback for elements with more coordinates
/// than lanes support, and the reference for all other methods. Returns whether an eigenvalue was changed. A matrix
/// with a non-finite entry is left unchanged.
pub fn change_dense(triangle: &mut [Block<f64>], points: usize, curvature: Curvature) -> bool {
    if !triangle.iter().flatten().flatten().all(|entry| entry.is_finite()) {
        return false;
    }
    let entry = |row: usize, column: usize| {
        let (row, column) = (row.min(column), row.max(column));
        triangle[triangle_index(points, row / 3, column / 3)][row % 3][column % 3]
    };
    let n = 3 * points;
    let mut dense: Vec<Vec<f64>> = (0..n).map(|row| (0..n).map(|column| entry(row, column)).collect()).collect();
    let vectors = diagonalise(&mut dense);
    let changes: Vec<f64> = (0..n).map(|k| curvature.change(dense[k][k])).collect();
    if changes.iter().all(|&change| change == 0.0) {
        return false;
    }
    for (i, j) in (0..points).flat_map(|i| (i..points).map(move |j| (i, j))) {
        let block = &mut triangle[triangle_index(points, i, j)];
        for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
            let products =
                vectors.iter().zip(&changes).map(|(v, change)| change * (v[3 * i + row] * v[3 * j + column]));
            block[row][column] += products.sum::<f64>();
        }
    }
    true
}

/// Diagonalises a symmetric matrix by cyclic Jacobi rotations (Golub and Van Loan, *Matrix Computations*, §8.5).
/// Returns its eigenvectors, in the order of the diagonal.
fn diagonalise(a: &mut [Vec<f64>]) -> Vec<Vec<f64>> {
    let n = a.len();
    let mut vectors: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    let largest = a.iter().flatten().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
    for _ in 0..MOST_SWEEPS {
        let pairs = || (0..n).flat_map(|p| (p + 1..n).map(move |q| (p, q)));
        let (negligible, mut is_diagonal) = (0.01 * f64::EPSILON * largest, true);
        for (p, q) in pairs() {
            if a[p][q].abs() <= negligible {
                continue;
            }
            is_diagonal = false;
            let cotangent = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let tangent = cotangent.signum() / (cotangent.abs() + cotangent.hypot(1.0));
            let cosine = 1.0 / tangent.hypot(1.0);
            let turned = |x: f64, y: f64| [cosine * (x - tangent * y), cosine * (tangent * x + y)];
            a.iter_mut().for_each(|row| [row[p], row[q]] = turned(row[p], row[q]));
            for rows in [&mut *a, &mut vectors[..]] {
                for k in 0..n {
                    [rows[p][k], rows[q][k]] = turned(rows[p][k], rows[q][k]);
                }
            }
        }
        if is_diagonal {
            break;
        }
    }
    vectors
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    #[test]
    fn a_matrix_with_more_coordinates_than_lanes_support_is_projected_as_by_a_dense_eigensolver() {
        const POINTS: usize = 6;
        let entry = |i: usize, j: usize| ((7 * i.min(j) + 3 * i.max(j)) % 11) as f64 - 4.0;
        let dense = DMatrix::from_fn(3 * POINTS, 3 * POINTS, entry);
        for curvature in [Curvature::Clamped, Curvature::Absolute] {
            let mut triangle = vec![[[0.0; 3]; 3]; POINTS * (POINTS + 1) / 2];
            for (i, j) in (0..POINTS).flat_map(|i| (i..POINTS).map(move |j| (i, j))) {
                triangle[triangle_index(POINTS, i, j)] =
                    std::array::from_fn(|row| std::array::from_fn(|column| entry(3 * i + row, 3 * j + column)));
            }
            let mut eigen = dense.clone().symmetric_eigen();
            eigen.eigenvalues.iter_mut().for_each(|value| *value += curvature.change(*value));
            let expected = eigen.recompose();
            assert!(change_dense(&mut triangle, POINTS, curvature));
            for (i, j) in (0..POINTS).flat_map(|i| (i..POINTS).map(move |j| (i, j))) {
                let block = triangle[triangle_index(POINTS, i, j)];
                for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
                    let expected = expected[(3 * i + row, 3 * j + column)];
                    assert!((block[row][column] - expected).abs() < 1e-12, "{} {expected}", block[row][column]);
                }
                assert!(i != j || (0..3).all(|row| (0..3).all(|column| block[row][column] == block[column][row])));
            }
        }
        // A definite matrix is left as it is.
        let mut definite = [[[2.0, 1.0, 0.0], [1.0, 2.0, 1.0], [0.0, 1.0, 2.0]]];
        assert!(!change_dense(&mut definite, 1, Curvature::Clamped));
    }
}
