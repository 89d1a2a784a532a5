use super::{Binary, Bits, fast_sum, horner, polynomial, power_of_two};
use crate::numbers::cpu::Scalar;
use crate::numbers::level::Level;

/// The angle of the point (x, y); y is the first argument.
pub struct Atan2;

/// The angle of a point whose distance from the origin is between 2^−320 and 2^320 (2^−48 and 2^48 in single
/// precision). Same bits as [`Atan2`], without the special cases.
pub struct ModerateAtan2;

/// The constants of the arc tangent in one precision.
pub trait ArcTangent: Scalar {
    /// π/4 in two parts. The first part ends in three zero bits, so its products with 2, 3 and 4 are exact.
    const QUARTER_PI: (Self, Self);
    /// tan π/8.
    const TAN_8TH_PI: Self;
    /// Points whose larger coordinate is below, between and above [`Self::SCALE_BOUNDS`] are multiplied by these powers
    /// of two. Then no intermediate result overflows, and a quotient underflows only if it is subnormal.
    const SCALES: [i32; 3];
    /// Exponents of the bounds that [`Self::SCALES`] refers to. The middle covers [`ModerateAtan2`].
    const SCALE_BOUNDS: [i32; 2];

    /// Returns (atan t − t)/t³ of z = t², |t| ≤ tan π/8.
    fn arc_tangent_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D;
}

impl ArcTangent for f64 {
    const QUARTER_PI: (Self, Self) = (std::f64::consts::FRAC_PI_4, 3.061616997868383e-17);
    const TAN_8TH_PI: Self = 0.414_213_562_373_095;
    const SCALES: [i32; 3] = [600, 400, -300];
    const SCALE_BOUNDS: [i32; 2] = [-400, 500];

    /// Relative error of the arc tangent below 2^−58.3.
    #[inline(always)]
    fn arc_tangent_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D {
        let coefficients = [
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
        polynomial::<D, L, 12>(z, coefficients)
    }
}

impl ArcTangent for f32 {
    const QUARTER_PI: (Self, Self) = (f32::from_bits(std::f32::consts::FRAC_PI_4.to_bits() & !7), 1.569_582_4e-7);
    const TAN_8TH_PI: Self = 0.414_213_57;
    const SCALES: [i32; 3] = [127, 63, -16];
    const SCALE_BOUNDS: [i32; 2] = [-49, 49];

    /// Relative error of the arc tangent below 2^−30.4.
    #[inline(always)]
    fn arc_tangent_rest<D: Bits<Format = Self>, L: Level>(z: D) -> D {
        let coefficients = [-0.333_333_16, 0.199_985_28, -0.142_443_91, 0.105_991_684, -0.060_900_52];
        horner::<D, L, _>(z, coefficients)
    }
}

/// Returns n/d in two parts, given the rounded quotient. Its remainder n − quotient·d is exact, fused or not.
#[inline(always)]
fn remainder<D: Bits, L: Level>(n: D, quotient: D, d: D) -> D {
    if L::FUSED { (-quotient).mul_add::<L>(d, n) } else { (n - quotient * d) - quotient.product_error::<L>(d) }
}

impl Binary for Atan2 {
    #[inline(always)]
    fn of<D: Bits, L: Level>(y: D, x: D) -> D {
        let (zero, one) = (D::from_f64(0.0), D::from_f64(1.0));
        let Octant { steep, less, more } = octant(y, x);
        // 0/0 counts as 0, ∞/∞ as 1, and finite/∞ as 0.
        let infinity = D::splat(D::Format::INFINITY);
        let infinite = more.equal(infinity);
        let less = D::select(infinite, D::select(less.equal(infinity), one, zero), less);
        let more = D::select(infinite | more.equal(zero), one, more);
        let [small, moderate, large] = D::Format::SCALES.map(power_of_two::<D>);
        let [lower, upper] = D::Format::SCALE_BOUNDS.map(power_of_two::<D>);
        let scale = D::select(more.less(lower), small, moderate);
        let scale = D::select(upper.less(more), large, scale);
        let angle = angle::<D, L>(y, x, Octant { steep, less: less * scale, more: more * scale });
        D::select(x.equal(x) & y.equal(y), angle, x + y)
    }
}

impl Binary for ModerateAtan2 {
    #[inline(always)]
    fn of<D: Bits, L: Level>(y: D, x: D) -> D {
        let Octant { steep, less, more } = octant(y, x);
        // The smaller coordinate may be as small as numbers get.
        let scale = power_of_two::<D>(D::Format::SCALES[1]);
        angle::<D, L>(y, x, Octant { steep, less: less * scale, more: more * scale })
    }
}

/// The magnitudes of a point's coordinates in order, and whether |y| is the larger.
struct Octant<D: Bits> {
    steep: D::Mask,
    less: D,
    more: D,
}

#[inline(always)]
fn octant<D: Bits>(y: D, x: D) -> Octant<D> {
    let (width, height) = (x.abs(), y.abs());
    let steep = width.less(height);
    Octant { steep, less: D::select(steep, width, height), more: D::select(steep, height, width) }
}

/// Returns the angle of a point with equally scaled magnitudes that are normal numbers.
#[inline(always)]
fn angle<D: Bits, L: Level>(y: D, x: D, Octant { steep, less, more }: Octant<D>) -> D {
    let [zero, one, two, four] = [0.0, 1.0, 2.0, 4.0].map(D::from_f64);
    // Angles above π/8 are π/4 + atan((less − more)/(less + more)).
    let far = (D::splat(D::Format::TAN_8TH_PI) * more).less(less);
    let (difference, difference_error) = fast_sum(more, -less);
    let (sum, sum_error) = fast_sum(more, less);
    let numerator = D::select(far, -difference, less);
    let denominator = D::select(far, sum, more);
    let reciprocal = one / denominator;
    let t = numerator * reciprocal;
    let errors = D::select(far, -(difference_error + t * sum_error), zero);
    let rest = (remainder::<D, L>(numerator, t, denominator) + errors) * reciprocal;
    let z = t * t;
    let correction = (t * z).mul_add::<L>(D::Format::arc_tangent_rest::<D, L>(z), rest - rest * z);
    // The angle is base ± (t + correction); base is a multiple of π/4.
    let left = one.or(x.sign()).less(zero);
    let quarters = D::select(far, one, zero);
    let quarters = D::select(steep, two - quarters, quarters);
    let quarters = D::select(left, four - quarters, quarters);
    let sign = D::select(steep, D::from_f64(-0.0), zero).xor(x.sign());
    let (high, low) = fast_sum(quarters * D::splat(D::Format::QUARTER_PI.0), t.xor(sign));
    let rest = quarters.mul_add::<L>(D::splat(D::Format::QUARTER_PI.1), correction.xor(sign));
    (high + (low + rest)).xor(y.sign())
}
