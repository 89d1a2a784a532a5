//! The measured loops: one kernel's routine on all elements.

use std::hint::black_box;
use std::marker::PhantomData;

use energy_dsl::{Array, Baseline, Kernel, Lane, Level, Number, Real};

use crate::sample::Answer;
use crate::subject::Subject;
use crate::work::{TOGETHER, Width, call_each, each_block};

#[inline(always)]
fn hand<K: Subject, S: Real, V: Lane<S>, L: Level>(numbers: &[S]) -> K::HandAnswer<V> {
    let mut x = <K::Hand<V> as Array<V>>::repeat(V::splat(S::from_f64(0.0)));
    for (i, x) in x.as_mut().iter_mut().enumerate() {
        *x = V::load(&numbers[i * V::LANES..]);
    }
    K::hand::<V, L>(&x)
}

/// Runs hand-derived code on all elements, [`packed`] for the lanes of the level.
#[derive(Debug)]
pub struct Hand<'a, K, W: Width>(pub &'a [W::Scalar], pub PhantomData<K>);

impl<K: Subject, W: Width> Kernel for Hand<'_, K, W> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let lanes = <W::Number<L> as Lane<W::Scalar>>::LANES;
        let size = <K::Hand<f64> as Array<f64>>::LEN * lanes;
        each_block!(self.0, size, lanes, |block| hand::<K, W::Scalar, W::Number<L>, L>(block));
    }
}

/// Runs generated code at a level on all elements, [`packed`] for its lanes.
#[derive(Debug)]
pub struct Generated<'a, K, W: Width>(pub &'a [W::Scalar], pub PhantomData<K>);

impl<K: Subject, W: Width> Kernel for Generated<'_, K, W> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let lanes = <W::Number<L> as Lane<W::Scalar>>::LANES;
        let size = K::generated_numbers() * lanes;
        each_block!(self.0, size, lanes, |block| K::generated::<W::Scalar, W::Number<L>, L>(block, lanes));
    }
}

/// Calls the generated plain method on each element. `unknowns` holds the unknowns of all elements, one after the
/// other.
pub fn generated_plain<K: Subject>(elements: &[K::Element], unknowns: &[f64]) {
    call_each(elements, unknowns, K::generated_plain, K::generated_plain_into);
}

/// Hand-derived code on one element, for [`Number::dispatch`], which the generated plain methods also call.
struct HandCall<'a, K: Subject> {
    numbers: &'a [f64],
    result: &'a mut K::HandAnswer<f64>,
}

impl<K: Subject> Kernel for HandCall<'_, K> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        *self.result = hand::<K, f64, f64, L>(self.numbers);
    }
}

/// Calls hand-derived code on each element.
pub fn hand_plain<K: Subject>(numbers: &[f64]) {
    let size = <K::Hand<f64> as Array<f64>>::LEN;
    let mut results = vec![hand::<K, f64, f64, Baseline>(&numbers[..size]); TOGETHER];
    for group in numbers.chunks(size * TOGETHER) {
        for (numbers, result) in group.chunks_exact(size).zip(&mut results) {
            f64::dispatch(HandCall::<K> { numbers, result });
        }
        black_box(&mut results);
    }
}

/// Evaluates the textbook formula over dual numbers on all elements, `size` numbers each.
pub fn dual<K: Subject>(numbers: &[f64], size: usize) {
    each_block!(numbers, size, 1, |block| K::dual(block));
}

/// Collects the results of all elements. It runs in a kernel, so that the checked code is the measured code.
#[derive(Debug)]
pub struct Collect<'a, K, W: Width> {
    /// The elements, [`packed`].
    pub numbers: &'a [W::Scalar],
    /// Whether to run hand-derived code instead of generated code.
    pub hand: bool,
    /// The kernel whose code runs.
    pub kernel: PhantomData<K>,
}

impl<K: Subject, W: Width> Kernel for Collect<'_, K, W> {
    type Output = Vec<Vec<W::Scalar>>;

    #[inline(always)]
    fn run<L: Level>(self) -> Self::Output {
        let lanes = <W::Number<L> as Lane<W::Scalar>>::LANES;
        let size = if self.hand { <K::Hand<f64> as Array<f64>>::LEN } else { K::generated_numbers() };
        let mut all = Vec::new();
        for block in self.numbers.chunks_exact(size * lanes) {
            let answer = if self.hand {
                hand::<K, W::Scalar, W::Number<L>, L>(block).numbers()
            } else {
                K::generated::<W::Scalar, W::Number<L>, L>(block, lanes).numbers()
            };
            for lane in 0..lanes {
                all.push(answer.iter().map(|number| number.extract(lane)).collect());
            }
        }
        all
    }
}
