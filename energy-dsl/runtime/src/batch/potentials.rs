//! Batches of potentials.

use std::ops::Range;

use super::error::{BatchError, Flagged, check_output, note_flags};
use super::packed::{BLOCK, Packed, PackedPotential, WidePoints};
use crate::array::Array;
use crate::element::{Block, Potential, Vector3};
use crate::numbers::{Float, Kernel, Lane, Level, Real, dispatch, prefetch_rows};

/// One element per lane, with its points.
pub struct Batch<'a, E: PackedPotential<S>, V: Lane<S>, S: Float = f64> {
    /// Index of the first element among the packed ones.
    pub first: usize,
    /// Index of the first element in the range of the call: where its results go if outputs belong to the range alone.
    pub place: usize,
    /// Number of elements: one per lane, or fewer in the last batch.
    pub count: usize,
    /// The elements, one per lane.
    pub element: &'a E::Wide<V>,
    /// The points of the elements.
    pub points: &'a WidePoints<E, V, S>,
    /// Vertex indices of the block, from the first element of the batch on.
    stencils: &'a [u32],
}

impl<'a, S: Float, E: PackedPotential<S>, V: Lane<S>> Batch<'a, E, V, S> {
    /// Returns the vertex indices from the first element of the batch on: those of point p start at p · [`BLOCK`].
    #[inline(always)]
    #[must_use]
    pub fn stencils(&self) -> &'a [u32] {
        self.stencils
    }

    /// Returns the vertex index of point `point` of each element.
    #[inline(always)]
    #[must_use]
    pub fn vertices(&self, point: usize) -> &'a [u32] {
        &self.stencils[point * BLOCK..][..V::LANES]
    }
}

/// Work on each batch of a list of elements.
pub trait BatchWork<E: PackedPotential<S>, S: Float = f64> {
    /// Processes one batch. Mark implementations `#[inline(always)]` and avoid closures in hot code: only inlined code
    /// is compiled for the SIMD level.
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, S::Lanes<L>, S>);
}

/// Runs `work` on all elements, in batches, at the best SIMD level of the machine.
///
/// # Panics
/// When a stencil has a point that is not among `positions`.
pub fn for_each_batch<S: Float, E: PackedPotential<S>>(
    elements: &Packed<E, S>,
    positions: &[Vector3<S>],
    work: &mut impl BatchWork<E, S>,
) {
    for_each_batch_in(elements, 0..elements.len(), positions, work);
}

/// Runs `work` on a range of elements. The range starts at a multiple of [`BLOCK`].
///
/// # Panics
/// When a stencil has a point that is not among `positions`, or the range begins elsewhere, or ends after the last
/// element.
pub fn for_each_batch_in<S: Float, E: PackedPotential<S>>(
    elements: &Packed<E, S>,
    range: Range<usize>,
    positions: &[Vector3<S>],
    work: &mut impl BatchWork<E, S>,
) {
    dispatch(Batches { elements, range, positions, work });
}

/// The kernel behind [`for_each_batch`], for callers that choose the SIMD level themselves.
#[derive(Debug)]
pub struct Batches<'a, E, W, S = f64> {
    /// The elements with their stencils.
    pub elements: &'a Packed<E, S>,
    /// The elements to process; the range starts at a multiple of [`BLOCK`].
    pub range: Range<usize>,
    /// Positions of all vertices.
    pub positions: &'a [Vector3<S>],
    /// Called for each batch.
    pub work: &'a mut W,
}

impl<S: Float, E: PackedPotential<S>, W: BatchWork<E, S>> Kernel for Batches<'_, E, W, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { elements: packed, range, positions, work } = self;
        if let Err(error) = packed.check(&range, points_of::<S, E>(), positions.len()) {
            panic!("{error}");
        }
        let lanes = <S::Lanes<L> as Lane<S>>::LANES;
        let mut first = range.start;
        while first < range.end {
            let (block, offset) = (first / BLOCK, first % BLOCK);
            let element = E::load::<S::Lanes<L>>(packed.numbers_from(block, offset), BLOCK);
            let points = packed.gather::<S::Lanes<L>, WidePoints<E, S::Lanes<L>, S>>(block, offset, positions);
            let (place, count) = (first - range.start, lanes.min(range.end - first));
            let stencils = packed.stencils_from(block, offset);
            work.batch::<L>(Batch { first, place, count, element: &element, points: &points, stencils });
            first += lanes;
        }
    }
}

fn points_of<S: Float, E: PackedPotential<S>>() -> usize {
    <E::Points as Array<Vector3<S>>>::LEN
}

impl<S: Float, E: PackedPotential<S>> Packed<E, S> {
    /// Writes U of each element of a range, which starts at a multiple of [`BLOCK`].
    ///
    /// # Errors
    /// When range, points and outputs do not fit each other.
    pub fn values(&self, range: Range<usize>, x: &[Vector3<S>], energies: &mut [S]) -> Result<Flagged, BatchError> {
        self.check(&range, points_of::<S, E>(), x.len())?;
        check_output("energies", energies.len(), range.len(), 1)?;
        let mut work = Values { energies, flagged: Vec::new() };
        dispatch(Batches { elements: self, range, positions: x, work: &mut work });
        Ok(work.flagged)
    }

    /// Writes U and ∂U/∂x, 3 N numbers, of each element of a range, which starts at a multiple of [`BLOCK`].
    ///
    /// # Errors
    /// When range, points and outputs do not fit each other.
    pub fn gradients(
        &self,
        range: Range<usize>,
        x: &[Vector3<S>],
        energies: &mut [S],
        gradients: &mut [S],
    ) -> Result<Flagged, BatchError> {
        let points = points_of::<S, E>();
        self.check(&range, points, x.len())?;
        check_output("energies", energies.len(), range.len(), 1)?;
        check_output("gradients", gradients.len(), range.len(), 3 * points)?;
        let mut work = Gradients { energies, gradients, flagged: Vec::new() };
        dispatch(Batches { elements: self, range, positions: x, work: &mut work });
        Ok(work.flagged)
    }

