//! What pairs say of a move.

use energy_solve::threads::for_each;

use super::spacing::Spacings;
use crate::collision::{CollisionMesh, Measured, Move, PART, Pair};

/// Judges a move by pairs that are measured at its start.
pub(super) struct Judge<'a> {
    pub mesh: &'a CollisionMesh,
    pub spacings: &'a Spacings,
    pub step: &'a Move<'a>,
    pub measured: &'a Measured,
}

/// What pairs say of a move.
pub(super) struct Judgement {
    /// The part of the move during which all pairs certainly keep their clearance.
    pub part: f64,
    /// Pairs that were too close to be dismissed by a comparison of distances.
    pub tested: u64,
    /// The pairs that shorten the move.
    pub blocking: Vec<Pair>,
}

impl Judge<'_> {
    /// Judges by these pairs, all that were measured. Each thread takes parts of the same size, for any number of
    /// threads, so that the results are the same.
    pub fn on(&self, pairs: &[Pair], threads: usize) -> Judgement {
        let parts: Vec<_> = pairs.chunks(PART).enumerate().map(|(number, part)| (number * PART, part)).collect();
        let judged = for_each(threads, parts, |(first, part)| self.on_part(first, part));
        judged.into_iter().fold(Judgement::default(), Judgement::and)
    }

    /// Judges by consecutive pairs from number `first` on.
    fn on_part(&self, first: usize, pairs: &[Pair]) -> Judgement {
        let mut judgement = Judgement::default();
        for (number, pair) in (first..).zip(pairs) {
            let clearance = self.spacings.of(self.mesh, pair).clearance(self.mesh.has_plane(pair));
            if self.step.stays_beyond(clearance.reach, pair, self.measured.separations()[number]) {
                continue;
            }
            judgement.tested += 1;
            let own = self.step.safe_part(pair, &self.measured.closest(number), clearance, judgement.part);
            if own < 1.0 {
                judgement.blocking.push(*pair);
            }
            judgement.part = own.min(judgement.part);
        }
        judgement
    }
}

impl Default for Judgement {
    /// No pair shortens the move.
    fn default() -> Self {
        Self { part: 1.0, tested: 0, blocking: Vec::new() }
    }
}

impl Judgement {
    /// What both say.
    fn and(self, other: Self) -> Self {
        let blocking = [self.blocking, other.blocking].concat();
        Self { part: self.part.min(other.part), tested: self.tested + other.tested, blocking }
    }
}
