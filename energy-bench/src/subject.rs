//! What a kernel is: inputs, and the ways to compute its derivatives.

use std::fmt::Debug;

use energy_dsl::{
    Array, Block, Declaration, Element, Hessian, Lane, Level, OperationCount, PackedPotential, PackedResidual,
    Potential, Real, Residual, ResidualJacobian, Stored, Vector3,
};

use crate::assembled::Assembled;
use crate::random::Random;
use crate::uncompensated::Uncompensated;

/// A kernel: one element of the library, and the same derivatives by other means.
pub trait Subject: Debug + 'static {
    /// Its short name, `K1` to `K5`.
    const KEY: &'static str;
    /// What it is.
    const TITLE: &'static str;
    /// The library's declaration.
    const DECLARATION: &'static Declaration;
    /// The library's routine that is measured.
    const ROUTINE: &'static str;

    /// The library's element.
    type Element: 'static;
    /// What hand-derived code reads: numbers prepared once for an element, then its unknowns.
    type Hand<T: Copy>: Array<T>;
    /// What hand-derived code returns.
    type HandAnswer<T: Real>: Answer<T>;
    /// What the library returns.
    type LibraryAnswer<T: Real>: Answer<T>;

    /// A random, well-conditioned element.
    fn sample(random: &mut Random) -> Sample;

    /// Hand-derived code.
    fn hand<T: Real, L: Level>(x: &Self::Hand<T>) -> Self::HandAnswer<T>;

    /// How many numbers the library reads: the element's own, then its unknowns.
    fn library_numbers() -> usize;

    /// The library at level `L`, on numbers at 0, `stride`, 2 `stride`, …, as many side by side as `V` has lanes.
    fn library<S: Real, V: Lane<S>, L: Level>(numbers: &[S], stride: usize) -> Self::LibraryAnswer<V>;

    /// The library's element, of its own numbers and possibly more.
    fn element(numbers: &[f64]) -> Self::Element;

    /// The library by its plain method, which dispatches at every call.
    fn library_plain(element: &Self::Element, unknowns: &[f64]) -> Self::LibraryAnswer<f64>;

    /// [`Self::library_plain`] written to where the result is wanted.
    fn library_plain_into(element: &Self::Element, unknowns: &[f64], result: &mut Self::LibraryAnswer<f64>);

    /// The textbook formula over num-dual's dual numbers: value, gradient and full Hessian (or Jacobian), flattened as the
    /// library's results are.
    fn dual(textbook: &[f64]) -> Self::HandAnswer<f64>;

    /// The same without compensation, where the library's element has it.
    #[must_use]
    fn uncompensated(_samples: &[Sample]) -> Option<Uncompensated> {
        None
    }

    /// The element moved to within [`STRAIN`](crate::accuracy::STRAIN) of its rest, if it has one where differences cancel.
    #[must_use]
    fn near_rest(_sample: &Sample) -> Option<Sample> {
        None
    }

    /// All elements by way of vertices, where the kernel is a potential of points.
    fn assembled(samples: &[Sample]) -> Option<Assembled>;

    /// The operations of the library's routine.
    #[must_use]
    fn operations() -> OperationCount {
        let routines = Self::DECLARATION.routines;
        routines.iter().find(|routine| routine.name == Self::ROUTINE).map_or_else(Default::default, |r| r.full)
    }
}

/// One element in the form each contender reads. What a rest shape determines is computed beforehand for all of them.
#[derive(Clone, Debug)]
pub struct Sample {
    /// For the library: the element's own numbers, then its unknowns.
    pub library: Vec<f64>,
    /// The unknowns alone.
    pub unknowns: Vec<f64>,
    /// For hand-derived code; see [`Subject::Hand`].
    pub hand: Vec<f64>,
    /// For the textbook formula, which dual numbers and computer algebra differentiate.
    pub textbook: Vec<f64>,
}

impl Sample {
    /// From an element and what it is evaluated on.
    pub(crate) fn new<E: Stored<f64>>(element: &E, unknowns: &[f64], hand: Vec<f64>, textbook: Vec<f64>) -> Self {
        let mut library = vec![0.0; E::NUMBERS];
        element.store(&mut library, 1);
        library.extend_from_slice(unknowns);
        Self { library, unknowns: unknowns.to_vec(), hand, textbook }
    }
}

/// `count` elements of a kernel, the same in every run.
#[must_use]
pub fn samples<K: Subject>(count: usize) -> Vec<Sample> {
    let mut random = Random::new(20);
    (0..count).map(|_| K::sample(&mut random)).collect()
}

