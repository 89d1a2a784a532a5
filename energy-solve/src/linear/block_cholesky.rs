use std::sync::Arc;

use energy_dsl::Vector3;

use crate::linear::solve::{SolveReport, StopReason};
use crate::linear::sparse_factor::{OutOfMemory, SparseFactor};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::pattern::Pattern;
use crate::matrix::precision::Precision;

/// Sparse Cholesky factorisation A = L Lᵀ, which solves to full precision.
///
/// Its time does not depend on the matrix entries. For a sheet it grows with the power 1.5 of the number of vertices
/// (George, SIAM J. Numer. Anal. 10, 1973).
///
/// Vertices are eliminated in an approximate minimum degree order (Amestoy, Davis and Duff, SIAM J. Matrix Anal. Appl.
/// 17, 1996). The order and the fill-in are computed once per pattern; [`BlockCholesky::factor`] reuses them for every
/// matrix.
///
/// ```
/// use energy_solve::{BlockCholesky, BlockMatrix, Pattern, Storage};
///
/// let pattern = Pattern::from_stencils(Storage::Upper, 2, [[0, 1].as_slice()]).into();
/// let mut matrix = BlockMatrix::zeros(std::sync::Arc::clone(&pattern));
/// for axis in 0..3 {
///     matrix.diagonal_mut(0)[axis][axis] = 2.0;
///     matrix.diagonal_mut(1)[axis][axis] = 2.0;
/// }
/// matrix.values_mut()[1][0][0] = -1.0; // couples the first components
/// let mut cholesky = BlockCholesky::new(&pattern)?;
/// cholesky.factor(&matrix)?;
/// let mut x = vec![[0.0; 3]; 2];
/// cholesky.solve(&[[3.0, 4.0, 0.0], [0.0; 3]], &mut x);
/// assert!((x[0][0] - 2.0).abs() < 1e-14 && (x[1][0] - 1.0).abs() < 1e-14 && (x[0][1] - 2.0).abs() < 1e-14);
/// # Ok::<(), energy_solve::CholeskyError>(())
/// ```
#[derive(Debug)]
pub struct BlockCholesky {
    pattern: Arc<Pattern>,
    factor: SparseFactor,
}

/// A factorisation that failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CholeskyError {
    /// A pivot is not positive.
    #[error("the matrix is not positive definite")]
    NotPositiveDefinite,
    /// The factor does not fit into memory.
    #[error("the factor of a matrix of {rows} vertices does not fit into memory")]
    OutOfMemory {
        /// Block rows of the matrix.
        rows: usize,
    },
}

impl BlockCholesky {
    /// Analyses a pattern.
    ///
    /// # Errors
    /// If memory runs out.
    ///
    /// # Panics
    /// If the pattern does not store an upper triangle.
    pub fn new(pattern: &Arc<Pattern>) -> Result<Self, CholeskyError> {
        let factor =
            SparseFactor::new(3, pattern).map_err(|OutOfMemory| CholeskyError::OutOfMemory { rows: pattern.rows() })?;
        Ok(Self { pattern: Arc::clone(pattern), factor })
    }

    /// Returns the number of entries of the factor.
    #[must_use]
    pub fn entries(&self) -> usize {
        self.factor.entries()
    }

    /// Factors a matrix of the pattern.
    ///
    /// # Errors
    /// If the matrix is not positive definite.
    ///
    /// # Panics
    /// If the matrix has another pattern.
    pub fn factor(&mut self, matrix: &BlockMatrix<impl Precision>) -> Result<(), CholeskyError> {
        assert!(Arc::ptr_eq(&self.pattern, matrix.pattern()), "the matrix has another pattern");
        let entry = |block: usize, i: usize, j: usize| matrix.values()[block][i][j].into();
        self.factor.factor(0.0, entry).map_err(|_| CholeskyError::NotPositiveDefinite)
    }

    /// Computes x ← A⁻¹ b for the last factored matrix A. The report tells if the solution is not finite.
    pub fn solve(&self, b: &[Vector3<f64>], x: &mut [Vector3<f64>]) -> SolveReport {
        x.copy_from_slice(b);
        self.factor.solve(x.as_flattened_mut());
        let finite = x.as_flattened().iter().all(|component| component.is_finite());
        let stopped = if finite { StopReason::Converged } else { StopReason::NonFinite };
        SolveReport { stopped, ..SolveReport::indefinite() }
    }
}
