use std::cell::Cell;
use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

use energy_dsl::{Level, Number};

use super::Float;

thread_local! {
    /// Precision, in bits, of the numbers that this thread creates: [`Number::from_f64`] has no parameter for it.
    static PRECISION: Cell<usize> = const { Cell::new(256) };
}

/// Runs `work` with this precision of new numbers.
pub(crate) fn with_precision<R>(bits: usize, work: impl FnOnce() -> R) -> R {
    struct Restore(usize);
    impl Drop for Restore {
        fn drop(&mut self) {
            PRECISION.set(self.0);
        }
    }
    let _restore = Restore(PRECISION.replace(bits));
    work()
}

/// A multi-precision number; `None` inside if an operation is undefined, such as a division by zero or the logarithm of
/// zero. The exponent is unlimited, so numbers neither overflow nor underflow.
#[derive(Clone, Debug)]
pub struct Big(Option<Float>);

impl Big {
    /// Whether the number is defined.
    #[must_use]
    pub fn is_defined(&self) -> bool {
        self.0.is_some()
    }

    /// Whether the number is exactly zero.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.0.as_ref().is_some_and(Float::is_zero)
    }

    /// Returns the nearest double: infinite or zero out of range, NaN if undefined.
    #[must_use]
    pub fn to_f64(&self) -> f64 {
        self.0.as_ref().map_or(f64::NAN, Float::to_f64)
    }

    /// Returns |got − self| with a relative error of a roundoff; NaN if either is undefined. Infinity is correct for a
    /// number beyond the range of doubles.
    #[must_use]
    pub fn error_of(&self, got: f64) -> f64 {
        if got.is_infinite() {
            let nearest = self.to_f64();
            return if nearest == got { 0.0 } else { (got - nearest).abs() };
        }
        (Self::from_f64(got) - self.clone()).abs().to_f64()
    }

    /// Formats the number with this many digits, as in `-1.25e-3`; `0` for zero, `undefined` for an undefined number.
    #[must_use]
    pub fn to_decimal(&self, digits: usize) -> String {
        let Some(x) = &self.0 else { return "undefined".into() };
        if self.is_zero() {
            return "0".into();
        }
        x.to_decimal(digits)
    }

    /// Returns the larger magnitude; undefined counts as the largest.
    pub(super) fn larger(self, other: &Self) -> Self {
        match (&self.0, &other.0) {
            (None, _) => self,
            (_, None) => other.clone(),
            _ => Number::max(self, other.clone().abs()),
        }
    }

    /// Whether |self| ≤ |other| · 2^exponent; `false` if either is undefined.
    pub(super) fn is_within(&self, other: &Self, exponent: i64) -> bool {
        let (Some(a), Some(b)) = (self.clone().abs().0, other.clone().abs().0) else { return false };
        a.is_zero() || a <= b.shifted(exponent)
    }

    fn of(value: Float) -> Self {
        // Treat 1/0 and the like as undefined: computing with infinity would panic.
        Self(value.is_finite().then_some(value))
    }

    fn unary(self, work: impl FnOnce(Float) -> Option<Float>) -> Self {
        self.0.and_then(work).map_or(Self(None), Self::of)
    }

    fn binary(self, other: Self, work: impl FnOnce(Float, Float) -> Option<Float>) -> Self {
        match (self.0, other.0) {
            (Some(a), Some(b)) => work(a, b).map_or(Self(None), Self::of),
            _ => Self(None),
        }
    }

    fn order(&self, other: &Self) -> Option<Ordering> {
        self.0.as_ref()?.partial_cmp(other.0.as_ref()?)
    }
}

fn float(value: f64) -> Float {
    Float::from_f64(value, PRECISION.get())
}

fn pi() -> Float {
    Float::pi(PRECISION.get())
}

impl Add for Big {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.binary(other, |a, b| Some(a + b))
    }
}

impl Sub for Big {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.binary(other, |a, b| Some(a - b))
    }
}

impl Mul for Big {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.binary(other, |a, b| Some(a * b))
    }
}

impl Div for Big {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        self.binary(other, |a, b| (!b.is_zero()).then(|| a / b))
    }
}

impl Neg for Big {
    type Output = Self;
    fn neg(self) -> Self {
        self.unary(|a| Some(-a))
    }
}

impl Number for Big {
    type Mask = bool;
    type Unbounded = Self;

    fn unbounded(&self, _lane: usize) -> Self {
        self.clone()
    }

    fn set_lane(&mut self, _lane: usize, value: Self) {
        *self = value;
    }

