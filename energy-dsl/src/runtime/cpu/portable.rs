//! Registers as arrays, for any processor. The loops are short and branch-free: compilers turn them into the target's
//! vector instructions (SSE2, NEON).

use std::array;
use std::ops::{BitAnd, BitOr, Not};

use super::lanes::Lanes;
use super::register::{DoubleRegister, Register, SingleRegister, elementary_of_doubles, elementary_of_singles};
use super::{Baseline, Kernel, Level};
use crate::runtime::elementary::{Binary, Double, Unary, sin_cos};
use crate::runtime::real::Mask;

/// Two doubles.
#[derive(Clone, Copy)]
#[repr(align(16))]
pub struct F64x2([f64; 2]);

/// Four single-precision numbers.
#[derive(Clone, Copy)]
#[repr(align(16))]
pub struct F32x4([f32; 4]);

macro_rules! array_register {
    ($register:ident, $mask:ident, $float:ident, $bits:ident, $lanes:literal, $elementary:ident) => {
        /// All bits of a lane where it holds, none elsewhere.
        #[derive(Clone, Copy, Debug)]
        pub struct $mask([$bits; $lanes]);

        impl $mask {
            #[inline(always)]
            fn from_fn(holds: impl Fn(usize) -> bool) -> Self {
                Self(array::from_fn(|i| $bits::from(holds(i)).wrapping_neg()))
            }
        }

        impl BitAnd for $mask {
            type Output = Self;

            #[inline(always)]
            fn bitand(self, other: Self) -> Self {
                Self(array::from_fn(|i| self.0[i] & other.0[i]))
            }
        }

        impl BitOr for $mask {
            type Output = Self;

            #[inline(always)]
            fn bitor(self, other: Self) -> Self {
                Self(array::from_fn(|i| self.0[i] | other.0[i]))
            }
        }

        impl Not for $mask {
            type Output = Self;

            #[inline(always)]
            fn not(self) -> Self {
                Self(self.0.map(|bits| !bits))
            }
        }

        impl Mask for $mask {
            #[inline(always)]
            fn none() -> Self {
                Self([0; $lanes])
            }
            #[inline(always)]
            fn bits(self) -> u32 {
                (0..$lanes).map(|i| u32::from(self.0[i] != 0) << i).sum()
            }
            #[inline(always)]
            fn from_bits(bits: u32) -> Self {
                Self(array::from_fn(|i| if bits >> i & 1 != 0 { !0 } else { 0 }))
            }
        }

        impl $register {
            #[inline(always)]
            fn map(a: Self, f: impl Fn($float) -> $float) -> Self {
                Self(a.0.map(f))
            }
            #[inline(always)]
            fn zip(a: Self, b: Self, f: impl Fn($float, $float) -> $float) -> Self {
                Self(array::from_fn(|i| f(a.0[i], b.0[i])))
            }
            #[inline(always)]
            fn zip_bits(a: Self, b: Self, f: impl Fn($bits, $bits) -> $bits) -> Self {
                Self::zip(a, b, |a, b| $float::from_bits(f(a.to_bits(), b.to_bits())))
            }
        }

        impl Register for $register {
            type Scalar = $float;
            type Mask = $mask;
            const LANES: usize = $lanes;

            #[inline(always)]
            fn dispatch<K: Kernel>(kernel: K) -> K::Output {
                kernel.run::<Baseline>()
            }
            #[inline(always)]
            fn splat(value: $float) -> Self {
                Self([value; $lanes])
            }
            #[inline(always)]
            fn load(values: &[$float]) -> Self {
                Self(array::from_fn(|i| values[i]))
            }
            #[inline(always)]
            fn store(self, values: &mut [$float]) {
                values[..$lanes].copy_from_slice(&self.0);
            }
            #[inline(always)]
            fn from_fn(value: impl FnMut(usize) -> $float) -> Self {
                Self(array::from_fn(value))
            }
            #[inline(always)]
            fn add(a: Self, b: Self) -> Self {
                Self::zip(a, b, |a, b| a + b)
            }
            #[inline(always)]
            fn sub(a: Self, b: Self) -> Self {
                Self::zip(a, b, |a, b| a - b)
            }
            #[inline(always)]
            fn mul(a: Self, b: Self) -> Self {
                Self::zip(a, b, |a, b| a * b)
            }
            #[inline(always)]
            fn div(a: Self, b: Self) -> Self {
                Self::zip(a, b, |a, b| a / b)
            }
            #[inline(always)]
            fn sqrt(a: Self) -> Self {
                Self::map(a, $float::sqrt)
            }
            #[inline(always)]
            fn fused(a: Self, b: Self, c: Self) -> Self {
                Self(array::from_fn(|i| a.0[i].mul_add(b.0[i], c.0[i])))
            }
            #[inline(always)]
            fn min(a: Self, b: Self) -> Self {
                Self::zip(a, b, |a, b| if a < b { a } else { b })
            }
            #[inline(always)]
            fn max(a: Self, b: Self) -> Self {
                Self::zip(a, b, |a, b| if a > b { a } else { b })
            }
            #[inline(always)]
            fn less(a: Self, b: Self) -> $mask {
                $mask::from_fn(|i| a.0[i] < b.0[i])
            }
            #[inline(always)]
            fn less_or_equal(a: Self, b: Self) -> $mask {
                $mask::from_fn(|i| a.0[i] <= b.0[i])
            }
            #[inline(always)]
            fn equal(a: Self, b: Self) -> $mask {
                $mask::from_fn(|i| a.0[i] == b.0[i])
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                let pick = |i: usize| (mask.0[i] & yes.0[i].to_bits()) | (!mask.0[i] & no.0[i].to_bits());
                Self(array::from_fn(|i| $float::from_bits(pick(i))))
            }
            #[inline(always)]
            fn and(a: Self, b: Self) -> Self {
                Self::zip_bits(a, b, |a, b| a & b)
            }
            #[inline(always)]
            fn or(a: Self, b: Self) -> Self {
                Self::zip_bits(a, b, |a, b| a | b)
            }
            #[inline(always)]
            fn xor(a: Self, b: Self) -> Self {
                Self::zip_bits(a, b, |a, b| a ^ b)
            }
            #[inline(always)]
            fn add_bits(a: Self, b: Self) -> Self {
                Self::zip_bits(a, b, $bits::wrapping_add)
            }
            #[inline(always)]
            fn sub_bits(a: Self, b: Self) -> Self {
                Self::zip_bits(a, b, $bits::wrapping_sub)
            }
            $elementary!();
        }
    };
}

array_register!(F64x2, Mask64x2, f64, u64, 2, elementary_of_doubles);
array_register!(F32x4, Mask32x4, f32, u32, 4, elementary_of_singles);

impl DoubleRegister for F64x2 {
    #[inline(always)]
    fn low_bits_to_exponent(a: Self) -> Self {
        Self::map(a, Double::low_bits_to_exponent)
    }
    #[inline(always)]
    fn exponent_to_low_bits(a: Self) -> Self {
        Self::map(a, Double::exponent_to_low_bits)
    }
    #[inline(always)]
    fn bit_1_to_sign(a: Self) -> Self {
        Self::map(a, Double::bit_1_to_sign)
    }
}

impl SingleRegister for F32x4 {
    type Double = F64x2;

    #[inline(always)]
    fn widen(a: Self) -> [F64x2; 2] {
        let [a, b, c, d] = a.0.map(f64::from);
        [F64x2([a, b]), F64x2([c, d])]
    }
    #[inline(always)]
    fn narrow([F64x2([a, b]), F64x2([c, d])]: [F64x2; 2]) -> Self {
        Self([a, b, c, d].map(|value| value as f32))
    }
}
