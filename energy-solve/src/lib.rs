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

mod least_squares;
mod linear;
mod matrix;
mod system;
mod terms;
mod threads;

pub use least_squares::{
    CouplingError, Couplings, GaussNewton, GaussNewtonError, GaussNewtonOptions, IterationReport, LeastSquaresTerm,
    Loss, NormalEquations, NormalMatrix, NormalPattern, NormalSolution, NormalSolver, NormalSolverKind, Outcome,
    Placed, ResidualTerm, SolverError, TermCost, TermSum,
};
pub use linear::{
    BlockCholesky, BlockJacobi, CholeskyError, IncompleteCholesky, Multigrid, OverRelaxation, Preconditioner,
    SingularBlock, SolveOptions, SolveReport, StopReason, bicgstab, conjugate_gradients,
};
pub use matrix::{BlockMatrix, Blocks, DofMap, Pattern, Precision, Storage, dot, index};
pub use system::{EvaluationError, LinearisationOptions, LinearisedForces, System, SystemError, TermEnergy};
pub use terms::{
    Character, Counts, Curvature, Divisible, ElementList, ForceTerm, Linearisation, ListError, PlacedTerm,
    PotentialTerm, Quantity, Share, State, Stencils, StepStart, Tally, Term, TermDescription, TrianglePlaces, Weights,
    change_dense,
};
