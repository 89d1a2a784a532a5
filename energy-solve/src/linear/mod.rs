//! Solvers of linear systems and their preconditioners.

mod bicgstab;
mod block_cholesky;
mod block_jacobi;
mod conjugate_gradients;
mod domains;
mod incomplete_cholesky;
mod multigrid;
mod over_relaxation;
mod preconditioner;
mod rounded_block;
mod solve;
pub(crate) mod sparse_factor;

pub use bicgstab::bicgstab;
pub use block_cholesky::{BlockCholesky, CholeskyError};
pub use block_jacobi::BlockJacobi;
pub use conjugate_gradients::conjugate_gradients;
pub use incomplete_cholesky::IncompleteCholesky;
pub use multigrid::Multigrid;
pub use over_relaxation::OverRelaxation;
pub use preconditioner::{Preconditioner, SingularBlock};
pub use solve::{SolveOptions, SolveReport, StopReason};
