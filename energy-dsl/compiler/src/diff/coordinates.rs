use std::collections::BTreeMap;

use super::forward::Sparse;
use super::linear::{self, Front};
use super::weights::Sum;
use crate::graph::{Graph, Input, NodeId};

/// The inputs that derivatives are taken with respect to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moving {
    /// Positions of points, or unknowns.
    Positions,
    /// Velocities of points.
    Velocities,
}

/// Reduced coordinates: independent linear functions of the points through which the points enter the formula.
#[derive(Clone, Debug)]
pub struct Coordinates {
    /// Dual parts, constants, of the nodes where differentiation starts.
    pub(super) seeds: BTreeMap<NodeId, Sparse>,
    /// Points of each coordinate vector, with weights. Coordinate c is component c % 3 of vector c / 3.
    pub vectors: Vec<Vec<(usize, f64)>>,
    /// Components of a vector.
    pub components: usize,
    /// Whether no translation of all points changes the outputs.
    pub translation_invariant: bool,
}

impl Coordinates {
    /// Returns the number of coordinates.
    #[must_use]
    pub fn len(&self) -> usize {
        self.vectors.len() * self.components
    }

    /// Creates one coordinate for each unknown.
    pub fn of_unknowns(g: &mut Graph, unknowns: usize) -> Self {
        let one = g.constant(1.0);
        let seeds = (0..unknowns)
            .map(|u| (g.input(Input::Position(u16::try_from(u).expect("few unknowns"))), vec![(u, one)]))
            .collect();
        let vectors = (0..unknowns).map(|u| vec![(u, 1.0)]).collect();
        Self { seeds, vectors, components: 1, translation_invariant: false }
    }

    /// Creates one coordinate for each node.
    pub fn of_nodes(g: &mut Graph, nodes: &[NodeId]) -> Self {
        let one = g.constant(1.0);
        let seeds = nodes.iter().enumerate().map(|(number, &node)| (node, vec![(number, one)])).collect();
        let vectors = (0..nodes.len()).map(|number| vec![(number, 1.0)]).collect();
        Self { seeds, vectors, components: 1, translation_invariant: false }
    }

    /// Creates the coordinates of one point. Only these move.
    pub fn of_point(&self, g: &mut Graph, point: usize) -> Self {
        let mut seeds = BTreeMap::new();
        for (&node, entries) in &self.seeds {
            let mut weights = [0.0; 3];
            for &(coordinate, sign) in entries {
                let sign = g.as_constant(sign).expect("compiler bug: seeds are constants");
                let vector = &self.vectors[coordinate / self.components];
                let weight = vector.iter().filter(|(other, _)| *other == point).map(|(_, weight)| weight).sum::<f64>();
                weights[coordinate % self.components] += sign * weight;
            }
            let parts = weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
            let seed: Sparse = parts.map(|(axis, &weight)| (axis, g.constant(weight))).collect();
            if !seed.is_empty() {
                seeds.insert(node, seed);
            }
        }
        Self { seeds, vectors: vec![vec![(point, 1.0)]], components: 3, translation_invariant: false }
    }

    /// Creates a single coordinate, the distance along a direction that is given in these coordinates.
    pub(super) fn along(&self, g: &mut Graph, direction: &[NodeId]) -> Self {
        let mut seeds = BTreeMap::new();
        for (&node, entries) in &self.seeds {
            let parts: Vec<_> = entries.iter().map(|&(c, sign)| g.mul(direction[c], sign)).collect();
            seeds.insert(node, vec![(0, g.sum(parts))]);
        }
        Self { seeds, vectors: vec![vec![(0, 1.0)]], components: 1, translation_invariant: false }
    }

    /// Returns the rates of all coordinates, given the velocities of the points or any other direction.
    pub fn rates(&self, g: &mut Graph) -> Vec<NodeId> {
        let mut rates = Vec::with_capacity(self.len());
        for vector in &self.vectors {
            for axis in 0..self.components {
                let mut sum = g.constant(0.0);
                for &(point, weight) in vector {
                    let number = u16::try_from(self.components * point + axis).expect("few points");
                    let velocity = g.input(Input::Velocity(number));
                    sum = add_weighted(g, sum, weight, velocity);
                }
                rates.push(sum);
            }
        }
        rates
    }

    /// Finds the differences of points that `outputs` depend on, or fewer linear functions of the points.
    pub fn of_points(g: &mut Graph, outputs: &[NodeId], moving: Moving) -> Self {
        let differences = Front::of_differences(g, outputs, moving);
        let functions = Front::of_linear_functions(g, outputs, moving);
        let fewer = functions.filter(|functions| functions.span.basis.len() < differences.span.basis.len());
        let front = fewer.unwrap_or(differences);
        // Weights of points are at most 1, so that no derivative overflows as it is expanded to points.
        let scales: Vec<f64> = front.span.basis.iter().map(|sum| power_of_two_above(sum.largest()).max(1.0)).collect();
        let seed = |g: &mut Graph, axis: usize, sum: &Sum| -> Sparse {
            sum.iter().map(|(vector, weight)| (3 * vector + axis, g.constant(weight * scales[vector]))).collect()
        };
        let seeds = front.nodes.iter().map(|(&node, (axis, sum))| (node, seed(g, *axis, sum))).collect();
        let basis = &front.span.basis;
        let vectors = basis.iter().zip(&scales).map(|(sum, scale)| {
            let mut points: Vec<_> = sum.iter().map(|(point, weight)| (point, weight / scale)).collect();
            // A difference is written as such.
            points.sort_by(|(_, a), (_, b)| b.total_cmp(a));
            points
        });
        let translation_invariant = linear::is_translation_invariant(g, outputs, moving);
        Self { seeds, vectors: vectors.collect(), components: 3, translation_invariant }
    }
}

/// Returns the smallest power of two that is at least `x` > 0.
fn power_of_two_above(x: f64) -> f64 {
    x.log2().ceil().exp2()
}

/// Returns `sum + weight · term`.
pub(super) fn add_weighted(g: &mut Graph, sum: NodeId, weight: f64, term: NodeId) -> NodeId {
    let magnitude = g.constant(weight.abs());
    let term = g.mul(magnitude, term);
    if weight > 0.0 { g.add(sum, term) } else { g.sub(sum, term) }
}
