//! Numbers along a ray: series in an infinitesimal ε > 0.
//!
//! At a singular input x, a formula is evaluated at x + ε d for some directions d. The largest term of a result says
//! what it tends to as ε → 0. The series are those of a Hahn field: real powers of ε and of ln(1/ε), with the order
//! and the arithmetic of real numbers.

use std::cell::{Cell, RefCell};
use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::level::{Baseline, Level};
use super::real::Number;
use super::unbounded::Unbounded;

type Factor = Unbounded<f64>;

/// A sum this small against its operands is rounding: they cancel.
const CANCELLED: f64 = 1e-12;
/// Powers that differ by less are equal.
const SAME: f64 = 1e-9;
/// The power of what grows or vanishes faster than every power, such as e^(1/ε).
const BEYOND: f64 = 1e6;

/// The order of magnitude ε^power · ln(1/ε)^logs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Order {
    power: f64,
    logs: f64,
}

impl Order {
    const ONE: Self = Self { power: 0.0, logs: 0.0 };
    /// Smaller than everything: the first unknown term of an exact series.
    const NEVER: Self = Self { power: f64::INFINITY, logs: 0.0 };
    /// Larger than everything: of such a series nothing is known.
    const ALWAYS: Self = Self { power: f64::NEG_INFINITY, logs: 0.0 };

    /// Compares magnitudes; the larger one comes first.
    fn compare(self, other: Self) -> Ordering {
        let by = |a: f64, b: f64| if (a - b).abs() < SAME || a == b { Ordering::Equal } else { a.total_cmp(&b) };
        by(self.power, other.power).then(by(other.logs, self.logs))
    }

    fn is_larger_than(self, other: Self) -> bool {
        self.compare(other) == Ordering::Less
    }

    fn larger(self, other: Self) -> Self {
        if other.is_larger_than(self) { other } else { self }
    }

    fn times(self, other: Self) -> Self {
        Self { power: self.power + other.power, logs: self.logs + other.logs }
    }

    fn raised(self, exponent: f64) -> Self {
        Self { power: self.power * exponent, logs: self.logs * exponent }
    }
}

/// A term of a series.
#[derive(Clone, Copy, Debug)]
pub(super) struct Term {
    order: Order,
    factor: Factor,
}

impl Term {
    /// Returns whether the term is negative.
    pub(super) fn is_negative(self) -> bool {
        is_negative(self.factor)
    }

    /// Compares sizes: first the orders of magnitude, then the factors.
    pub(super) fn compare_size(self, other: Self) -> Ordering {
        let by_factor = match (self.factor.abs(), other.factor.abs()) {
            (a, b) if a.less(b) => Ordering::Less,
            (a, b) if b.less(a) => Ordering::Greater,
            _ => Ordering::Equal,
        };
        self.order.compare(other.order).reverse().then(by_factor)
    }

    /// Returns whether two terms are equal up to rounding.
    pub(super) fn is_near(self, other: Self) -> bool {
        let (difference, size) = ((self.factor - other.factor).abs(), self.factor.abs().max(other.factor.abs()));
        self.order.compare(other.order) == Ordering::Equal && difference.less_or_equal(size * factor(CANCELLED))
    }
}

/// Known terms, the largest first, and the order of the first unknown term.
#[derive(Clone, Debug)]
struct Series {
    terms: Vec<Term>,
    unknown: Order,
}

fn factor(value: f64) -> Factor {
    Factor::from_f64(value)
}

fn is_negative(x: Factor) -> bool {
    x.less(factor(0.0))
}

impl Series {
    fn constant(value: Factor) -> Self {
        Self::of(vec![Term { order: Order::ONE, factor: value }], Order::NEVER)
    }

    fn number(value: f64) -> Self {
        Self::constant(factor(value))
    }

    fn undefined() -> Self {
        Self { terms: Vec::new(), unknown: Order::ALWAYS }
    }

