//! Results at singular inputs.
//!
//! A result that is not finite, or that a flag marks, is evaluated along rays through the input. If all rays agree, the
//! result has that limit. Outside of the formula's domain, and where no limit can exist, rays are not needed.

use std::ops::Range;

use super::flags::{Flag, Flags};
use super::narrow::{Evaluated, Search, one_sided};
use super::ray::{Along, Comparison, Found, Ray};
use super::real::{Mask, Number};
use super::series::Limit;
use super::unbounded::Unbounded;

/// Kinds of the inputs and outputs of a routine.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct Roles<'a> {
    /// Inputs that derivatives are taken with respect to.
    pub moves: &'a [bool],
    /// Sizes of the groups of results: values, first derivatives, second derivatives.
    pub groups: &'a [usize],
    /// Whether the first group is of values, not of derivatives.
    pub values_first: bool,
    /// Whether the first group is an energy. It is infinite outside of its domain.
    pub is_energy: bool,
}

/// Masks of a general path.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct Care<T: Number> {
    /// Flags of results that may be conventions.
    pub flags: Flags<T>,
    /// Inputs at which the formula is not defined, as the logarithm of a negative number.
    pub outside: T::Mask,
    /// Inputs at which results are conventions without a limit.
    pub definite: T::Mask,
}

/// Rays that are tried first: four opposite pairs. They usually tell a singularity, where each ray has its own results.
const FEW: usize = 8;
/// Rays that tell one where opposite rays agree: eight more directions.
const SOME: usize = 16;
/// The fewest of them that must have results, which other rays may not have: they leave the formula's domain.
const ENOUGH: usize = 5;
/// Rays that tell a kink, where derivatives have some values, from a singularity.
const MANY: usize = 24;

/// Replaces results by their limits, or by the documented values where there is none, and sets the flags.
///
/// - `degenerate` is set if a result is not finite or replaces a limit that does not exist.
/// - `kink` is set if a derivative has different limits on different sides. The result is one of them.
///
/// `along` evaluates the results along a ray.
#[doc(hidden)]
pub fn settle<T: Number>(
    inputs: &[T],
    roles: Roles<'_>,
    results: &mut [T],
    care: Care<T>,
    along: Along<'_>,
) -> Flags<T> {
    let mut flags = care.flags;
    if care.outside.any() {
        fill_outside(roles, results);
        return Flags::degenerate();
    }
    if care.definite.any() {
        keep_conventions(roles, results);
        return Flags::degenerate();
    }
    look_around(inputs, roles, results, &mut flags, along);
    flags
}

/// Writes the results outside of the domain: an infinite energy, and zeros.
pub(crate) fn fill_outside<T: Number>(roles: Roles<'_>, results: &mut [T]) {
    results.fill(T::from_f64(0.0));
    if let (true, Some(value)) = (roles.is_energy, results.first_mut()) {
        *value = T::from_f64(f64::INFINITY);
    }
}

/// Keeps each group of results whose numbers are all finite, and infinite values; other groups become 0.
fn keep_conventions<T: Number>(roles: Roles<'_>, results: &mut [T]) {
    let is_finite = |x: &T| (x.clone() - x.clone()).equal(T::from_f64(0.0)).all();
    let is_number = |x: &T| x.clone().equal(x.clone()).all();
    let mut rest = results;
    for (number, &size) in roles.groups.iter().enumerate() {
        let (group, others) = rest.split_at_mut(size);
        let is_value = number == 0 && roles.values_first && size == 1;
        if !group.iter().all(|x| if is_value { is_number(x) } else { is_finite(x) }) {
            group.fill(T::from_f64(0.0));
        }
        rest = others;
    }
}

