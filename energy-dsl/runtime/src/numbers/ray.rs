//! Numbers along rays.
//!
//! At a singular input x, a formula is evaluated at x + ε d for some directions d, where ε is an infinitesimal. The
//! largest term of a result gives its limit as ε → 0. A bundle of rays is evaluated at once.

use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::bundle::{Bundle, set_rays};
use super::level::Level;
use super::outcomes::{LANES, Outcomes};
use super::real::{Mask, Number};
use super::series::{LENGTHS, Limit, Term, with_length};
use super::unbounded::Unbounded;

/// Evaluates a routine along rays. Returns also the rays along which the formula itself is degenerate.
pub(super) type Along<'a> = &'a dyn Fn(&[Ray]) -> (Vec<Ray>, Outcomes);

thread_local! {
    /// The numbers of the bundle that this thread is computing.
    static NUMBERS: RefCell<Vec<Bundle>> = const { RefCell::new(Vec::new()) };
    /// The comparisons of the bundle that this thread is computing, in order of evaluation.
    static COMPARISONS: RefCell<Vec<[Comparison; LANES]>> = const { RefCell::new(Vec::new()) };
    /// Comparisons whose outcomes are reversed, and along which rays.
    static REVERSED: RefCell<Vec<(usize, Outcomes)>> = const { RefCell::new(Vec::new()) };
}

/// A comparison of two numbers along a ray: the largest term of their difference; `None` if that is 0 or undefined.
pub(super) type Comparison = Option<Term>;

/// Results of a routine along a ray.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Limits of the results; `None` if the formula is degenerate along the ray.
    pub limits: Option<Vec<Limit>>,
    /// All comparisons but tests of equality. Routines do not branch, so all rays have the same ones.
    pub comparisons: Vec<Comparison>,
}

impl Found {
    fn is_known(&self) -> bool {
        let is_unknown = |limit: &Limit| matches!(limit, Limit::Unknown);
        self.limits.as_ref().is_none_or(|limits| !limits.iter().any(is_unknown))
    }
}

/// A number along the rays of a bundle: a handle. Generated code has thousands of them on its stack.
#[derive(Clone, Copy, Debug)]
pub struct Ray(u32);

impl Ray {
    /// Returns what a routine computes at x + slope · ε for the slopes of each ray, where `along` evaluates it.
    pub(super) fn evaluate(x: &[Unbounded<f64>], slopes: &[Vec<f64>], along: Along<'_>) -> Vec<Found> {
        let bundles = slopes.chunks(LANES);
        bundles.flat_map(|slopes| Self::evaluate_bundle(x, &slopes.iter().collect::<Vec<_>>(), along)).collect()
    }

    fn evaluate_bundle(x: &[Unbounded<f64>], slopes: &[&Vec<f64>], along: Along<'_>) -> Vec<Found> {
        let (mut found, may_tell_more) = Self::evaluate_to(LENGTHS[0], x, slopes, along);
        let unknown: Vec<usize> = (0..slopes.len()).filter(|&ray| !found[ray].is_known()).collect();
        if may_tell_more && !unknown.is_empty() {
            let slopes: Vec<&Vec<f64>> = unknown.iter().map(|&ray| slopes[ray]).collect();
            let (longer, _) = Self::evaluate_to(LENGTHS[1], x, &slopes, along);
            unknown.into_iter().zip(longer).for_each(|(ray, longer)| found[ray] = longer);
        }
        found
    }

    /// Returns what the routine would compute along a ray if the comparisons of each list had the other outcome.
    pub(super) fn evaluate_reversed(
        lists: &[Vec<usize>],
        x: &[Unbounded<f64>],
        slopes: &Vec<f64>,
        along: Along<'_>,
    ) -> Vec<Found> {
        let bundle = |lists: &[Vec<usize>]| {
            let rays = (0..lists.len()).map(|ray| Outcomes::of(|other| other == ray));
            let reversed = lists.iter().zip(rays).flat_map(|(list, ray)| list.iter().map(move |&c| (c, ray)));
            REVERSED.set(reversed.collect());
            let found = Self::evaluate_to(LENGTHS[0], x, &vec![slopes; lists.len()], along).0;
            REVERSED.take();
            found
        };
        lists.chunks(LANES).flat_map(bundle).collect()
    }

    /// Returns the comparisons at x + slope · ε for the slopes of each ray.
    pub(super) fn compare(x: &[Unbounded<f64>], slopes: &[Vec<f64>], along: Along<'_>) -> Vec<Vec<Comparison>> {
        let bundle =
            |slopes: &[Vec<f64>]| Self::evaluate_to(LENGTHS[0], x, &slopes.iter().collect::<Vec<_>>(), along).0;
        slopes.chunks(LANES).flat_map(bundle).map(|found| found.comparisons).collect()
    }

