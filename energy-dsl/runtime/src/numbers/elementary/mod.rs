//! Sine, cosine, exponential, logarithm, arc tangent and power. Each is one branch-free algorithm that is generic over
//! the width, so a lane has the bits of the scalar. The only branch reduces huge angles.
//!
//! Both precisions share the algorithms; each has its own constants and polynomials, and its own way to reduce angles.
//! Nothing in single precision is computed in double precision, so the same code suits processors without doubles.
//!
//! All are within 1 ulp over the whole range, including subnormal numbers and the special cases of IEEE 754; `verify`
//! tests this. Errors in single precision are smaller: exponentials are within 1.01 u, powers 1.05 u, logarithms
//! 1.15 u, angles 1.1 u, sine and cosine 1.2 u, with u = 2⁻²⁴ = ½ ulp(1). The nearest number has an error of up to
//! 1 u. Results below 2⁻¹¹⁸ are within 0.8 ulp; most are rounded twice.
//!
//! The polynomials minimise the maximum relative error of the function. They were computed in multi-precision by the
//! Remez exchange algorithm. Doubles are its rounded coefficients. In single precision, each coefficient was rounded
//! before the exchange was repeated for the higher ones, which make up for the rounding. The stated error is that of
//! the rounded coefficients.

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

use arctangent::ArcTangent;
use exponential::Exponential;
use logarithm::Logarithm;
use power::Power;
use trigonometry::Trigonometry;

use super::cpu::Scalar;
use super::lane::Lane;
use super::level::Level;
use super::real::{Mask, Number};

/// A floating-point format with the constants of its elementary functions.
pub trait Format: Scalar + Trigonometry + Exponential + Logarithm + ArcTangent + Power {
    /// Adding it rounds a small number to an integer, which the low bits of the sum hold: 1.5·2⁵² and 1.5·2²³.
    const ROUND: Self;
    /// The exponent of 1 in its bits.
    const BIAS: Self;
    /// From here on, all numbers are integers: 2⁵² and 2²³.
    const ALL_INTEGERS: Self;
    /// The lowest bit alone.
    const LOWEST_BIT: Self;
    /// The bits of the mantissa.
    const MANTISSA: Self;
}

impl Format for f64 {
    const ROUND: Self = 6_755_399_441_055_744.0;
    const BIAS: Self = 1023.0;
    const ALL_INTEGERS: Self = 4_503_599_627_370_496.0;
    const LOWEST_BIT: Self = f64::from_bits(1);
    const MANTISSA: Self = f64::from_bits((1 << 52) - 1);
}

impl Format for f32 {
    const ROUND: Self = 12_582_912.0;
    const BIAS: Self = 127.0;
    const ALL_INTEGERS: Self = 8_388_608.0;
    const LOWEST_BIT: Self = f32::from_bits(1);
    const MANTISSA: Self = f32::from_bits((1 << 23) - 1);
}

/// Floating-point numbers with access to their bits.
pub trait Bits: Lane<<Self as Bits>::Format> {
    /// The type of one lane.
    type Format: Format;

    /// Bitwise and.
    fn and(self, other: Self) -> Self;
    /// Bitwise or.
    fn or(self, other: Self) -> Self;
    /// Bitwise exclusive or.
    fn xor(self, other: Self) -> Self;
    /// Adds the bit patterns as integers.
    fn add_bits(self, other: Self) -> Self;
    /// Moves the lowest bits to the position of sign and exponent.
    fn low_bits_to_exponent(self) -> Self;
    /// Moves sign and exponent to the lowest bits.
    fn exponent_to_low_bits(self) -> Self;
    /// Moves bit 1 (of value 2) to the sign position and clears the others.
    fn bit_1_to_sign(self) -> Self;

    /// Reduces the marked lanes of some angles, which are huge. `reduced` has the quadrants and remainders of the others.
    #[inline(always)]
    fn reduced_if_huge(self, huge: Self::Mask, reduced: [Self; 3]) -> [Self; 3] {
        if huge.any() { huge_angle::reduced(self, huge, reduced) } else { reduced }
    }

    /// Returns the sign bit alone.
    #[inline(always)]
    fn sign(self) -> Self {
        self.and(Self::from_f64(-0.0))
    }
}

macro_rules! bits_of_float {
    ($float:ident, $mantissa_bits:literal, $sign_bit:literal) => {
        impl Bits for $float {
            type Format = Self;

            #[inline(always)]
            fn and(self, other: Self) -> Self {
                $float::from_bits(self.to_bits() & other.to_bits())
            }
            #[inline(always)]
            fn or(self, other: Self) -> Self {
                $float::from_bits(self.to_bits() | other.to_bits())
            }
            #[inline(always)]
            fn xor(self, other: Self) -> Self {
                $float::from_bits(self.to_bits() ^ other.to_bits())
            }
            #[inline(always)]
            fn add_bits(self, other: Self) -> Self {
                $float::from_bits(self.to_bits().wrapping_add(other.to_bits()))
            }
            #[inline(always)]
            fn low_bits_to_exponent(self) -> Self {
                $float::from_bits(self.to_bits() << $mantissa_bits)
            }
            #[inline(always)]
            fn exponent_to_low_bits(self) -> Self {
                $float::from_bits(self.to_bits() >> $mantissa_bits)
            }
            #[inline(always)]
            fn bit_1_to_sign(self) -> Self {
                $float::from_bits(self.to_bits() >> 1 << $sign_bit)
            }
        }
    };
}

