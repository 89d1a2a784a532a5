use energy_dsl::{Block, Vector3};

use crate::linear::solve::SingularBlock;
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::precision::{Precision, doubled};
use crate::matrix::vector::block_times;

/// Block-Jacobi preconditioner: the inverses of the diagonal blocks.
pub(crate) struct BlockJacobi {
    inverses: Vec<Block<f64>>,
}

impl BlockJacobi {
    /// Inverts the diagonal blocks of a matrix.
    ///
    /// # Errors
    /// If a diagonal block is singular or not finite.
    pub(crate) fn new(matrix: &BlockMatrix<impl Precision>) -> Result<Self, SingularBlock> {
        let inverse = |row| inverse(&doubled(matrix.diagonal(row))).ok_or(SingularBlock { row });
        Ok(Self { inverses: (0..matrix.pattern().rows()).map(inverse).collect::<Result<_, _>>()? })
    }

    /// Computes z ← M⁻¹ r.
    pub(crate) fn apply(&self, r: &[Vector3<f64>], z: &mut [Vector3<f64>]) {
        for ((zi, ri), inverse) in z.iter_mut().zip(r).zip(&self.inverses) {
            *zi = block_times(inverse, ri);
        }
    }
}

pub(crate) fn inverse(block: &Block<f64>) -> Option<Block<f64>> {
    // The determinant is cubic in the entries: scale them to about 1 so that light or soft vertices do not underflow.
    let scale = block.iter().flatten().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
    let [[a, b, c], [d, e, f], [g, h, i]] = block.map(|row| row.map(|entry| entry / scale));
    // Cofactors of the first row, which also give the determinant.
    let [aa, bb, cc] = [e * i - h * f, d * i - g * f, d * h - g * e];
    let determinant = a * aa - b * bb + c * cc;
    let adjugate =
        [[aa, h * c - b * i, b * f - e * c], [-bb, a * i - g * c, d * c - a * f], [cc, g * b - a * h, a * e - d * b]];
    let inverse = adjugate.map(|row| row.map(|entry| entry / determinant / scale));
    inverse.iter().flatten().all(|entry| entry.is_finite()).then_some(inverse)
}

/// Whether the leading minors are positive (Sylvester's criterion).
pub(crate) fn is_positive_definite([[a, b, c], [d, e, f], [g, h, i]]: &Block<f64>) -> bool {
    let minor = a * e - b * d;
    let determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
    *a > 0.0 && minor > 0.0 && determinant > 0.0
}
