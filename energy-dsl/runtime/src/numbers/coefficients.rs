//! Coefficients of one power of ε along several rays, and the series that they make.

use std::cell::RefCell;

use super::cpu::dispatch;
use super::level::{Kernel, Level};
use super::outcomes::{LANES, Outcomes};
use super::real::Mask;
use super::series::CANCELLED;

pub(super) type Row = [f64; LANES];

/// Coefficients outside of this range are left to series, whose exponents are larger.
const SIZES: std::ops::Range<f64> = 1e-120..1e120;

/// The coefficients of one power of ε along all rays.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Coefficients {
    pub(super) factors: Row,
    /// Sizes of the largest numbers that were added or subtracted on the way: the error is this many roundoffs.
    pub(super) sizes: Row,
}

impl Coefficients {
    pub(super) const ZERO: Self = Self { factors: [0.0; LANES], sizes: [0.0; LANES] };

    pub(super) fn exact(factors: Row) -> Self {
        Self { factors, sizes: factors.map(f64::abs) }
    }

    /// Returns a function of the first coefficients of a series, with their relative errors.
    pub(super) fn of_function(&self, function: impl Fn(f64) -> f64) -> Self {
        let factors = self.factors.map(function);
        let size = |ray: usize| match self.factors[ray] {
            0.0 => factors[ray].abs(),
            factor => factors[ray].abs() * (self.sizes[ray] / factor.abs()),
        };
        Self { factors, sizes: std::array::from_fn(size) }
    }

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

    /// Adds `times` · coefficient k of the integral of x' y.
    #[inline(always)]
    fn add_slope(&mut self, times: f64, k: usize, x: &[Self], y: &[Self]) {
        for i in 1..x.len().min(k + 1) {
            self.add_product(times * i as f64 / k as f64, &x[i], &y[k - i]);
        }
    }

    /// Adds `times` · x.
    #[inline(always)]
    fn add(&mut self, times: f64, x: &Self) {
        for ray in 0..LANES {
            self.factors[ray] += times * x.factors[ray];
            self.sizes[ray] = larger(self.sizes[ray], times.abs() * x.sizes[ray]);
        }
    }

    /// Multiplies by other coefficients.
    #[inline(always)]
    pub(super) fn multiply(&mut self, by: &Self) {
        for ray in 0..LANES {
            let (factor, size) = (self.factors[ray], self.sizes[ray]);
            self.factors[ray] = factor * by.factors[ray];
            self.sizes[ray] = larger(size * by.factors[ray].abs(), factor.abs() * by.sizes[ray]);
        }
    }

    /// Divides by other coefficients. Where they are 0, the result is 0.
    #[inline(always)]
    pub(super) fn divide(&mut self, by: &Self) {
        for ray in 0..LANES {
            let (factor, size, divisor) = (self.factors[ray], self.sizes[ray], by.factors[ray]);
            let inverse = if divisor == 0.0 { 0.0 } else { 1.0 / divisor.abs() };
            self.factors[ray] = if divisor == 0.0 { 0.0 } else { factor / divisor };
            self.sizes[ray] = larger(size, factor.abs() * inverse * by.sizes[ray]) * inverse;
        }
    }

