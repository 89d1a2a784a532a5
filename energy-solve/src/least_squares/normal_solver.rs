use crate::least_squares::normal_matrix::{NormalMatrix, NormalPattern};
use crate::linear::sparse_factor::SparseFactor;

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

/// Statistics of one solve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NormalSolution {
    /// Iterations of conjugate gradients; 0 for a factorisation.
    pub iterations: usize,
}

/// A solver for matrices of one pattern.
#[derive(Debug)]
pub struct NormalSolver<const D: usize> {
    kind: NormalSolverKind,
    factor: Option<Box<Factor>>,
}

impl<const D: usize> NormalSolver<D> {
    /// Analyses a pattern.
    ///
    /// # Errors
    /// If memory runs out.
    pub fn new(kind: NormalSolverKind, pattern: &NormalPattern) -> Result<Self, SolverError> {
        let factor = match kind {
            NormalSolverKind::Cholesky => Some(Box::new(Factor::new::<D>(pattern)?)),
            NormalSolverKind::ConjugateGradients { .. } => None,
        };
        Ok(Self { kind, factor })
    }

    /// Solves (A + μ 1) x = b in place; `x` holds b first.
    ///
    /// # Errors
    /// If the matrix is not positive definite, or iterations do not converge.
    pub fn solve(
        &mut self,
        matrix: &NormalMatrix<D>,
        damping: f64,
        x: &mut [[f64; D]],
    ) -> Result<NormalSolution, SolverError> {
        match (self.kind, &mut self.factor) {
            (NormalSolverKind::ConjugateGradients { relative_tolerance, iteration_limit }, _) => {
                conjugate_gradients(matrix, damping, x, relative_tolerance, iteration_limit)
            }
            (NormalSolverKind::Cholesky, Some(factor)) => {
                factor.solve(matrix, damping, x)?;
                Ok(NormalSolution::default())
            }
            (NormalSolverKind::Cholesky, None) => unreachable!("`new` created the factor"),
        }
    }
}

/// A sparse Cholesky factor of a block matrix.
#[derive(Debug)]
struct Factor(SparseFactor);

impl Factor {
    fn new<const D: usize>(pattern: &NormalPattern) -> Result<Self, SolverError> {
        let unknowns = pattern.blocks() * D;
        let (mut rows, mut columns) = (vec![0], Vec::new());
        for row in 0..pattern.blocks() {
            columns.extend(pattern.row(row).iter().map(|&column| column as usize));
            rows.push(columns.len());
        }
        SparseFactor::new(D, &rows, &columns).map(Self).map_err(|_| SolverError::OutOfMemory { unknowns })
    }

    fn solve<const D: usize>(
        &mut self,
        matrix: &NormalMatrix<D>,
        damping: f64,
        x: &mut [[f64; D]],
    ) -> Result<(), SolverError> {
        let entry = |block: usize, i: usize, j: usize| matrix.values[block][i][j];
        self.0.factor(damping, entry).map_err(|_| SolverError::NotPositiveDefinite)?;
        self.0.solve(x.as_flattened_mut());
        Ok(())
    }
}

/// Solves by preconditioned conjugate gradients, starting from zero; `b` receives the solution.
fn conjugate_gradients<const D: usize>(
    matrix: &NormalMatrix<D>,
    damping: f64,
    b: &mut [[f64; D]],
    relative_tolerance: f64,
    iteration_limit: usize,
) -> Result<NormalSolution, SolverError> {
    let factors: Vec<[[f64; D]; D]> = (0..b.len())
        .map(|row| lower_factor(matrix.diagonal(row), damping).ok_or(SolverError::NotPositiveDefinite))
        .collect::<Result<_, _>>()?;
    let mut x = vec![[0.0; D]; b.len()];
    let residual = b;
    let mut preconditioned: Vec<[f64; D]> = residual.iter().zip(&factors).map(|(r, l)| divided(l, r)).collect();
    let mut direction = preconditioned.clone();
    let mut product = x.clone();
    let mut square = dot(residual, &preconditioned);
    let goal = square * relative_tolerance * relative_tolerance;
    let mut iterations = 0;
    while square > goal {
        if iterations == iteration_limit {
            return Err(SolverError::NotConverged { iterations });
        }
        matrix.multiply_damped(damping, &direction, &mut product);
        let curvature = dot(&direction, &product);
        if curvature.is_nan() || curvature <= 0.0 {
            return Err(SolverError::NotPositiveDefinite);
        }
        let step = square / curvature;
        for row in 0..x.len() {
            for i in 0..D {
                x[row][i] += step * direction[row][i];
                residual[row][i] -= step * product[row][i];
            }
            preconditioned[row] = divided(&factors[row], &residual[row]);
        }
        let next = dot(residual, &preconditioned);
        let ratio = next / square;
        for (direction, preconditioned) in direction.iter_mut().zip(&preconditioned) {
            for i in 0..D {
                direction[i] = ratio * direction[i] + preconditioned[i];
            }
        }
        square = next;
        iterations += 1;
    }
    residual.copy_from_slice(&x);
    Ok(NormalSolution { iterations })
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
