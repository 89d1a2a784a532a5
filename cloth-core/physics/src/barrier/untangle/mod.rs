//! Repairs a start in which cloth crosses itself or an obstacle a little.
//!
//! Two layers that cross have lost the order in which they lie. [`sides`] restores it: pairs of features that face each
//! other lie in the same order as their neighbours, and the larger pieces into which crossings cut the cloth decide.
//! Vertices then move along the normals, pair after pair, until each pair keeps its thickness in that order (position
//! based dynamics: Müller, Heidelberger, Hennix and Ratcliff 2007). Rest shapes do not change, so elastic forces undo
//! what these moves stretch.

mod sides;

use energy_dsl::Vector3;

use super::spacing::{Skin, Spacing, Spacings};
use super::start::{Participants, SKIN, TOUCHING, crossings_that_count};
use crate::collision::{Closest, Pair, Rules, Search};
use crate::contact::AnySolid;
use crate::geometry::{add_scaled, dot, norm, subtract};
use sides::{Facing, sides};

/// Sweeps over all close pairs, after which the repair is given up.
const SWEEPS: usize = 300;
/// The part of the activation gap that repaired pairs have.
const OPENING: f64 = 0.2;
/// The largest displacement of a vertex, over the largest thickness and gap. Deeper crossings have no certain order.
const SHALLOW: f64 = 3.0;
/// The part of the missing distance by which a pair is pushed. Neighbouring pairs push, too.
const RELAXATION: f64 = 0.5;
/// The distance over which the direction out of an obstacle is measured, over its reach.
const PROBE: f64 = 1e-3;

/// The start of a repair.
pub struct Untangling<'a> {
    /// The features that may collide.
    pub participants: &'a Participants,
    /// The obstacles at the start, in the order of [`Participants::obstacles`].
    pub solids: &'a [AnySolid],
    /// Whether each vertex may be moved.
    pub is_movable: Vec<bool>,
}

