//! Numbers along rays.
//!
//! At a singular input x, a formula is evaluated at x + ε d for some directions d, where ε is an infinitesimal. The
//! largest term of a result gives its limit as ε → 0. A bundle of rays is evaluated at once.

use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Range, Sub};

use super::bundle::{Bundle, rays, set_rays};
use super::coefficients::List;
use super::comparisons::{self, Comparison, reversed};
use super::level::Level;
use super::outcomes::{LANES, Outcomes};
use super::real::{Mask, Number};
use super::recording::{Recording, Step, compare, defined};
use super::series::{LENGTHS, Limit, Term, with_length};
use super::unbounded::Unbounded;

/// Evaluates a routine along rays. Returns also the rays along which the formula itself is degenerate.
pub(super) type Along<'a> = &'a dyn Fn(&[Ray]) -> (Vec<Ray>, Outcomes);

thread_local! {
    /// The numbers of the bundle that this thread is computing.
    static NUMBERS: RefCell<Recording> = const { RefCell::new(Recording::new()) };
}

/// Results of a routine along a ray.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Limits of the results, or of the first groups of them; `None` if the formula is degenerate along the ray.
    pub limits: Option<Vec<Limit>>,
    /// All comparisons whose outcomes may matter. Routines do not branch, so all rays have the same ones.
    pub comparisons: Vec<Comparison>,
}

impl Found {
    /// Returns whether more terms might tell a limit.
    fn is_open(&self) -> bool {
        self.limits.as_ref().is_some_and(|limits| limits.iter().any(|limit| matches!(limit, Limit::Open)))
    }
}

/// A routine at a singular input.
#[derive(Clone, Copy)]
pub(super) struct Singular<'a> {
    pub inputs: &'a [Unbounded<f64>],
    pub along: Along<'a>,
    /// The groups of its results.
    pub groups: &'a [Range<usize>],
}

impl Singular<'_> {
    /// Returns what the routine computes at x + slope · ε for the slopes of each ray. Bundle by bundle, it evaluates
    /// group after group while `goes_on`, from the knowledge about the rays of the bundle.
    pub(super) fn evaluate(self, slopes: &[Vec<f64>], goes_on: &mut dyn FnMut(usize, &[Found]) -> bool) -> Vec<Found> {
        let slopes: Vec<&Vec<f64>> = slopes.iter().collect();
        slopes.chunks(LANES).flat_map(|slopes| self.evaluate_bundle(slopes, goes_on)).collect()
    }

    fn evaluate_bundle(self, slopes: &[&Vec<f64>], goes_on: &mut dyn FnMut(usize, &[Found]) -> bool) -> Vec<Found> {
        let [short, longer @ ..] = LENGTHS;
        let mut found = self.evaluate_to(short, slopes, None, goes_on);
        for length in longer {
            let open: Vec<usize> = (0..slopes.len()).filter(|&ray| found[ray].is_open()).collect();
            if open.is_empty() {
                break;
            }
            let slopes: Vec<&Vec<f64>> = open.iter().map(|&ray| slopes[ray]).collect();
            open.into_iter()
                .zip(self.evaluate_to(length, &slopes, None, goes_on))
                .for_each(|(ray, longer)| found[ray] = longer);
        }
        found
    }

    /// Returns what the routine would compute along a ray if the comparisons of each list had the other outcome.
    pub(super) fn evaluate_reversed(self, lists: &[Vec<u32>], slopes: &Vec<f64>) -> Vec<Found> {
        let bundle = |lists: &[Vec<u32>]| {
            let rays = (0..lists.len()).map(Outcomes::only);
            let outcomes = lists.iter().zip(rays).flat_map(|(list, ray)| list.iter().map(move |&c| (c, ray)));
            let slopes = vec![slopes; lists.len()];
            reversed(outcomes.collect(), || self.evaluate_to(LENGTHS[0], &slopes, None, &mut |_, _| true))
        };
        lists.chunks(LANES).flat_map(bundle).collect()
    }

    /// Returns a comparison at x + slope · ε for the slopes of each ray. No result is computed.
    pub(super) fn compare(self, comparison: u32, slopes: &[Vec<f64>]) -> Vec<Comparison> {
        let slopes: Vec<&Vec<f64>> = slopes.iter().collect();
        let without_results = Self { groups: &[], ..self };
        let bundle =
            |slopes: &[&Vec<f64>]| without_results.evaluate_to(LENGTHS[0], slopes, Some(comparison), &mut |_, _| false);
        let this = |found: Found| found.comparisons.get(comparison as usize).copied().flatten();
        slopes.chunks(LANES).flat_map(bundle).map(this).collect()
    }

    /// Evaluates the rays of one bundle: a comparison, then group after group while `goes_on`.
    fn evaluate_to(
        self,
        length: usize,
        slopes: &[&Vec<f64>],
        comparison: Option<u32>,
        goes_on: &mut dyn FnMut(usize, &[Found]) -> bool,
    ) -> Vec<Found> {
        set_rays(slopes.len());
        let result = with_length(length, || {
            let of_input = |i: usize| slopes.iter().map(|slopes| slopes[i]).collect::<Vec<f64>>();
            let input = |i: usize| Ray::new(Bundle::linear(self.inputs[i], &of_input(i)));
            let (results, degenerate) = (self.along)(&(0..self.inputs.len()).map(input).collect::<Vec<_>>());
            if let Some(comparison) = comparison {
                NUMBERS.with_borrow_mut(|all| all.make(comparison));
            }
            let nothing =
                |ray: usize| Found { limits: (!degenerate.lane(ray)).then(Vec::new), comparisons: Vec::new() };
            let mut found: Vec<Found> = (0..slopes.len()).map(nothing).collect();
            for (number, group) in self.groups.iter().enumerate() {
                for result in &results[group.clone()] {
                    result.add_limits(&mut found);
                }
                if !goes_on(number, &found) {
                    break;
                }
            }
            let comparisons = comparisons::take(slopes.len());
            found.iter_mut().zip(comparisons).for_each(|(found, comparisons)| found.comparisons = comparisons);
            found
        });
        NUMBERS.with_borrow_mut(Recording::clear);
        List::forget_all();
        result
    }
}