    /// Sorts terms, adds those of one order, and drops what is zero or unknown.
    fn of(mut terms: Vec<Term>, unknown: Order) -> Self {
        terms.sort_by(|a, b| a.order.compare(b.order));
        Self::sorted(terms, unknown)
    }

    /// Adds terms of one order, and drops what is zero or unknown.
    fn sorted(terms: Vec<Term>, mut unknown: Order) -> Self {
        if !terms.iter().all(|term| term.factor.is_finite()) {
            return Self::undefined();
        }
        let mut kept: Vec<Term> = Vec::with_capacity(terms.len());
        let mut first = 0;
        while first < terms.len() {
            let order = terms[first].order;
            let same = terms[first..].iter().take_while(|term| term.order.compare(order) == Ordering::Equal).count();
            let group = &terms[first..first + same];
            first += same;
            let sum = group.iter().fold(factor(0.0), |sum, term| sum + term.factor);
            let largest = group.iter().fold(factor(0.0), |largest, term| largest.max(term.factor.abs()));
            if (largest * factor(CANCELLED)).less(sum.abs()) && order.is_larger_than(unknown) {
                kept.push(Term { order, factor: sum });
            }
        }
        let length = LENGTH.get();
        if let Some(dropped) = kept.get(length) {
            unknown = unknown.larger(dropped.order);
            kept.truncate(length);
        }
        Self { terms: kept, unknown }
    }

    fn is_defined(&self) -> bool {
        self.unknown.power > f64::NEG_INFINITY
    }

    fn is_zero(&self) -> bool {
        self.terms.is_empty() && self.unknown.power == f64::INFINITY
    }

    /// Returns the order of the largest term that is or may be there.
    fn leading(&self) -> Order {
        self.terms.first().map_or(self.unknown, |term| term.order)
    }

    /// Returns −1, 0 or 1. What is not known counts as 0.
    fn sign(&self) -> f64 {
        self.terms.first().map_or(0.0, |term| if is_negative(term.factor) { -1.0 } else { 1.0 })
    }

    fn plus(&self, other: &Self) -> Self {
        let mut terms = Vec::with_capacity(self.terms.len() + other.terms.len());
        let (mut a, mut b) = (self.terms.iter().peekable(), other.terms.iter().peekable());
        while let (Some(x), Some(y)) = (a.peek(), b.peek()) {
            let first = if y.order.is_larger_than(x.order) { &mut b } else { &mut a };
            terms.extend(first.next());
        }
        terms.extend(a.chain(b));
        Self::sorted(terms, self.unknown.larger(other.unknown))
    }

    fn times(&self, other: &Self) -> Self {
        if !self.is_defined() || !other.is_defined() {
            return Self::undefined();
        }
        if self.is_zero() || other.is_zero() {
            return Self::number(0.0);
        }
        let unknown = self.unknown.times(other.leading()).larger(other.unknown.times(self.leading()));
        let product = |a: &Term, b: &Term| Term { order: a.order.times(b.order), factor: a.factor * b.factor };
        Self::of(self.terms.iter().flat_map(|a| other.terms.iter().map(move |b| product(a, b))).collect(), unknown)
    }

    fn scaled(&self, by: f64) -> Self {
        if by == 0.0 && self.is_defined() {
            return Self::number(0.0);
        }
        let terms = self.terms.iter().map(|term| Term { factor: term.factor * factor(by), ..*term }).collect();
        Self { terms, ..*self }
    }

    fn minus(&self, other: &Self) -> Self {
        self.plus(&other.scaled(-1.0))
    }

    /// Divides every term by one term.
    fn over(&self, by: Term) -> Self {
        let order = by.order.raised(-1.0);
        let terms = self.terms.iter();
        let terms = terms.map(|t| Term { order: t.order.times(order), factor: t.factor / by.factor }).collect();
        Self::sorted(terms, self.unknown.times(order))
    }

    /// Splits t (1 + r) into t and the infinitesimal r; `None` if no term is known.
    fn split(&self) -> Option<(Term, Self)> {
        let first = *self.terms.first()?;
        Some((first, Self { terms: self.terms[1..].to_vec(), ..*self }.over(first)))
    }

