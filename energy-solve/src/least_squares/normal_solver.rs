use crate::least_squares::normal_matrix::NormalMatrix;
use crate::linear::conjugate_gradients::{Steps, conjugate_gradients};
use crate::linear::solve::{SolveOptions, SolveReport, StopReason};
use crate::linear::sparse_factor::{OutOfMemory, SparseFactor};
use crate::matrix::pattern::Pattern;

/// The solver of (JᵀJ + μ 1) d = −Jᵀr.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NormalSolverKind {
    /// Sparse Cholesky factorisation. The elimination order is computed once per pattern.
    Cholesky,
    /// Conjugate gradients, preconditioned by the diagonal blocks.
    ConjugateGradients {
        /// Tolerance of the residual's norm relative to that of the right-hand side, both in the norm of the
        /// preconditioner.
        relative_tolerance: f64,
        /// Stop after this many iterations.
        iteration_limit: usize,
    },
}

/// Normal equations that cannot be solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SolverError {
    /// A pivot is not positive.
    #[error("the damped JᵀJ is not positive definite; increase the damping")]
    NotPositiveDefinite,
    /// Conjugate gradients did not converge.
    #[error("conjugate gradients did not converge in {iterations} iterations; increase the limit, or use Cholesky")]
    NotConverged {
        /// Number of iterations done.
        iterations: usize,
    },
    /// The factor does not fit into memory.
    #[error("the factorisation of {unknowns} unknowns does not fit into memory")]
    OutOfMemory {
        /// Number of unknowns.
        unknowns: usize,
    },
}

/// A solver for matrices of one pattern.
#[derive(Debug)]
pub(super) enum NormalSolver {
    Cholesky(Box<SparseFactor>),
    ConjugateGradients(SolveOptions),
}

impl NormalSolver {
    /// Analyses a pattern whose blocks have `size` rows.
    ///
    /// # Errors
    /// If memory runs out.
    pub(super) fn new(kind: NormalSolverKind, size: usize, pattern: &Pattern) -> Result<Self, SolverError> {
        match kind {
            NormalSolverKind::Cholesky => match SparseFactor::new(size, pattern) {
                Ok(factor) => Ok(Self::Cholesky(factor.into())),
                Err(OutOfMemory) => Err(SolverError::OutOfMemory { unknowns: size * pattern.rows() }),
            },
            NormalSolverKind::ConjugateGradients { relative_tolerance, iteration_limit } => Ok(
                Self::ConjugateGradients(SolveOptions::new(relative_tolerance).with_iteration_limit(iteration_limit)),
            ),
        }
    }

    /// Solves (A + μ 1) x = b in place; `x` holds b first. Returns the number of iterations; 0 for a factorisation.
    ///
    /// # Errors
    /// If the matrix is not positive definite, or iterations do not converge.
    pub(super) fn solve<const D: usize>(
        &mut self,
        matrix: &NormalMatrix<D>,
        damping: f64,
        x: &mut [[f64; D]],
    ) -> Result<usize, SolverError> {
        match self {
            Self::Cholesky(factor) => {
                let entry = |block: usize, i: usize, j: usize| matrix.values[block][i][j];
                factor.factor(damping, entry).map_err(|_| SolverError::NotPositiveDefinite)?;
                factor.solve(x.as_flattened_mut());
                Ok(0)
            }
            Self::ConjugateGradients(options) => iterate(matrix, damping, x, options),
        }
    }
}

