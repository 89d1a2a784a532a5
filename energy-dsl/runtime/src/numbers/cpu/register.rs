//! The operations of a processor's register. [`super::lanes`] turns registers into numbers.

use super::lanes::Lanes;
use crate::numbers::elementary::Format;
use crate::numbers::lane::{Lane, check_transposed, gather_by_element, transpose_by_element};
use crate::numbers::level::Kernel;
use crate::numbers::real::{Mask, Number};
use crate::numbers::unbounded::{Settle, Settled, Unbounded};

/// A floating-point number that lanes are made of, with the bit patterns of its format.
pub trait Scalar: Lane<Self> + Number<Mask = bool> + PartialOrd + Default {
    /// The sign bit alone.
    const SIGN: Self;
    /// All bits except the sign.
    const MAGNITUDE: Self;
    /// All exponent bits: the pattern of infinity.
    const INFINITY: Self;
    /// The power of two with twice the bias in its exponent field: the largest one.
    const LARGEST_POWER: Self;
    /// The least normal number, with exponent field 1.
    const LEAST_NORMAL: Self;
    /// Dekker's splitter, 2^⌈p/2⌉ + 1 for p bits of mantissa.
    const SPLITTER: Self;
    /// The number 1.
    const ONE: Self;
    /// Exponent of the least normal number.
    const FIRST: i32;
    /// Exponent of the largest numbers.
    const LAST: i32;
    /// Significands of [`crate::Unbounded`] within these magnitudes are not renormalised.
    const SPAN: (Self, Self);
    /// If exponents differ by more, the smaller number cannot change a sum, fused or not.
    const REACH: i32;

    /// Returns the nearest number to a double.
    fn nearest(value: f64) -> Self;
    /// Converts to double precision.
    fn to_f64(self) -> f64;
    /// Returns the nearest integer; of two, the one further from 0.
    fn round(self) -> Self;
    /// Returns ⌊log₂|self|⌋ of a normal number.
    fn exponent(self) -> i32;
    /// Returns 2^exponent, a normal number.
    fn power_of_two(exponent: i32) -> Self;
    /// Returns the bounds within which [`crate::Number::is_moderate`] holds.
    fn moderate_bounds(degree: u8) -> (Self, Self);
    /// Runs the general path of a routine in this precision.
    fn unbounded_path(path: &impl Settle, inputs: &[Unbounded<Self>]) -> Settled<Self>;
}

