use energy_solve::ContactCounts;
use serde::{Deserialize, Serialize};

/// The work of contact, and how often it shortened moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct ContactWork {
    /// Searches for pairs that may collide.
    pub searches: u64,
    /// Searches that found nothing near anything.
    pub clear: u64,
    /// Certified moves.
    pub moves: u64,
    /// Moves that were shortened.
    pub shortened: u64,
    /// The sum of the parts of these moves that were left.
    pub left: f64,
    /// Candidate pairs that could come within reach near the iterate, summed over the moves.
    pub candidates: u64,
    /// Candidates that were too close to be dismissed by a comparison of distances, summed over the moves.
    pub tested: u64,
    /// Pairs in contact, summed over the linear systems.
    pub active: u64,
    /// Linear systems, with or without contacts.
    pub systems: u64,
}

impl ContactWork {
    /// Returns the work between two moments.
    pub(super) fn between(before: &ContactCounts, now: &ContactCounts) -> Self {
        Self {
            searches: now.searches - before.searches,
            clear: now.clear - before.clear,
            moves: now.moves - before.moves,
            shortened: now.shortened - before.shortened,
            left: now.left - before.left,
            candidates: now.candidates - before.candidates,
            tested: now.tested - before.tested,
            active: now.active - before.active,
            systems: now.systems - before.systems,
        }
    }
}

impl std::ops::AddAssign for ContactWork {
    fn add_assign(&mut self, other: Self) {
        self.searches += other.searches;
        self.clear += other.clear;
        self.moves += other.moves;
        self.shortened += other.shortened;
        self.left += other.left;
        self.candidates += other.candidates;
        self.tested += other.tested;
        self.active += other.active;
        self.systems += other.systems;
    }
}

/// Such as `12 pairs in contact per linear system; 40 moves, of which 3 were shortened to 0.61 on average; 95 pairs per
/// move, 20 of them tested; 10 searches, 4 of which found nothing near`.
impl std::fmt::Display for ContactWork {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let per = |sum: u64, count: u64| sum as f64 / count.max(1) as f64;
        write!(f, "{:.0} pairs in contact per linear system; {} moves", per(self.active, self.systems), self.moves)?;
        if self.shortened > 0 {
            let mean = self.left / self.shortened as f64;
            write!(f, ", of which {} were shortened to {mean:.2} on average", self.shortened)?;
        }
        let [candidates, tested] = [self.candidates, self.tested].map(|sum| per(sum, self.moves));
        write!(f, "; {candidates:.0} pairs per move, {tested:.0} of them tested; {} searches", self.searches)?;
        if self.clear > 0 {
            write!(f, ", {} of which found nothing near", self.clear)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_work_of_consecutive_times_adds_up() {
        let counts = |n: u64| {
            let mut counts = ContactCounts::default();
            (counts.searches, counts.clear, counts.moves, counts.shortened) = (n, n + 2, 3 * n, 5 * n);
            (counts.candidates, counts.tested, counts.active, counts.systems) = (7 * n, 11 * n, 13 * n, 17 * n);
            counts.left = 0.5 * n as f64;
            counts
        };
        let [start, middle, end] = [1, 4, 9].map(counts);
        let mut sum = ContactWork::between(&start, &middle);
        sum += ContactWork::between(&middle, &end);
        assert_eq!(sum, ContactWork::between(&start, &end));
    }
}
