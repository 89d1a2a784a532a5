use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::cpu::{Scalar, dispatch_scalar};
use super::elementary::{Atan2, Binary, Cos, Exp, Ln, ModerateAtan2, Pow, Sin, Unary, sin_cos};
use super::flags::Flags;
use super::level::{Baseline, Kernel, Level};
use super::unbounded::{Settle, Unbounded};

/// The outcome of a comparison: a `bool`, or one per lane.
pub trait Mask: Copy + Debug + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// Returns the mask that is false in all lanes.
    fn none() -> Self;
    /// Returns the lanes as bits: bit `i` is lane `i`.
    fn bits(self) -> u32;
    /// Creates a mask from bits: lane `i` is bit `i`. Surplus bits are ignored.
    fn from_bits(bits: u32) -> Self;

    /// Returns whether the mask is true in some lane.
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }

    /// Returns whether the mask is true in all lanes.
    #[inline(always)]
    fn all(self) -> bool {
        !(!self).any()
    }

    /// Returns the mask in one lane.
    #[inline(always)]
    fn lane(self, lane: usize) -> bool {
        self.bits() >> lane & 1 != 0
    }
}

impl Mask for bool {
    #[inline(always)]
    fn none() -> Self {
        false
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }

    #[inline(always)]
    fn from_bits(bits: u32) -> Self {
        bits & 1 != 0
    }
}

/// The arithmetic that formulas need. Generated code runs over any [`Real`]; the interpreter runs over any `Number`,
/// which need not be `Copy` (multi-precision numbers are not).
///
/// Operations that depend on the processor take the SIMD [`Level`]: it decides whether products fuse with sums, and so
/// how elementary functions are evaluated.
pub trait Number:
    Sized
    + Clone
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The outcome of a comparison.
    type Mask: Mask;
    /// Whether the type has several lanes, so that a mask may differ between them.
    const WIDE: bool = false;
    /// Single-lane numbers with the same significand and an extended exponent, used for extraordinary configurations. A
    /// type that cannot overflow, or that has no such counterpart, names itself.
    type Unbounded: Number<Unbounded = Self::Unbounded>;

    /// Returns one lane. A scalar has one, number 0.
    fn unbounded(&self, lane: usize) -> Self::Unbounded;
    /// Replaces one lane by the number nearest to `value`.
    fn set_lane(&mut self, lane: usize, value: Self::Unbounded);

    /// Returns the number nearest to a double.
    fn from_f64(value: f64) -> Self;
    /// Returns √self.
    fn sqrt(self) -> Self;
    /// Returns |self|.
    fn abs(self) -> Self;
    /// Returns the smaller of the two.
    fn min(self, other: Self) -> Self;
    /// Returns the larger of the two.
    fn max(self, other: Self) -> Self;
    /// Returns the sine of an angle in radians.
    fn sin<L: Level>(self) -> Self;
    /// Returns the cosine of an angle in radians.
    fn cos<L: Level>(self) -> Self;
    /// Returns sine and cosine of an angle in radians.
    fn sin_cos<L: Level>(self) -> (Self, Self) {
        (self.clone().sin::<L>(), self.cos::<L>())
    }
    /// Returns eˣ.
    fn exp<L: Level>(self) -> Self;
    /// Returns the natural logarithm.
    fn ln<L: Level>(self) -> Self;
    /// Returns the angle of the point (`x`, `self`), in (−π, π].
    fn atan2<L: Level>(self, x: Self) -> Self;
    /// [`Self::atan2`] where `self`² + `x`² [is moderate](Self::is_moderate), of degree 8 at most. Elsewhere the result
    /// is arbitrary.
    fn moderate_atan2<L: Level>(self, x: Self) -> Self {
        self.atan2::<L>(x)
    }
    /// Returns self to a real power.
    fn powf<L: Level>(self, exponent: Self) -> Self;
    /// Returns self · factor + addend, rounded once where the level has fused operations and twice elsewhere.
    fn mul_add<L: Level>(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }
    /// Returns the rounding error of `self + other`: (self + other) − fl(self + other), exactly. Zero in exact
    /// arithmetic.
    fn sum_error(self, other: Self) -> Self;
    /// Returns the rounding error of `self - other`: (self − other) − fl(self − other), exactly. Zero in exact
    /// arithmetic.
    fn difference_error(self, other: Self) -> Self {
        self.sum_error(-other)
    }
    /// Returns the rounding error of `self · other`: self·other − fl(self·other), exactly unless it underflows. Zero in
    /// exact arithmetic.
    fn product_error<L: Level>(self, other: Self) -> Self;
    /// Returns self · factor − subtrahend as if rounded once.
    fn fused_mul_sub<L: Level>(self, factor: Self, subtrahend: Self) -> Self {
        let error = self.clone().product_error::<L>(factor.clone());
        (self * factor - subtrahend) + error
    }
    /// Returns the rounding error of `root` = fl(√self): self − root², rounded once. Zero in exact arithmetic.
    fn root_error<L: Level>(self, root: Self) -> Self {
        let square = root.clone() * root.clone();
        (self - square) - root.clone().product_error::<L>(root)
    }
    /// Returns the power of two s with 1 ≤ s·|self| < 2 if |self| is a normal number; 1 for zero, infinity and NaN.
    /// Multiplying by s is exact. Its derivative is taken as zero: formulas that use it do not depend on it.
    fn power_of_two_scale(self) -> Self;
    /// Returns whether 2^(−80·`degree`) ≤ self < 2^(80·`degree`) (12 instead of 80 in single precision). Such a number
    /// is a product of `degree` moderate lengths: products of up to eight moderate lengths neither overflow nor
    /// underflow, and generated code skips scaling. A type that cannot tell returns false.
    #[allow(clippy::wrong_self_convention)] // numbers are taken by value throughout
    fn is_moderate(self, _degree: u8) -> Self::Mask {
        Self::Mask::none()
    }
    /// Returns self < other.
    fn less(self, other: Self) -> Self::Mask;
    /// Returns self < other, where results are the same for both outcomes.
    #[inline(always)]
    fn precedes(self, other: Self) -> Self::Mask {
        self.less(other)
    }
    /// Returns self ≤ other.
    fn less_or_equal(self, other: Self) -> Self::Mask;
    /// Returns self = other.
    fn equal(self, other: Self) -> Self::Mask;
    /// Returns `yes` where the mask holds, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Returns the number itself, except that a [`Number::Unbounded`] number beyond the bounded type's range, but not
    /// infinite, becomes a large finite one. A few of these can still be added to or subtracted from each other.
    #[must_use]
    fn saturated(self) -> Self {
        self
    }
    /// Returns the number in double precision with an extended exponent; `None` if the type has more digits than that
    /// or is not a plain number.
    #[doc(hidden)]
    fn extended(&self) -> Option<Unbounded<f64>> {
        None
    }
    /// Returns the number nearest to one with an extended exponent. Only types that are [`Number::extended`] need it.
    #[doc(hidden)]
    #[must_use]
    fn of_extended(value: Unbounded<f64>) -> Self {
        Self::from_f64(value.to_scalar())
    }
    /// Returns whether the bounded type has a finite number for it.
    #[doc(hidden)]
    fn is_representable(&self) -> bool {
        (self.clone() - self.clone()).equal(Self::from_f64(0.0)).all()
    }
    /// Runs the general path of a routine over this type.
    #[doc(hidden)]
    fn general_path(path: &impl Settle, inputs: &[Self]) -> (Vec<Self>, Flags<Self>) {
        path.settled(inputs)
    }
    /// Runs a kernel over this type at the level that suits it: the best level of the machine for `f64` and `f32`.
    fn dispatch<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<Baseline>()
    }
}

