//! Solvers for sparse matrices with a border.

use std::sync::Arc;

use crate::linear::band::{BandFactor, BandOrder};
use crate::linear::dense_factor::DenseFactor;
use crate::linear::kind_gradients::KindGradients;
use crate::linear::solve::{SingularPivot, SolveOptions, StopReason};
use crate::matrix::bordered::{BorderedMatrix, add_scaled, dot};
use crate::matrix::kinds::KindPattern;

/// The widest band for which [`KindSolver::Automatic`] factors: a wider one takes more time than conjugate gradients.
const WIDEST: usize = 64;

/// How a [`BorderedSolver`] treats the sparse part.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum KindSolver {
    /// A banded factorisation if the half bandwidth is at most 64, otherwise conjugate gradients with default options.
    #[default]
    Automatic,
    /// A banded factorisation, for chains.
    Band(BandOrder),
    /// Conjugate gradients with the inverse diagonal blocks as preconditioner.
    ConjugateGradients(SolveOptions),
}

/// A bordered system that has no solution of the wanted kind.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BorderedError {
    /// Once maximised unknowns are eliminated, some direction has negative curvature.
    #[error("the matrix is not positive definite")]
    Indefinite,
    /// A pivot is zero.
    #[error(transparent)]
    Singular(#[from] SingularPivot),
    /// The block of the maximised unknowns is not negative definite.
    #[error("the potential is not concave in the shared unknowns that are maximised")]
    NotConcave,
    /// Conjugate gradients cannot eliminate a multiplier.
    #[error("a multiplier of a constraint needs a banded factorisation: KindSolver::Band")]
    Multiplier,
    /// Conjugate gradients did not converge.
    #[error("conjugate gradients stopped after {iterations} iterations: {stopped}")]
    NotConverged {
        /// Number of iterations.
        iterations: usize,
        /// Why they stopped.
        stopped: StopReason,
    },
}

/// Solves [A B; Bᵀ C] x = b if the matrix is positive definite once maximised unknowns are eliminated.
///
/// With a banded factorisation of A, x follows from the Schur complement S = C − Bᵀ A⁻¹ B. Its negative eigenvalues and
/// those of A must together be as many as there are maximised unknowns (Haynsworth 1968). A alone may be indefinite:
/// then the solution is refined once.
///
/// A multiplier of a constraint is a maximised unknown whose part of C is zero. Then A need not be definite, nor does
/// its sum with the other terms: only where the constraint keeps its value.
///
/// Conjugate gradients first eliminate the maximised unknowns, and iterate on A − B C⁻¹ Bᵀ, bordered by the minimised
/// unknowns.
#[derive(Debug)]
pub struct BorderedSolver {
    inner: Inner,
}

#[derive(Debug)]
enum Inner {
    Band(Box<Band>),
    Gradients(KindGradients),
}

/// A banded factorisation of A and the factors of its Schur complement.
#[derive(Debug)]
struct Band {
    factor: BandFactor,
    /// The columns of A⁻¹ B.
    columns: Vec<f64>,
    schur: DenseFactor,
    is_indefinite: bool,
}

impl BorderedSolver {
    /// Analyses a pattern.
    #[must_use]
    pub fn new(pattern: &Arc<KindPattern>, solver: &KindSolver) -> Self {
        let band = |factor| Inner::Band(Box::new(Band::new(factor)));
        let inner = match solver {
            KindSolver::Band(order) => band(BandFactor::new(pattern, order)),
            KindSolver::ConjugateGradients(options) => Inner::Gradients(KindGradients::new(*options)),
            KindSolver::Automatic => match BandFactor::narrow(pattern, WIDEST) {
                Some(factor) => band(factor),
                None => Inner::Gradients(KindGradients::new(SolveOptions::default())),
            },
        };
        Self { inner }
    }

