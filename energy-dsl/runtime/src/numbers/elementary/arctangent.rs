use super::{Binary, Double, fast_sum, polynomial, power_of_two};
use crate::numbers::level::Level;

/// The angle of the point (x, y); y is the first argument.
pub struct Atan2;

/// The angle of a point whose distance from the origin is between 2^−320 and 2^320. Same bits as [`Atan2`], without the
/// special cases.
pub struct ModerateAtan2;

/// π/4 in two parts. The first part ends in three zero bits, so its products with 2, 3 and 4 are exact.
const QUARTER_PI: (f64, f64) = (std::f64::consts::FRAC_PI_4, 3.061616997868383e-17);

/// (atan t − t)/t³ of z = t², |t| ≤ tan π/8; relative error of the arc tangent below 2^−58.3.
const ARC_TANGENT: [f64; 12] = [
    -0.33333333333333326,
    0.19999999999997647,
    -0.14285714285385662,
    0.11111111088051101,
    -0.0909090814058287,
    0.0769228268201909,
    -0.06666225791595612,
    0.05877013801782385,
    -0.05218361411012888,
    0.045034060305270976,
    -0.03347178443649261,
    0.01519305869190648,
];

/// Returns n/d in two parts, given the rounded quotient. Its remainder n − quotient·d is exact, fused or not.
#[inline(always)]
fn remainder<D: Double, L: Level>(n: D, quotient: D, d: D) -> D {
    if L::FUSED { (-quotient).mul_add::<L>(d, n) } else { (n - quotient * d) - quotient.product_error::<L>(d) }
}

impl Binary for Atan2 {
    #[inline(always)]
    fn of<D: Double, L: Level>(y: D, x: D) -> D {
        let (zero, one) = (D::splat(0.0), D::splat(1.0));
        let Octant { steep, less, more } = octant(y, x);
        // 0/0 counts as 0, ∞/∞ as 1, and finite/∞ as 0.
        let infinity = D::splat(f64::INFINITY);
        let infinite = more.equal(infinity);
        let less = D::select(infinite, D::select(less.equal(infinity), one, zero), less);
        let more = D::select(infinite | more.equal(zero), one, more);
        // The scale prevents overflow below; a quotient underflows only if it is subnormal.
        let scale = D::select(
            more.less(D::splat(power_of_two(-400))),
            D::splat(power_of_two(600)),
            D::splat(power_of_two(400)),
        );
        let scale = D::select(D::splat(power_of_two(500)).less(more), D::splat(power_of_two(-300)), scale);
        let angle = angle::<D, L>(y, x, Octant { steep, less: less * scale, more: more * scale });
        D::select(x.equal(x) & y.equal(y), angle, x + y)
    }
}

impl Binary for ModerateAtan2 {
    #[inline(always)]
    fn of<D: Double, L: Level>(y: D, x: D) -> D {
        let Octant { steep, less, more } = octant(y, x);
        // The smaller coordinate may be as small as doubles get.
        let scale = D::splat(power_of_two(400));
        angle::<D, L>(y, x, Octant { steep, less: less * scale, more: more * scale })
    }
}

/// The magnitudes of a point's coordinates in order, and whether |y| is the larger.
struct Octant<D: Double> {
    steep: D::Mask,
    less: D,
    more: D,
}

#[inline(always)]
fn octant<D: Double>(y: D, x: D) -> Octant<D> {
    let (width, height) = (x.abs(), y.abs());
    let steep = width.less(height);
    Octant { steep, less: D::select(steep, width, height), more: D::select(steep, height, width) }
}

/// Returns the angle of a point with equally scaled magnitudes that are normal numbers.
#[inline(always)]
fn angle<D: Double, L: Level>(y: D, x: D, Octant { steep, less, more }: Octant<D>) -> D {
    let (zero, one, two, four) = (D::splat(0.0), D::splat(1.0), D::splat(2.0), D::splat(4.0));
    // Angles above π/8 are π/4 + atan((less − more)/(less + more)).
    let far = (D::splat(0.414_213_562_373_095) * more).less(less);
    let (difference, difference_error) = fast_sum(more, -less);
    let (sum, sum_error) = fast_sum(more, less);
    let numerator = D::select(far, -difference, less);
    let denominator = D::select(far, sum, more);
    let reciprocal = one / denominator;
    let t = numerator * reciprocal;
    let errors = D::select(far, -(difference_error + t * sum_error), zero);
    let rest = (remainder::<D, L>(numerator, t, denominator) + errors) * reciprocal;
    let z = t * t;
    let correction = (t * z).mul_add::<L>(polynomial::<D, L, 12>(z, ARC_TANGENT), rest - rest * z);
    // The angle is base ± (t + correction); base is a multiple of π/4.
    let left = one.or(x.sign()).less(zero);
    let quarters = D::select(far, one, zero);
    let quarters = D::select(steep, two - quarters, quarters);
    let quarters = D::select(left, four - quarters, quarters);
    let sign = D::select(steep, D::splat(-0.0), zero).xor(x.sign());
    let (high, low) = fast_sum(quarters * D::splat(QUARTER_PI.0), t.xor(sign));
    let rest = quarters.mul_add::<L>(D::splat(QUARTER_PI.1), correction.xor(sign));
    (high + (low + rest)).xor(y.sign())
}
