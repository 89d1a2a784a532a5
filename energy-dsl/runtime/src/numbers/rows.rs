//! Series along several rays at once, as rows of coefficients.

use super::coefficients::{Coefficients, Compute, List, Operation, Row};
use super::cpu::dispatch;
use super::level::Baseline;
use super::outcomes::{LANES, Outcomes};
use super::real::{Mask, Number};
use super::series::{LENGTHS, Order, Term, length};

/// Series along all rays whose powers of ε ascend in steps of 1, all with one power of ln(1/ε).
#[derive(Clone, Debug)]
pub(super) struct Rows {
    first: Order,
    list: List,
    /// Whether the terms after the last row are 0. Otherwise they are unknown.
    is_exact: bool,
}

impl Rows {
    pub(super) fn zero() -> Self {
        Self { first: Order::ONE, list: List::zeros(0), is_exact: true }
    }

    /// Creates rows of the first coefficients; `None` if a number is too large or too small.
    pub(super) fn new(first: Order, rows: &[Coefficients], is_exact: bool) -> Option<Self> {
        let are_moderate = rows.iter().all(Coefficients::are_moderate);
        are_moderate.then(|| Self { first, list: List::of(rows), is_exact }.stripped())
    }

    fn constant(factors: Row) -> Option<Self> {
        Self::new(Order::ONE, &[Coefficients::exact(factors)], true)
    }

    /// Creates a constant along some rays.
    pub(super) fn same(factor: f64, size: f64, rays: Outcomes) -> Option<Self> {
        let along = |x: f64| std::array::from_fn(|ray| if rays.lane(ray) { x } else { 0.0 });
        Self::new(Order::ONE, &[Coefficients { factors: along(factor), sizes: along(size) }], true)
    }

    /// Creates x + slope · ε along each ray.
    pub(super) fn linear(x: Row, slopes: Row) -> Option<Self> {
        Self::new(Order::ONE, &[x, slopes].map(Coefficients::exact), true)
    }

    /// Drops leading rows that are 0.
    fn stripped(mut self) -> Self {
        let zeros = self.list.iter().take_while(|row| row.is_zero()).count();
        if zeros > 0 {
            self.list.drop_first(zeros);
            self.first.power += zeros as f64;
        }
        self
    }

    /// Sets the coefficients along some rays to 0.
    pub(super) fn cleared(mut self, rays: Outcomes) -> Self {
        if rays.any() {
            for row in &mut *self.list {
                row.set(rays, 0.0, 0.0);
            }
        }
        self.stripped()
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
        self.list.iter().all(|row| row.factors[ray] == 0.0)
    }

    /// Returns the known terms along a ray.
    pub(super) fn terms(&self, ray: usize) -> impl Iterator<Item = Term> {
        let term = move |(k, row): (usize, &Coefficients)| {
            let factor = row.factors[ray];
            (factor != 0.0).then(|| Term::of(self.order(k), factor, row.sizes[ray] / factor.abs()))
        };
        self.list.iter().enumerate().filter_map(term)
    }

