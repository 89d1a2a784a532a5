//! Elements that a term evaluates in lanes: generated ones, or tapes.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::ops::Range;

use energy_dsl::{
    Array, BLOCK, Batch, BatchWork, Block, Declaration, Flags, Kernel, Lane, Level, Mask, Number, Packed,
    PackedPotential, Potential, ReducedHessian, ReducedPotential, Vector3, WidePoints, dispatch, for_each_batch_in,
};

use super::waiting::Held;
use super::work::{Examined, Expanded, Gradients, Hessians, Values, difference_vectors, lanes_in};
use crate::terms::scatter::Lanes;

/// Elements of one type, packed for lanes. Ranges start at multiples of [`Evaluated::PACK`].
pub(super) trait Evaluated: Debug + Send + Sync + 'static {
    /// Elements that are evaluated together.
    const PACK: usize;

    /// Returns the declaration of the elements.
    fn declaration(&self) -> &Declaration;
    /// Returns the vertices of all elements by pack, point, element.
    fn stencils(&self) -> &[u32];
    /// Returns the elements with these indices.
    fn selected(&self, indices: &[usize]) -> Self;
    /// Evaluates Σ U.
    fn values(&self, packs: &[Range<usize>], x: &[Vector3<f64>], work: &mut Values<'_>);
    /// Evaluates U and ∇U.
    fn gradients(&self, packs: &[Range<usize>], x: &[Vector3<f64>], work: &mut Gradients<'_>);
    /// Evaluates U, ∇U and ∇²U.
    fn hessians(&self, packs: &[Range<usize>], x: &[Vector3<f64>], work: &mut Hessians<'_, '_>);
    /// Calls `each` with the index, U and ∇U of each element.
    fn each_gradient(&self, x: &[Vector3<f64>], each: &mut dyn FnMut(usize, f64, &[f64]));
}

impl<E: PackedPotential<f64> + Debug + Send + Sync + 'static> Evaluated for Packed<E> {
    const PACK: usize = BLOCK;

    fn declaration(&self) -> &Declaration {
        E::DECLARATION
    }

    fn stencils(&self) -> &[u32] {
        Packed::stencils(self)
    }

    fn selected(&self, indices: &[usize]) -> Self {
        Packed::selected(self, indices)
    }

    fn values(&self, packs: &[Range<usize>], x: &[Vector3<f64>], work: &mut Values<'_>) {
        packs.iter().for_each(|pack| for_each_batch_in(self, pack.clone(), x, work));
    }

    fn gradients(&self, packs: &[Range<usize>], x: &[Vector3<f64>], work: &mut Gradients<'_>) {
        packs.iter().for_each(|pack| for_each_batch_in(self, pack.clone(), x, work));
    }

    fn hessians(&self, packs: &[Range<usize>], x: &[Vector3<f64>], work: &mut Hessians<'_, '_>) {
        packs.iter().for_each(|pack| for_each_batch_in(self, pack.clone(), x, work));
        if !work.waiting.is_empty() {
            dispatch(Release::<E>::of(work));
        }
    }

    fn each_gradient(&self, x: &[Vector3<f64>], each: &mut dyn FnMut(usize, f64, &[f64])) {
        let points = <WidePoints<E, f64> as Array<Vector3<f64>>>::LEN;
        for number in 0..self.len() {
            let vertex = |point: usize| self.stencils()[(number / BLOCK * points + point) * BLOCK + number % BLOCK];
            let own = WidePoints::<E, f64>::from_fn(|point| x[vertex(point) as usize]);
            let result = self.element(number).gradient(&own);
            each(number, result.value, result.gradient.as_ref().as_flattened());
        }
    }
}

/// Returns the elements of a batch.
#[inline(always)]
fn lanes<'a, E: PackedPotential<f64>, V: Lane<f64>>(batch: &Batch<'a, E, V>) -> Lanes<'a> {
    Lanes { first: batch.first, count: batch.count, stencils: batch.stencils(), stride: BLOCK }
}

impl<E: PackedPotential<f64>> BatchWork<E> for Values<'_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        let result = batch.element.value_at::<L>(batch.points);
        let flagged = lanes_in(result.flags.degenerate | result.flags.kink, batch.count);
        self.add(&lanes(&batch), result.value, flagged);
    }
}

impl<E: PackedPotential<f64>> BatchWork<E> for Gradients<'_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        let result = batch.element.gradient_at::<L>(batch.points);
        let flagged = lanes_in(result.flags.degenerate | result.flags.kink, batch.count);
        self.add(&lanes(&batch), result.value, result.gradient.as_ref(), flagged);
    }
}