/// A [`Number`] that generated code can run over.
pub trait Real: Number<Unbounded: Copy> + Copy {}

impl<T: Number<Unbounded: Copy> + Copy> Real for T {}

macro_rules! number_for_float {
    ($float:ident, $bits:ident, $mantissa_bits:literal, $exponent_mask:literal, $bias:literal) => {
        impl Number for $float {
            type Mask = bool;
            type Unbounded = Unbounded<$float>;

            #[inline]
            fn unbounded(&self, _lane: usize) -> Self::Unbounded {
                Unbounded::of(*self)
            }
            #[inline]
            fn set_lane(&mut self, _lane: usize, value: Self::Unbounded) {
                *self = value.to_scalar();
            }
            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as $float
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $float::sqrt(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $float::abs(self)
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if other < self { other } else { self }
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if other > self { other } else { self }
            }
            #[inline(always)]
            fn sin<L: Level>(self) -> Self {
                Sin::of::<Self, L>(self)
            }
            #[inline(always)]
            fn cos<L: Level>(self) -> Self {
                Cos::of::<Self, L>(self)
            }
            #[inline(always)]
            fn sin_cos<L: Level>(self) -> (Self, Self) {
                sin_cos::<Self, L>(self)
            }
            #[inline(always)]
            fn exp<L: Level>(self) -> Self {
                Exp::of::<Self, L>(self)
            }
            #[inline(always)]
            fn ln<L: Level>(self) -> Self {
                Ln::of::<Self, L>(self)
            }
            #[inline(always)]
            fn atan2<L: Level>(self, x: Self) -> Self {
                Atan2::of::<Self, L>(self, x)
            }
            #[inline(always)]
            fn moderate_atan2<L: Level>(self, x: Self) -> Self {
                ModerateAtan2::of::<Self, L>(self, x)
            }
            #[inline(always)]
            fn powf<L: Level>(self, exponent: Self) -> Self {
                Pow::of::<Self, L>(self, exponent)
            }
            #[inline(always)]
            fn mul_add<L: Level>(self, factor: Self, addend: Self) -> Self {
                if L::FUSED { $float::mul_add(self, factor, addend) } else { self * factor + addend }
            }
            #[inline(always)]
            fn sum_error(self, other: Self) -> Self {
                // Knuth's 2Sum.
                let sum = self + other;
                let virtual_other = sum - self;
                (self - (sum - virtual_other)) + (other - virtual_other)
            }
            #[inline(always)]
            fn difference_error(self, other: Self) -> Self {
                // 2Sum without forming −other: one instruction less.
                let difference = self - other;
                let virtual_other = self - difference;
                (self - (difference + virtual_other)) + (virtual_other - other)
            }
            #[inline(always)]
            fn product_error<L: Level>(self, other: Self) -> Self {
                let product = self * other;
                if L::FUSED {
                    return $float::mul_add(self, other, -product);
                }
                // Dekker's product. Without a fused instruction, `mul_add` is a slow library call.
                let halves = |value: $float| {
                    let shifted = <$float as Scalar>::SPLITTER * value;
                    let high = shifted - (shifted - value);
                    (high, value - high)
                };
                let ((a, b), (c, d)) = (halves(self), halves(other));
                ((a * c - product) + a * d + b * c) + b * d
            }
            #[inline(always)]
            fn fused_mul_sub<L: Level>(self, factor: Self, subtrahend: Self) -> Self {
                if L::FUSED {
                    return $float::mul_add(self, factor, -subtrahend);
                }
                (self * factor - subtrahend) + Number::product_error::<L>(self, factor)
            }
            #[inline(always)]
            fn root_error<L: Level>(self, root: Self) -> Self {
                if L::FUSED {
                    return $float::mul_add(-root, root, self);
                }
                (self - root * root) - Number::product_error::<L>(root, root)
            }
            #[inline(always)]
            fn power_of_two_scale(self) -> Self {
                let exponent = (self.to_bits() >> $mantissa_bits) & $exponent_mask;
                let inverse: $bits = match exponent {
                    0 if self != 0.0 => 2 * $bias, // subnormal: the largest power of two there is
                    0 | $exponent_mask => $bias,   // zero, infinity, NaN: 1
                    _ => (2 * $bias - exponent).max(1),
                };
                $float::from_bits(inverse << $mantissa_bits)
            }
            #[inline(always)]
            fn is_moderate(self, degree: u8) -> bool {
                let (from, to) = <$float as Scalar>::moderate_bounds(degree);
                from <= self && self < to
            }
            #[inline(always)]
            fn less(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn less_or_equal(self, other: Self) -> bool {
                self <= other
            }
            #[inline(always)]
            fn equal(self, other: Self) -> bool {
                self == other
            }
            #[inline(always)]
            fn select(mask: bool, yes: Self, no: Self) -> Self {
                if mask { yes } else { no }
            }
            #[inline(always)]
            fn dispatch<K: Kernel>(kernel: K) -> K::Output {
                dispatch_scalar(kernel)
            }
        }
    };
}

number_for_float!(f64, u64, 52, 0x7ff, 1023);
number_for_float!(f32, u32, 23, 0xff, 127);

#[cfg(test)]
mod tests {
    use super::{Baseline, Number};

    #[test]
    fn error_terms_are_exact() {
        let u = f64::EPSILON / 2.0;
        // (1 + 2u)(1 − u) = 1 + u − 2u² rounds to 1.
        assert_eq!(Number::product_error::<Baseline>(1.0 + 2.0 * u, 1.0 - u), u - 2.0 * u * u);
        // Doubles are 2 apart at 1e16: 1e16 + 1 + 2u rounds up.
        assert_eq!(1e16_f64.sum_error(1.0 + 2.0 * u), -1.0 + 2.0 * u);
        assert_eq!(1.0_f32.sum_error(1e-10), 1e-10);
    }

    #[test]
    fn scales_are_powers_of_two_and_bring_numbers_near_one() {
        for value in [1.0, 1.5, -3.0, 1e300, 1e-300, f64::MAX, f64::MIN_POSITIVE, 7e-160] {
            let scaled = (value * value.power_of_two_scale()).abs();
            assert!((1.0..2.0).contains(&scaled) || value == f64::MAX, "{value} scaled to {scaled}");
        }
        assert_eq!(0.0.power_of_two_scale(), 1.0);
        assert_eq!(f64::INFINITY.power_of_two_scale(), 1.0);
        assert_eq!(3e-30_f32.power_of_two_scale().to_bits() << 9, 0);
    }
}