macro_rules! scalar {
    (
        $float:ident, $bits:ident, $settled:ident, $mantissa_bits:literal, $bias:literal, $splitter:literal,
        $moderate:literal, $span:literal, $reach:literal
    ) => {
        impl Scalar for $float {
            const SIGN: Self = -0.0;
            const MAGNITUDE: Self = $float::from_bits($bits::MAX >> 1);
            const INFINITY: Self = $float::INFINITY;
            const LARGEST_POWER: Self = $float::from_bits((2 * $bias) << $mantissa_bits);
            const LEAST_NORMAL: Self = $float::MIN_POSITIVE;
            const SPLITTER: Self = $splitter;
            const ONE: Self = 1.0;
            const FIRST: i32 = 1 - $bias;
            const LAST: i32 = $bias;
            const SPAN: (Self, Self) = (1.0 / $span, $span);
            const REACH: i32 = $reach;

            #[inline(always)]
            fn nearest(value: f64) -> Self {
                value as $float
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn round(self) -> Self {
                $float::round(self)
            }
            #[inline(always)]
            fn exponent(self) -> i32 {
                ((self.to_bits() << 1) >> ($mantissa_bits + 1)) as i32 - $bias
            }
            #[inline(always)]
            fn power_of_two(exponent: i32) -> Self {
                $float::from_bits(((exponent + $bias) as $bits) << $mantissa_bits)
            }
            #[inline(always)]
            fn moderate_bounds(degree: u8) -> (Self, Self) {
                let limit = $moderate * $bits::from(degree);
                let power = |exponent: $bits| $float::from_bits(exponent << $mantissa_bits);
                (power($bias - limit), power($bias + limit))
            }
            fn unbounded_path(path: &impl Settle, inputs: &[Unbounded<Self>]) -> Settled<Self> {
                path.$settled(inputs)
            }
        }
    };
}

// Products of two full significands, and a third number shifted by the reach, are normal numbers.
scalar!(f64, u64, in_double, 52, 1023, 134_217_729.0, 80, 340_282_366_920_938_463_463_374_607_431_768_211_456.0, 500);
scalar!(f32, u32, in_single, 23, 127, 4097.0, 12, 16.0, 95);

/// A register of numbers. If it needs processor features, it is used only in kernels that run at the level of the
/// register.
pub trait Register: Copy {
    /// The type of one lane.
    type Scalar: Format;
    /// The outcome of a comparison.
    type Mask: Mask;
    /// Number of lanes.
    const LANES: usize;

    /// Runs a kernel at the level of the register.
    fn dispatch<K: Kernel>(kernel: K) -> K::Output;

    /// Returns the same number in every lane.
    fn splat(value: Self::Scalar) -> Self;
    /// Reads a slice that is long enough.
    fn load(values: &[Self::Scalar]) -> Self;
    /// Writes a slice that is long enough.
    fn store(self, values: &mut [Self::Scalar]);
    /// Returns `value(i)` in lane `i`.
    fn from_fn(value: impl FnMut(usize) -> Self::Scalar) -> Self;

    /// Returns a + b.
    fn add(a: Self, b: Self) -> Self;
    /// Returns a − b.
    fn sub(a: Self, b: Self) -> Self;
    /// Returns a · b.
    fn mul(a: Self, b: Self) -> Self;
    /// Returns a / b.
    fn div(a: Self, b: Self) -> Self;
    /// Returns √a.
    fn sqrt(a: Self) -> Self;
    /// Returns a · b + c, rounded once.
    fn fused(a: Self, b: Self, c: Self) -> Self;
    /// Returns a < b ? a : b.
    fn min(a: Self, b: Self) -> Self;
    /// Returns a > b ? a : b.
    fn max(a: Self, b: Self) -> Self;

    /// Returns a < b.
    fn less(a: Self, b: Self) -> Self::Mask;
    /// Returns a ≤ b.
    fn less_or_equal(a: Self, b: Self) -> Self::Mask;
    /// Returns a = b.
    fn equal(a: Self, b: Self) -> Self::Mask;
    /// Returns `yes` where the mask holds, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// Bitwise and.
    fn and(a: Self, b: Self) -> Self;
    /// Bitwise or.
    fn or(a: Self, b: Self) -> Self;
    /// Bitwise exclusive or.
    fn xor(a: Self, b: Self) -> Self;
    /// Adds the bit patterns as integers.
    fn add_bits(a: Self, b: Self) -> Self;
    /// Subtracts the bit patterns as integers.
    fn sub_bits(a: Self, b: Self) -> Self;

    /// Gathers points, as [`Lane::gather`] does.
    #[inline(always)]
    fn gather(points: &[[Self::Scalar; 3]], indices: &[u32]) -> [Self; 3] {
        gather_by_element::<_, Lanes<Self>>(points, indices).map(|lanes| lanes.0)
    }

    /// Writes lanes as rows, as [`Lane::store_transposed`] does.
    #[inline(always)]
    fn store_transposed(numbers: &[Lanes<Self>], count: usize, out: &mut [Self::Scalar], stride: usize) {
        check_transposed::<_, Lanes<Self>>(numbers.len(), count, out.len(), stride);
        transpose_by_element(numbers, count, out, stride);
    }

    /// Shifts each lane left by the bits of the mantissa.
    fn low_bits_to_exponent(a: Self) -> Self;
    /// Shifts each lane right by the bits of the mantissa.
    fn exponent_to_low_bits(a: Self) -> Self;
    /// Shifts bit 1 to the sign and keeps only the sign bit.
    fn bit_1_to_sign(a: Self) -> Self;
}
