/// A diagonal block without an inverse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the diagonal block of row {row} is singular or not finite; a free vertex needs mass or stiffness")]
#[non_exhaustive]
pub struct SingularBlock {
    /// Block row of the diagonal block.
    pub row: usize,
}

/// A factorisation without row exchanges met a pivot that is zero or not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the pivot of unknown {unknown} is zero or not finite; a free unknown needs mass or stiffness")]
#[non_exhaustive]
pub struct SingularPivot {
    /// Number of the unknown among the free ones.
    pub unknown: usize,
}

/// Stopping criteria of a linear solver.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SolveOptions {
    /// Stop once the residual is this much smaller than the right-hand side. Conjugate gradients measure both as √(rᵀ
    /// D⁻¹ r), BiCGSTAB as ‖D⁻¹ r‖. The preconditioner D contains masses and stiffnesses, so the test means the same
    /// for light and for heavy cloth.
    pub relative_tolerance: f64,
    /// Stop after this many iterations.
    pub iteration_limit: usize,
}

impl SolveOptions {
    /// Creates options with this relative tolerance.
    #[must_use]
    pub fn new(relative_tolerance: f64) -> Self {
        Self { relative_tolerance, ..Self::default() }
    }

    /// Sets the largest number of iterations.
    #[must_use]
    pub const fn with_iteration_limit(self, iteration_limit: usize) -> Self {
        Self { iteration_limit, ..self }
    }
}

impl Default for SolveOptions {
    /// Relative tolerance 10⁻⁸, at most 10 000 iterations.
    fn default() -> Self {
        Self { relative_tolerance: 1e-8, iteration_limit: 10_000 }
    }
}

/// The reason why a solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StopReason {
    /// The residual met the tolerance.
    Converged,
    /// The residual did not meet the tolerance within the iteration limit.
    IterationLimit,
    /// A direction p has pᵀAp ≤ 0, so the matrix is not positive definite. Returns the iterate before it.
    IndefiniteCurvature,
    /// The recurrences of BiCGSTAB broke down (division by zero). Returns the iterate before it.
    Breakdown,
    /// An intermediate result is infinite or NaN. The iterate is useless.
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

/// Statistics of one solve.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SolveReport {
    /// Number of iterations.
    pub iterations: usize,
    /// Norm of the residual before the first iteration; see [`SolveOptions::relative_tolerance`] for the norm.
    pub initial_residual: f64,
    /// Norm of the final residual, by the solver's recurrence.
    pub final_residual: f64,
    /// The reason why the solver stopped.
    pub stopped: StopReason,
}

impl SolveReport {
    /// Report for a matrix that proves to be indefinite before the first iteration.
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
