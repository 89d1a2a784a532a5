//! Numbers with an extended exponent.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::cpu::Scalar;
use super::flags::Flags;
use super::level::Level;
use super::real::Number;

/// The number significand · 2^exponent. It rounds as the floating-point type does, but intermediate results neither
/// overflow nor underflow. Extraordinary configurations are computed with it: edges of length 1e-160, whose squares
/// underflow in doubles, keep all their digits.
///
/// The bits are those of the plain type if that neither overflows nor underflows.
#[derive(Clone, Copy, Debug)]
pub struct Unbounded<S> {
    /// Zero, infinite, NaN, or of a magnitude in [1/`S::SPAN`, `S::SPAN`).
    significand: S,
    exponent: i32,
}

/// Numbers with larger exponents are infinite; those with smaller ones are 0. The bound is out of reach of formulas,
/// and sums of exponents fit in an `i32`.
const LAST_EXPONENT: i32 = 1 << 28;

impl<S: Scalar> Unbounded<S> {
    /// Converts a number of the type, exactly.
    pub(crate) fn of(value: S) -> Self {
        Self::new(value, 0)
    }

    fn new(significand: S, exponent: i32) -> Self {
        let magnitude = significand.abs();
        if S::SPAN.0 <= magnitude && magnitude < S::SPAN.1 && exponent.abs() < LAST_EXPONENT {
            return Self { significand, exponent };
        }
        Self::normalised(significand, exponent)
    }

    fn normalised(significand: S, exponent: i32) -> Self {
        let magnitude = significand.abs();
        let is_plain = magnitude < S::INFINITY && S::default() < magnitude;
        if !is_plain {
            return Self { significand, exponent: 0 };
        }
        if magnitude < S::LEAST_NORMAL {
            return Self::normalised(significand * S::power_of_two(S::REACH), exponent - S::REACH);
        }
        let own = significand.exponent();
        // Two factors, because 2^−own itself may not be a normal number.
        let significand = significand * S::power_of_two(-own / 2) * S::power_of_two(-own - -own / 2);
        match exponent + own {
            e if e >= LAST_EXPONENT => Self { significand: significand * S::INFINITY, exponent: 0 },
            e if e <= -LAST_EXPONENT => Self { significand: significand * S::default(), exponent: 0 },
            exponent => Self { significand, exponent },
        }
    }

    /// Returns significand and exponent, with the significand of a finite nonzero number in [1, 2).
    fn split(self) -> (S, i32) {
        let Self { significand, exponent } = Self::normalised(self.significand, self.exponent);
        (significand, exponent)
    }

    /// Returns whether the number is neither infinite nor NaN. It may be too large for the type.
    pub(crate) fn is_finite(self) -> bool {
        self.significand.abs() < S::INFINITY
    }

    fn is_plain(self) -> bool {
        let magnitude = self.significand.abs();
        S::default() < magnitude && magnitude < S::INFINITY
    }

    /// Returns the nearest number of the type: infinite or 0 if it is out of range.
    pub(crate) fn to_scalar(self) -> S {
        if !self.is_plain() {
            return self.significand;
        }
        let (significand, exponent) = self.split();
        match exponent {
            e if e > S::LAST => significand * S::INFINITY,
            e if e < S::FIRST - 80 => significand * S::default(),
            // The first product is exact, so a subnormal result is rounded once.
            e if e < S::FIRST => significand * S::power_of_two(S::FIRST) * S::power_of_two(e - S::FIRST),
            e => significand * S::power_of_two(e),
        }
    }

    /// Returns whether the number is 0 or a normal number of the type.
    fn fits(self) -> bool {
        let (_, exponent) = self.split();
        (S::FIRST..=S::LAST).contains(&exponent)
    }

