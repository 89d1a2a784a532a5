//! Forward differentiation in all coordinates at once, over any number type.

use std::ops::{Add, Div, Mul, Neg, Sub};

use energy_dsl::{Level, Number};

/// A number with its first and second derivatives by all coordinates. Missing derivatives and `None` are identically
/// zero.
#[derive(Clone, Debug)]
pub struct Jet<T> {
    /// The value, the term of order 0.
    pub value: T,
    first: Vec<Option<T>>,
    /// Upper triangle of second derivatives, row by row; empty if not requested.
    second: Vec<Option<T>>,
}

/// The order of differentiation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// First derivatives.
    First,
    /// First and second derivatives.
    Second,
}

impl<T: Number> Jet<T> {
    /// Creates a constant.
    pub fn constant(value: T) -> Self {
        Self { value, first: Vec::new(), second: Vec::new() }
    }

    /// Creates the variable for coordinate `number` of `count`.
    pub fn variable(value: T, number: usize, count: usize, order: Order) -> Self {
        let mut first = vec![None; count];
        first[number] = Some(T::from_f64(1.0));
        let second = if order == Order::Second { vec![None; count * (count + 1) / 2] } else { Vec::new() };
        Self { value, first, second }
    }

    /// Returns the number of coordinates; 0 for a constant.
    pub fn coordinates(&self) -> usize {
        self.first.len()
    }

    /// Returns ∂/∂qᵢ.
    pub fn by(&self, i: usize) -> T {
        or_zero(self.first.get(i).and_then(Option::as_ref))
    }

    /// Returns ∂²/∂qᵢ∂qⱼ.
    pub fn by_both(&self, i: usize, j: usize) -> T {
        let (i, j) = if i <= j { (i, j) } else { (j, i) };
        let n = self.first.len();
        // The index is i n − i (i + 1)/2 + j, non-negative for i ≤ n. A constant has no derivatives.
        let place = (i * n + j).checked_sub(i * (i + 1) / 2);
        or_zero(place.and_then(|place| self.second.get(place)).and_then(Option::as_ref))
    }

    /// Returns f(self), given f, f′ and f″ there.
    fn chain(self, f: T, first: T, second: T) -> Self {
        let weigh = |entry: &Option<T>| entry.as_ref().map(|e| first.clone() * e.clone());
        let mut triangle = Vec::with_capacity(self.second.len());
        let mut entries = self.second.iter();
        for i in 0..if self.second.is_empty() { 0 } else { self.first.len() } {
            let bent = self.first[i].as_ref().map(|a| second.clone() * a.clone());
            for b in &self.first[i..] {
                let straight = entries.next().and_then(weigh);
                triangle.push(sum(straight, product(bent.as_ref(), b.as_ref())));
            }
        }
        Self { value: f, first: self.first.iter().map(weigh).collect(), second: triangle }
    }

    /// Combines two jets entry by entry.
    fn linear(self, other: Self, value: T, join: impl Fn(Option<T>, Option<T>) -> Option<T>) -> Self {
        let zip = |a: Vec<Option<T>>, b: Vec<Option<T>>| -> Vec<Option<T>> {
            let (mut a, mut b) = (a.into_iter(), b.into_iter());
            (0..a.len().max(b.len())).map(|_| join(a.next().flatten(), b.next().flatten())).collect()
        };
        Self { value, first: zip(self.first, other.first), second: zip(self.second, other.second) }
    }

    /// Product rule: ∂²(a b) = a ∂²b + b ∂²a + ∂a ∂bᵀ + ∂b ∂aᵀ.
    fn times(self, other: Self) -> Self {
        let n = self.first.len().max(other.first.len());
        let second = self.second.len().max(other.second.len());
        let (a, b) = (&self, &other);
        let entry = |list: &[Option<T>], i: usize| list.get(i).cloned().flatten();
        let scaled = |value: &T, list: &[Option<T>], i: usize| entry(list, i).map(|e| value.clone() * e);
        let first = (0..n).map(|i| sum(scaled(&a.value, &b.first, i), scaled(&b.value, &a.first, i))).collect();
        let mut triangle = Vec::with_capacity(second);
        for i in 0..if second == 0 { 0 } else { n } {
            for j in i..n {
                let place = triangle.len();
                let straight = sum(scaled(&a.value, &b.second, place), scaled(&b.value, &a.second, place));
                let (ai, bj) = (entry(&a.first, i), entry(&b.first, j));
                let (bi, aj) = (entry(&b.first, i), entry(&a.first, j));
                let crossed = sum(product(ai.as_ref(), bj.as_ref()), product(bi.as_ref(), aj.as_ref()));
                triangle.push(sum(straight, crossed));
            }
        }
        Self { value: self.value * other.value, first, second: triangle }
    }

