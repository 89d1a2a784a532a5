//! Batches of forces.

use std::ops::Range;

use super::error::{BatchError, Flagged, check_output, note_flags};
use super::packed::{BLOCK, Packed, PackedForce};
use super::potentials::store_rows;
use crate::array::Array;
use crate::element::{ForceLaw, Vector3};
use crate::numbers::{Float, Kernel, Lane, Level, dispatch};

impl<S: Float, E: PackedForce<S>> Packed<E, S> {
    /// Writes f(x, v), 3 N numbers, of each element of a range, which starts at a multiple of [`BLOCK`].
    ///
    /// # Errors
    /// When range, points, velocities and outputs do not fit each other.
    pub fn forces(
        &self,
        range: Range<usize>,
        x: &[Vector3<S>],
        v: &[Vector3<S>],
        forces: &mut [S],
    ) -> Result<Flagged, BatchError> {
        self.check_motion(&range, x, v)?;
        check_output("forces", forces.len(), range.len(), 3 * points_of::<S, E>())?;
        Ok(dispatch(Forces { packed: self, range, x, v, forces }))
    }

    /// Writes f(x, v) (3 N numbers), ∂f/∂x and ∂f/∂v (9 N² numbers each: all 3×3 blocks, row by row) of each element of
    /// a range, which starts at a multiple of [`BLOCK`].
    ///
    /// # Errors
    /// When range, points, velocities and outputs do not fit each other.
    pub fn force_jacobians(
        &self,
        range: Range<usize>,
        x: &[Vector3<S>],
        v: &[Vector3<S>],
        forces: &mut [S],
        by_position: &mut [S],
        by_velocity: &mut [S],
    ) -> Result<Flagged, BatchError> {
        let points = points_of::<S, E>();
        self.check_motion(&range, x, v)?;
        check_output("forces", forces.len(), range.len(), 3 * points)?;
        check_output("Jacobians by position", by_position.len(), range.len(), 9 * points * points)?;
        check_output("Jacobians by velocity", by_velocity.len(), range.len(), 9 * points * points)?;
        Ok(dispatch(ForcesWithJacobians { packed: self, range, x, v, forces, by_position, by_velocity }))
    }

    fn check_motion(&self, range: &Range<usize>, x: &[Vector3<S>], v: &[Vector3<S>]) -> Result<(), BatchError> {
        self.check(range, points_of::<S, E>(), x.len())?;
        self.check(range, points_of::<S, E>(), v.len())
    }
}

fn points_of<S: Float, E: PackedForce<S>>() -> usize {
    <<E as ForceLaw<S>>::Points as Array<Vector3<S>>>::LEN
}

/// Points of an element per lane.
type WideForcePoints<E, V, S> = <<E as PackedForce<S>>::Wide<V> as ForceLaw<V>>::Points;

struct Forces<'a, E, S> {
    packed: &'a Packed<E, S>,
    range: Range<usize>,
    x: &'a [Vector3<S>],
    v: &'a [Vector3<S>],
    forces: &'a mut [S],
}

impl<S: Float, E: PackedForce<S>> Kernel for Forces<'_, E, S> {
    type Output = Flagged;

    #[inline(always)]
    fn run<L: Level>(self) -> Flagged {
        let Self { packed, range, x, v, forces } = self;
        let (lanes, mut flagged) = (<S::Lanes<L> as Lane<S>>::LANES, Vec::new());
        for first in range.clone().step_by(lanes) {
            let (block, offset, count) = (first / BLOCK, first % BLOCK, lanes.min(range.end - first));
            let element = E::load::<S::Lanes<L>>(packed.numbers_from(block, offset), BLOCK);
            let x: WideForcePoints<E, S::Lanes<L>, S> = packed.gather(block, offset, x);
            let v: WideForcePoints<E, S::Lanes<L>, S> = packed.gather(block, offset, v);
            let result = element.force_at::<L>(&x, &v);
            store_rows(result.force.as_ref().as_flattened(), first - range.start, count, forces);
            if result.flags.any() {
                note_flags(&mut flagged, first, count, result.flags.degenerate, result.flags.kink);
            }
        }
        flagged
    }
}

struct ForcesWithJacobians<'a, E, S> {
    packed: &'a Packed<E, S>,
    range: Range<usize>,
    x: &'a [Vector3<S>],
    v: &'a [Vector3<S>],
    forces: &'a mut [S],
    by_position: &'a mut [S],
    by_velocity: &'a mut [S],
}

impl<S: Float, E: PackedForce<S>> Kernel for ForcesWithJacobians<'_, E, S> {
    type Output = Flagged;

    #[inline(always)]
    fn run<L: Level>(self) -> Flagged {
        let Self { packed, range, x, v, forces, by_position, by_velocity } = self;
        let (lanes, mut flagged) = (<S::Lanes<L> as Lane<S>>::LANES, Vec::new());
        for first in range.clone().step_by(lanes) {
            let (block, offset, count) = (first / BLOCK, first % BLOCK, lanes.min(range.end - first));
            let element = E::load::<S::Lanes<L>>(packed.numbers_from(block, offset), BLOCK);
            let x: WideForcePoints<E, S::Lanes<L>, S> = packed.gather(block, offset, x);
            let v: WideForcePoints<E, S::Lanes<L>, S> = packed.gather(block, offset, v);
            let result = element.jacobians_at::<L>(&x, &v);
            let place = first - range.start;
            store_rows(result.force.as_ref().as_flattened(), place, count, forces);
            store_rows(result.by_position.as_ref().as_flattened().as_flattened(), place, count, by_position);
            store_rows(result.by_velocity.as_ref().as_flattened().as_flattened(), place, count, by_velocity);
            if result.flags.any() {
                note_flags(&mut flagged, first, count, result.flags.degenerate, result.flags.kink);
            }
        }
        flagged
    }
}
