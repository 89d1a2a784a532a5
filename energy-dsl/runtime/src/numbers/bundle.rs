//! Series along several rays at once.
//!
//! Rays through one point mostly have series with the same powers of ε. Such series are rows of coefficients with a lane
//! for each ray. Those with other powers, or with logarithms, stay apart.

use std::borrow::Cow;
use std::cell::Cell;

use super::cpu::dispatch;
use super::level::{Baseline, Kernel, Level};
use super::real::{Mask, Number};
use super::series::{CANCELLED, LENGTHS, Series, Term, length};

/// The most rays of a bundle.
pub(super) const LANES: usize = 8;

thread_local! {
    /// Rays of the bundles that this thread is computing.
    static RAYS: Cell<usize> = const { Cell::new(LANES) };
}

/// Sets the number of rays of a bundle.
pub(super) fn set_rays(rays: usize) {
    RAYS.set(rays);
}

/// Outcomes of a comparison along the rays of a bundle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outcomes(u8);

impl Outcomes {
    pub(super) fn of(outcome: impl Fn(usize) -> bool) -> Self {
        Self((0..LANES).fold(0, |bits, ray| bits | u8::from(outcome(ray)) << ray))
    }
}

impl std::ops::BitAnd for Outcomes {
    type Output = Self;
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl std::ops::BitOr for Outcomes {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl std::ops::Not for Outcomes {
    type Output = Self;
    fn not(self) -> Self {
        Self(!self.0)
    }
}

impl Mask for Outcomes {
    fn none() -> Self {
        Self(0)
    }
    fn bits(self) -> u32 {
        self.0.into()
    }
    fn from_bits(bits: u32) -> Self {
        Self((bits & u32::from(u8::MAX)) as u8)
    }
}

type Row = [f64; LANES];

/// The coefficients of one power of ε along all rays.
#[derive(Clone, Copy, Debug)]
struct Coefficients {
    factors: Row,
    /// Sizes of the largest numbers that were added or subtracted on the way: the error is this many roundoffs.
    sizes: Row,
}

/// Numbers of other sizes are left to series, whose exponents are larger.
const SIZES: std::ops::Range<f64> = 1e-120..1e120;

impl Coefficients {
    const ZERO: Self = Self { factors: [0.0; LANES], sizes: [0.0; LANES] };

    /// Adds `times` · x · y.
    #[inline(always)]
    fn add_product(&mut self, times: f64, x: &Self, y: &Self) {
        for ray in 0..LANES {
            let (a, b) = (times * x.factors[ray], y.factors[ray]);
            self.factors[ray] += a * b;
            let size = larger(a.abs() * y.sizes[ray], times.abs() * x.sizes[ray] * b.abs());
            self.sizes[ray] = larger(self.sizes[ray], size);
        }
    }

    /// Divides by other coefficients. Where they are 0, the result is 0.
    #[inline(always)]
    fn divide(&mut self, by: &Self) {
        for ray in 0..LANES {
            let (factor, size, divisor) = (self.factors[ray], self.sizes[ray], by.factors[ray]);
            let inverse = if divisor == 0.0 { 0.0 } else { 1.0 / divisor.abs() };
            self.factors[ray] = if divisor == 0.0 { 0.0 } else { factor / divisor };
            self.sizes[ray] = larger(size, factor.abs() * inverse * by.sizes[ray]) * inverse;
        }
    }

    /// Multiplies by other coefficients.
    #[inline(always)]
    fn scale(&mut self, by: &Self) {
        for ray in 0..LANES {
            let (factor, size) = (self.factors[ray], self.sizes[ray]);
            self.factors[ray] = factor * by.factors[ray];
            self.sizes[ray] = larger(size * by.factors[ray].abs(), factor.abs() * by.sizes[ray]);
        }
    }

    /// Replaces sums that are rounding errors by 0.
    #[inline(always)]
    fn drop_cancelled(&mut self) {
        for ray in 0..LANES {
            let is_known = self.sizes[ray] * CANCELLED < self.factors[ray].abs();
            self.factors[ray] = if is_known { self.factors[ray] } else { 0.0 };
            self.sizes[ray] = if is_known { self.sizes[ray] } else { 0.0 };
        }
    }

    /// Returns whether all numbers are 0 or of moderate size.
    #[inline(always)]
    fn are_moderate(&self) -> bool {
        let is_moderate = |&x: &f64| x == 0.0 || SIZES.start < x.abs() && x.abs() < SIZES.end;
        self.factors.iter().fold(true, |all, x| all & is_moderate(x)) & self.sizes.iter().all(|size| *size < 1e200)
    }

    fn is_zero(&self) -> bool {
        self.factors == [0.0; LANES]
    }
}

#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a < b { b } else { a }
}

/// Series along all rays whose powers of ε ascend in steps of 1 from the same one.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    power: f64,
    list: Vec<Coefficients>,
    /// Whether the terms after the last row are 0. Otherwise they are unknown.
    is_exact: bool,
    /// Rays along which the number is undefined. Their coefficients are 0.
    undefined: Outcomes,
}