    fn reciprocal(self) -> Self {
        let r = T::from_f64(1.0) / self.value.clone();
        let square = r.clone() * r.clone();
        self.chain(r.clone(), -square.clone(), T::from_f64(2.0) * square * r)
    }

    fn is_constant(&self) -> bool {
        self.first.iter().all(Option::is_none)
    }
}

fn or_zero<T: Number>(entry: Option<&T>) -> T {
    entry.cloned().unwrap_or_else(|| T::from_f64(0.0))
}

fn sum<T: Number>(a: Option<T>, b: Option<T>) -> Option<T> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a + b),
        (a, b) => a.or(b),
    }
}

fn product<T: Number>(a: Option<&T>, b: Option<&T>) -> Option<T> {
    Some(a?.clone() * b?.clone())
}

impl<T: Number> Add for Jet<T> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let value = self.value.clone() + other.value.clone();
        self.linear(other, value, sum)
    }
}

impl<T: Number> Sub for Jet<T> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        let value = self.value.clone() - other.value.clone();
        self.linear(other, value, |a, b| sum(a, b.map(|b| -b)))
    }
}

impl<T: Number> Mul for Jet<T> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.times(other)
    }
}

impl<T: Number> Div for Jet<T> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        // The quotient itself is rounded once.
        let value = self.value.clone() / other.value.clone();
        Self { value, ..self.times(other.reciprocal()) }
    }
}

impl<T: Number> Neg for Jet<T> {
    type Output = Self;
    fn neg(self) -> Self {
        let negated = |list: Vec<Option<T>>| list.into_iter().map(|entry| entry.map(|e| -e)).collect();
        Self { value: -self.value, first: negated(self.first), second: negated(self.second) }
    }
}

impl<T: Number<Mask = bool>> Number for Jet<T> {
    type Mask = bool;
    type Unbounded = Self;

    fn unbounded(&self, _lane: usize) -> Self {
        self.clone()
    }

    fn set_lane(&mut self, _lane: usize, value: Self) {
        *self = value;
    }

