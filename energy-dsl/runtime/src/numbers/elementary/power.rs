use super::exponential::{LN_2, exp_of_sum};
use super::logarithm::decompose;
use super::{Binary, Double, Exp, Ln, Unary, fast_sum, polynomial, power_of_two};
use crate::numbers::level::Level;

/// A number to a real power.
pub struct Pow;

/// ((artanh(s)/s − 1)/z − 1/3)/z² − 1/(5 z) with z = s², for (1 + s)/(1 − s) from √½ to √2. Its contribution to the
/// logarithm is accurate to 2^−71 of the logarithm.
const TAIL: [f64; 7] = [
    0.1428571428571658,
    0.1111111111000677,
    0.09090909302631021,
    0.0769228645666346,
    0.06667881250806947,
    0.05842527635307529,
    0.05955427637454669,
];

/// ⅓ in two parts.
const THIRD: (f64, f64) = (1.0 / 3.0, 1.850371707708594e-17);

/// Returns a product and its rounding error.
#[inline(always)]
fn product<D: Double, L: Level>(a: D, b: D) -> (D, D) {
    (a * b, a.product_error::<L>(b))
}

/// Returns ln x in two parts, with a relative error of about 2^−65, for positive, finite x.
#[inline(always)]
fn precise_logarithm<D: Double, L: Level>(x: D) -> (D, D) {
    let (f, k) = decompose(x);
    // s = f/(2 + f)
    let (d, d_low) = fast_sum(D::splat(2.0), f);
    let reciprocal = D::splat(1.0) / d;
    let s = f * reciprocal;
    let (back, back_low) = product::<D, L>(s, d);
    let s_low = (((f - back) - back_low) - s * d_low) * reciprocal;
    // artanh s = s + s z (1/3 + z/5 + z² …)
    let (z, z_low) = product::<D, L>(s, s);
    let z_low = z_low + (s + s) * s_low;
    let fifth = z.mul_add::<L>(polynomial::<D, L, 7>(z, TAIL), D::splat(0.2));
    let (c, c_low) = fast_sum(D::splat(THIRD.0), z * fifth);
    let c_low = c_low + z_low.mul_add::<L>(fifth, D::splat(THIRD.1));
    let (u, u_low) = product::<D, L>(z, c);
    let u_low = u_low + (z * c_low + z_low * c);
    let (v, v_low) = product::<D, L>(s, u);
    let v_low = v_low + (s * u_low + s_low * u);
    let (high, low) = fast_sum(s, v);
    let low = low + (v_low + s_low);
    // ln x = k ln 2 + 2 artanh s
    let (sum, error) = fast_sum(k * D::splat(LN_2.0), high + high);
    fast_sum(sum, error + k.mul_add::<L>(D::splat(LN_2.1), low + low))
}

/// Returns whether a non-negative number is an integer.
#[inline(always)]
fn is_integer<D: Double>(x: D) -> D::Mask {
    let all_integers_from = D::splat(4_503_599_627_370_496.0);
    all_integers_from.less_or_equal(x) | ((x + all_integers_from) - all_integers_from).equal(x)
}

/// Clamps the arguments of |x|ʸ: exponents beyond ±2⁶⁶ give the same results as ±2⁶⁶.
#[inline(always)]
fn tame<D: Double>(x: D, y: D) -> (D, D) {
    let bound = D::splat(power_of_two(66));
    (x.abs(), y.max(-bound).min(bound))
}

/// Derives xʸ from |x|ʸ, which must be right unless |x| is zero or infinite.
#[inline(always)]
fn with_special_cases<D: Double>(x: D, y: D, power: D) -> D {
    let (zero, one, infinity) = (D::splat(0.0), D::splat(1.0), D::splat(f64::INFINITY));
    let size = x.abs();
    let (falling, whole) = (y.less(zero), is_integer(y.abs()));
    let power = D::select(size.equal(zero), D::select(falling, infinity, zero), power);
    let power = D::select(size.equal(infinity), D::select(falling, zero, infinity), power);
    let odd = whole & !is_integer(D::splat(0.5) * y.abs());
    let power = power.xor(D::select(odd, x.sign(), zero));
    let real = whole | !x.less(zero) | size.equal(infinity);
    let power = D::select(real & x.equal(x) & y.equal(y), power, D::splat(f64::NAN));
    D::select(x.equal(one) | y.equal(zero), one, power)
}

impl Binary for Pow {
    #[inline(always)]
    fn of<D: Double, L: Level>(x: D, y: D) -> D {
        let (size, factor) = tame(x, y);
        let (high, low) = precise_logarithm::<D, L>(size);
        let (exponent, error) = product::<D, L>(factor, high);
        // If the result overflows or vanishes, the error term would not be small.
        let ordinary = exponent.abs().less(D::splat(1000.0));
        let rest = D::select(ordinary, factor.mul_add::<L>(low, error), D::splat(0.0));
        with_special_cases(x, y, exp_of_sum::<D, L>(exponent, rest))
    }

    #[inline(always)]
    fn of_single<D: Double, L: Level>(x: D, y: D) -> D {
        let (size, factor) = tame(x, y);
        with_special_cases(x, y, Exp::of::<D, L>(factor * Ln::of::<D, L>(size)))
    }
}
