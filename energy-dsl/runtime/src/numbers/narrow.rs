//! Narrow regions near a singular input.
//!
//! If both sides of a comparison are equal at the input, the largest term of their difference decides the outcome along
//! each ray. If it has one sign on all rays that were tried, it may have the other one on a narrow cone of rays, as in
//! `if 20 norm(q - p) < p.x { … }` at p = q with p.x = 0. A descent on the size of that term leads to the cone.

use std::cmp::Ordering;

use super::comparisons::Comparison;
use super::outcomes::LANES;
use super::ray::Singular;
use super::series::Term;

/// Rays that the descents at one input may evaluate. Forty coordinates need 400 for one descent.
pub(super) const EVALUATIONS: usize = 800;
/// Descents start from the rays with the smallest differences.
const STARTS: usize = 2;
/// Narrower cones, in slopes, are not searched for.
const NARROWEST: f64 = 1e-4;
/// Distances to a ray with the other outcome at which it must persist somewhere. Lines and surfaces do not count.
const NEAR: [f64; 8] = [0.05, 0.05, 0.05, 0.01, 0.01, 0.001, 0.001, 0.001];

/// A ray that was evaluated.
pub(super) struct Evaluated<'a> {
    pub slopes: &'a [f64],
    pub comparisons: &'a [Comparison],
}

/// Returns comparisons with the same outcome on all rays whose differences depend on the ray. Each entry lists all
/// comparisons of one difference: those of a value and of its derivatives.
pub(super) fn one_sided(rays: &[Evaluated<'_>]) -> Vec<Vec<u32>> {
    let Some((first, rest)) = rays.split_first() else { return Vec::new() };
    if rest.iter().any(|ray| ray.comparisons.len() != first.comparisons.len()) {
        return Vec::new();
    }
    let mut found: Vec<Vec<u32>> = Vec::new();
    for (number, &term) in first.comparisons.iter().enumerate() {
        let Some(term) = term else { continue };
        let others = || rest.iter().map(|ray| ray.comparisons[number]);
        let is_alike = others().all(|other| other.is_some_and(|other| other.is_negative() == term.is_negative()));
        let is_constant = others().all(|other| other.is_some_and(|other| other.is_near(term)));
        if !is_alike || is_constant {
            continue;
        }
        let same = |ray: &Evaluated<'_>, a: u32| match (ray.comparisons[a as usize], ray.comparisons[number]) {
            (Some(a), Some(b)) => a.compare_size(b) == Ordering::Equal,
            _ => false,
        };
        let number = u32::try_from(number).expect("comparisons are numbered so");
        match found.iter_mut().find(|copies| rays.iter().all(|ray| same(ray, copies[0]))) {
            Some(copies) => copies.push(number),
            None => found.push(vec![number]),
        }
    }
    found
}

/// A search for rays on which a comparison has another outcome.
pub(super) struct Search<'a> {
    pub routine: Singular<'a>,
    pub moves: &'a [bool],
    /// Number of the comparison.
    pub comparison: u32,
    /// Rays that may be evaluated.
    pub evaluations: usize,
}

/// Slopes and the difference along them.
#[derive(Clone)]
struct Point {
    slopes: Vec<f64>,
    difference: Comparison,
}

impl Search<'_> {
    /// Returns the slopes of rays with the other outcome; an empty list if none was found.
    pub(super) fn run(&self, rays: &[Evaluated<'_>]) -> Vec<Vec<f64>> {
        let mut starts: Vec<Point> = rays
            .iter()
            .map(|ray| Point { slopes: ray.slopes.to_vec(), difference: ray.comparisons[self.comparison as usize] })
            .collect();
        starts.sort_by(|a, b| match (a.difference, b.difference) {
            (Some(a), Some(b)) => a.compare_size(b),
            _ => Ordering::Equal,
        });
        let Some(is_negative) = starts.first().and_then(|start| start.difference).map(Term::is_negative) else {
            return Vec::new();
        };
        let is_other = |point: &Point| point.difference.is_some_and(|term| term.is_negative() != is_negative);
        for start in starts.into_iter().take(STARTS) {
            let found = self.descend(start, &is_other);
            if is_other(&found) {
                let near = self.near(&found.slopes);
                let rays: Vec<Vec<f64>> = near.into_iter().filter(is_other).map(|point| point.slopes).collect();
                if !rays.is_empty() {
                    return rays;
                }
            }
        }
        Vec::new()
    }

    fn at(&self, slopes: Vec<f64>) -> Point {
        self.at_each(vec![slopes]).remove(0)
    }

    fn at_each(&self, rays: Vec<Vec<f64>>) -> Vec<Point> {
        let differences = self.routine.compare(self.comparison, &rays);
        rays.into_iter().zip(differences).map(|(slopes, difference)| Point { slopes, difference }).collect()
    }

    fn moving(&self) -> impl Iterator<Item = usize> {
        (0..self.moves.len()).filter(|&i| self.moves[i])
    }

    /// Makes the difference smaller until it has the other sign: a pattern search with a step per slope. The slopes of
    /// a bundle of rays are changed at once, both up and down.
    fn descend(&self, start: Point, is_other: &dyn Fn(&Point) -> bool) -> Point {
        let mut best = start;
        let mut steps: Vec<(usize, f64)> = self.moving().map(|i| (i, 0.5)).collect();
        let mut evaluations = 0;
        while evaluations < self.evaluations / STARTS && steps.iter().any(|&(_, step)| step.abs() > NARROWEST) {
            let before = best.slopes.clone();
            for steps in steps.chunks_mut(LANES / 2) {
                let tried = self.at_each(steps.iter().flat_map(|&(i, step)| beside(&best.slopes, i, step)).collect());
                evaluations += tried.len();
                if let Some(found) = tried.iter().find(|point| is_other(point)) {
                    return found.clone();
                }
                for ((_, step), pair) in steps.iter_mut().zip(tried.as_chunks::<2>().0) {
                    *step *= next_step(&best, pair);
                }
                best = tried.into_iter().fold(best, |best, found| if is_smaller(&found, &best) { found } else { best });
            }
            steps.retain(|&(_, step)| step != 0.0);
            // Steps along a valley: once more what the whole round moved.
            let onwards = best.slopes.iter().zip(&before).map(|(now, before)| now + (now - before)).collect();
            let found = self.at(onwards);
            evaluations += 1;
            if is_other(&found) {
                return found;
            }
            if is_smaller(&found, &best) {
                best = found;
            }
            self.normalise(&mut best);
        }
        best
    }

    /// Scales the slopes to size 1. Otherwise they would shrink, and differences with them.
    fn normalise(&self, point: &mut Point) {
        let size = self.moving().fold(0.0_f64, |size, i| size.max(point.slopes[i].abs()));
        if size > 0.0 && (size - 1.0).abs() > 0.5 {
            *point = self.at(point.slopes.iter().map(|slope| slope / size).collect());
        }
    }

    /// Returns rays near a ray.
    fn near(&self, slopes: &[f64]) -> Vec<Point> {
        let ray = |(number, distance): (usize, &f64)| {
            let moved = slopes.iter().enumerate().map(|(i, &slope)| match self.moves[i] {
                true => slope + distance * super::limits::slope(1000 + number, i),
                false => 0.0,
            });
            moved.collect()
        };
        self.at_each(NEAR.iter().enumerate().map(ray).collect())
    }
}

