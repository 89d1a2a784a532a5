//! Solvers of linear systems.

mod bicgstab;
mod block_cholesky;
mod block_jacobi;
pub(crate) mod conjugate_gradients;
mod domains;
mod multigrid;
mod over_relaxation;
pub(crate) mod solve;
pub(crate) mod sparse_factor;

pub use bicgstab::bicgstab;
pub use block_cholesky::{BlockCholesky, CholeskyError};
pub use multigrid::Multigrid;
pub use over_relaxation::OverRelaxation;
pub use solve::{SingularBlock, SolveOptions, SolveReport, StopReason};