    fn from_f64(value: f64) -> Self {
        Self::constant(T::from_f64(value))
    }
    fn sqrt(self) -> Self {
        let root = self.value.clone().sqrt();
        let first = T::from_f64(0.5) / root.clone();
        let second = -(first.clone() / (T::from_f64(2.0) * self.value.clone()));
        self.chain(root, first, second)
    }
    fn abs(self) -> Self {
        if self.value.clone().less(T::from_f64(0.0)) { -self } else { self }
    }
    fn min(self, other: Self) -> Self {
        if other.value.clone().less(self.value.clone()) { other } else { self }
    }
    fn max(self, other: Self) -> Self {
        if self.value.clone().less(other.value.clone()) { other } else { self }
    }
    fn sin<L: Level>(self) -> Self {
        let (s, c) = self.value.clone().sin_cos::<L>();
        self.chain(s.clone(), c, -s)
    }
    fn cos<L: Level>(self) -> Self {
        let (s, c) = self.value.clone().sin_cos::<L>();
        self.chain(c.clone(), -s, -c)
    }
    fn exp<L: Level>(self) -> Self {
        let e = self.value.clone().exp::<L>();
        self.chain(e.clone(), e.clone(), e)
    }
    fn ln<L: Level>(self) -> Self {
        let r = T::from_f64(1.0) / self.value.clone();
        let value = self.value.clone().ln::<L>();
        self.chain(value, r.clone(), -(r.clone() * r))
    }
    /// dφ = (x dy − y dx)/r². Second derivatives follow from those of the two quotients.
    fn atan2<L: Level>(self, x: Self) -> Self {
        let y = self;
        let value = y.value.clone().atan2::<L>(x.value.clone());
        let square = x.value.clone() * x.value.clone() + y.value.clone() * y.value.clone();
        let (along, across) = (x.value.clone() / square.clone(), y.value.clone() / square);
        // φ = φ₀ + Im ln((x + i y)/(x₀ + i y₀)). With the quotient a + i b, ∂²φ = ∂²b − (∂a ∂bᵀ + ∂b ∂aᵀ), as a = 1 and
        // b = 0 there.
        let constant = |value: T| Self::constant(value);
        let a = x.clone() * constant(along.clone()) + y.clone() * constant(across.clone());
        let b = y * constant(along) - x * constant(across);
        let (a_only, b_only) = (a.slopes_only(), b.clone().slopes_only());
        let bent = a_only * b_only;
        Self { value, ..b - bent }
    }
    fn powf<L: Level>(self, exponent: Self) -> Self {
        // A constant exponent allows a zero or negative base.
        if !exponent.is_constant() {
            return (exponent * self.ln::<L>()).exp::<L>();
        }
        let (x, e) = (self.value.clone(), exponent.value);
        let (one, two) = (T::from_f64(1.0), T::from_f64(2.0));
        let less = e.clone() - one.clone();
        let value = x.clone().powf::<L>(e.clone());
        let first = e.clone() * x.clone().powf::<L>(less.clone());
        let bend = e.clone() * less;
        // x¹ has no second derivative, even at 0, where x⁻¹ is undefined.
        let second = if bend.clone().equal(T::from_f64(0.0)) { bend } else { bend * x.powf::<L>(e - two) };
        self.chain(value, first, second)
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
        Self::constant(self.value.power_of_two_scale())
    }
    fn less(self, other: Self) -> bool {
        self.value.less(other.value)
    }
    fn less_or_equal(self, other: Self) -> bool {
        self.value.less_or_equal(other.value)
    }
    fn equal(self, other: Self) -> bool {
        self.value.equal(other.value)
    }
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

impl<T: Number> Jet<T> {
    /// Drops the value and the second derivatives, so that products contain products of first derivatives only.
    fn slopes_only(self) -> Self {
        let second = vec![None; self.second.len()];
        Self { value: T::from_f64(0.0), first: self.first, second }
    }
}

#[cfg(test)]
mod tests {
    use energy_dsl::Baseline;

    use super::*;

    fn point(x: f64, y: f64) -> (Jet<f64>, Jet<f64>) {
        (Jet::variable(x, 0, 2, Order::Second), Jet::variable(y, 1, 2, Order::Second))
    }

    /// At (3, 4): φ_x = −y/r², φ_xx = 2xy/r⁴, φ_xy = (y² − x²)/r⁴.
    #[test]
    fn derivatives_of_the_angle_of_a_point() {
        let (x, y) = point(3.0, 4.0);
        let angle = y.atan2::<Baseline>(x);
        for (got, want) in [
            (angle.by(0), -4.0 / 25.0),
            (angle.by(1), 3.0 / 25.0),
            (angle.by_both(0, 0), 24.0 / 625.0),
            (angle.by_both(1, 0), 7.0 / 625.0),
            (angle.by_both(1, 1), -24.0 / 625.0),
        ] {
            assert!((got - want).abs() < 1e-15, "{got} is not {want}");
        }
    }

    #[test]
    fn quotients_powers_and_roots() {
        let (x, y) = point(2.0, 4.0);
        let quotient = x.clone() / y.clone();
        assert_eq!((quotient.by(1), quotient.by_both(0, 1), quotient.by_both(1, 1)), (-0.125, -0.0625, 0.0625));
        let cube = (-x.clone()).powf::<Baseline>(Jet::constant(3.0));
        assert_eq!((cube.value, cube.by(0), cube.by_both(0, 0)), (-8.0, -12.0, -12.0));
        let norm = (x.clone() * x + y.clone() * y).sqrt();
        let r = 20.0_f64.sqrt();
        assert!((norm.by_both(0, 1) + 8.0 / (20.0 * r)).abs() < 1e-15);
        assert!((norm.by_both(0, 0) - 16.0 / (20.0 * r)).abs() < 1e-15);
    }
}