/// A number along the rays of a bundle: a handle. Generated code has thousands of them on its stack.
#[derive(Clone, Copy, Debug)]
pub struct Ray(u32);

impl Ray {
    /// Adds the limits of a result along each ray.
    fn add_limits(self, found: &mut [Found]) {
        NUMBERS.with_borrow_mut(|all| {
            let [number] = all.each([self.0]);
            for (ray, found) in found.iter_mut().enumerate() {
                found.limits.iter_mut().for_each(|limits| limits.push(number.limit(ray)));
            }
        });
    }

    fn new(number: Bundle) -> Self {
        Self(NUMBERS.with_borrow_mut(|all| all.add(number)))
    }

    fn after(step: Step) -> Self {
        Self(NUMBERS.with_borrow_mut(|all| all.record(step)))
    }

    /// Returns the rays along which self < other, and those along which they are equal.
    fn against(self, other: Self) -> [Outcomes; 2] {
        NUMBERS.with_borrow_mut(|all| {
            let [a, b] = all.each([self.0, other.0]);
            compare(comparisons::register(), a, b)
        })
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $operation:ident) => {
        impl $trait for Ray {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self::after(Step::$operation(self.0, other.0))
            }
        }
    };
}

operator!(Add, add, Plus);
operator!(Sub, sub, Minus);
operator!(Mul, mul, Times);
operator!(Div, div, Over);

