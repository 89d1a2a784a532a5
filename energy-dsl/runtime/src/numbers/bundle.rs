//! Numbers along several rays at once.
//!
//! Rays through one point mostly have series with the same powers of ε and ln(1/ε). Such series are sums of rows of
//! coefficients with a lane for each ray. Others stay apart.

use std::borrow::Cow;
use std::cell::Cell;
use std::cmp::Ordering;
use std::ops::BitOr;

use super::coefficients::{Coefficients, Row};
use super::outcomes::{LANES, Outcomes};
use super::real::Mask;
use super::rows::Rows;
use super::series::{Limit, MOST_ROWS, Order, Series, Term, binomial, length, logarithmic};
use super::unbounded::Unbounded;

thread_local! {
    /// Rays of the bundles that this thread is computing.
    static RAYS: Cell<usize> = const { Cell::new(LANES) };
}

/// Sets the number of rays of a bundle.
pub(super) fn set_rays(rays: usize) {
    RAYS.set(rays);
}

/// Returns the rays of a bundle.
pub(super) fn rays() -> Outcomes {
    Outcomes::first(RAYS.get())
}

/// Numbers with more parts than this stay apart.
const MOST_PARTS: usize = 6;

/// Rays along which a number is undefined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Undefined {
    rays: Outcomes,
    /// Those of them along which more terms might tell more.
    open: Outcomes,
}

impl Undefined {
    fn surely(rays: Outcomes) -> Self {
        Self { rays, open: Outcomes::NONE }
    }

    fn select(outcomes: Outcomes, yes: Self, no: Self) -> Self {
        let of = |yes, no| yes & outcomes | no & !outcomes;
        Self { rays: of(yes.rays, no.rays), open: of(yes.open, no.open) }
    }
}

impl BitOr for Undefined {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        let surely = self.rays & !self.open | other.rays & !other.open;
        Self { rays: self.rays | other.rays, open: (self.open | other.open) & !surely }
    }
}

/// A sum of rows whose powers do not overlap.
#[derive(Clone, Debug)]
pub(super) struct Sum {
    part: Rows,
    others: Vec<Rows>,
    /// Rays along which the number is undefined. Coefficients are 0 there.
    undefined: Undefined,
}

impl Sum {
    fn of(part: Rows, undefined: Undefined) -> Self {
        Self { part: part.cleared(undefined.rays), others: Vec::new(), undefined }
    }

    fn parts(&self) -> impl Iterator<Item = &Rows> {
        std::iter::once(&self.part).chain(&self.others)
    }

    /// Returns the only part.
    fn single(&self) -> Option<&Rows> {
        self.others.is_empty().then_some(&self.part)
    }

    /// Adds sign · part.
    fn add(&mut self, part: &Rows, sign: f64) -> Option<()> {
        let negative = if sign < 0.0 { !Outcomes::none() } else { Outcomes::none() };
        if part.is_zero() {
            return Some(());
        }
        if self.part.is_zero() {
            self.part = part.signed(negative).cleared(self.undefined.rays);
            return Some(());
        }
        let parts = self.others.len() + 1;
        let own = std::iter::once(&mut self.part).chain(&mut self.others).find(|own| own.overlaps(part));
        match own {
            Some(own) => *own = own.plus(part, sign)?.cleared(self.undefined.rays),
            None if parts < MOST_PARTS => self.others.push(part.signed(negative).cleared(self.undefined.rays)),
            None => return None,
        }
        if !self.others.is_empty() {
            self.drop_unknown();
        }
        Some(())
    }

    /// Drops parts that are 0, or smaller than the first unknown term.
    fn drop_unknown(&mut self) {
        let end = self.end();
        let is_known = |part: &Rows| !part.is_zero() && !end.is_larger_than(part.end()) || part.exceeds(end);
        self.others.retain(is_known);
        if !is_known(&self.part)
            && let Some(other) = self.others.pop()
        {
            self.part = other;
        }
    }

    /// Adds parts.
    fn total(parts: impl Iterator<Item = Option<Rows>>, undefined: Undefined) -> Option<Self> {
        let mut sum = Self::of(Rows::zero(), undefined);
        for part in parts {
            sum.add(&part?, 1.0)?;
        }
        Some(sum)
    }

    fn plus(&self, other: &Self, sign: f64) -> Option<Self> {
        if let (Some(a), Some(b)) = (self.single(), other.single())
            && a.overlaps(b)
        {
            return Some(Self::of(a.plus(b, sign)?, self.undefined | other.undefined));
        }
        let mut sum = self.clone().undefined_along(other.undefined);
        other.parts().try_for_each(|part| sum.add(part, sign))?;
        Some(sum)
    }

