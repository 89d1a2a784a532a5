//! Series in an infinitesimal ε > 0: those of a Hahn field. They have real powers of ε and of ln(1/ε), and the order
//! and the arithmetic of real numbers.

use std::cell::Cell;
use std::cmp::Ordering;

use super::level::Baseline;
use super::real::Number;
use super::unbounded::Unbounded;

type Factor = Unbounded<f64>;

/// Terms that a series keeps at first, and if these do not determine a limit.
pub(super) const LENGTHS: [usize; 3] = [3, MOST_ROWS, LONGEST];
/// The most terms of series that are kept as rows.
pub(super) const MOST_ROWS: usize = 6;
/// The most terms of a series. Longer series lose terms of other powers.
const LONGEST: usize = 10;

thread_local! {
    /// Terms that a series keeps.
    static LENGTH: Cell<usize> = const { Cell::new(LONGEST) };
}

/// Evaluates with series of at most this many terms.
pub(super) fn with_length<R>(length: usize, evaluate: impl FnOnce() -> R) -> R {
    LENGTH.set(length);
    let result = evaluate();
    LENGTH.set(LONGEST);
    result
}

/// Returns the number of terms that a series keeps.
pub(super) fn length() -> usize {
    LENGTH.get()
}

/// A sum this small against everything that it was computed from is rounding: its terms cancel.
pub(super) const CANCELLED: f64 = 1e-12;
/// Powers that differ by less are equal.
const SAME: f64 = 1e-9;
/// Terms further apart than this many whole powers are sorted.
const MOST_STEPS: f64 = 64.0;
/// The power of what grows or vanishes faster than every power, such as e^(1/ε).
const BEYOND: f64 = 1e6;

/// The order of magnitude ε^power · ln(1/ε)^logs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Order {
    pub(super) power: f64,
    pub(super) logs: f64,
}

impl Order {
    pub(super) const ONE: Self = Self { power: 0.0, logs: 0.0 };
    /// Smaller than everything: the first unknown term of an exact series.
    pub(super) const NEVER: Self = Self { power: f64::INFINITY, logs: 0.0 };
    /// Larger than everything: of such a series nothing is known, because it has too few terms.
    const ALWAYS: Self = Self { power: f64::NEG_INFINITY, logs: 0.0 };
    /// Larger still: such a series does not exist.
    const NOWHERE: Self = Self { power: f64::NEG_INFINITY, logs: 1.0 };

    /// Compares magnitudes; the larger one comes first.
    pub(super) fn compare(self, other: Self) -> Ordering {
        let by = |a: f64, b: f64| if (a - b).abs() < SAME || a == b { Ordering::Equal } else { a.total_cmp(&b) };
        by(self.power, other.power).then(by(other.logs, self.logs))
    }

    pub(super) fn is_larger_than(self, other: Self) -> bool {
        self.compare(other) == Ordering::Less
    }

    /// Returns the order this many whole powers of ε smaller.
    pub(super) fn after(self, steps: usize) -> Self {
        Self { power: self.power + steps as f64, ..self }
    }

    /// Returns the number of whole powers of ε from a larger order to this one; `None` if it is not whole or exceeds
    /// the length of rows.
    pub(super) fn row_from(self, first: Self) -> Option<usize> {
        let step = self.power - first.power;
        let is_row = self.logs == first.logs && step == step.round() && (0.0..length() as f64).contains(&step);
        is_row.then_some(step as usize)
    }

    pub(super) fn larger(self, other: Self) -> Self {
        if other.is_larger_than(self) { other } else { self }
    }

    pub(super) fn times(self, other: Self) -> Self {
        Self { power: self.power + other.power, logs: self.logs + other.logs }
    }

    pub(super) fn raised(self, exponent: f64) -> Self {
        Self { power: self.power * exponent, logs: self.logs * exponent }
    }
}

/// A term of a series.
#[derive(Clone, Copy, Debug)]
pub(super) struct Term {
    order: Order,
    factor: Factor,
    /// Size of the largest number that was added or subtracted on the way, relative to the factor. The relative error
    /// of the factor is this many roundoffs.
    doubt: f64,
}

