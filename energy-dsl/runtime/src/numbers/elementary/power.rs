use super::exponential::{Exponential, exp_of_sum};
use super::logarithm::decompose;
use super::{Binary, Bits, Format, fast_sum, horner, polynomial, power_of_two};
use crate::numbers::cpu::Scalar;
use crate::numbers::level::Level;

/// A number to a real power.
pub struct Pow;

/// The constants of the power in one precision.
pub trait Power: Scalar {
    /// ⅓ in two parts.
    const THIRD: (Self, Self);
    /// Powers whose logarithms are larger are zero or infinite.
    const LARGEST_LOGARITHM: Self;

    /// Returns ((artanh(s)/s − 1)/z − 1/3)/z² − 1/(5 z) with z = s², for (1 + s)/(1 − s) from √½ to √2.
    fn artanh_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D;
}

impl Power for f64 {
    const THIRD: (Self, Self) = (1.0 / 3.0, 1.850371707708594e-17);
    const LARGEST_LOGARITHM: Self = 1000.0;

    /// Its contribution to the logarithm is accurate to 2^−71 of the logarithm.
    #[inline(always)]
    fn artanh_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D {
        let coefficients = [
            0.1428571428571658,
            0.1111111111000677,
            0.09090909302631021,
            0.0769228645666346,
            0.06667881250806947,
            0.05842527635307529,
            0.05955427637454669,
        ];
        polynomial::<D, L, 7>(z, coefficients)
    }
}

impl Power for f32 {
    const THIRD: (Self, Self) = (1.0 / 3.0, -9.934_108e-9);
    const LARGEST_LOGARITHM: Self = 128.0;

    /// Its contribution to the logarithm is accurate to 2^−43 of the logarithm.
    #[inline(always)]
    fn artanh_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D {
        horner::<D, L, _>(z, [0.142_857_98, 0.110_991_35, 0.096_325_72])
    }
}

/// Returns a product and its rounding error.
#[inline(always)]
fn product<D: Bits, L: Level>(a: D, b: D) -> (D, D) {
    (a * b, a.product_error::<L>(b))
}

/// Returns ln x in two parts, with a relative error of about 2^−65 (2^−36 in single precision), for positive, finite x.
#[inline(always)]
fn precise_logarithm<D: Bits, L: Level>(x: D) -> (D, D) {
    let (f, k) = decompose(x);
    // s = f/(2 + f)
    let (d, d_low) = fast_sum(D::from_f64(2.0), f);
    let reciprocal = D::from_f64(1.0) / d;
    let s = f * reciprocal;
    let (back, back_low) = product::<D, L>(s, d);
    let s_low = (((f - back) - back_low) - s * d_low) * reciprocal;
    // artanh s = s + s z (1/3 + z/5 + z² …)
    let (z, z_low) = product::<D, L>(s, s);
    let z_low = z_low + (s + s) * s_low;
    let fifth = z.mul_add::<L>(D::Format::artanh_rest::<D, L>(z), D::from_f64(0.2));
    let (c, c_low) = fast_sum(D::splat(D::Format::THIRD.0), z * fifth);
    let c_low = c_low + z_low.mul_add::<L>(fifth, D::splat(D::Format::THIRD.1));
    let (u, u_low) = product::<D, L>(z, c);
    let u_low = u_low + (z * c_low + z_low * c);
    let (v, v_low) = product::<D, L>(s, u);
    let v_low = v_low + (s * u_low + s_low * u);
    let (high, low) = fast_sum(s, v);
    let low = low + (v_low + s_low);
    // ln x = k ln 2 + 2 artanh s
    let (sum, error) = fast_sum(k * D::splat(D::Format::LN_2.0), high + high);
    fast_sum(sum, error + k.mul_add::<L>(D::splat(D::Format::LN_2.1), low + low))
}

/// Returns whether a non-negative number is an integer.
#[inline(always)]
fn is_integer<D: Bits>(x: D) -> D::Mask {
    let all_integers_from = D::splat(D::Format::ALL_INTEGERS);
    all_integers_from.less_or_equal(x) | ((x + all_integers_from) - all_integers_from).equal(x)
}

/// Clamps the arguments of |x|ʸ: exponents beyond ±2⁶⁶ give the same results as ±2⁶⁶.
#[inline(always)]
fn tame<D: Bits>(x: D, y: D) -> (D, D) {
    let bound = power_of_two::<D>(66);
    (x.abs(), y.max(-bound).min(bound))
}

/// Derives xʸ from |x|ʸ, which must be right unless |x| is zero or infinite.
#[inline(always)]
fn with_special_cases<D: Bits>(x: D, y: D, power: D) -> D {
    let (zero, one, infinity) = (D::from_f64(0.0), D::from_f64(1.0), D::splat(D::Format::INFINITY));
    let size = x.abs();
    let (falling, whole) = (y.less(zero), is_integer(y.abs()));
    let power = D::select(size.equal(zero), D::select(falling, infinity, zero), power);
    let power = D::select(size.equal(infinity), D::select(falling, zero, infinity), power);
    let odd = whole & !is_integer(D::from_f64(0.5) * y.abs());
    let power = power.xor(D::select(odd, x.sign(), zero));
    let real = whole | !x.less(zero) | size.equal(infinity);
    let power = D::select(real & x.equal(x) & y.equal(y), power, D::from_f64(f64::NAN));
    D::select(x.equal(one) | y.equal(zero), one, power)
}

impl Binary for Pow {
    #[inline(always)]
    fn of<D: Bits, L: Level>(x: D, y: D) -> D {
        let (size, factor) = tame(x, y);
        let (high, low) = precise_logarithm::<D, L>(size);
        let (exponent, error) = product::<D, L>(factor, high);
        // If the result overflows or vanishes, the error term would not be small.
        let ordinary = exponent.abs().less(D::splat(D::Format::LARGEST_LOGARITHM));
        let rest = D::select(ordinary, factor.mul_add::<L>(low, error), D::from_f64(0.0));
        with_special_cases(x, y, exp_of_sum::<D, L>(exponent, rest))
    }
}
