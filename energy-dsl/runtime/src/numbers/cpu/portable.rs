//! Registers as arrays, for any processor. Operations go lane by lane without loops or branches, so compilers turn them
//! into vector instructions of the target (SSE2, NEON) and compile them quickly.

use std::ops::{BitAnd, BitOr, Not};

use super::register::Register;
use crate::numbers::elementary::Bits;
use crate::numbers::level::{Baseline, Kernel};
use crate::numbers::real::Mask;

/// A register of two doubles.
#[derive(Clone, Copy)]
#[repr(align(16))]
pub struct F64x2([f64; 2]);

/// A register of four single-precision numbers.
#[derive(Clone, Copy)]
#[repr(align(16))]
pub struct F32x4([f32; 4]);

macro_rules! array_register {
    ($register:ident, $mask:ident, $float:ident, $lanes:literal, [$($i:literal)*]) => {
        /// One `bool` per lane.
        #[derive(Clone, Copy, Debug)]
        pub struct $mask([bool; $lanes]);

        impl BitAnd for $mask {
            type Output = Self;

            #[inline(always)]
            fn bitand(self, other: Self) -> Self {
                Self([$(self.0[$i] & other.0[$i]),*])
            }
        }

        impl BitOr for $mask {
            type Output = Self;

            #[inline(always)]
            fn bitor(self, other: Self) -> Self {
                Self([$(self.0[$i] | other.0[$i]),*])
            }
        }

        impl Not for $mask {
            type Output = Self;

            #[inline(always)]
            fn not(self) -> Self {
                Self([$(!self.0[$i]),*])
            }
        }

        impl Mask for $mask {
            #[inline(always)]
            fn none() -> Self {
                Self([false; $lanes])
            }
            #[inline(always)]
            fn bits(self) -> u32 {
                0 $(| u32::from(self.0[$i]) << $i)*
            }
            #[inline(always)]
            fn from_bits(bits: u32) -> Self {
                Self([$(bits >> $i & 1 != 0),*])
            }
        }

        impl Register for $register {
            type Scalar = $float;
            type Mask = $mask;
            const LANES: usize = $lanes;

            /// Kept out of line, so that a kernel which several routines share is compiled once.
            #[inline(never)]
            fn dispatch<K: Kernel>(kernel: K) -> K::Output {
                kernel.run::<Baseline>()
            }
            #[inline(always)]
            fn splat(value: $float) -> Self {
                Self([value; $lanes])
            }
            #[inline(always)]
            fn load(values: &[$float]) -> Self {
                let values = &values[..$lanes];
                Self([$(values[$i]),*])
            }
            #[inline(always)]
            fn store(self, values: &mut [$float]) {
                let values = &mut values[..$lanes];
                $(values[$i] = self.0[$i];)*
            }
            #[inline(always)]
            fn from_fn(mut value: impl FnMut(usize) -> $float) -> Self {
                Self([$(value($i)),*])
            }
            #[inline(always)]
            fn add(a: Self, b: Self) -> Self {
                Self([$(a.0[$i] + b.0[$i]),*])
            }
            #[inline(always)]
            fn sub(a: Self, b: Self) -> Self {
                Self([$(a.0[$i] - b.0[$i]),*])
            }
            #[inline(always)]
            fn mul(a: Self, b: Self) -> Self {
                Self([$(a.0[$i] * b.0[$i]),*])
            }
            #[inline(always)]
            fn div(a: Self, b: Self) -> Self {
                Self([$(a.0[$i] / b.0[$i]),*])
            }
            #[inline(always)]
            fn sqrt(a: Self) -> Self {
                Self([$(a.0[$i].sqrt()),*])
            }
            #[inline(always)]
            fn fused(a: Self, b: Self, c: Self) -> Self {
                Self([$(a.0[$i].mul_add(b.0[$i], c.0[$i])),*])
            }
            #[inline(always)]
            fn min(a: Self, b: Self) -> Self {
                Self([$(if a.0[$i] < b.0[$i] { a.0[$i] } else { b.0[$i] }),*])
            }
            #[inline(always)]
            fn max(a: Self, b: Self) -> Self {
                Self([$(if a.0[$i] > b.0[$i] { a.0[$i] } else { b.0[$i] }),*])
            }
            #[inline(always)]
            fn less(a: Self, b: Self) -> $mask {
                $mask([$(a.0[$i] < b.0[$i]),*])
            }
            #[inline(always)]
            fn less_or_equal(a: Self, b: Self) -> $mask {
                $mask([$(a.0[$i] <= b.0[$i]),*])
            }
            #[inline(always)]
            fn equal(a: Self, b: Self) -> $mask {
                $mask([$(a.0[$i] == b.0[$i]),*])
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                Self([$(if mask.0[$i] { yes.0[$i] } else { no.0[$i] }),*])
            }
            #[inline(always)]
            fn and(a: Self, b: Self) -> Self {
                Self([$($float::from_bits(a.0[$i].to_bits() & b.0[$i].to_bits())),*])
            }
            #[inline(always)]
            fn or(a: Self, b: Self) -> Self {
                Self([$($float::from_bits(a.0[$i].to_bits() | b.0[$i].to_bits())),*])
            }
            #[inline(always)]
            fn xor(a: Self, b: Self) -> Self {
                Self([$($float::from_bits(a.0[$i].to_bits() ^ b.0[$i].to_bits())),*])
            }
            #[inline(always)]
            fn add_bits(a: Self, b: Self) -> Self {
                Self([$($float::from_bits(a.0[$i].to_bits().wrapping_add(b.0[$i].to_bits()))),*])
            }
            #[inline(always)]
            fn sub_bits(a: Self, b: Self) -> Self {
                Self([$($float::from_bits(a.0[$i].to_bits().wrapping_sub(b.0[$i].to_bits()))),*])
            }
            #[inline(always)]
            fn low_bits_to_exponent(a: Self) -> Self {
                Self([$(a.0[$i].low_bits_to_exponent()),*])
            }
            #[inline(always)]
            fn exponent_to_low_bits(a: Self) -> Self {
                Self([$(a.0[$i].exponent_to_low_bits()),*])
            }
            #[inline(always)]
            fn bit_1_to_sign(a: Self) -> Self {
                Self([$(a.0[$i].bit_1_to_sign()),*])
            }
        }
    };
}

array_register!(F64x2, Mask64x2, f64, 2, [0 1]);
array_register!(F32x4, Mask32x4, f32, 4, [0 1 2 3]);
