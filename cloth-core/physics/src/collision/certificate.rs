//! Proof that a straight move keeps pairs apart.
//!
//! A direction n separates two convex features by n·(b − a) ≥ ℓ for all corners a of one and b of the other. Corners
//! move on straight lines at constant velocity, so n·(b − a) is an affine function of time. If it is at least ℓ at both
//! ends of a move, it is at least ℓ during the move: the features stay at least ℓ apart. No root is computed, and only
//! dot products are rounded.
//!
//! The level ℓ = ξ + 0.1 (d − ξ) of a pair at distance d keeps a tenth of its gap beyond the thickness ξ. If the normal
//! of the closest points at the start, or at the end, separates the pair at both ends, the whole move is safe.
//! Otherwise the pair advances along the move: the normal at one instant allows a certain time, and so on (directional
//! advance; compare the conservative advancement of Li, Kaufman and Jiang 2021).
//!
//! All positions that occur are rounded. The level is raised by 64 ε times the largest coordinate. This exceeds the sum
//! of all rounding errors, relative to the largest coordinate and the three components. They are 2 ε for each of the
//! two corners, 1 ε for their difference, and 3 ε for the dot product with a vector of length 1 + 4 ε.

use energy_dsl::{Real, Vector3};

use super::displacement::{excursions, largest_coordinate, mean};
use super::{Closest, Pair, plane};
use crate::geometry::{add_scaled, dot, subtract};

/// The part of the gap beyond the thickness that a move must leave.
const KEPT: f64 = 0.1;
/// Instants at which a pair takes a new normal before the rest of the move is given up.
const ADVANCES: usize = 64;
/// The advance is over once it gains less than this part of the way so far.
const GAIN: f64 = 1e-2;
/// Bound of all rounding errors, relative to the largest coordinate.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// The distance that a pair keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// The thickness ξ, in m.
    pub thickness: f64,
    /// Distance beyond which nothing needs to be kept, in m; infinite if a part of every gap is kept.
    pub reach: f64,
    /// Whether the triangle stands for its whole plane. The point then stays on its side of the plane.
    pub is_plane: bool,
}

/// A straight move of all vertices.
#[derive(Clone, Debug)]
pub struct Move<'a> {
    pub(crate) from: &'a [Vector3<f64>],
    pub(crate) to: &'a [Vector3<f64>],
    /// The mean of all positions at the start, and at the end.
    pub(crate) means: [Vector3<f64>; 2],
    /// The length of the displacement of each vertex relative to the mean, in m.
    pub(crate) excursions: Vec<f64>,
    /// Bound of the rounding errors of a separation, in m.
    rounding: f64,
}

impl<'a> Move<'a> {
    /// Starts the certificate of a move of all vertices.
    pub fn new(from: &'a [Vector3<f64>], to: &'a [Vector3<f64>]) -> Self {
        let largest = largest_coordinate(from).max(largest_coordinate(to));
        let means = [mean(from), mean(to)];
        let excursions = excursions(from, to, subtract(means[1], means[0]));
        Self { from, to, means, excursions, rounding: ROUNDING * largest }
    }

    /// Whether all positions are finite. Their means are then finite too, unless some are close to the largest number.
    pub fn is_finite(&self) -> bool {
        self.means.as_flattened().iter().all(|coordinate| coordinate.is_finite())
    }

    /// Returns the positions after a part of the way.
    pub fn after(&self, part: f64) -> Vec<Vector3<f64>> {
        self.from.iter().zip(self.to).map(|(from, to)| add_scaled(*from, part, subtract(*to, *from))).collect()
    }

    /// The largest of the excursions.
    pub fn longest(&self) -> f64 {
        self.excursions.iter().copied().fold(0.0, f64::max)
    }

    /// Whether a pair with this separation at the start certainly stays out of reach.
    #[inline]
    pub fn stays_beyond(&self, reach: f64, pair: &Pair, separation: f64) -> bool {
        separation - pair.approach(&self.excursions) > reach + self.rounding
    }

    /// A lower bound of the separation of a pair at the end, from one at the start.
    #[inline]
    pub fn least_separation(&self, pair: &Pair, separation: f64) -> f64 {
        separation - pair.approach(&self.excursions) - self.rounding
    }

    /// A separation at the start beyond which no pair that approaches by this much comes within reach.
    pub fn beyond(&self, reach: f64, approach: f64) -> f64 {
        // The rounding of a sum and a difference.
        reach + approach + 2.0 * self.rounding
    }

    /// Returns a part of the move during which the pair certainly keeps its clearance: 1 for the whole move. The result
    /// is exact enough if it is at least `wanted`; the search then stops early.
    pub fn safe_part(&self, pair: &Pair, clearance: Clearance, wanted: f64) -> f64 {
        let (from, to) = (pair.corners(self.from), pair.corners(self.to));
        let level = self.level(Closest::of(pair, &from).distance, clearance.thickness, clearance.reach);
        if clearance.is_plane {
            return plane::safe_part(&from, &to, level);
        }
        self.advance(pair, &from, &to, level, wanted)
    }

    /// The level ℓ of pairs at a distance, including rounding errors. Pairs within their thickness must not come closer
    /// by more than a tenth.
    #[inline(always)]
    pub fn level<V: Real>(&self, distance: V, thickness: V, reach: V) -> V {
        let number = V::from_f64;
        let beyond = thickness + number(KEPT) * (distance - thickness);
        let kept = V::select(thickness.less(distance), beyond, number(1.0 - KEPT) * distance);
        // Out of reach, nothing needs to be kept.
        kept.min(reach) + number(self.rounding)
    }

    fn advance(&self, pair: &Pair, from: &[Vector3<f64>; 4], to: &[Vector3<f64>; 4], level: f64, wanted: f64) -> f64 {
        let first = pair.first();
        let velocities: [Vector3<f64>; 4] = std::array::from_fn(|corner| subtract(to[corner], from[corner]));
        let mut time = 0.0;
        for _ in 0..ADVANCES {
            let here = std::array::from_fn(|corner| add_scaled(from[corner], time, velocities[corner]));
            let normal = Closest::of(pair, &here).normal;
            let gained = safe_time(normal, &here, &velocities, first, level);
            let next = time + gained;
            if next >= 1.0 {
                return 1.0;
            }
            if next >= wanted || gained <= GAIN * time {
                return next;
            }
            if gained.is_nan() {
                return time;
            }
            time = next;
        }
        time
    }
}

/// How long n keeps the features apart by the level at these velocities. 0 if it does not do so now.
fn safe_time(
    n: Vector3<f64>,
    corners: &[Vector3<f64>; 4],
    velocities: &[Vector3<f64>; 4],
    first: usize,
    level: f64,
) -> f64 {
    let mut time = f64::INFINITY;
    for a in 0..first {
        for b in first..4 {
            let beyond = dot(n, subtract(corners[a], corners[b])) - level;
            let rate = dot(n, subtract(velocities[a], velocities[b]));
            // False for NaN.
            let separates = beyond > 0.0;
            if !separates {
                return 0.0;
            }
            if rate < 0.0 {
                time = time.min(beyond / -rate);
            }
        }
    }
    time
}
