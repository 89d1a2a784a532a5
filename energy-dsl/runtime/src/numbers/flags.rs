use super::real::{Mask, Number};

/// The reason why a result is a documented convention instead of the limit of a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Flag {
    /// A true singularity (coincident points, a triangle without area). The primitive's documented value was returned.
    Degenerate,
    /// One-sided derivatives differ. Those of one documented side were returned.
    Kink,
}

/// Flags of one evaluation: one mask per [`Flag`], with one entry per lane.
#[derive(Clone, Copy, Debug)]
pub struct Flags<T: Number> {
    /// Lanes with [`Flag::Degenerate`].
    pub degenerate: T::Mask,
    /// Lanes with [`Flag::Kink`].
    pub kink: T::Mask,
}

impl<T: Number> Flags<T> {
    /// Returns flags that are not set.
    #[must_use]
    pub fn clear() -> Self {
        Self { degenerate: T::Mask::none(), kink: T::Mask::none() }
    }

    /// Returns flags of which [`Flag::Degenerate`] is set in all lanes.
    #[must_use]
    pub fn degenerate() -> Self {
        Self { degenerate: !T::Mask::none(), kink: T::Mask::none() }
    }

    /// Returns the union of two sets of flags.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { degenerate: self.degenerate | other.degenerate, kink: self.kink | other.kink }
    }

    /// Returns whether any flag is set in any lane.
    #[must_use]
    pub fn any(self) -> bool {
        (self.degenerate | self.kink).any()
    }
}
