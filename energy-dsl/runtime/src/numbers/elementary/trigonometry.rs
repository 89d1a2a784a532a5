use super::{Double, ROUND, Unary, huge_angle, polynomial};
use crate::numbers::level::Level;
use crate::numbers::real::Mask;

/// The sine.
pub struct Sin;
/// The cosine.
pub struct Cos;

/// π/2 in four parts. The first three have 33 bits: their products with integers below 2²⁰ are exact.
const HALF_PI: [f64; 4] = [1.5707963267341256, 6.077100506303966e-11, 2.0222662487111665e-21, 8.4784276603689e-32];

/// Angles from here on are reduced one lane at a time.
const HUGE: f64 = 1_048_576.0;

/// (sin r − r)/r³ of z = r², |r| ≤ π/4; relative error of the sine below 2^−56.4.
const SINE: [f64; 6] = [
    -0.1666666666666663,
    0.008333333333322108,
    -0.00019841269829580182,
    2.7557313618006984e-06,
    -2.505074721513869e-08,
    1.5896197405403167e-10,
];

/// (cos r − 1 + r²/2)/r⁴ of z = r², |r| ≤ π/4; relative error of the cosine below 2^−59.6.
const COSINE: [f64; 6] = [
    0.041666666666666595,
    -0.001388888888887304,
    2.480158728884133e-05,
    -2.7557314176214795e-07,
    2.0875700412150045e-09,
    -1.1358513730492512e-11,
];

/// A non-negative angle as a multiple of π/2 (in the low bits) and a remainder of magnitude at most π/4, in two parts.
struct Reduced<D> {
    quadrant: D,
    high: D,
    low: D,
}

#[inline(always)]
fn reduce<D: Double, L: Level>(x: D) -> Reduced<D> {
    let quadrant = x.mul_add::<L>(D::splat(std::f64::consts::FRAC_2_PI), D::splat(ROUND));
    let count = quadrant - D::splat(ROUND);
    // The product is exact by construction; the difference is exact because the operands are close.
    let first = x - count * D::splat(HALF_PI[0]);
    let second = -(count * D::splat(HALF_PI[1]));
    let third = -(count * D::splat(HALF_PI[2]));
    let coarse = first + second;
    let fine = coarse + third;
    let error = first.sum_error(second) + coarse.sum_error(third);
    let rest = error - count * D::splat(HALF_PI[3]);
    let high = fine + rest;
    let mut reduced = Reduced { quadrant, high, low: rest - (high - fine) };
    let huge = !x.less(D::splat(HUGE));
    if huge.any() {
        let (mut angles, mut parts) = ([0.0; 8], [[0.0; 8]; 3]);
        x.store(&mut angles);
        for (part, of) in parts.iter_mut().zip([reduced.quadrant, reduced.high, reduced.low]) {
            of.store(part);
        }
        huge_angle::reduce(&angles[..D::LANES], huge.bits(), &mut parts);
        let [quadrant, high, low] = parts.map(|part| D::load(&part));
        reduced = Reduced { quadrant, high, low };
    }
    reduced
}

/// Returns sine and cosine together.
#[inline(always)]
pub fn sin_cos<D: Double, L: Level>(x: D) -> (D, D) {
    let Reduced { quadrant, high: r, low } = reduce::<D, L>(x.abs());
    let one = D::splat(1.0);
    let z = r * r;
    let half = D::splat(0.5) * z;
    let sine = {
        let correction = low - low * half;
        r + (z * r).mul_add::<L>(polynomial::<D, L, 6>(z, SINE), correction)
    };
    let cosine = {
        // The rounding error of 1 − z/2 is added to the remainder.
        let main = one - half;
        let rest = (one - main) - half;
        main + ((z * z).mul_add::<L>(polynomial::<D, L, 6>(z, COSINE), rest) - r * low)
    };
    // Compared as numbers near 1 whose lowest bit is the lowest bit of the quadrant.
    let even = quadrant.and(D::from_bits(1)).or(one).equal(one);
    let sine_sign = quadrant.bit_1_to_sign().xor(x.sign());
    let cosine_sign = (quadrant + one).bit_1_to_sign();
    (D::select(even, sine, cosine).xor(sine_sign), D::select(even, cosine, sine).xor(cosine_sign))
}

impl Unary for Sin {
    #[inline(always)]
    fn of<D: Double, L: Level>(x: D) -> D {
        sin_cos::<D, L>(x).0
    }
}

impl Unary for Cos {
    #[inline(always)]
    fn of<D: Double, L: Level>(x: D) -> D {
        sin_cos::<D, L>(x).1
    }
}