/// Evaluates the results along rays if one of them is not finite or may be a convention.
fn look_around<T: Number>(inputs: &[T], roles: Roles<'_>, results: &mut [T], flags: &mut Flags<T>, along: Along<'_>) {
    let is_finite = |x: &T| (x.clone() - x.clone()).equal(T::from_f64(0.0)).all();
    if (flags.degenerate | flags.kink).any() || !results.iter().all(is_finite) {
        *flags = Flags::clear();
        let is_number = |x: &T| x.clone().equal(x.clone()).all();
        let extended = |numbers: &[T]| numbers.iter().map(Number::extended).collect::<Option<Vec<_>>>();
        match (extended(inputs), extended(results)) {
            _ if !inputs.iter().all(is_number) => {}
            (Some(inputs), Some(plain)) => {
                let settled = Rays::through(inputs, roles, Rounding::of::<T>(), along).settle(&plain, flags);
                results.iter_mut().zip(settled).for_each(|(result, number)| *result = T::of_extended(number));
            }
            // A type without rays, such as multi-precision numbers.
            _ => results.iter_mut().filter(|x| !is_number(x)).for_each(|result| {
                *result = T::from_f64(0.0);
                flags.degenerate = !T::Mask::none();
            }),
        }
    }
    if !results.iter().all(Number::is_representable) {
        flags.degenerate = !T::Mask::none();
    }
}

/// A ray and the results of the routine along it.
struct Path {
    slopes: Vec<f64>,
    comparisons: Vec<Comparison>,
    /// Limits of all results.
    limits: Vec<Limit>,
}

impl Path {
    fn evaluated(&self) -> Evaluated<'_> {
        let Self { slopes, comparisons, .. } = self;
        Evaluated { slopes, comparisons }
    }
}

/// The rays through a singular input.
struct Rays<'a> {
    inputs: Vec<Unbounded<f64>>,
    roles: Roles<'a>,
    rounding: Rounding,
    along: Along<'a>,
    paths: Vec<Path>,
    /// Whether all values are undefined along all rays, as those of √(−1).
    is_outside: bool,
}

/// Limits of one result along all rays.
enum Agreement {
    Number(Unbounded<f64>),
    /// An infinity with the sign of this number.
    Infinite(f64),
    /// Few different numbers.
    Sides,
    None,
}

/// A group of results.
struct Group<'a> {
    range: Range<usize>,
    agreements: Vec<Agreement>,
    /// Results at the input itself.
    plain: &'a [Unbounded<f64>],
    /// Size that rounding errors of limits are relative to.
    scale: Unbounded<f64>,
}

impl Group<'_> {
    fn all(&self, is: impl Fn(&Agreement) -> bool) -> bool {
        self.agreements.iter().all(is)
    }
}

fn zero() -> Unbounded<f64> {
    Unbounded::from_f64(0.0)
}

impl<'a> Rays<'a> {
    fn through(inputs: Vec<Unbounded<f64>>, roles: Roles<'a>, rounding: Rounding, along: Along<'a>) -> Self {
        Self { inputs, roles, rounding, along, paths: Vec::new(), is_outside: true }
    }

    /// Evaluates more rays, up to this number.
    fn cast(&mut self, rays: usize) {
        let moves = self.roles.moves;
        let slopes = |ray: usize| {
            let slope = |(i, &moves): (usize, &bool)| if moves { slope(ray, i) } else { 0.0 };
            moves.iter().enumerate().map(slope).collect()
        };
        self.cast_along((self.paths.len()..rays).map(slopes).collect());
    }

    fn cast_along(&mut self, slopes: Vec<Vec<f64>>) {
        let Roles { groups, values_first, .. } = self.roles;
        let values = if values_first { groups[0] } else { 0 };
        let is_inside = |limits: &Vec<Limit>| !limits[..values].iter().any(|value| matches!(value, Limit::Unknown));
        let found = Ray::evaluate(&self.inputs, &slopes, self.along);
        for (slopes, Found { limits, comparisons }) in slopes.into_iter().zip(found) {
            self.is_outside &= limits.as_ref().is_some_and(|limits| !is_inside(limits));
            // If the value is undefined, so are its derivatives.
            let limits = limits.filter(is_inside).unwrap_or_else(|| vec![Limit::Unknown; groups.iter().sum()]);
            self.paths.push(Path { slopes, comparisons, limits });
        }
    }

    fn agree(&self) -> bool {
        let mut groups = self.groups().into_iter().zip(self.scales());
        groups.all(|(group, scale)| group.into_iter().all(|i| matches!(self.agreement(i, scale), Agreement::Number(_))))
    }

