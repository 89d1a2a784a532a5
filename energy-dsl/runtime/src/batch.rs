//! Evaluation of many elements of one type: parameters and stencils are packed into lanes once, points are gathered,
//! results unpacked.
//!
//! A *batch* holds one element per lane. Surplus lanes of the last batch repeat the last element, so they add no flags;
//! their results are not written.

use std::marker::PhantomData;
use std::ops::Range;

use crate::aligned::Aligned;
use crate::array::Array;
use crate::element::{Element, ForceLaw, Potential, ReducedPotential, Residual, Vector3};
use crate::numbers::Flags;
use crate::numbers::{Kernel, Lane, Level, dispatch};
use crate::numbers::{Mask, Real};

/// Elements in a packed block: the number of `f32` lanes in the widest register.
pub const BLOCK: usize = 16;

/// Elements that can be stored as plain numbers.
pub trait Stored<S: Real>: Element {
    /// Numbers per element: its parameters and what its rest shape determines.
    const NUMBERS: usize;

    /// Writes the numbers to indices 0, `stride`, 2 `stride`, ….
    fn store(&self, numbers: &mut [S], stride: usize);
}

macro_rules! packed {
    ($(#[$docs:meta])* $name:ident: $of:ident, $wide:ident) => {
        $(#[$docs])*
        pub trait $name<S: Real>: Stored<S> + $of<S> {
            /// The element over lanes `V`.
            type Wide<V: Lane<S>>: $wide<V>;

            /// Reads one element per lane. The numbers of consecutive elements are adjacent; those of one element are
            /// `stride` apart.
            fn load<V: Lane<S>>(numbers: &[S], stride: usize) -> Self::Wide<V>;
        }
    };
}

packed!(
    /// Potentials that run over lanes.
    PackedPotential: Potential, ReducedPotential
);
packed!(
    /// Forces that run over lanes.
    PackedForce: ForceLaw, ForceLaw
);
packed!(
    /// Residuals that run over lanes.
    PackedResidual: Residual, Residual
);

/// The points of a potential over lanes `V`.
pub type WidePoints<E, V, S = f64> = <<E as PackedPotential<S>>::Wide<V> as Potential<V>>::Points;

/// Elements of one type with their stencils, as a structure of arrays. Blocks hold [`BLOCK`] elements, number by
/// number.
#[derive(Clone, Debug)]
pub struct Packed<E, S = f64> {
    elements: usize,
    points: usize,
    /// One more than the largest vertex index.
    reach: usize,
    /// Indexed by block, number, element.
    numbers: Aligned<S>,
    /// Indexed by block, point, element.
    stencils: Vec<u32>,
    of: PhantomData<E>,
}

impl<S: Real, E: Stored<S>> Packed<E, S> {
    /// Packs elements; element i acts on the points `stencils[i]`.
    ///
    /// # Panics
    /// When there are not as many stencils as elements.
    #[must_use]
    pub fn new<const N: usize>(elements: &[E], stencils: &[[u32; N]]) -> Self {
        assert_eq!(elements.len(), stencils.len(), "every element needs a stencil");
        Self::from_fn(elements.len(), N, |element| &elements[element], |element, point| stencils[element][point])
    }

    /// Packs `count` elements with `points` points each. Element i is `element(i)`; its point p is `vertex(i, p)`.
    pub fn from_fn<'a>(
        count: usize,
        points: usize,
        element: impl Fn(usize) -> &'a E,
        vertex: impl Fn(usize, usize) -> u32,
    ) -> Self
    where
        E: 'a,
    {
        let blocks = count.div_ceil(BLOCK);
        let mut packed = Self {
            elements: count,
            points,
            reach: 0,
            numbers: Aligned::new(blocks * E::NUMBERS * BLOCK, S::from_f64(0.0)),
            stencils: vec![0; blocks * points * BLOCK],
            of: PhantomData,
        };
        for place in 0..blocks * BLOCK {
            let repeated = place.min(count - 1);
            packed.write(place, element(repeated));
            for point in 0..points {
                let vertex = vertex(repeated, point);
                packed.reach = packed.reach.max(vertex as usize + 1);
                packed.stencils[(place / BLOCK * points + point) * BLOCK + place % BLOCK] = vertex;
            }
        }
        packed
    }

    /// Returns the number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.elements
    }

    /// Returns whether there are no elements.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.elements == 0
    }

    /// Returns the vertex indices of all elements, in blocks of [`BLOCK`] elements, point by point. The last block is
    /// padded with its last element.
    #[must_use]
    pub fn stencils(&self) -> &[u32] {
        &self.stencils
    }

    /// Returns the numbers from lane `offset` of a block on; an empty slice if elements have no parameters.
    #[inline(always)]
    fn numbers_from(&self, block: usize, offset: usize) -> &[S] {
        if E::NUMBERS == 0 { &[] } else { &self.numbers[block * E::NUMBERS * BLOCK + offset..] }
    }

    /// Replaces an element and keeps its stencil.
    ///
    /// # Panics
    /// When there is no such element.
    pub fn set(&mut self, element: usize, to: &E) {
        assert!(element < self.elements, "element {element} of {}", self.elements);
        self.write(element, to);
        if element + 1 == self.elements {
            for place in self.elements..self.elements.next_multiple_of(BLOCK) {
                self.write(place, to);
            }
        }
    }

    fn write(&mut self, place: usize, element: &E) {
        if E::NUMBERS > 0 {
            element.store(&mut self.numbers[place / BLOCK * E::NUMBERS * BLOCK + place % BLOCK..], BLOCK);
        }
    }
}