/// A result with derivatives.
pub trait Answer<T>: Copy {
    /// Value, gradient and triangle of Hessian blocks (or residual and Jacobian), one after the other.
    fn numbers(&self) -> Vec<T>;
}

/// The result of hand-derived code: what the library returns, without flags.
#[derive(Clone, Copy, Debug)]
pub struct Derivatives<T, const POINTS: usize, const BLOCKS: usize> {
    /// U.
    pub value: T,
    /// ∂U/∂x.
    pub gradient: [Vector3<T>; POINTS],
    /// The triangle of ∂²U/∂x².
    pub hessian: [Block<T>; BLOCKS],
}

impl<T: Copy, const POINTS: usize, const BLOCKS: usize> Answer<T> for Derivatives<T, POINTS, BLOCKS> {
    fn numbers(&self) -> Vec<T> {
        let blocks = self.hessian.as_flattened().as_flattened();
        [&[self.value], self.gradient.as_flattened(), blocks].concat()
    }
}

impl<T: Real, Points: Array<Vector3<T>>, Triangle: Array<Block<T>>> Answer<T> for Hessian<T, Points, Triangle> {
    fn numbers(&self) -> Vec<T> {
        let blocks = self.hessian.as_ref().as_flattened().as_flattened();
        [&[self.value], self.gradient.as_ref().as_flattened(), blocks].concat()
    }
}

/// The result of hand-derived code for a residual.
#[derive(Clone, Copy, Debug)]
pub struct Row<T, const UNKNOWNS: usize> {
    /// r.
    pub value: T,
    /// ∂r/∂u.
    pub jacobian: [T; UNKNOWNS],
}

impl<T: Copy, const UNKNOWNS: usize> Answer<T> for Row<T, UNKNOWNS> {
    fn numbers(&self) -> Vec<T> {
        [&[self.value], self.jacobian.as_slice()].concat()
    }
}

impl<T: Real, Rows: Array<T>, Jacobian: Array<T>> Answer<T> for ResidualJacobian<T, Rows, Jacobian> {
    fn numbers(&self) -> Vec<T> {
        [self.value.as_ref(), self.jacobian.as_ref()].concat()
    }
}

/// What a potential over lanes returns.
type WideHessian<E, S, V> = Hessian<
    V,
    <<E as PackedPotential<S>>::Wide<V> as Potential<V>>::Points,
    <<E as PackedPotential<S>>::Wide<V> as Potential<V>>::Triangle,
>;

/// A potential of the library, read from numbers.
#[inline(always)]
pub(crate) fn potential<S: Real, E: PackedPotential<S>, V: Lane<S>, L: Level>(
    numbers: &[S],
    stride: usize,
) -> WideHessian<E, S, V> {
    let zero = V::splat(S::from_f64(0.0));
    let element = E::load::<V>(numbers, stride);
    let mut points = <<E::Wide<V> as Potential<V>>::Points as Array<Vector3<V>>>::repeat([zero; 3]);
    for (i, number) in points.as_mut().as_flattened_mut().iter_mut().enumerate() {
        *number = V::load(&numbers[(E::NUMBERS + i) * stride..]);
    }
    element.hessian_at::<L>(&points)
}

/// What a residual over lanes returns.
type WideJacobian<E, S, V> = ResidualJacobian<
    V,
    <<E as PackedResidual<S>>::Wide<V> as Residual<V>>::Rows,
    <<E as PackedResidual<S>>::Wide<V> as Residual<V>>::Jacobian,
>;

/// A residual of the library, read from numbers.
#[inline(always)]
pub(crate) fn residual<S: Real, E: PackedResidual<S>, V: Lane<S>, L: Level>(
    numbers: &[S],
    stride: usize,
) -> WideJacobian<E, S, V> {
    let zero = V::splat(S::from_f64(0.0));
    let element = E::load::<V>(numbers, stride);
    let mut unknowns = <<E::Wide<V> as Residual<V>>::Unknowns as Array<V>>::repeat(zero);
    for (i, number) in unknowns.as_mut().iter_mut().enumerate() {
        *number = V::load(&numbers[(E::NUMBERS + i) * stride..]);
    }
    element.jacobian_at::<L>(&unknowns)
}

/// The numbers of an element and of its unknowns.
pub(crate) fn number_count<E: Stored<f64>>() -> usize {
    E::NUMBERS + <E as Element>::DECLARATION.points.iter().map(|field| field.size).sum::<usize>()
}

/// The points that unknowns are the coordinates of, where they are.
pub(crate) fn points<const N: usize>(unknowns: &[f64]) -> &[Vector3<f64>; N] {
    let (points, _) = unknowns.as_chunks();
    points.try_into().expect("three numbers a point")
}