    /// Splits c + r into the number c and the infinitesimal r; `None` if it is not finite.
    fn finite(&self) -> Option<(f64, Self)> {
        if !Order::ONE.is_larger_than(self.unknown) {
            return None;
        }
        match self.terms.first() {
            Some(first) if first.order.is_larger_than(Order::ONE) => None,
            Some(first) if first.order.compare(Order::ONE) == Ordering::Equal => {
                Some((first.factor.to_scalar(), Self { terms: self.terms[1..].to_vec(), ..*self }))
            }
            _ => Some((0.0, self.clone())),
        }
    }

    /// Returns Σ coefficient(k) rᵏ for an infinitesimal r.
    fn composed(&self, coefficient: impl Fn(usize) -> f64) -> Self {
        let mut sum = Self::number(coefficient(0));
        if self.is_zero() {
            return sum;
        }
        let (mut power, length) = (Self::number(1.0), LENGTH.get());
        for k in 1..=length {
            power = power.times(self);
            sum = sum.plus(&power.scaled(coefficient(k)));
        }
        let rest = self.leading().raised(length as f64 + 1.0);
        Self::sorted(sum.terms, sum.unknown.larger(rest))
    }

    fn reciprocal(&self) -> Self {
        let Some((first, rest)) = self.split() else { return Self::undefined() };
        rest.composed(|k| if k.is_multiple_of(2) { 1.0 } else { -1.0 }).over(first)
    }

    /// Returns the power with a constant exponent.
    fn raised(&self, exponent: f64) -> Self {
        if exponent == 0.0 {
            return Self::number(1.0);
        }
        let Some((first, rest)) = self.split() else {
            return match exponent > 0.0 {
                true if self.is_zero() => self.clone(),
                true => Self { terms: Vec::new(), unknown: self.unknown.raised(exponent) },
                false => Self::undefined(),
            };
        };
        let odd = exponent % 2.0 != 0.0;
        if is_negative(first.factor) && exponent.fract() != 0.0 {
            return Self::undefined();
        }
        let size = first.factor.abs().powf::<Baseline>(factor(exponent));
        let size = if is_negative(first.factor) && odd { -size } else { size };
        let binomial = |k: usize| (0..k).map(|i| (exponent - i as f64) / (i + 1) as f64).product();
        let order = first.order.raised(-exponent);
        rest.composed(binomial).over(Term { order, factor: factor(1.0) / size })
    }

    fn exp(&self) -> Self {
        if let Some((constant, rest)) = self.finite() {
            let size = factor(constant).exp::<Baseline>();
            return rest.composed(|k| 1.0 / factorial(k)).times(&Self::constant(size));
        }
        let Some(first) = self.terms.first().copied() else { return Self::undefined() };
        // e^(a ln(1/ε) + r) = ε^(−a) eʳ.
        if first.order.compare(Order { power: 0.0, logs: 1.0 }) == Ordering::Equal {
            let order = Order { power: first.factor.to_scalar(), logs: 0.0 };
            let rest = Self { terms: self.terms[1..].to_vec(), ..*self };
            return rest.exp().over(Term { order, factor: factor(1.0) });
        }
        let power = if is_negative(first.factor) { BEYOND } else { -BEYOND };
        Self::of(vec![Term { order: Order { power, logs: 0.0 }, factor: factor(1.0) }], Order::NEVER)
    }

    fn ln(&self) -> Self {
        let Some((first, rest)) = self.split() else { return Self::undefined() };
        // ln ln(1/ε) is no term of a series.
        if is_negative(first.factor) || first.order.logs != 0.0 {
            return Self::undefined();
        }
        let log = Term { order: Order { power: 0.0, logs: 1.0 }, factor: factor(-first.order.power) };
        let constant = Term { order: Order::ONE, factor: first.factor.ln::<Baseline>() };
        let series =
            rest.composed(|k| if k == 0 { 0.0 } else { (if k.is_multiple_of(2) { -1.0 } else { 1.0 }) / k as f64 });
        Self::of(vec![log, constant], Order::NEVER).plus(&series)
    }