    /// Returns whether the sum has one row for each power of both.
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        let step = self.first.power - other.first.power;
        self.first.logs == other.first.logs && step == step.round() && step.abs() <= length() as f64
    }

    fn computed(first: Order, rows: usize, is_exact: bool, operation: Operation<'_>) -> Option<Self> {
        let mut list = List::zeros(rows);
        let are_moderate = dispatch(Compute { operation, rows: &mut list });
        are_moderate.then(|| Self { first, list, is_exact }.stripped())
    }

    /// Returns self + sign · other, which overlap.
    pub(super) fn plus(&self, other: &Self, sign: f64) -> Option<Self> {
        let (first, [mine, others], most) = self.aligned(other);
        let known = self.known().saturating_add(mine).min(other.known().saturating_add(others));
        let rows = most.min(length()).min(known);
        let is_exact = self.is_exact && other.is_exact && rows == most;
        Self::computed(first, rows, is_exact, Operation::Sum([&self.list, &other.list], [mine, others], sign))
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
            (true, _) => Some(other.clone()),
            (_, true) => Some(self.clone()),
            _ if self.overlaps(other) => self.plus(other, 1.0),
            _ => None,
        }
    }

    pub(super) fn signed(&self, negative: Outcomes) -> Self {
        let mut rows = self.clone();
        for row in &mut *rows.list {
            (0..LANES).filter(|&ray| negative.lane(ray)).for_each(|ray| row.factors[ray] = -row.factors[ray]);
        }
        rows
    }

    pub(super) fn times(&self, other: &Self) -> Option<Self> {
        if self.is_zero() || other.is_zero() {
            return Some(Self::zero());
        }
        let most = (self.list.len() + other.list.len()).saturating_sub(1);
        let rows = most.min(length()).min(self.known()).min(other.known());
        let is_exact = self.is_exact && other.is_exact && rows == most;
        let first = self.first.times(other.first);
        Self::computed(first, rows, is_exact, Operation::Product(&self.list, &other.list))
    }

    /// Returns whether the first coefficient is a number other than 0 along all rays but some.
    fn leads(&self, but: Outcomes) -> bool {
        self.list.first().is_some_and(|row| (0..LANES).all(|ray| row.factors[ray] != 0.0 || but.lane(ray)))
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
        Some((Self::computed(first, rows, is_exact, Operation::Quotient(&self.list, &other.list))?, zero))
    }

    /// Returns the series divided by its first term, and the coefficients of that.
    fn split(&self, undefined: Outcomes) -> Option<(List, Coefficients)> {
        let leads = self.leads(undefined);
        leads.then(|| {
            let (mut rest, first) = (self.list, self.list[0]);
            rest.iter_mut().for_each(|row| row.divide(&first));
            (rest, first)
        })
    }

    /// Returns a power with a constant exponent other than 0, and the rays along which it is not defined.
    pub(super) fn raised(&self, exponent: f64, undefined: Outcomes) -> Option<(Self, Outcomes)> {
        let (rest, first) = self.split(undefined)?;
        let negative = Outcomes::of(|ray| first.factors[ray] < 0.0 && exponent.fract() != 0.0);
        let is_exact = self.is_exact && self.list.len() == 1;
        let rows = if is_exact { 1 } else { length().min(self.known()) };
        let mut raised =
            Self::computed(self.first.raised(exponent), rows, is_exact, Operation::Power(&rest, exponent))?;
        let size = first.of_function(|x| power(x, exponent));
        raised.list.iter_mut().for_each(|row| row.multiply(&size));
        Some((Self::new(raised.first, &raised.list, is_exact)?, negative))
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
        let mut rest = Self::computed(Order::ONE, rows, is_exact, Operation::Logarithm(&rest))?;
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
        let from = power as usize;
        let mut rows = List::zeros((from + self.list.len()).min(LENGTHS[0]));
        let kept = self.list.len().min(rows.len() - from);
        rows[from..].copy_from_slice(&self.list[..kept]);
        let constant = *rows.first()?;
        rows[0] = Coefficients::ZERO;
        Some((constant, rows))
    }

    pub(super) fn exp(&self) -> Option<Self> {
        if self.is_zero() {
            return Self::constant([1.0; LANES]);
        }
        let (constant, rest) = self.finite()?;
        let is_exact = self.is_exact && rest.len() == 1;
        let rows = if is_exact { 1 } else { length().min(if self.is_exact { usize::MAX } else { rest.len() }) };
        let rest = Self::computed(Order::ONE, rows, is_exact, Operation::Exponential(&rest))?;
        let size = Self::constant(constant.factors.map(Number::exp::<Baseline>))?;
        rest.times(&size)
    }

    /// Returns ε ∂/∂ε.
    fn slope(&self) -> Self {
        let mut rows = self.clone();
        rows.list.iter_mut().enumerate().for_each(|(k, row)| row.scale(self.first.power + k as f64));
        rows.stripped()
    }

    /// Returns the series with this ε ∂/∂ε and no constant.
    fn integrated(mut self) -> Option<Self> {
        let power = self.first.power;
        if power <= 0.0 {
            return None;
        }
        self.list.iter_mut().enumerate().for_each(|(k, row)| row.scale(1.0 / (power + k as f64)));
        Self::new(self.first, &self.list, self.is_exact)
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
            true => rows.list[0],
            false => Coefficients::ZERO,
        };
        let (y0, x0) = (leading(y, x), leading(x, y));
        let turn = |ray: usize| {
            let sign = y.list.iter().map(|row| row.factors[ray]).find(|&factor| factor != 0.0).unwrap_or(0.0);
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
