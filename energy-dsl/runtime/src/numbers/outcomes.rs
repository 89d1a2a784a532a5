//! Outcomes of comparisons along several rays.

use std::ops::{BitAnd, BitOr, Not};

use super::real::Mask;

/// The most rays of a bundle.
pub(super) const LANES: usize = 8;

/// The outcome of a comparison along each ray of a bundle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outcomes(u8);

impl Outcomes {
    pub(super) const NONE: Self = Self(0);

    /// Creates the mask of one ray.
    pub(super) fn only(ray: usize) -> Self {
        Self(1 << ray)
    }

    /// Creates the mask of the first rays.
    pub(super) fn first(rays: usize) -> Self {
        Self(((1_u32 << rays) - 1).to_le_bytes()[0])
    }

    pub(super) fn of(outcome: impl Fn(usize) -> bool) -> Self {
        Self((0..LANES).fold(0, |bits, ray| bits | u8::from(outcome(ray)) << ray))
    }
}

impl BitAnd for Outcomes {
    type Output = Self;
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl BitOr for Outcomes {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl Not for Outcomes {
    type Output = Self;
    fn not(self) -> Self {
        Self(!self.0)
    }
}

impl Mask for Outcomes {
    fn none() -> Self {
        Self::NONE
    }
    fn bits(self) -> u32 {
        self.0.into()
    }
    fn from_bits(bits: u32) -> Self {
        Self(bits.to_le_bytes()[0])
    }
}