    /// Returns sine and cosine.
    fn sin_cos(&self) -> (Self, Self) {
        let Some((constant, rest)) = self.finite() else { return (Self::undefined(), Self::undefined()) };
        let alternating = |k: usize| (if (k / 2).is_multiple_of(2) { 1.0 } else { -1.0 }) / factorial(k);
        let sine = rest.composed(|k| if k % 2 == 1 { alternating(k) } else { 0.0 });
        let cosine = rest.composed(|k| if k % 2 == 0 { alternating(k) } else { 0.0 });
        // Multiples of π/2 are not doubles: what is left of a sine or cosine there is rounding.
        let is_rounding = |x: f64| constant.abs() > 1.0 && x.abs() < CANCELLED;
        let (s, c) = constant.sin_cos();
        let [s, c] = [s, c].map(|x| if is_rounding(x) { 0.0 } else { x });
        (cosine.scaled(s).plus(&sine.scaled(c)), cosine.scaled(c).minus(&sine.scaled(s)))
    }

    /// Returns the arctangent of a finite series.
    fn arctangent(&self) -> Self {
        let Some((constant, rest)) = self.finite() else { return Self::undefined() };
        // atan(c + r) = atan c + atan(r / (1 + c² + c r)).
        let below = Self::number(1.0 + constant * constant).plus(&rest.scaled(constant));
        let slight = rest.times(&below.reciprocal());
        let odd = |k: usize| if k.is_multiple_of(2) { 0.0 } else { (if k % 4 == 1 { 1.0 } else { -1.0 }) / k as f64 };
        Self::number(constant.atan()).plus(&slight.composed(odd))
    }

    /// Returns the angle of the point (x, self).
    fn angle(&self, x: &Self) -> Self {
        use std::f64::consts::{FRAC_PI_2, PI};
        if self.is_zero() && x.sign() > 0.0 {
            return Self::number(0.0);
        }
        let turn = if self.sign() < 0.0 { -1.0 } else { 1.0 };
        let (own, other) = (self.abs(), x.abs());
        if own.minus(&other).sign() <= 0.0 {
            let slope = self.times(&x.reciprocal()).arctangent();
            return if x.sign() < 0.0 { slope.plus(&Self::number(turn * PI)) } else { slope };
        }
        let slope = x.times(&self.reciprocal()).arctangent();
        Self::number(turn * FRAC_PI_2).minus(&slope)
    }

    fn abs(&self) -> Self {
        if self.sign() < 0.0 { self.scaled(-1.0) } else { self.clone() }
    }

    fn limit(&self) -> Limit {
        let Some(first) = self.terms.first() else {
            return if Order::ONE.is_larger_than(self.unknown) { Limit::Finite(factor(0.0)) } else { Limit::Unknown };
        };
        match first.order.compare(Order::ONE) {
            Ordering::Less => Limit::Infinite(self.sign()),
            Ordering::Equal => Limit::Finite(first.factor),
            Ordering::Greater => Limit::Finite(factor(0.0)),
        }
    }
}

fn factorial(k: usize) -> f64 {
    (1..=k).map(|i| i as f64).product()
}

/// What a number tends to as ε → 0.
#[derive(Clone, Copy, Debug)]
pub(super) enum Limit {
    /// A finite number.
    Finite(Unbounded<f64>),
    /// An infinity with the sign of this number.
    Infinite(f64),
    /// The number is not defined along the ray.
    Unknown,
}

/// Evaluates a routine along a ray; `None` if the formula itself is degenerate there.
pub(super) type Along<'a> = &'a dyn Fn(&[Ray]) -> Option<Vec<Ray>>;

/// Terms that a series keeps at first, and if these do not determine a limit.
const LENGTHS: [usize; 2] = [4, 10];