/// Returns slopes of which one is changed by a step, up and down.
fn beside(slopes: &[f64], i: usize, step: f64) -> [Vec<f64>; 2] {
    [step, -step].map(|step| {
        let mut changed = slopes.to_vec();
        changed[i] += step;
        changed
    })
}

/// Returns the factor of the next step of a slope, which was changed up and down: 0 if it does not matter.
fn next_step(best: &Point, [up, down]: &[Point; 2]) -> f64 {
    match [up, down].map(|tried| is_smaller(tried, best)) {
        [true, _] => 1.5,
        [_, true] => -1.5,
        _ if is_smaller(best, up) || is_smaller(best, down) => 0.4,
        _ => 0.0,
    }
}

/// Returns whether the difference at `a` is smaller than at `b`. An undefined one is not.
fn is_smaller(a: &Point, b: &Point) -> bool {
    match (a.difference, b.difference) {
        (Some(a), Some(b)) => a.compare_size(b) == Ordering::Less,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use crate::numbers::outcomes::Outcomes;
    use crate::numbers::ray::Ray;
    use crate::numbers::unbounded::Unbounded;
    use crate::numbers::{Care, Flags, Mask, Number, Roles, settle};

    /// Returns whether a value with one derivative is marked as a kink at 0, where the derivative is 1.
    fn is_kink(inputs: usize, formula: impl Fn(&[Ray]) -> Vec<Ray>) -> bool {
        let mut results = [0.0, 1.0].map(Unbounded::<f64>::of);
        let flags = Flags { degenerate: false, kink: true };
        let care = Care { flags, outside: false, definite: false };
        let roles = Roles { moves: &vec![true; inputs], groups: &[1, 1], values_first: true, is_energy: true };
        let flags =
            settle(&vec![Unbounded::of(0.0); inputs], roles, &mut results, care, &|x| (formula(x), Outcomes::none()));
        assert!(!flags.degenerate && results[1].to_scalar() == 1.0);
        flags.kink
    }

    fn norm_squared(x: &[Ray]) -> Ray {
        x.iter().fold(Ray::from_f64(0.0), |sum, &x| sum + x * x)
    }

    /// Returns a value with the slope 1 or, where the condition holds, with another one.
    fn bent(x: &[Ray], condition: Outcomes, slope: f64) -> Vec<Ray> {
        let slope = Ray::select(condition, Ray::from_f64(slope), Ray::from_f64(1.0));
        vec![slope * x[0], slope]
    }

    #[test]
    fn cones_that_no_fixed_ray_meets_are_found() {
        for width in [1.0, 0.1, 0.01] {
            let distance = |x: &[Ray]| norm_squared(&[x[3] - x[6], x[4] - x[7], x[5] - x[8]]).sqrt();
            let cone = |x: &[Ray]| distance(x).less(Ray::from_f64(width) * x[0]);
            assert!(is_kink(9, |x| bent(x, cone(x), 2.0)), "width {width}");
            assert!(!is_kink(9, |x| bent(x, cone(x), 1.0)));
        }
        // A wedge between two planes.
        let wedge = |x: &[Ray]| (x[1] - x[2]).abs().less(Ray::from_f64(0.003) * x[0]);
        assert!(is_kink(3, |x| bent(x, wedge(x), 2.0)));
    }

    /// Straight rays do not enter a cusp, and a plane has no width.
    #[test]
    fn lines_and_cusps_do_not_count() {
        assert!(!is_kink(2, |x| bent(x, (x[1] * x[1]).less(x[0] * x[0] * x[0]), 2.0)));
        assert!(!is_kink(3, |x| bent(x, (x[1] * x[1]).less_or_equal(Ray::from_f64(0.0)), 2.0)));
        assert!(!is_kink(3, |x| bent(x, norm_squared(x).less(Ray::from_f64(0.0)), 2.0)));
    }
}