    #[inline(always)]
    pub(super) fn scale(&mut self, by: f64) {
        for ray in 0..LANES {
            self.factors[ray] *= by;
            self.sizes[ray] *= by.abs();
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
    pub(super) fn are_moderate(&self) -> bool {
        // Without branches, for vector code.
        let is_moderate = |x: f64| (x == 0.0) | (SIZES.start < x.abs()) & (x.abs() < SIZES.end);
        let mut all = true;
        for ray in 0..LANES {
            all &= is_moderate(self.factors[ray]) & (self.sizes[ray] < 1e200);
        }
        all
    }

    #[inline(always)]
    pub(super) fn is_zero(&self) -> bool {
        let mut all = true;
        for ray in 0..LANES {
            all &= self.factors[ray] == 0.0;
        }
        all
    }

    pub(super) fn set(&mut self, rays: Outcomes, factor: f64, size: f64) {
        for ray in (0..LANES).filter(|&ray| rays.lane(ray)) {
            (self.factors[ray], self.sizes[ray]) = (factor, size);
        }
    }
}

#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a < b { b } else { a }
}

/// How the coefficients of a series are computed, one after the other, from those of others.
#[derive(Clone, Copy)]
pub(super) enum Operation<Series> {
    /// a + sign · b, with the numbers of the first coefficients of both.
    Sum([Series; 2], [usize; 2], f64),
    Product(Series, Series),
    Quotient(Series, Series),
    /// A power of a series that begins with 1.
    Power(Series, f64),
    /// The logarithm of a series that begins with 1.
    Logarithm(Series),
    /// The exponential function of a series that begins with 0.
    Exponential(Series),
}

impl Operation<List> {
    /// Returns the operation on the coefficients.
    fn on(self, all: &[Coefficients]) -> Operation<&[Coefficients]> {
        let rows = |list: List| &all[list.range()];
        match self {
            Self::Sum(of, from, sign) => Operation::Sum(of.map(rows), from, sign),
            Self::Product(a, b) => Operation::Product(rows(a), rows(b)),
            Self::Quotient(a, b) => Operation::Quotient(rows(a), rows(b)),
            Self::Power(x, exponent) => Operation::Power(rows(x), exponent),
            Self::Logarithm(x) => Operation::Logarithm(rows(x)),
            Self::Exponential(x) => Operation::Exponential(rows(x)),
        }
    }
}

impl Operation<&[Coefficients]> {
    /// Returns coefficient k before rounding errors are dropped. `before` are those with smaller numbers.
    #[inline(always)]
    fn coefficient(&self, k: usize, before: &[Coefficients]) -> Coefficients {
        let at = |rows: &[Coefficients], k: usize| rows.get(k).copied().unwrap_or(Coefficients::ZERO);
        let mut row = Coefficients::ZERO;
        match *self {
            Self::Sum([a, b], [from_a, from_b], sign) => {
                row = k.checked_sub(from_a).map_or(row, |k| at(a, k));
                row.add(sign, &k.checked_sub(from_b).map_or(Coefficients::ZERO, |k| at(b, k)));
            }
            Self::Product(a, b) => {
                let from = (k + 1).saturating_sub(b.len());
                for (x, y) in a.iter().skip(from).zip(b[..=k - from].iter().rev()) {
                    row.add_product(1.0, x, y);
                }
            }
            Self::Quotient(a, b) => {
                row = at(a, k);
                for (x, y) in b.iter().skip(1).zip(before.iter().rev()) {
                    row.add_product(-1.0, x, y);
                }
            }
            // The derivatives of y = xᵖ, ln x and eˣ by ε: x y' = p x' y, x y' = x', y' = x' y.
            Self::Power(x, _) if k == 0 => row = x[0],
            Self::Logarithm(_) if k == 0 => {}
            Self::Exponential(_) if k == 0 => row = Coefficients::exact([1.0; LANES]),
            Self::Power(x, exponent) => {
                for i in 1..x.len().min(k + 1) {
                    row.add_product((exponent * i as f64 - (k - i) as f64) / k as f64, &x[i], &before[k - i]);
                }
            }
            Self::Logarithm(x) => {
                row = at(x, k);
                for i in 1..x.len().min(k) {
                    row.add_product(-((k - i) as f64) / k as f64, &x[i], &before[k - i]);
                }
            }
            Self::Exponential(x) => row.add_slope(1.0, k, x, before),
        }
        row
    }
}

/// Computes coefficients.
struct Compute<'a> {
    operation: Operation<&'a [Coefficients]>,
    rows: &'a mut [Coefficients],
}