/// Solves (A + μ 1) x = b by conjugate gradients with the diagonal blocks as preconditioner; `x` holds b first.
fn iterate<const D: usize>(
    matrix: &NormalMatrix<D>,
    damping: f64,
    x: &mut [[f64; D]],
    options: &SolveOptions,
) -> Result<usize, SolverError> {
    let factors = (0..x.len()).map(|row| lower_factor(matrix.diagonal(row), damping));
    let factors = factors.collect::<Option<Vec<_>>>().ok_or(SolverError::NotPositiveDefinite)?;
    let residual = x.to_vec();
    let preconditioned: Vec<[f64; D]> = residual.iter().zip(&factors).map(|(r, l)| divided(l, r)).collect();
    let mut steps = NormalSteps {
        direction: vec![[0.0; D]; x.len()],
        product: vec![[0.0; D]; x.len()],
        matrix,
        damping,
        factors,
        residual,
        preconditioned,
        x,
    };
    let SolveReport { iterations, stopped, .. } = conjugate_gradients(&mut steps, options);
    match stopped {
        StopReason::Converged => Ok(iterations),
        StopReason::IterationLimit => Err(SolverError::NotConverged { iterations }),
        _ => Err(SolverError::NotPositiveDefinite),
    }
}

/// The steps of conjugate gradients for A + μ 1.
struct NormalSteps<'a, const D: usize> {
    matrix: &'a NormalMatrix<D>,
    damping: f64,
    /// Factors of the diagonal blocks; see [`lower_factor`].
    factors: Vec<[[f64; D]; D]>,
    residual: Vec<[f64; D]>,
    preconditioned: Vec<[f64; D]>,
    direction: Vec<[f64; D]>,
    product: Vec<[f64; D]>,
    x: &'a mut [[f64; D]],
}

impl<const D: usize> Steps for NormalSteps<'_, D> {
    fn start(&mut self) -> (f64, f64) {
        self.x.fill([0.0; D]);
        (1.0, dot(&self.residual, &self.preconditioned))
    }

    fn precondition(&mut self, square: f64) -> f64 {
        square
    }

    fn conjugate(&mut self, ratio: f64) -> f64 {
        for (direction, preconditioned) in self.direction.iter_mut().zip(&self.preconditioned) {
            for i in 0..D {
                direction[i] = ratio * direction[i] + preconditioned[i];
            }
        }
        self.matrix.multiply_damped(self.damping, &self.direction, &mut self.product);
        dot(&self.direction, &self.product)
    }

    fn advance(&mut self, step: f64) -> f64 {
        for row in 0..self.x.len() {
            for i in 0..D {
                self.x[row][i] += step * self.direction[row][i];
                self.residual[row][i] -= step * self.product[row][i];
            }
            self.preconditioned[row] = divided(&self.factors[row], &self.residual[row]);
        }
        dot(&self.residual, &self.preconditioned)
    }

    /// Nothing is left to do: x is in place.
    fn finish(&mut self, _: f64) {}
}

fn dot<const D: usize>(a: &[[f64; D]], b: &[[f64; D]]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
}

/// Returns L with A + μ 1 = L Lᵀ, with an inverted diagonal; `None` if the matrix is not positive definite.
fn lower_factor<const D: usize>(a: &[[f64; 8]; D], damping: f64) -> Option<[[f64; D]; D]> {
    let mut l = [[0.0; D]; D];
    for i in 0..D {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            let left = a[j][i] - known;
            if i == j {
                let pivot = left + damping;
                if pivot.is_nan() || pivot <= 0.0 {
                    return None;
                }
                l[i][i] = 1.0 / pivot.sqrt();
            } else {
                l[i][j] = left * l[j][j];
            }
        }
    }
    Some(l)
}

/// Returns (L Lᵀ)⁻¹ b; the diagonal of L is inverted.
fn divided<const D: usize>(l: &[[f64; D]; D], b: &[f64; D]) -> [f64; D] {
    let mut x = *b;
    for i in 0..D {
        let known: f64 = (0..i).map(|j| l[i][j] * x[j]).sum();
        x[i] = (x[i] - known) * l[i][i];
    }
    for i in (0..D).rev() {
        let known: f64 = (i + 1..D).map(|j| l[j][i] * x[j]).sum();
        x[i] = (x[i] - known) * l[i][i];
    }
    x
}
