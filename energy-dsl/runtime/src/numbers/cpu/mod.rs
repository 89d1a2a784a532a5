//! SIMD levels of the processor, and dispatch to the best one at run time.
//!
//! A [`Kernel`] is code that is generic over a [`Level`], a set of instructions. [`dispatch`] runs it at the best level
//! of the machine, detected at run time, so users need no compiler flags. A level has its widest lanes ([`Level::F64`],
//! [`Level::F32`]); a kernel over many elements processes [`Lane::LANES`] of them at a time.
//!
//! Results depend on the level only through [`Level::FUSED`]: levels that agree in it give the same bits, at any width.
//! The environment variable `ENERGY_LEVEL` (`baseline`, `avx2` or `avx512`) caps the level; it is read once. With it,
//! one machine reproduces the results of a lesser one. It cannot go below what the program was compiled to require.

mod lanes;
mod portable;
mod register;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::fmt::{self, Display};
use std::str::FromStr;
use std::sync::atomic::{AtomicU8, Ordering};

use lanes::Lanes;
pub(crate) use register::Scalar;

use super::block_sum::Rows;
use super::level::{Baseline, Kernel, Level};

impl Level for Baseline {
    const NAME: &'static str = LevelName::Baseline.as_str();
    const FUSED: bool = cfg!(any(target_feature = "fma", target_arch = "aarch64"));
    type F64 = Lanes<portable::F64x2>;
    type F32 = Lanes<portable::F32x4>;
    type Sum64 = Rows<f64, Self>;
    type Sum32 = Rows<f32, Self>;
}

/// The baseline with fused operations by library calls. It reproduces the bits of fused levels outside their kernels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fused;

impl Level for Fused {
    const NAME: &'static str = "fused";
    const FUSED: bool = true;
    type F64 = Lanes<portable::F64x2>;
    type F32 = Lanes<portable::F32x4>;
    type Sum64 = Rows<f64, Self>;
    type Sum32 = Rows<f32, Self>;
}

/// Asks for the cache lines of rows that will be written soon, if a row is longer than a few lines: rows that are written
/// side by side are no pattern that processors foresee.
#[inline(always)]
pub(crate) fn prefetch_rows<S>(numbers: &[S], stride: usize) {
    /// Bytes of a cache line.
    const LINE: usize = 64;
    if stride * size_of::<S>() <= 2 * LINE {
        return;
    }
    #[cfg(target_arch = "x86_64")]
    numbers.iter().step_by((LINE / size_of::<S>()).max(1)).for_each(x86::prefetch);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = numbers;
}

/// The SIMD levels, in increasing order. A level includes the instructions of all lower ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum LevelName {
    /// The instructions that every processor of the target has; see [`Baseline`].
    Baseline,
    /// x86-64 with AVX2 and FMA: 4 doubles.
    Avx2,
    /// x86-64 with AVX-512 F, DQ, VL and BW: 8 doubles.
    Avx512,
}

impl LevelName {
    /// All levels, whether or not this machine has them.
    pub const ALL: [Self; 3] = [Self::Baseline, Self::Avx2, Self::Avx512];

    /// Returns the name that `ENERGY_LEVEL` uses.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Baseline => "baseline",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

impl Display for LevelName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for LevelName {
    type Err = UnknownLevel;

    fn from_str(text: &str) -> Result<Self, UnknownLevel> {
        Self::ALL.into_iter().find(|name| name.as_str() == text).ok_or_else(|| UnknownLevel(text.to_owned()))
    }
}

/// An unknown SIMD level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownLevel(String);

impl Display for UnknownLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is not a level; levels are baseline, avx2, avx512", self.0)
    }
}

impl std::error::Error for UnknownLevel {}

/// Runs a kernel at the best level of this machine, capped by `ENERGY_LEVEL`.
///
/// ```
/// use energy_runtime::{Kernel, Lane, Level, Number, dispatch};
///
/// struct Roots<'a>(&'a mut [f64]);
///
/// impl Kernel for Roots<'_> {
///     type Output = ();
///
///     #[inline(always)]
///     fn run<L: Level>(self) {
///         for chunk in self.0.chunks_mut(L::F64::LANES) {
///             L::F64::load_ragged(chunk).sqrt().store_ragged(chunk);
///         }
///     }
/// }
///
/// let mut numbers: Vec<f64> = (0..11).map(|i| f64::from(i * i)).collect();
/// dispatch(Roots(&mut numbers));
/// assert_eq!(numbers[10], 10.0);
/// ```
#[inline(always)]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    run_at(REQUIRED.unwrap_or_else(level), kernel)
}

/// Runs scalar code, at AVX2 at most: it needs fused operations, and AVX-512 would compile everything once more.
#[inline(always)]
pub(crate) fn dispatch_scalar<K: Kernel>(kernel: K) -> K::Output {
    if Baseline::FUSED {
        return kernel.run::<Baseline>();
    }
    run_scalar(level(), kernel)
}

