//! The SIMD levels of x86-64. All unsafe code of the workspace is in this folder: calls of code compiled for detected
//! features, and the intrinsics that need these features.
//!
//! Why it is sound: [`Avx2`], [`Avx512`] and their lanes cannot be named outside the crate. They appear only as the
//! type parameter of a kernel that [`run_at`] instantiates, after the level's features were detected. A processor does
//! not lose features.
#![allow(unsafe_code)]

mod avx2;
mod avx512;
mod block_sum;
mod transpose;

use super::LevelName;
use super::lanes::Lanes;
use crate::numbers::block_sum::Rows;
use crate::numbers::level::{Baseline, Kernel, Level};
use std::arch::x86_64::{__m256, __m256d, __m512, __m512d};

/// The level with AVX2 and FMA.
#[derive(Clone, Copy, Debug)]
pub struct Avx2;

impl Level for Avx2 {
    const NAME: &'static str = LevelName::Avx2.as_str();
    const FUSED: bool = true;
    type F64 = Lanes<__m256d>;
    type F32 = Lanes<__m256>;
    type Sum64 = Rows<f64, Self>;
    type Sum32 = Rows<f32, Self>;
}

/// The level with AVX-512 F, DQ, VL and BW.
#[derive(Clone, Copy, Debug)]
pub struct Avx512;

impl Level for Avx512 {
    const NAME: &'static str = LevelName::Avx512.as_str();
    const FUSED: bool = true;
    type F64 = Lanes<__m512d>;
    type F32 = Lanes<__m512>;
    type Sum64 = Rows<f64, Self>;
    type Sum32 = block_sum::Nine;
}

/// Returns the best level of this machine. The standard library caches the detection.
pub fn detected() -> LevelName {
    let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    let avx512 = is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512bw");
    match (avx2, avx512) {
        (true, true) => LevelName::Avx512,
        (true, false) => LevelName::Avx2,
        (false, _) => LevelName::Baseline,
    }
}

/// Asks for a cache line that will be written soon.
#[inline(always)]
pub(super) fn prefetch<S>(place: &S) {
    // SAFETY: a hint changes nothing but the caches, and every x86-64 has the instruction.
    unsafe { std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_ET0 }>(std::ptr::from_ref(place).cast()) }
}

/// Runs a kernel at a level that is at most [`detected`].
#[inline(always)]
pub(super) fn run_at<K: Kernel>(name: LevelName, kernel: K) -> K::Output {
    debug_assert!(name <= detected(), "{name} is not available");
    match name {
        // SAFETY: callers, all in the parent module, pass levels that `detected` allows or that the program was
        // compiled to require.
        LevelName::Avx512 => unsafe { run_avx512(kernel) },
        // SAFETY: as above.
        LevelName::Avx2 => unsafe { run_avx2(kernel) },
        LevelName::Baseline => kernel.run::<Baseline>(),
    }
}

/// Runs scalar code at AVX2 if the level, at most [`detected`], includes it.
#[inline(never)]
pub(super) fn run_scalar<K: Kernel>(name: LevelName, kernel: K) -> K::Output {
    if name >= LevelName::Avx2 {
        // SAFETY: as for `run_at`.
        unsafe { run_avx2(kernel) }
    } else {
        run_plain(kernel)
    }
}

/// Reads a number by a separate load. Volatile loads are not merged into wider ones.
#[inline(always)]
pub(crate) fn read_alone<T: Copy>(number: &T) -> T {
    // SAFETY: a reference is valid for reads, aligned and initialised, and `T` is `Copy`.
    unsafe { std::ptr::read_volatile(number) }
}

/// Kept out of line: a scalar routine at a lower level should not bloat its callers.
#[inline(never)]
fn run_plain<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Baseline>()
}

#[target_feature(enable = "avx2,fma")]
#[inline]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")]
#[inline]
fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx512>()
}

/// Implements operations of a register, each as one expression of intrinsics.
macro_rules! intrinsics {
    ($(fn $name:ident($($argument:ident: $type:ty),*) -> $output:ty = $body:expr;)*) => {
        $(
            #[inline(always)]
            fn $name($($argument: $type),*) -> $output {
                // SAFETY: there are registers of this type only where their level's features were detected; see
                // `super`.
                unsafe { $body }
            }
        )*
    };
}

/// Implements a mask that is an integer or a register.
macro_rules! mask {
    (
        $mask:ident($inner:ty), none: $none:expr, bits: |$m:ident| $bits:expr, from_bits: |$b:ident| $from_bits:expr,
        and: $and:expr, or: $or:expr, not: $not:expr
    ) => {
        #[doc = "The outcome of a comparison of registers."]
        #[derive(Clone, Copy, Debug)]
        pub struct $mask($inner);

        impl std::ops::BitAnd for $mask {
            type Output = Self;

            #[inline(always)]
            fn bitand(self, other: Self) -> Self {
                // SAFETY: as for registers.
                #[allow(unused_unsafe)]
                unsafe {
                    Self($and(self.0, other.0))
                }
            }
        }

        impl std::ops::BitOr for $mask {
            type Output = Self;

            #[inline(always)]
            fn bitor(self, other: Self) -> Self {
                // SAFETY: as for registers.
                #[allow(unused_unsafe)]
                unsafe {
                    Self($or(self.0, other.0))
                }
            }
        }

        impl std::ops::Not for $mask {
            type Output = Self;

            #[inline(always)]
            fn not(self) -> Self {
                // SAFETY: as for registers.
                #[allow(unused_unsafe)]
                unsafe {
                    Self($not(self.0))
                }
            }
        }

        impl crate::numbers::real::Mask for $mask {
            #[inline(always)]
            fn none() -> Self {
                // SAFETY: as for registers.
                #[allow(unused_unsafe)]
                unsafe {
                    Self($none)
                }
            }
            #[inline(always)]
            fn bits(self) -> u32 {
                let $m = self.0;
                // SAFETY: as for registers.
                #[allow(unused_unsafe)]
                unsafe {
                    $bits
                }
            }
            #[inline(always)]
            fn from_bits($b: u32) -> Self {
                // SAFETY: as for registers.
                #[allow(unused_unsafe)]
                unsafe {
                    Self($from_bits)
                }
            }
        }
    };
}
use {intrinsics, mask};