impl Term {
    fn exact(order: Order, factor: Factor) -> Self {
        Self { order, factor, doubt: 1.0 }
    }

    pub(super) fn of(order: Order, by: f64, doubt: f64) -> Self {
        Self { order, factor: factor(by), doubt }
    }

    pub(super) fn order(self) -> Order {
        self.order
    }

    /// Returns the factor and the size of its largest summand, if doubles have them.
    pub(super) fn plain(self) -> Option<(f64, f64)> {
        let plain = self.factor.to_scalar();
        plain.is_normal().then_some((plain, plain.abs() * self.doubt))
    }

    /// Returns the limit of a series that begins with this term.
    pub(super) fn limit(self) -> Limit {
        match self.order.compare(Order::ONE) {
            Ordering::Less => Limit::Infinite(if self.is_negative() { -1.0 } else { 1.0 }),
            Ordering::Equal => Limit::Finite(self.factor, self.doubt),
            Ordering::Greater => Limit::zero(),
        }
    }

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
pub(super) struct Series {
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
        let plain = value.to_scalar();
        if plain.is_infinite() && !value.is_finite() {
            // The constant `infinity` of a formula.
            let order = Order { power: -BEYOND, logs: 0.0 };
            return Self::of(vec![Term::exact(order, factor(1.0_f64.copysign(plain)))], Order::NEVER);
        }
        Self::of(vec![Term::exact(Order::ONE, value)], Order::NEVER)
    }

    pub(super) fn number(value: f64) -> Self {
        Self::constant(factor(value))
    }

    /// Creates x + slope · ε. An infinite x becomes |slope|/ε with its sign.
    pub(super) fn linear(x: Factor, slope: f64) -> Self {
        let term = |power: f64, factor| Term::exact(Order { power, logs: 0.0 }, factor);
        let plain = x.to_scalar();
        if !x.is_finite() {
            let size = if slope == 0.0 { 1.0 } else { slope.abs() };
            return Self::of(vec![term(-1.0, factor(size.copysign(plain)))], Order::NEVER);
        }
        Self::of(vec![term(0.0, x), term(1.0, factor(slope))], Order::NEVER)
    }

    pub(super) fn undefined() -> Self {
        Self { terms: Vec::new(), unknown: Order::NOWHERE }
    }

    /// Creates a series that more terms might tell more of.
    pub(super) fn open() -> Self {
        Self { terms: Vec::new(), unknown: Order::ALWAYS }
    }

    /// Returns whether nothing is known because there are too few terms.
    pub(super) fn is_open(&self) -> bool {
        !self.is_defined() && self.unknown.logs <= 0.0
    }

    /// Returns what is known of a function of this series that needs its first term, without such a term.
    fn without_terms(&self) -> Self {
        match () {
            () if !self.is_defined() => self.clone(),
            () if self.is_zero() => Self::undefined(),
            () => Self::open(),
        }
    }

    /// Returns what is known of a function that needs a finite series.
    fn not_finite(&self) -> Self {
        let is_infinite = |first: &Term| first.order.is_larger_than(Order::ONE);
        if self.terms.first().is_some_and(is_infinite) { Self::undefined() } else { self.without_terms() }
    }

    pub(super) fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// Returns the order of the first unknown term.
    pub(super) fn unknown(&self) -> Order {
        self.unknown
    }

    /// Sorts terms, adds those of one order, and drops those that are zero or unknown.
    pub(super) fn of(mut terms: Vec<Term>, unknown: Order) -> Self {
        terms.sort_by(|a, b| a.order.compare(b.order));
        Self::sorted(terms, unknown)
    }

    /// Adds terms of one order, and drops those that are zero or unknown.
    fn sorted(mut terms: Vec<Term>, mut unknown: Order) -> Self {
        if !terms.iter().all(|term| term.factor.is_finite()) {
            return Self::undefined();
        }
        let (mut first, mut kept, length) = (0, 0, LENGTH.get());
        while first < terms.len() {
            let order = terms[first].order;
            let same = terms[first..].iter().take_while(|term| term.order.compare(order) == Ordering::Equal).count();
            let sum = sum_of(&terms[first..first + same]);
            first += same;
            if let Some(sum) = sum.filter(|_| order.is_larger_than(unknown)) {
                if kept == length {
                    unknown = unknown.larger(order);
                    break;
                }
                terms[kept] = sum;
                kept += 1;
            }
        }
        terms.truncate(kept);
        Self { terms, unknown }
    }

