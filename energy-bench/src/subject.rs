//! The interface of a kernel: random inputs, and its derivatives by each contender.

use std::fmt::Debug;

use energy_dsl::{Array, Declaration, Lane, Level, OperationCount, Real};

use crate::assembled::Assembled;
use crate::random::Random;
use crate::sample::Coincident;
use crate::sample::{Answer, Sample};
use crate::uncompensated::Uncompensated;

/// A kernel: a declared element, and the same derivatives by other means.
pub trait Subject: Debug + 'static {
    /// Short name, `K1` to `K5`.
    const KEY: &'static str;
    /// Name of the potential.
    const TITLE: &'static str;
    /// Declaration of the element.
    const DECLARATION: &'static Declaration;
    /// Name of the generated routine that is measured.
    const ROUTINE: &'static str;

    /// Type of the declared element.
    type Element: 'static;
    /// Input of hand-derived code: precomputed numbers of the element, then its unknowns.
    type Hand<T: Copy>: Array<T>;
    /// Result of hand-derived code.
    type HandAnswer<T: Real>: Answer<T>;
    /// Result of generated code.
    type GeneratedAnswer<T: Real>: Answer<T>;

    /// Returns a random, well-conditioned element.
    fn sample(random: &mut Random) -> Sample;

    /// Evaluates hand-derived code.
    fn hand<T: Real, L: Level>(x: &Self::Hand<T>) -> Self::HandAnswer<T>;

    /// Length of [`Sample::generated`]: parameters and unknowns.
    fn generated_numbers() -> usize;

    /// Evaluates generated code at level `L` on as many elements as `V` has lanes. Element numbers are `stride` apart
    /// in `numbers`.
    fn generated<S: Real, V: Lane<S>, L: Level>(numbers: &[S], stride: usize) -> Self::GeneratedAnswer<V>;

    /// Creates the element from its parameters; further numbers are ignored.
    fn element(numbers: &[f64]) -> Self::Element;

    /// Calls the generated plain method, which dispatches at every call.
    fn generated_plain(element: &Self::Element, unknowns: &[f64]) -> Self::GeneratedAnswer<f64>;

    /// Calls the generated plain method that writes its result to `result`.
    fn generated_plain_into(element: &Self::Element, unknowns: &[f64], result: &mut Self::GeneratedAnswer<f64>);

    /// Evaluates the textbook formula over dual numbers: value, gradient and Hessian (or residual and Jacobian).
    fn dual(textbook: &[f64]) -> Self::HandAnswer<f64>;

    /// Returns the results and contenders of the uncompensated element; `None` if compensation does not apply to the
    /// kernel.
    #[must_use]
    fn uncompensated(_samples: &[Sample]) -> Option<Uncompensated> {
        None
    }

    /// Returns the element within [`STRAIN`](crate::near_rest::STRAIN) of its rest shape; `None` if nothing cancels
    /// there.
    #[must_use]
    fn near_rest(_sample: &Sample) -> Option<Sample> {
        None
    }

    /// Returns the element with coincident points (K5: without rotation), and its documented result.
    #[must_use]
    fn coincident(sample: &Sample) -> Coincident;

    /// Places all elements on vertices; `None` if the kernel is not a potential of points.
    fn assembled(samples: &[Sample]) -> Option<Assembled>;

    /// Returns the operation count of the generated routine.
    #[must_use]
    fn operations() -> OperationCount {
        let routines = &Self::DECLARATION.routines;
        routines.iter().find(|routine| routine.name == Self::ROUTINE).map_or_else(Default::default, |r| r.full)
    }
}

/// Returns `count` random elements of a kernel, the same in every run.
#[must_use]
pub fn samples<K: Subject>(count: usize) -> Vec<Sample> {
    let mut random = Random::new(20);
    (0..count).map(|_| K::sample(&mut random)).collect()
}