    /// Returns whether every group has limits, or a result that each ray has its own number or infinity for.
    fn are_scattered(&self) -> bool {
        self.groups().into_iter().zip(self.scales()).all(|(group, scale)| {
            let agreements: Vec<Agreement> = group.clone().map(|i| self.agreement(i, scale)).collect();
            let has_limits = agreements.iter().all(|a| matches!(a, Agreement::Number(_)));
            has_limits || group.into_iter().any(|i| self.is_scattered(i, scale))
        })
    }

    fn is_scattered(&self, result: usize, scale: Unbounded<f64>) -> bool {
        let is_infinite = |path: &Path| matches!(path.limits[result], Limit::Infinite(_));
        let (numbers, sides) = (self.numbers(result).count(), self.sides(result, scale).len());
        // An even function has one result for two opposite directions: twelve different ones for sixteen rays.
        self.paths.iter().any(is_infinite) || numbers >= ENOUGH && 3 * sides >= 2 * numbers
    }

    /// Returns the different limits of a result.
    fn sides(&self, result: usize, scale: Unbounded<f64>) -> Vec<Unbounded<f64>> {
        let mut sides: Vec<Unbounded<f64>> = Vec::new();
        for number in self.numbers(result) {
            if !sides.iter().any(|side| is_near(*side, number, scale)) {
                sides.push(number);
            }
        }
        sides
    }

    /// Looks for rays into narrow regions where the formula takes another branch, with other results.
    fn cast_into_narrow_regions(&mut self) {
        let rays: Vec<Evaluated<'_>> = self.paths.iter().map(Path::evaluated).collect();
        let (inputs, moves) = (&self.inputs[..], self.roles.moves);
        let differ = |found: Vec<Found>| found.into_iter().map(|ray| !self.has_results(ray.limits)).collect::<Vec<_>>();
        let comparisons = one_sided(&rays);
        let matter = differ(Ray::evaluate_reversed(&comparisons, inputs, &self.paths[0].slopes, self.along));
        let mut important = comparisons.iter().zip(matter).filter(|(_, matters)| *matters);
        let found = important.find_map(|(comparisons, _)| {
            let found = Search { inputs, moves, along: self.along, comparison: comparisons[0] }.run(&rays);
            differ(Ray::evaluate(inputs, &found, self.along)).contains(&true).then_some(found)
        });
        if let Some(found) = found {
            self.cast(MANY);
            self.cast_along(found);
        }
    }

    /// Returns whether limits are those of the first ray, or do not exist because the formula is degenerate.
    fn has_results(&self, limits: Option<Vec<Limit>>) -> bool {
        let first = &self.paths[0].limits;
        let same = |a: &Limit, b: &Limit, scale| match (a, b) {
            (Limit::Finite(a), Limit::Finite(b)) => is_near(*a, *b, scale),
            _ => false,
        };
        limits.is_none_or(|limits| {
            let mut groups = self.groups().into_iter().zip(self.scales());
            groups.all(|(group, scale)| group.into_iter().all(|i| same(&limits[i], &first[i], scale)))
        })
    }

    fn settle<T: Number>(mut self, plain: &[Unbounded<f64>], flags: &mut Flags<T>) -> Vec<Unbounded<f64>> {
        self.cast(FEW);
        if self.agree() {
            self.cast_into_narrow_regions();
        } else {
            for rays in [SOME, MANY] {
                if self.are_scattered() {
                    break;
                }
                self.cast(rays);
            }
        }
        let mut settled = Vec::with_capacity(plain.len());
        for (number, (range, scale)) in self.groups().into_iter().zip(self.scales()).enumerate() {
            let group = Group {
                agreements: range.clone().map(|i| self.agreement(i, scale)).collect(),
                plain: &plain[range.clone()],
                range,
                scale,
            };
            let is_value = number == 0 && self.roles.values_first;
            let (numbers, flag) = if is_value { self.values(&group) } else { self.derivatives(&group) };
            settled.extend(numbers);
            match flag {
                Some(Flag::Degenerate) => flags.degenerate = !T::Mask::none(),
                Some(Flag::Kink) => flags.kink = !T::Mask::none(),
                None => {}
            }
        }
        settled
    }