/// Runs a kernel at a named level, for tests and benchmarks. Returns `None` if this machine does not have it.
#[inline]
pub fn dispatch_at<K: Kernel>(name: LevelName, kernel: K) -> Option<K::Output> {
    (name <= detected()).then(|| run_at(name, kernel))
}

/// Returns the level that [`dispatch`] uses.
#[inline]
#[must_use]
pub fn level() -> LevelName {
    /// The level plus one; 0 while it is unknown.
    static CHOICE: AtomicU8 = AtomicU8::new(0);
    match CHOICE.load(Ordering::Relaxed) {
        1 => LevelName::Baseline,
        2 => LevelName::Avx2,
        3 => LevelName::Avx512,
        _ => {
            let choice = choose();
            CHOICE.store(choice as u8 + 1, Ordering::Relaxed);
            choice
        }
    }
}

/// Returns the levels of this machine in increasing order, regardless of `ENERGY_LEVEL`.
pub fn available() -> impl Iterator<Item = LevelName> {
    LevelName::ALL.into_iter().filter(|&name| name <= detected())
}

/// The level that the program was compiled to require. If it is the best one, nothing is left to choose.
const REQUIRED: Option<LevelName> = if cfg!(all(
    target_arch = "x86_64",
    target_feature = "avx512f",
    target_feature = "avx512dq",
    target_feature = "avx512vl",
    target_feature = "avx512bw",
    target_feature = "avx2",
    target_feature = "fma"
)) {
    Some(LevelName::Avx512)
} else {
    None
};

