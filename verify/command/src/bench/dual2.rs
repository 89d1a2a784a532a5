//! [`Number`] for num-dual's second-order dual numbers, which carry a gradient and a Hessian of all coordinates.

use std::ops::{Add, Div, Mul, Neg, Sub};

use energy_dsl::{Level, Number};
use nalgebra::Const;
use num_dual::{Derivative, Dual2Vec, DualNum};

/// A number with its first and second derivatives by `N` coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dual2<const N: usize>(pub(super) Dual2Vec<f64, Const<N>>);

impl<const N: usize> Dual2<N> {
    fn constant(value: f64) -> Self {
        Self(Dual2Vec::from_re(value))
    }

    /// Creates the variable for a coordinate.
    pub(super) fn variable(value: f64, coordinate: usize) -> Self {
        Self(Dual2Vec::<f64, Const<N>>::from_re(value).derivative(coordinate))
    }

    /// Returns the Hessian, row by row.
    pub(super) fn hessian(self) -> Vec<f64> {
        self.0.v2.0.map_or_else(|| vec![0.0; N * N], |matrix| matrix.as_slice().to_vec())
    }

    fn is_constant(self) -> bool {
        self.0.v1 == Derivative::none() && self.0.v2 == Derivative::none()
    }
}

macro_rules! forward_operator {
    ($trait:ident, $method:ident) => {
        impl<const N: usize> $trait for Dual2<N> {
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

impl<const N: usize> Neg for Dual2<N> {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl<const N: usize> Number for Dual2<N> {
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
    fn sum_error(self, other: Self) -> Self {
        Self::constant(self.0.re.sum_error(other.0.re))
    }
    fn product_error<L: Level>(self, other: Self) -> Self {
        Self::constant(self.0.re.product_error::<L>(other.0.re))
    }
    fn root_error<L: Level>(self, root: Self) -> Self {
        Self::constant(self.0.re.root_error::<L>(root.0.re))
    }
    fn power_of_two_scale(self) -> Self {
        Self::constant(self.0.re.power_of_two_scale())
    }
    fn is_moderate(self, degree: u8) -> bool {
        self.0.re.is_moderate(degree)
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

#[cfg(test)]
mod tests {
    use energy_dsl::Baseline;

    use super::*;

    /// At (3, 4), f = atan2(y, x) has f_xx = 2xy/r⁴ and f_xy = (y² − x²)/r⁴.
    #[test]
    fn second_derivatives_of_the_angle_of_a_point() {
        let (x, y) = (Dual2::<2>::variable(3.0, 0), Dual2::variable(4.0, 1));
        let hessian = y.atan2::<Baseline>(x).hessian();
        for (got, want) in hessian.iter().zip([24.0 / 625.0, 7.0 / 625.0, 7.0 / 625.0, -24.0 / 625.0]) {
            assert!((got - want).abs() < 1e-15, "{hessian:?}");
        }
        assert_eq!((x * x).powf::<Baseline>(Dual2::constant(0.0)).hessian(), [0.0; 4]);
    }
}
