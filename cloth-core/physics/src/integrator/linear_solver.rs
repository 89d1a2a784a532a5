use std::sync::Arc;

use energy_dsl::Vector3;
use energy_solve::{
    BlockCholesky, BlockMatrix, CrossBlocks, Multigrid, OverRelaxation, Pattern, Precision, SolveOptions, SolveReport,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::StepError;
use super::trial::Trials;

/// The solver of the symmetric linear systems of implicit integrators.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LinearSolverChoice {
    /// For sheets, over-relaxation, or multigrid once over-relaxation needs too many iterations. For strands,
    /// Cholesky.
    #[default]
    Auto,
    /// Conjugate gradients with symmetric over-relaxation.
    OverRelaxation,
    /// Conjugate gradients with multigrid.
    Multigrid,
    /// Sparse Cholesky factorisation of every matrix.
    Cholesky,
}

impl LinearSolverChoice {
    /// All choices, `Auto` first.
    pub const ALL: [Self; 4] = [Self::Auto, Self::OverRelaxation, Self::Multigrid, Self::Cholesky];

    /// The name in scene files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::OverRelaxation => "over-relaxation",
            Self::Multigrid => "multigrid",
            Self::Cholesky => "cholesky",
        }
    }
}

/// Numbers of linear systems solved, by solver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct SolvedBy {
    /// Solves by [`OverRelaxation`].
    pub over_relaxation: u64,
    /// Solves by [`Multigrid`].
    pub multigrid: u64,
    /// Solves by [`BlockCholesky`].
    pub cholesky: u64,
    /// The largest number of multigrid levels, including the finest.
    pub levels: usize,
    /// The largest operator complexity: blocks of all levels over blocks of the finest.
    pub complexity: f64,
}

impl std::ops::AddAssign for SolvedBy {
    fn add_assign(&mut self, other: Self) {
        self.over_relaxation += other.over_relaxation;
        self.multigrid += other.multigrid;
        self.cholesky += other.cholesky;
        self.levels = self.levels.max(other.levels);
        self.complexity = self.complexity.max(other.complexity);
    }
}

/// Such as `multigrid 97 (4 levels, complexity 1.08), over-relaxation 3`.
impl std::fmt::Display for SolvedBy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let named =
            [("multigrid", self.multigrid), ("over-relaxation", self.over_relaxation), ("Cholesky", self.cholesky)];
        let mut separator = "";
        for (name, count) in named.into_iter().filter(|(_, count)| *count > 0) {
            write!(f, "{separator}{name} {count}")?;
            if name == "multigrid" {
                write!(f, " ({} levels, complexity {:.2})", self.levels, self.complexity)?;
            }
            separator = ", ";
        }
        Ok(())
    }
}

/// A linear solver for the symmetric systems of an integrator.
#[derive(Debug)]
pub(super) struct LinearSolver<T> {
    choice: LinearSolverChoice,
    threads: usize,
    /// Whether the prepared sum has contacts between rows that no element couples.
    in_contact: bool,
    /// The solver of the last matrix. Solvers of other kinds are set up again when needed, to save memory.
    solver: Option<Solver<T>>,
}

#[derive(Debug)]
enum Solver<T> {
    OverRelaxation(Box<OverRelaxation<T>>),
    Multigrid(Box<Multigrid<T>>),
    Cholesky(Box<BlockCholesky>),
}

impl<T: Precision> Solver<T> {
    /// Creates a solver for matrices of this pattern. `Auto` creates over-relaxation.
    fn set_up(choice: LinearSolverChoice, pattern: &Arc<Pattern>, threads: usize) -> Result<Self, StepError> {
        Ok(match choice {
            LinearSolverChoice::Multigrid => Self::Multigrid(Multigrid::with_threads(pattern, threads).into()),
            LinearSolverChoice::Cholesky => Self::Cholesky(BlockCholesky::new(pattern)?.into()),
            LinearSolverChoice::Auto | LinearSolverChoice::OverRelaxation => {
                Self::OverRelaxation(OverRelaxation::with_threads(pattern, threads).into())
            }
        })
    }