impl Untangling<'_> {
    /// Returns positions near x at which nothing crosses, and pairs keep their thickness. `None` if x has crossings
    /// that are too deep.
    pub fn repair(&self, x: &[Vector3<f64>]) -> Option<Vec<Vector3<f64>>> {
        let Participants { mesh, radii, gaps, obstacles, exclusions, with_itself, .. } = self.participants;
        let skin = |reach: f64, radius: f64| Skin { radius, thickness: SKIN * reach, gap: (1.0 - SKIN) * reach };
        let skins = obstacles.iter().map(|obstacle| skin(obstacle.reach, obstacle.radius)).collect();
        let spacings = Spacings { radii: radii.clone(), gaps: gaps.clone(), skins };
        let own = 2.0 * largest(radii) + largest(gaps);
        let reach = obstacles.iter().map(|obstacle| obstacle.reach).fold(own, f64::max);
        // A feature on the wrong side is at a distance equal to its depth.
        let halves = spacings.halves(mesh).iter().map(|half| half + 0.5 * reach).collect();
        let (is_free, exclusions) = (self.participants.is_free.clone(), exclusions.clone());
        let rules = Rules { halves, is_free, exclusions, with_itself: *with_itself };
        let mut search = Search::new(mesh, x, rules.clone());
        let mut now = x.to_vec();
        for _ in 0..SWEEPS {
            let pairs = search.pairs_at(mesh, &now);
            let close: Vec<_> = pairs.iter().map(|pair| (*pair, Closest::of(pair, &pair.corners(&now)))).collect();
            let crossings = crossings_that_count(mesh, &rules, &now);
            let is_apart = |(pair, closest): &(Pair, Closest)| closest.distance > self.least(&spacings, pair);
            if crossings.is_empty() && close.iter().all(is_apart) && !self.is_inside(&now) {
                return Some(now);
            }
            self.leave_obstacles(&mut now);
            let facings = sides(mesh, &now, &close, &crossings);
            self.part(&spacings, &close, &facings, &mut now);
            let is_far = |(from, to): (&Vector3<f64>, &Vector3<f64>)| norm(subtract(*from, *to)) > SHALLOW * reach;
            if x.iter().zip(&now).any(is_far) {
                return None;
            }
        }
        None
    }

    /// The distance above which a pair needs no repair, in m. Obstacles fit their skins to what starts near them.
    fn least(&self, spacings: &Spacings, pair: &Pair) -> f64 {
        match self.participants.mesh.obstacle_of(pair).map(|number| &self.participants.obstacles[number]) {
            Some(obstacle) => obstacle.radius + TOUCHING * obstacle.reach,
            None => spacings.of(&self.participants.mesh, pair).thickness,
        }
    }

    /// Whether a vertex that may be moved is inside an obstacle.
    fn is_inside(&self, x: &[Vector3<f64>]) -> bool {
        let movable = || x.iter().zip(&self.is_movable).filter(|(_, is_movable)| **is_movable);
        self.solids.iter().any(|solid| movable().any(|(x, _)| solid.signed_distance(*x) <= 0.0))
    }

    /// Moves vertices that are inside obstacles to their surface, and a little beyond.
    fn leave_obstacles(&self, x: &mut [Vector3<f64>]) {
        for (solid, start) in self.solids.iter().zip(&self.participants.obstacles) {
            let wanted = 2.0 * SKIN * start.reach;
            for (_, x) in x.iter_mut().enumerate().filter(|(vertex, _)| self.is_movable[*vertex]) {
                let missing = wanted - solid.signed_distance(*x);
                if missing > 0.0 {
                    *x = add_scaled(*x, missing, normalised(solid.outwards(*x, PROBE * start.reach)));
                }
            }
        }
    }

    /// Moves the vertices of one pair after the other, until it is apart in its order.
    fn part(&self, spacings: &Spacings, close: &[(Pair, Closest)], facings: &[Facing], x: &mut [Vector3<f64>]) {
        let mesh = &self.participants.mesh;
        let mut is_crossed = vec![false; x.len()];
        for Facing { pair, weights, across } in facings {
            let Spacing { thickness, gap } = spacings.of(mesh, pair);
            let apart = separation(pair, weights, across, x);
            if apart < 0.0 {
                pair.vertices.iter().for_each(|vertex| is_crossed[*vertex as usize] = true);
            }
            self.push(pair, weights, across, thickness + OPENING * gap - apart, x);
        }
        for (pair, closest) in close {
            // The distance of features on the wrong side must shrink first.
            if pair.vertices.iter().any(|vertex| is_crossed[*vertex as usize]) {
                continue;
            }
            let apart = separation(pair, &closest.weights, &closest.normal, x);
            let Spacing { thickness, gap } = spacings.of(mesh, pair);
            if closest.distance < thickness + OPENING * gap {
                self.push(pair, &closest.weights, &closest.normal, thickness + OPENING * gap - apart, x);
            }
        }
    }

    /// Moves the vertices of a pair apart by a distance along a unit vector, those that take a larger part in it more.
    fn push(&self, pair: &Pair, weights: &[f64; 4], across: &Vector3<f64>, by: f64, x: &mut [Vector3<f64>]) {
        let is_movable = pair.of(&self.is_movable);
        let weights: [f64; 4] = std::array::from_fn(|corner| f64::from(u8::from(is_movable[corner])) * weights[corner]);
        let square: f64 = weights.iter().map(|weight| weight * weight).sum();
        if by > 0.0 && square > 0.0 {
            pair.add(weights, across.map(|component| RELAXATION * by / square * component), x);
        }
    }
}

/// Σ cᵢ n·xᵢ, in m.
fn separation(pair: &Pair, weights: &[f64; 4], n: &Vector3<f64>, x: &[Vector3<f64>]) -> f64 {
    let corners = pair.corners(x);
    // Differences to one corner lose fewer digits.
    weights.iter().zip(&corners).map(|(weight, corner)| weight * dot(*n, subtract(*corner, corners[0]))).sum()
}

/// A unit vector along another one; zero if that is zero.
fn normalised(vector: Vector3<f64>) -> Vector3<f64> {
    let length = norm(vector);
    if length > 0.0 { vector.map(|component| component / length) } else { vector }
}

fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().copied().fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
