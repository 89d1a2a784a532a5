//! Sums of elements: gather, block-sparse assembly, iterative solvers.
//!
//! An [`ElementList`] holds elements of one type and the vertices each acts on. A [`System`] sums lists of different types
//! ([`Term`]s) over the vertices of one body, some of which may be pinned, and yields
//!
//! * the energy U(x) of every term that has one,
//! * the force f(x, v) on every vertex, in N,
//! * α ∂f/∂x + β ∂f/∂v over the free vertices as a [`BlockMatrix`] whose pattern is built once (its upper triangle, where all
//!   terms are symmetric), with the elements' Hessians as they are or made positive semi-definite ([`Curvature`]), and (∂f/∂x) v.
//!
//! Pinned vertices are removed from the matrix, not penalised; elements with pinned vertices only are never evaluated. What
//! was evaluated and what was skipped is counted ([`Counts`]). [`conjugate_gradients`] and [`bicgstab`] solve with the matrix, and
//! [`OverRelaxation`] to the few digits that Newton's method wants, in a fraction of the time; [`Multigrid`] where sheets are so fine or so stiff that the
//! iterations of both are many; [`BlockCholesky`] to all digits.
//!
//! Potentials are evaluated many elements at once, and by several threads ([`System::set_threads`], [`OverRelaxation::with_threads`], [`Multigrid::with_threads`]). Everything is
//! deterministic: sums run in the order of terms and elements, whatever the number of threads.
//!
//! ```
//! use energy_solve::{BlockJacobi, BlockMatrix, Pattern, SolveOptions, Storage, conjugate_gradients};
//!
//! // One vertex held by three springs of stiffness 2, 4 and 8 N/m along the axes, pulled with 1 N along each.
//! let mut matrix = BlockMatrix::zeros(Pattern::from_stencils(Storage::Upper, 1, []).into());
//! for (axis, stiffness) in [2.0, 4.0, 8.0].into_iter().enumerate() {
//!     matrix.diagonal_mut(0)[axis][axis] = stiffness;
//! }
//! let preconditioner = BlockJacobi::new(&matrix).unwrap();
//! let mut displacement = vec![[0.0; 3]];
//! let report =
//!     conjugate_gradients(&matrix, &preconditioner, &[[1.0; 3]], &mut displacement, &SolveOptions::default());
//! assert!(report.converged());
//! assert!((displacement[0][2] - 0.125).abs() < 1e-12);
//! ```

#![forbid(unsafe_code)]

mod active;
mod bicgstab;
mod block_cholesky;
mod block_jacobi;
mod conjugate_gradients;
mod constant;
mod counts;
mod curvature;
mod division;
mod dofs;
mod domains;
mod force_term;
mod gauss_newton;
mod incomplete_cholesky;
mod list;
mod loss;
mod matrix;
mod multigrid;
mod normal_matrix;
mod normal_solver;
mod over_relaxation;
mod pattern;
mod places;
mod potential_term;
mod precision;
mod preconditioner;
mod residual_term;
mod rounded_block;
mod scatter;
mod solve;
mod sparse_factor;
mod stencils;
mod system;
mod term;
mod threads;
mod triangle_places;
mod vector;

pub use bicgstab::bicgstab;
pub use block_cholesky::{BlockCholesky, CholeskyError};
pub use block_jacobi::BlockJacobi;
pub use conjugate_gradients::conjugate_gradients;
pub use counts::{Counts, Tally};
pub use curvature::{Curvature, change_dense};
pub use dofs::DofMap;
pub use force_term::ForceTerm;
pub use gauss_newton::{GaussNewton, GaussNewtonError, GaussNewtonOptions, IterationReport, Outcome, TermCost};
pub use incomplete_cholesky::IncompleteCholesky;
pub use list::{ElementList, ListError};
pub use loss::Loss;
pub use matrix::BlockMatrix;
pub use multigrid::Multigrid;
pub use normal_matrix::{CouplingError, Couplings, NormalMatrix, NormalPattern};
pub use normal_solver::{NormalSolution, NormalSolver, NormalSolverKind, SolverError};
pub use over_relaxation::OverRelaxation;
pub use pattern::{Pattern, Storage, index};
pub use potential_term::PotentialTerm;
pub use precision::{Blocks, Precision};
pub use preconditioner::{Preconditioner, SingularBlock};
pub use residual_term::{LeastSquaresTerm, NormalEquations, Placed, ResidualTerm, TermSum};
pub use solve::{SolveOptions, SolveReport, StopReason};
pub use stencils::Stencils;
pub use system::{EvaluationError, LinearisationOptions, LinearisedForces, System, SystemError, TermEnergy};
pub use term::{Character, Divisible, Linearisation, Quantity, Share, State, StepStart, Term, Weights};
pub use triangle_places::TrianglePlaces;
pub use vector::dot;
