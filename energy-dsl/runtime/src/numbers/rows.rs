//! Series along several rays at once, as rows of coefficients.

use std::cmp::Ordering;

use super::coefficients::{Coefficients, List, Operation, Row};
use super::level::Baseline;
use super::outcomes::{LANES, Outcomes};
use super::real::{Mask, Number};
use super::series::{CANCELLED, MOST_ROWS, Order, Term, length};

/// Series along all rays whose powers of ε ascend in steps of 1, all with one power of ln(1/ε).
#[derive(Clone, Copy, Debug)]
pub(super) struct Rows {
    first: Order,
    list: List,
    /// Whether the terms after the last row are 0. Otherwise they are unknown.
    is_exact: bool,
}

impl Rows {
    pub(super) fn zero() -> Self {
        Self { first: Order::ONE, list: List::EMPTY, is_exact: true }
    }

    /// Creates rows of the first coefficients; `None` if a number is too large or too small.
    pub(super) fn new(first: Order, rows: &[Coefficients], is_exact: bool) -> Option<Self> {
        let are_moderate = rows.iter().all(Coefficients::are_moderate);
        are_moderate.then(|| Self { first, list: List::of(rows), is_exact }.stripped())
    }

    pub(super) fn constant(factors: Row) -> Option<Self> {
        Self::new(Order::ONE, &[Coefficients::exact(factors)], true)
    }

    /// Creates a constant along some rays.
    pub(super) fn same(value: f64, rays: Outcomes) -> Option<Self> {
        Self::constant(std::array::from_fn(|ray| if rays.lane(ray) { value } else { 0.0 }))
    }

    /// Returns the number that the series is along the first rays.
    pub(super) fn as_constant(&self, rays: usize) -> Option<f64> {
        if self.is_zero() {
            return Some(0.0);
        }
        let is_constant = self.is_exact && self.list.len() == 1 && self.first.compare(Order::ONE) == Ordering::Equal;
        let [first, rest @ ..] = &self.list.first().filter(|_| is_constant)?.factors[..rays] else { return None };
        rest.iter().all(|factor| factor == first).then_some(*first)
    }

    /// Creates x + slope · ε along each ray.
    pub(super) fn linear(x: Row, slopes: Row) -> Option<Self> {
        Self::new(Order::ONE, &[x, slopes].map(Coefficients::exact), true)
    }

    /// Returns the series with other coefficients; `None` if one becomes too large or too small.
    fn changed(&self, change: impl Fn(usize, &mut Coefficients)) -> Option<Self> {
        let list = self.list.changed(change);
        let are_moderate = list.with(|rows| rows.iter().all(Coefficients::are_moderate));
        are_moderate.then(|| Self { list, ..*self }.stripped())
    }

    /// Drops leading rows that are 0.
    fn stripped(mut self) -> Self {
        let (list, zeros) = self.list.stripped();
        self.first.power += zeros as f64;
        Self { list, ..self }
    }

    /// Sets the coefficients along some rays to 0.
    pub(super) fn cleared(self, rays: Outcomes) -> Self {
        let is_zero = |row: &Coefficients| (0..LANES).all(|ray| row.factors[ray] == 0.0 || !rays.lane(ray));
        if !rays.any() || self.list.with(|rows| rows.iter().all(is_zero)) {
            return self;
        }
        Self { list: self.list.changed(|_, row| row.set(rays, 0.0, 0.0)), ..self }.stripped()
    }

    /// Returns the number of known rows.
    fn known(&self) -> usize {
        if self.is_exact { usize::MAX } else { self.list.len() }
    }

    fn order(&self, row: usize) -> Order {
        Order { power: self.first.power + row as f64, ..self.first }
    }

    /// Returns the order of the first unknown row.
    pub(super) fn end(&self) -> Order {
        if self.is_exact { Order::NEVER } else { self.order(self.list.len()) }
    }

    /// Returns whether there is a term larger than some order.
    pub(super) fn exceeds(&self, order: Order) -> bool {
        !self.list.is_empty() && self.first.is_larger_than(order)
    }

    pub(super) fn is_zero(&self) -> bool {
        self.is_exact && self.list.is_empty()
    }

    fn is_zero_along(&self, ray: usize) -> bool {
        self.list.with(|rows| rows.iter().all(|row| row.factors[ray] == 0.0))
    }

    fn term(&self, k: usize, row: &Coefficients, ray: usize) -> Option<Term> {
        let factor = row.factors[ray];
        (factor != 0.0).then(|| Term::of(self.order(k), factor, row.sizes[ray] / factor.abs()))
    }