/// Computes rows.
enum Operation<'a> {
    Product(&'a [Coefficients], &'a [Coefficients]),
    Quotient(&'a [Coefficients], &'a [Coefficients]),
    /// A power of a series that begins with 1.
    Power(&'a [Coefficients], f64),
}

struct Compute<'a> {
    operation: Operation<'a>,
    rows: &'a mut [Coefficients],
}

impl Kernel for Compute<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Level>(self) -> bool {
        for k in 0..self.rows.len() {
            let (before, after) = self.rows.split_at_mut(k);
            let row = &mut after[0];
            match self.operation {
                Operation::Product(a, b) => {
                    for i in (k + 1).saturating_sub(b.len())..a.len().min(k + 1) {
                        row.add_product(1.0, &a[i], &b[k - i]);
                    }
                    row.drop_cancelled();
                }
                Operation::Quotient(a, b) => {
                    *row = a.get(k).copied().unwrap_or(Coefficients::ZERO);
                    for i in 1..b.len().min(k + 1) {
                        row.add_product(-1.0, &b[i], &before[k - i]);
                    }
                    row.drop_cancelled();
                    row.divide(&b[0]);
                }
                Operation::Power(series, exponent) => {
                    if k == 0 {
                        *row = series[0];
                    }
                    for i in 1..series.len().min(k + 1) {
                        let times = (exponent * i as f64 - (k - i) as f64) / k as f64;
                        row.add_product(times, &series[i], &before[k - i]);
                    }
                    row.drop_cancelled();
                }
            }
        }
        self.rows.iter().fold(true, |all, row| all & row.are_moderate())
    }
}

impl Rows {
    /// Creates x + slope · ε along each ray; `None` if a number is too large or too small.
    fn linear(x: f64, slopes: &Row) -> Option<Self> {
        let of = |factors: Row| Coefficients { factors, sizes: factors.map(f64::abs) };
        let rays = RAYS.get();
        let undefined = Outcomes::of(|ray| ray >= rays);
        let value = std::array::from_fn(|ray| if ray < rays { x } else { 0.0 });
        Self { power: 0.0, list: vec![of(value), of(*slopes)], is_exact: true, undefined }.checked()
    }

    fn checked(self) -> Option<Self> {
        self.list.iter().all(Coefficients::are_moderate).then(|| self.stripped())
    }

    /// Drops leading rows that are 0.
    fn stripped(mut self) -> Self {
        let zeros = self.list.iter().take_while(|row| row.is_zero()).count();
        if zeros > 0 {
            self.list.drain(..zeros);
            self.power += zeros as f64;
        }
        self
    }

    /// Returns the number of known rows.
    fn known(&self) -> usize {
        if self.is_exact { usize::MAX } else { self.list.len() }
    }

    fn is_zero_along(&self, ray: usize) -> bool {
        self.list.iter().all(|row| row.factors[ray] == 0.0)
    }

    fn computed(&self, power: f64, rows: usize, is_exact: bool, operation: Operation<'_>) -> Option<Self> {
        let mut list = vec![Coefficients::ZERO; rows];
        let are_moderate = dispatch(Compute { operation, rows: &mut list });
        are_moderate.then(|| Self { power, list, is_exact, ..*self }.stripped())
    }