    /// Returns also whether longer series might tell more.
    fn evaluate_to(length: usize, x: &[Unbounded<f64>], slopes: &[&Vec<f64>], along: Along<'_>) -> (Vec<Found>, bool) {
        set_rays(slopes.len());
        let ((results, degenerate), may_tell_more) = with_length(length, || {
            let of_input = |i: usize| slopes.iter().map(|slopes| slopes[i]).collect::<Vec<f64>>();
            let rays: Vec<Self> = (0..x.len()).map(|i| Self::new(Bundle::linear(x[i], &of_input(i)))).collect();
            let (results, degenerate) = along(&rays);
            let limits = |ray: usize| results.iter().map(|result| result.limit(ray)).collect();
            ((0..slopes.len()).map(limits).collect::<Vec<Vec<Limit>>>(), degenerate)
        });
        NUMBERS.with_borrow_mut(Vec::clear);
        let comparisons = COMPARISONS.take();
        let found = |(ray, limits): (usize, Vec<Limit>)| Found {
            limits: (!degenerate.lane(ray)).then_some(limits),
            comparisons: comparisons.iter().map(|terms| terms[ray]).collect(),
        };
        (results.into_iter().enumerate().map(found).collect(), may_tell_more)
    }

    fn limit(self, ray: usize) -> Limit {
        NUMBERS.with_borrow(|all| all[self.0 as usize].along(ray).limit())
    }

    fn new(number: Bundle) -> Self {
        NUMBERS.with_borrow_mut(|all| {
            all.push(number);
            Self(u32::try_from(all.len() - 1).expect("a routine has fewer than 2³² operations"))
        })
    }

    fn map(self, with: impl FnOnce(&Bundle) -> Bundle) -> Self {
        let number = NUMBERS.with_borrow(|all| with(&all[self.0 as usize]));
        Self::new(number)
    }

    fn map_two(self, other: Self, with: impl FnOnce(&Bundle, &Bundle) -> Bundle) -> Self {
        let number = NUMBERS.with_borrow(|all| with(&all[self.0 as usize], &all[other.0 as usize]));
        Self::new(number)
    }

    /// Returns the signs of self − other along each ray; NaN if one is undefined.
    fn against(self, other: Self) -> [f64; LANES] {
        NUMBERS.with_borrow(|all| {
            let (a, b) = (&all[self.0 as usize], &all[other.0 as usize]);
            let signs = compared(&a.minus(b));
            std::array::from_fn(|ray| if a.is_defined(ray) && b.is_defined(ray) { signs[ray] } else { f64::NAN })
        })
    }
}

/// Records a comparison of a difference with 0 and returns the signs, or the other signs if the outcome is reversed.
fn compared(difference: &Bundle) -> [f64; LANES] {
    let terms: [Comparison; LANES] = difference.first();
    let number = COMPARISONS.with_borrow_mut(|all| {
        all.push(terms);
        all.len() - 1
    });
    let is_reversed = |all: &Vec<(usize, Outcomes)>| {
        let of_this = all.iter().filter(|(reversed, _)| *reversed == number);
        of_this.fold(Outcomes::none(), |rays, (_, ray)| rays | *ray)
    };
    let reversed = REVERSED.with_borrow(is_reversed);
    let sign =
        |ray: usize| terms[ray].map_or(0.0, |term| if term.is_negative() != reversed.lane(ray) { -1.0 } else { 1.0 });
    std::array::from_fn(sign)
}

macro_rules! operator {
    ($trait:ident, $method:ident, $operation:ident) => {
        impl $trait for Ray {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                self.map_two(other, Bundle::$operation)
            }
        }
    };
}

operator!(Add, add, plus);
operator!(Sub, sub, minus);
operator!(Mul, mul, times);
operator!(Div, div, over);

impl Neg for Ray {
    type Output = Self;
    fn neg(self) -> Self {
        self.map(|a| a.signed(!Outcomes::none()))
    }
}

impl Number for Ray {
    type Mask = Outcomes;
    type Unbounded = Self;

