use std::ops::{Add, Div, Mul, Neg, Sub};

use energy_runtime::{Level, Number};

/// Nested dual numbers a + b ε with ε² = 0 over `T`, nested as deep as a formula needs for its derivatives. The ε of
/// greater depth is the outer one. Numbers that do not depend on an ε do not carry it.
#[derive(Clone, Debug)]
pub(crate) enum Tower<T> {
    /// A number that depends on no ε.
    Plain(T),
    /// `value` + `slope` ε, with the ε of this depth.
    Raised { depth: usize, value: Box<Tower<T>>, slope: Box<Tower<T>> },
}

impl<T: Number> Tower<T> {
    /// Returns self + ε, with a depth greater than any it carries.
    pub(crate) fn raised(self, depth: usize) -> Self {
        Self::new(depth, self, Self::from_f64(1.0))
    }

    /// Returns the coefficient of the ε of this depth, the greatest it carries.
    pub(crate) fn slope(self, depth: usize) -> Self {
        if self.depth() == depth { self.split(depth).1 } else { Self::from_f64(0.0) }
    }

    /// Returns the part without any ε.
    pub(crate) fn into_plain(self) -> T {
        match self {
            Self::Plain(value) => value,
            Self::Raised { value, .. } => value.into_plain(),
        }
    }

    fn new(depth: usize, value: Self, slope: Self) -> Self {
        Self::Raised { depth, value: Box::new(value), slope: Box::new(slope) }
    }

    fn depth(&self) -> usize {
        match self {
            Self::Plain(_) => 0,
            Self::Raised { depth, .. } => *depth,
        }
    }

    /// Returns value and slope with respect to the ε of the greatest depth.
    fn split(self, outer: usize) -> (Self, Self) {
        match self {
            Self::Raised { depth, value, slope } if depth == outer => (*value, *slope),
            other => (other, Self::from_f64(0.0)),
        }
    }

    /// Returns f(self), where f has the derivative `slope`.
    fn chain(self, plain: impl FnOnce(T) -> T, raised: impl FnOnce(Self) -> (Self, Self)) -> Self {
        match self {
            Self::Plain(value) => Self::Plain(plain(value)),
            Self::Raised { depth, value, slope } => {
                let (f, df) = raised(*value);
                Self::new(depth, f, df * *slope)
            }
        }
    }

    /// Returns f(self, other), from values and slopes with respect to the outer ε.
    fn combine(
        self,
        other: Self,
        plain: impl FnOnce(T, T) -> T,
        raised: impl FnOnce((Self, Self), (Self, Self)) -> (Self, Self),
    ) -> Self {
        let depth = self.depth().max(other.depth());
        match (self, other) {
            (Self::Plain(a), Self::Plain(b)) => Self::Plain(plain(a, b)),
            (a, b) => {
                let (value, slope) = raised(a.split(depth), b.split(depth));
                Self::new(depth, value, slope)
            }
        }
    }
}

impl<T: Number> Add for Tower<T> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.combine(other, |a, b| a + b, |(a, da), (b, db)| (a + b, da + db))
    }
}

impl<T: Number> Sub for Tower<T> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.combine(other, |a, b| a - b, |(a, da), (b, db)| (a - b, da - db))
    }
}

impl<T: Number> Mul for Tower<T> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.combine(other, |a, b| a * b, |(a, da), (b, db)| (a.clone() * b.clone(), da * b + a * db))
    }
}

impl<T: Number> Div for Tower<T> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        self.combine(
            other,
            |a, b| a / b,
            |(a, da), (b, db)| {
                let quotient = a / b.clone();
                (quotient.clone(), (da - quotient * db) / b)
            },
        )
    }
}

impl<T: Number> Neg for Tower<T> {
    type Output = Self;
    fn neg(self) -> Self {
        self.chain(|a| -a, |a| (-a, Self::from_f64(-1.0)))
    }
}

impl<T: Number> Number for Tower<T> {
    type Mask = T::Mask;
    type Unbounded = Self;

    fn unbounded(&self, _lane: usize) -> Self {
        self.clone()
    }
    fn set_lane(&mut self, _lane: usize, value: Self) {
        *self = value;
    }

