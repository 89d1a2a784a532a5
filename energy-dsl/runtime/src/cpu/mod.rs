//! What a processor can do, and how code is run at the best level it has.
//!
//! A [`Kernel`] is work that is generic over a [`Level`], a set of instructions. [`dispatch`] runs it at the best level of
//! the machine, found at run time: users need no compiler flags. A level brings its widest lanes ([`Level::F64`],
//! [`Level::F32`]), so a kernel over many elements takes [`Lane::LANES`] of them at a time.
//!
//! Results depend on a level only by [`Level::FUSED`]: levels that agree in it give the same bits, at any width. The
//! environment variable `ENERGY_LEVEL` (`baseline`, `avx2` or `avx512`), read once, caps the level: with it one machine
//! reproduces the results of a lesser one. (It cannot undo what the program was compiled to require.)

mod block_sum;
mod lane;
mod lanes;
mod portable;
mod register;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::fmt::{self, Debug, Display};
use std::str::FromStr;
use std::sync::atomic::{AtomicU8, Ordering};

use block_sum::Rows;
pub use block_sum::{BLOCK_NUMBERS, BlockSum};
pub use lane::Lane;
use lanes::Lanes;
pub(crate) use register::Scalar;

/// A set of instructions that kernels are compiled for.
pub trait Level: Copy + Debug + 'static {
    /// Its name.
    const NAME: &'static str;
    /// Whether a product and a sum fuse into one rounding.
    const FUSED: bool;
    /// As many doubles as one instruction takes.
    type F64: Lane<f64>;
    /// As many single-precision numbers as one instruction takes.
    type F32: Lane<f32>;
    /// What sweeps through sparse matrices of doubles sum up with.
    type Sum64: BlockSum<f64>;
    /// The same of single-precision numbers.
    type Sum32: BlockSum<f32>;
}

/// What every processor of the target has.
#[derive(Clone, Copy, Debug)]
pub struct Baseline;

impl Level for Baseline {
    const NAME: &'static str = LevelName::Baseline.as_str();
    const FUSED: bool = cfg!(any(target_feature = "fma", target_arch = "aarch64"));
    type F64 = Lanes<portable::F64x2>;
    type F32 = Lanes<portable::F32x4>;
    type Sum64 = Rows<f64, Self>;
    type Sum32 = Rows<f32, Self>;
}

/// Baseline, with fused operations by library calls: what gives the bits of fused levels outside their kernels.
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

/// Work that can be compiled for any [`Level`].
pub trait Kernel {
    /// What it returns.
    type Output;
    /// Does it. Mark implementations `#[inline(always)]`: only what is inlined is compiled for the level.
    fn run<L: Level>(self) -> Self::Output;
}

/// The levels there are, from the least to the best. A better one can do all that a lesser one can.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum LevelName {
    /// What every processor of the target has; see [`Baseline`].
    Baseline,
    /// x86-64 with AVX2 and FMA: 4 doubles.
    Avx2,
    /// x86-64 with AVX-512 F, DQ, VL and BW: 8 doubles.
    Avx512,
}

impl LevelName {
    /// Every level, of this machine or not.
    pub const ALL: [Self; 3] = [Self::Baseline, Self::Avx2, Self::Avx512];

    /// The name as `ENERGY_LEVEL` has it.
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

/// A name that is no level's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownLevel(String);

impl Display for UnknownLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is not a level; levels are baseline, avx2, avx512", self.0)
    }
}

impl std::error::Error for UnknownLevel {}

/// Runs a kernel at the best level this machine has, capped by `ENERGY_LEVEL`.
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

/// Runs scalar code: at AVX2 at most, for fused operations. AVX-512 would be one more instantiation of everything.
#[inline(always)]
pub(crate) fn dispatch_scalar<K: Kernel>(kernel: K) -> K::Output {
    if Baseline::FUSED {
        return kernel.run::<Baseline>();
    }
    run_scalar(level(), kernel)
}

/// Runs a kernel at a level by name, if this machine has it: for tests and benchmarks.
#[inline]
pub fn dispatch_at<K: Kernel>(name: LevelName, kernel: K) -> Option<K::Output> {
    (name <= detected()).then(|| run_at(name, kernel))
}

/// The level that [`dispatch`] runs at.
#[inline]
#[must_use]
pub fn level() -> LevelName {
    /// One more than the level; 0 while it is not known.
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

/// The levels this machine has, from the least to the best, whatever `ENERGY_LEVEL` says.
pub fn available() -> impl Iterator<Item = LevelName> {
    LevelName::ALL.into_iter().filter(|&name| name <= detected())
}

/// A level that the program was compiled to require: no choice is left if it is the best there is.
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
                // A mistyped cap that went unnoticed would make a comparison of machines worthless.
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

/// A number, by a load of its own.
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
