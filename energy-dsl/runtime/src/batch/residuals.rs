//! Batches of residuals.

use std::ops::Range;

use super::error::{BatchError, Flagged, check_output, note_flags};
use super::packed::{BLOCK, Packed, PackedResidual, gather_numbers};
use super::potentials::store_rows;
use crate::array::Array;
use crate::element::Residual;
use crate::numbers::{Float, Kernel, Lane, Level, dispatch};

impl<S: Float, E: PackedResidual<S>> Packed<E, S> {
    /// Writes r(u), M numbers, of each element of a range, which starts at a multiple of [`BLOCK`]. Stencils index
    /// `unknowns`, number by number, in declared order.
    ///
    /// # Errors
    /// When range, unknowns and outputs do not fit each other.
    pub fn residuals(&self, range: Range<usize>, unknowns: &[S], residuals: &mut [S]) -> Result<Flagged, BatchError> {
        self.check(&range, <E::Unknowns as Array<S>>::LEN, unknowns.len())?;
        check_output("residuals", residuals.len(), range.len(), <E::Rows as Array<S>>::LEN)?;
        Ok(dispatch(Residuals { packed: self, range, unknowns, residuals }))
    }

    /// Writes r(u) (M numbers) and ∂r/∂u (M · U numbers, row by row) of each element of a range, which starts at a
    /// multiple of [`BLOCK`]. Stencils index `unknowns`, number by number, in declared order.
    ///
    /// # Errors
    /// When range, unknowns and outputs do not fit each other.
    pub fn jacobians(
        &self,
        range: Range<usize>,
        unknowns: &[S],
        residuals: &mut [S],
        jacobians: &mut [S],
    ) -> Result<Flagged, BatchError> {
        self.check(&range, <E::Unknowns as Array<S>>::LEN, unknowns.len())?;
        check_output("residuals", residuals.len(), range.len(), <E::Rows as Array<S>>::LEN)?;
        check_output("Jacobians", jacobians.len(), range.len(), <E::Jacobian as Array<S>>::LEN)?;
        Ok(dispatch(ResidualsWithJacobians { packed: self, range, unknowns, residuals, jacobians }))
    }
}

struct Residuals<'a, E, S> {
    packed: &'a Packed<E, S>,
    range: Range<usize>,
    unknowns: &'a [S],
    residuals: &'a mut [S],
}

impl<S: Float, E: PackedResidual<S>> Kernel for Residuals<'_, E, S> {
    type Output = Flagged;

    #[inline(always)]
    fn run<L: Level>(self) -> Flagged {
        let Self { packed, range, unknowns, residuals } = self;
        let (lanes, mut flagged) = (<S::Lanes<L> as Lane<S>>::LANES, Vec::new());
        for first in range.clone().step_by(lanes) {
            let (block, offset, count) = (first / BLOCK, first % BLOCK, lanes.min(range.end - first));
            let element = E::load::<S::Lanes<L>>(packed.numbers_from(block, offset), BLOCK);
            let result = element.residual_at::<L>(&gather_numbers(packed.stencils_from(block, offset), unknowns));
            store_rows(result.value.as_ref(), first - range.start, count, residuals);
            if result.flags.any() {
                note_flags(&mut flagged, first, count, result.flags.degenerate, result.flags.kink);
            }
        }
        flagged
    }
}

struct ResidualsWithJacobians<'a, E, S> {
    packed: &'a Packed<E, S>,
    range: Range<usize>,
    unknowns: &'a [S],
    residuals: &'a mut [S],
    jacobians: &'a mut [S],
}

impl<S: Float, E: PackedResidual<S>> Kernel for ResidualsWithJacobians<'_, E, S> {
    type Output = Flagged;

    #[inline(always)]
    fn run<L: Level>(self) -> Flagged {
        let Self { packed, range, unknowns, residuals, jacobians } = self;
        let (lanes, mut flagged) = (<S::Lanes<L> as Lane<S>>::LANES, Vec::new());
        for first in range.clone().step_by(lanes) {
            let (block, offset, count) = (first / BLOCK, first % BLOCK, lanes.min(range.end - first));
            let element = E::load::<S::Lanes<L>>(packed.numbers_from(block, offset), BLOCK);
            let result = element.jacobian_at::<L>(&gather_numbers(packed.stencils_from(block, offset), unknowns));
            let place = first - range.start;
            store_rows(result.value.as_ref(), place, count, residuals);
            store_rows(result.jacobian.as_ref(), place, count, jacobians);
            if result.flags.any() {
                note_flags(&mut flagged, first, count, result.flags.degenerate, result.flags.kink);
            }
        }
        flagged
    }
}