    /// Returns values: their limits, infinities, or else the documented values. Several values, such as the components
    /// of forces, are infinite at infinite inputs only; elsewhere they are conventions, like derivatives.
    fn values(&self, group: &Group<'_>) -> (Vec<Unbounded<f64>>, Option<Flag>) {
        let value = |(agreement, &plain): (&Agreement, &Unbounded<f64>)| match agreement {
            Agreement::Number(limit) => self.rounding.nearest(plain, *limit, group.scale),
            Agreement::Infinite(sign) => Unbounded::from_f64(f64::INFINITY.copysign(*sign)),
            _ if plain.is_finite() && !self.is_outside => plain,
            _ => zero(),
        };
        let has_limits = group.all(|a| matches!(a, Agreement::Number(_)));
        let is_single = group.plain.len() == 1 || !self.inputs.iter().all(|input| input.is_finite());
        if !has_limits && !is_single {
            return self.conventions(group);
        }
        let flag = (!has_limits).then_some(Flag::Degenerate);
        (group.agreements.iter().zip(group.plain).map(value).collect(), flag)
    }

    /// Returns what the robust primitives contribute, or 0: all of a group, so that forces still cancel.
    fn conventions(&self, group: &Group<'_>) -> (Vec<Unbounded<f64>>, Option<Flag>) {
        let keep = !self.is_outside && group.plain.iter().copied().all(Unbounded::is_finite);
        let numbers = group.plain.iter().map(|&x| if keep { x } else { zero() });
        (numbers.collect(), Some(Flag::Degenerate))
    }

    /// Returns derivatives: their limits, or those of one side.
    fn derivatives(&self, group: &Group<'_>) -> (Vec<Unbounded<f64>>, Option<Flag>) {
        if !group.all(|a| matches!(a, Agreement::Number(_) | Agreement::Sides)) {
            return self.conventions(group);
        }
        let side = &self.paths[self.side(group)].limits;
        let limit = |(agreement, i): (&Agreement, usize)| match (agreement, side[i]) {
            (&Agreement::Number(limit), _) | (_, Limit::Finite(limit)) => limit,
            _ => zero(),
        };
        let limits = group.agreements.iter().zip(group.range.clone()).map(limit);
        let numbers =
            limits.zip(group.plain).map(|(limit, &plain)| self.rounding.nearest(plain, limit, group.scale)).collect();
        (numbers, group.agreements.iter().any(|a| matches!(a, Agreement::Sides)).then_some(Flag::Kink))
    }

    fn numbers(&self, result: usize) -> impl Iterator<Item = Unbounded<f64>> {
        self.paths.iter().filter_map(move |path| match path.limits[result] {
            Limit::Finite(number) => Some(number),
            _ => None,
        })
    }

    /// Returns the indices of the results of each group.
    fn groups(&self) -> Vec<Range<usize>> {
        let mut end = 0;
        let range = |&size: &usize| {
            end += size;
            end - size..end
        };
        self.roles.groups.iter().map(range).collect()
    }

    /// Returns the size of each group, which its rounding errors are relative to: its largest limit, or the contribution
    /// of its derivatives over the distance of the input from 0.
    fn scales(&self) -> Vec<Unbounded<f64>> {
        let largest = |numbers: &mut dyn Iterator<Item = Unbounded<f64>>| numbers.fold(zero(), |a, b| a.max(b.abs()));
        let moving = self.inputs.iter().zip(self.roles.moves).filter(|(input, moves)| **moves && input.is_finite());
        let distance = largest(&mut moving.map(|(&input, _)| input));
        let mut scales: Vec<_> =
            self.groups().into_iter().map(|group| largest(&mut group.flat_map(|i| self.numbers(i)))).collect();
        for group in (1..scales.len()).rev() {
            scales[group - 1] = scales[group - 1].max(scales[group] * distance);
        }
        scales
    }

    /// Rays on which a result is not defined do not count: they leave its domain.
    fn agreement(&self, result: usize, scale: Unbounded<f64>) -> Agreement {
        let numbers: Vec<_> = self.numbers(result).collect();
        let infinite = self.paths.iter().filter_map(|path| match path.limits[result] {
            Limit::Infinite(sign) => Some(sign),
            _ => None,
        });
        let infinite: Vec<f64> = infinite.collect();
        match (&numbers[..], &infinite[..]) {
            ([], []) => Agreement::None,
            ([], [first, rest @ ..]) if rest.iter().all(|other| other == first) => Agreement::Infinite(*first),
            ([first, rest @ ..], []) if rest.iter().all(|x| is_near(*x, *first, scale)) => Agreement::Number(*first),
            (numbers, []) => {
                let sides = self.sides(result, scale);
                if 2 * sides.len() <= numbers.len() { Agreement::Sides } else { Agreement::None }
            }
            _ => Agreement::None,
        }
    }