impl Kernel for Compute<'_> {
    type Output = Extent;

    #[inline(always)]
    fn run<L: Level>(self) -> Extent {
        for k in 0..self.rows.len() {
            let mut row = self.operation.coefficient(k, &self.rows[..k]);
            row.drop_cancelled();
            if let Operation::Quotient(_, b) = self.operation {
                row.divide(&b[0]);
            }
            self.rows[k] = row;
        }
        Extent::of(self.rows)
    }
}

/// Computes the sine and then the cosine of a series x that begins with 0: s' = x' c, c' = −x' s.
struct SineCosine<'a> {
    x: &'a [Coefficients],
    rows: &'a mut [Coefficients],
}

impl Kernel for SineCosine<'_> {
    type Output = Extent;

    #[inline(always)]
    fn run<L: Level>(self) -> Extent {
        let (sine, cosine) = self.rows.split_at_mut(self.rows.len() / 2);
        for k in 0..sine.len() {
            let mut next = [Coefficients::ZERO, Coefficients::exact([if k == 0 { 1.0 } else { 0.0 }; LANES])];
            next[0].add_slope(1.0, k, self.x, cosine);
            next[1].add_slope(-1.0, k, self.x, sine);
            next.iter_mut().for_each(Coefficients::drop_cancelled);
            [sine[k], cosine[k]] = next;
        }
        Extent::of(self.rows)
    }
}

/// Knowledge about coefficients.
#[derive(Clone, Copy)]
struct Extent {
    /// Whether all numbers are 0 or of moderate size.
    are_moderate: bool,
    /// The number of leading coefficients that are 0.
    zeros: usize,
}

impl Extent {
    #[inline(always)]
    fn of(rows: &[Coefficients]) -> Self {
        let mut extent = Self { are_moderate: true, zeros: 0 };
        for (k, row) in rows.iter().enumerate() {
            extent.are_moderate &= row.are_moderate();
            extent.zeros += usize::from(extent.zeros == k && row.is_zero());
        }
        extent
    }
}

/// The coefficients of all series of a bundle.
struct Store {
    rows: Vec<Coefficients>,
    /// Rows that belong to a series. Later ones wait to be used again.
    used: usize,
}

thread_local! {
    /// The coefficients of the bundle that this thread is computing.
    static COEFFICIENTS: RefCell<Store> = const { RefCell::new(Store { rows: Vec::new(), used: 0 }) };
}

/// The first coefficients of a series: a handle. They do not change, and are forgotten after each bundle.
#[derive(Clone, Copy, Debug)]
pub(super) struct List {
    start: u32,
    count: u32,
}

impl List {
    pub(super) const EMPTY: Self = Self { start: 0, count: 0 };

    pub(super) fn forget_all() {
        COEFFICIENTS.with_borrow_mut(|all| all.used = 0);
    }

    pub(super) fn of(rows: &[Coefficients]) -> Self {
        Self::filled(rows.len(), |_, new| new.copy_from_slice(rows)).0
    }

    /// Computes coefficients and drops the first ones that are 0. Returns also how many these are; `None` if a number
    /// is too large or too small.
    pub(super) fn computed(count: usize, operation: Operation<Self>) -> Option<(Self, usize)> {
        let (list, extent) = Self::filled(count, |all, rows| dispatch(Compute { operation: operation.on(all), rows }));
        extent.are_moderate.then(|| (list.after(extent.zeros), extent.zeros))
    }

    /// Returns sine and cosine of a series that begins with 0.
    pub(super) fn sine_cosine(self, count: usize) -> Option<[Self; 2]> {
        let compute =
            |all: &[Coefficients], rows: &mut [Coefficients]| dispatch(SineCosine { x: &all[self.range()], rows });
        let (both, Extent { are_moderate, .. }) = Self::filled(2 * count, compute);
        let sine = Self { count: both.count / 2, ..both };
        are_moderate.then(|| [sine, both.after(count)])
    }

