//! Multi-precision numbers by dashu, in pure Rust.

use std::ops::{Add, Div, Mul, Neg, Sub};

use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;

type Binary = FBig<HalfEven, 2>;

/// A binary number of any precision.
#[derive(Clone, Debug, PartialEq, PartialOrd)]
pub(super) struct Float(Binary);

impl Float {
    /// Converts a double exactly, with the precision for computing with it. Zero for NaN and infinity.
    pub(super) fn from_f64(value: f64, bits: usize) -> Self {
        let exact = Binary::try_from(value).unwrap_or(Binary::ZERO);
        Self(exact.with_precision(bits.max(53)).value())
    }

    pub(super) fn pi(bits: usize) -> Self {
        Self(Binary::pi(bits))
    }

    pub(super) fn to_f64(&self) -> f64 {
        self.0.to_f64().value()
    }

    /// Formats the number with this many digits, as in `-1.25e-3`.
    pub(super) fn to_decimal(&self, digits: usize) -> String {
        format!("{:e}", self.0.clone().with_base_and_precision::<10>(digits).value())
    }

    pub(super) fn is_zero(&self) -> bool {
        self.0.repr().significand().is_zero()
    }

    pub(super) fn is_finite(&self) -> bool {
        self.0.repr().is_finite()
    }

    pub(super) fn is_positive(&self) -> bool {
        self.0 > Binary::ZERO
    }

    /// Returns x · 2^exponent.
    pub(super) fn shifted(self, exponent: i64) -> Self {
        Self(self.0 << isize::try_from(exponent).unwrap_or(isize::MIN))
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
        Self(self.0.powf(&exponent.0))
    }

    /// Returns the integer power of a non-zero number.
    pub(super) fn powi(self, exponent: i32) -> Self {
        Self(self.0.powi(exponent.into()))
    }
}

impl Add for Float {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl Sub for Float {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl Mul for Float {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

impl Div for Float {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        Self(self.0 / other.0)
    }
}

impl Neg for Float {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}
