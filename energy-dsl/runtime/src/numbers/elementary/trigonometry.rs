use super::{Bits, Format, Unary, fast_sum, horner, huge_angle, polynomial};
use crate::numbers::cpu::Scalar;
use crate::numbers::level::Level;

/// Sine of an angle in rad.
pub struct Sin;
/// Cosine of an angle in rad.
pub struct Cos;

/// The constants of sine and cosine in one precision, and how it reduces angles.
pub trait Trigonometry: Scalar {
    /// 2/π.
    const FRAC_2_PI: Self;
    /// Angles from here on are reduced one lane at a time.
    const HUGE: Self;

    /// Returns x − count·π/2 in two parts, for |x| below [`Self::HUGE`] and the integer next to 2 x/π.
    fn remainder<D: Bits<Format = Self>, L: Level>(x: D, count: D) -> (D, D);
    /// Reduces a finite angle from [`Self::HUGE`] on: returns its quadrant plus [`Format::ROUND`], and the remainder in
    /// two parts.
    fn reduce_huge(self) -> [Self; 3];
    /// Returns (sin r − r)/r³ of z = r², |r| ≤ π/4.
    fn sine_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D;
    /// Returns (cos r − 1 + r²/2)/r⁴ of z = r², |r| ≤ π/4.
    fn cosine_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D;
}

impl Trigonometry for f64 {
    const FRAC_2_PI: Self = std::f64::consts::FRAC_2_PI;
    const HUGE: Self = 1_048_576.0;

    #[inline(always)]
    fn remainder<D: Bits<Format = Self>, L: Level>(x: D, count: D) -> (D, D) {
        // π/2 in four parts. The first three have 33 bits: their products with integers below 2²⁰ are exact.
        let half_pi = [1.5707963267341256, 6.077100506303966e-11, 2.0222662487111665e-21, 8.4784276603689e-32];
        let [a, b, c, d] = half_pi.map(D::splat);
        // The product is exact by construction; the difference is exact because the operands are close.
        let first = x - count * a;
        let second = -(count * b);
        let third = -(count * c);
        let coarse = first + second;
        let fine = coarse + third;
        let error = first.sum_error(second) + coarse.sum_error(third);
        let rest = error - count * d;
        let high = fine + rest;
        (high, rest - (high - fine))
    }
    fn reduce_huge(self) -> [Self; 3] {
        huge_angle::reduce_double(self)
    }
    /// Relative error of the sine below 2^−56.4.
    #[inline(always)]
    fn sine_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D {
        let coefficients = [
            -0.1666666666666663,
            0.008333333333322108,
            -0.00019841269829580182,
            2.7557313618006984e-06,
            -2.505074721513869e-08,
            1.5896197405403167e-10,
        ];
        polynomial::<D, L, 6>(z, coefficients)
    }
    /// Relative error of the cosine below 2^−59.6.
    #[inline(always)]
    fn cosine_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D {
        let coefficients = [
            0.041666666666666595,
            -0.001388888888887304,
            2.480158728884133e-05,
            -2.7557314176214795e-07,
            2.0875700412150045e-09,
            -1.1358513730492512e-11,
        ];
        polynomial::<D, L, 6>(z, coefficients)
    }
}

impl Trigonometry for f32 {
    const FRAC_2_PI: Self = std::f32::consts::FRAC_2_PI;
    const HUGE: Self = 65_536.0;

    #[inline(always)]
    fn remainder<D: Bits<Format = Self>, L: Level>(x: D, count: D) -> (D, D) {
        // π/2 in three parts: the nearest number, and the rest in two.
        let [a, b, c] = [std::f32::consts::FRAC_PI_2, -4.371_139e-8, -1.715_124_5e-15].map(D::splat);
        // Exact at all levels: a multiple of the last bit of `a`, or of an `x` below 1, of magnitude below 1.
        let first = -count.fused_mul_sub::<L>(a, x);
        let second = -(count * b);
        let second_error = -count.product_error::<L>(b);
        // FastTwoSum is exact, because the first number is a multiple of the last bit of the second.
        let (coarse, error) = fast_sum(first, second);
        let rest = (error + second_error) - count * c;
        fast_sum(coarse, rest)
    }
    fn reduce_huge(self) -> [Self; 3] {
        huge_angle::reduce_single(self)
    }
    /// Relative error of the sine below 2^−32.4.
    #[inline(always)]
    fn sine_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D {
        horner::<D, L, _>(z, [-0.166_666_67, 0.008_333_379, -0.000_198_530_4, 2.832_010_7e-6])
    }
    /// Relative error of the cosine below 2^−32.9.
    #[inline(always)]
    fn cosine_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D {
        horner::<D, L, _>(z, [0.041_666_646, -0.001_388_730_6, 0.000_024_431_65])
    }
}

/// A non-negative angle as a multiple of π/2 (in the low bits) and a remainder of magnitude at most π/4, in two parts.
struct Reduced<D> {
    quadrant: D,
    high: D,
    low: D,
}

#[inline(always)]
fn reduce<D: Bits, L: Level>(x: D) -> Reduced<D> {
    let round = D::splat(D::Format::ROUND);
    let quadrant = x.mul_add::<L>(D::splat(D::Format::FRAC_2_PI), round);
    let (high, low) = D::Format::remainder::<D, L>(x, quadrant - round);
    let huge = !x.less(D::splat(D::Format::HUGE));
    let [quadrant, high, low] = x.reduced_if_huge(huge, [quadrant, high, low]);
    Reduced { quadrant, high, low }
}

/// Returns sine and cosine together.
#[inline(always)]
pub fn sin_cos<D: Bits, L: Level>(x: D) -> (D, D) {
    let Reduced { quadrant, high: r, low } = reduce::<D, L>(x.abs());
    let one = D::from_f64(1.0);
    let z = r * r;
    let half = D::from_f64(0.5) * z;
    let sine = {
        let correction = low - low * half;
        r + (z * r).mul_add::<L>(D::Format::sine_rest::<D, L>(z), correction)
    };
    let cosine = {
        // The rounding error of 1 − z/2 is added to the remainder.
        let main = one - half;
        let rest = (one - main) - half;
        main + ((z * z).mul_add::<L>(D::Format::cosine_rest::<D, L>(z), rest) - r * low)
    };
    // Compared as numbers near 1 whose lowest bit is the lowest bit of the quadrant.
    let even = quadrant.and(D::splat(D::Format::LOWEST_BIT)).or(one).equal(one);
    let sine_sign = quadrant.bit_1_to_sign().xor(x.sign());
    let cosine_sign = (quadrant + one).bit_1_to_sign();
    (D::select(even, sine, cosine).xor(sine_sign), D::select(even, cosine, sine).xor(cosine_sign))
}

impl Unary for Sin {
    #[inline(always)]
    fn of<D: Bits, L: Level>(x: D) -> D {
        sin_cos::<D, L>(x).0
    }
}

impl Unary for Cos {
    #[inline(always)]
    fn of<D: Bits, L: Level>(x: D) -> D {
        sin_cos::<D, L>(x).1
    }
}