    fn unbounded(&self, _lane: usize) -> Self {
        *self
    }
    fn set_lane(&mut self, _lane: usize, value: Self) {
        *self = value;
    }
    fn from_f64(value: f64) -> Self {
        Self::new(Bundle::number(value))
    }
    fn sqrt(self) -> Self {
        self.map(|a| a.raised(0.5))
    }
    fn abs(self) -> Self {
        self.map(|a| {
            let signs = compared(a);
            a.signed(Outcomes::of(|ray| signs[ray] < 0.0))
        })
    }
    fn min(self, other: Self) -> Self {
        Self::select(other.less(self), other, self)
    }
    fn max(self, other: Self) -> Self {
        Self::select(self.less(other), other, self)
    }
    fn sin<L: Level>(self) -> Self {
        self.map(Bundle::sin)
    }
    fn cos<L: Level>(self) -> Self {
        self.map(Bundle::cos)
    }
    fn exp<L: Level>(self) -> Self {
        self.map(Bundle::exp)
    }
    fn ln<L: Level>(self) -> Self {
        self.map(Bundle::ln)
    }
    fn atan2<L: Level>(self, x: Self) -> Self {
        self.map_two(x, Bundle::angle)
    }
    fn powf<L: Level>(self, exponent: Self) -> Self {
        self.map_two(exponent, Bundle::power)
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
    fn less(self, other: Self) -> Outcomes {
        let signs = self.against(other);
        Outcomes::of(|ray| signs[ray] < 0.0)
    }
    fn less_or_equal(self, other: Self) -> Outcomes {
        let signs = self.against(other);
        Outcomes::of(|ray| signs[ray] <= 0.0)
    }
    fn equal(self, other: Self) -> Outcomes {
        NUMBERS.with_borrow(|all| {
            let (a, b) = (&all[self.0 as usize], &all[other.0 as usize]);
            let first = a.minus(b).first();
            Outcomes::of(|ray| a.is_defined(ray) && b.is_defined(ray) && first[ray].is_none())
        })
    }
    fn select(mask: Outcomes, yes: Self, no: Self) -> Self {
        yes.map_two(no, |yes, no| Bundle::select(mask, yes, no))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::level::Baseline;
    use crate::numbers::limits::slope;

    type B = Baseline;

    fn ray(x: f64, slope: f64) -> Ray {
        set_rays(1);
        Ray::new(Bundle::linear(Unbounded::of(x), &[slope]))
    }

    fn limit(of: Ray) -> f64 {
        match of.limit(0) {
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

    /// A formula of two numbers.
    type Formula = fn([Ray; 2]) -> Ray;

    /// Rows of coefficients tell the limits that single series tell.
    #[test]
    fn bundles_agree_with_series() {
        let formulas: [Formula; 14] = [
            |[x, y]| (x * x + y * y).sqrt() / (x - y),
            |[x, y]| (x * y).abs().powf::<B>(number(0.4)) / (x.abs() + y * y).powf::<B>(number(0.8)),
            |[x, y]| (x * x).ln::<B>() / (y * y * x.abs()).ln::<B>(),
            |[x, y]| (x.abs().ln::<B>() + y).exp::<B>() / y,
            |[x, y]| y.atan2::<B>(x) - x.atan2::<B>(y),
            |[x, y]| (x * x * y).atan2::<B>(number(-1.0)) + (x / y).exp::<B>(),
            |[x, y]| (number(1.0) + x - (x + y).exp::<B>()) / x,
            |[x, y]| (x / y).sin::<B>() + (number(2.0) + y).cos::<B>(),
            |[x, y]| x.max(y) / x.min(y),
            |[x, y]| (number(1.0) / x - number(1.0) / y) * x * y / (x + y),
            |[x, y]| Ray::select(x.less(y), x * x, y.abs().sqrt()) / (x * y).abs().sqrt(),
            |[x, y]| (x + y).sqrt() * (number(3.0) + x).ln::<B>(),
            |[x, y]| ((number(1.0) + x).sqrt() - number(1.0) - number(0.5) * x) / (x * y),
            |[x, y]| ((number(1.0) + x).ln::<B>() - x) / (x * y) + (x.atan2::<B>(number(1.0) + y) - x) / (x * y),
        ];
        let slopes: Vec<Vec<f64>> = (0..LANES).map(|ray| vec![slope(ray, 0), slope(ray, 1)]).collect();
        let zeros = [Unbounded::of(0.0); 2];
        for (number, formula) in formulas.into_iter().enumerate() {
            let along = |rays: &[Ray]| (vec![formula([rays[0], rays[1]])], Outcomes::none());
            let [rows, series] =
                LENGTHS.map(|length| Ray::evaluate_to(length, &zeros, &slopes.iter().collect::<Vec<_>>(), &along).0);
            for (ray, (rows, series)) in rows.into_iter().zip(series).enumerate() {
                match [rows, series].map(|found| found.limits.expect("no flag")[0]) {
                    [Limit::Finite(a), Limit::Finite(b)] => {
                        let [a, b] = [a, b].map(Unbounded::to_scalar);
                        assert!((a - b).abs() <= 1e-14 * b.abs().max(1.0), "{number} along {ray}: {a}, not {b}");
                    }
                    [Limit::Infinite(a), Limit::Infinite(b)] => assert_eq!(a, b, "{number} along {ray}"),
                    [Limit::Unknown, Limit::Unknown] => {}
                    other => panic!("{number} along {ray}: {other:?}"),
                }
            }
        }
    }

    #[test]
    fn comparisons_see_the_infinitesimal_part() {
        let less = |a: Ray, b: Ray| a.less(b).lane(0);
        assert!(less(number(1.0), ray(1.0, 1e-30)) && less(ray(1.0, -1e-30), number(1.0)));
        assert!(less(ray(0.0, 1.0), number(1e-300)) && less(number(1e300), number(1.0) / ray(0.0, 1.0)));
        let undefined = number(-1.0).sqrt();
        assert!(!undefined.equal(undefined).lane(0) && limit(undefined).is_nan());
    }
}
