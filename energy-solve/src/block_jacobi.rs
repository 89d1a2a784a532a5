use energy_dsl::{Block, Vector3};
use nalgebra::Matrix3;

use crate::matrix::BlockMatrix;
use crate::preconditioner::{Preconditioner, SingularBlock};
use crate::vector::block_times;

/// The block-Jacobi preconditioner: the inverses of the diagonal blocks.
#[derive(Clone, Debug)]
pub struct BlockJacobi {
    inverses: Vec<Block<f64>>,
    positive_definite: bool,
}

impl BlockJacobi {
    /// Inverts the diagonal blocks of a matrix.
    ///
    /// # Errors
    /// When one of them is singular or not finite.
    pub fn new(matrix: &BlockMatrix) -> Result<Self, SingularBlock> {
        let blocks = || (0..matrix.pattern().rows()).map(|row| matrix.diagonal(row));
        let inverses = blocks().enumerate().map(|(row, block)| inverse(block).ok_or(SingularBlock { row }));
        let positive_definite = blocks().all(is_positive_definite);
        Ok(Self { inverses: inverses.collect::<Result<_, _>>()?, positive_definite })
    }
}

impl Preconditioner for BlockJacobi {
    /// Whether every diagonal block is.
    fn is_positive_definite(&self) -> bool {
        self.positive_definite
    }

    fn apply(&self, r: &[Vector3<f64>], z: &mut [Vector3<f64>]) {
        for ((zi, ri), inverse) in z.iter_mut().zip(r).zip(&self.inverses) {
            *zi = block_times(inverse, ri);
        }
    }
}

pub(crate) fn inverse(block: &Block<f64>) -> Option<Block<f64>> {
    // The determinant is cubic in the entries: bring them near 1 so that light or soft vertices do not underflow.
    let scale = block.iter().flatten().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
    let scaled = Matrix3::from_fn(|row, column| block[row][column] / scale);
    let inverse = scaled.try_inverse()?;
    let unscaled: Block<f64> = std::array::from_fn(|row| std::array::from_fn(|column| inverse[(row, column)] / scale));
    unscaled.iter().flatten().all(|entry| entry.is_finite()).then_some(unscaled)
}

/// Sylvester's criterion on the lower triangle, by elimination.
pub(crate) fn is_positive_definite(block: &Block<f64>) -> bool {
    let [[a, ..], [b, c, _], [d, e, f]] = *block;
    let (c, e, f) = (c - b * (b / a), e - b * (d / a), f - d * (d / a));
    a > 0.0 && c > 0.0 && f - e * (e / c) > 0.0
}