    /// Returns both significands for one common exponent. A number too small to change a sum, except by its sign, stays
    /// that small.
    fn aligned(self, other: Self) -> (S, S, i32) {
        let lift = |from: i32, to: i32| S::power_of_two((from - to).max(-S::REACH));
        if self.exponent == other.exponent || !self.is_plain() || !other.is_plain() {
            let exponent = if self.is_plain() { self.exponent } else { other.exponent };
            (self.significand, other.significand, exponent)
        } else if self.exponent > other.exponent {
            (self.significand, other.significand * lift(other.exponent, self.exponent), self.exponent)
        } else {
            (self.significand * lift(self.exponent, other.exponent), other.significand, other.exponent)
        }
    }

    /// Returns self · factor + addend, rounded once.
    fn fused<L: Level>(self, factor: Self, addend: Self) -> Self {
        let (a, b, c) = (self.significand, factor.significand, addend.significand);
        let exponent = self.exponent + factor.exponent;
        if !addend.is_plain() || !self.is_plain() || !factor.is_plain() {
            let exponent = if addend.is_plain() { addend.exponent } else { exponent };
            return Self::new(a.mul_add::<L>(b, c), exponent);
        }
        let shift = addend.exponent - exponent;
        if shift > S::REACH {
            return Self::new((a * S::power_of_two(-S::REACH)).mul_add::<L>(b, c), addend.exponent);
        }
        Self::new(a.mul_add::<L>(b, c * S::power_of_two(shift.max(-S::REACH))), exponent)
    }

    /// Returns ln 2 in two parts.
    fn ln_2() -> (S, S) {
        // ln 2 minus the nearest double.
        const REST: f64 = 2.319_046_813_846_299_6e-17;
        let high = S::nearest(std::f64::consts::LN_2);
        (high, S::nearest((std::f64::consts::LN_2 - high.to_f64()) + REST))
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, |$a:ident, $b:ident| $result:expr) => {
        impl<S: Scalar> $trait for Unbounded<S> {
            type Output = Self;
            // Kept out of line: general paths are thousands of operations and cold, so calls keep them small and quick
            // to compile.
            #[inline(never)]
            fn $method(self, other: Self) -> Self {
                let ($a, $b) = (self, other);
                $result
            }
        }
    };
}

operator!(Add, add, |a, b| {
    let (x, y, exponent) = a.aligned(b);
    Self::new(x + y, exponent)
});
operator!(Sub, sub, |a, b| a + -b);
operator!(Mul, mul, |a, b| Self::new(a.significand * b.significand, a.exponent + b.exponent));
operator!(Div, div, |a, b| Self::new(a.significand / b.significand, a.exponent - b.exponent));

impl<S: Scalar> Neg for Unbounded<S> {
    type Output = Self;
    fn neg(self) -> Self {
        Self { significand: -self.significand, ..self }
    }
}

impl<S: Scalar> Number for Unbounded<S> {
    type Mask = bool;
    type Unbounded = Self;

    fn unbounded(&self, _lane: usize) -> Self {
        *self
    }
    fn set_lane(&mut self, _lane: usize, value: Self) {
        *self = value;
    }

