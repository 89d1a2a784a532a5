use std::ops::AddAssign;

/// Evaluation counts of one routine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Elements evaluated.
    pub evaluated: u64,
    /// Elements skipped because all their vertices are pinned.
    pub skipped: u64,
    /// Elements evaluated where the formula has no unique derivative; see [`energy_dsl::Flag`].
    pub flagged: u64,
    /// Elements whose Hessian had negative eigenvalues that [`Curvature`](crate::Curvature) changed. The other Hessians
    /// passed a test of semi-definiteness.
    pub projected: u64,
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.evaluated += other.evaluated;
        self.skipped += other.skipped;
        self.flagged += other.flagged;
        self.projected += other.projected;
    }
}

/// Evaluation counts of one term since its system was created.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    /// Evaluations of the value alone.
    pub value: Tally,
    /// Evaluations of value and gradient, or of the force.
    pub gradient: Tally,
    /// Evaluations of value, gradient and Hessian, or of the force's Jacobians.
    pub hessian: Tally,
    /// Hessians that were not evaluated because they are constant and known.
    pub reused: u64,
}
