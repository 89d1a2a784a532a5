use super::real::{Mask, Number};

/// Why a result is a documented convention and not the limit of a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Flag {
    /// A true singularity (coincident points, a zero-area triangle, …): the primitive's documented value was returned.
    Degenerate,
    /// One-sided derivatives differ here: those of one documented side were returned.
    Kink,
}

/// The conditions met while evaluating a routine, one mask per [`Flag`]. For lanes each lane has its own.
#[derive(Clone, Copy, Debug)]
pub struct Flags<T: Number> {
    /// Where [`Flag::Degenerate`] holds.
    pub degenerate: T::Mask,
    /// Where [`Flag::Kink`] holds.
    pub kink: T::Mask,
}

impl<T: Number> Flags<T> {
    /// No condition met.
    #[must_use]
    pub fn clear() -> Self {
        Self { degenerate: T::Mask::none(), kink: T::Mask::none() }
    }

    /// Both conditions, each where either of the two has it.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { degenerate: self.degenerate | other.degenerate, kink: self.kink | other.kink }
    }

    /// Whether any condition was met (in any lane).
    #[must_use]
    pub fn any(self) -> bool {
        (self.degenerate | self.kink).any()
    }
}
