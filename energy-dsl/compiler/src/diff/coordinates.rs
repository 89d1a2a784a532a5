use std::collections::BTreeMap;

use super::forward::Sparse;
use super::linear::{self, Front};
use super::unknowns::{Axis, Moving, Unknown, Unknowns};
use super::weights::Sum;
use crate::graph::{Graph, Input, NodeId};
use energy_runtime::FieldKind;

/// Reduced coordinates: independent linear functions of the unknowns through which these enter the formula.
#[derive(Clone, Debug)]
pub struct Coordinates {
    /// Dual parts, constants, of the nodes where differentiation starts.
    pub(super) seeds: BTreeMap<NodeId, Sparse>,
    /// Unknowns of each coordinate vector, with weights.
    pub vectors: Vec<Vec<(usize, f64)>>,
    /// Number of the first coordinate of each vector, and then the number of all coordinates.
    starts: Vec<usize>,
    /// The unknowns that derivatives are expanded to.
    pub(super) unknowns: Vec<Unknown>,
    /// Whether no translation of all points changes the outputs.
    pub translation_invariant: bool,
}

impl Coordinates {
    /// Returns the number of coordinates.
    #[must_use]
    pub fn len(&self) -> usize {
        self.starts.last().copied().unwrap_or(0)
    }

    /// Returns the number of a component of a vector.
    pub(super) fn number(&self, vector: usize, axis: usize) -> usize {
        self.starts[vector] + axis
    }

    /// Returns the number of components of a vector.
    pub(super) fn components(&self, vector: usize) -> usize {
        self.starts[vector + 1] - self.starts[vector]
    }

    /// Returns the vector of a coordinate, and its component.
    fn place(&self, coordinate: usize) -> (usize, usize) {
        let vector = self.starts.partition_point(|&start| start <= coordinate) - 1;
        (vector, coordinate - self.starts[vector])
    }

    /// Creates coordinates that are single numbers.
    fn of_numbers(seeds: BTreeMap<NodeId, Sparse>, numbers: usize) -> Self {
        let unknown =
            |number| Unknown { increments: 1, first_increment: number, first_number: number, kind: FieldKind::Numbers };
        let vectors = (0..numbers).map(|number| vec![(number, 1.0)]).collect();
        let unknowns = (0..numbers).map(unknown).collect();
        Self { seeds, vectors, starts: (0..=numbers).collect(), unknowns, translation_invariant: false }
    }

    /// Creates one coordinate for each coordinate in which the unknowns move.
    pub fn of_unknowns(g: &mut Graph, unknowns: &Unknowns) -> Self {
        let nodes: Vec<NodeId> = unknowns.inputs().into_iter().map(|input| g.input(input)).collect();
        Self::of_nodes(g, &nodes)
    }

    /// Creates one coordinate for each node.
    pub fn of_nodes(g: &mut Graph, nodes: &[NodeId]) -> Self {
        let one = g.constant(1.0);
        let seeds = nodes.iter().enumerate().map(|(number, &node)| (node, vec![(number, one)])).collect();
        Self::of_numbers(seeds, nodes.len())
    }

    /// Creates the coordinates of one point. Only these move.
    pub fn of_point(&self, g: &mut Graph, point: usize) -> Self {
        let mut seeds = BTreeMap::new();
        for (&node, entries) in &self.seeds {
            let mut weights = [0.0; 3];
            for &(coordinate, sign) in entries {
                let sign = g.as_constant(sign).expect("compiler bug: seeds are constants");
                let (vector, axis) = self.place(coordinate);
                let parts = self.vectors[vector].iter().filter(|(other, _)| *other == point);
                weights[axis] += sign * parts.map(|(_, weight)| weight).sum::<f64>();
            }
            let parts = weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
            let seed: Sparse = parts.map(|(axis, &weight)| (axis, g.constant(weight))).collect();
            if !seed.is_empty() {
                seeds.insert(node, seed);
            }
        }
        let unknowns = self.unknowns.clone();
        Self { seeds, vectors: vec![vec![(point, 1.0)]], starts: vec![0, 3], unknowns, translation_invariant: false }
    }