    pub(super) fn is_defined(&self) -> bool {
        self.unknown.power > f64::NEG_INFINITY
    }

    pub(super) fn is_zero(&self) -> bool {
        self.terms.is_empty() && self.unknown.power == f64::INFINITY
    }

    /// Returns the largest term; `None` if none is known.
    pub(super) fn first(&self) -> Option<Term> {
        self.terms.first().copied()
    }

    /// Returns the order of the largest term that is or may be there.
    fn leading(&self) -> Order {
        self.terms.first().map_or(self.unknown, |term| term.order)
    }

    /// Returns −1, 0 or 1. An unknown sign is 0.
    pub(super) fn sign(&self) -> f64 {
        self.terms.first().map_or(0.0, |term| if is_negative(term.factor) { -1.0 } else { 1.0 })
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        let mut terms = Vec::with_capacity(self.terms.len() + other.terms.len());
        let (mut a, mut b) = (self.terms.iter().peekable(), other.terms.iter().peekable());
        while let (Some(x), Some(y)) = (a.peek(), b.peek()) {
            let first = if y.order.is_larger_than(x.order) { &mut b } else { &mut a };
            terms.extend(first.next());
        }
        terms.extend(a.chain(b));
        Self::sorted(terms, self.unknown.larger(other.unknown))
    }

    pub(super) fn times(&self, other: &Self) -> Self {
        if !self.is_defined() || !other.is_defined() {
            return Self { terms: Vec::new(), unknown: self.unknown.larger(other.unknown) };
        }
        if self.is_zero() || other.is_zero() {
            return Self::number(0.0);
        }
        let unknown = self.unknown.times(other.leading()).larger(other.unknown.times(self.leading()));
        let product = |a: &Term, b: &Term| Term {
            order: a.order.times(b.order),
            factor: a.factor * b.factor,
            doubt: a.doubt.max(b.doubt),
        };
        let Some((own, others)) = self.steps().zip(other.steps()) else {
            let products = self.terms.iter().flat_map(|a| other.terms.iter().map(move |b| product(a, b)));
            return Self::of(products.collect(), unknown);
        };
        // Powers of both ascend in whole steps, so that products need not be sorted.
        let last = own[self.terms.len().max(1) - 1] + others[other.terms.len().max(1) - 1];
        let mut terms = Vec::with_capacity(self.terms.len() * other.terms.len());
        for step in 0..=last {
            for (a, &at) in self.terms.iter().zip(&own) {
                let partner = others[..other.terms.len()].iter().position(|&other| at + other == step);
                terms.extend(partner.map(|partner| product(a, &other.terms[partner])));
            }
        }
        Self::sorted(terms, unknown)
    }

    /// Returns the whole steps between the power of each term and that of the first; `None` if there are other powers,
    /// or logarithms.
    fn steps(&self) -> Option<[usize; LONGEST]> {
        let (mut steps, first) = ([0; LONGEST], self.leading().power);
        for (step, term) in steps.iter_mut().zip(&self.terms) {
            let distance = term.order.power - first;
            if term.order.logs != 0.0 || distance != distance.round() || distance > MOST_STEPS {
                return None;
            }
            *step = distance as usize;
        }
        Some(steps)
    }

    pub(super) fn scaled(&self, by: f64) -> Self {
        if by == 0.0 && self.is_defined() {
            return Self::number(0.0);
        }
        let terms = self.terms.iter().map(|term| Term { factor: term.factor * factor(by), ..*term }).collect();
        Self { terms, ..*self }
    }

    pub(super) fn minus(&self, other: &Self) -> Self {
        self.plus(&other.scaled(-1.0))
    }

    /// Divides every term by one term.
    fn over(&self, by: Term) -> Self {
        let order = by.order.raised(-1.0);
        let quotient =
            |t: &Term| Term { order: t.order.times(order), factor: t.factor / by.factor, doubt: t.doubt.max(by.doubt) };
        let terms = self.terms.iter().map(quotient).collect();
        Self::sorted(terms, self.unknown.times(order))
    }

