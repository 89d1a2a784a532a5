//! 3×3 matrices of nodes.

use crate::graph::{Graph, NodeId};

/// Three components.
pub(super) type Vector = [NodeId; 3];
/// Three rows.
pub(super) type Matrix = [Vector; 3];

/// Returns the rows of a matrix.
pub(super) fn rows(parts: &[NodeId]) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| parts[3 * i + j]))
}

/// The inverse of a symmetric matrix, as adj M/det M.
pub(super) struct Inverse {
    pub(super) adjugate: Matrix,
    pub(super) determinant: NodeId,
}

/// Returns M⁻¹ of a symmetric matrix.
pub(super) fn inverted(g: &mut Graph, matrix: &Matrix) -> Inverse {
    let adjugate = [1, 2, 0].map(|i| g.cross(&matrix[i], &matrix[(i + 1) % 3]));
    let determinant = g.dot(&matrix[0], &adjugate[0]);
    Inverse { adjugate, determinant }
}

/// Returns Mᵀ.
pub(super) fn transposed(m: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

/// Returns A B.
pub(super) fn product(g: &mut Graph, a: &Matrix, b: &Matrix) -> Matrix {
    let columns = transposed(b);
    std::array::from_fn(|i| std::array::from_fn(|j| g.dot(&a[i], &columns[j])))
}

/// Returns M v.
pub(super) fn times(g: &mut Graph, m: &Matrix, v: &Vector) -> Vector {
    std::array::from_fn(|i| g.dot(&m[i], v))
}

/// Returns tr M.
pub(super) fn trace(g: &mut Graph, m: &Matrix) -> NodeId {
    g.sum(vec![m[0][0], m[1][1], m[2][2]])
}

/// Returns (M + Mᵀ)/2.
pub(super) fn symmetric(g: &mut Graph, m: &Matrix) -> Matrix {
    let half = g.constant(0.5);
    let mut result = *m;
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let sum = g.add(m[i][j], m[j][i]);
        result[i][j] = g.mul(half, sum);
        result[j][i] = result[i][j];
    }
    result
}
