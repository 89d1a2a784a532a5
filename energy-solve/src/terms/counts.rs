use std::ops::AddAssign;

/// How often one routine ran.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Elements evaluated.
    pub evaluated: u64,
    /// Elements left out because all their vertices are pinned.
    pub skipped: u64,
    /// Elements evaluated at a point where the formula has no single derivative; see [`energy_dsl::Flag`].
    pub flagged: u64,
    /// Elements whose Hessian had negative eigenvalues that were changed; see [`crate::Curvature`]. For the others a test said that there
    /// are none.
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

/// What one term's routines did since the system was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// The value alone.
    pub value: Tally,
    /// Value and gradient, or the force.
    pub gradient: Tally,
    /// Everything up to the Hessian, or the force's Jacobians.
    pub hessian: Tally,
    /// Hessians that were not evaluated because they are constant and known.
    pub reused: u64,
}