    /// Splits t (1 + r) into t and the infinitesimal r; `None` if no term is known.
    fn split(&self) -> Option<(Term, Self)> {
        let &first = self.terms.first()?;
        Some((first, Self { terms: self.terms[1..].to_vec(), ..*self }.over(first)))
    }

    /// Splits c + r into the number c and the infinitesimal r; `None` if it is not finite.
    pub(super) fn finite(&self) -> Option<(f64, Self)> {
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

    pub(super) fn reciprocal(&self) -> Self {
        let Some((first, rest)) = self.split() else { return self.without_terms() };
        rest.composed(|k| if k.is_multiple_of(2) { 1.0 } else { -1.0 }).over(first)
    }

    /// Returns the power with a constant exponent.
    pub(super) fn raised(&self, exponent: f64) -> Self {
        if exponent == 0.0 {
            return Self::number(1.0);
        }
        let Some((first, rest)) = self.split() else {
            return match exponent > 0.0 {
                true if self.is_zero() => self.clone(),
                true => Self { terms: Vec::new(), unknown: self.unknown.raised(exponent) },
                false => self.without_terms(),
            };
        };
        let odd = exponent % 2.0 != 0.0;
        if is_negative(first.factor) && exponent.fract() != 0.0 {
            return Self::undefined();
        }
        let size = first.factor.abs().powf::<Baseline>(factor(exponent));
        let size = if is_negative(first.factor) && odd { -size } else { size };
        let order = first.order.raised(-exponent);
        rest.composed(|k| binomial(exponent, k)).over(Term { order, factor: factor(1.0) / size, doubt: first.doubt })
    }

    pub(super) fn exp(&self) -> Self {
        if let Some((constant, rest)) = self.finite() {
            let size = factor(constant).exp::<Baseline>();
            return rest.composed(|k| 1.0 / factorial(k)).times(&Self::constant(size));
        }
        let Some((first, _)) = self.split() else { return self.without_terms() };
        // e^(a ln(1/ε) + r) = ε^(−a) eʳ.
        if first.order.compare(Order { power: 0.0, logs: 1.0 }) == Ordering::Equal {
            let order = Order { power: first.factor.to_scalar(), logs: 0.0 };
            let rest = Self { terms: self.terms[1..].to_vec(), ..*self };
            return rest.exp().over(Term::exact(order, factor(1.0)));
        }
        let power = if is_negative(first.factor) { BEYOND } else { -BEYOND };
        Self::of(vec![Term::exact(Order { power, logs: 0.0 }, factor(1.0))], Order::NEVER)
    }

    pub(super) fn ln(&self) -> Self {
        let Some((first, rest)) = self.split() else { return self.without_terms() };
        // ln ln(1/ε) is not a term of a series.
        if is_negative(first.factor) || first.order.logs != 0.0 {
            return Self::undefined();
        }
        let log = Term::exact(Order { power: 0.0, logs: 1.0 }, factor(-first.order.power));
        let constant = Term { order: Order::ONE, factor: first.factor.ln::<Baseline>(), doubt: first.doubt };
        Self::of(vec![log, constant], Order::NEVER).plus(&rest.composed(logarithmic))
    }

    /// Returns sine and cosine.
    pub(super) fn sin_cos(&self) -> (Self, Self) {
        let Some((constant, rest)) = self.finite() else { return (self.not_finite(), self.not_finite()) };
        let alternating = |k: usize| (if (k / 2).is_multiple_of(2) { 1.0 } else { -1.0 }) / factorial(k);
        let sine = rest.composed(|k| if k % 2 == 1 { alternating(k) } else { 0.0 });
        let cosine = rest.composed(|k| if k % 2 == 0 { alternating(k) } else { 0.0 });
        // Multiples of π/2 are not doubles: a sine or cosine that should vanish there is rounding.
        let is_rounding = |x: f64| constant.abs() > 1.0 && x.abs() < CANCELLED;
        let (s, c) = constant.sin_cos();
        let [s, c] = [s, c].map(|x| if is_rounding(x) { 0.0 } else { x });
        (cosine.scaled(s).plus(&sine.scaled(c)), cosine.scaled(c).minus(&sine.scaled(s)))
    }

    /// Returns the arctangent of a finite series.
    fn arctangent(&self) -> Self {
        let Some((constant, rest)) = self.finite() else { return self.not_finite() };
        // atan(c + r) = atan c + atan(r / (1 + c² + c r)).
        let below = Self::number(1.0 + constant * constant).plus(&rest.scaled(constant));
        let slight = rest.times(&below.reciprocal());
        let odd = |k: usize| if k.is_multiple_of(2) { 0.0 } else { (if k % 4 == 1 { 1.0 } else { -1.0 }) / k as f64 };
        Self::number(constant.atan()).plus(&slight.composed(odd))
    }

    /// Returns the angle of the point (x, self).
    pub(super) fn angle(&self, x: &Self) -> Self {
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

    pub(super) fn limit(&self) -> Limit {
        let Some(first) = self.terms.first() else {
            if Order::ONE.is_larger_than(self.unknown) {
                return Limit::zero();
            }
            return if self.is_defined() || self.is_open() { Limit::Open } else { Limit::Unknown };
        };
        first.limit()
    }
}

/// Adds terms of one order; `None` if they cancel.
fn sum_of(terms: &[Term]) -> Option<Term> {
    let [first, rest @ ..] = terms else { return None };
    if rest.is_empty() {
        return (!first.factor.equal(factor(0.0))).then_some(*first);
    }
    let sum = terms.iter().fold(factor(0.0), |sum, term| sum + term.factor);
    let size = |term: &Term| term.factor.abs() * factor(term.doubt);
    let largest = terms.iter().fold(factor(0.0), |largest, term| largest.max(size(term)));
    let is_known = (largest * factor(CANCELLED)).less(sum.abs());
    is_known.then(|| Term { factor: sum, doubt: (largest / sum.abs()).to_scalar(), ..*first })
}

/// Returns coefficient k of (1 + r)^exponent.
pub(super) fn binomial(exponent: f64, k: usize) -> f64 {
    (0..k).map(|i| (exponent - i as f64) / (i + 1) as f64).product()
}

/// Returns coefficient k of ln(1 + r).
pub(super) fn logarithmic(k: usize) -> f64 {
    match k {
        0 => 0.0,
        _ if k.is_multiple_of(2) => -1.0 / k as f64,
        _ => 1.0 / k as f64,
    }
}

fn factorial(k: usize) -> f64 {
    (1..=k).map(|i| i as f64).product()
}

/// Limit of a number as ε → 0.
#[derive(Clone, Copy, Debug)]
pub(super) enum Limit {
    /// A finite number. Its relative error is this many roundoffs.
    Finite(Unbounded<f64>, f64),
    /// An infinity with the sign of this number.
    Infinite(f64),
    /// The number is not defined along the ray.
    Unknown,
    /// More terms might tell the limit.
    Open,
}

impl Limit {
    pub(super) fn zero() -> Self {
        Self::Finite(factor(0.0), 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_no_sign() {
        for x in [-3.0, 3.0] {
            let Limit::Finite(size, _) = Series::number(x).abs().limit() else { panic!("a number has a limit") };
            assert_eq!(size.to_scalar(), 3.0);
        }
    }

    #[test]
    fn more_terms_tell_more_of_open_series_only() {
        assert!(Series::open().is_open() && matches!(Series::open().limit(), Limit::Open));
        assert!(!Series::undefined().is_open() && matches!(Series::undefined().limit(), Limit::Unknown));
        assert!(!Series::number(1.0).is_open());
    }

    #[test]
    fn rows_are_whole_powers_apart() {
        let order = |power: f64| Order { power, logs: 0.0 };
        assert_eq!(order(2.5).row_from(order(0.5)), Some(2));
        assert_eq!(order(0.5).row_from(order(0.5)), Some(0));
        assert_eq!([order(0.5), order(3.0), order(20.5)].map(|of| of.row_from(order(2.5))), [None; 3]);
        assert_eq!(Order { power: 2.5, logs: 1.0 }.row_from(order(0.5)), None);
    }
}
