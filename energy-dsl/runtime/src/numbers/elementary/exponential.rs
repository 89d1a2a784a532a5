use super::{Bits, Format, Unary, fast_sum, horner, polynomial};
use crate::numbers::cpu::Scalar;
use crate::numbers::level::Level;

/// The exponential function.
pub struct Exp;

/// The constants of the exponential function in one precision.
pub trait Exponential: Scalar {
    /// The result is zero or infinite outside these bounds.
    const RANGE: (Self, Self);
    /// 1/ln 2.
    const LOG2_E: Self;
    /// ln 2 in two parts. The first has so few bits that its products with exponents are exact.
    const LN_2: (Self, Self);

    /// Returns (eʳ − 1 − r)/r², |r| ≤ ln 2 / 2.
    fn exponential_rest<D: Bits<Format = Self>, L: Level>(r: D) -> D;
}

impl Exponential for f64 {
    const RANGE: (Self, Self) = (-746.0, 710.0);
    const LOG2_E: Self = std::f64::consts::LOG2_E;
    // The first part has 42 bits.
    const LN_2: (Self, Self) = (0.6931471805598903, 5.497923018708371e-14);

    /// Relative error of the exponential below 2^−60.3.
    #[inline(always)]
    fn exponential_rest<D: Bits<Format = Self>, L: Level>(r: D) -> D {
        let coefficients = [
            0.5,
            0.16666666666666682,
            0.041666666666666095,
            0.008333333333317023,
            0.001388888888911561,
            0.0001984126989641349,
            2.4801586926727148e-05,
            2.7557234830782365e-06,
            2.755758172396617e-07,
            2.51120481278516e-08,
            2.0826678703672504e-09,
        ];
        polynomial::<D, L, 11>(r, coefficients)
    }
}

impl Exponential for f32 {
    const RANGE: (Self, Self) = (-104.0, 89.0);
    const LOG2_E: Self = std::f32::consts::LOG2_E;
    // The first part has 15 bits.
    const LN_2: (Self, Self) = (0.693_145_75, 1.428_606_8e-6);

    /// Relative error of the exponential below 2^−31.2.
    #[inline(always)]
    fn exponential_rest<D: Bits<Format = Self>, L: Level>(r: D) -> D {
        let coefficients = [0.5, 0.166_666_48, 0.041_666_48, 0.008_337_869, 0.001_393_338_1, 0.000_173_401_33];
        horner::<D, L, _>(r, coefficients)
    }
}

/// Returns e^(x + low), where `low` is at most a few units in the last place of a large `x`.
#[inline(always)]
pub fn exp_of_sum<D: Bits, L: Level>(x: D, low: D) -> D {
    let round = D::splat(D::Format::ROUND);
    let x = x.max(D::splat(D::Format::RANGE.0)).min(D::splat(D::Format::RANGE.1));
    let count = x.mul_add::<L>(D::splat(D::Format::LOG2_E), round) - round;
    // The product is exact by construction; the difference is exact because the operands are close.
    let coarse = x - count * D::splat(D::Format::LN_2.0);
    let fine = count * D::splat(D::Format::LN_2.1);
    let r = coarse - fine;
    let (r, low) = fast_sum(r, ((coarse - r) - fine) + low);
    let (sum, error) = fast_sum(D::from_f64(1.0), r);
    let rest = D::Format::exponential_rest::<D, L>(r);
    let power = sum + (r * r).mul_add::<L>(rest, low.mul_add::<L>(sum, error));
    // 2^count as two factors, each a normal number, so only the second product rounds if the result is subnormal.
    let biased = D::splat(D::Format::ROUND + D::Format::BIAS);
    let half = count.mul_add::<L>(D::from_f64(0.5), biased);
    let other = (count - (half - biased)) + biased;
    power * half.low_bits_to_exponent() * other.low_bits_to_exponent()
}

impl Unary for Exp {
    #[inline(always)]
    fn of<D: Bits, L: Level>(x: D) -> D {
        exp_of_sum::<D, L>(x, D::from_f64(0.0))
    }
}