    /// Returns the ray whose limits are the most like the plain results: the side on which the formula itself is.
    fn side(&self, group: &Group<'_>) -> usize {
        let alike = |ray: usize| {
            let same = |(limit, plain): (&Limit, &Unbounded<f64>)| match limit {
                Limit::Finite(number) => is_near(*number, *plain, group.scale),
                _ => false,
            };
            self.paths[ray].limits[group.range.clone()].iter().zip(group.plain).filter(|pair| same(*pair)).count()
        };
        (0..self.paths.len()).rev().max_by_key(|&ray| alike(ray)).unwrap_or(0)
    }
}

/// The rounding errors of a plain result that is the limit, relative to the result and to the largest of all.
#[derive(Clone, Copy, Debug)]
struct Rounding(f64, f64);

impl Rounding {
    fn of<T: Number>() -> Self {
        let is_single = T::from_f64(1.0 + 1e-10).equal(T::from_f64(1.0)).all();
        if is_single { Self(1e-3, 1e-5) } else { Self(1e-8, 1e-13) }
    }

    /// Returns the plain result if it is the limit: other routines return the same bits.
    fn nearest(self, plain: Unbounded<f64>, limit: Unbounded<f64>, scale: Unbounded<f64>) -> Unbounded<f64> {
        let allowed = Unbounded::from_f64(self.0) * plain.abs().max(limit.abs()) + Unbounded::from_f64(self.1) * scale;
        if (plain - limit).abs().less_or_equal(allowed) { plain } else { limit }
    }
}

fn is_near(a: Unbounded<f64>, b: Unbounded<f64>, scale: Unbounded<f64>) -> bool {
    let allowed = Unbounded::from_f64(1e-8) * a.abs().max(b.abs()) + Unbounded::from_f64(1e-13) * scale;
    (a - b).abs().less_or_equal(allowed)
}

