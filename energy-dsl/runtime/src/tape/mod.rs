//! Routines as data: the block tape.
//!
//! Declarations that are read at run time are not compiled to machine code. The compiler writes their statements to a
//! [`Tape`] instead, in the order in which it would emit them. A tape runs over a block of [`TAPE_BLOCK`] elements:
//! each operation is applied to all of them, in SIMD lanes of the best level, before the next one starts. So the cost
//! of choosing an operation is shared by the block. Numbers live in slots, which are reused after their last use.
//!
//! Results have the bits of generated code at the same SIMD level. Elements that the ordinary path does not suit run
//! on the general path, one at a time, over numbers with an extended exponent.

mod encoded;
mod evaluate;
mod general;
mod instruction;
mod lanes;
mod operation;
mod packed;
mod routine;
mod runner;
mod scalar;
mod slots;
#[cfg(test)]
mod tests;

pub use encoded::EncodedPath;
pub use evaluate::{BlockResults, Expander, Output};
pub use general::GeneralPath;
pub use instruction::{Constant, Instruction, Tape};
pub use lanes::Slot;
pub use operation::{Operation, ROWS};
pub use packed::{Column, TapeElements};
pub use routine::{General, Input, Repetition, Routine, Routines, TermNumber};
pub use runner::{Places, stencil_blocks};
pub use scalar::Values;
pub use slots::Results;

/// Elements per block of a tape.
pub const TAPE_BLOCK: usize = 64;