thread_local! {
    /// Terms that a series keeps.
    static LENGTH: Cell<usize> = const { Cell::new(LENGTHS[1]) };
    /// The series of all rays that this thread is computing.
    static SERIES: RefCell<Vec<Series>> = const { RefCell::new(Vec::new()) };
    /// The comparisons of the ray that this thread is computing, in order of evaluation.
    static COMPARISONS: RefCell<Vec<Comparison>> = const { RefCell::new(Vec::new()) };
    /// Comparisons whose outcomes are reversed.
    static REVERSED: RefCell<Vec<usize>> = const { RefCell::new(Vec::new()) };
}

/// A comparison of two numbers along a ray: the largest term of their difference; `None` if that is 0 or undefined.
pub(super) type Comparison = Option<Term>;

/// What a routine computes along a ray.
#[derive(Debug)]
pub(super) struct Found {
    /// Limits of the results; `None` if the formula is degenerate along the ray.
    pub limits: Option<Vec<Limit>>,
    /// All comparisons but tests of equality. Routines do not branch, so all rays have the same ones.
    pub comparisons: Vec<Comparison>,
}

/// A number along a ray: a handle of a series. Generated code has thousands of them on its stack.
#[derive(Clone, Copy, Debug)]
pub struct Ray(u32);

impl Ray {
    /// Returns what a routine computes at x + slope · ε, where `along` evaluates it.
    pub(super) fn evaluate(x: &[Unbounded<f64>], slopes: &[f64], along: Along<'_>) -> Found {
        let short = Self::evaluate_to(LENGTHS[0], x, slopes, along);
        let is_known = |limits: &Vec<Limit>| !limits.iter().any(|limit| matches!(limit, Limit::Unknown));
        if short.limits.as_ref().is_none_or(is_known) { short } else { Self::evaluate_to(LENGTHS[1], x, slopes, along) }
    }

    /// Returns what the routine would compute if some comparisons had the other outcome.
    pub(super) fn evaluate_reversed(
        comparisons: &[usize],
        x: &[Unbounded<f64>],
        slopes: &[f64],
        along: Along<'_>,
    ) -> Found {
        REVERSED.set(comparisons.to_vec());
        let found = Self::evaluate(x, slopes, along);
        REVERSED.take();
        found
    }

    /// Returns the comparisons at x + slope · ε.
    pub(super) fn compare(x: &[Unbounded<f64>], slopes: &[f64], along: Along<'_>) -> Vec<Comparison> {
        Self::evaluate_to(LENGTHS[0], x, slopes, along).comparisons
    }

    fn evaluate_to(length: usize, x: &[Unbounded<f64>], slopes: &[f64], along: Along<'_>) -> Found {
        LENGTH.set(length);
        let rays: Vec<Self> = x.iter().zip(slopes).map(|(&x, &slope)| Self::from(x, slope)).collect();
        let limits = along(&rays).map(|found| found.into_iter().map(Self::limit).collect::<Vec<_>>());
        SERIES.with_borrow_mut(Vec::clear);
        LENGTH.set(LENGTHS[1]);
        Found { limits, comparisons: COMPARISONS.take() }
    }

    /// Creates x + slope · ε. An infinite x becomes |slope|/ε with its sign.
    fn from(x: Unbounded<f64>, slope: f64) -> Self {
        let term = |power: f64, factor| Term { order: Order { power, logs: 0.0 }, factor };
        let plain = x.to_scalar();
        if !x.is_finite() {
            let size = if slope == 0.0 { 1.0 } else { slope.abs() };
            return Self::new(Series::of(vec![term(-1.0, factor(size.copysign(plain)))], Order::NEVER));
        }
        Self::new(Series::of(vec![term(0.0, x), term(1.0, factor(slope))], Order::NEVER))
    }

    fn limit(self) -> Limit {
        self.read(Series::limit)
    }

    fn new(series: Series) -> Self {
        SERIES.with_borrow_mut(|all| {
            all.push(series);
            Self(u32::try_from(all.len() - 1).expect("a routine has fewer than 2³² operations"))
        })
    }

