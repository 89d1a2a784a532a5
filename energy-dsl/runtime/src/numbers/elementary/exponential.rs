use super::{Double, ROUND, Unary, fast_sum, polynomial};
use crate::numbers::level::Level;

/// The exponential function.
pub struct Exp;

/// ln 2 in two parts. The first has 42 bits: its products with exponents are exact.
pub const LN_2: (f64, f64) = (0.6931471805598903, 5.497923018708371e-14);

/// (eʳ − 1 − r)/r², |r| ≤ ln 2 / 2; relative error of the exponential below 2^−60.3.
const EXPONENTIAL: [f64; 11] = [
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

/// Returns e^(x + low), where `low` is at most a few units in the last place of a large `x`.
#[inline(always)]
pub fn exp_of_sum<D: Double, L: Level>(x: D, low: D) -> D {
    // The result is zero or infinite outside these bounds.
    let x = x.max(D::splat(-746.0)).min(D::splat(710.0));
    let count = x.mul_add::<L>(D::splat(std::f64::consts::LOG2_E), D::splat(ROUND)) - D::splat(ROUND);
    // The product is exact by construction; the difference is exact because the operands are close.
    let coarse = x - count * D::splat(LN_2.0);
    let fine = count * D::splat(LN_2.1);
    let r = coarse - fine;
    let (r, low) = fast_sum(r, ((coarse - r) - fine) + low);
    let (sum, error) = fast_sum(D::splat(1.0), r);
    let power = sum + (r * r).mul_add::<L>(polynomial::<D, L, 11>(r, EXPONENTIAL), low.mul_add::<L>(sum, error));
    // 2^count as two factors, each a normal number, so only the second product rounds if the result is subnormal.
    let biased = D::splat(ROUND + 1023.0);
    let half = count.mul_add::<L>(D::splat(0.5), biased);
    let other = (count - (half - biased)) + biased;
    power * half.low_bits_to_exponent() * other.low_bits_to_exponent()
}

impl Unary for Exp {
    #[inline(always)]
    fn of<D: Double, L: Level>(x: D) -> D {
        exp_of_sum::<D, L>(x, D::splat(0.0))
    }
}