    fn with_undefined(self, undefined: Outcomes) -> Self {
        let mut rows = Self { undefined: self.undefined | undefined, ..self };
        if rows.undefined != self.undefined {
            for ray in (0..LANES).filter(|&ray| rows.undefined.lane(ray)) {
                for row in &mut rows.list {
                    (row.factors[ray], row.sizes[ray]) = (0.0, 0.0);
                }
            }
        }
        rows
    }

    fn is_zero(&self) -> bool {
        self.is_exact && self.list.is_empty()
    }

    fn times(&self, other: &Self) -> Option<Self> {
        if self.is_zero() || other.is_zero() {
            let zero = if self.is_zero() { self } else { other };
            return Some(zero.clone().with_undefined(self.undefined | other.undefined));
        }
        let most = (self.list.len() + other.list.len()).saturating_sub(1);
        let rows = most.min(length()).min(self.known()).min(other.known());
        let is_exact = self.is_exact && other.is_exact && rows == most;
        let product = Operation::Product(&self.list, &other.list);
        Some(self.computed(self.power + other.power, rows, is_exact, product)?.with_undefined(other.undefined))
    }

    /// Returns the rays along which the first coefficient is 0 but not the series, or the series is not known to be 0.
    fn has_other_leading_terms(&self) -> bool {
        let is_other = |ray: usize| {
            let is_zero = self.list.first().is_none_or(|row| row.factors[ray] == 0.0);
            is_zero && !self.undefined.lane(ray) && !(self.is_exact && self.is_zero_along(ray))
        };
        (0..LANES).any(is_other)
    }

    fn over(&self, other: &Self) -> Option<Self> {
        if other.has_other_leading_terms() {
            return None;
        }
        let undefined = Outcomes::of(|ray| other.is_zero_along(ray)) | other.undefined;
        if other.list.is_empty() {
            return Some(Self { list: Vec::new(), ..self.clone() }.with_undefined(!Outcomes::none()));
        }
        let is_exact = self.is_exact && other.is_exact && other.list.len() == 1;
        let most = if is_exact { self.list.len() } else { usize::MAX };
        let rows = most.min(length()).min(self.known()).min(other.known());
        let quotient = Operation::Quotient(&self.list, &other.list);
        Some(self.computed(self.power - other.power, rows, is_exact, quotient)?.with_undefined(undefined))
    }

    /// Returns a power with a constant exponent other than 0.
    fn raised(&self, exponent: f64) -> Option<Self> {
        let first = *self.list.first()?;
        let is_zero = |ray: usize| first.factors[ray] == 0.0 && !self.undefined.lane(ray);
        if (0..LANES).any(is_zero) {
            return None;
        }
        let negative = Outcomes::of(|ray| first.factors[ray] < 0.0 && exponent.fract() != 0.0);
        let is_exact = self.is_exact && self.list.len() == 1;
        let rows = if is_exact { 1 } else { length().min(self.known()) };
        let mut series = self.list.clone();
        series.iter_mut().for_each(|row| row.divide(&first));
        let mut raised = self.computed(self.power * exponent, rows, is_exact, Operation::Power(&series, exponent))?;
        let factors: Row = first.factors.map(|x| power(x, exponent));
        let doubts: Row = std::array::from_fn(|ray| first.sizes[ray] / first.factors[ray].abs());
        let sizes = std::array::from_fn(|ray| if factors[ray] == 0.0 { 0.0 } else { factors[ray].abs() * doubts[ray] });
        raised.list.iter_mut().for_each(|row| row.scale(&Coefficients { factors, sizes }));
        raised.with_undefined(negative).checked()
    }

