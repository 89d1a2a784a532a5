//! Loops over all elements: results go to a buffer of a few elements that stays in the cache, so that arithmetic is
//! compared and not memory.

use std::fmt::Debug;
use std::hint::black_box;
use std::marker::PhantomData;

use energy_dsl::{Aligned, Kernel, Lane, Level, Real};

use crate::sample::Sample;

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

/// The loop over blocks of `size` numbers, each of as many elements as `lanes`.
macro_rules! each_block {
    ($numbers:expr, $size:expr, $lanes:expr, |$block:ident| $call:expr) => {{
        let (numbers, size) = ($numbers, $size);
        let first = {
            let $block = &numbers[..size];
            $call
        };
        let mut results = vec![first; $crate::work::TOGETHER / $lanes];
        for group in numbers.chunks(size * ($crate::work::TOGETHER / $lanes)) {
            for ($block, result) in group.chunks_exact(size).zip(&mut results) {
                *result = $call;
            }
            std::hint::black_box(&mut results);
        }
    }};
}

pub(crate) use each_block;

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
