//! Implements numbers by registers.

use std::fmt::{self, Debug};
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::register::{Register, Scalar};
use crate::numbers::elementary::{Atan2, Binary, Bits, Cos, Exp, Ln, ModerateAtan2, Pow, Sin, Unary, sin_cos};
use crate::numbers::lane::Lane;
use crate::numbers::level::{Kernel, Level};
use crate::numbers::real::Number;
use crate::numbers::unbounded::Unbounded;

/// A register with the arithmetic of a number.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct Lanes<R>(pub(super) R);

impl<R: Register> Debug for Lanes<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries((0..R::LANES).map(|lane| self.extract(lane))).finish()
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl<R: Register> $trait for Lanes<R> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(R::$method(self.0, other.0))
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<R: Register> Neg for Lanes<R> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(R::xor(self.0, R::splat(R::Scalar::SIGN)))
    }
}

impl<R: Register> Lane<R::Scalar> for Lanes<R> {
    const LANES: usize = R::LANES;

    #[inline(always)]
    fn splat(value: R::Scalar) -> Self {
        Self(R::splat(value))
    }
    #[inline(always)]
    fn load(values: &[R::Scalar]) -> Self {
        assert!(values.len() >= R::LANES, "a load of {} lanes from {} numbers", R::LANES, values.len());
        Self(R::load(values))
    }
    #[inline(always)]
    fn store(self, values: &mut [R::Scalar]) {
        assert!(values.len() >= R::LANES, "a store of {} lanes to {} numbers", R::LANES, values.len());
        self.0.store(values);
    }
    #[inline(always)]
    fn from_fn(value: impl FnMut(usize) -> R::Scalar) -> Self {
        Self(R::from_fn(value))
    }
    #[inline(always)]
    fn extract(self, lane: usize) -> R::Scalar {
        assert!(lane < R::LANES, "lane {lane} of {}", R::LANES);
        // The widest register has 16 lanes.
        let mut values = [R::Scalar::default(); 16];
        self.0.store(&mut values);
        values[lane]
    }
    #[inline(always)]
    fn store_transposed(numbers: &[Self], count: usize, out: &mut [R::Scalar], stride: usize) {
        R::store_transposed(numbers, count, out, stride);
    }
    #[inline(always)]
    fn gather(points: &[[R::Scalar; 3]], indices: &[u32]) -> [Self; 3] {
        let [x, y, z] = R::gather(points, indices);
        [Self(x), Self(y), Self(z)]
    }
}

impl<R: Register> Number for Lanes<R> {
    type Mask = R::Mask;
    const WIDE: bool = R::LANES > 1;
    type Unbounded = Unbounded<R::Scalar>;

    fn unbounded(&self, lane: usize) -> Self::Unbounded {
        Unbounded::of(self.extract(lane))
    }
    fn set_lane(&mut self, lane: usize, value: Self::Unbounded) {
        let (old, new) = (*self, value.to_scalar());
        *self = Self::from_fn(|at| if at == lane { new } else { old.extract(at) });
    }
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self::splat(R::Scalar::nearest(value))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(R::sqrt(self.0))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(R::and(self.0, R::splat(R::Scalar::MAGNITUDE)))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // The order of the scalar's `min`: self unless the other is truly smaller.
        Self(R::min(other.0, self.0))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(R::max(other.0, self.0))
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
        if L::FUSED { Self(R::fused(self.0, factor.0, addend.0)) } else { self * factor + addend }
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
            return Self(R::fused(self.0, other.0, (-product).0));
        }
        // Dekker's product.
        let halves = |value: Self| {
            let shifted = Self::splat(R::Scalar::SPLITTER) * value;
            let high = shifted - (shifted - value);
            (high, value - high)
        };
        let ((a, b), (c, d)) = (halves(self), halves(other));
        ((a * c - product) + a * d + b * c) + b * d
    }
    #[inline(always)]
    fn fused_mul_sub<L: Level>(self, factor: Self, subtrahend: Self) -> Self {
        if L::FUSED {
            return Self(R::fused(self.0, factor.0, (-subtrahend).0));
        }
        (self * factor - subtrahend) + self.product_error::<L>(factor)
    }
    #[inline(always)]
    fn root_error<L: Level>(self, root: Self) -> Self {
        if L::FUSED {
            return Self(R::fused((-root).0, root.0, self.0));
        }
        (self - root * root) - root.product_error::<L>(root)
    }
    #[inline(always)]
    fn power_of_two_scale(self) -> Self {
        let exponent = R::and(self.0, R::splat(R::Scalar::INFINITY));
        // The exponent field of the inverse is twice the bias minus the number's field, at least 1. A subnormal number
        // has field 0 and gets the largest power of two. Infinity and NaN wrap to a negative number, which is replaced
        // below, as for zero.
        let inverse = R::sub_bits(R::splat(R::Scalar::LARGEST_POWER), exponent);
        let inverse = R::max(inverse, R::splat(R::Scalar::LEAST_NORMAL));
        let zero = R::splat(R::Scalar::default());
        let special = R::equal(self.0, zero) | R::equal(exponent, R::splat(R::Scalar::INFINITY));
        Self(R::select(special, R::splat(R::Scalar::ONE), inverse))
    }
    #[inline(always)]
    fn is_moderate(self, degree: u8) -> R::Mask {
        let (from, to) = R::Scalar::moderate_bounds(degree);
        R::less_or_equal(R::splat(from), self.0) & R::less(self.0, R::splat(to))
    }
    #[inline(always)]
    fn less(self, other: Self) -> R::Mask {
        R::less(self.0, other.0)
    }
    #[inline(always)]
    fn less_or_equal(self, other: Self) -> R::Mask {
        R::less_or_equal(self.0, other.0)
    }
    #[inline(always)]
    fn equal(self, other: Self) -> R::Mask {
        R::equal(self.0, other.0)
    }
    #[inline(always)]
    fn select(mask: R::Mask, yes: Self, no: Self) -> Self {
        Self(R::select(mask, yes.0, no.0))
    }
    #[inline(always)]
    fn dispatch<K: Kernel>(kernel: K) -> K::Output {
        R::dispatch(kernel)
    }
}

impl<R: Register> Bits for Lanes<R> {
    type Format = R::Scalar;

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(R::and(self.0, other.0))
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(R::or(self.0, other.0))
    }
    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        Self(R::xor(self.0, other.0))
    }
    #[inline(always)]
    fn add_bits(self, other: Self) -> Self {
        Self(R::add_bits(self.0, other.0))
    }
    #[inline(always)]
    fn low_bits_to_exponent(self) -> Self {
        Self(R::low_bits_to_exponent(self.0))
    }
    #[inline(always)]
    fn exponent_to_low_bits(self) -> Self {
        Self(R::exponent_to_low_bits(self.0))
    }
    #[inline(always)]
    fn bit_1_to_sign(self) -> Self {
        Self(R::bit_1_to_sign(self.0))
    }
}