    /// Creates a single coordinate, the distance along a direction that is given in these coordinates.
    pub(super) fn along(&self, g: &mut Graph, direction: &[NodeId]) -> Self {
        let mut seeds = BTreeMap::new();
        for (&node, entries) in &self.seeds {
            let parts: Vec<_> = entries.iter().map(|&(c, sign)| g.mul(direction[c], sign)).collect();
            seeds.insert(node, vec![(0, g.sum(parts))]);
        }
        Self::of_numbers(seeds, 1)
    }

    /// Returns the rates of all coordinates, given the velocities of the unknowns or any other direction.
    pub fn rates(&self, g: &mut Graph) -> Vec<NodeId> {
        let mut rates = Vec::with_capacity(self.len());
        for (number, vector) in self.vectors.iter().enumerate() {
            for axis in 0..self.components(number) {
                let mut sum = g.constant(0.0);
                for &(unknown, weight) in vector {
                    let increment = self.unknowns[unknown].first_increment + axis;
                    let velocity = g.input(Input::Velocity(u16::try_from(increment).expect("few unknowns")));
                    sum = add_weighted(g, sum, weight, velocity);
                }
                rates.push(sum);
            }
        }
        rates
    }

    /// Finds the differences of unknowns that `outputs` depend on, or fewer linear functions of them.
    pub fn reduced(g: &mut Graph, outputs: &[NodeId], unknowns: &Unknowns, moving: Moving) -> Self {
        let differences = Front::of_differences(g, outputs, unknowns, moving);
        let functions = Front::of_linear_functions(g, outputs, unknowns, moving);
        let fewer = functions.filter(|functions| functions.span.basis.len() < differences.span.basis.len());
        let front = fewer.unwrap_or(differences);
        Self::of_front(g, &front, outputs, unknowns, moving)
    }

    /// Finds the linear functions of unknowns that `outputs` depend on. `None` unless there are as many as differences, but
    /// other ones.
    pub fn of_as_many_functions(
        g: &mut Graph,
        outputs: &[NodeId],
        unknowns: &Unknowns,
        moving: Moving,
    ) -> Option<Self> {
        let differences = Front::of_differences(g, outputs, unknowns, moving);
        let functions = Front::of_linear_functions(g, outputs, unknowns, moving)?;
        let are_others = functions.nodes.keys().ne(differences.nodes.keys());
        let is_as_short = functions.span.basis.len() == differences.span.basis.len();
        (are_others && is_as_short).then(|| Self::of_front(g, &functions, outputs, unknowns, moving))
    }

    fn of_front(g: &mut Graph, front: &Front, outputs: &[NodeId], unknowns: &Unknowns, moving: Moving) -> Self {
        let basis = &front.span.basis;
        let mut starts = vec![0];
        for sum in basis {
            let (unknown, _) = sum.iter().next().expect("compiler bug: an independent sum is not 0");
            starts.push(starts[starts.len() - 1] + unknowns.list[unknown].increments);
        }
        // Weights of points are at most 1, so that no derivative overflows as it is expanded to points.
        let scales: Vec<f64> = basis.iter().map(|sum| power_of_two_above(sum.largest()).max(1.0)).collect();
        let seed = |g: &mut Graph, axis: Axis, sum: &Sum| -> Sparse {
            sum.iter()
                .map(|(vector, weight)| (starts[vector] + axis.number, g.constant(weight * scales[vector])))
                .collect()
        };
        let seeds = front.nodes.iter().map(|(&node, (axis, sum))| (node, seed(g, *axis, sum))).collect();
        let vectors = basis.iter().zip(&scales).map(|(sum, scale)| {
            let mut points: Vec<_> = sum.iter().map(|(point, weight)| (point, weight / scale)).collect();
            // A difference is written as such.
            points.sort_by(|(_, a), (_, b)| b.total_cmp(a));
            points
        });
        let translation_invariant = linear::is_translation_invariant(g, outputs, unknowns, moving);
        let (vectors, unknowns) = (vectors.collect(), unknowns.list.clone());
        Self { seeds, vectors, starts, unknowns, translation_invariant }
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
