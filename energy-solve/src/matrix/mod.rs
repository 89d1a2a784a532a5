//! Sparse matrices of 3×3 blocks over the free vertices of a mesh.

pub(crate) mod block_matrix;
pub(crate) mod dof_map;
mod export;
pub(crate) mod pattern;
pub(crate) mod precision;
pub(crate) mod vector;

pub use block_matrix::BlockMatrix;
pub use dof_map::DofMap;
pub use export::{Bsr, Csr};
pub use pattern::{Pattern, Storage, index};
pub use precision::{Blocks, Precision};
pub use vector::dot;