    fn read<R>(self, with: impl FnOnce(&Series) -> R) -> R {
        SERIES.with_borrow(|all| with(&all[self.0 as usize]))
    }

    fn map(self, with: impl FnOnce(&Series) -> Series) -> Self {
        Self::new(self.read(with))
    }

    fn map_two(self, other: Self, with: impl FnOnce(&Series, &Series) -> Series) -> Self {
        let series = SERIES.with_borrow(|all| with(&all[self.0 as usize], &all[other.0 as usize]));
        Self::new(series)
    }

    /// Returns the sign of self − other; `None` if one is undefined.
    fn against(self, other: Self) -> Option<f64> {
        SERIES.with_borrow(|all| {
            let (a, b) = (&all[self.0 as usize], &all[other.0 as usize]);
            let difference = (a.is_defined() && b.is_defined()).then(|| a.minus(b));
            let sign = compared(difference.as_ref());
            difference.is_some().then_some(sign)
        })
    }
}

/// Records a comparison of a difference with 0 and returns the sign, or the other sign if the outcome is reversed.
fn compared(difference: Option<&Series>) -> f64 {
    let sign = difference.map_or(0.0, Series::sign);
    let number = COMPARISONS.with_borrow_mut(|all| {
        all.push(difference.and_then(|difference| difference.terms.first().copied()));
        all.len() - 1
    });
    if REVERSED.with_borrow(|reversed| reversed.contains(&number)) { -sign } else { sign }
}

macro_rules! operator {
    ($trait:ident, $method:ident, |$a:ident, $b:ident| $result:expr) => {
        impl $trait for Ray {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                self.map_two(other, |$a, $b| $result)
            }
        }
    };
}

operator!(Add, add, |a, b| a.plus(b));
operator!(Sub, sub, |a, b| a.minus(b));
operator!(Mul, mul, |a, b| a.times(b));
operator!(Div, div, |a, b| a.times(&b.reciprocal()));

impl Neg for Ray {
    type Output = Self;
    fn neg(self) -> Self {
        self.map(|a| a.scaled(-1.0))
    }
}

impl Number for Ray {
    type Mask = bool;
    type Unbounded = Self;

    fn unbounded(&self, _lane: usize) -> Self {
        *self
    }
    fn set_lane(&mut self, _lane: usize, value: Self) {
        *self = value;
    }
    fn from_f64(value: f64) -> Self {
        Self::new(Series::number(value))
    }
    fn sqrt(self) -> Self {
        self.map(|a| a.raised(0.5))
    }
    fn abs(self) -> Self {
        self.map(|a| a.scaled(if compared(Some(a)) < 0.0 { -1.0 } else { 1.0 }))
    }
    fn min(self, other: Self) -> Self {
        if other.less(self) { other } else { self }
    }
    fn max(self, other: Self) -> Self {
        if self.less(other) { other } else { self }
    }
    fn sin<L: Level>(self) -> Self {
        self.map(|a| a.sin_cos().0)
    }
    fn cos<L: Level>(self) -> Self {
        self.map(|a| a.sin_cos().1)
    }
    fn exp<L: Level>(self) -> Self {
        self.map(Series::exp)
    }
    fn ln<L: Level>(self) -> Self {
        self.map(Series::ln)
    }
    fn atan2<L: Level>(self, x: Self) -> Self {
        self.map_two(x, Series::angle)
    }
    fn powf<L: Level>(self, exponent: Self) -> Self {
        self.map_two(exponent, |base, exponent| match exponent.finite() {
            Some((constant, rest)) if rest.is_zero() => base.raised(constant),
            _ => base.ln().times(exponent).exp(),
        })
    }
    // A series is exact: nothing is rounded.
    fn sum_error(self, _: Self) -> Self {
        Self::from_f64(0.0)
    }
    fn product_error<L: Level>(self, _: Self) -> Self {
        Self::from_f64(0.0)
    }
    fn root_error<L: Level>(self, _: Self) -> Self {
        Self::from_f64(0.0)
    }
    fn power_of_two_scale(self) -> Self {
        Self::from_f64(1.0)
    }
    fn less(self, other: Self) -> bool {
        self.against(other).is_some_and(|sign| sign < 0.0)
    }
    fn less_or_equal(self, other: Self) -> bool {
        self.against(other).is_some_and(|sign| sign <= 0.0)
    }
    fn equal(self, other: Self) -> bool {
        SERIES.with_borrow(|all| {
            let (a, b) = (&all[self.0 as usize], &all[other.0 as usize]);
            a.is_defined() && b.is_defined() && a.minus(b).sign() == 0.0
        })
    }
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type B = Baseline;