    /// Combines the rows of two numbers, each a function of the rows with the same power; 0 stands for those that are
    /// missing. `None` if their powers do not differ by whole steps.
    fn combined(
        &self,
        other: &Self,
        combine: impl Fn(&Coefficients, &Coefficients) -> Coefficients,
        undefined: Outcomes,
    ) -> Option<Self> {
        let difference = if self.is_zero() || other.is_zero() { 0.0 } else { other.power - self.power };
        if difference != difference.round() || difference.abs() > MOST_STEPS {
            return None;
        }
        let (mine, others) = ((-difference).max(0.0) as usize, difference.max(0.0) as usize);
        let most = (mine + self.list.len()).max(others + other.list.len());
        let known = self.known().saturating_add(mine).min(other.known().saturating_add(others));
        let rows = most.min(length()).min(known);
        let row = |of: &Self, k: usize, from: usize| match k.checked_sub(from) {
            Some(k) => of.list.get(k).copied().unwrap_or(Coefficients::ZERO),
            None => Coefficients::ZERO,
        };
        let list = (0..rows).map(|k| combine(&row(self, k, mine), &row(other, k, others))).collect();
        let is_exact = self.is_exact && other.is_exact && rows == most;
        let power = match (self.is_zero(), other.is_zero()) {
            (true, _) => other.power,
            (_, true) => self.power,
            _ => self.power.min(other.power),
        };
        Self { power, list, is_exact, undefined: Outcomes::none() }.with_undefined(undefined).checked()
    }

    /// Returns self + sign · other.
    fn plus(&self, other: &Self, sign: f64) -> Option<Self> {
        let sum = |a: &Coefficients, b: &Coefficients| {
            let mut sum = *a;
            for ray in 0..LANES {
                sum.factors[ray] += sign * b.factors[ray];
                sum.sizes[ray] = larger(sum.sizes[ray], b.sizes[ray]);
            }
            sum.drop_cancelled();
            sum
        };
        self.combined(other, sum, self.undefined | other.undefined)
    }

    /// Returns each ray's choice.
    fn select(outcomes: Outcomes, yes: &Self, no: &Self) -> Option<Self> {
        let choose = |a: &Coefficients, b: &Coefficients| {
            let mut chosen = *a;
            for ray in (0..LANES).filter(|&ray| !outcomes.lane(ray)) {
                (chosen.factors[ray], chosen.sizes[ray]) = (b.factors[ray], b.sizes[ray]);
            }
            chosen
        };
        yes.combined(no, choose, yes.undefined & outcomes | no.undefined & !outcomes)
    }

    fn signed(&self, negative: Outcomes) -> Self {
        let mut rows = self.clone();
        for row in &mut rows.list {
            for ray in (0..LANES).filter(|&ray| negative.lane(ray)) {
                row.factors[ray] = -row.factors[ray];
            }
        }
        rows
    }

    fn along(&self, ray: usize) -> Series {
        if self.undefined.lane(ray) {
            return Series::undefined();
        }
        let term = |(k, row): (usize, &Coefficients)| {
            let factor = row.factors[ray];
            (factor != 0.0).then(|| Term::of_power(self.power + k as f64, factor, row.sizes[ray] / factor.abs()))
        };
        let terms = self.list.iter().enumerate().filter_map(term).collect();
        let unknown = if self.is_exact { f64::INFINITY } else { self.power + self.list.len() as f64 };
        Series::of_powers(terms, unknown)
    }

    /// Returns the first known term along a ray; `None` if there is none.
    fn first(&self, ray: usize) -> Option<Term> {
        let (k, row) = self.list.iter().enumerate().find(|(_, row)| row.factors[ray] != 0.0)?;
        let factor = row.factors[ray];
        Some(Term::of_power(self.power + k as f64, factor, row.sizes[ray] / factor.abs()))
    }

    /// Creates the rows of some series; `None` if they have logarithms or other powers. Terms after the last row are
    /// not kept.
    fn of(series: &[Series]) -> Option<Self> {
        let defined = || series.iter().enumerate().filter(|(_, series)| series.is_defined());
        let undefined = Outcomes::of(|ray| series.get(ray).is_none_or(|series| !series.is_defined()));
        Self::from_lanes(defined(), undefined, |row, ray, factor, size| {
            (row.factors[ray], row.sizes[ray]) = (factor, size);
        })
    }

    /// Creates the rows of a series that is the same along all rays.
    fn same(series: &Series) -> Option<Self> {
        let rays = RAYS.get();
        let undefined = Outcomes::of(|ray| ray >= rays || !series.is_defined());
        let defined = series.is_defined().then_some((0, series)).into_iter();
        Self::from_lanes(defined, undefined, |row, _, factor, size| {
            row.factors[..rays].fill(factor);
            row.sizes[..rays].fill(size);
        })
    }