    /// Creates coefficients from those that exist. `fill` writes all of them.
    fn filled<R>(count: usize, fill: impl FnOnce(&[Coefficients], &mut [Coefficients]) -> R) -> (Self, R) {
        COEFFICIENTS.with_borrow_mut(|all| {
            let start = all.used;
            all.used += count;
            if all.rows.len() < all.used {
                all.rows.resize(2 * all.used, Coefficients::ZERO);
            }
            let (others, rows) = all.rows.split_at_mut(start);
            let found = fill(others, &mut rows[..count]);
            let [start, count] = [start, count].map(|n| u32::try_from(n).expect("fewer than 2³² coefficients"));
            (Self { start, count }, found)
        })
    }

    fn range(self) -> std::ops::Range<usize> {
        self.start as usize..(self.start + self.count) as usize
    }

    pub(super) fn len(self) -> usize {
        self.count as usize
    }

    pub(super) fn is_empty(self) -> bool {
        self.count == 0
    }

    pub(super) fn with<R>(self, read: impl FnOnce(&[Coefficients]) -> R) -> R {
        COEFFICIENTS.with_borrow(|all| read(&all.rows[self.range()]))
    }

    pub(super) fn first(self) -> Option<Coefficients> {
        self.with(|rows| rows.first().copied())
    }

    /// Returns the coefficients without the first ones that are 0, and how many these are.
    pub(super) fn stripped(self) -> (Self, usize) {
        let zeros = self.with(|rows| rows.iter().take_while(|row| row.is_zero()).count());
        (self.after(zeros), zeros)
    }

    fn after(self, first: usize) -> Self {
        let first = first as u32;
        Self { start: self.start + first, count: self.count - first }
    }

    /// Returns the first coefficient and the others.
    pub(super) fn split(self) -> [Self; 2] {
        [Self { count: 1, ..self }, self.after(1)]
    }

    /// Returns coefficients that `change` was applied to, with their numbers.
    pub(super) fn changed(self, change: impl Fn(usize, &mut Coefficients)) -> Self {
        let copy = |all: &[Coefficients], rows: &mut [Coefficients]| {
            rows.copy_from_slice(&all[self.range()]);
            rows.iter_mut().enumerate().for_each(|(k, row)| change(k, row));
        };
        Self::filled(self.len(), copy).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(factor: f64, size: f64) -> Coefficients {
        Coefficients { factors: [factor; LANES], sizes: [size; LANES] }
    }

    fn first(of: &Coefficients) -> (f64, f64) {
        (of.factors[0], of.sizes[0])
    }

    #[test]
    fn sizes_are_those_of_the_largest_terms() {
        let mut product = of(-2.0, 8.0);
        product.multiply(&of(4.0, 4.0));
        assert_eq!(first(&product), (-8.0, 32.0));
        product.multiply(&of(0.5, 16.0));
        assert_eq!(first(&product), (-4.0, 128.0));
        product.divide(&of(-2.0, 2.0));
        assert_eq!(first(&product), (2.0, 64.0));
        product.divide(&of(4.0, 256.0));
        assert_eq!(first(&product), (0.5, 32.0));
        product.divide(&of(0.0, 0.0));
        assert_eq!(first(&product), (0.0, 0.0));
        let mut sum = of(1.0, 1.0);
        sum.add_product(-3.0, &of(2.0, 8.0), &of(5.0, 6.0));
        assert_eq!(first(&sum), (-29.0, 120.0));
        sum.add(-2.0, &of(3.0, 100.0));
        assert_eq!(first(&sum), (-35.0, 200.0));
        sum.scale(-2.0);
        assert_eq!(first(&sum), (70.0, 400.0));
        assert_eq!(first(&of(-2.0, 8.0).of_function(|x| x * x)), (4.0, 16.0));
    }

    #[test]
    fn sums_that_cancel_are_0() {
        let mut sum = of(1e-3, 1e10);
        sum.drop_cancelled();
        assert_eq!(first(&sum), (0.0, 0.0));
        let mut sum = of(-1.0, 1e10);
        sum.drop_cancelled();
        assert_eq!(first(&sum), (-1.0, 1e10));
    }
}
