//! Coefficients of one power of ε along several rays, and the series that they make.

use std::ops::{Deref, DerefMut};

use super::level::{Kernel, Level};
use super::outcomes::{LANES, Outcomes};
use super::real::Mask;
use super::series::{CANCELLED, LENGTHS};

pub(super) type Row = [f64; LANES];

/// Coefficients outside of this range are left to series, whose exponents are larger.
const SIZES: std::ops::Range<f64> = 1e-120..1e120;

/// The coefficients of one power of ε along all rays.
#[derive(Clone, Copy, Debug)]
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
        self.factors = self.factors.map(|x| x * by);
        self.sizes = self.sizes.map(|x| x * by.abs());
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
        let is_moderate = |x: f64| x == 0.0 || SIZES.start < x.abs() && x.abs() < SIZES.end;
        let mut all = true;
        for ray in 0..LANES {
            all &= is_moderate(self.factors[ray]) & (self.sizes[ray] < 1e200);
        }
        all
    }

    pub(super) fn is_zero(&self) -> bool {
        self.factors == [0.0; LANES]
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

/// How the coefficients of a series are computed, one after the other.
pub(super) enum Operation<'a> {
    /// a + sign · b, with the numbers of the first coefficients of both.
    Sum([&'a [Coefficients]; 2], [usize; 2], f64),
    Product(&'a [Coefficients], &'a [Coefficients]),
    Quotient(&'a [Coefficients], &'a [Coefficients]),
    /// A power of a series that begins with 1.
    Power(&'a [Coefficients], f64),
    /// The logarithm of a series that begins with 1.
    Logarithm(&'a [Coefficients]),
    /// The exponential function of a series that begins with 0.
    Exponential(&'a [Coefficients]),
}

pub(super) struct Compute<'a> {
    pub(super) operation: Operation<'a>,
    pub(super) rows: &'a mut [Coefficients],
}

impl Operation<'_> {
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
                for i in (k + 1).saturating_sub(b.len())..a.len().min(k + 1) {
                    row.add_product(1.0, &a[i], &b[k - i]);
                }
            }
            Self::Quotient(a, b) => {
                row = at(a, k);
                for i in 1..b.len().min(k + 1) {
                    row.add_product(-1.0, &b[i], &before[k - i]);
                }
            }
            Self::Power(x, _) | Self::Logarithm(x) | Self::Exponential(x) if k == 0 => match self {
                Self::Power(..) => row = x[0],
                Self::Logarithm(_) => {}
                _ => row = Coefficients::exact([1.0; LANES]),
            },
            // The derivatives of y = xᵖ, ln x and eˣ by ε: x y' = p x' y, x y' = x', y' = x' y.
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
            Self::Exponential(x) => {
                for i in 1..x.len().min(k + 1) {
                    row.add_product(i as f64 / k as f64, &x[i], &before[k - i]);
                }
            }
        }
        row
    }
}

impl Kernel for Compute<'_> {
    /// Whether all numbers are 0 or of moderate size.
    type Output = bool;

    #[inline(always)]
    fn run<L: Level>(self) -> bool {
        for k in 0..self.rows.len() {
            let mut row = self.operation.coefficient(k, &self.rows[..k]);
            row.drop_cancelled();
            if let Operation::Quotient(_, b) = self.operation {
                row.divide(&b[0]);
            }
            self.rows[k] = row;
        }
        self.rows.iter().fold(true, |all, row| all & row.are_moderate())
    }
}

/// The first coefficients of a series.
#[derive(Clone, Copy, Debug)]
pub(super) struct List {
    rows: [Coefficients; LENGTHS[0]],
    count: usize,
}

impl List {
    pub(super) fn zeros(count: usize) -> Self {
        Self { rows: [Coefficients::ZERO; LENGTHS[0]], count }
    }

    pub(super) fn of(rows: &[Coefficients]) -> Self {
        let mut list = Self::zeros(rows.len());
        list.copy_from_slice(rows);
        list
    }

    pub(super) fn drop_first(&mut self, count: usize) {
        self.rows.copy_within(count..self.count, 0);
        self.count -= count;
    }
}

impl Deref for List {
    type Target = [Coefficients];
    fn deref(&self) -> &[Coefficients] {
        &self.rows[..self.count]
    }
}

impl DerefMut for List {
    fn deref_mut(&mut self) -> &mut [Coefficients] {
        &mut self.rows[..self.count]
    }
}
