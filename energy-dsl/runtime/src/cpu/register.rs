//! What a processor's register can do. [`super::lanes`] makes numbers of registers.

use super::lane::{Lane, check_transposed, gather_by_element, transpose_by_element};
use super::lanes::Lanes;
use super::{Kernel, Level};
use crate::elementary::{Binary, Unary};
use crate::flags::Flags;
use crate::real::{Mask, Number};
use crate::unbounded::{Unbounded, WithCare};

/// A floating-point number that lanes are made of, with the bit patterns that work on it needs.
pub trait Scalar: Lane<Self> + Number<Mask = bool> + PartialOrd + Default {
    /// Only the sign bit.
    const SIGN: Self;
    /// All bits but the sign.
    const MAGNITUDE: Self;
    /// All bits of the exponent: the pattern of infinity.
    const INFINITY: Self;
    /// Its exponent field is twice the bias: the largest power of two.
    const LARGEST_POWER: Self;
    /// The least normal number: exponent field 1.
    const LEAST_NORMAL: Self;
    /// Dekker's splitter, 2^⌈p/2⌉ + 1 for p bits of mantissa.
    const SPLITTER: Self;
    /// The number one.
    const ONE: Self;
    /// The exponent of the least normal number.
    const FIRST: i32;
    /// The exponent of the largest numbers.
    const LAST: i32;
    /// Between which magnitudes significands of [`crate::Unbounded`] are left as they are.
    const SPAN: (Self, Self);
    /// Numbers whose exponents differ by more do not meet in a sum, nor in a fused one.
    const REACH: i32;

    /// The number nearest to a double.
    fn nearest(value: f64) -> Self;
    /// In double precision.
    fn to_f64(self) -> f64;
    /// ⌊log₂|self|⌋ of a normal number.
    fn exponent(self) -> i32;
    /// 2^exponent, a normal number.
    fn power_of_two(exponent: i32) -> Self;
    /// From where to where [`crate::Number::is_moderate`] holds.
    fn moderate_bounds(degree: u8) -> (Self, Self);
    /// Runs a routine with all precautions in this precision.
    fn run_unbounded<W: WithCare<INPUTS, OUTPUTS>, const INPUTS: usize, const OUTPUTS: usize>(
        inputs: &[Unbounded<Self>; INPUTS],
    ) -> ([Unbounded<Self>; OUTPUTS], Flags<Unbounded<Self>>);
}

macro_rules! scalar {
    ($float:ident, $bits:ident, $run_with_care:expr, $mantissa_bits:literal, $bias:literal, $splitter:literal, $moderate:literal, $span:literal, $reach:literal) => {
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
            fn run_unbounded<W: WithCare<INPUTS, OUTPUTS>, const INPUTS: usize, const OUTPUTS: usize>(
                inputs: &[Unbounded<Self>; INPUTS],
            ) -> ([Unbounded<Self>; OUTPUTS], Flags<Unbounded<Self>>) {
                $run_with_care(inputs)
            }
        }
    };
}

// Products of two significands, with all their bits, and a third number shifted by the reach, are normal numbers.
scalar!(
    f64,
    u64,
    |inputs| (W::compiled().double)(inputs),
    52,
    1023,
    134_217_729.0,
    80,
    340_282_366_920_938_463_463_374_607_431_768_211_456.0,
    500
);
scalar!(f32, u32, W::run, 23, 127, 4097.0, 12, 16.0, 95);

/// A register of numbers. Where it needs features of the processor, it is used in kernels run at [`Self::Level`] only.
pub trait Register: Copy {
    /// One of the numbers.
    type Scalar: Scalar;
    /// The outcome of a comparison.
    type Mask: Mask;
    /// How many there are.
    const LANES: usize;

    /// Runs a kernel at the level that the register is of.
    fn dispatch<K: Kernel>(kernel: K) -> K::Output;

    /// The same number everywhere.
    fn splat(value: Self::Scalar) -> Self;
    /// The numbers of a slice that is long enough.
    fn load(values: &[Self::Scalar]) -> Self;
    /// Writes to a slice that is long enough.
    fn store(self, values: &mut [Self::Scalar]);
    /// The number `value(i)` at place `i`.
    fn from_fn(value: impl FnMut(usize) -> Self::Scalar) -> Self;

    /// a + b.
    fn add(a: Self, b: Self) -> Self;
    /// a − b.
    fn sub(a: Self, b: Self) -> Self;
    /// a · b.
    fn mul(a: Self, b: Self) -> Self;
    /// a / b.
    fn div(a: Self, b: Self) -> Self;
    /// √a.
    fn sqrt(a: Self) -> Self;
    /// a · b + c, rounded once.
    fn fused(a: Self, b: Self, c: Self) -> Self;
    /// a < b ? a : b.
    fn min(a: Self, b: Self) -> Self;
    /// a > b ? a : b.
    fn max(a: Self, b: Self) -> Self;