    fn undefined_along(mut self, undefined: Undefined) -> Self {
        if self.undefined | undefined != self.undefined {
            self.undefined = self.undefined | undefined;
            self.part = self.part.cleared(undefined.rays);
            self.others = self.others.into_iter().map(|part| part.cleared(undefined.rays)).collect();
        }
        self
    }

    fn times(&self, other: &Self) -> Option<Self> {
        let undefined = self.undefined | other.undefined;
        if let (Some(a), Some(b)) = (self.single(), other.single()) {
            return Some(Self::of(a.times(b)?, undefined));
        }
        Self::total(self.parts().flat_map(|a| other.parts().map(move |b| a.times(b))), undefined)
    }

    /// Splits t (1 + r) into the term t and r; `None` if rays begin with different powers.
    fn split(&self) -> Option<(Rows, Self)> {
        let order = |part: &Rows| part.first_order();
        let larger = |a, b| if order(b).is_larger_than(order(a)) { b } else { a };
        let first = self.parts().reduce(larger)?;
        let [head, rest] = first.headed(self.undefined.rays)?;
        let others = self.parts().filter(|part| !std::ptr::eq(*part, first));
        let slight = others.chain([&rest]).map(|part| Some(part.over(&head, self.undefined.rays)?.0));
        Some((head, Self::total(slight, self.undefined)?))
    }

    fn scaled(&self, by: f64) -> Option<Self> {
        Self::total(self.parts().map(|part| part.scaled(by)), self.undefined)
    }

    /// Returns Σ coefficient(k) rᵏ for an infinitesimal r.
    fn composed(&self, coefficient: impl Fn(usize) -> f64) -> Option<Self> {
        let constant = |value: f64| Some(Self::of(Rows::constant([value; LANES])?, self.undefined));
        let (mut sum, mut power) = (constant(coefficient(0))?, constant(1.0)?);
        if self.parts().all(Rows::is_zero) {
            return Some(sum);
        }
        for k in 1..=length() {
            power = power.times(self)?;
            sum = sum.plus(&power.scaled(coefficient(k))?, 1.0)?;
        }
        let leading = self.parts().map(Rows::first_order).fold(Order::NEVER, Order::larger);
        sum.add(&Rows::unknown(leading.raised(length() as f64 + 1.0)), 1.0)?;
        Some(sum)
    }

    fn over(&self, other: &Self) -> Option<Self> {
        let Some(divisor) = other.single() else { return self.times(&other.raised(-1.0)?) };
        let mut undefined = self.undefined | other.undefined;
        let quotients: Option<Vec<_>> = self.parts().map(|part| part.over(divisor, undefined.rays)).collect();
        let quotients = quotients?;
        undefined = quotients.iter().fold(undefined, |all, (_, zero)| all | Undefined::surely(*zero));
        Self::total(quotients.into_iter().map(|(quotient, _)| Some(quotient)), undefined)
    }

    fn raised(&self, exponent: f64) -> Option<Self> {
        if let Some(part) = self.single() {
            let (raised, negative) = part.raised(exponent, self.undefined.rays)?;
            return Some(Self::of(raised, self.undefined | Undefined::surely(negative)));
        }
        let (head, rest) = self.split()?;
        let (raised, negative) = head.raised(exponent, self.undefined.rays)?;
        rest.composed(|k| binomial(exponent, k))?.times(&Self::of(raised, self.undefined | Undefined::surely(negative)))
    }

    fn ln(&self) -> Option<Self> {
        if let Some(part) = self.single() {
            let (parts, negative) = part.ln(self.undefined.rays)?;
            return Self::total(parts.into_iter().map(Some), self.undefined | Undefined::surely(negative));
        }
        let (head, rest) = self.split()?;
        let (parts, negative) = head.ln(self.undefined.rays)?;
        let logarithm = Self::total(parts.into_iter().map(Some), self.undefined | Undefined::surely(negative))?;
        rest.composed(logarithmic)?.plus(&logarithm, 1.0)
    }

    fn exp(&self) -> Option<Self> {
        Some(Self::of(self.single()?.exp()?, self.undefined))
    }

    fn sin_cos(&self) -> Option<[Self; 2]> {
        Some(self.single()?.sin_cos()?.map(|part| Self::of(part, self.undefined)))
    }

    fn angle(&self, x: &Self) -> Option<Self> {
        let undefined = self.undefined | x.undefined;
        let parts = self.single()?.angle(x.single()?, undefined.rays)?;
        Self::total(parts.into_iter().map(Some), undefined)
    }