impl<E: PackedPotential<f64>> BatchWork<E> for Hessians<'_, '_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        let lanes = lanes(&batch);
        let mut reduced = batch.element.reduced_hessian_at::<L>(batch.points);
        let n = <<E::Wide<L::F64> as ReducedPotential<L::F64>>::Coordinates as Array<L::F64>>::LEN;
        let (derivatives, points) = ((reduced.gradient.as_ref(), reduced.hessian.as_mut()), batch.points.as_ref());
        let Examined { open, mut changed } = self.examine::<L>(E::DECLARATION, &lanes, derivatives, n, points);
        let is_next = self.waiting.is_empty();
        if open == 0 && is_next {
            L::F64::dispatch(Expansion::<E, _> { to: self, lanes, reduced: &reduced, changed });
            return;
        }
        let vectors = difference_vectors::<L>(E::DECLARATION, points);
        if let Some(projection) = self.projection(E::DECLARATION)
            && open.count_ones() as usize == <L::F64 as Lane<f64>>::LANES
            && is_next
        {
            changed |= self.waiting.project_now::<L>(projection, reduced.hessian.as_mut(), vectors.as_flattened());
            L::F64::dispatch(Expansion::<E, _> { to: self, lanes, reduced: &reduced, changed });
            return;
        }
        let Flags { degenerate, kink } = reduced.flags;
        let Lanes { first, count, .. } = lanes;
        let held = Held { first, count, degenerate: degenerate.bits(), kink: kink.bits(), changed };
        let numbers = [&[reduced.value], reduced.gradient.as_ref(), reduced.hessian.as_ref(), vectors.as_flattened()];
        self.waiting.hold(held, open, (&lanes, points.len()), numbers);
        if self.waiting.is_full(<L::F64 as Lane<f64>>::LANES) {
            L::F64::dispatch(Release::<E>::of(self));
        }
    }
}

/// Adds the batches that wait, after their Hessians were projected.
struct Release<'k, 'a, 'b, E> {
    to: &'k mut Hessians<'a, 'b>,
    of: PhantomData<E>,
}

impl<'k, 'a, 'b, E> Release<'k, 'a, 'b, E> {
    fn of(to: &'k mut Hessians<'a, 'b>) -> Self {
        Self { to, of: PhantomData }
    }
}

impl<E: PackedPotential<f64>> Kernel for Release<'_, '_, '_, E> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let to = self.to;
        let Some(projection) = to.projection(E::DECLARATION) else { return };
        let mut waiting = std::mem::take(&mut to.waiting);
        waiting.project::<L>(projection);
        waiting.release::<L::F64>(|held, lanes, numbers| {
            let zero = L::F64::splat(0.0);
            let mask = |bits: u32| <L::F64 as Number>::Mask::from_bits(bits);
            let flags = Flags { degenerate: mask(held.degenerate), kink: mask(held.kink) };
            let (gradient, hessian) = (Array::repeat(zero), Array::repeat(zero));
            let mut reduced: Reduced<E, L::F64> = ReducedHessian { value: zero, gradient, hessian, flags };
            let mut stored = numbers.chunks_exact(<L::F64 as Lane<f64>>::LANES);
            let parts = [std::slice::from_mut(&mut reduced.value), reduced.gradient.as_mut(), reduced.hessian.as_mut()];
            for (number, stored) in parts.into_iter().flatten().zip(&mut stored) {
                *number = L::F64::load(stored);
            }
            L::F64::dispatch(Expansion::<E, _> { to: &mut *to, lanes, reduced: &reduced, changed: held.changed });
        });
        to.waiting = waiting;
    }
}

/// The reduced Hessian of elements in lanes.
type Reduced<E, V> = ReducedHessian<
    V,
    <<E as PackedPotential<f64>>::Wide<V> as ReducedPotential<V>>::Coordinates,
    <<E as PackedPotential<f64>>::Wide<V> as ReducedPotential<V>>::Upper,
>;

/// Expands the results of a batch and adds them to a linearisation. Its own [`Kernel`] is compiled for the SIMD
/// level without being inlined.
struct Expansion<'k, 'a, 'b, E: PackedPotential<f64>, V: Lane<f64>> {
    to: &'k mut Hessians<'a, 'b>,
    lanes: Lanes<'k>,
    reduced: &'k Reduced<E, V>,
    /// Bits of the changed lanes.
    changed: u32,
}

impl<E: PackedPotential<f64>, V: Lane<f64>> Kernel for Expansion<'_, '_, '_, E, V> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { to, lanes, reduced, changed } = self;
        let mut result = <E::Wide<V> as ReducedPotential<V>>::expand::<L, { u32::MAX }>(reduced);
        let flagged = lanes_in(result.flags.degenerate | result.flags.kink, lanes.count);
        V::dispatch(Addition {
            to,
            lanes,
            value: result.value,
            gradient: &result.gradient,
            triangle: &mut result.hessian,
            bits: (flagged, changed),
        });
    }
}

/// Adds the results of a batch to a linearisation. Elements with equally many points share this code.
struct Addition<'k, 'a, 'b, V, P, T> {
    to: &'k mut Hessians<'a, 'b>,
    lanes: Lanes<'k>,
    value: V,
    gradient: &'k P,
    triangle: &'k mut T,
    /// Flagged and projected lanes.
    bits: (u32, u32),
}

impl<V: Lane<f64>, P: Array<Vector3<V>>, T: Array<Block<V>>> Kernel for Addition<'_, '_, '_, V, P, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { to, lanes, value, gradient, triangle, bits } = self;
        let (mut v, mut sums) = (*gradient, *gradient);
        let numbers = Expanded { value, gradient: gradient.as_ref(), triangle: triangle.as_mut() };
        to.add(&lanes, numbers, bits, [v.as_mut(), sums.as_mut()]);
    }
}
