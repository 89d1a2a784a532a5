//! Evaluation of many elements of one type: parameters and stencils are packed into lanes once, points are gathered,
//! results unpacked.
//!
//! A *batch* holds one element per lane. Surplus lanes of the last batch repeat the last element, so they add no flags;
//! their results are not written.

mod error;
mod forces;
mod mixed;
mod packed;
mod potentials;
mod residuals;
#[cfg(test)]
mod tests;

pub use error::{BatchError, Flagged};
pub use packed::{BLOCK, Packed, PackedForce, PackedMixed, PackedPotential, PackedResidual, Stored, WidePoints};
pub use potentials::{Batch, BatchWork, Batches, Hessians, for_each_batch, for_each_batch_in};