    fn signed(&self, negative: Outcomes) -> Self {
        let others = self.others.iter().map(|part| part.signed(negative)).collect();
        Self { part: self.part.signed(negative), others, ..*self }
    }

    fn select(outcomes: Outcomes, yes: &Self, no: &Self) -> Option<Self> {
        let undefined = Undefined::select(outcomes, yes.undefined, no.undefined);
        let parts = yes.parts().map(|part| part.cleared(!outcomes));
        Self::total(parts.chain(no.parts().map(|part| part.cleared(outcomes))).map(Some), undefined)
    }

    /// Returns the order of the first unknown term.
    fn end(&self) -> Order {
        self.parts().map(Rows::end).fold(Order::NEVER, Order::larger)
    }

    /// Returns the largest known term along a ray.
    fn first(&self, ray: usize) -> Option<Term> {
        let first = self.parts().filter_map(|part| part.first(ray));
        let largest = first.reduce(|a, b| if b.order().is_larger_than(a.order()) { b } else { a })?;
        largest.order().is_larger_than(self.end()).then_some(largest)
    }

    fn limit(&self, ray: usize) -> Limit {
        match self.first(ray) {
            _ if self.undefined.open.lane(ray) => Limit::Open,
            _ if self.undefined.rays.lane(ray) => Limit::Unknown,
            Some(first) => first.limit(),
            None if Order::ONE.is_larger_than(self.end()) => Limit::zero(),
            None => Limit::Open,
        }
    }

    fn along(&self, ray: usize) -> Series {
        if self.undefined.rays.lane(ray) {
            return if self.undefined.open.lane(ray) { Series::open() } else { Series::undefined() };
        }
        let terms = self.parts().flat_map(|part| part.terms(ray)).collect();
        Series::of(terms, self.end())
    }

    /// Creates the sum of some series, each along some rays; `None` if a number is too large or too small, or if there
    /// are too many different powers.
    fn from_series(series: &[(Series, Outcomes)], undefined: Undefined) -> Option<Self> {
        let end = series.iter().fold(Order::NEVER, |end, (series, _)| end.larger(series.unknown()));
        let terms = || series.iter().flat_map(|(series, rays)| series.terms().iter().map(move |term| (term, *rays)));
        let mut orders: Vec<Order> = terms().map(|(term, _)| term.order()).filter(|o| o.is_larger_than(end)).collect();
        orders.sort_by(|a, b| a.compare(*b));
        let mut firsts: Vec<Order> = Vec::new();
        for order in orders {
            if !firsts.iter().any(|&first| order.row_from(first).is_some()) {
                firsts.push(order);
            }
        }
        if firsts.len() >= MOST_PARTS {
            return None;
        }
        let unknown = (end.compare(Order::NEVER) != Ordering::Equal).then(|| Some(Rows::unknown(end)));
        Self::total(firsts.iter().map(|&first| rows_of(terms(), first, &firsts)).chain(unknown), undefined)
    }
}

/// Returns the rows of those terms that do not belong to earlier orders than `first`.
fn rows_of<'a>(terms: impl Iterator<Item = (&'a Term, Outcomes)>, first: Order, firsts: &[Order]) -> Option<Rows> {
    let (mut rows, mut used) = ([Coefficients::ZERO; MOST_ROWS], 0);
    let own = |term: &Term| firsts.iter().find(|&&other| term.order().row_from(other).is_some());
    for (term, rays) in terms.filter(|(term, _)| own(term).is_some_and(|own| own.compare(first) == Ordering::Equal)) {
        let row = term.order().row_from(first)?;
        let (factor, size) = term.plain()?;
        rows[row].set(rays, factor, size);
        used = used.max(row + 1);
    }
    Rows::new(first, &rows[..used], true)
}

/// A number along the rays of a bundle.
#[derive(Clone, Debug)]
// Nearly all numbers are sums of rows.
#[allow(clippy::large_enum_variant)]
pub(super) enum Bundle {
    /// It does not depend on the ray.
    Same(Series),
    Sum(Sum),
    Apart(Vec<Series>),
}

/// Returns whether long series are asked for. They are kept apart, to lose no term.
fn is_long() -> bool {
    length() > MOST_ROWS
}

