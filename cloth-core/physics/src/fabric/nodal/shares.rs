//! The term divided among threads. Patches across the border of two shares are evaluated for both.

use std::ops::Range;

use energy_dsl::{Vector3, dispatch};
use energy_solve::{Blocks, Divisible, Linearisation, Share, State, Tally};

use super::assembly::{Forces, Found, Hessians, Sums, subtract_product};
use super::law::{Order, total_energy};
use super::patch::Patch;
use super::term::{Chunk, NodalMembrane};

impl NodalMembrane {
    /// Returns the chunks with a patch at one of these vertices.
    pub(super) fn chunks_at(&self, vertices: &Range<usize>) -> Vec<usize> {
        let has_patch =
            |chunk: &Chunk| self.active[chunk.numbers.clone()].iter().any(|&p| meets(self.patches.get(p), vertices));
        (0..self.chunks.len()).filter(|&number| has_patch(&self.chunks[number])).collect()
    }

    /// Evaluates the patches of a share. Returns the number of flagged patches in chunks that begin in the share, too.
    fn found_in(&self, share: &Share, x: &[Vector3<f64>], order: Order) -> (Vec<Found>, u64) {
        let (mut all, mut total) = (Vec::new(), 0);
        let everywhere = || (0..self.chunks.len()).collect();
        for number in self.shares.get(share.number).cloned().unwrap_or_else(everywhere) {
            let chunk = &self.chunks[number];
            let (responses, flagged) = self.responses(chunk, x, order);
            let found = chunk.numbers.clone().zip(responses);
            all.extend(found.filter(|&(number, _)| meets(self.patches.get(self.active[number]), &share.vertices)));
            let first = self.patches.get(self.active[chunk.numbers.start]).vertices[0];
            let begins_here = share.vertices.contains(&first);
            total += if begins_here { flagged } else { 0 };
        }
        (all, total)
    }

    /// Returns the tally of a share. The first counts the patches of all.
    fn tally_of(&self, share: &Share, flagged: u64) -> Tally {
        let is_first = share.vertices.start == 0;
        if is_first { self.tally(flagged) } else { Tally { flagged, ..Tally::default() } }
    }
}

/// Whether a patch may have one of these vertices.
fn meets(patch: Patch<'_>, vertices: &Range<usize>) -> bool {
    let [first, .., last] = *patch.vertices else { return false };
    first < vertices.end && last >= vertices.start
}

impl Divisible for NodalMembrane {
    fn energy_parts(&self) -> usize {
        self.chunks.len()
    }

    fn energy_part(&self, part: usize, x: &[Vector3<f64>]) -> (f64, Tally) {
        let (responses, flagged) = self.responses(&self.chunks[part], x, Order::Value);
        let tally = if part == 0 { self.tally(flagged) } else { Tally { flagged, ..Tally::default() } };
        (total_energy(&responses), tally)
    }

    fn add_force_of(&self, share: &Share, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        let (found, flagged) = self.found_in(share, state.x, Order::Gradient);
        let force = Sums { first: share.vertices.start, vectors: force };
        dispatch(Forces { of: self, found: &found, x: state.x, force });
        self.tally_of(share, flagged)
    }

    fn add_linearisation_of(&self, share: &Share, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let (found, flagged) = self.found_in(share, state.x, Order::Hessian);
        let first_vertex = share.vertices.start;
        if let Some(product) = &mut sum.stiffness_times_velocity {
            subtract_product(self, &found, state, Sums { first: first_vertex, vectors: product });
        }
        let (scale, curvature, force) = (-sum.weights.position, sum.curvature, &mut *sum.force);
        let force = Sums { first: first_vertex, vectors: force };
        let (of, found, x, first) = (self, &found[..], state.x, share.blocks.start);
        match &mut sum.matrix {
            Blocks::Single(matrix) => dispatch(Hessians { of, found, x, scale, curvature, force, first, matrix }),
            Blocks::Double(matrix) => dispatch(Hessians { of, found, x, scale, curvature, force, first, matrix }),
        }
        self.tally_of(share, flagged)
    }
}