    fn from_lanes<'a>(
        series: impl Iterator<Item = (usize, &'a Series)> + Clone,
        undefined: Outcomes,
        set: impl Fn(&mut Coefficients, usize, f64, f64),
    ) -> Option<Self> {
        let least = |powers: &mut dyn Iterator<Item = f64>| powers.fold(f64::INFINITY, f64::min);
        let power = least(&mut series.clone().map(|(_, series)| series.leading_power()));
        let end = least(&mut series.clone().map(|(_, series)| series.unknown_power()));
        if power == f64::INFINITY {
            return Some(Self { power: 0.0, list: Vec::new(), is_exact: true, undefined });
        }
        let mut list = vec![Coefficients::ZERO; (end - power).floor().clamp(0.0, length() as f64) as usize];
        let (mut rows, mut is_exact) = (0, end == f64::INFINITY);
        for (ray, series) in series {
            for (order, factor, doubt) in series.powers()? {
                let step = order - power;
                if step != step.round() {
                    return None;
                }
                match list.get_mut(step as usize) {
                    Some(row) => set(row, ray, factor, factor.abs() * doubt),
                    None => is_exact = false,
                }
                rows = rows.max(step as usize + 1);
            }
        }
        if is_exact {
            list.truncate(rows);
        }
        Self { power, list, is_exact, undefined }.checked()
    }
}

/// Powers further apart than this many steps are kept as series.
const MOST_STEPS: f64 = 64.0;

fn power(x: f64, exponent: f64) -> f64 {
    let size = if exponent == 0.5 { x.abs().sqrt() } else { Number::powf::<Baseline>(x.abs(), exponent) };
    match x {
        0.0 => 0.0,
        x if x < 0.0 && exponent % 2.0 != 0.0 => -size,
        _ => size,
    }
}

/// A number along the rays of a bundle.
#[derive(Clone, Debug)]
pub(super) enum Bundle {
    /// It does not depend on the ray.
    Same(Series),
    Rows(Rows),
    Apart(Vec<Series>),
}

impl Bundle {
    /// Creates x + slope · ε along each ray.
    pub(super) fn linear(x: super::unbounded::Unbounded<f64>, slopes: &[f64]) -> Self {
        if slopes.iter().all(|&slope| slope == 0.0) && x.is_finite() {
            return Self::Same(Series::linear(x, 0.0));
        }
        let mut row = [0.0; LANES];
        row[..slopes.len()].copy_from_slice(slopes);
        let rows = (x.is_finite() && !is_long()).then(|| Rows::linear(x.to_scalar(), &row)).flatten();
        rows.map_or_else(|| Self::Apart(slopes.iter().map(|&slope| Series::linear(x, slope)).collect()), Self::Rows)
    }

    pub(super) fn number(value: f64) -> Self {
        Self::Same(Series::number(value))
    }

    fn of(series: Vec<Series>) -> Self {
        if is_long() {
            return Self::Apart(series);
        }
        Rows::of(&series).map_or(Self::Apart(series), Self::Rows)
    }