/// Returns the slope of an input along a ray: a fixed number of size ¼ to 1. Only the first rays are opposite: an even
/// function would have one limit along both, as if these were sides of a kink.
pub(super) fn slope(ray: usize, input: usize) -> f64 {
    let (pair, sign) = if ray < FEW { (ray / 2, if ray.is_multiple_of(2) { 1.0 } else { -1.0 }) } else { (ray, 1.0) };
    // The finaliser of SplitMix64, with the bits of a counter.
    let mut bits = (pair as u64 * 4099 + input as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    bits ^= bits >> 31;
    let size = 0.25 + 0.75 * (bits >> 12) as f64 / (1_u64 << 52) as f64;
    if bits & 1 == 0 { sign * size } else { -sign * size }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::level::Baseline;
    use crate::numbers::outcomes::Outcomes;

    type Formula = fn(&[Ray]) -> Vec<Ray>;

    /// Returns the settled results and the flags (degenerate, kink) at x = y = 0, of which no plain result is known.
    fn at_zero(values: usize, formula: Formula) -> (Vec<f64>, (bool, bool)) {
        let inputs = [Unbounded::<f64>::of(0.0); 2];
        let results = formula(&[0, 1].map(|_| Ray::from_f64(0.0))).len();
        let along = |rays: &[Ray]| (formula(rays), Outcomes::none());
        let mut results = vec![Unbounded::of(f64::NAN); results];
        let groups = [values, results.len() - values];
        let roles = Roles { moves: &[true, true], groups: &groups, values_first: true, is_energy: true };
        let flags = settle(&inputs, roles, &mut results, suspected(Flags::clear()), &along);
        (results.into_iter().map(Unbounded::to_scalar).collect(), (flags.degenerate, flags.kink))
    }

    fn suspected(flags: Flags<Unbounded<f64>>) -> Care<Unbounded<f64>> {
        Care { flags, outside: false, definite: false }
    }

    fn length(x: &[Ray]) -> Ray {
        (x[0] * x[0] + x[1] * x[1]).sqrt()
    }

    #[test]
    fn limits_kinks_and_singularities_are_told_apart() {
        assert_eq!(at_zero(1, |x| vec![x[0] / x[0], x[0] * x[1] / x[0]]), (vec![1.0, 0.0], (false, false)));
        let (kink, flags) = at_zero(1, |x| vec![x[0].abs(), x[0] / x[0].abs(), x[1] / x[1].abs()]);
        assert!(kink[0] == 0.0 && kink[1].abs() == 1.0 && kink[2].abs() == 1.0 && flags == (false, true));
        assert_eq!(
            at_zero(1, |x| {
                let r = length(x);
                vec![r, x[0] / r]
            }),
            (vec![0.0, 0.0], (true, false))
        );
        let (barrier, flags) = at_zero(1, |x| {
            let r = length(x);
            vec![-r.ln::<Baseline>(), x[0] / (r * r)]
        });
        assert!(barrier == [f64::INFINITY, 0.0] && flags == (true, false));
        assert_eq!(at_zero(1, |x| vec![x[0].sqrt(), x[0].sqrt() * x[0]]), (vec![0.0, 0.0], (false, false)));
        assert_eq!(at_zero(1, |x| vec![(x[0] - Ray::from_f64(1.0)).sqrt()]), (vec![0.0], (true, false)));
        assert_eq!(at_zero(1, |x| vec![Ray::from_f64(1.0) / x[0]]), (vec![0.0], (true, false)));
    }

    #[test]
    fn unread_flags_of_untaken_branches_vanish() {
        let care = suspected(Flags { degenerate: true, kink: true });
        let mut results = [Unbounded::of(3.0), Unbounded::of(0.0)];
        let roles = Roles { moves: &[true], groups: &[1, 1], values_first: true, is_energy: true };
        let along = |x: &[Ray]| (vec![Ray::from_f64(3.0), x[0] * Ray::from_f64(2.0)], Outcomes::none());
        let flags = settle(&[Unbounded::of(0.0)], roles, &mut results, care, &along);
        assert!(!flags.any() && results.map(Unbounded::to_scalar) == [3.0, 0.0]);
    }

    #[test]
    fn numbers_that_were_read_as_nan_stay_and_are_flagged() {
        let care = suspected(Flags::clear());
        let mut results = [Unbounded::of(f64::NAN)];
        let roles = Roles { moves: &[true], groups: &[1], values_first: true, is_energy: true };
        let never = |_: &[Ray]| -> (Vec<Ray>, Outcomes) { unreachable!("no ray is needed") };
        let flags = settle(&[Unbounded::of(f64::NAN)], roles, &mut results, care, &never);
        assert!(flags.degenerate && results[0].to_scalar().is_nan());
        let mut large = [Unbounded::of(1e200) * Unbounded::of(1e200)];
        let flags = settle(&[Unbounded::of(1e200)], roles, &mut large, care, &never);
        assert!(flags.degenerate && large[0].to_scalar() == f64::INFINITY);
    }

    #[test]
    fn without_a_domain_or_a_limit_no_ray_is_needed() {
        let never = |_: &[Ray]| -> (Vec<Ray>, Outcomes) { unreachable!("no ray is needed") };
        let roles = Roles { moves: &[true], groups: &[1, 2], values_first: true, is_energy: true };
        let settled = |care, is_energy| {
            let mut results = [f64::NAN, f64::NAN, 3.0].map(Unbounded::<f64>::of);
            let roles = Roles { is_energy, ..roles };
            let flags = settle(&[Unbounded::of(0.0)], roles, &mut results, care, &never);
            assert!(flags.degenerate && !flags.kink);
            results.map(Unbounded::to_scalar)
        };
        let care = suspected(Flags::clear());
        assert_eq!(settled(Care { outside: true, ..care }, true), [f64::INFINITY, 0.0, 0.0]);
        assert_eq!(settled(Care { outside: true, ..care }, false), [0.0; 3]);
        assert_eq!(settled(Care { definite: true, ..care }, true), [0.0; 3]);
    }
}
