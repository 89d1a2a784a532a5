use energy_dsl::Vector3;
use energy_solve::{
    BlockMatrix, IncompleteCholesky, OverRelaxation, Precision, SingularBlock, SolveOptions, SolveReport,
    conjugate_gradients,
};

/// What solves the symmetric systems of an integrator, chosen once for a pattern.
#[derive(Clone, Debug)]
pub(super) enum LinearSolver<T: Precision> {
    /// Sheets: nothing to factor, little to read.
    Relaxed(OverRelaxation<T>),
    /// Strands of hair, and whatever else is eliminated vertex by vertex without new couplings: there the incomplete factorisation is
    /// complete, and relaxation would carry news from one end to the other by a few vertices an iteration.
    Factored(Box<IncompleteCholesky>),
}

impl<T: Precision> LinearSolver<T> {
    /// For matrices of the pattern of this one, to be solved by at most so many threads.
    pub(super) fn new(matrix: &BlockMatrix<impl Precision>, threads: usize) -> Self {
        let pattern = matrix.pattern();
        if pattern.fills_in() {
            Self::Relaxed(OverRelaxation::with_threads(pattern, threads))
        } else {
            Self::Factored(Box::new(IncompleteCholesky::new(pattern)))
        }
    }

    /// Takes over a matrix.
    pub(super) fn prepare(&mut self, matrix: &BlockMatrix<impl Precision>) -> Result<(), SingularBlock> {
        match self {
            Self::Relaxed(relaxed) => relaxed.scale(matrix),
            Self::Factored(factor) => factor.factor(matrix),
        }
    }

    /// Solves A x = b from x = 0, A the matrix that was prepared.
    pub(super) fn solve(
        &mut self,
        matrix: &BlockMatrix<impl Precision>,
        b: &[Vector3<f64>],
        x: &mut [Vector3<f64>],
        options: &SolveOptions,
    ) -> SolveReport {
        match self {
            Self::Relaxed(relaxed) => relaxed.solve(b, x, options),
            Self::Factored(factor) => {
                x.fill([0.0; 3]);
                conjugate_gradients(matrix, &**factor, b, x, options)
            }
        }
    }
}