    fn from_f64(value: f64) -> Self {
        Self(value.is_finite().then(|| float(value)))
    }
    fn sqrt(self) -> Self {
        self.unary(|a| if a.is_zero() { Some(a) } else { a.is_positive().then(|| a.sqrt()) })
    }
    fn abs(self) -> Self {
        self.unary(|a| Some(if a.is_positive() || a.is_zero() { a } else { -a }))
    }
    fn min(self, other: Self) -> Self {
        self.binary(other, |a, b| Some(if b < a { b } else { a }))
    }
    fn max(self, other: Self) -> Self {
        self.binary(other, |a, b| Some(if b > a { b } else { a }))
    }
    fn sin<L: Level>(self) -> Self {
        self.unary(|a| Some(if a.is_zero() { a } else { a.sin() }))
    }
    fn cos<L: Level>(self) -> Self {
        self.unary(|a| Some(if a.is_zero() { float(1.0) } else { a.cos() }))
    }
    fn exp<L: Level>(self) -> Self {
        // The largest exponent, far beyond the range of doubles: larger ones would exhaust the memory.
        const LARGEST: f64 = 1e6;
        self.unary(|a| match a.to_f64() {
            x if x > LARGEST => None,
            x if x < -LARGEST => Some(float(0.0)),
            _ if a.is_zero() => Some(float(1.0)),
            _ => Some(a.exp()),
        })
    }
    fn ln<L: Level>(self) -> Self {
        self.unary(|a| a.is_positive().then(|| a.ln()))
    }
    fn atan2<L: Level>(self, x: Self) -> Self {
        self.binary(x, |y, x| match (y.is_zero(), x.is_zero()) {
            (true, true) => None,
            (true, false) => Some(if x.is_positive() { float(0.0) } else { pi() }),
            _ => Some(y.atan2(&x)),
        })
    }
    fn powf<L: Level>(self, exponent: Self) -> Self {
        self.binary(exponent, |a, e| {
            let whole = e.to_f64() as i32;
            let is_whole = float(f64::from(whole)) == e;
            if e.is_zero() {
                return Some(float(1.0));
            }
            if a.is_zero() {
                return e.is_positive().then_some(a);
            }
            if is_whole && whole.abs() < 1_000_000 {
                return Some(a.powi(whole));
            }
            a.is_positive().then(|| a.powf(&e))
        })
    }
    fn sum_error(self, _other: Self) -> Self {
        Self::from_f64(0.0)
    }
    fn product_error<L: Level>(self, _other: Self) -> Self {
        Self::from_f64(0.0)
    }
    fn root_error<L: Level>(self, _root: Self) -> Self {
        Self::from_f64(0.0)
    }
    fn power_of_two_scale(self) -> Self {
        Self::from_f64(1.0)
    }
    fn is_moderate(self, _degree: u8) -> bool {
        self.is_defined()
    }
    fn less(self, other: Self) -> bool {
        self.order(&other) == Some(Ordering::Less)
    }
    fn less_or_equal(self, other: Self) -> bool {
        matches!(self.order(&other), Some(Ordering::Less | Ordering::Equal))
    }
    fn equal(self, other: Self) -> bool {
        self.order(&other) == Some(Ordering::Equal)
    }
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

#[cfg(test)]
mod tests {
    use energy_dsl::Baseline;

    use super::*;

    #[test]
    fn undefined_numbers_stay_undefined_and_never_panic() {
        let (zero, one) = (Big::from_f64(0.0), Big::from_f64(1.0));
        let nothing = [
            one.clone() / zero.clone(),
            (-one.clone()).sqrt(),
            zero.clone().ln::<Baseline>(),
            zero.clone().atan2::<Baseline>(zero.clone()),
            zero.clone().powf::<Baseline>(-one.clone()),
            Big::from_f64(1e9).exp::<Baseline>(),
            Big::from_f64(f64::NAN),
        ];
        for number in nothing {
            assert!(!number.is_defined() && !(number.clone() + one.clone()).is_defined());
            assert!(!number.clone().less(one.clone()) && number.to_f64().is_nan());
        }
    }

    #[test]
    fn known_digits() {
        with_precision(256, || {
            let digits = |x: Big| x.to_decimal(50);
            assert_eq!(digits(Big::from_f64(2.0).sqrt()), "1.4142135623730950488016887242096980785696718753769e0");
            let one = Big::from_f64(1.0);
            assert_eq!(digits(one.clone().exp::<Baseline>()), "2.7182818284590452353602874713526624977572470937e0");
            assert_eq!(
                digits(Big::from_f64(0.0).atan2::<Baseline>(-one)),
                "3.1415926535897932384626433832795028841971693993751e0"
            );
        });
    }

    #[test]
    fn errors_of_a_hundredth_of_a_roundoff_are_visible_over_the_whole_range() {
        let third = Big::from_f64(1.0) / Big::from_f64(3.0);
        assert!((third.error_of(1.0 / 3.0) / 2.0_f64.powi(-53) - 1.0 / 6.0 * 2.0).abs() < 0.2);
        let tiny = Big::from_f64(1e-300) * Big::from_f64(1e-300);
        assert!(!tiny.is_zero() && tiny.to_f64() == 0.0);
        assert!((tiny / Big::from_f64(1e-300)).error_of(1e-300) < 1e-316);
    }
}
