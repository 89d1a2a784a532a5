//! The loops that are measured: all elements in, results written to a buffer of a few elements that stays in the cache, so
//! that arithmetic is compared and not memory.

use std::fmt::Debug;
use std::hint::black_box;
use std::marker::PhantomData;

use energy_dsl::{Aligned, Array, Baseline, Kernel, Lane, Level, Number, Real};

use crate::subject::{Answer, Sample, Subject};

/// How many elements' results the buffer holds.
pub const TOGETHER: usize = 16;

/// Work on all elements.
pub type Work = Box<dyn FnMut()>;

/// One element at a time, or as many as there are lanes.
pub trait Width: Debug + 'static {
    /// A number of which there are several.
    type Scalar: Real;
    /// What is computed with at a level.
    type Number<L: Level>: Lane<Self::Scalar>;
}

macro_rules! width {
    ($(#[$docs:meta])* $name:ident: $scalar:ty, $number:ty) => {
        $(#[$docs])*
        #[derive(Clone, Copy, Debug)]
        pub struct $name;

        impl Width for $name {
            type Scalar = $scalar;
            type Number<L: Level> = $number;
        }
    };
}

width!(
    /// One double.
    One: f64, f64
);
width!(
    /// Lanes of doubles.
    Doubles: f64, L::F64
);
width!(
    /// Lanes of single-precision numbers.
    Singles: f32, L::F32
);

/// How many lanes there are at the level of the kernel.
struct Lanes<W>(PhantomData<W>);

impl<W: Width> Kernel for Lanes<W> {
    type Output = usize;

    #[inline(always)]
    fn run<L: Level>(self) -> usize {
        <W::Number<L> as Lane<W::Scalar>>::LANES
    }
}

/// The lanes of a width at a level; nothing if the machine has no such level.
#[must_use]
pub fn lanes<W: Width>(level: energy_dsl::LevelName) -> Option<usize> {
    energy_dsl::dispatch_at(level, Lanes::<W>(PhantomData))
}

/// Elements side by side: number by number, `width` elements together. With a width of one, an array of structs.
#[must_use]
pub fn packed<S: Real>(samples: &[Sample], width: usize, of: impl Fn(&Sample) -> &[f64]) -> Aligned<S> {
    let mut numbers = Vec::new();
    for block in samples.chunks_exact(width) {
        for i in 0..of(&block[0]).len() {
            numbers.extend(block.iter().map(|sample| S::from_f64(of(sample)[i])));
        }
    }
    Aligned::from(numbers.as_slice())
}

#[inline(always)]
fn hand<K: Subject, S: Real, V: Lane<S>, L: Level>(numbers: &[S]) -> K::HandAnswer<V> {
    let mut x = <K::Hand<V> as Array<V>>::repeat(V::splat(S::from_f64(0.0)));
    for (i, x) in x.as_mut().iter_mut().enumerate() {
        *x = V::load(&numbers[i * V::LANES..]);
    }
    K::hand::<V, L>(&x)
}

/// The loop over blocks of `size` numbers, each of as many elements as `lanes`.
macro_rules! each_block {
    ($numbers:expr, $size:expr, $lanes:expr, |$block:ident| $call:expr) => {{
        let (numbers, size) = ($numbers, $size);
        let first = {
            let $block = &numbers[..size];
            $call
        };
        let mut results = vec![first; $crate::run::TOGETHER / $lanes];
        for group in numbers.chunks(size * ($crate::run::TOGETHER / $lanes)) {
            for ($block, result) in group.chunks_exact(size).zip(&mut results) {
                *result = $call;
            }
            std::hint::black_box(&mut results);
        }
    }};
}

pub(crate) use each_block;

/// Hand-derived code on all elements, [`packed`] for the lanes of the level.
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

/// The library's routine at the level, on all elements, [`packed`] for its lanes.
#[derive(Debug)]
pub struct Library<'a, K, W: Width>(pub &'a [W::Scalar], pub PhantomData<K>);

impl<K: Subject, W: Width> Kernel for Library<'_, K, W> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let lanes = <W::Number<L> as Lane<W::Scalar>>::LANES;
        let size = K::library_numbers() * lanes;
        each_block!(self.0, size, lanes, |block| K::library::<W::Scalar, W::Number<L>, L>(block, lanes));
    }
}

/// The library's plain method on all elements, with the unknowns of all one after the other.
pub fn library_plain<K: Subject>(elements: &[K::Element], unknowns: &[f64]) {
    call_each(elements, unknowns, K::library_plain, K::library_plain_into);
}

/// A call for each element, after one that makes room for results.
pub(crate) fn call_each<E, A: Clone>(
    elements: &[E],
    unknowns: &[f64],
    first: impl Fn(&E, &[f64]) -> A,
    call: impl Fn(&E, &[f64], &mut A),
) {
    let size = unknowns.len() / elements.len();
    let mut results = vec![first(&elements[0], &unknowns[..size]); TOGETHER];
    for (elements, unknowns) in elements.chunks(TOGETHER).zip(unknowns.chunks(size * TOGETHER)) {
        for ((element, unknowns), result) in elements.iter().zip(unknowns.chunks_exact(size)).zip(&mut results) {
            call(element, unknowns, result);
        }
        black_box(&mut results);
    }
}

/// Hand-derived code on one element, for [`Number::dispatch`]: at the level that the library's plain methods run at.
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

/// Hand-derived code on all elements, a call each.
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

/// Dual numbers on all elements, `size` numbers each.
pub fn dual<K: Subject>(numbers: &[f64], size: usize) {
    each_block!(numbers, size, 1, |block| K::dual(block));
}

/// All results, element by element, of hand-derived code or of the library: what is checked, in a kernel so that it is the
/// code that is measured.
#[derive(Debug)]
pub struct Collect<'a, K, W: Width> {
    /// The elements, [`packed`].
    pub numbers: &'a [W::Scalar],
    /// Hand-derived code or the library.
    pub hand: bool,
    /// Which kernel.
    pub of: PhantomData<K>,
}

impl<K: Subject, W: Width> Kernel for Collect<'_, K, W> {
    type Output = Vec<Vec<W::Scalar>>;

    #[inline(always)]
    fn run<L: Level>(self) -> Self::Output {
        let lanes = <W::Number<L> as Lane<W::Scalar>>::LANES;
        let size = if self.hand { <K::Hand<f64> as Array<f64>>::LEN } else { K::library_numbers() };
        let mut all = Vec::new();
        for block in self.numbers.chunks_exact(size * lanes) {
            let answer = if self.hand {
                hand::<K, W::Scalar, W::Number<L>, L>(block).numbers()
            } else {
                K::library::<W::Scalar, W::Number<L>, L>(block, lanes).numbers()
            };
            for lane in 0..lanes {
                all.push(answer.iter().map(|number| number.extract(lane)).collect());
            }
        }
        all
    }
}
