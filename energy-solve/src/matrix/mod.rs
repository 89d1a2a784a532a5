//! Sparse matrices of 3×3 blocks over the free vertices of a mesh, and of blocks of other sizes over other unknowns.

pub(crate) mod block_matrix;
pub(crate) mod bordered;
pub(crate) mod cross_blocks;
pub(crate) mod dof_map;
mod export;
pub(crate) mod kinds;
pub(crate) mod pattern;
pub(crate) mod precision;
pub(crate) mod vector;

pub use block_matrix::BlockMatrix;
pub use bordered::BorderedMatrix;
pub use cross_blocks::CrossBlocks;
pub use dof_map::DofMap;
pub use export::{Bsr, Csr};
pub use kinds::{KindMatrix, KindPattern};
pub use pattern::{Pattern, Storage, index};
pub use precision::{Blocks, Precision};
pub use vector::dot;
