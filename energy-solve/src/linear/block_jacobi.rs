use energy_dsl::{Block, Number, Vector3};
use nalgebra::Matrix3;

use crate::linear::preconditioner::{Preconditioner, SingularBlock};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::precision::{Precision, doubled};
use crate::matrix::vector::block_times;

/// Block-Jacobi preconditioner: the inverses of the diagonal blocks.
#[derive(Clone, Debug)]
pub struct BlockJacobi {
    inverses: Vec<Block<f64>>,
    positive_definite: bool,
}

impl BlockJacobi {
    /// Inverts the diagonal blocks of a matrix.
    ///
    /// # Errors
    /// If a diagonal block is singular or not finite.
    pub fn new(matrix: &BlockMatrix<impl Precision>) -> Result<Self, SingularBlock> {
        let blocks = || (0..matrix.pattern().rows()).map(|row| doubled(matrix.diagonal(row)));
        let inverses = blocks().enumerate().map(|(row, block)| inverse(&block).ok_or(SingularBlock { row }));
        let positive_definite = blocks().all(|block| is_positive_definite(&block));
        Ok(Self { inverses: inverses.collect::<Result<_, _>>()?, positive_definite })
    }
}

impl Preconditioner for BlockJacobi {
    /// Whether every diagonal block is positive definite.
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
    // The determinant is cubic in the entries: scale them to about 1 so that light or soft vertices do not underflow.
    let scale = block.iter().flatten().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
    let scaled = Matrix3::from_fn(|row, column| block[row][column] / scale);
    let inverse = scaled.try_inverse()?;
    let unscaled: Block<f64> = std::array::from_fn(|row| std::array::from_fn(|column| inverse[(row, column)] / scale));
    unscaled.iter().flatten().all(|entry| entry.is_finite()).then_some(unscaled)
}

/// Applies Sylvester's criterion to the lower triangle, by elimination.
pub(crate) fn is_positive_definite(block: &Block<f64>) -> bool {
    let [[a, ..], [b, c, _], [d, e, f]] = *block;
    let (c, e, f) = (c - b * (b / a), e - b * (d / a), f - d * (d / a));
    a > 0.0 && c > 0.0 && f - e * (e / c) > 0.0
}

/// Inverts a positive definite block, given by its upper triangle; `None` if it is not positive definite.
#[inline(always)]
pub(crate) fn inverse_of_definite(block: &Block<f64>) -> Option<Block<f64>> {
    // The determinant is cubic in the entries: scale them to about 1 so that light or soft vertices do not underflow.
    let scale = block[0][0].max(block[1][1]).max(block[2][2]).power_of_two_scale();
    let [[a, b, c], [_, d, e], [_, _, f]] = *block;
    let [a, b, c, d, e, f] = [a * scale, b * scale, c * scale, d * scale, e * scale, f * scale];
    // Cofactors of the entries. Sylvester's criterion tests a, the cofactor ff and the determinant.
    let [aa, bb, cc] = [d * f - e * e, c * e - b * f, b * e - c * d];
    let [dd, ee, ff] = [a * f - c * c, b * c - a * e, a * d - b * b];
    let determinant = a * aa + b * bb + c * cc;
    let factor = scale / determinant;
    if !(a > 0.0 && ff > 0.0 && determinant > 0.0 && factor.is_finite()) {
        return None;
    }
    let [aa, bb, cc] = [aa * factor, bb * factor, cc * factor];
    let [dd, ee, ff] = [dd * factor, ee * factor, ff * factor];
    Some([[aa, bb, cc], [bb, dd, ee], [cc, ee, ff]])
}