impl Bundle {
    /// Creates x + slope · ε along each ray.
    pub(super) fn linear(x: Unbounded<f64>, slopes: &[f64]) -> Self {
        let is_constant = slopes.iter().all(|&slope| slope == 0.0);
        let row = |value: &dyn Fn(usize) -> f64| -> Row {
            std::array::from_fn(|ray| if ray < slopes.len() { value(ray) } else { 0.0 })
        };
        let constant = || row(&|_| x.to_scalar());
        let rows = || match is_constant {
            true => Rows::constant(constant()),
            false => Rows::linear(constant(), row(&|ray| slopes[ray])),
        };
        match (x.is_finite() && !is_long()).then(rows).flatten() {
            Some(rows) => Self::Sum(Sum::of(rows, Undefined::surely(!Outcomes::first(slopes.len())))),
            None if is_constant && x.is_finite() => Self::Same(Series::linear(x, 0.0)),
            None => Self::Apart(slopes.iter().map(|&slope| Series::linear(x, slope)).collect()),
        }
    }

    pub(super) fn number(value: f64) -> Self {
        let all = rays();
        match (!is_long()).then(|| Rows::same(value, all)).flatten() {
            Some(rows) => Self::Sum(Sum { part: rows, others: Vec::new(), undefined: Undefined::surely(!all) }),
            None => Self::Same(Series::number(value)),
        }
    }

    fn of(series: Vec<Series>) -> Self {
        if is_long() {
            return Self::Apart(series);
        }
        let undefined = Undefined {
            rays: Outcomes::of(|ray| series.get(ray).is_none_or(|series| !series.is_defined())),
            open: Outcomes::of(|ray| series.get(ray).is_some_and(Series::is_open)),
        };
        let with_ray = |(ray, series)| (series, Outcomes::only(ray));
        let defined: Vec<_> =
            series.iter().cloned().enumerate().map(with_ray).filter(|(s, _)| s.is_defined()).collect();
        Sum::from_series(&defined, undefined).map_or(Self::Apart(series), Self::Sum)
    }

    fn along_each(series: impl Fn(usize) -> Series) -> Self {
        Self::of((0..RAYS.get()).map(series).collect())
    }

