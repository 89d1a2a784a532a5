//! Batches of potentials of mixed unknowns.

use std::ops::Range;

use super::error::{BatchError, Flagged, check_output, note_flags};
use super::packed::{BLOCK, Packed, PackedMixed, gather_numbers};
use super::potentials::store_rows;
use crate::array::Array;
use crate::element::MixedPotential;
use crate::numbers::{Flags, Float, Kernel, Lane, Level, dispatch};

impl<S: Float, E: PackedMixed<S>> Packed<E, S> {
    /// Writes U of each element of a range, which starts at a multiple of [`BLOCK`]. Stencils index `unknowns`, number
    /// by number, in declared order.
    ///
    /// # Errors
    /// When range, unknowns and outputs do not fit each other.
    pub fn mixed_values(&self, range: Range<usize>, unknowns: &[S], energies: &mut [S]) -> Result<Flagged, BatchError> {
        self.check(&range, <E::Unknowns as Array<S>>::LEN, unknowns.len())?;
        check_output("energies", energies.len(), range.len(), 1)?;
        Ok(run(self, range, unknowns, Values { energies }))
    }

    /// Writes U and ∂U/∂u, one number per increment, of each element of a range, which starts at a multiple of
    /// [`BLOCK`]. Stencils index `unknowns`, number by number, in declared order.
    ///
    /// # Errors
    /// When range, unknowns and outputs do not fit each other.
    pub fn mixed_gradients(
        &self,
        range: Range<usize>,
        unknowns: &[S],
        energies: &mut [S],
        gradients: &mut [S],
    ) -> Result<Flagged, BatchError> {
        self.check(&range, <E::Unknowns as Array<S>>::LEN, unknowns.len())?;
        check_output("energies", energies.len(), range.len(), 1)?;
        check_output("gradients", gradients.len(), range.len(), <E::Increments as Array<S>>::LEN)?;
        Ok(run(self, range, unknowns, Gradients { energies, gradients }))
    }

    /// Writes U, ∂U/∂u (D numbers) and the upper triangle of ∂²U/∂u², row by row (D (D + 1)/2 numbers), of each element
    /// of a range, which starts at a multiple of [`BLOCK`]. Stencils index `unknowns`, number by number, in declared
    /// order.
    ///
    /// # Errors
    /// When range, unknowns and outputs do not fit each other.
    pub fn mixed_hessians(
        &self,
        range: Range<usize>,
        unknowns: &[S],
        energies: &mut [S],
        gradients: &mut [S],
        triangles: &mut [S],
    ) -> Result<Flagged, BatchError> {
        self.check(&range, <E::Unknowns as Array<S>>::LEN, unknowns.len())?;
        check_output("energies", energies.len(), range.len(), 1)?;
        check_output("gradients", gradients.len(), range.len(), <E::Increments as Array<S>>::LEN)?;
        check_output("Hessians", triangles.len(), range.len(), <E::Upper as Array<S>>::LEN)?;
        Ok(run(self, range, unknowns, Hessians { energies, gradients, triangles }))
    }
}

fn run<S: Float, E: PackedMixed<S>, R: Routine<E, S>>(
    packed: &Packed<E, S>,
    range: Range<usize>,
    unknowns: &[S],
    routine: R,
) -> Flagged {
    dispatch(EachBatch { packed, range, unknowns, routine })
}

/// The unknowns of a potential over lanes `V`.
type WideUnknowns<E, V, S> = <<E as PackedMixed<S>>::Wide<V> as MixedPotential<V>>::Unknowns;

/// A routine that stores the results of one batch.
trait Routine<E: PackedMixed<S>, S: Float> {
    /// Evaluates elements, one per lane, and stores the results of the first `count` from row `place` on.
    fn store<L: Level>(
        &mut self,
        element: &E::Wide<S::Lanes<L>>,
        unknowns: &WideUnknowns<E, S::Lanes<L>, S>,
        place: usize,
        count: usize,
    ) -> Flags<S::Lanes<L>>;
}

/// The kernel that runs a routine over a range.
struct EachBatch<'a, E, S, R> {
    packed: &'a Packed<E, S>,
    range: Range<usize>,
    unknowns: &'a [S],
    routine: R,
}

impl<S: Float, E: PackedMixed<S>, R: Routine<E, S>> Kernel for EachBatch<'_, E, S, R> {
    type Output = Flagged;

    #[inline(always)]
    fn run<L: Level>(self) -> Flagged {
        let Self { packed, range, unknowns, mut routine } = self;
        let (lanes, mut flagged) = (<S::Lanes<L> as Lane<S>>::LANES, Vec::new());
        for first in range.clone().step_by(lanes) {
            let (block, offset, count) = (first / BLOCK, first % BLOCK, lanes.min(range.end - first));
            let element = E::load::<S::Lanes<L>>(packed.numbers_from(block, offset), BLOCK);
            let own = gather_numbers(packed.stencils_from(block, offset), unknowns);
            let flags = routine.store::<L>(&element, &own, first - range.start, count);
            if flags.any() {
                note_flags(&mut flagged, first, count, flags.degenerate, flags.kink);
            }
        }
        flagged
    }
}

struct Values<'a, S> {
    energies: &'a mut [S],
}

impl<S: Float, E: PackedMixed<S>> Routine<E, S> for Values<'_, S> {
    #[inline(always)]
    fn store<L: Level>(
        &mut self,
        element: &E::Wide<S::Lanes<L>>,
        unknowns: &WideUnknowns<E, S::Lanes<L>, S>,
        place: usize,
        count: usize,
    ) -> Flags<S::Lanes<L>> {
        let result = element.value_at::<L>(unknowns);
        result.value.store_ragged(&mut self.energies[place..][..count]);
        result.flags
    }
}

struct Gradients<'a, S> {
    energies: &'a mut [S],
    gradients: &'a mut [S],
}

impl<S: Float, E: PackedMixed<S>> Routine<E, S> for Gradients<'_, S> {
    #[inline(always)]
    fn store<L: Level>(
        &mut self,
        element: &E::Wide<S::Lanes<L>>,
        unknowns: &WideUnknowns<E, S::Lanes<L>, S>,
        place: usize,
        count: usize,
    ) -> Flags<S::Lanes<L>> {
        let result = element.gradient_at::<L>(unknowns);
        result.value.store_ragged(&mut self.energies[place..][..count]);
        store_rows(result.gradient.as_ref(), place, count, self.gradients);
        result.flags
    }
}

struct Hessians<'a, S> {
    energies: &'a mut [S],
    gradients: &'a mut [S],
    triangles: &'a mut [S],
}

impl<S: Float, E: PackedMixed<S>> Routine<E, S> for Hessians<'_, S> {
    #[inline(always)]
    fn store<L: Level>(
        &mut self,
        element: &E::Wide<S::Lanes<L>>,
        unknowns: &WideUnknowns<E, S::Lanes<L>, S>,
        place: usize,
        count: usize,
    ) -> Flags<S::Lanes<L>> {
        let result = element.hessian_at::<L>(unknowns);
        result.value.store_ragged(&mut self.energies[place..][..count]);
        store_rows(result.gradient.as_ref(), place, count, self.gradients);
        store_rows(result.hessian.as_ref(), place, count, self.triangles);
        result.flags
    }
}
