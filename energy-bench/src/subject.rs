//! What a kernel is: inputs, and the ways to compute its derivatives.

use std::fmt::Debug;

use energy_dsl::{Array, Declaration, Lane, Level, OperationCount, Real};

use crate::assembled::Assembled;
use crate::random::Random;
use crate::sample::{Answer, Sample};
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

    /// The textbook formula over num-dual's dual numbers: value, gradient and full Hessian (or Jacobian), flattened as
    /// the library's results are.
    fn dual(textbook: &[f64]) -> Self::HandAnswer<f64>;

    /// The same without compensation, where the library's element has it.
    #[must_use]
    fn uncompensated(_samples: &[Sample]) -> Option<Uncompensated> {
        None
    }

    /// The element moved to within [`STRAIN`](crate::accuracy::STRAIN) of its rest, if it has one where differences
    /// cancel.
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

/// `count` elements of a kernel, the same in every run.
#[must_use]
pub fn samples<K: Subject>(count: usize) -> Vec<Sample> {
    let mut random = Random::new(20);
    (0..count).map(|_| K::sample(&mut random)).collect()
}
