use super::exponential::Exponential;
use super::{Bits, Format, Unary, fast_sum, horner, polynomial};
use crate::numbers::cpu::Scalar;
use crate::numbers::level::Level;

/// The natural logarithm.
pub struct Ln;

/// The constants of the logarithm in one precision.
pub trait Logarithm: Scalar {
    /// √½, rounded.
    const ROOT_HALF: Self;
    /// The bits of 1 minus those of √½. After they were added to the bits of a number, the exponent increments at √2
    /// instead of at 2.
    const ONE_LESS_ROOT_HALF: Self;
    /// A power of two that makes subnormal numbers normal, and its exponent.
    const LIFT: (Self, Self);

    /// Returns (2 artanh s − 2 s)/s³ of z = s², for (1 + s)/(1 − s) from √½ to √2.
    fn logarithm_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D;
    /// Returns ln(1 + f) as a difference, given f²/2 and ln(1 + f) − f + f²/2. The second number is small.
    fn sum_near_one<D: Bits<Format = Self>, L: Level>(f: D, half_square: D, correction: D) -> (D, D);
}

impl Logarithm for f64 {
    const ROOT_HALF: Self = std::f64::consts::FRAC_1_SQRT_2;
    const ONE_LESS_ROOT_HALF: Self = f64::from_bits(1.0_f64.to_bits() - Self::ROOT_HALF.to_bits());
    const LIFT: (Self, Self) = (18_014_398_509_481_984.0, 54.0);

    /// Relative error of the logarithm below 2^−59.
    #[inline(always)]
    fn logarithm_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D {
        let coefficients = [
            0.6666666666666734,
            0.39999999999416,
            0.28571428742104327,
            0.2222219860101163,
            0.18183562946905538,
            0.1531408412214996,
            0.14795630718842445,
        ];
        polynomial::<D, L, 7>(z, coefficients)
    }
    #[inline(always)]
    fn sum_near_one<D: Bits<Format = Self>, L: Level>(f: D, half_square: D, correction: D) -> (D, D) {
        (f, half_square - correction)
    }
}

impl Logarithm for f32 {
    const ROOT_HALF: Self = std::f32::consts::FRAC_1_SQRT_2;
    const ONE_LESS_ROOT_HALF: Self = f32::from_bits(1.0_f32.to_bits() - Self::ROOT_HALF.to_bits());
    const LIFT: (Self, Self) = (16_777_216.0, 24.0);

    /// Relative error of the logarithm below 2^−30.2.
    #[inline(always)]
    fn logarithm_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D {
        horner::<D, L, _>(z, [0.666_667_76, 0.399_775_86, 0.298_706_95])
    }
    /// Adds the rounding errors of f²/2 and of f − f²/2, which would be an eighth of the error each.
    #[inline(always)]
    fn sum_near_one<D: Bits<Format = Self>, L: Level>(f: D, half_square: D, correction: D) -> (D, D) {
        let (high, low) = fast_sum(f, -half_square);
        let square_error = (D::from_f64(0.5) * f).product_error::<L>(f);
        (high, (square_error - low) - correction)
    }
}

/// Returns (f, k) with x = (1 + f)·2^k and 1 + f between √½ and √2, for positive, finite x.
#[inline(always)]
pub fn decompose<D: Bits>(x: D) -> (D, D) {
    let (zero, one) = (D::from_f64(0.0), D::from_f64(1.0));
    let subnormal = x.less(D::splat(D::Format::LEAST_NORMAL));
    let x = x * D::select(subnormal, D::splat(D::Format::LIFT.0), one);
    let shifted = x.add_bits(D::splat(D::Format::ONE_LESS_ROOT_HALF));
    let mantissa = shifted.and(D::splat(D::Format::MANTISSA)).add_bits(D::splat(D::Format::ROOT_HALF));
    // The exponent field as a number in the low bits, above a power of two.
    let exponent = shifted.exponent_to_low_bits().or(D::splat(D::Format::ALL_INTEGERS));
    let lift = D::select(subnormal, D::splat(D::Format::LIFT.1), zero);
    (mantissa - one, exponent - (lift + D::splat(D::Format::ALL_INTEGERS + D::Format::BIAS)))
}

impl Unary for Ln {
    #[inline(always)]
    fn of<D: Bits, L: Level>(x: D) -> D {
        let zero = D::from_f64(0.0);
        let (f, k) = decompose(x);
        let s = f / (D::from_f64(2.0) + f);
        let z = s * s;
        // ln(1 + f) = f − (f²/2 − s (f²/2 + R)), R = 2 artanh(s)/s − 2.
        let half = D::from_f64(0.5) * f * f;
        let small = k * D::splat(D::Format::LN_2.1);
        let correction = s.mul_add::<L>(half + z * D::Format::logarithm_rest::<D, L>(z), small);
        let (near, rest) = D::Format::sum_near_one::<D, L>(f, half, correction);
        let (high, low) = fast_sum(k * D::splat(D::Format::LN_2.0), near);
        let result = high + (low - rest);
        let infinity = D::splat(D::Format::INFINITY);
        let result = D::select(x.less(infinity), result, x);
        let result = D::select(x.less(zero), D::from_f64(f64::NAN), result);
        D::select(x.equal(zero), -infinity, result)
    }
}