    /// Returns the known terms along a ray.
    pub(super) fn terms(&self, ray: usize) -> Vec<Term> {
        self.list.with(|rows| rows.iter().enumerate().filter_map(|(k, row)| self.term(k, row, ray)).collect())
    }

    /// Returns the largest known term along a ray.
    pub(super) fn first(&self, ray: usize) -> Option<Term> {
        self.list.with(|rows| rows.iter().enumerate().find_map(|(k, row)| self.term(k, row, ray)))
    }

    /// Returns whether the sum has one row for each power of both.
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        let step = self.first.power - other.first.power;
        // Most steps are 0, and rounding is a call.
        self.first.logs == other.first.logs && (step == 0.0 || step == step.round() && step.abs() <= length() as f64)
    }

    fn computed(first: Order, rows: usize, is_exact: bool, operation: Operation<List>) -> Option<Self> {
        let (list, zeros) = List::computed(rows, operation)?;
        Some(Self { first: first.after(zeros), list, is_exact })
    }

    /// Returns self + sign · other, which overlap.
    pub(super) fn plus(&self, other: &Self, sign: f64) -> Option<Self> {
        let (first, [mine, others], most) = self.aligned(other);
        let known = self.known().saturating_add(mine).min(other.known().saturating_add(others));
        let rows = most.min(length()).min(known);
        let is_exact = self.is_exact && other.is_exact && rows == most;
        Self::computed(first, rows, is_exact, Operation::Sum([self.list, other.list], [mine, others], sign))
    }

    /// Returns the first order of the sum, the first rows of both, and the number of rows.
    fn aligned(&self, other: &Self) -> (Order, [usize; 2], usize) {
        let power = self.first.power.min(other.first.power);
        let from = [self, other].map(|rows| (rows.first.power - power) as usize);
        let most = (from[0] + self.list.len()).max(from[1] + other.list.len());
        (Order { power, ..self.first }, from, most)
    }

    /// Adds rows that need not overlap if one of them is 0.
    fn plus_part(&self, other: &Self) -> Option<Self> {
        match (self.is_zero(), other.is_zero()) {
            (true, _) => Some(*other),
            (_, true) => Some(*self),
            _ if self.overlaps(other) => self.plus(other, 1.0),
            _ => None,
        }
    }

    pub(super) fn signed(&self, negative: Outcomes) -> Self {
        if !negative.any() || self.list.is_empty() {
            return *self;
        }
        let sign: Row = std::array::from_fn(|ray| if negative.lane(ray) { -1.0 } else { 1.0 });
        let change = |_, row: &mut Coefficients| (0..LANES).for_each(|ray| row.factors[ray] *= sign[ray]);
        Self { list: self.list.changed(change), ..*self }
    }

    pub(super) fn times(&self, other: &Self) -> Option<Self> {
        if self.is_zero() || other.is_zero() {
            return Some(Self::zero());
        }
        let most = (self.list.len() + other.list.len()).saturating_sub(1);
        let rows = most.min(length()).min(self.known()).min(other.known());
        let is_exact = self.is_exact && other.is_exact && rows == most;
        let first = self.first.times(other.first);
        Self::computed(first, rows, is_exact, Operation::Product(self.list, other.list))
    }

    /// Returns whether the first coefficient is a number other than 0 along all rays but some.
    fn leads(&self, but: Outcomes) -> bool {
        self.list.first().is_some_and(|row| (0..LANES).all(|ray| row.factors[ray] != 0.0 || but.lane(ray)))
    }

    pub(super) fn first_order(&self) -> Order {
        self.first
    }

    /// Splits the series into its first term and the rest; `None` if some rays have no such term.
    pub(super) fn headed(&self, undefined: Outcomes) -> Option<[Self; 2]> {
        self.leads(undefined).then(|| {
            let [head, rest] = self.list.split();
            let rest = Self { first: self.first.after(1), list: rest, ..*self };
            [Self { list: head, is_exact: true, ..*self }, rest.stripped()]
        })
    }

    /// Creates a series of which only the order is known.
    pub(super) fn unknown(first: Order) -> Self {
        Self { first, list: List::EMPTY, is_exact: false }
    }

    pub(super) fn scaled(&self, by: f64) -> Option<Self> {
        if by == 0.0 { Some(Self::zero()) } else { self.changed(|_, row| row.scale(by)) }
    }

    /// Returns the quotient, and the rays along which the divisor is 0; `None` if it begins with several powers.
    pub(super) fn over(&self, other: &Self, undefined: Outcomes) -> Option<(Self, Outcomes)> {
        let zero = Outcomes::of(|ray| other.is_exact && other.is_zero_along(ray));
        if other.is_zero() {
            return Some((Self::zero(), zero));
        }
        if !other.leads(undefined | zero) {
            return None;
        }
        if self.is_zero() {
            return Some((Self::zero(), zero));
        }
        let is_exact = self.is_exact && other.is_exact && other.list.len() == 1;
        let most = if is_exact { self.list.len() } else { usize::MAX };
        let rows = most.min(length()).min(self.known()).min(other.known());
        let first = self.first.times(other.first.raised(-1.0));
        Some((Self::computed(first, rows, is_exact, Operation::Quotient(self.list, other.list))?, zero))
    }

    /// Returns the series divided by its first term, and the coefficients of that.
    fn split(&self, undefined: Outcomes) -> Option<(List, Coefficients)> {
        let first = self.list.first().filter(|_| self.leads(undefined))?;
        Some((self.list.changed(|_, row| row.divide(&first)), first))
    }

    /// Returns a power with a constant exponent other than 0, and the rays along which it is not defined.
    pub(super) fn raised(&self, exponent: f64, undefined: Outcomes) -> Option<(Self, Outcomes)> {
        let (rest, first) = self.split(undefined)?;
        let negative = Outcomes::of(|ray| first.factors[ray] < 0.0 && exponent.fract() != 0.0);
        let is_exact = self.is_exact && self.list.len() == 1;
        let rows = if is_exact { 1 } else { length().min(self.known()) };
        let raised = Self::computed(self.first.raised(exponent), rows, is_exact, Operation::Power(rest, exponent))?;
        let size = first.of_function(|x| power(x, exponent));
        Some((raised.changed(|_, row| row.multiply(&size))?, negative))
    }

    /// Returns the logarithm of the first term and that of the rest, and the rays along which they are not defined.
    pub(super) fn ln(&self, undefined: Outcomes) -> Option<([Self; 2], Outcomes)> {
        if self.first.logs != 0.0 {
            return None;
        }
        let (rest, first) = self.split(undefined)?;
        let negative = Outcomes::of(|ray| first.factors[ray] < 0.0);
        let is_exact = self.is_exact && self.list.len() == 1;
        let rows = if is_exact { 1 } else { length().min(self.known()) };
        let mut rest = Self::computed(Order::ONE, rows, is_exact, Operation::Logarithm(rest))?;
        let ln = |x: f64| if x > 0.0 { Number::ln::<Baseline>(x) } else { 0.0 };
        let constant = Self::new(Order::ONE, &[first.of_function(ln)], true)?;
        rest = constant.plus_part(&rest)?;
        let power =
            Self::new(Order { power: 0.0, logs: 1.0 }, &[Coefficients::exact([-self.first.power; LANES])], true)?;
        Some(([power, rest], negative))
    }

    /// Splits a finite series into its constants and the rest; `None` if its powers are others.
    fn finite(&self) -> Option<(Coefficients, List)> {
        let Order { power, logs } = self.first;
        if logs != 0.0 || power < 0.0 || power != power.round() || power > length() as f64 {
            return None;
        }
        let (from, mut rows) = (power as usize, [Coefficients::ZERO; MOST_ROWS]);
        let known = (from + self.list.len()).min(rows.len());
        self.list.with(|list| rows.iter_mut().skip(from).zip(list).for_each(|(row, own)| *row = *own));
        let constant = std::mem::replace(&mut rows[0], Coefficients::ZERO);
        (known > 0).then(|| (constant, List::of(&rows[..known])))
    }

    pub(super) fn exp(&self) -> Option<Self> {
        if self.is_zero() {
            return Self::constant([1.0; LANES]);
        }
        let (constant, rest) = self.finite()?;
        let (rows, is_exact) = self.extent(rest);
        let rest = Self::computed(Order::ONE, rows, is_exact, Operation::Exponential(rest))?;
        let size = Self::constant(constant.factors.map(Number::exp::<Baseline>))?;
        rest.times(&size)
    }

    /// Returns the rows of a function of this series, and whether it is exact, from the part that is not constant.
    fn extent(&self, rest: List) -> (usize, bool) {
        let is_exact = self.is_exact && rest.len() <= 1;
        (if is_exact { 1 } else { length().min(if self.is_exact { usize::MAX } else { rest.len() }) }, is_exact)
    }

    pub(super) fn sin_cos(&self) -> Option<[Self; 2]> {
        let (constant, rest) = self.finite()?;
        let (rows, is_exact) = self.extent(rest);
        let slight = rest.sine_cosine(rows)?.map(|list| Self { first: Order::ONE, list, is_exact }.stripped());
        // Multiples of π/2 are not doubles: a sine or cosine that should vanish there is rounding.
        let of_constant = |function: fn(f64) -> f64| {
            Self::constant(constant.factors.map(|x| match function(x) {
                y if x.abs() > 1.0 && y.abs() < CANCELLED => 0.0,
                y => y,
            }))
        };
        let ([sine, cosine], s, c) = (slight, of_constant(f64::sin)?, of_constant(f64::cos)?);
        let turned = |a: Self, b: Option<Self>| a.plus_part(&b?);
        Some([
            turned(cosine.times(&s)?, sine.times(&c))?,
            turned(cosine.times(&c)?, sine.times(&s).map(|part| part.signed(!Outcomes::none())))?,
        ])
    }

    /// Returns ε ∂/∂ε.
    fn slope(&self) -> Self {
        let list = self.list.changed(|k, row| row.scale(self.first.power + k as f64));
        Self { list, ..*self }.stripped()
    }

    /// Returns the series with this ε ∂/∂ε and no constant.
    fn integrated(self) -> Option<Self> {
        let power = self.first.power;
        (power > 0.0).then(|| self.changed(|k, row| row.scale(1.0 / (power + k as f64))))?
    }

    /// Returns the angle of the points (x, self): its first term, and the rest.
    pub(super) fn angle(&self, x: &Self, undefined: Outcomes) -> Option<[Self; 2]> {
        let y = self;
        if y.first.logs != 0.0 || x.first.logs != 0.0 || x.list.is_empty() || y.list.is_empty() {
            return None;
        }
        let square = x.times(x)?.plus_part(&y.times(y)?)?;
        if !square.leads(undefined) {
            return None;
        }
        let numerator = x.times(&y.slope())?.plus_difference(&y.times(&x.slope())?)?;
        let (slope, _) = numerator.over(&square, undefined)?;
        let rest = if slope.is_zero() { slope } else { slope.integrated()? };
        // The order of both decides the first term; the smaller one counts as a signed 0.
        let leading = |rows: &Self, other: &Self| match rows.first.power <= other.first.power {
            true => rows.list.first().unwrap_or(Coefficients::ZERO),
            false => Coefficients::ZERO,
        };
        let (y0, x0) = (leading(y, x), leading(x, y));
        let turn = |ray: usize| {
            let find = |rows: &[Coefficients]| rows.iter().map(|row| row.factors[ray]).find(|&factor| factor != 0.0);
            let sign = y.list.with(find).unwrap_or(0.0);
            let y0 = if y0.factors[ray] == 0.0 { 0.0_f64.copysign(sign) } else { y0.factors[ray] };
            Number::atan2::<Baseline>(y0, x0.factors[ray])
        };
        let constant = Self::constant(std::array::from_fn(|ray| if undefined.lane(ray) { 0.0 } else { turn(ray) }))?;
        Some([constant, rest])
    }

    /// Returns self − other, which may be 0.
    fn plus_difference(&self, other: &Self) -> Option<Self> {
        self.plus_part(&other.signed(!Outcomes::none()))
    }
}