    /// a < b.
    fn less(a: Self, b: Self) -> Self::Mask;
    /// a ≤ b.
    fn less_or_equal(a: Self, b: Self) -> Self::Mask;
    /// a = b.
    fn equal(a: Self, b: Self) -> Self::Mask;
    /// `yes` where the mask holds, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// Bits that both have.
    fn and(a: Self, b: Self) -> Self;
    /// Bits that either has.
    fn or(a: Self, b: Self) -> Self;
    /// Bits that just one has.
    fn xor(a: Self, b: Self) -> Self;
    /// The sum of the bit patterns as integers.
    fn add_bits(a: Self, b: Self) -> Self;
    /// The difference of the bit patterns as integers.
    fn sub_bits(a: Self, b: Self) -> Self;

    /// [`Lane::gather`].
    #[inline(always)]
    fn gather(points: &[[Self::Scalar; 3]], indices: &[u32]) -> [Self; 3] {
        gather_by_element::<_, Lanes<Self>>(points, indices).map(|lanes| lanes.0)
    }

    /// [`Lane::store_transposed`].
    #[inline(always)]
    fn store_transposed(numbers: &[Lanes<Self>], count: usize, out: &mut [Self::Scalar], stride: usize) {
        check_transposed::<_, Lanes<Self>>(numbers.len(), count, out.len(), stride);
        transpose_by_element(numbers, count, out, stride);
    }

    /// An elementary function of each number.
    fn unary<F: Unary, L: Level>(a: Self) -> Self;
    /// Sine and cosine of each number.
    fn sin_cos<L: Level>(a: Self) -> (Self, Self);
    /// An elementary function of each pair of numbers.
    fn binary<F: Binary, L: Level>(a: Self, b: Self) -> Self;
}

/// A register of doubles, with the shifts that elementary functions need.
pub trait DoubleRegister: Register<Scalar = f64> {
    /// Each shifted to the left by 52 bits.
    fn low_bits_to_exponent(a: Self) -> Self;
    /// Each shifted to the right by 52 bits.
    fn exponent_to_low_bits(a: Self) -> Self;
    /// Each shifted to the left by 62 bits, the sign bit kept.
    fn bit_1_to_sign(a: Self) -> Self;
}

/// A register of single-precision numbers, half of which fill one of doubles.
pub trait SingleRegister: Register<Scalar = f32> {
    /// As many bits of doubles.
    type Double: DoubleRegister;

    /// Both halves in double precision.
    fn widen(a: Self) -> [Self::Double; 2];
    /// Both halves, rounded.
    fn narrow(halves: [Self::Double; 2]) -> Self;
}

/// Elementary functions of a register of doubles.
macro_rules! elementary_of_doubles {
    () => {
        #[inline(always)]
        fn unary<F: Unary, L: Level>(a: Self) -> Self {
            F::of::<_, L>(Lanes(a)).0
        }
        #[inline(always)]
        fn sin_cos<L: Level>(a: Self) -> (Self, Self) {
            let (sine, cosine) = sin_cos::<_, L>(Lanes(a));
            (sine.0, cosine.0)
        }
        #[inline(always)]
        fn binary<F: Binary, L: Level>(a: Self, b: Self) -> Self {
            F::of::<_, L>(Lanes(a), Lanes(b)).0
        }
    };
}

/// Elementary functions of a register of single-precision numbers: by way of doubles. (Not with closures, which would not be
/// compiled for the level.)
macro_rules! elementary_of_singles {
    () => {
        #[inline(always)]
        fn unary<F: Unary, L: Level>(a: Self) -> Self {
            let [low, high] = Self::widen(a);
            Self::narrow([F::of::<_, L>(Lanes(low)).0, F::of::<_, L>(Lanes(high)).0])
        }
        #[inline(always)]
        fn sin_cos<L: Level>(a: Self) -> (Self, Self) {
            let [low, high] = Self::widen(a);
            let (low, high) = (sin_cos::<_, L>(Lanes(low)), sin_cos::<_, L>(Lanes(high)));
            (Self::narrow([low.0.0, high.0.0]), Self::narrow([low.1.0, high.1.0]))
        }
        #[inline(always)]
        fn binary<F: Binary, L: Level>(a: Self, b: Self) -> Self {
            let ([a_low, a_high], [b_low, b_high]) = (Self::widen(a), Self::widen(b));
            let low = F::of_single::<_, L>(Lanes(a_low), Lanes(b_low)).0;
            let high = F::of_single::<_, L>(Lanes(a_high), Lanes(b_high)).0;
            Self::narrow([low, high])
        }
    };
}

pub(super) use {elementary_of_doubles, elementary_of_singles};