    fn from_f64(value: f64) -> Self {
        Self::Plain(T::from_f64(value))
    }
    fn sqrt(self) -> Self {
        self.chain(T::sqrt, |a| {
            let root = a.sqrt();
            (root.clone(), Self::from_f64(0.5) / root)
        })
    }
    fn abs(self) -> Self {
        let negative = self.clone().less(Self::from_f64(0.0));
        Self::select(negative, -self.clone(), self)
    }
    fn min(self, other: Self) -> Self {
        let mask = other.clone().less(self.clone());
        Self::select(mask, other, self)
    }
    fn max(self, other: Self) -> Self {
        let mask = self.clone().less(other.clone());
        Self::select(mask, other, self)
    }
    fn sin<L: Level>(self) -> Self {
        self.chain(T::sin::<L>, |a| (a.clone().sin::<L>(), a.cos::<L>()))
    }
    fn cos<L: Level>(self) -> Self {
        self.chain(T::cos::<L>, |a| (a.clone().cos::<L>(), -a.sin::<L>()))
    }
    fn exp<L: Level>(self) -> Self {
        self.chain(T::exp::<L>, |a| {
            let e = a.exp::<L>();
            (e.clone(), e)
        })
    }
    fn ln<L: Level>(self) -> Self {
        self.chain(T::ln::<L>, |a| (a.clone().ln::<L>(), Self::from_f64(1.0) / a))
    }
    fn atan2<L: Level>(self, x: Self) -> Self {
        self.combine(x, T::atan2::<L>, |(y, dy), (x, dx)| {
            let square = x.clone() * x.clone() + y.clone() * y.clone();
            let slope = (x.clone() * dy - y.clone() * dx) / square;
            (y.atan2::<L>(x), slope)
        })
    }
    fn powf<L: Level>(self, exponent: Self) -> Self {
        // With a constant exponent the base may be negative or zero.
        if let Self::Plain(e) = &exponent {
            let e = e.clone();
            return self.chain(
                |a| a.powf::<L>(e.clone()),
                |a| {
                    let less = Self::Plain(e.clone() - T::from_f64(1.0));
                    (a.clone().powf::<L>(Self::Plain(e.clone())), Self::Plain(e.clone()) * a.powf::<L>(less))
                },
            );
        }
        (exponent * self.ln::<L>()).exp::<L>()
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
        Self::Plain(self.into_plain().power_of_two_scale())
    }
    fn less(self, other: Self) -> Self::Mask {
        self.into_plain().less(other.into_plain())
    }
    fn less_or_equal(self, other: Self) -> Self::Mask {
        self.into_plain().less_or_equal(other.into_plain())
    }
    fn equal(self, other: Self) -> Self::Mask {
        self.into_plain().equal(other.into_plain())
    }
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        yes.combine(
            no,
            |yes, no| T::select(mask, yes, no),
            |(yes, yes_slope), (no, no_slope)| (Self::select(mask, yes, no), Self::select(mask, yes_slope, no_slope)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use energy_runtime::Baseline;

    /// f = x³ y has ∂²f/∂x∂y = 3x². The inner and the outer ε stay separate.
    #[test]
    fn two_depths_give_the_mixed_derivative() {
        let x = Tower::Plain(2.0).raised(1);
        let y = Tower::Plain(5.0).raised(2);
        let cube = x.powf::<Baseline>(Tower::Plain(3.0));
        assert_eq!((cube * y).slope(2).slope(1).into_plain(), 12.0);
        // Moved by both: ∂²(x²)/∂x² = 2.
        let x = Tower::Plain(7.0).raised(1).raised(2);
        assert_eq!((x.clone() * x).slope(2).slope(1).into_plain(), 2.0);
    }

    #[test]
    fn what_does_not_move_has_no_slope() {
        assert_eq!((Tower::Plain(2.0) / Tower::Plain(3.0)).slope(1).into_plain(), 0.0);
        let angle = Tower::Plain(1.0).raised(1).atan2::<Baseline>(Tower::Plain(1.0));
        assert!((angle.slope(1).into_plain() - 0.5).abs() < 1e-15);
    }
}