impl<S: Real + Lane<S>, E: PackedPotential<S>> Packed<E, S> {
    /// Returns one element, unpacked.
    ///
    /// # Panics
    /// When there is no such element.
    #[must_use]
    pub fn element(&self, element: usize) -> E::Wide<S> {
        assert!(element < self.elements, "element {element} of {}", self.elements);
        E::load::<S>(self.numbers_from(element / BLOCK, element % BLOCK), BLOCK)
    }
}

/// One element per lane, with its points.
pub struct Batch<'a, E: PackedPotential<f64>, V: Lane<f64>> {
    /// Index of the first element.
    pub first: usize,
    /// Number of elements: one per lane, or fewer in the last batch.
    pub count: usize,
    /// The elements, one per lane.
    pub element: &'a E::Wide<V>,
    /// The points of the elements.
    pub points: &'a WidePoints<E, V>,
    /// Vertex indices of the block, from the first element of the batch on.
    stencils: &'a [u32],
}

impl<'a, E: PackedPotential<f64>, V: Lane<f64>> Batch<'a, E, V> {
    /// Returns the vertex index of point `point` of each element.
    #[inline(always)]
    #[must_use]
    pub fn vertices(&self, point: usize) -> &'a [u32] {
        &self.stencils[point * BLOCK..][..V::LANES]
    }
}

/// Work on each batch of a list of elements.
pub trait BatchWork<E: PackedPotential<f64>> {
    /// Processes one batch. Mark implementations `#[inline(always)]` and avoid closures in hot code: only inlined code
    /// is compiled for the SIMD level.
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>);
}

/// Runs `work` on all elements, in batches, at the best SIMD level of the machine.
///
/// # Panics
/// When a stencil has a point that is not among `positions`.
pub fn for_each_batch<E: PackedPotential<f64>>(
    elements: &Packed<E>,
    positions: &[Vector3<f64>],
    work: &mut impl BatchWork<E>,
) {
    for_each_batch_in(elements, 0..elements.len(), positions, work);
}

/// Runs `work` on a range of elements. The range starts at a multiple of [`BLOCK`].
///
/// # Panics
/// When a stencil has a point that is not among `positions`, or the range begins elsewhere, or ends after the last
/// element.
pub fn for_each_batch_in<E: PackedPotential<f64>>(
    elements: &Packed<E>,
    range: Range<usize>,
    positions: &[Vector3<f64>],
    work: &mut impl BatchWork<E>,
) {
    dispatch(Batches { elements, range, positions, work });
}

