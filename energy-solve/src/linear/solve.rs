use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::precision::Precision;
use crate::matrix::vector::dot;
use energy_dsl::Vector3;

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveOptions {
    /// Stop when the residual is this much smaller than the right-hand side, both measured as √(rᵀ D⁻¹ r) for conjugate
    /// gradients and as ‖D⁻¹ r‖ for BiCGSTAB. D, the preconditioner, holds masses and stiffnesses: the test means the
    /// same for a light and for a heavy cloth.
    pub relative_tolerance: f64,
    /// Give up after this many iterations.
    pub iteration_limit: usize,
}

impl Default for SolveOptions {
    /// 10⁻⁸ and 10 000 iterations.
    fn default() -> Self {
        Self { relative_tolerance: 1e-8, iteration_limit: 10_000 }
    }
}

/// Why a solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StopReason {
    /// The residual met the tolerance.
    Converged,
    /// It did not within the limit.
    IterationLimit,
    /// A direction p with pᵀAp ≤ 0 was met: the matrix is not positive definite. The iterate before it is returned.
    IndefiniteCurvature,
    /// The recurrences of BiCGSTAB broke down (a division by zero). The iterate before it is returned.
    Breakdown,
    /// An intermediate result is infinite or NaN. The iterate is of no use.
    NonFinite,
}

impl std::fmt::Display for StopReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged",
            Self::IterationLimit => "iteration limit reached",
            Self::IndefiniteCurvature => "indefinite curvature",
            Self::Breakdown => "breakdown of the recurrence",
            Self::NonFinite => "non-finite numbers",
        })
    }
}

/// What a solver did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveReport {
    /// Iterations done.
    pub iterations: usize,
    /// The residual's norm before the first iteration; see [`SolveOptions::relative_tolerance`] for the norm.
    pub initial_residual: f64,
    /// The residual's norm at the end, by the solver's recurrence.
    pub final_residual: f64,
    /// Why it stopped.
    pub stopped: StopReason,
}

impl SolveReport {
    /// Of a matrix that shows to be indefinite before it is multiplied by anything.
    #[must_use]
    pub fn indefinite() -> Self {
        let stopped = StopReason::IndefiniteCurvature;
        Self { iterations: 0, initial_residual: 0.0, final_residual: 0.0, stopped }
    }

    /// Whether the tolerance was met.
    #[must_use]
    pub fn converged(&self) -> bool {
        self.stopped == StopReason::Converged
    }
}

/// b − A x.
pub(crate) fn residual(
    matrix: &BlockMatrix<impl Precision>,
    b: &[Vector3<f64>],
    x: &[Vector3<f64>],
) -> Vec<Vector3<f64>> {
    let mut r = vec![[0.0; 3]; b.len()];
    matrix.multiply(x, &mut r);
    crate::matrix::vector::scale_and_add(&mut r, -1.0, b);
    r
}

pub(crate) fn norm(a: &[Vector3<f64>]) -> f64 {
    dot(a, a).sqrt()
}
