use std::sync::Arc;

use energy_dsl::Vector3;
use energy_solve::{
    BlockCholesky, BlockMatrix, IncompleteCholesky, Multigrid, OverRelaxation, Pattern, Precision, SolveOptions,
    SolveReport, conjugate_gradients,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::StepError;
use super::trial::Trial;

/// What solves the symmetric linear systems of implicit integrators.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LinearSolverChoice {
    /// Over-relaxation for sheets, or multigrid where that takes so many iterations that multigrid is faster; incomplete Cholesky for strands.
    #[default]
    Auto,
    /// Conjugate gradients with symmetric over-relaxation.
    OverRelaxation,
    /// Conjugate gradients with multigrid.
    Multigrid,
    /// A sparse factorisation of every matrix.
    Cholesky,
    /// Conjugate gradients with an incomplete factorisation.
    IncompleteCholesky,
}

impl LinearSolverChoice {
    /// All.
    pub const ALL: [Self; 5] =
        [Self::Auto, Self::OverRelaxation, Self::Multigrid, Self::Cholesky, Self::IncompleteCholesky];

    /// What it is called in scenes.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::OverRelaxation => "over-relaxation",
            Self::Multigrid => "multigrid",
            Self::Cholesky => "cholesky",
            Self::IncompleteCholesky => "incomplete-cholesky",
        }
    }
}

/// How many linear systems were solved by what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SolvedBy {
    /// [`OverRelaxation`].
    pub over_relaxation: u64,
    /// [`Multigrid`].
    pub multigrid: u64,
    /// [`BlockCholesky`].
    pub cholesky: u64,
    /// [`IncompleteCholesky`].
    pub incomplete_cholesky: u64,
    /// The most levels of multigrid, the finest among them.
    pub levels: usize,
    /// The blocks of all levels for one of the finest: the most.
    pub complexity: f64,
}

impl std::ops::AddAssign for SolvedBy {
    fn add_assign(&mut self, other: Self) {
        self.over_relaxation += other.over_relaxation;
        self.multigrid += other.multigrid;
        self.cholesky += other.cholesky;
        self.incomplete_cholesky += other.incomplete_cholesky;
        self.levels = self.levels.max(other.levels);
        self.complexity = self.complexity.max(other.complexity);
    }
}

/// Such as `multigrid 97 (4 levels, complexity 1.08), over-relaxation 3`.
impl std::fmt::Display for SolvedBy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let named = [
            ("multigrid", self.multigrid),
            ("over-relaxation", self.over_relaxation),
            ("Cholesky", self.cholesky),
            ("incomplete Cholesky", self.incomplete_cholesky),
        ];
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

/// What solves the symmetric systems of an integrator.
#[derive(Debug)]
pub(super) struct LinearSolver<T> {
    choice: LinearSolverChoice,
    threads: usize,
    /// What the matrix was prepared for; others are set up again when they are called for, rather than kept.
    solver: Option<Solver<T>>,
}

#[derive(Debug)]
enum Solver<T> {
    OverRelaxation(Box<OverRelaxation<T>>),
    Multigrid(Box<Multigrid<T>>),
    Cholesky(Box<BlockCholesky>),
    IncompleteCholesky(Box<IncompleteCholesky>),
}

impl<T: Precision> Solver<T> {
    /// For matrices of a pattern. What is chosen automatically is over-relaxation.
    fn set_up(choice: LinearSolverChoice, pattern: &Arc<Pattern>, threads: usize) -> Result<Self, StepError> {
        Ok(match choice {
            LinearSolverChoice::Multigrid => Self::Multigrid(Multigrid::with_threads(pattern, threads).into()),
            LinearSolverChoice::Cholesky => Self::Cholesky(BlockCholesky::new(pattern)?.into()),
            LinearSolverChoice::IncompleteCholesky => Self::IncompleteCholesky(IncompleteCholesky::new(pattern).into()),
            LinearSolverChoice::Auto | LinearSolverChoice::OverRelaxation => {
                Self::OverRelaxation(OverRelaxation::with_threads(pattern, threads).into())
            }
        })
    }

    /// What it is.
    fn choice(&self) -> LinearSolverChoice {
        match self {
            Self::OverRelaxation(_) => LinearSolverChoice::OverRelaxation,
            Self::Multigrid(_) => LinearSolverChoice::Multigrid,
            Self::Cholesky(_) => LinearSolverChoice::Cholesky,
            Self::IncompleteCholesky(_) => LinearSolverChoice::IncompleteCholesky,
        }
    }
}

/// Without what can be set up again.
impl<T: Precision> Clone for LinearSolver<T> {
    fn clone(&self) -> Self {
        Self { choice: self.choice, threads: self.threads, solver: None }
    }
}

impl<T: Precision> LinearSolver<T> {
    /// For matrices of the pattern of this one, to be solved by at most so many threads.
    pub(super) fn new(choice: LinearSolverChoice, matrix: &BlockMatrix<impl Precision>, threads: usize) -> Self {
        // Where elimination vertex by vertex makes no new couplings, the incomplete factorisation is complete, and relaxation would carry news from one
        // end to the other by a few vertices an iteration.
        let choice = match choice {
            LinearSolverChoice::Auto if !matrix.pattern().fills_in() => LinearSolverChoice::IncompleteCholesky,
            choice => choice,
        };
        Self { choice, threads, solver: None }
    }

    /// Takes over a matrix.
    pub(super) fn prepare(&mut self, matrix: &BlockMatrix<impl Precision>, trial: &Trial) -> Result<(), StepError> {
        let (pattern, threads) = (matrix.pattern(), self.threads);
        let wanted = match self.choice {
            LinearSolverChoice::Auto if trial.multigrid() => LinearSolverChoice::Multigrid,
            LinearSolverChoice::Auto => LinearSolverChoice::OverRelaxation,
            choice => choice,
        };
        // One that is not wanted any more goes before another is set up: there is not to be memory for both.
        let known = self.solver.take().filter(|solver| solver.choice() == wanted);
        let solver = known.map_or_else(|| Solver::set_up(wanted, pattern, threads), Ok)?;
        match self.solver.insert(solver) {
            Solver::OverRelaxation(solver) => solver.scale(matrix)?,
            Solver::Multigrid(solver) => solver.take_over(matrix)?,
            Solver::Cholesky(solver) => solver.factor(matrix)?,
            Solver::IncompleteCholesky(solver) => solver.factor(matrix)?,
        }
        Ok(())
    }

    /// Solves A x = b from x = 0, A the matrix that was prepared, and notes what it took.
    pub(super) fn solve(
        &mut self,
        matrix: &BlockMatrix<impl Precision>,
        b: &[Vector3<f64>],
        x: &mut [Vector3<f64>],
        options: &SolveOptions,
        trial: &mut Trial,
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
            Solver::IncompleteCholesky(solver) => {
                solved_by.incomplete_cholesky = 1;
                x.fill([0.0; 3]);
                conjugate_gradients(matrix, &**solver, b, x, options)
            }
        };
        if self.choice == LinearSolverChoice::Auto && report.converged() {
            trial.note(report.iterations, options.relative_tolerance);
        }
        (report, solved_by)
    }
}