/// The kernel behind [`for_each_batch`], for callers that choose the SIMD level themselves.
#[derive(Debug)]
pub struct Batches<'a, E, W> {
    /// The elements with their stencils.
    pub elements: &'a Packed<E>,
    /// The elements to process; the range starts at a multiple of [`BLOCK`].
    pub range: Range<usize>,
    /// Positions of all vertices.
    pub positions: &'a [Vector3<f64>],
    /// Called for each batch.
    pub work: &'a mut W,
}

impl<E: PackedPotential<f64>, W: BatchWork<E>> Kernel for Batches<'_, E, W> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { elements: packed, range, positions, work } = self;
        let n = <E::Points as Array<Vector3<f64>>>::LEN;
        assert_eq!(packed.points, n, "a stencil has as many points as the element");
        assert!(packed.reach <= positions.len(), "point {} of {}", packed.reach, positions.len());
        assert!(range.start % BLOCK == 0 && range.end <= packed.elements, "{range:?} of {} elements", packed.elements);
        let lanes = <L::F64 as Lane<f64>>::LANES;
        let mut first = range.start;
        while first < range.end {
            let (block, offset) = (first / BLOCK, first % BLOCK);
            let element = E::load::<L::F64>(packed.numbers_from(block, offset), BLOCK);
            let mut points = <WidePoints<E, L::F64> as Array<Vector3<L::F64>>>::repeat([L::F64::splat(0.0); 3]);
            for (point, wide) in points.as_mut().iter_mut().enumerate() {
                *wide = L::F64::gather(positions, &packed.stencils[(block * n + point) * BLOCK + offset..][..lanes]);
            }
            let count = lanes.min(range.end - first);
            let stencils = &packed.stencils[block * n * BLOCK + offset..];
            work.batch::<L>(Batch { first, count, element: &element, points: &points, stencils });
            first += lanes;
        }
    }
}

/// Work that stores energies, gradients and Hessians element by element, for [`for_each_batch`].
///
/// To get slices of numbers from slices of arrays, use `as_flattened_mut`.
#[derive(Debug)]
pub struct Hessians<'a> {
    /// U of each element.
    pub energies: &'a mut [f64],
    /// ∂U/∂x of each element: 3 N numbers.
    pub gradients: &'a mut [f64],
    /// The triangle of ∂²U/∂x² of each element: 9 · N (N + 1)/2 numbers.
    pub triangles: &'a mut [f64],
    /// Index and flags of each flagged element.
    pub flagged: Vec<(usize, Flags<f64>)>,
}

impl<E: PackedPotential<f64>> BatchWork<E> for Hessians<'_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        let (first, count) = (batch.first, batch.count);
        let result = batch.element.hessian_at::<L>(batch.points);
        result.value.store_ragged(&mut self.energies[first..first + count]);
        let gradient = result.gradient.as_ref().as_flattened();
        let stride = gradient.len();
        L::F64::store_transposed(gradient, count, &mut self.gradients[first * stride..], stride);
        let triangle = result.hessian.as_ref().as_flattened().as_flattened();
        let stride = triangle.len();
        L::F64::store_transposed(triangle, count, &mut self.triangles[first * stride..], stride);
        if result.flags.any() {
            note_flags(&mut self.flagged, first, count, result.flags.degenerate, result.flags.kink);
        }
    }
}

/// Not inlined: flags are rare.
#[cold]
#[inline(never)]
fn note_flags<M: Mask>(flagged: &mut Vec<(usize, Flags<f64>)>, first: usize, count: usize, degenerate: M, kink: M) {
    let flags = (0..count).map(|lane| Flags { degenerate: degenerate.lane(lane), kink: kink.lane(lane) });
    flagged.extend((first..).zip(flags).filter(|(_, flags)| flags.any()));
}