    fn ray(x: f64, slope: f64) -> Ray {
        Ray::from(Unbounded::of(x), slope)
    }

    fn limit(of: Ray) -> f64 {
        match of.limit() {
            Limit::Finite(value) => value.to_scalar(),
            Limit::Infinite(sign) => sign * f64::INFINITY,
            Limit::Unknown => f64::NAN,
        }
    }

    fn number(value: f64) -> Ray {
        Ray::from_f64(value)
    }

    #[test]
    fn limits_of_textbook_quotients() {
        let x = ray(0.0, 0.7);
        assert_eq!(limit(x / x), 1.0);
        assert!((limit(x.sin::<B>() / x) - 1.0).abs() < 1e-15);
        assert!((limit((number(1.0) - x.cos::<B>()) / (x * x)) - 0.5).abs() < 1e-15);
        assert!((limit((x.exp::<B>() - number(1.0) - x) / (x * x)) - 0.5).abs() < 1e-14);
        assert!((limit((x - x.sin::<B>()) / (x * x * x)) - 1.0 / 6.0).abs() < 1e-14);
        assert!((limit((number(1.0) + x).ln::<B>() / x) - 1.0).abs() < 1e-15);
        assert_eq!(limit(x * x.ln::<B>()), 0.0);
        assert!((limit(x.powf::<B>(x)) - 1.0).abs() < 1e-15);
        assert_eq!(limit(x.ln::<B>()), f64::NEG_INFINITY);
        assert_eq!(limit((number(-1.0) / x).exp::<B>() / x), 0.0);
        assert_eq!(limit(number(1.0) / ray(0.0, -1.0)), f64::NEG_INFINITY);
        let quarter = ray(std::f64::consts::FRAC_PI_2, 0.7);
        assert_eq!(limit(quarter.cos::<B>() / (number(1.0) - quarter.sin::<B>()).sqrt()), -(2.0_f64.sqrt()));
        let third = (ray(8.0, 1.0).powf::<B>(number(1.0 / 3.0)) - number(2.0)) / ray(0.0, 1.0);
        assert!((limit(third) - 1.0 / 12.0).abs() < 1e-14);
    }

    #[test]
    fn lengths_and_angles_have_their_directions() {
        let (x, y) = (ray(0.0, 3.0), ray(0.0, -4.0));
        let length = (x * x + y * y).sqrt();
        assert!((limit(x / length) - 0.6).abs() < 1e-15 && limit(length) == 0.0);
        assert!((limit(y.atan2::<B>(x)) - (-4.0_f64).atan2(3.0)).abs() < 1e-15);
        let pi = ray(0.0, 1.0).atan2::<B>(number(-1.0));
        assert!((limit(pi) - std::f64::consts::PI).abs() < 1e-15);
        let (far, near) = (ray(f64::INFINITY, 0.5), ray(2.0, 0.3));
        assert_eq!(limit(far - near), f64::INFINITY);
        assert!((limit(far / (far + near)) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn comparisons_see_the_infinitesimal_part() {
        assert!(number(1.0).less(ray(1.0, 1e-30)) && ray(1.0, -1e-30).less(number(1.0)));
        assert!(ray(0.0, 1.0).less(number(1e-300)) && number(1e300).less(number(1.0) / ray(0.0, 1.0)));
        let undefined = number(-1.0).sqrt();
        assert!(!undefined.equal(undefined) && limit(undefined).is_nan());
    }
}
