//! Gauss–Newton for sums of squared residuals over blocks of unknowns.

mod gauss_newton;
mod loss;
mod normal_matrix;
mod normal_solver;
mod residual_term;

pub use gauss_newton::{GaussNewton, GaussNewtonError, GaussNewtonOptions, IterationReport, Outcome, TermCost};
pub use loss::Loss;
pub use normal_matrix::{CouplingError, Couplings, NormalMatrix};
pub use normal_solver::{NormalSolverKind, SolverError};
pub use residual_term::{LeastSquaresTerm, NormalEquations, Placed, ResidualTerm, TermSum};