    /// Writes U, ∂U/∂x (3 N numbers) and the triangle of ∂²U/∂x² (9 · N (N + 1)/2 numbers) of each element of a range,
    /// which starts at a multiple of [`BLOCK`].
    ///
    /// Outputs belong to the range alone, so threads can share them out:
    ///
    /// ```
    /// use energy_runtime::{BatchError, BLOCK, Float, Packed, PackedPotential, Vector3};
    ///
    /// /// Evaluates springs, which have two points, on two threads.
    /// fn evaluate<E: PackedPotential<f64> + Sync>(
    ///     springs: &Packed<E>,
    ///     x: &[Vector3<f64>],
    ///     energies: &mut [f64],
    ///     gradients: &mut [f64],
    ///     triangles: &mut [f64],
    /// ) -> Result<(), BatchError> {
    ///     let half = springs.chunk_len(2).min(springs.len());
    ///     let (e0, e1) = energies.split_at_mut(half);
    ///     let (g0, g1) = gradients.split_at_mut(6 * half);
    ///     let (t0, t1) = triangles.split_at_mut(27 * half);
    ///     std::thread::scope(|scope| {
    ///         let other = scope.spawn(|| springs.hessians(half..springs.len(), x, e1, g1, t1));
    ///         springs.hessians(0..half, x, e0, g0, t0)?;
    ///         other.join().expect("no panic").map(|_| ())
    ///     })
    /// }
    /// ```
    ///
    /// # Errors
    /// When range, points and outputs do not fit each other.
    pub fn hessians(
        &self,
        range: Range<usize>,
        x: &[Vector3<S>],
        energies: &mut [S],
        gradients: &mut [S],
        triangles: &mut [S],
    ) -> Result<Flagged, BatchError> {
        let points = points_of::<S, E>();
        self.check(&range, points, x.len())?;
        check_output("energies", energies.len(), range.len(), 1)?;
        check_output("gradients", gradients.len(), range.len(), 3 * points)?;
        check_output("Hessians", triangles.len(), range.len(), 9 * <E::Triangle as Array<Block<S>>>::LEN)?;
        let mut work = Hessians { energies, gradients, triangles, flagged: Vec::new() };
        dispatch(Batches { elements: self, range, positions: x, work: &mut work });
        Ok(work.flagged)
    }
}

/// Work that stores energies.
struct Values<'a, S> {
    energies: &'a mut [S],
    flagged: Flagged,
}

impl<S: Float, E: PackedPotential<S>> BatchWork<E, S> for Values<'_, S> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, S::Lanes<L>, S>) {
        let result = batch.element.value_at::<L>(batch.points);
        result.value.store_ragged(&mut self.energies[batch.place..][..batch.count]);
        if result.flags.any() {
            note_flags(&mut self.flagged, batch.first, batch.count, result.flags.degenerate, result.flags.kink);
        }
    }
}

/// Work that stores energies and gradients.
struct Gradients<'a, S> {
    energies: &'a mut [S],
    gradients: &'a mut [S],
    flagged: Flagged,
}

impl<S: Float, E: PackedPotential<S>> BatchWork<E, S> for Gradients<'_, S> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, S::Lanes<L>, S>) {
        let (place, count) = (batch.place, batch.count);
        let result = batch.element.gradient_at::<L>(batch.points);
        result.value.store_ragged(&mut self.energies[place..][..count]);
        store_rows(result.gradient.as_ref().as_flattened(), place, count, self.gradients);
        if result.flags.any() {
            note_flags(&mut self.flagged, batch.first, count, result.flags.degenerate, result.flags.kink);
        }
    }
}

/// Work that stores energies, gradients and Hessians element by element, for [`for_each_batch`]. The slices belong to
/// the range of the call: the results of its first element come first.
///
/// To get slices of numbers from slices of arrays, use `as_flattened_mut`. [`Packed::hessians`] checks their lengths.
#[derive(Debug)]
pub struct Hessians<'a, S = f64> {
    /// U of each element.
    pub energies: &'a mut [S],
    /// ∂U/∂x of each element: 3 N numbers.
    pub gradients: &'a mut [S],
    /// The triangle of ∂²U/∂x² of each element: 9 · N (N + 1)/2 numbers.
    pub triangles: &'a mut [S],
    /// Index among the packed elements and flags of each flagged element.
    pub flagged: Flagged,
}

impl<S: Float, E: PackedPotential<S>> BatchWork<E, S> for Hessians<'_, S> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, S::Lanes<L>, S>) {
        let (place, count) = (batch.place, batch.count);
        let result = batch.element.hessian_at::<L>(batch.points);
        result.value.store_ragged(&mut self.energies[place..][..count]);
        store_rows(result.gradient.as_ref().as_flattened(), place, count, self.gradients);
        store_rows(result.hessian.as_ref().as_flattened().as_flattened(), place, count, self.triangles);
        if result.flags.any() {
            note_flags(&mut self.flagged, batch.first, count, result.flags.degenerate, result.flags.kink);
        }
    }
}

/// Writes the numbers of `count` elements, one element per lane, to consecutive rows from row `place` on.
#[inline(always)]
pub(super) fn store_rows<S: Real, V: Lane<S>>(numbers: &[V], place: usize, count: usize, out: &mut [S]) {
    let stride = numbers.len();
    let out = &mut out[place * stride..];
    V::store_transposed(numbers, count, out, stride);
    let next = &out[count * stride..];
    prefetch_rows(&next[..next.len().min(count * stride)], stride);
}