    /// Returns the number as rows, unless long series are asked for.
    fn rows(&self) -> Option<Cow<'_, Rows>> {
        match self {
            Self::Rows(rows) => Some(Cow::Borrowed(rows)),
            Self::Same(series) if !is_long() => Rows::same(series).map(Cow::Owned),
            _ => None,
        }
    }

    pub(super) fn along(&self, ray: usize) -> Cow<'_, Series> {
        match self {
            Self::Same(series) => Cow::Borrowed(series),
            Self::Rows(rows) => Cow::Owned(rows.along(ray)),
            Self::Apart(series) => Cow::Borrowed(&series[ray]),
        }
    }

    fn map(&self, rows: impl Fn(&Rows) -> Option<Rows>, apart: impl Fn(&Series) -> Series) -> Self {
        match self {
            Self::Same(series) => Self::Same(apart(series)),
            Self::Rows(own) => rows(own).map_or_else(|| self.map_apart(apart), Self::Rows),
            Self::Apart(_) => self.map_apart(apart),
        }
    }

    fn map_apart(&self, apart: impl Fn(&Series) -> Series) -> Self {
        Self::of((0..RAYS.get()).map(|ray| apart(&self.along(ray))).collect())
    }

    fn map_two(
        &self,
        other: &Self,
        rows: impl Fn(&Rows, &Rows) -> Option<Rows>,
        apart: impl Fn(&Series, &Series) -> Series,
    ) -> Self {
        if let (Self::Same(a), Self::Same(b)) = (self, other) {
            return Self::Same(apart(a, b));
        }
        if let (Some(a), Some(b)) = (self.rows(), other.rows())
            && let Some(found) = rows(&a, &b)
        {
            return Self::Rows(found);
        }
        Self::of((0..RAYS.get()).map(|ray| apart(&self.along(ray), &other.along(ray))).collect())
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        self.map_two(other, |a, b| a.plus(b, 1.0), Series::plus)
    }

    pub(super) fn minus(&self, other: &Self) -> Self {
        self.map_two(other, |a, b| a.plus(b, -1.0), Series::minus)
    }

    pub(super) fn times(&self, other: &Self) -> Self {
        self.map_two(other, Rows::times, Series::times)
    }

    pub(super) fn over(&self, other: &Self) -> Self {
        self.map_two(other, Rows::over, |a, b| a.times(&b.reciprocal()))
    }

    pub(super) fn raised(&self, exponent: f64) -> Self {
        self.map(|rows| rows.raised(exponent), |series| series.raised(exponent))
    }

    /// Changes the sign along some rays.
    pub(super) fn signed(&self, negative: Outcomes) -> Self {
        match self {
            _ if !negative.any() => self.clone(),
            Self::Rows(rows) => Self::Rows(rows.signed(negative)),
            Self::Same(series) if negative.all() => Self::Same(series.scaled(-1.0)),
            _ => {
                let sign = |ray: usize| if negative.lane(ray) { -1.0 } else { 1.0 };
                Self::of((0..RAYS.get()).map(|ray| self.along(ray).scaled(sign(ray))).collect())
            }
        }
    }

    pub(super) fn select(outcomes: Outcomes, yes: &Self, no: &Self) -> Self {
        let rays = RAYS.get();
        let taken = (0..rays).filter(|&ray| outcomes.lane(ray)).count();
        if taken == rays {
            return yes.clone();
        }
        if taken == 0 {
            return no.clone();
        }
        if let (Some(a), Some(b)) = (yes.rows(), no.rows())
            && let Some(found) = Rows::select(outcomes, &a, &b)
        {
            return Self::Rows(found);
        }
        let along = |ray: usize| if outcomes.lane(ray) { yes.along(ray) } else { no.along(ray) }.into_owned();
        Self::of((0..rays).map(along).collect())
    }

    /// Returns whether the number is defined along a ray. There are none beyond the last.
    pub(super) fn is_defined(&self, ray: usize) -> bool {
        match self {
            Self::Rows(rows) => !rows.undefined.lane(ray),
            Self::Same(series) => series.is_defined(),
            Self::Apart(series) => series.get(ray).is_some_and(Series::is_defined),
        }
    }

    /// Returns the largest term along each ray; `None` if none is known.
    pub(super) fn first(&self) -> [Option<Term>; LANES] {
        match self {
            Self::Same(series) => [series.first(); LANES],
            Self::Rows(rows) => std::array::from_fn(|ray| rows.first(ray)),
            Self::Apart(series) => std::array::from_fn(|ray| series.get(ray)?.first()),
        }
    }

    /// Returns the number if it is the same along all rays, and finite.
    pub(super) fn constant(&self) -> Option<f64> {
        let Self::Same(series) = self else { return None };
        series.finite().filter(|(_, rest)| rest.is_zero()).map(|(constant, _)| constant)
    }

    /// Computes a function of series along each ray.
    pub(super) fn apart(&self, function: impl Fn(&Series) -> Series) -> Self {
        self.map(|_| None, function)
    }

    /// Computes a function of two series along each ray.
    pub(super) fn apart_with(&self, other: &Self, function: impl Fn(&Series, &Series) -> Series) -> Self {
        self.map_two(other, |_, _| None, function)
    }
}

/// Returns whether long series are asked for. They are kept apart, to lose no term.
fn is_long() -> bool {
    length() > LENGTHS[0]
}