    /// Returns the half bandwidth; `None` for conjugate gradients.
    #[must_use]
    pub fn half_bandwidth(&self) -> Option<usize> {
        match &self.inner {
            Inner::Band(band) => Some(band.factor.half_bandwidth()),
            Inner::Gradients(_) => None,
        }
    }

    /// x ← K⁻¹ b for the bordered matrix K. Vectors have one number per row. Returns the number of iterations: 0 if K
    /// was factored.
    ///
    /// # Errors
    /// If K is not positive definite once maximised unknowns are eliminated, the potential is not concave in these, or
    /// conjugate gradients do not converge.
    ///
    /// # Panics
    /// If the matrix has another pattern or the vectors another length.
    pub fn solve(&mut self, matrix: &BorderedMatrix, b: &[f64], x: &mut [f64]) -> Result<usize, BorderedError> {
        match &mut self.inner {
            Inner::Band(band) => band.solve(matrix, b, x).map(|()| 0),
            Inner::Gradients(gradients) => gradients.solve(matrix, b, x),
        }
    }
}

impl Band {
    fn new(factor: BandFactor) -> Self {
        Self { factor, columns: Vec::new(), schur: DenseFactor::default(), is_indefinite: false }
    }

    fn solve(&mut self, matrix: &BorderedMatrix, b: &[f64], x: &mut [f64]) -> Result<(), BorderedError> {
        self.factor(matrix)?;
        x.copy_from_slice(b);
        self.substitute(matrix, x);
        if self.is_indefinite {
            let mut residual = vec![0.0; x.len()];
            matrix.multiply(x, &mut residual);
            residual.iter_mut().zip(b).for_each(|(residual, b)| *residual = b - *residual);
            self.substitute(matrix, &mut residual);
            add_scaled(x, 1.0, &residual);
        }
        Ok(())
    }

    fn factor(&mut self, matrix: &BorderedMatrix) -> Result<(), BorderedError> {
        concave(matrix)?;
        let maximised = matrix.maximised.iter().filter(|is| **is).count();
        let negative = self.factor.factor(&matrix.kinds)?;
        self.is_indefinite = negative > 0;
        let (n, shared) = (matrix.kinds.pattern().increments(), matrix.shared());
        matrix.border.clone_into(&mut self.columns);
        self.columns.chunks_exact_mut(n.max(1)).for_each(|column| self.factor.solve(column));
        let mut schur = matrix.corner.clone();
        for row in 0..shared {
            for column in 0..shared {
                schur[row * shared + column] -= dot(matrix.border(row), &self.columns[column * n..][..n]);
            }
        }
        self.schur = DenseFactor::new(schur, shared).map_err(|_| BorderedError::Indefinite)?;
        if negative + self.schur.negative() == maximised { Ok(()) } else { Err(BorderedError::Indefinite) }
    }

    /// x ← K⁻¹ x.
    fn substitute(&mut self, matrix: &BorderedMatrix, x: &mut [f64]) {
        let n = matrix.kinds.pattern().increments();
        let (own, shared) = x.split_at_mut(n);
        self.factor.solve(own);
        shared.iter_mut().enumerate().for_each(|(number, entry)| *entry -= dot(matrix.border(number), own));
        self.schur.solve(shared);
        shared.iter().zip(self.columns.chunks_exact(n.max(1))).for_each(|(s, column)| add_scaled(own, -s, column));
    }
}

/// Returns the factors of the block of C of the maximised unknowns that are not multipliers, and their number.
///
/// # Errors
/// If the block is not negative definite.
pub(crate) fn concave(matrix: &BorderedMatrix) -> Result<(DenseFactor, usize), BorderedError> {
    let maximised = (0..matrix.shared()).filter(|&shared| matrix.is_concave(shared)).count();
    let block = matrix.part_of_corner(true, true);
    let factor = DenseFactor::new(block, maximised).map_err(|_| BorderedError::NotConcave)?;
    if factor.negative() == maximised { Ok((factor, maximised)) } else { Err(BorderedError::NotConcave) }
}
