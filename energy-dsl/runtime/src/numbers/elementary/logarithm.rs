use super::exponential::LN_2;
use super::{Double, Unary, fast_sum, polynomial};
use crate::numbers::level::Level;

/// The natural logarithm.
pub struct Ln;

/// (2 artanh s − 2 s)/s³ of z = s², for (1 + s)/(1 − s) from √½ to √2; relative error of the logarithm below 2^−59.
const LOGARITHM: [f64; 7] = [
    0.6666666666666734,
    0.39999999999416,
    0.28571428742104327,
    0.2222219860101163,
    0.18183562946905538,
    0.1531408412214996,
    0.14795630718842445,
];

/// The bits of √½.
const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;

/// Returns (f, k) with x = (1 + f)·2^k and 1 + f between √½ and √2, for positive, finite x.
#[inline(always)]
pub fn decompose<D: Double>(x: D) -> (D, D) {
    let zero = D::splat(0.0);
    let subnormal = x.less(D::splat(f64::MIN_POSITIVE));
    let x = x * D::select(subnormal, D::splat(18_014_398_509_481_984.0), D::splat(1.0));
    let shifted = x.add_bits(D::from_bits((1023 << 52) - ROOT_HALF));
    let mantissa = shifted.and(D::from_bits((1 << 52) - 1)).add_bits(D::from_bits(ROOT_HALF));
    // 2⁵² plus the exponent field.
    let exponent = shifted.exponent_to_low_bits().or(D::splat(4_503_599_627_370_496.0));
    let bias = D::select(subnormal, D::splat(54.0), zero) + D::splat(4_503_599_627_370_496.0 + 1023.0);
    (mantissa - D::splat(1.0), exponent - bias)
}

impl Unary for Ln {
    #[inline(always)]
    fn of<D: Double, L: Level>(x: D) -> D {
        let zero = D::splat(0.0);
        let (f, k) = decompose(x);
        let s = f / (D::splat(2.0) + f);
        let z = s * s;
        // ln(1 + f) = f − (f²/2 − s (f²/2 + R)), R = 2 artanh(s)/s − 2.
        let half = D::splat(0.5) * f * f;
        let small = k * D::splat(LN_2.1);
        let correction = s.mul_add::<L>(half + z * polynomial::<D, L, 7>(z, LOGARITHM), small);
        let (high, low) = fast_sum(k * D::splat(LN_2.0), f);
        let result = high + (low - (half - correction));
        let infinity = D::splat(f64::INFINITY);
        let result = D::select(x.less(infinity), result, x);
        let result = D::select(x.less(zero), D::splat(f64::NAN), result);
        D::select(x.equal(zero), -infinity, result)
    }
}