#[cold]
fn choose() -> LevelName {
    match std::env::var("ENERGY_LEVEL") {
        Ok(cap) => match cap.parse::<LevelName>() {
            Ok(cap) => detected().min(cap),
            Err(error) => {
                // A typing error that goes unnoticed would invalidate a comparison of machines.
                eprintln!("warning: ENERGY_LEVEL is ignored: {error}");
                detected()
            }
        },
        Err(_) => detected(),
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::read_alone;
#[cfg(target_arch = "x86_64")]
use x86::{detected, run_at, run_scalar};

/// Reads a number by a separate load.
#[cfg(not(target_arch = "x86_64"))]
#[inline(always)]
pub(crate) fn read_alone<T: Copy>(number: &T) -> T {
    *number
}

#[cfg(not(target_arch = "x86_64"))]
fn detected() -> LevelName {
    LevelName::Baseline
}

#[cfg(not(target_arch = "x86_64"))]
#[inline(always)]
fn run_at<K: Kernel>(_name: LevelName, kernel: K) -> K::Output {
    kernel.run::<Baseline>()
}

#[cfg(not(target_arch = "x86_64"))]
#[inline(always)]
fn run_scalar<K: Kernel>(_name: LevelName, kernel: K) -> K::Output {
    kernel.run::<Baseline>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::{BlockSum, Float, Lane, Mask, Number};

    /// Checks what moves numbers between lanes and slices, for one type of lanes.
    fn check<S: Number + Copy + PartialEq + std::fmt::Debug + std::panic::RefUnwindSafe, V: Lane<S>>() {
        let number = |number: usize| S::from_f64(number as f64);
        let lanes = V::LANES;
        for rows in 1..20 {
            let wide: Vec<V> = (0..rows).map(|row| V::from_fn(|lane| number(100 * lane + row))).collect();
            for (count, stride) in [(lanes, rows), (lanes, rows + 3), (lanes - 1, rows + 1), (1, rows), (0, rows)] {
                let mut out = vec![number(9_999); lanes * stride];
                V::store_transposed(&wide, count, &mut out, stride);
                for (place, &found) in out.iter().enumerate() {
                    let (lane, row) = (place / stride, place % stride);
                    let is_written = lane < count && row < rows;
                    assert_eq!(found, if is_written { number(100 * lane + row) } else { number(9_999) });
                }
            }
        }
        // With and without the last point, beyond which nothing may be read.
        for count in [40, 39, 38] {
            let points: Vec<[S; 3]> = (0..count).map(|at| [0, 1, 2].map(|axis| number(10 * at + axis))).collect();
            let indices: Vec<u32> = (0..lanes as u32).map(|lane| (7 * lane + 38) % count as u32).collect();
            for (axis, gathered) in V::gather(&points, &indices).into_iter().enumerate() {
                assert!((0..lanes).all(|lane| gathered.extract(lane) == points[indices[lane] as usize][axis]));
            }
        }
        let points = vec![[number(1); 3]; 40];
        for beyond in [40, u32::MAX] {
            let indices: Vec<u32> = (0..lanes).map(|lane| if lane == lanes / 2 { beyond } else { 0 }).collect();
            let gathered = std::panic::catch_unwind(|| V::gather(&points, &indices).map(|lanes| lanes.extract(0)));
            assert!(gathered.is_err(), "point {beyond} of 40");
        }
        let all = (1 << lanes) - 1;
        assert_eq!((V::Mask::none().bits(), (!V::Mask::none()).bits() & all), (0, all));
        for bits in [0, all, 1, 0b10 & all, 1 << (lanes - 1)] {
            let mask = V::Mask::from_bits(bits);
            assert_eq!((mask.bits(), mask.any(), mask.all()), (bits, bits != 0, bits == all));
            assert_eq!((!mask).bits() & all, all & !bits);
            assert_eq!(
                ((mask & V::Mask::from_bits(1)).bits(), (mask | V::Mask::from_bits(1)).bits()),
                (bits & 1, bits | 1)
            );
        }
        let ascending: Vec<S> = (0..lanes).map(number).collect();
        for count in 1..=lanes {
            let ragged = V::load_ragged(&ascending[..count]);
            assert!((0..lanes).all(|lane| ragged.extract(lane) == number(lane.min(count - 1))));
            let mut stored = vec![number(77); count];
            V::load(&ascending).store_ragged(&mut stored);
            assert_eq!(stored, ascending[..count]);
        }
    }

    struct Check;

    impl Kernel for Check {
        type Output = ();

        #[inline(always)]
        fn run<L: Level>(self) {
            check::<f64, L::F64>();
            check::<f32, L::F32>();
        }
    }

    #[test]
    fn lanes_of_all_levels_keep_their_places() {
        check::<f64, f64>();
        check::<f32, f32>();
        for level in available() {
            dispatch_at(level, Check).unwrap();
        }
    }

    /// Checks that lanes have the bits of scalars.
    fn compare<S: Float, L: Level>() {
        let mut random = fastrand::Rng::with_seed(6);
        for _ in 0..2_000 {
            let mut draw = |spread: i32| {
                let size = 2.0_f64.powi(random.i32(-spread..=spread));
                S::Lanes::<L>::from_fn(|_| S::from_f64((2.0 * random.f64() - 1.0) * size))
            };
            let (a, b, c, large) = (draw(4), draw(4), draw(4), draw(40));
            macro_rules! same {
                ($($function:ident $(::<$level:ident>)? ($x:ident $(, $y:ident)*))*) => {
                    $(let wide = $x.$function$(::<$level>)?($($y),*);
                    for lane in 0..<S::Lanes<L> as Lane<S>>::LANES {
                        let alone = $x.extract(lane).$function$(::<$level>)?($($y.extract(lane)),*);
                        let is_same = |number: S| number.equal(alone).all() || !alone.equal(alone).all();
                        assert!(is_same(wide.extract(lane)), "{} at {}", stringify!($function), L::NAME);
                    })*
                };
            }
            same! {
                sqrt(a) abs(a) min(a, b) max(a, b) sin::<L>(a) cos::<L>(a) sin::<L>(large) cos::<L>(large) exp::<L>(a)
                ln::<L>(a) ln::<L>(large) atan2::<L>(a, b) atan2::<L>(large, b) powf::<L>(a, b) mul_add::<L>(a, b, c)
                fused_mul_sub::<L>(a, b, c) sum_error(a, large) difference_error(a, large) product_error::<L>(a, b)
                root_error::<L>(a, b) power_of_two_scale(large)
            }
        }
    }

    /// Checks that running sums have the bits of sums of numbers.
    fn add_blocks<S: Float, L: Level, B: BlockSum<S>>() {
        let mut random = fastrand::Rng::with_seed(7);
        let mut draw = || S::from_f64(2.0 * random.f64() - 1.0);
        let (mut sum, mut expected) = (B::zero(), Rows::<S, L>::zero());
        for _ in 0..10 {
            let mut block = [S::from_f64(0.0); 16];
            block.iter_mut().for_each(|number| *number = draw());
            let vector = [draw(), draw(), draw(), S::from_f64(0.0)];
            sum.add(&block, &vector);
            expected.add(&block, &vector);
            assert!((0..3).all(|row| sum.total()[row].equal(expected.total()[row]).all()), "{}", L::NAME);
            let from = [draw(), draw(), draw(), S::from_f64(0.0)];
            let (found, expected) = (B::less(from, &block, &vector), Rows::<S, L>::less(from, &block, &vector));
            assert!((0..3).all(|row| found[row].equal(expected[row]).all()), "{}", L::NAME);
        }
    }

    struct Compare;

    impl Kernel for Compare {
        type Output = ();

        #[inline(always)]
        fn run<L: Level>(self) {
            compare::<f64, L>();
            compare::<f32, L>();
            add_blocks::<f64, L, L::Sum64>();
            add_blocks::<f32, L, L::Sum32>();
        }
    }

    #[test]
    fn lanes_of_all_levels_have_the_bits_of_scalars() {
        for level in available() {
            dispatch_at(level, Compare).unwrap();
        }
    }
}
