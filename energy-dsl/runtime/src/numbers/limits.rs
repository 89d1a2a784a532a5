//! Results at singular inputs.
//!
//! A result that is not finite, or that a flag marks, is evaluated along rays through the input. If all rays agree, the
//! result has that limit. Outside of the formula's domain, and where no limit can exist, rays are not needed.

use std::ops::Range;

use super::comparisons::Comparison;
use super::flags::{Flag, Flags};
use super::narrow::{EVALUATIONS, Evaluated, Search, one_sided};
use super::ray::{Along, Found, Singular};
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
/// Numbers with a relative error of fewer roundoffs are surely different if they differ by 1e-8.
const SURE: f64 = 1e5;
/// Rays that tell a kink, where derivatives have some values, from a singularity.
const MANY: usize = 24;

/// Replaces results by their limits, or by the documented values without a limit, and sets the flags.
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
    /// Limits of the first results. Others are unknown.
    limits: Vec<Limit>,
}

impl Path {
    fn limit(&self, result: usize) -> Limit {
        self.limits.get(result).copied().unwrap_or(Limit::Unknown)
    }

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
    /// Indices of the results of each group.
    ranges: Vec<Range<usize>>,
    /// Groups that all rays have results of. If the last of them has no limit, the later ones, its derivatives, lack
    /// limits, too.
    evaluated: usize,
    paths: Vec<Path>,
    /// Whether all values are undefined along all rays, as those of √(−1).
    is_outside: bool,
    /// Whether the formula is degenerate along all rays.
    is_degenerate: bool,
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

    fn has_limits(&self) -> bool {
        self.all(|a| matches!(a, Agreement::Number(_)))
    }
}

fn zero() -> Unbounded<f64> {
    Unbounded::from_f64(0.0)
}

impl<'a> Rays<'a> {
    fn through(inputs: Vec<Unbounded<f64>>, roles: Roles<'a>, rounding: Rounding, along: Along<'a>) -> Self {
        let mut end = 0;
        let range = |&size: &usize| {
            end += size;
            end - size..end
        };
        let ranges: Vec<_> = roles.groups.iter().map(range).collect();
        let (evaluated, paths) = (ranges.len(), Vec::new());
        Self { inputs, roles, rounding, along, evaluated, ranges, paths, is_outside: true, is_degenerate: true }
    }