    #[inline(never)]
    fn from_f64(value: f64) -> Self {
        Self::new(S::nearest(value), 0)
    }
    #[inline(never)]
    fn sqrt(self) -> Self {
        if self.exponent % 2 == 0 {
            return Self::new(self.significand.sqrt(), self.exponent / 2);
        }
        Self::new((self.significand + self.significand).sqrt(), (self.exponent - 1) / 2)
    }
    fn abs(self) -> Self {
        Self { significand: self.significand.abs(), ..self }
    }
    #[inline(never)]
    fn min(self, other: Self) -> Self {
        if other.less(self) { other } else { self }
    }
    #[inline(never)]
    fn max(self, other: Self) -> Self {
        if self.less(other) { other } else { self }
    }
    #[inline(never)]
    fn sin<L: Level>(self) -> Self {
        // For |x| < 2⁻⁶⁰ the result is x.
        if self.is_plain() && self.split().1 < -60 { self } else { Self::new(self.to_scalar().sin::<L>(), 0) }
    }
    #[inline(never)]
    fn cos<L: Level>(self) -> Self {
        Self::new(self.to_scalar().cos::<L>(), 0)
    }
    #[inline(never)]
    fn exp<L: Level>(self) -> Self {
        let plain = self.to_scalar();
        let result = plain.exp::<L>();
        let is_normal = S::LEAST_NORMAL <= result && result < S::INFINITY;
        if is_normal || !self.is_plain() || self.split().1 > 24 {
            return Self::new(result, 0);
        }
        // eˣ = 2ᵏ e^(x − k ln 2)
        let (high, low) = Self::ln_2();
        let k = (plain * S::nearest(std::f64::consts::LOG2_E)).round();
        let rest = ((plain - k * high) - k.product_error::<L>(high)) - k * low;
        Self::new(rest.exp::<L>(), k.to_f64() as i32)
    }
    #[inline(never)]
    fn ln<L: Level>(self) -> Self {
        if !self.is_plain() || self.fits() {
            return Self::new(self.to_scalar().ln::<L>(), 0);
        }
        let (significand, exponent) = self.split();
        let ((high, low), k) = (Self::ln_2(), S::nearest(f64::from(exponent)));
        Self::new(k * high + (significand.ln::<L>() + (k.product_error::<L>(high) + k * low)), 0)
    }
    #[inline(never)]
    fn atan2<L: Level>(self, x: Self) -> Self {
        let (y, x_aligned, _) = self.aligned(x);
        // If y is less than the last bit of x > 0, the angle is y/x.
        let is_slight = self.is_plain() && x.is_plain() && S::default() < x.significand;
        let quotient = self / x;
        if is_slight && quotient.split().1 < -80 { quotient } else { Self::new(y.atan2::<L>(x_aligned), 0) }
    }
    #[inline(never)]
    fn powf<L: Level>(self, exponent: Self) -> Self {
        let power = exponent.to_scalar();
        let (significand, own) = self.split();
        let own = S::nearest(f64::from(own));
        let (first, last) = (S::nearest(f64::from(S::FIRST + 2)), S::nearest(f64::from(S::LAST - 1)));
        let (estimate, doubt) = (own * power, power.abs());
        let within = first < estimate - doubt && estimate + doubt < last;
        if !self.is_plain() || (self.fits() && within) {
            return Self::new(self.to_scalar().powf::<L>(power), 0);
        }
        // (m 2ᵉ)ᵖ = mᵖ 2^(frac eᵖ) 2^(whole eᵖ). The first factor may be large or small, too: then it loses some digits.
        let whole = estimate.round();
        let fraction = own.fused_mul_sub::<L>(power, whole);
        let of_significand = match doubt < last {
            true => Self::of(significand.powf::<L>(power)),
            false => Self::of(significand.ln::<L>() * power).exp::<L>(),
        };
        of_significand * Self::new(S::nearest(2.0).powf::<L>(fraction), whole.to_f64() as i32)
    }
    #[inline(never)]
    fn mul_add<L: Level>(self, factor: Self, addend: Self) -> Self {
        if L::FUSED { self.fused::<L>(factor, addend) } else { self * factor + addend }
    }
    #[inline(never)]
    fn sum_error(self, other: Self) -> Self {
        let is_far = self.is_plain() && other.is_plain() && (self.exponent - other.exponent).abs() > S::REACH;
        if is_far {
            return if self.exponent > other.exponent { other } else { self };
        }
        let (x, y, exponent) = self.aligned(other);
        Self::new(x.sum_error(y), exponent)
    }
    #[inline(never)]
    fn product_error<L: Level>(self, other: Self) -> Self {
        Self::new(self.significand.product_error::<L>(other.significand), self.exponent + other.exponent)
    }
    #[inline(never)]
    fn fused_mul_sub<L: Level>(self, factor: Self, subtrahend: Self) -> Self {
        if L::FUSED {
            return self.fused::<L>(factor, -subtrahend);
        }
        (self * factor - subtrahend) + self.product_error::<L>(factor)
    }
    #[inline(never)]
    fn root_error<L: Level>(self, root: Self) -> Self {
        if L::FUSED {
            return (-root).fused::<L>(root, self);
        }
        (self - root * root) - root.product_error::<L>(root)
    }
    #[inline(never)]
    fn power_of_two_scale(self) -> Self {
        let exponent = if self.is_plain() { -self.split().1 } else { 0 };
        Self { significand: S::ONE, exponent }
    }
    #[inline(never)]
    fn less(self, other: Self) -> bool {
        let (x, y, _) = self.aligned(other);
        x < y
    }
    #[inline(never)]
    fn less_or_equal(self, other: Self) -> bool {
        let (x, y, _) = self.aligned(other);
        x <= y
    }
    #[inline(never)]
    fn equal(self, other: Self) -> bool {
        let (x, y, _) = self.aligned(other);
        x == y
    }
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
    fn extended(&self) -> Option<Unbounded<f64>> {
        let (significand, exponent) = self.split();
        Some(Unbounded::new(significand.to_f64(), exponent))
    }
    fn of_extended(value: Unbounded<f64>) -> Self {
        let (significand, exponent) = value.split();
        Self::new(S::nearest(significand), exponent)
    }
    fn is_representable(&self) -> bool {
        self.to_scalar().abs() < S::INFINITY
    }
    fn saturated(self) -> Self {
        if !self.is_plain() || self.to_scalar().abs() < S::INFINITY {
            return self;
        }
        let large = S::power_of_two(S::LAST - 8);
        Self::of(if S::default() < self.significand { large } else { -large })
    }
    fn general_path(path: &impl Settle, inputs: &[Self]) -> (Vec<Self>, Flags<Self>) {
        S::unbounded_path(path, inputs)
    }
}

