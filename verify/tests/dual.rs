//! [`Number`] for num-dual's hyper-dual numbers, which differentiate a formula independently of the compiler and of the
//! audit's jets.

use std::ops::{Add, Div, Mul, Neg, Sub};

use energy_dsl::{Baseline, Level, Number};
use num_dual::{DualNum, HyperDual64};

/// A hyper-dual number a + b ε₁ + c ε₂ + d ε₁ε₂ with ε₁² = ε₂² = 0: a value, two first derivatives and their mixed
/// second derivative.
#[derive(Clone, Copy, Debug)]
pub struct Hyper(pub HyperDual64);

impl Hyper {
    /// Creates a constant.
    #[must_use]
    pub fn constant(value: f64) -> Self {
        Self(HyperDual64::from_re(value))
    }

    /// Creates a variable with a unit derivative along ε₁ if `first`, and along ε₂ if `second`.
    #[must_use]
    pub fn variable(value: f64, first: bool, second: bool) -> Self {
        let unit = |moves| if moves { 1.0 } else { 0.0 };
        Self(HyperDual64::new(value, unit(first), unit(second), 0.0))
    }

    fn is_constant(self) -> bool {
        self.0.eps1 == 0.0 && self.0.eps2 == 0.0 && self.0.eps1eps2 == 0.0
    }
}

macro_rules! forward_operator {
    ($trait:ident, $method:ident) => {
        impl $trait for Hyper {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    };
}
forward_operator!(Add, add);
forward_operator!(Sub, sub);
forward_operator!(Mul, mul);
forward_operator!(Div, div);

impl Neg for Hyper {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Number for Hyper {
    type Mask = bool;
    type Unbounded = Self;

    fn unbounded(&self, _lane: usize) -> Self {
        *self
    }

    fn set_lane(&mut self, _lane: usize, value: Self) {
        *self = value;
    }

    fn from_f64(value: f64) -> Self {
        Self::constant(value)
    }
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    fn abs(self) -> Self {
        if self.0.re < 0.0 { -self } else { self }
    }
    fn min(self, other: Self) -> Self {
        if other.0.re < self.0.re { other } else { self }
    }
    fn max(self, other: Self) -> Self {
        if other.0.re > self.0.re { other } else { self }
    }
    fn sin<L: Level>(self) -> Self {
        Self(self.0.sin())
    }
    fn cos<L: Level>(self) -> Self {
        Self(self.0.cos())
    }
    fn exp<L: Level>(self) -> Self {
        Self(self.0.exp())
    }
    fn ln<L: Level>(self) -> Self {
        Self(self.0.ln())
    }
    fn atan2<L: Level>(self, x: Self) -> Self {
        // num-dual's atan2 divides by x, and by x² in its derivatives.
        if x.0.re.abs() >= self.0.re.abs() {
            return Self(self.0.atan2(x.0));
        }
        let quarter = Self::constant(std::f64::consts::FRAC_PI_2.copysign(self.0.re));
        quarter - Self((x.0 / self.0).atan())
    }
    fn powf<L: Level>(self, exponent: Self) -> Self {
        // A constant exponent allows a zero or negative base, which exp(e ln x) does not.
        if exponent.is_constant() { Self(self.0.powf(exponent.0.re)) } else { Self(self.0.powd(exponent.0)) }
    }
    fn sum_error(self, _other: Self) -> Self {
        Self::constant(0.0)
    }
    fn product_error<L: Level>(self, _other: Self) -> Self {
        Self::constant(0.0)
    }
    fn root_error<L: Level>(self, _root: Self) -> Self {
        Self::constant(0.0)
    }
    fn power_of_two_scale(self) -> Self {
        Self::constant(self.0.re.power_of_two_scale())
    }
    fn less(self, other: Self) -> bool {
        self.0.re < other.0.re
    }
    fn less_or_equal(self, other: Self) -> bool {
        self.0.re <= other.0.re
    }
    fn equal(self, other: Self) -> bool {
        self.0.re == other.0.re
    }
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

/// At (3, 4), f = atan2(y, x) has f_x = −y/r², f_xy = (y² − x²)/r⁴.
#[test]
fn second_derivatives_of_the_angle_of_a_point() {
    let x = Hyper::variable(3.0, true, false);
    let y = Hyper::variable(4.0, false, true);
    let angle = y.atan2::<Baseline>(x).0;
    assert!((angle.re - 4.0_f64.atan2(3.0)).abs() < 1e-15);
    assert!((angle.eps1 + 4.0 / 25.0).abs() < 1e-15, "{angle:?}");
    assert!((angle.eps2 - 3.0 / 25.0).abs() < 1e-15, "{angle:?}");
    assert!((angle.eps1eps2 - 7.0 / 625.0).abs() < 1e-15, "{angle:?}");
}

/// On the y axis, where y/x is infinite: φ_x = −1/y, φ_xy = 1/y².
#[test]
fn the_angle_of_a_point_on_the_axis() {
    for y in [2.0, -2.0] {
        let angle = Hyper::variable(y, false, true).atan2::<Baseline>(Hyper::variable(0.0, true, false)).0;
        assert_eq!(angle.re, std::f64::consts::FRAC_PI_2.copysign(y));
        assert_eq!((angle.eps1, angle.eps2, angle.eps1eps2), (-1.0 / y, 0.0, 0.25));
    }
}

#[test]
fn powers_and_selections() {
    let x = Hyper::variable(-2.0, true, true);
    let cube = x.powf::<Baseline>(Hyper::constant(3.0)).0;
    assert_eq!((cube.re, cube.eps1, cube.eps1eps2), (-8.0, 12.0, -12.0));
    let magnitude = x.abs().0;
    assert_eq!((magnitude.re, magnitude.eps1), (2.0, -1.0));
    let chosen = Hyper::select(x.less(Hyper::constant(0.0)), x * x, Hyper::constant(f64::NAN)).0;
    assert_eq!((chosen.re, chosen.eps1, chosen.eps1eps2), (4.0, -4.0, 2.0));
    // The scale counts as a constant in the derivative.
    let scaled = (x * x.power_of_two_scale()).0;
    assert_eq!((scaled.re, scaled.eps1), (-1.0, 0.5));
}
