//! Sums of energies and forces over meshes, and solvers for the linear systems that they lead to.
//!
//! An [`ElementList`] holds elements of one type and the vertices each acts on. A [`System`] sums such lists
//! ([`Term`]s) over the vertices of one body, some of which may be pinned. It returns
//!
//! * the energy U(x) of each term that has one;
//! * the force f(x, v) on each vertex, in N;
//! * the matrix α ∂f/∂x + β ∂f/∂v over the free vertices, as a [`BlockMatrix`] with a fixed pattern, and the vector
//!   (∂f/∂x) v. If every term is symmetric, only the upper triangle is stored. [`Curvature`] selects exact or positive
//!   semi-definite element Hessians.
//!
//! Pinned vertices are removed from the matrix, not penalised, and elements whose vertices are all pinned are never
//! evaluated. [`Counts`] records what was evaluated and skipped.
//!
//! Linear solvers:
//!
//! * [`OverRelaxation`] is the fastest for the few digits that Newton's method needs.
//! * [`Multigrid`] replaces it for meshes so fine or stiff that it takes too many iterations.
//! * [`BlockCholesky`] solves to full precision.
//! * [`bicgstab`] solves systems that are not symmetric.
//!
//! Potentials are evaluated in SIMD lanes and by several threads ([`System::set_threads`],
//! [`OverRelaxation::with_threads`], [`Multigrid::with_threads`]). Everything is deterministic: sums run in the order
//! of terms and elements, for any number of threads.
//!
//! To use another library's solver, [`BlockMatrix::to_csr`], [`BlockMatrix::to_bsr`] and [`BlockMatrix::to_triplets`]
//! export the matrix; [`Csr`] shows the calls for nalgebra-sparse, sprs and faer.
//!
//! Contact is not a sum of fixed elements: see [`ContactModel`] and [`BlockMatrix::add_contacts`].
//!
//! # Unknowns that are not only points
//!
//! A [`MixedBody`] has scalars (twist angles), vectors of 2 and 3, rotations, and unknowns that all elements share (a
//! pressure). A [`MixedSystem`] sums [`MixedTerm`]s over it: potentials of mixed unknowns, with or without a state, and
//! those of points. It returns U, ∂U/∂u by increments, and ∂²U/∂u² as a [`BorderedMatrix`]. This has a [`KindMatrix`],
//! whose blocks have the sizes of their unknowns, and dense rows for shared ones. [`MixedNewton`] finds equilibria, and
//! [`MixedIntegrator`] takes time steps with masses and inertia tensors. [`BorderedSolver`] solves the linear systems,
//! by a [`BandFactor`] for chains such as rods, otherwise by conjugate gradients.
//!
//! # Least squares
//!
//! A [`GaussNewton`] solver minimises sums of squared residuals ([`ResidualTerm`]) over blocks of unknowns.
//!
//! ```
//! use energy_solve::{BlockMatrix, OverRelaxation, Pattern, SolveOptions, Storage};
//!
//! // One vertex held by springs of 2, 4 and 8 N/m along the axes, pulled with 1 N along each axis.
//! let mut matrix = BlockMatrix::zeros(Pattern::from_stencils(Storage::Upper, 1, []).into());
//! for (axis, stiffness) in [2.0, 4.0, 8.0].into_iter().enumerate() {
//!     matrix.diagonal_mut(0)[axis][axis] = stiffness;
//! }
//! let mut solver = OverRelaxation::<f64>::new(matrix.pattern());
//! solver.scale(&matrix).unwrap();
//! let mut displacement = vec![[0.0; 3]];
//! let report = solver.solve(&[[1.0; 3]], &mut displacement, &SolveOptions::default());
//! assert!(report.converged());
//! assert!((displacement[0][2] - 0.125).abs() < 1e-12);
//! ```

#![forbid(unsafe_code)]

mod contact;
mod least_squares;
mod linear;
mod matrix;
mod mixed;
mod system;
mod terms;
pub mod threads;

pub use contact::{
    Contact, ContactCounts, ContactForces, ContactMemory, ContactModel, ContactStep, ContactsInMatrix, Pressed,
    Presser, Resistance, SlidingStiffness, Touching,
};
pub use least_squares::{
    CouplingError, Couplings, GaussNewton, GaussNewtonError, GaussNewtonOptions, IterationReport, LeastSquaresTerm,
    Loss, NormalEquations, NormalMatrix, NormalSolverKind, Outcome, Placed, ResidualTerm, SolverError, TermCost,
    TermSum,
};
pub use linear::{
    BandFactor, BandOrder, BlockCholesky, BorderedError, BorderedSolver, CholeskyError, KindSolver, Multigrid,
    OverRelaxation, SingularBlock, SingularPivot, SolveOptions, SolveReport, StopReason, bicgstab,
};
pub use matrix::{
    BlockMatrix, Blocks, BorderedMatrix, Bsr, CrossBlocks, Csr, DofMap, KindMatrix, KindPattern, Pattern, Precision,
    Storage, dot, index,
};
pub use mixed::{
    ElementStates, Extremum, Inertia, MixedBody, MixedEnergy, MixedError, MixedIntegrator, MixedNewton,
    MixedNewtonError, MixedNewtonOptions, MixedNewtonReport, MixedScheme, MixedState, MixedStop, MixedSystem,
    MixedTerm, UnknownKind,
};
pub use system::{EvaluationError, LinearisationOptions, LinearisedForces, System, SystemError, TermEnergy};
pub use terms::{
    Character, Counts, Curvature, DissipationLaw, DissipationTerm, Divisible, DrivenLaw, DrivenTerm, ElementList,
    ForceTerm, Linearisation, ListError, Order, OwnLaw, OwnResults, OwnTerm, PlacedTerm, PotentialTerm, Quantity,
    Restriction, ScatterMaps, Share, State, StatefulLaw, SteeredTapeTerm, SteeredTapes, Stencils, StepStart, Tally,
    TapeTerm, Term, TermDescription, TriangleBuffer, Weights, change_dense,
};
