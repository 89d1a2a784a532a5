//! Solvers of linear systems.

mod band;
mod bicgstab;
mod block_cholesky;
pub(crate) mod block_jacobi;
pub(crate) mod bordered;
pub(crate) mod conjugate_gradients;
mod dense_factor;
mod domains;
mod kind_gradients;
mod multigrid;
mod over_relaxation;
pub(crate) mod solve;
pub(crate) mod sparse_factor;

pub use band::{BandFactor, BandOrder};
pub use bicgstab::bicgstab;
pub use block_cholesky::{BlockCholesky, CholeskyError};
pub use bordered::{BorderedError, BorderedSolver, KindSolver};
pub use multigrid::Multigrid;
pub use over_relaxation::OverRelaxation;
pub use solve::{SingularBlock, SingularPivot, SolveOptions, SolveReport, StopReason};
