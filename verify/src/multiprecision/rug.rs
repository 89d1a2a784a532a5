//! Multi-precision numbers by rug, which wraps GNU MPFR: an implementation independent of dashu.

use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

use rug::ops::Pow;

/// A binary number of any precision.
#[derive(Clone, Debug, PartialEq, PartialOrd)]
pub(super) struct Float(rug::Float);

impl Float {
    /// Converts a double exactly, with the precision for computing with it. Zero for NaN and infinity.
    pub(super) fn from_f64(value: f64, bits: usize) -> Self {
        Self(rug::Float::with_val(precision(bits), if value.is_finite() { value } else { 0.0 }))
    }

    pub(super) fn pi(bits: usize) -> Self {
        Self(rug::Float::with_val(precision(bits), rug::float::Constant::Pi))
    }

    pub(super) fn to_f64(&self) -> f64 {
        self.0.to_f64()
    }

    /// Formats the number with this many digits, as in `-1.25e-3`.
    pub(super) fn to_decimal(&self, digits: usize) -> String {
        let text = format!("{:.digits$e}", self.0);
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let mantissa =
            if mantissa.contains('.') { mantissa.trim_end_matches('0').trim_end_matches('.') } else { mantissa };
        format!("{mantissa}e{exponent}")
    }

    pub(super) fn is_zero(&self) -> bool {
        self.0.is_zero()
    }

    pub(super) fn is_finite(&self) -> bool {
        self.0.is_finite()
    }

    pub(super) fn is_positive(&self) -> bool {
        self.0.cmp0() == Some(Ordering::Greater)
    }

    /// Returns x · 2^exponent.
    pub(super) fn shifted(self, exponent: i64) -> Self {
        Self(self.0 << i32::try_from(exponent).unwrap_or(i32::MIN))
    }

    pub(super) fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }

    pub(super) fn sin(self) -> Self {
        Self(self.0.sin())
    }

    pub(super) fn cos(self) -> Self {
        Self(self.0.cos())
    }

    pub(super) fn exp(self) -> Self {
        Self(self.0.exp())
    }

    pub(super) fn ln(self) -> Self {
        Self(self.0.ln())
    }

    pub(super) fn atan2(self, x: &Self) -> Self {
        Self(self.0.atan2(&x.0))
    }

    /// Returns the power of a positive number.
    pub(super) fn powf(self, exponent: &Self) -> Self {
        Self(self.0.pow(&exponent.0))
    }

    /// Returns the integer power of a non-zero number.
    pub(super) fn powi(self, exponent: i32) -> Self {
        Self(self.0.pow(exponent))
    }

    /// Applies `work` to two numbers at the higher of their precisions.
    fn of_both(self, other: Self, work: impl FnOnce(rug::Float, rug::Float) -> rug::Float) -> Self {
        let mut left = self.0;
        if left.prec() < other.0.prec() {
            left.set_prec(other.0.prec());
        }
        Self(work(left, other.0))
    }
}

fn precision(bits: usize) -> u32 {
    u32::try_from(bits.max(53)).expect("a number that fits into memory")
}

impl Add for Float {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.of_both(other, |a, b| a + b)
    }
}

impl Sub for Float {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.of_both(other, |a, b| a - b)
    }
}

impl Mul for Float {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.of_both(other, |a, b| a * b)
    }
}

impl Div for Float {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        self.of_both(other, |a, b| a / b)
    }
}

impl Neg for Float {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}