bits_of_float!(f64, 52, 63);
bits_of_float!(f32, 23, 31);

/// A function of one number.
pub trait Unary {
    /// Returns the value of the function.
    fn of<D: Bits, L: Level>(x: D) -> D;
}

/// A function of two numbers.
pub trait Binary {
    /// Returns the value of the function.
    fn of<D: Bits, L: Level>(a: D, b: D) -> D;
}

/// Returns 2^exponent, a normal number, in every lane.
#[inline(always)]
fn power_of_two<D: Bits>(exponent: i32) -> D {
    D::splat(D::Format::power_of_two(exponent))
}

/// Returns Σ `coefficients[i]` zⁱ for a few coefficients, by Horner's scheme: it has fewer operations than Estrin's,
/// and rounds only once at the size of the first coefficient.
#[inline(always)]
fn horner<D: Bits, L: Level, const N: usize>(z: D, coefficients: [D::Format; N]) -> D {
    let mut sum = D::splat(coefficients[N - 1]);
    for i in (0..N - 1).rev() {
        sum = sum.mul_add::<L>(z, D::splat(coefficients[i]));
    }
    sum
}

/// Returns Σ `coefficients[i]` zⁱ for at most 16 coefficients, by Estrin's scheme: a short chain of dependent
/// operations. Written without a loop over its rounds, which is not always unrolled; then the terms would live in
/// memory.
#[inline(always)]
fn polynomial<D: Bits, L: Level, const N: usize>(z: D, coefficients: [D::Format; N]) -> D {
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

/// One round of Estrin's scheme: adds every second of the first `count` terms, times the power, to the term before it.
/// Returns how many terms remain.
#[inline(always)]
fn estrin_round<D: Bits, L: Level, const N: usize>(terms: &mut [D; N], count: usize, power: D) -> usize {
    for i in 0..count / 2 {
        terms[i] = terms[2 * i + 1].mul_add::<L>(power, terms[2 * i]);
    }
    if count % 2 == 1 {
        terms[count / 2] = terms[count - 1];
    }
    count.div_ceil(2)
}

/// FastTwoSum: returns the sum and its rounding error. The first number must be the larger.
#[inline(always)]
fn fast_sum<D: Number + Copy>(larger: D, smaller: D) -> (D, D) {
    let sum = larger + smaller;
    (sum, (larger - sum) + smaller)
}

#[cfg(test)]
mod single;

#[cfg(test)]
mod tests {
    use fastrand::Rng;

    use crate::numbers::{Baseline, Number};

    #[track_caller]
    fn assert_near(found: f64, expected: f64, what: &str, at: &[f64]) {
        let allowed = 4.0 * f64::EPSILON * expected.abs() + f64::from_bits(4);
        assert!((found - expected).abs() <= allowed || found == expected, "{what} {at:?}: {found:e}, {expected:e}");
    }

    #[test]
    fn functions_are_those_of_the_standard_library() {
        type B = Baseline;
        let mut random = Rng::with_seed(5);
        let mut draw = |exponents: std::ops::RangeInclusive<i32>| {
            let size = (1.0 + random.f64()) * 2.0_f64.powi(random.i32(exponents));
            if random.bool() { size } else { -size }
        };
        for _ in 0..100_000 {
            for x in [draw(-40..=10), draw(10..=1022)] {
                assert_near(Number::sin::<B>(x), x.sin(), "sin", &[x]);
                assert_near(Number::cos::<B>(x), x.cos(), "cos", &[x]);
            }
            let x = draw(-60..=8);
            assert_near(Number::exp::<B>(x), x.exp(), "exp", &[x]);
            let x = draw(-1000..=1000).abs();
            assert_near(Number::ln::<B>(x), x.ln(), "ln", &[x]);
            let x = 1.0 + draw(-50..=-2);
            assert_near(Number::ln::<B>(x), x.ln(), "ln", &[x]);
            let (y, x) = (draw(-300..=300), draw(-300..=300));
            assert_near(Number::atan2::<B>(y, x), y.atan2(x), "atan2", &[y, x]);
            let (y, x) = (draw(-4..=4), draw(-4..=4));
            assert_near(Number::atan2::<B>(y, x), y.atan2(x), "atan2", &[y, x]);
            let (x, exponent) = (draw(-30..=30).abs(), draw(-10..=4));
            assert_near(Number::powf::<B>(x, exponent), x.powf(exponent), "power", &[x, exponent]);
        }
    }
}
