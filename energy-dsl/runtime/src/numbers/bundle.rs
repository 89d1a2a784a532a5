//! Numbers along several rays at once.
//!
//! Rays through one point mostly have series with the same powers of ε and ln(1/ε). Such series are sums of rows of
//! coefficients with a lane for each ray. Others stay apart.

use std::borrow::Cow;
use std::cell::Cell;
use std::cmp::Ordering;

use super::coefficients::{Coefficients, Row};
use super::outcomes::{LANES, Outcomes};
use super::real::Mask;
use super::rows::Rows;
use super::series::{LENGTHS, Order, Series, Term, length};
use super::unbounded::Unbounded;

thread_local! {
    /// Rays of the bundles that this thread is computing.
    static RAYS: Cell<usize> = const { Cell::new(LANES) };
}

/// Sets the number of rays of a bundle.
pub(super) fn set_rays(rays: usize) {
    RAYS.set(rays);
}

/// Numbers with more parts than this stay apart.
const MOST_PARTS: usize = 6;

/// A sum of rows whose powers do not overlap.
#[derive(Clone, Debug)]
pub(super) struct Sum {
    part: Rows,
    others: Vec<Rows>,
    /// Rays along which the number is undefined. Their coefficients are 0.
    undefined: Outcomes,
}

impl Sum {
    fn of(part: Rows, undefined: Outcomes) -> Self {
        Self { part: part.cleared(undefined), others: Vec::new(), undefined }
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
            self.part = part.signed(negative).cleared(self.undefined);
            return Some(());
        }
        let parts = self.others.len() + 1;
        let own = std::iter::once(&mut self.part).chain(&mut self.others).find(|own| own.overlaps(part));
        match own {
            Some(own) => *own = own.plus(part, sign)?.cleared(self.undefined),
            None if parts < MOST_PARTS => self.others.push(part.signed(negative).cleared(self.undefined)),
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
    fn total(parts: impl Iterator<Item = Option<Rows>>, undefined: Outcomes) -> Option<Self> {
        let mut sum = Self::of(Rows::zero(), undefined);
        for part in parts {
            sum.add(&part?, 1.0)?;
        }
        Some(sum)
    }

    fn plus(&self, other: &Self, sign: f64) -> Option<Self> {
        let mut sum = self.clone().undefined_along(other.undefined);
        other.parts().try_for_each(|part| sum.add(part, sign))?;
        Some(sum)
    }

    fn undefined_along(mut self, rays: Outcomes) -> Self {
        if self.undefined | rays != self.undefined {
            self.undefined = self.undefined | rays;
            self.part = self.part.cleared(rays);
            self.others = self.others.into_iter().map(|part| part.cleared(rays)).collect();
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

    fn over(&self, other: &Self) -> Option<Self> {
        let divisor = other.single()?;
        let mut undefined = self.undefined | other.undefined;
        let quotients: Option<Vec<_>> = self.parts().map(|part| part.over(divisor, undefined)).collect();
        let quotients = quotients?;
        undefined = quotients.iter().fold(undefined, |all, (_, zero)| all | *zero);
        Self::total(quotients.into_iter().map(|(quotient, _)| Some(quotient)), undefined)
    }

    fn raised(&self, exponent: f64) -> Option<Self> {
        let (raised, negative) = self.single()?.raised(exponent, self.undefined)?;
        Some(Self::of(raised, self.undefined | negative))
    }

    fn ln(&self) -> Option<Self> {
        let (parts, negative) = self.single()?.ln(self.undefined)?;
        Self::total(parts.into_iter().map(Some), self.undefined | negative)
    }

    fn exp(&self) -> Option<Self> {
        Some(Self::of(self.single()?.exp()?, self.undefined))
    }

    fn angle(&self, x: &Self) -> Option<Self> {
        let undefined = self.undefined | x.undefined;
        let parts = self.single()?.angle(x.single()?, undefined)?;
        Self::total(parts.into_iter().map(Some), undefined)
    }

    fn signed(&self, negative: Outcomes) -> Self {
        let others = self.others.iter().map(|part| part.signed(negative)).collect();
        Self { part: self.part.signed(negative), others, ..*self }
    }

    fn select(outcomes: Outcomes, yes: &Self, no: &Self) -> Option<Self> {
        let undefined = yes.undefined & outcomes | no.undefined & !outcomes;
        let parts = yes.parts().map(|part| part.clone().cleared(!outcomes));
        Self::total(parts.chain(no.parts().map(|part| part.clone().cleared(outcomes))).map(Some), undefined)
    }

    /// Returns the order of the first unknown term.
    fn end(&self) -> Order {
        self.parts().map(Rows::end).fold(Order::NEVER, Order::larger)
    }

    /// Returns the largest known term along a ray.
    fn first(&self, ray: usize) -> Option<Term> {
        let first = self.parts().filter_map(|part| part.terms(ray).next());
        let largest = first.reduce(|a, b| if b.order().is_larger_than(a.order()) { b } else { a })?;
        largest.order().is_larger_than(self.end()).then_some(largest)
    }

    fn along(&self, ray: usize) -> Series {
        if self.undefined.lane(ray) {
            return Series::undefined();
        }
        let terms = self.parts().flat_map(|part| part.terms(ray)).collect();
        Series::of(terms, self.end())
    }

    /// Creates the sum of some series, each along some rays; `None` if a number is too large or too small. Terms after
    /// the last row are not kept.
    fn from_series(series: &[(Series, Outcomes)], undefined: Outcomes) -> Option<Self> {
        let end = series.iter().fold(Order::NEVER, |end, (series, _)| end.larger(series.unknown()));
        let mut firsts: Vec<Order> = Vec::new();
        for term in series.iter().flat_map(|(series, _)| series.terms()) {
            match firsts.iter_mut().find(|first| term.order().is_in_steps_from(**first)) {
                Some(first) => *first = first.larger(term.order()),
                None => firsts.push(term.order()),
            }
        }
        if firsts.len() > MOST_PARTS {
            return None;
        }
        if firsts.is_empty() {
            let is_exact = end.compare(Order::NEVER) == Ordering::Equal;
            return Some(Self::of(if is_exact { Rows::zero() } else { Rows::new(end, &[], false)? }, undefined));
        }
        Self::total(firsts.into_iter().map(|first| rows_of(series, first, end)), undefined)
    }
}

/// Returns the rows of terms in whole steps from one order.
fn rows_of(series: &[(Series, Outcomes)], first: Order, end: Order) -> Option<Rows> {
    let known = (0..length()).take_while(|&step| first.after(step).is_larger_than(end)).count();
    let (mut rows, mut used) = ([Coefficients::ZERO; LENGTHS[0]], 0);
    let list = &mut rows[..known];
    let mut is_exact = end.compare(Order::NEVER) == Ordering::Equal;
    for (series, rays) in series {
        for term in series.terms().iter().filter(|term| term.order().is_in_steps_from(first)) {
            let step = (term.order().power - first.power).round() as usize;
            let Some(row) = list.get_mut(step) else {
                is_exact = false;
                continue;
            };
            let (factor, size) = term.plain()?;
            row.set(*rays, factor, size);
            used = used.max(step + 1);
        }
    }
    Rows::new(first, &list[..if is_exact { used } else { known }], is_exact)
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
    length() > LENGTHS[0]
}

impl Bundle {
    /// Creates x + slope · ε along each ray.
    pub(super) fn linear(x: Unbounded<f64>, slopes: &[f64]) -> Self {
        if slopes.iter().all(|&slope| slope == 0.0) && x.is_finite() {
            return Self::Same(Series::linear(x, 0.0));
        }
        let row = |value: &dyn Fn(usize) -> f64| -> Row {
            std::array::from_fn(|ray| if ray < slopes.len() { value(ray) } else { 0.0 })
        };
        let rows = || Rows::linear(row(&|_| x.to_scalar()), row(&|ray| slopes[ray]));
        match (x.is_finite() && !is_long()).then(rows).flatten() {
            Some(rows) => Self::Sum(Sum::of(rows, !Outcomes::first(slopes.len()))),
            None => Self::Apart(slopes.iter().map(|&slope| Series::linear(x, slope)).collect()),
        }
    }

    pub(super) fn number(value: f64) -> Self {
        Self::Same(Series::number(value))
    }

    fn of(series: Vec<Series>) -> Self {
        if is_long() {
            return Self::Apart(series);
        }
        let undefined = Outcomes::of(|ray| series.get(ray).is_none_or(|series| !series.is_defined()));
        let along = |(ray, series)| (series, Outcomes::of(|other| other == ray));
        let defined: Vec<_> = series.iter().cloned().enumerate().map(along).filter(|(s, _)| s.is_defined()).collect();
        Sum::from_series(&defined, undefined).map_or(Self::Apart(series), Self::Sum)
    }

    /// Returns the number as a sum of rows, unless long series are asked for.
    fn sum(&self) -> Option<Cow<'_, Sum>> {
        match self {
            Self::Sum(sum) => Some(Cow::Borrowed(sum)),
            Self::Same(series) if !is_long() && series.is_defined() => {
                let all = Outcomes::first(RAYS.get());
                if let [term] = series.terms()
                    && term.order().compare(Order::ONE) == Ordering::Equal
                    && series.is_exact()
                {
                    let (factor, size) = term.plain()?;
                    return Some(Cow::Owned(Sum {
                        part: Rows::same(factor, size, all)?,
                        others: Vec::new(),
                        undefined: !all,
                    }));
                }
                Sum::from_series(&[(series.clone(), all)], !all).map(Cow::Owned)
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
        Self::of((0..RAYS.get()).map(|ray| of_series(&self.along(ray))).collect())
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
        Self::of((0..RAYS.get()).map(|ray| of_series(&self.along(ray), &other.along(ray))).collect())
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
        if let Self::Same(series) = exponent
            && let Some((constant, rest)) = series.finite()
            && rest.is_zero()
        {
            return self.raised(constant);
        }
        let of_series = |base: &Series, exponent: &Series| match exponent.finite() {
            Some((constant, rest)) if rest.is_zero() => base.raised(constant),
            _ => base.ln().times(exponent).exp(),
        };
        self.map_two(exponent, |_, _| None, of_series)
    }

    pub(super) fn exp(&self) -> Self {
        self.map(Sum::exp, Series::exp)
    }

    pub(super) fn ln(&self) -> Self {
        self.map(Sum::ln, Series::ln)
    }

    pub(super) fn sin(&self) -> Self {
        self.map(|_| None, |series| series.sin_cos().0)
    }

    pub(super) fn cos(&self) -> Self {
        self.map(|_| None, |series| series.sin_cos().1)
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
            _ => Self::of((0..RAYS.get()).map(|ray| self.along(ray).scaled(sign(ray))).collect()),
        }
    }

    pub(super) fn select(outcomes: Outcomes, yes: &Self, no: &Self) -> Self {
        let rays = RAYS.get();
        match (0..rays).filter(|&ray| outcomes.lane(ray)).count() {
            0 => return no.clone(),
            taken if taken == rays => return yes.clone(),
            _ => {}
        }
        if let (Some(yes), Some(no)) = (yes.sum(), no.sum())
            && let Some(found) = Sum::select(outcomes, &yes, &no)
        {
            return Self::Sum(found);
        }
        let along = |ray: usize| if outcomes.lane(ray) { yes.along(ray) } else { no.along(ray) }.into_owned();
        Self::of((0..rays).map(along).collect())
    }

    /// Returns whether the number is defined along a ray. It is not along rays beyond the last.
    pub(super) fn is_defined(&self, ray: usize) -> bool {
        match self {
            Self::Same(series) => series.is_defined(),
            Self::Sum(sum) => !sum.undefined.lane(ray),
            Self::Apart(series) => series.get(ray).is_some_and(Series::is_defined),
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