    /// Returns the number as a sum of rows, unless long series are asked for.
    fn sum(&self) -> Option<Cow<'_, Sum>> {
        match self {
            Self::Sum(sum) => Some(Cow::Borrowed(sum)),
            Self::Same(series) if !is_long() && series.is_defined() => {
                let all = rays();
                Sum::from_series(&[(series.clone(), all)], Undefined::surely(!all)).map(Cow::Owned)
            }
            _ => None,
        }
    }

    pub(super) fn along(&self, ray: usize) -> Cow<'_, Series> {
        match self {
            Self::Same(series) => Cow::Borrowed(series),
            Self::Sum(sum) => Cow::Owned(sum.along(ray)),
            Self::Apart(series) => Cow::Borrowed(&series[ray]),
        }
    }

    fn map(&self, of_sum: impl Fn(&Sum) -> Option<Sum>, of_series: impl Fn(&Series) -> Series) -> Self {
        match self {
            Self::Same(series) => return Self::Same(of_series(series)),
            Self::Sum(sum) => {
                if let Some(found) = of_sum(sum) {
                    return Self::Sum(found);
                }
            }
            Self::Apart(_) => {}
        }
        Self::along_each(|ray| of_series(&self.along(ray)))
    }

    fn map_two(
        &self,
        other: &Self,
        of_sums: impl Fn(&Sum, &Sum) -> Option<Sum>,
        of_series: impl Fn(&Series, &Series) -> Series,
    ) -> Self {
        if let (Self::Same(a), Self::Same(b)) = (self, other) {
            return Self::Same(of_series(a, b));
        }
        if let (Some(a), Some(b)) = (self.sum(), other.sum())
            && let Some(found) = of_sums(&a, &b)
        {
            return Self::Sum(found);
        }
        Self::along_each(|ray| of_series(&self.along(ray), &other.along(ray)))
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        self.map_two(other, |a, b| a.plus(b, 1.0), Series::plus)
    }

    pub(super) fn minus(&self, other: &Self) -> Self {
        self.map_two(other, |a, b| a.plus(b, -1.0), Series::minus)
    }

    pub(super) fn times(&self, other: &Self) -> Self {
        self.map_two(other, Sum::times, Series::times)
    }

    pub(super) fn over(&self, other: &Self) -> Self {
        self.map_two(other, Sum::over, |a, b| a.times(&b.reciprocal()))
    }

    pub(super) fn raised(&self, exponent: f64) -> Self {
        let of_sum = |sum: &Sum| if exponent == 0.0 { None } else { sum.raised(exponent) };
        self.map(of_sum, |series| series.raised(exponent))
    }

    pub(super) fn power(&self, exponent: &Self) -> Self {
        if let Some(constant) = exponent.constant() {
            return self.raised(constant);
        }
        let of_series = |base: &Series, exponent: &Series| match exponent.finite() {
            Some((constant, rest)) if rest.is_zero() => base.raised(constant),
            _ => base.ln().times(exponent).exp(),
        };
        self.map_two(exponent, |_, _| None, of_series)
    }

    /// Returns the number that it is along all rays.
    fn constant(&self) -> Option<f64> {
        match self {
            Self::Same(series) => series.finite().filter(|(_, rest)| rest.is_zero()).map(|(constant, _)| constant),
            Self::Sum(sum) => sum.single()?.as_constant(RAYS.get()),
            Self::Apart(_) => None,
        }
    }

    pub(super) fn exp(&self) -> Self {
        self.map(Sum::exp, Series::exp)
    }

    pub(super) fn ln(&self) -> Self {
        self.map(Sum::ln, Series::ln)
    }

    pub(super) fn sin(&self) -> Self {
        self.map(|sum| sum.sin_cos().map(|[sine, _]| sine), |series| series.sin_cos().0)
    }

    pub(super) fn cos(&self) -> Self {
        self.map(|sum| sum.sin_cos().map(|[_, cosine]| cosine), |series| series.sin_cos().1)
    }

    /// Returns the angle of the points (x, self).
    pub(super) fn angle(&self, x: &Self) -> Self {
        self.map_two(x, Sum::angle, Series::angle)
    }

    /// Changes the sign along some rays.
    pub(super) fn signed(&self, negative: Outcomes) -> Self {
        let sign = |ray: usize| if negative.lane(ray) { -1.0 } else { 1.0 };
        match self {
            _ if !negative.any() => self.clone(),
            Self::Sum(sum) => Self::Sum(sum.signed(negative)),
            Self::Same(series) if negative.all() => Self::Same(series.scaled(-1.0)),
            _ => Self::along_each(|ray| self.along(ray).scaled(sign(ray))),
        }
    }

    pub(super) fn select(outcomes: Outcomes, yes: &Self, no: &Self) -> Self {
        if let (Some(yes), Some(no)) = (yes.sum(), no.sum())
            && let Some(found) = Sum::select(outcomes, &yes, &no)
        {
            return Self::Sum(found);
        }
        Self::along_each(|ray| if outcomes.lane(ray) { yes.along(ray) } else { no.along(ray) }.into_owned())
    }

    /// Returns whether the number is defined along a ray. It is not along rays beyond the last.
    pub(super) fn is_defined(&self, ray: usize) -> bool {
        match self {
            Self::Same(series) => series.is_defined(),
            Self::Sum(sum) => !sum.undefined.rays.lane(ray),
            Self::Apart(series) => series.get(ray).is_some_and(Series::is_defined),
        }
    }

    pub(super) fn limit(&self, ray: usize) -> Limit {
        match self {
            Self::Same(series) => series.limit(),
            Self::Sum(sum) => sum.limit(ray),
            Self::Apart(series) => series[ray].limit(),
        }
    }

    /// Returns the largest term along each ray; `None` if none is known.
    pub(super) fn first(&self) -> [Option<Term>; LANES] {
        match self {
            Self::Same(series) => [series.first(); LANES],
            Self::Sum(sum) => std::array::from_fn(|ray| sum.first(ray)),
            Self::Apart(series) => std::array::from_fn(|ray| series.get(ray)?.first()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn term(power: f64, is_exact: bool) -> Rows {
        let order = Order { power, logs: 0.0 };
        Rows::new(order, &[Coefficients::exact([1.0; LANES])], is_exact).unwrap()
    }

    #[test]
    fn parts_beyond_the_first_unknown_term_are_dropped() {
        // 1 + unknown terms from ε on.
        let unsure = term(0.0, false);
        for (power, parts) in [(-0.5, 2), (0.5, 2), (1.5, 1), (20.5, 1)] {
            let mut sum = Sum::of(unsure, Undefined::surely(Outcomes::NONE));
            sum.add(&term(power, true), 1.0).unwrap();
            assert_eq!(sum.parts().count(), parts, "power {power}");
            assert!(sum.parts().all(|part| !part.is_zero() && part.exceeds(Order { power: 1.0, logs: 0.0 })));
        }
        // A series whose first unknown term is the sum's is kept without terms, too.
        let mut sum = Sum::of(term(0.25, true), Undefined::surely(Outcomes::NONE));
        sum.add(&unsure, 1.0).unwrap();
        sum.add(&unsure, -1.0).unwrap();
        assert_eq!((sum.parts().count(), sum.end().power), (2, 1.0));
        assert!(Sum::of(term(0.25, true), Undefined::surely(Outcomes::NONE)).single().is_some());
    }
}
