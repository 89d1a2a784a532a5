//! Loops over all elements. Results go to a small buffer that stays in the cache: the benchmark compares arithmetic,
//! not memory bandwidth.

use std::fmt::Debug;
use std::hint::black_box;
use std::marker::PhantomData;

use energy_dsl::{Aligned, Kernel, Lane, Level, Real};

use crate::sample::Sample;

/// Number of elements whose results the buffer holds.
pub const TOGETHER: usize = 16;

/// One run over all elements.
pub type Work = Box<dyn FnMut()>;

/// Number of elements that a routine evaluates at once.
pub trait Width: Debug + 'static {
    /// Scalar type: `f64` or `f32`.
    type Scalar: Real;
    /// Number type of the routine at a level.
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
    /// One element in doubles.
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

/// Kernel that returns the number of lanes.
struct Lanes<W>(PhantomData<W>);

impl<W: Width> Kernel for Lanes<W> {
    type Output = usize;

    #[inline(always)]
    fn run<L: Level>(self) -> usize {
        <W::Number<L> as Lane<W::Scalar>>::LANES
    }
}

/// Returns the number of lanes at a level; `None` if the machine does not have that level.
#[must_use]
pub fn lanes<W: Width>(level: energy_dsl::LevelName) -> Option<usize> {
    energy_dsl::dispatch_at(level, Lanes::<W>(PhantomData))
}

/// Interleaves the inputs of `width` elements at a time: all first numbers, then all second numbers. A width of 1 gives
/// an array of structs.
#[must_use]
pub fn packed<S: Real>(samples: &[Sample], width: usize, numbers: impl Fn(&Sample) -> &[f64]) -> Aligned<S> {
    let mut all = Vec::new();
    for block in samples.chunks_exact(width) {
        for i in 0..numbers(&block[0]).len() {
            all.extend(block.iter().map(|sample| S::from_f64(numbers(sample)[i])));
        }
    }
    Aligned::from(all.as_slice())
}

/// Evaluates an expression for each block of `size` numbers, which holds `lanes` elements.
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

/// Makes one call per element. `first` fills the buffer before that.
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