impl Neg for Ray {
    type Output = Self;
    fn neg(self) -> Self {
        Self::after(Step::Signed(self.0, !Outcomes::none()))
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
        Self(NUMBERS.with_borrow_mut(|all| all.constant(value)))
    }
    fn sqrt(self) -> Self {
        Self::after(Step::Root(self.0))
    }
    fn abs(self) -> Self {
        Self::after(Step::Size(self.0, comparisons::register()))
    }
    fn min(self, other: Self) -> Self {
        Self::after(Step::Smaller(self.0, other.0, comparisons::register()))
    }
    fn max(self, other: Self) -> Self {
        Self::after(Step::Larger(self.0, other.0, comparisons::register()))
    }
    fn sin<L: Level>(self) -> Self {
        Self::after(Step::Sin(self.0))
    }
    fn cos<L: Level>(self) -> Self {
        Self::after(Step::Cos(self.0))
    }
    fn exp<L: Level>(self) -> Self {
        Self::after(Step::Exp(self.0))
    }
    fn ln<L: Level>(self) -> Self {
        Self::after(Step::Ln(self.0))
    }
    fn atan2<L: Level>(self, x: Self) -> Self {
        Self::after(Step::Angle(self.0, x.0))
    }
    fn powf<L: Level>(self, exponent: Self) -> Self {
        Self::after(Step::Power(self.0, exponent.0))
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
        self.against(other)[0]
    }
    fn less_or_equal(self, other: Self) -> Outcomes {
        let [less, equal] = self.against(other);
        less | equal
    }
    fn precedes(self, other: Self) -> Outcomes {
        NUMBERS.with_borrow_mut(|all| {
            let [a, b] = all.each([self.0, other.0]);
            let first = a.minus(b).first();
            defined(a, b) & Outcomes::of(|ray| first[ray].is_some_and(Term::is_negative))
        })
    }
    fn equal(self, other: Self) -> Outcomes {
        NUMBERS.with_borrow_mut(|all| {
            let [a, b] = all.each([self.0, other.0]);
            let first = a.minus(b).first();
            defined(a, b) & Outcomes::of(|ray| first[ray].is_none())
        })
    }
    fn select(mask: Outcomes, yes: Self, no: Self) -> Self {
        match mask & rays() {
            taken if taken == rays() => yes,
            taken if !taken.any() => no,
            _ => Self::after(Step::Select(mask, yes.0, no.0)),
        }
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
        let mut found = [Found { limits: Some(Vec::new()), comparisons: Vec::new() }];
        of.add_limits(&mut found);
        match found[0].limits.as_ref().expect("limits")[0] {
            Limit::Finite(value, _) => value.to_scalar(),
            Limit::Infinite(sign) => sign * f64::INFINITY,
            Limit::Unknown | Limit::Open => f64::NAN,
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

    fn fourth(x: Ray) -> Ray {
        x * x * x * x
    }

    /// Rows of coefficients tell the limits that single series tell.
    #[test]
    fn bundles_agree_with_series() {
        let formulas: [Formula; 18] = [
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
            |[x, y]| (y.sin::<B>() - y * x.cos::<B>()) / (x * x * y),
            // Powers that are far apart are separate parts.
            |[x, y]| ((number(1.0) + fourth(x) * fourth(y)).sqrt() - number(1.0)) / (fourth(x) * fourth(y)),
            |[x, y]| (number(1.0) + fourth(x) * fourth(y)).ln::<B>() / (fourth(x) * fourth(y)),
            |[x, y]| (x / (x + fourth(x) * fourth(y)) - number(1.0)) / (x * x * x * fourth(y)),
        ];
        let slopes: Vec<Vec<f64>> = (0..LANES).map(|ray| vec![slope(ray, 0), slope(ray, 1)]).collect();
        let zeros = [Unbounded::of(0.0); 2];
        for (number, formula) in formulas.into_iter().enumerate() {
            let along = |rays: &[Ray]| (vec![formula([rays[0], rays[1]])], Outcomes::none());
            let group = 0..1;
            let routine = Singular { inputs: &zeros, along: &along, groups: std::slice::from_ref(&group) };
            let rays: Vec<&Vec<f64>> = slopes.iter().collect();
            let [short, rows, series] =
                LENGTHS.map(|length| routine.evaluate_to(length, &rays, None, &mut |_, _| true));
            // Short rows that tell nothing say so.
            let is_short = short.iter().any(Found::is_open);
            let rows = if is_short { rows } else { [short, rows].concat() };
            for (ray, (rows, series)) in rows.iter().zip(series.iter().cycle()).enumerate() {
                match [rows, series].map(|found| found.limits.as_ref().expect("no flag")[0]) {
                    [Limit::Finite(a, _), Limit::Finite(b, _)] => {
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