    fn choice(&self) -> LinearSolverChoice {
        match self {
            Self::OverRelaxation(_) => LinearSolverChoice::OverRelaxation,
            Self::Multigrid(_) => LinearSolverChoice::Multigrid,
            Self::Cholesky(_) => LinearSolverChoice::Cholesky,
        }
    }
}

/// Clones the settings only: the solver is set up again when needed.
impl<T: Precision> Clone for LinearSolver<T> {
    fn clone(&self) -> Self {
        Self { choice: self.choice, threads: self.threads, in_contact: false, solver: None }
    }
}

impl<T: Precision> LinearSolver<T> {
    /// Creates a solver for matrices with the pattern of this one, with at most `threads` threads.
    pub(super) fn new(choice: LinearSolverChoice, matrix: &BlockMatrix<impl Precision>, threads: usize) -> Self {
        // If elimination causes no fill-in, as on strands, a factorisation is cheap. Relaxation would propagate changes
        // by a few vertices per iteration only.
        let choice = match choice {
            LinearSolverChoice::Auto if !matrix.pattern().fills_in() => LinearSolverChoice::Cholesky,
            choice => choice,
        };
        Self { choice, threads, in_contact: false, solver: None }
    }

    /// Prepares the solver for the sum of a matrix and of the blocks of contacts that its pattern lacks. A factorisation
    /// takes no such blocks: it gives way to the solvers of sheets while there are some.
    pub(super) fn prepare(
        &mut self,
        matrix: &BlockMatrix<impl Precision>,
        cross: &CrossBlocks,
        trials: &mut Trials,
    ) -> Result<(), StepError> {
        let (pattern, threads) = (matrix.pattern(), self.threads);
        self.in_contact = !cross.is_empty();
        let wanted = match self.choice {
            LinearSolverChoice::Cholesky if !self.in_contact => LinearSolverChoice::Cholesky,
            LinearSolverChoice::Auto | LinearSolverChoice::Cholesky if trials.of(self.in_contact).multigrid() => {
                LinearSolverChoice::Multigrid
            }
            LinearSolverChoice::Auto | LinearSolverChoice::Cholesky => LinearSolverChoice::OverRelaxation,
            choice => choice,
        };
        // Drop an unwanted solver before setting up another: memory for both may be lacking.
        let known = self.solver.take().filter(|solver| solver.choice() == wanted);
        let solver = known.map_or_else(|| Solver::set_up(wanted, pattern, threads), Ok)?;
        match self.solver.insert(solver) {
            Solver::OverRelaxation(solver) => solver.scale_with(matrix, cross)?,
            Solver::Multigrid(solver) => solver.take_over_with(matrix, cross)?,
            Solver::Cholesky(solver) => solver.factor(matrix)?,
        }
        Ok(())
    }

    /// Solves A x = b from x = 0, where A is the prepared sum, and records the iterations in `trials`.
    pub(super) fn solve(
        &mut self,
        b: &[Vector3<f64>],
        x: &mut [Vector3<f64>],
        options: &SolveOptions,
        trials: &mut Trials,
    ) -> (SolveReport, SolvedBy) {
        let mut solved_by = SolvedBy::default();
        let report = match self.solver.as_mut().expect("a matrix was prepared") {
            Solver::OverRelaxation(solver) => {
                solved_by.over_relaxation = 1;
                solver.solve(b, x, options)
            }
            Solver::Multigrid(solver) => {
                let (levels, complexity) = (solver.levels(), solver.operator_complexity());
                solved_by = SolvedBy { multigrid: 1, levels, complexity, ..solved_by };
                solver.solve(b, x, options)
            }
            Solver::Cholesky(solver) => {
                solved_by.cholesky = 1;
                solver.solve(b, x)
            }
        };
        let is_chosen =
            self.choice == LinearSolverChoice::Auto || self.choice == LinearSolverChoice::Cholesky && self.in_contact;
        if is_chosen && report.converged() {
            trials.of(self.in_contact).record(report.iterations, options.relative_tolerance);
        }
        (report, solved_by)
    }
}