    fn routine(&self) -> Singular<'_> {
        Singular { inputs: &self.inputs, along: self.along, groups: &self.ranges }
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
        for slopes in slopes.chunks(FEW) {
            let mut evaluated = self.evaluated;
            let found = self.routine().evaluate(slopes, &mut |group, found| {
                let is_last = self.has_surely_no_limit(group, found);
                evaluated = if is_last { evaluated.min(group + 1) } else { evaluated };
                !is_last
            });
            self.evaluated = evaluated;
            for (slopes, Found { limits, comparisons }) in slopes.iter().zip(found) {
                self.is_degenerate &= limits.is_none();
                self.is_outside &= limits.as_ref().is_some_and(|limits| !self.is_inside(limits));
                // If the value is undefined, so are its derivatives.
                let limits = limits.filter(|limits| self.is_inside(limits)).unwrap_or_default();
                self.paths.push(Path { slopes: slopes.clone(), comparisons, limits });
            }
        }
    }

    /// Returns whether all values are defined along a ray.
    fn is_inside(&self, limits: &[Limit]) -> bool {
        let values = if self.roles.values_first { self.ranges[0].len() } else { 0 };
        !limits[..values].iter().any(|value| matches!(value, Limit::Unknown | Limit::Open))
    }

    /// Returns whether a result of this group is infinite along a ray, or differs from ray to ray by more than rounding;
    /// or whether no ray is inside of the domain.
    fn has_surely_no_limit(&self, group: usize, found: &[Found]) -> bool {
        let rays = || found.iter().filter_map(|ray| ray.limits.as_deref()).filter(|limits| self.is_inside(limits));
        rays().next().is_none()
            || self.ranges[group].clone().any(|i| {
                let known = |limits: &[Limit]| match limits[i] {
                    Limit::Finite(number, doubt) => (doubt < SURE).then_some(number),
                    _ => None,
                };
                let numbers: Vec<_> = rays().filter_map(known).collect();
                let scale = numbers.iter().fold(zero(), |scale, number| scale.max(number.abs()));
                let numbers: Vec<f64> = numbers.into_iter().map(|number| relative(number, scale)).collect();
                rays().any(|limits| matches!(limits[i], Limit::Infinite(_))) || are_scattered(&numbers)
            })
    }

    /// Judges the limits of all results.
    fn judged<'b>(&self, plain: &'b [Unbounded<f64>]) -> Vec<Group<'b>> {
        let group = |(range, scale): (Range<usize>, Unbounded<f64>)| Group {
            agreements: range.clone().map(|i| self.agreement(i, scale)).collect(),
            plain: &plain[range.clone()],
            range,
            scale,
        };
        self.ranges.iter().cloned().zip(self.scales()).map(group).collect()
    }

    /// Returns whether more rays would tell nothing new of a group: it has limits, or two sides, or a result that each
    /// ray has its own number or infinity for.
    fn is_clear(&self, group: &Group<'_>) -> bool {
        let is_infinite = |i: usize| self.paths.iter().any(|path| matches!(path.limit(i), Limit::Infinite(_)));
        let is_scattered = |i: usize| is_infinite(i) || are_scattered(&self.relative(i, group.scale));
        let has_sides = |i: usize| {
            let numbers = self.relative(i, group.scale);
            numbers.len() == self.paths.len() && are_two_sides(&numbers)
        };
        group.has_limits() || group.range.clone().any(is_scattered) || group.range.clone().all(has_sides)
    }

    /// Looks for rays into narrow regions where the formula takes another branch, with other results than those of
    /// these groups. Returns whether there are any.
    fn cast_into_narrow_regions(&mut self, groups: &[Group<'_>]) -> bool {
        let rays: Vec<Evaluated<'_>> = self.paths.iter().map(Path::evaluated).collect();
        let (routine, moves) = (self.routine(), self.roles.moves);
        let differs = |ray: Found| !self.has_results(ray.limits, groups);
        let comparisons = one_sided(&rays);
        let reversed = routine.evaluate_reversed(&comparisons, &self.paths[0].slopes);
        let important = comparisons.iter().zip(reversed).filter_map(|(list, ray)| differs(ray).then_some(list[0]));
        let important: Vec<u32> = important.collect();
        let evaluations = EVALUATIONS / important.len().max(1);
        let found = important.into_iter().find_map(|comparison| {
            let found = Search { routine, moves, comparison, evaluations }.run(&rays);
            routine.evaluate(&found, &mut |_, _| true).into_iter().any(differs).then_some(found)
        });
        let Some(found) = found else { return false };
        self.cast(MANY);
        self.cast_along(found);
        true
    }

    /// Returns whether limits are those of the first ray, or do not exist because the formula is degenerate.
    fn has_results(&self, limits: Option<Vec<Limit>>, groups: &[Group<'_>]) -> bool {
        let same = |a: Limit, b: Limit, scale| match (a, b) {
            (Limit::Finite(a, _), Limit::Finite(b, _)) => is_near(relative(a, scale), relative(b, scale)),
            _ => false,
        };
        limits.is_none_or(|limits| {
            groups.iter().all(|group| group.range.clone().all(|i| same(limits[i], self.paths[0].limit(i), group.scale)))
        })
    }

    fn settle<T: Number>(mut self, plain: &[Unbounded<f64>], flags: &mut Flags<T>) -> Vec<Unbounded<f64>> {
        self.cast(FEW);
        let mut groups = self.judged(plain);
        if groups.iter().all(Group::has_limits) {
            if self.cast_into_narrow_regions(&groups) {
                groups = self.judged(plain);
            }
        } else {
            for rays in [SOME, MANY] {
                if self.is_degenerate || groups[..self.evaluated].iter().all(|group| self.is_clear(group)) {
                    break;
                }
                self.cast(rays);
                groups = self.judged(plain);
            }
        }
        let mut settled = Vec::with_capacity(plain.len());
        for (number, group) in groups.into_iter().enumerate() {
            let is_value = number == 0 && self.roles.values_first;
            let (numbers, flag) = match () {
                () if number >= self.evaluated => self.conventions(&group),
                () if is_value => self.values(&group),
                () => self.derivatives(&group),
            };
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
        let has_limits = group.has_limits();
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
        let side = &self.paths[self.side(group)];
        let limit = |(agreement, i): (&Agreement, usize)| match (agreement, side.limit(i)) {
            (&Agreement::Number(limit), _) | (_, Limit::Finite(limit, _)) => limit,
            _ => zero(),
        };
        let limits = group.agreements.iter().zip(group.range.clone()).map(limit);
        let numbers =
            limits.zip(group.plain).map(|(limit, &plain)| self.rounding.nearest(plain, limit, group.scale)).collect();
        (numbers, group.agreements.iter().any(|a| matches!(a, Agreement::Sides)).then_some(Flag::Kink))
    }

    fn numbers(&self, result: usize) -> impl Iterator<Item = Unbounded<f64>> {
        self.paths.iter().filter_map(move |path| match path.limit(result) {
            Limit::Finite(number, _) => Some(number),
            _ => None,
        })
    }

    /// Returns the finite limits of a result, relative to a scale.
    fn relative(&self, result: usize, scale: Unbounded<f64>) -> Vec<f64> {
        self.numbers(result).map(|number| relative(number, scale)).collect()
    }

    /// Returns the size of each group, which its rounding errors are relative to: its largest limit, or the
    /// contribution of its derivatives over the distance of the input from 0.
    fn scales(&self) -> Vec<Unbounded<f64>> {
        let largest = |numbers: &mut dyn Iterator<Item = Unbounded<f64>>| numbers.fold(zero(), |a, b| a.max(b.abs()));
        let moving = self.inputs.iter().zip(self.roles.moves).filter(|(input, moves)| **moves && input.is_finite());
        let distance = largest(&mut moving.map(|(&input, _)| input));
        let mut scales: Vec<_> =
            self.ranges.iter().map(|group| largest(&mut group.clone().flat_map(|i| self.numbers(i)))).collect();
        for group in (1..scales.len()).rev() {
            scales[group - 1] = scales[group - 1].max(scales[group] * distance);
        }
        scales
    }

    /// Rays on which a result is not defined do not count: they leave its domain.
    fn agreement(&self, result: usize, scale: Unbounded<f64>) -> Agreement {
        let numbers = self.relative(result, scale);
        let mut infinite = self.paths.iter().filter_map(|path| match path.limit(result) {
            Limit::Infinite(sign) => Some(sign),
            _ => None,
        });
        match (self.numbers(result).next(), infinite.next()) {
            (None, Some(first)) if infinite.all(|other| other == first) => Agreement::Infinite(first),
            (Some(first), None) if numbers.iter().all(|&x| is_near(x, numbers[0])) => Agreement::Number(first),
            (Some(_), None) if 2 * sides(&numbers) <= numbers.len() => Agreement::Sides,
            _ => Agreement::None,
        }
    }

    /// Returns the ray whose limits are the most like the plain results: the side on which the formula itself is.
    fn side(&self, group: &Group<'_>) -> usize {
        let alike = |ray: usize| {
            let same = |(i, &plain): (usize, &Unbounded<f64>)| match self.paths[ray].limit(i) {
                Limit::Finite(number, _) => is_near(relative(number, group.scale), relative(plain, group.scale)),
                _ => false,
            };
            group.range.clone().zip(group.plain).filter(|&pair| same(pair)).count()
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

/// Returns a number relative to the scale of its group.
fn relative(x: Unbounded<f64>, scale: Unbounded<f64>) -> f64 {
    if x.equal(zero()) { 0.0 } else { (x / scale).to_scalar() }
}

/// Returns whether numbers are equal but for rounding errors.
fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-8 * a.abs().max(b.abs()) + 1e-13
}

/// Returns whether each ray has its own number. An even function has one for two opposite directions: twelve different
/// ones for sixteen rays.
fn are_scattered(numbers: &[f64]) -> bool {
    numbers.len() >= ENOUGH && 3 * sides(numbers) >= 2 * numbers.len()
}

/// Returns whether there are at most two numbers, neither of which a single ray has.
fn are_two_sides(numbers: &[f64]) -> bool {
    let first = numbers.iter().filter(|&&number| is_near(number, numbers[0])).count();
    sides(numbers) <= 2 && first != 1 && first + 1 != numbers.len()
}

/// Returns how many of these numbers are different.
fn sides(numbers: &[f64]) -> usize {
    let is_new = |(i, &number): (usize, &f64)| !numbers[..i].iter().any(|&other| is_near(other, number));
    numbers.iter().enumerate().filter(|&number| is_new(number)).count()
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
    use crate::numbers::ray::Ray;

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

    #[test]
    fn results_that_are_nearly_the_limit_stay() {
        let is_kept = |rounding: Rounding, plain: f64, limit: f64, scale: f64| {
            rounding.nearest(Unbounded::of(plain), Unbounded::of(limit), Unbounded::of(scale)).to_scalar() == plain
        };
        let (single, double) = (Rounding::of::<f32>(), Rounding::of::<f64>());
        assert!(is_kept(single, 0.9e-5, 0.0, 1.0) && !is_kept(single, 1.1e-5, 0.0, 1.0));
        assert!(is_kept(single, 1.0009, 1.0, 0.0) && !is_kept(single, 1.0011, 1.0, 0.0));
        assert!(is_kept(double, 0.9e-13, 0.0, 1.0) && !is_kept(double, 1.1e-13, 0.0, 1.0));
        assert!(is_kept(double, 1.0 + 0.9e-8, 1.0, 0.0) && !is_kept(double, 1.0 + 1.1e-8, 1.0, 0.0));
    }

    #[test]
    fn slopes_are_fixed_and_different() {
        // Limits along other rays may be rounded differently: results would change from version to version.
        let expected = [-0.912_483_106_160_231_9, -0.635_638_733_888_018_5, -0.578_857_186_237_408_3];
        assert_eq!([slope(0, 0), slope(7, 3), slope(20, 1)], expected);
        let mut sizes = Vec::new();
        for ray in 0..MANY {
            for input in 0..50 {
                let own = slope(ray, input);
                assert!((0.25..=1.0).contains(&own.abs()));
                if ray < FEW && ray % 2 == 1 {
                    assert_eq!(own, -slope(ray - 1, input));
                } else {
                    sizes.push(own.abs());
                }
            }
        }
        sizes.sort_by(f64::total_cmp);
        assert!(sizes.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
