//! SIMD levels and kernels: what code that runs at any level is generic over.

use std::fmt::Debug;

use super::block_sum::BlockSum;
use super::lane::Lane;

/// A set of instructions that kernels are compiled for.
pub trait Level: Copy + Debug + 'static {
    /// Name of the level.
    const NAME: &'static str;
    /// Whether a · b + c is rounded once.
    const FUSED: bool;
    /// The widest register of doubles.
    type F64: Lane<f64>;
    /// The widest register of single-precision numbers.
    type F32: Lane<f32>;
    /// Running sum for sweeps over sparse matrices of doubles.
    type Sum64: BlockSum<f64>;
    /// Running sum for sweeps over sparse matrices of single-precision numbers.
    type Sum32: BlockSum<f32>;
}

/// The level that every processor of the target has.
#[derive(Clone, Copy, Debug)]
pub struct Baseline;

/// Code that can be compiled for any [`Level`].
pub trait Kernel {
    /// The result of the kernel.
    type Output;
    /// Runs the code. Mark implementations `#[inline(always)]`: only inlined code is compiled for the level.
    fn run<L: Level>(self) -> Self::Output;
}
