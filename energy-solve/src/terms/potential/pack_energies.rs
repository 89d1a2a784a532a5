use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use energy_dsl::{BLOCK, Lane};

use crate::terms::scatter::Lanes;

/// Writes Σ U of each pack. The order of summation is fixed, so the sum is the same for any number of lanes.
pub(super) struct PackEnergies<'a> {
    /// The number of elements.
    elements: usize,
    /// U of the current pack's elements.
    values: [f64; BLOCK],
    /// Σ U of each pack, as bits.
    sums: &'a [AtomicU64],
}

impl<'a> PackEnergies<'a> {
    pub(super) fn new(elements: usize, sums: &'a [AtomicU64]) -> Self {
        Self { elements, values: [0.0; BLOCK], sums }
    }

    #[inline(always)]
    pub(super) fn note<V: Lane<f64>>(&mut self, batch: &Lanes<'_>, values: V) {
        let position = batch.first % BLOCK;
        values.store(&mut self.values[position..]);
        let next = position + V::LANES;
        if next == BLOCK || batch.first + batch.count == self.elements {
            // Lanes past the last element hold values of an earlier pack.
            self.values[position + batch.count..].fill(0.0);
            let sum = pairwise::<4, 2>(pairwise::<8, 4>(pairwise::<BLOCK, 8>(self.values)));
            self.sums[batch.first / BLOCK].store((sum[0] + sum[1]).to_bits(), Relaxed);
        }
    }
}

/// One step of a pairwise sum: adds the upper half to the lower half.
#[inline(always)]
fn pairwise<const ALL: usize, const HALF: usize>(numbers: [f64; ALL]) -> [f64; HALF] {
    let mut sums = [0.0; HALF];
    for position in 0..HALF {
        sums[position] = numbers[position] + numbers[position + HALF];
    }
    sums
}
