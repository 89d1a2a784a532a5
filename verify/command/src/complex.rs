//! Complex numbers a + b i for the complex step, with b so small that b² vanishes relative to a.

use std::ops::{Add, Div, Mul, Neg, Sub};

use energy_dsl::{Level, Number};

/// A number with an imaginary step. Comparisons and absolute values use the real part, so that derivatives are right
/// between kinks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Complex {
    pub(crate) re: f64,
    pub(crate) im: f64,
}

impl Complex {
    pub(crate) fn real(re: f64) -> Self {
        Self { re, im: 0.0 }
    }

    /// Returns f(self) for a function with value f and derivative f′.
    fn chain(self, value: f64, slope: f64) -> Self {
        Self { re: value, im: slope * self.im }
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

impl Div for Complex {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let re = self.re / other.re;
        Self { re, im: (self.im - re * other.im) / other.re }
    }
}

impl Neg for Complex {
    type Output = Self;
    fn neg(self) -> Self {
        Self { re: -self.re, im: -self.im }
    }
}

impl Number for Complex {
    type Mask = bool;
    type Unbounded = Self;

    fn unbounded(&self, _lane: usize) -> Self {
        *self
    }
    fn set_lane(&mut self, _lane: usize, value: Self) {
        *self = value;
    }
    fn from_f64(value: f64) -> Self {
        Self::real(value)
    }
    fn sqrt(self) -> Self {
        let root = self.re.sqrt();
        self.chain(root, 0.5 / root)
    }
    fn abs(self) -> Self {
        if self.re < 0.0 { -self } else { self }
    }
    fn min(self, other: Self) -> Self {
        if other.re < self.re { other } else { self }
    }
    fn max(self, other: Self) -> Self {
        if other.re > self.re { other } else { self }
    }
    fn sin<L: Level>(self) -> Self {
        self.chain(self.re.sin(), self.re.cos())
    }
    fn cos<L: Level>(self) -> Self {
        self.chain(self.re.cos(), -self.re.sin())
    }
    fn exp<L: Level>(self) -> Self {
        self.chain(self.re.exp(), self.re.exp())
    }
    fn ln<L: Level>(self) -> Self {
        self.chain(self.re.ln(), 1.0 / self.re)
    }
    fn atan2<L: Level>(self, x: Self) -> Self {
        let square = x.re * x.re + self.re * self.re;
        Self { re: self.re.atan2(x.re), im: (x.re * self.im - self.re * x.im) / square }
    }
    fn powf<L: Level>(self, exponent: Self) -> Self {
        self.chain(self.re.powf(exponent.re), exponent.re * self.re.powf(exponent.re - 1.0))
    }
    fn sum_error(self, other: Self) -> Self {
        Self::real(self.re.sum_error(other.re))
    }
    fn product_error<L: Level>(self, other: Self) -> Self {
        Self::real(self.re.product_error::<L>(other.re))
    }
    fn power_of_two_scale(self) -> Self {
        Self::real(self.re.power_of_two_scale())
    }
    fn is_moderate(self, degree: u8) -> bool {
        self.re.is_moderate(degree)
    }
    fn less(self, other: Self) -> bool {
        self.re < other.re
    }
    fn less_or_equal(self, other: Self) -> bool {
        self.re <= other.re
    }
    fn equal(self, other: Self) -> bool {
        self.re == other.re
    }
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

#[cfg(test)]
mod tests {
    use energy_dsl::Baseline;

    use super::*;

    /// The complex step yields derivatives to full precision.
    #[test]
    fn the_complex_step_is_a_derivative() {
        let x = Complex { re: 0.7, im: 1e-100 };
        let slope = |f: Complex| f.im / 1e-100;
        let near = |a: f64, b: f64| assert!((a - b).abs() <= 4e-16 * b.abs(), "{a} {b}");
        near(slope(Number::sqrt(x)), 0.5 / 0.7_f64.sqrt());
        near(slope(x.sin::<Baseline>() / x), 0.7_f64.cos() / 0.7 - 0.7_f64.sin() / 0.49);
        near(slope(x.atan2::<Baseline>(Complex::real(2.0))), 2.0 / 4.49);
        near(slope((x * x).exp::<Baseline>()), 1.4 * 0.49_f64.exp());
        near(slope(x.powf::<Baseline>(Complex::real(2.5)).ln::<Baseline>()), 2.5 / 0.7);
    }
}
