//! Elements of one type, packed for lanes.

use std::marker::PhantomData;
use std::ops::Range;

use super::error::BatchError;
use crate::aligned::Aligned;
use crate::array::Array;
use crate::element::{Element, ForceLaw, MixedPotential, Potential, ReducedPotential, Residual, Vector3};
use crate::numbers::{Lane, Real};

/// Elements in a packed block: the number of `f32` lanes in the widest register.
pub const BLOCK: usize = 16;

/// Elements that can be stored as plain numbers.
pub trait Stored<S: Real>: Element {
    /// Numbers per element: its parameters and those that its rest shape determines.
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
packed!(
    /// Potentials of mixed unknowns that run over lanes.
    PackedMixed: MixedPotential, MixedPotential
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
    /// Packs elements; element i acts on the points `stencils[i]`. The stencil of a residual, or of a potential of
    /// mixed unknowns, has one index per number of its unknowns.
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

    /// Returns the elements with these indices, in this order.
    #[must_use]
    pub fn selected(&self, indices: &[usize]) -> Self {
        let blocks = indices.len().div_ceil(BLOCK);
        let mut numbers = Aligned::new(blocks * E::NUMBERS * BLOCK, S::from_f64(0.0));
        let mut stencils = vec![0; blocks * self.points * BLOCK];
        for place in 0..blocks * BLOCK {
            let index = indices[place.min(indices.len() - 1)];
            let (from, to) = (index / BLOCK, place / BLOCK);
            for number in 0..E::NUMBERS {
                numbers[(to * E::NUMBERS + number) * BLOCK + place % BLOCK] =
                    self.numbers[(from * E::NUMBERS + number) * BLOCK + index % BLOCK];
            }
            for point in 0..self.points {
                stencils[(to * self.points + point) * BLOCK + place % BLOCK] =
                    self.stencils[(from * self.points + point) * BLOCK + index % BLOCK];
            }
        }
        Self { elements: indices.len(), points: self.points, reach: self.reach, numbers, stencils, of: PhantomData }
    }

    /// Returns the number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.elements
    }

    /// Returns whether it is empty.
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

    /// Returns how many elements each of `parts` threads should process: a multiple of [`BLOCK`], so that ranges
    /// `i * n..(i + 1) * n` and the chunks of the outputs fit each other. Never 0.
    #[must_use]
    pub fn chunk_len(&self, parts: usize) -> usize {
        self.elements.div_ceil(parts.max(1)).next_multiple_of(BLOCK).max(BLOCK)
    }

    /// Checks a range, the size of the stencils and the number of places that they refer to.
    pub(super) fn check(&self, range: &Range<usize>, stencil: usize, given: usize) -> Result<(), BatchError> {
        if self.points != stencil {
            return Err(BatchError::Stencil { needed: stencil, given: self.points });
        }
        if self.reach > given {
            return Err(BatchError::Missing { needed: self.reach, given });
        }
        let within = range.start <= range.end && range.end <= self.elements;
        if within && range.start.is_multiple_of(BLOCK) {
            Ok(())
        } else {
            Err(BatchError::Range { range: range.clone(), elements: self.elements, block: BLOCK })
        }
    }

    /// Returns the vertex indices of a block, from the element at `offset` on: those of point p begin at p · [`BLOCK`].
    #[inline(always)]
    pub(super) fn stencils_from(&self, block: usize, offset: usize) -> &[u32] {
        &self.stencils[block * self.points * BLOCK + offset..]
    }

    /// Gathers the points of the elements in a block, one element per lane, from the one at `offset` on.
    #[inline(always)]
    pub(super) fn gather<V: Lane<S>, P: Array<Vector3<V>>>(
        &self,
        block: usize,
        offset: usize,
        positions: &[Vector3<S>],
    ) -> P {
        let mut points = P::repeat([V::from_f64(0.0); 3]);
        for (point, wide) in points.as_mut().iter_mut().enumerate() {
            let first = (block * P::LEN + point) * BLOCK + offset;
            *wide = V::gather(positions, &self.stencils[first..][..V::LANES]);
        }
        points
    }

    /// Returns the numbers from lane `offset` of a block on; an empty slice if elements have no parameters.
    #[inline(always)]
    pub(super) fn numbers_from(&self, block: usize, offset: usize) -> &[S] {
        if E::NUMBERS == 0 { &[] } else { &self.numbers[block * E::NUMBERS * BLOCK + offset..] }
    }

    /// Replaces an element and keeps its stencil.
    ///
    /// # Panics
    /// If `index` is not below the number of elements.
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
    /// If `index` is not below the number of elements.
    #[must_use]
    pub fn element(&self, element: usize) -> E::Wide<S> {
        assert!(element < self.elements, "element {element} of {}", self.elements);
        E::load::<S>(self.numbers_from(element / BLOCK, element % BLOCK), BLOCK)
    }
}

/// Gathers unknowns, one element per lane, from the stencils of a block's elements.
#[inline(always)]
pub(super) fn gather_numbers<S: Real, V: Lane<S>, U: Array<V>>(stencils: &[u32], unknowns: &[S]) -> U {
    let mut wide = U::repeat(V::from_f64(0.0));
    for (number, wide) in wide.as_mut().iter_mut().enumerate() {
        let indices = &stencils[number * BLOCK..][..V::LANES];
        *wide = V::from_fn(|lane| unknowns[indices[lane] as usize]);
    }
    wide
}
