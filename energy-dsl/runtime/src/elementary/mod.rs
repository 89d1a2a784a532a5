//! Sine, cosine, exponential, logarithm, arc tangent and power, each one branch-free algorithm that is generic over the
//! width, so that a lane has the bits of the scalar. The only branch is the reduction of angles beyond 2²⁰.
//!
//! They are within 1 ulp over the whole range, subnormal numbers and special cases of IEEE 754 included; `verify` holds them
//! to it. Single precision is computed in
//! double precision and rounded once.
//!
//! The polynomials are minimax for the relative error of the function, computed in multi-precision by the exchange
//! algorithm of Remez, then rounded to doubles. The stated error is that of the rounded coefficients.

mod arctangent;
mod exponential;
mod huge_angle;
mod logarithm;
mod power;
mod trigonometry;

pub(crate) use arctangent::{Atan2, ModerateAtan2};
pub(crate) use exponential::Exp;
pub(crate) use logarithm::Ln;
pub(crate) use power::Pow;
pub(crate) use trigonometry::{Cos, Sin, sin_cos};

use super::cpu::{Lane, Level};
use super::real::Number;

/// Doubles whose bits can be worked on.
pub trait Double: Lane<f64> {
    /// Bits that both have.
    fn and(self, other: Self) -> Self;
    /// Bits that either has.
    fn or(self, other: Self) -> Self;
    /// Bits that just one has.
    fn xor(self, other: Self) -> Self;
    /// The sum of the bit patterns as integers.
    fn add_bits(self, other: Self) -> Self;
    /// The lowest bits moved into the place of sign and exponent.
    fn low_bits_to_exponent(self) -> Self;
    /// Sign and exponent moved into the lowest bits.
    fn exponent_to_low_bits(self) -> Self;
    /// Bit 1, that of value 2, moved into the place of the sign; nothing else.
    fn bit_1_to_sign(self) -> Self;

    /// The number whose bits are these, in every lane.
    #[inline(always)]
    fn from_bits(bits: u64) -> Self {
        Self::splat(f64::from_bits(bits))
    }

    /// The sign bit alone.
    #[inline(always)]
    fn sign(self) -> Self {
        self.and(Self::splat(-0.0))
    }
}

impl Double for f64 {
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        f64::from_bits(self.to_bits() & other.to_bits())
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        f64::from_bits(self.to_bits() | other.to_bits())
    }
    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        f64::from_bits(self.to_bits() ^ other.to_bits())
    }
    #[inline(always)]
    fn add_bits(self, other: Self) -> Self {
        f64::from_bits(self.to_bits().wrapping_add(other.to_bits()))
    }
    #[inline(always)]
    fn low_bits_to_exponent(self) -> Self {
        f64::from_bits(self.to_bits() << 52)
    }
    #[inline(always)]
    fn exponent_to_low_bits(self) -> Self {
        f64::from_bits(self.to_bits() >> 52)
    }
    #[inline(always)]
    fn bit_1_to_sign(self) -> Self {
        f64::from_bits(self.to_bits() >> 1 << 63)
    }
}

/// A function of one number.
pub trait Unary {
    /// Its value.
    fn of<D: Double, L: Level>(x: D) -> D;
}

/// A function of two numbers.
pub trait Binary {
    /// Its value.
    fn of<D: Double, L: Level>(a: D, b: D) -> D;

    /// Its value to more than single precision.
    #[inline(always)]
    fn of_single<D: Double, L: Level>(a: D, b: D) -> D {
        Self::of::<D, L>(a, b)
    }
}

/// Adding and subtracting it rounds a number below 2⁵¹ to an integer, which the low bits of the sum hold: 1.5·2⁵².
const ROUND: f64 = 6_755_399_441_055_744.0;

/// 2 to the power of an exponent of normal numbers.
const fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// Σ `coefficients[i]` zⁱ of at most 16 coefficients by Estrin's scheme: a short chain of dependent operations. (A loop over its
/// rounds would not always be unrolled, and then the terms live in memory.)
#[inline(always)]
fn polynomial<D: Double, L: Level, const N: usize>(z: D, coefficients: [f64; N]) -> D {
    const { assert!(N <= 16, "there are four rounds") };
    let mut terms = [z; N];
    for i in 0..N {
        terms[i] = D::splat(coefficients[i]);
    }
    let z2 = z * z;
    let z4 = z2 * z2;
    let z8 = z4 * z4;
    let count = estrin_round::<D, L, N>(&mut terms, N, z);
    let count = estrin_round::<D, L, N>(&mut terms, count, z2);
    let count = estrin_round::<D, L, N>(&mut terms, count, z4);
    estrin_round::<D, L, N>(&mut terms, count, z8);
    terms[0]
}

/// Of the first `count` terms each second one, times the power, is added to the one before it. Returns how many are left.
#[inline(always)]
fn estrin_round<D: Double, L: Level, const N: usize>(terms: &mut [D; N], count: usize, power: D) -> usize {
    for i in 0..count / 2 {
        terms[i] = terms[2 * i + 1].mul_add::<L>(power, terms[2 * i]);
    }
    if count % 2 == 1 {
        terms[count / 2] = terms[count - 1];
    }
    count.div_ceil(2)
}

/// The sum of two numbers, the first of which is the larger, and what rounding lost.
#[inline(always)]
fn fast_sum<D: Number + Copy>(larger: D, smaller: D) -> (D, D) {
    let sum = larger + smaller;
    (sum, (larger - sum) + smaller)
}
