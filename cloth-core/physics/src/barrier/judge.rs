//! Judges moves by the pairs near them.

use energy_solve::threads::for_each;

use super::spacing::Spacings;
use crate::collision::{Clearance, CollisionMesh, Move, Nearby, PART, Pair};

/// Judges a move by the pairs near it.
pub(super) struct Judge<'a> {
    pub mesh: &'a CollisionMesh,
    pub spacings: &'a Spacings,
    pub step: &'a Move<'a>,
    /// The pairs, measured at the start of the move.
    pub nearby: &'a Nearby,
}

/// The result for a move.
pub(super) struct Judgement {
    /// The part of the move during which all pairs certainly keep their clearance.
    pub part: f64,
    /// The number of pairs.
    pub pairs: u64,
    /// Pairs that were too close to be dismissed by a comparison of distances.
    pub tested: u64,
    /// The pairs that shorten the move.
    pub blocking: Vec<Pair>,
}

impl Judge<'_> {
    /// Threads find the few pairs that are not safe at first sight. These shorten the move one after the other.
    pub fn judge(&self, threads: usize) -> Judgement {
        let pairs = self.nearby.pairs();
        let parts: Vec<_> = pairs.chunks(PART).enumerate().map(|(number, part)| (number * PART, part)).collect();
        let mut judgement = Judgement { part: 1.0, pairs: pairs.len() as u64, tested: 0, blocking: Vec::new() };
        if pairs.is_empty() {
            return judgement;
        }
        let farthest = self.farthest();
        for (tested, doubtful) in for_each(threads, parts, |(first, part)| self.doubtful(first, part, farthest)) {
            judgement.tested += tested;
            for number in doubtful {
                let pair = &pairs[number];
                let own = self.step.safe_part(pair, self.clearance(pair), judgement.part);
                if own < 1.0 {
                    judgement.blocking.push(*pair);
                }
                judgement.part = own.min(judgement.part);
            }
        }
        judgement
    }

    /// The number of pairs that comparisons of distances do not dismiss, and those that are not safe at first sight,
    /// among consecutive pairs from number `first` on.
    fn doubtful(&self, first: usize, pairs: &[Pair], farthest: f64) -> (u64, Vec<usize>) {
        let mut close = Vec::new();
        for (number, (pair, separation)) in (first..).zip(pairs.iter().zip(&self.nearby.separations()[first..])) {
            if *separation > farthest {
                continue;
            }
            let clearance = self.clearance(pair);
            if !self.step.stays_beyond(clearance.reach, pair, *separation) {
                close.push((number, clearance));
            }
        }
        (close.len() as u64, self.step.doubtful(self.nearby.pairs(), &close))
    }

    /// Pairs beyond this distance certainly stay out of reach, in m.
    fn farthest(&self) -> f64 {
        self.step.beyond(self.spacings.largest_reach(), 2.0 * self.step.longest())
    }

    fn clearance(&self, pair: &Pair) -> Clearance {
        self.spacings.of(self.mesh, pair).clearance(self.mesh.has_plane(pair))
    }
}
