//! Sparse matrices of 3×3 blocks: their pattern, their numbers, and the rows of free vertices.

pub(crate) mod block_matrix;
pub(crate) mod dof_map;
pub(crate) mod pattern;
pub(crate) mod precision;
pub(crate) mod vector;

pub use block_matrix::BlockMatrix;
pub use dof_map::DofMap;
pub use pattern::{Pattern, Storage, index};
pub use precision::{Blocks, Precision};
pub use vector::dot;