/// Results with an extended exponent, and their flags.
pub type Settled<S> = (Vec<Unbounded<S>>, Flags<Unbounded<S>>);

/// The general path of a routine. It returns all results, and whether they are limits.
#[doc(hidden)]
pub trait Settle {
    /// Runs the path over any numbers.
    fn settled<T: Number>(&self, inputs: &[T]) -> (Vec<T>, Flags<T>);

    /// Runs the path in double precision. As it is not generic, it is compiled once, not in each crate that uses
    /// elements.
    fn in_double(&self, inputs: &[Unbounded<f64>]) -> Settled<f64>;

    /// The same in single precision.
    fn in_single(&self, inputs: &[Unbounded<f32>]) -> Settled<f32>;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Fused;
    use crate::numbers::level::Baseline;

    fn of<S: Scalar>(value: S) -> Unbounded<S> {
        Unbounded::of(value)
    }

    /// Asserts equal bits, except for the sign of 0 and the payload of NaN.
    fn assert_same<S: Scalar>(got: Unbounded<S>, plain: S, what: &str) {
        let got = got.to_scalar();
        assert!(
            got == plain || [got, plain].iter().all(|number| number.partial_cmp(number).is_none()),
            "{what}: {got:?} but plainly {plain:?}"
        );
    }

    fn agree_with_plain_numbers<S: Scalar>(spread: i32) {
        let mut random = fastrand::Rng::with_seed(3);
        let mut draw = || {
            let size = S::power_of_two(random.i32(-spread..=spread));
            S::nearest(random.f64() * 2.0 - 1.0) * size
        };
        for _ in 0..20_000 {
            let (a, b, c) = (draw(), draw(), draw());
            let (x, y, z) = (of(a), of(b), of(c));
            assert_same(x + y, a + b, "sum");
            assert_same(x - y, a - b, "difference");
            assert_same(x * y, a * b, "product");
            assert_same(x / y, a / b, "quotient");
            assert_same(x.abs().sqrt(), a.abs().sqrt(), "root");
            assert_same(x.sum_error(y), a.sum_error(b), "what a sum lost");
            assert_same(x.mul_add::<Fused>(y, z), a.mul_add::<Fused>(b, c), "fused product and sum");
            assert_same(x.mul_add::<Baseline>(y, z), a.mul_add::<Baseline>(b, c), "product and sum");
            assert_same(x.product_error::<Fused>(y), a.product_error::<Fused>(b), "what a product lost");
            assert_same(x.fused_mul_sub::<Fused>(y, z), a.fused_mul_sub::<Fused>(b, c), "fused difference");
            assert_eq!((x.less(y), x.equal(y), x.equal(x)), (a < b, a == b, true));
            assert_same(x.atan2::<Baseline>(y), a.atan2::<Baseline>(b), "angle");
        }
    }

