//! The step filter: finds the part of a move during which all candidates certainly keep their clearance.

use energy_solve::threads::for_each;

use super::spacing::Spacings;
use crate::collision::{Candidates, Clearance, CollisionMesh, Move, PART, Pair};

/// Filters a move by some candidates.
pub(super) struct StepFilter<'a> {
    pub mesh: &'a CollisionMesh,
    pub spacings: &'a Spacings,
    pub step: &'a Move<'a>,
    /// The candidates, measured at the start of the move.
    pub candidates: &'a Candidates,
}

/// The result of a filter.
pub(super) struct FilteredStep {
    /// The part of the move that is certified.
    pub part: f64,
    /// The number of pairs.
    pub pairs: u64,
    /// Pairs that were too close to be dismissed by a comparison of distances.
    pub tested: u64,
    /// The pairs that shorten the move.
    pub blocking: Vec<Pair>,
}

impl StepFilter<'_> {
    /// Threads find the few pairs that are not safe at first sight. These shorten the move one after the other.
    pub fn filter(&self, threads: usize) -> FilteredStep {
        let pairs = self.candidates.pairs();
        let parts: Vec<_> = pairs.chunks(PART).enumerate().map(|(number, part)| (number * PART, part)).collect();
        let mut filtered = FilteredStep { part: 1.0, pairs: pairs.len() as u64, tested: 0, blocking: Vec::new() };
        if pairs.is_empty() {
            return filtered;
        }
        let farthest = self.farthest();
        for (tested, doubtful) in for_each(threads, parts, |(first, part)| self.doubtful(first, part, farthest)) {
            filtered.tested += tested;
            for number in doubtful {
                let pair = &pairs[number];
                let own = self.step.safe_part(pair, self.clearance(pair), filtered.part);
                if own < 1.0 {
                    filtered.blocking.push(*pair);
                }
                filtered.part = own.min(filtered.part);
            }
        }
        filtered
    }

    /// The number of pairs that comparisons of distances do not dismiss, and those that are not safe at first sight,
    /// among consecutive pairs from number `first` on.
    fn doubtful(&self, first: usize, pairs: &[Pair], farthest: f64) -> (u64, Vec<usize>) {
        let mut close = Vec::new();
        for (number, (pair, separation)) in (first..).zip(pairs.iter().zip(&self.candidates.separations()[first..])) {
            if *separation > farthest {
                continue;
            }
            let clearance = self.clearance(pair);
            if !self.step.stays_beyond(clearance.reach, pair, *separation) {
                close.push((number, clearance));
            }
        }
        (close.len() as u64, self.step.doubtful(self.candidates.pairs(), &close))
    }

    /// Pairs beyond this distance certainly stay out of reach, in m.
    fn farthest(&self) -> f64 {
        self.step.beyond(self.spacings.largest_reach(), 2.0 * self.step.longest())
    }

    fn clearance(&self, pair: &Pair) -> Clearance {
        self.spacings.of(self.mesh, pair).clearance(self.mesh.has_plane(pair))
    }
}
