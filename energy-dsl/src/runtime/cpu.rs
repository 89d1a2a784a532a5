//! What a processor can do, and how code is run at the best level it has.

use std::fmt::Debug;

/// A set of instructions that kernels are compiled for.
pub trait Level: Copy + Debug + 'static {
    /// Whether a product and a sum fuse into one rounding.
    const FUSED: bool;
}

/// What every processor of the target has.
#[derive(Clone, Copy, Debug)]
pub struct Baseline;

impl Level for Baseline {
    const FUSED: bool = cfg!(any(target_feature = "fma", target_arch = "aarch64"));
}

/// Work that can be compiled for any [`Level`].
pub trait Kernel {
    /// What it returns.
    type Output;
    /// Does it. Mark implementations `#[inline(always)]`: only what is inlined is compiled for the level.
    fn run<L: Level>(self) -> Self::Output;
}
