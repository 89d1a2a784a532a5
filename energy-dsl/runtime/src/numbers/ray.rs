//! Numbers along a ray.
//!
//! At a singular input x, a formula is evaluated at x + ε d for some directions d, where ε is an infinitesimal. The
//! largest term of a result gives its limit as ε → 0.

use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::level::Level;
use super::real::Number;
use super::series::{LENGTHS, Limit, Series, Term, with_length};
use super::unbounded::Unbounded;

/// Evaluates a routine along a ray; `None` if the formula itself is degenerate there.
pub(super) type Along<'a> = &'a dyn Fn(&[Ray]) -> Option<Vec<Ray>>;

thread_local! {
    /// The series of all rays that this thread is computing.
    static SERIES: RefCell<Vec<Series>> = const { RefCell::new(Vec::new()) };
    /// The comparisons of the ray that this thread is computing, in order of evaluation.
    static COMPARISONS: RefCell<Vec<Comparison>> = const { RefCell::new(Vec::new()) };
    /// Comparisons whose outcomes are reversed.
    static REVERSED: RefCell<Vec<usize>> = const { RefCell::new(Vec::new()) };
}

/// A comparison of two numbers along a ray: the largest term of their difference; `None` if that is 0 or undefined.
pub(super) type Comparison = Option<Term>;

/// Results of a routine along a ray.
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
        let (short, may_tell_more) = Self::evaluate_to(LENGTHS[0], x, slopes, along);
        let is_known = |limits: &Vec<Limit>| !limits.iter().any(|limit| matches!(limit, Limit::Unknown));
        let suffices = !may_tell_more || short.limits.as_ref().is_none_or(is_known);
        if suffices { short } else { Self::evaluate_to(LENGTHS[1], x, slopes, along).0 }
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
        Self::evaluate_to(LENGTHS[0], x, slopes, along).0.comparisons
    }

    /// Returns also whether longer series might tell more.
    fn evaluate_to(length: usize, x: &[Unbounded<f64>], slopes: &[f64], along: Along<'_>) -> (Found, bool) {
        let (limits, may_tell_more) = with_length(length, || {
            let rays: Vec<Self> = x.iter().zip(slopes).map(|(&x, &slope)| Self::from(x, slope)).collect();
            along(&rays).map(|found| found.into_iter().map(Self::limit).collect())
        });
        SERIES.with_borrow_mut(Vec::clear);
        (Found { limits, comparisons: COMPARISONS.take() }, may_tell_more)
    }

    /// Creates x + slope · ε.
    fn from(x: Unbounded<f64>, slope: f64) -> Self {
        Self::new(Series::linear(x, slope))
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
        all.push(difference.and_then(Series::first));
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
    use crate::numbers::level::Baseline;

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