fn power(x: f64, exponent: f64) -> f64 {
    let size = match exponent {
        0.5 => x.abs().sqrt(),
        _ if x == 0.0 => 0.0,
        _ => Number::powf::<Baseline>(x.abs(), exponent),
    };
    if x < 0.0 && exponent % 2.0 != 0.0 { -size } else { size }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn constant(x: f64) -> Rows {
        Rows::constant([x; LANES]).unwrap()
    }

    fn value(of: Option<Rows>) -> f64 {
        of.unwrap().as_constant(LANES).expect("a constant")
    }

    #[test]
    fn functions_of_constants_are_constants() {
        assert_eq!(value(Rows::zero().exp()), 1.0);
        assert_eq!(value(constant(1.0).exp()), Number::exp::<Baseline>(1.0));
        for x in [0.5, 1.0, 2.0, -3.0] {
            let [sine, cosine] = constant(x).sin_cos().unwrap();
            assert_eq!((value(Some(sine)), value(Some(cosine))), (x.sin(), x.cos()));
        }
    }

    #[test]
    fn sines_and_cosines_vanish_at_their_zeros() {
        use std::f64::consts::{FRAC_PI_2, PI};
        for (x, expected) in [(FRAC_PI_2, [1.0, 0.0]), (-FRAC_PI_2, [-1.0, 0.0]), (PI, [0.0, -1.0])] {
            assert_eq!(constant(x).sin_cos().unwrap().map(|part| value(Some(part))), expected);
        }
        // A small number is not the rounding error of a zero.
        assert_eq!(value(constant(1e-15).sin_cos().map(|[sine, _]| sine)), 1e-15);
    }
}