    #[test]
    fn where_nothing_overflows_the_bits_are_those_of_the_plain_type() {
        agree_with_plain_numbers::<f64>(60);
        agree_with_plain_numbers::<f64>(300);
        agree_with_plain_numbers::<f32>(6);
        agree_with_plain_numbers::<f32>(24);
    }

    #[test]
    fn what_overflows_on_the_way_comes_back() {
        for size in [1e-300, 1e-160, 1e160, 1e300] {
            let (a, b) = (of(3.0 * size), of(4.0 * size));
            let length = (a * a + b * b).sqrt();
            assert!((length.to_scalar() / (5.0 * size) - 1.0).abs() < 1e-15);
            let sixth = length * length * length * length * length * length;
            assert!(((sixth / (a * a * a * a * a * a)).to_scalar() / (15625.0 / 729.0) - 1.0).abs() < 1e-14);
            let third = length * length * length;
            assert!((sixth.powf::<Baseline>(of(0.5)) / third - of(1.0)).abs().to_scalar() < 1e-14);
            let expected = 6.0 * f64::ln(5.0 * size);
            assert!((sixth.ln::<Baseline>().to_scalar() / expected - 1.0).abs() < 1e-15);
        }
        let tiny = of(-1000.0).exp::<Baseline>();
        assert_eq!(tiny.to_scalar(), 0.0);
        assert!(((tiny * of(500.0).exp::<Baseline>()).to_scalar() / (-500.0_f64).exp() - 1.0).abs() < 1e-13);
        // For |x| > 2²⁵, eˣ is 0 or infinite: x has too few bits after the point.
        let both = |x: f64| (of(-x).exp::<Baseline>() * of(x).exp::<Baseline>()).to_scalar();
        assert!((both(3.3e7) - 1.0).abs() < 1e-6 && both(3.4e7).is_nan());
    }

    #[test]
    fn results_too_large_are_large_and_infinite_ones_infinite() {
        let large = (of(1e200) * of(1e200)).saturated().to_scalar();
        assert!(large > 1e305 && large + 4.0 * large - large > large);
        assert_eq!((of(-1e200) * of(1e200)).saturated().to_scalar(), -large);
        assert_eq!((of(1.0) / of(0.0)).saturated().to_scalar(), f64::INFINITY);
        assert_eq!(of(3.5).saturated().to_scalar(), 3.5);
        assert!((of(1e30_f32) * of(1e30)).saturated().to_scalar() >= f32::MAX / 1024.0);
    }

    #[test]
    fn numbers_without_a_place_are_infinite_or_rounded_once() {
        assert_eq!((of(1e200) * of(1e200)).to_scalar(), f64::INFINITY);
        assert_eq!((of(-1e200) * of(1e200)).to_scalar(), f64::NEG_INFINITY);
        assert_eq!((of(3e200) * of(5e107)).to_scalar(), 3e200 * 5e107);
        assert_eq!((of(1e-200) * of(1e-200)).to_scalar(), 0.0);
        assert_eq!((of(3e-200) * of(7e-120)).to_scalar(), 3e-200 * 7e-120);
        let least = f64::from_bits(1);
        assert_eq!(of(least).to_scalar(), least);
        assert_eq!((of(least) * of(0.5)).to_scalar(), 0.0);
        assert!(f64::is_nan((of(0.0) / of(0.0)).to_scalar()));
        assert_eq!((of(1.0) / of(0.0)).to_scalar(), f64::INFINITY);
        assert_eq!((of(f64::INFINITY) + of(1e-300)).to_scalar(), f64::INFINITY);
    }
}
