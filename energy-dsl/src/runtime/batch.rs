//! Many elements of one type at once: their points and parameters packed into lanes, their results unpacked.
//!
//! A *batch* holds as many elements as the level has lanes. In the last one lanes may be left over: they repeat the last
//! element, so that they compute, and flag, nothing that it does not, and their results are not written.

use super::array::Array;
use super::cpu::{Kernel, Lane, Level, dispatch};
use super::element::{Potential, Vector3};
use super::flags::Flags;
use super::real::Mask;

/// Elements that can be packed into lanes.
pub trait Pack: Potential<f64> {
    /// The element over lanes.
    type Wide<V: Lane<f64>>: Potential<V>;

    /// Packs elements, one a lane; lanes beyond the slice's end repeat its last element. [`pack_field`] does it for one
    /// parameter.
    fn pack<V: Lane<f64>>(elements: &[Self]) -> Self::Wide<V>;
}

/// Packs one parameter of elements; see [`Pack::pack`].
///
/// # Panics
/// When there is no element.
#[inline(always)]
pub fn pack_field<V: Lane<f64>, E>(elements: &[E], field: impl Fn(&E) -> f64) -> V {
    let last = elements.len().checked_sub(1).expect("a batch has one element at least");
    V::from_fn(|lane| field(&elements[lane.min(last)]))
}

/// The points of an element over lanes.
pub type WidePoints<E, V> = <<E as Pack>::Wide<V> as Potential<V>>::Points;

/// Elements in lanes, with their points.
pub struct Batch<E: Pack, V: Lane<f64>> {
    /// The index of the first element.
    pub first: usize,
    /// How many elements there are: all lanes, or fewer in the last batch.
    pub count: usize,
    /// The elements.
    pub element: E::Wide<V>,
    /// Their points.
    pub points: WidePoints<E, V>,
}

/// What is done with every batch.
pub trait BatchWork<E: Pack> {
    /// Does it. Mark implementations `#[inline(always)]`, and use no closures for the main work: only what is inlined is
    /// compiled for the level.
    fn batch<L: Level>(&mut self, batch: &Batch<E, L::F64>);
}

/// Does work with all elements, in batches, at the best level of the machine. Element i acts on the points
/// `positions[stencils[i]]`.
///
/// # Panics
/// When the numbers of elements and stencils differ, or a stencil has a point that is not there.
pub fn for_each_batch<E: Pack, const N: usize>(
    elements: &[E],
    stencils: &[[u32; N]],
    positions: &[Vector3<f64>],
    work: &mut impl BatchWork<E>,
) {
    dispatch(Batches { elements, stencils, positions, work });
}

/// The kernel of [`for_each_batch`], for those who run it at a level of their choice.
#[derive(Debug)]
pub struct Batches<'a, E, const N: usize, W> {
    /// The elements.
    pub elements: &'a [E],
    /// Their points, by index.
    pub stencils: &'a [[u32; N]],
    /// All points.
    pub positions: &'a [Vector3<f64>],
    /// What is done.
    pub work: &'a mut W,
}

impl<E: Pack, const N: usize, W: BatchWork<E>> Kernel for Batches<'_, E, N, W> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        const { assert!(N == <E::Points as Array<Vector3<f64>>>::LEN, "a stencil has as many points as the element") }
        let (elements, stencils) = (self.elements, self.stencils);
        assert_eq!(elements.len(), stencils.len(), "every element needs a stencil");
        let lanes = <L::F64 as Lane<f64>>::LANES;
        let zero = <L::F64 as Lane<f64>>::splat(0.0);
        let mut first = 0;
        while first < elements.len() {
            let count = lanes.min(elements.len() - first);
            let (elements, stencils) = (&elements[first..first + count], &stencils[first..first + count]);
            let mut points = WidePoints::<E, L::F64>::from_fn(|_| [zero; 3]);
            for (point, wide) in points.as_mut().iter_mut().enumerate() {
                *wide =
                    <L::F64 as Lane<f64>>::gather(self.positions, |lane| stencils[lane.min(count - 1)][point] as usize);
            }
            self.work.batch::<L>(&Batch { first, count, element: E::pack(elements), points });
            first += count;
        }
    }
}

/// Energies, gradients and Hessians of all elements, one after the other: work for [`for_each_batch`].
///
/// Slices of arrays become slices of numbers by `as_flattened_mut`.
#[derive(Debug)]
pub struct Hessians<'a> {
    /// U of each element.
    pub energies: &'a mut [f64],
    /// ∂U/∂x of each element: 3 N numbers.
    pub gradients: &'a mut [f64],
    /// The triangle of ∂²U/∂x² of each element: 9 · N (N + 1)/2 numbers.
    pub triangles: &'a mut [f64],
    /// The elements that met a condition, with which.
    pub flagged: Vec<(usize, Flags<f64>)>,
}

impl<E: Pack> BatchWork<E> for Hessians<'_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: &Batch<E, L::F64>) {
        let (first, count) = (batch.first, batch.count);
        let result = batch.element.hessian_at::<L>(&batch.points);
        result.value.store_ragged(&mut self.energies[first..first + count]);
        let gradient = result.gradient.as_ref().as_flattened();
        let stride = gradient.len();
        L::F64::store_transposed(gradient, count, &mut self.gradients[first * stride..], stride);
        let triangle = result.hessian.as_ref().as_flattened().as_flattened();
        let stride = triangle.len();
        L::F64::store_transposed(triangle, count, &mut self.triangles[first * stride..], stride);
        if result.flags.any() {
            let (degenerate, kink) = (result.flags.degenerate, result.flags.kink);
            let flags = (0..count).map(|lane| Flags { degenerate: degenerate.lane(lane), kink: kink.lane(lane) });
            self.flagged.extend((first..).zip(flags).filter(|(_, flags)| flags.any()));
        }
    }
}
