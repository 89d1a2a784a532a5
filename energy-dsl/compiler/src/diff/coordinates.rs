use std::collections::BTreeMap;

use super::differentiable;
use super::forward::Sparse;
use super::local::Order;
use crate::graph::{Graph, Input, NodeId, Op};

/// What the derivatives are taken by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moving {
    /// Positions.
    Positions,
    /// Velocities.
    Velocities,
}

/// Reduced coordinates: a forest over the points whose edges are the differences that the formula forms. A point used by
/// itself hangs on the ground, so a tree without ground proves translation invariance.
#[derive(Clone, Debug)]
pub struct Coordinates {
    /// Dual parts (±1) of the nodes that differentiation starts from.
    pub(super) seeds: BTreeMap<NodeId, Sparse>,
    /// Of each coordinate vector: the points it is made of, with sign. Coordinate c is component c % 3 of vector c / 3.
    pub vectors: Vec<Vec<(usize, bool)>>,
    /// How many numbers one vector has.
    pub components: usize,
    /// Whether no point is used by itself.
    pub translation_invariant: bool,
}

/// The ground's number in the forest.
const GROUND: usize = usize::MAX;

impl Coordinates {
    /// The number of coordinates.
    #[must_use]
    pub fn len(&self) -> usize {
        self.vectors.len() * self.components
    }

    /// Each of `unknowns` numbers is its own coordinate.
    pub fn of_unknowns(g: &mut Graph, unknowns: usize) -> Self {
        let one = g.constant(1.0);
        let seeds = (0..unknowns)
            .map(|u| (g.input(Input::Position(u16::try_from(u).expect("few unknowns"))), vec![(u, one)]))
            .collect();
        let vectors = (0..unknowns).map(|u| vec![(u, true)]).collect();
        Self { seeds, vectors, components: 1, translation_invariant: false }
    }

    /// Each of `nodes` is its own coordinate.
    pub(super) fn of_nodes(g: &mut Graph, nodes: &[NodeId]) -> Self {
        let one = g.constant(1.0);
        let seeds = nodes.iter().enumerate().map(|(number, &node)| (node, vec![(number, one)])).collect();
        let vectors = (0..nodes.len()).map(|number| vec![(number, true)]).collect();
        Self { seeds, vectors, components: 1, translation_invariant: false }
    }

    /// One coordinate only: the distance along a direction, given by its part in each of these coordinates.
    pub(super) fn along(&self, g: &mut Graph, direction: &[NodeId]) -> Self {
        let mut seeds = BTreeMap::new();
        for (&node, entries) in &self.seeds {
            let parts: Vec<_> = entries.iter().map(|&(c, sign)| g.mul(direction[c], sign)).collect();
            seeds.insert(node, vec![(0, g.sum(parts))]);
        }
        Self { seeds, vectors: vec![vec![(0, true)]], components: 1, translation_invariant: false }
    }

    /// The derivative of each coordinate by time, of the points' velocities (or along any other direction).
    pub fn rates(&self, g: &mut Graph) -> Vec<NodeId> {
        let mut rates = Vec::with_capacity(self.len());
        for vector in &self.vectors {
            for axis in 0..self.components {
                let mut sum = g.constant(0.0);
                for &(point, positive) in vector {
                    let number = u16::try_from(self.components * point + axis).expect("few points");
                    let velocity = g.input(Input::Velocity(number));
                    sum = if positive { g.add(sum, velocity) } else { g.sub(sum, velocity) };
                }
                rates.push(sum);
            }
        }
        rates
    }

    /// Finds the differences of points through which `outputs` see them.
    pub fn of_points(g: &mut Graph, outputs: &[NodeId], moving: Moving) -> Self {
        let coordinate = |g: &Graph, node: NodeId| match (g.op(node), moving) {
            (Op::Input(Input::Position(c)), Moving::Positions)
            | (Op::Input(Input::Velocity(c)), Moving::Velocities) => Some((usize::from(c) / 3, usize::from(c) % 3)),
            _ => None,
        };
        let mut used: Vec<(usize, usize)> = Vec::new();
        let mut fronts: Vec<(NodeId, usize, usize, usize)> = Vec::new();
        let mut use_edge = |from: usize, to: usize| {
            if !used.contains(&(from, to)) {
                used.push((from, to));
            }
        };
        for &output in outputs {
            if let Some((point, axis)) = coordinate(g, output) {
                use_edge(point, GROUND);
                fronts.push((output, point, GROUND, axis));
            }
        }
        for node in differentiable(g, outputs, Order::Second) {
            if let Op::Sub(a, b) = g.op(node)
                && let (Some((p, axis)), Some((q, other))) = (coordinate(g, a), coordinate(g, b))
                && axis == other
            {
                use_edge(p, q);
                fronts.push((node, p, q, axis));
                continue;
            }
            let operands: Vec<NodeId> = match g.rule(node) {
                Some(rule) => rule.arguments.clone(),
                None => g.op(node).operands().collect(),
            };
            for operand in operands {
                if let Some((point, axis)) = coordinate(g, operand) {
                    use_edge(point, GROUND);
                    fronts.push((operand, point, GROUND, axis));
                }
            }
        }
        Self::from_differences(g, &used, &fronts)
    }

    fn from_differences(g: &mut Graph, used: &[(usize, usize)], fronts: &[(NodeId, usize, usize, usize)]) -> Self {
        // Kruskal: an edge that joins two trees is a coordinate vector.
        let mut trees: Vec<Vec<usize>> = Vec::new();
        let mut vectors: Vec<(usize, usize)> = Vec::new();
        for &(from, to) in used {
            let find = |trees: &[Vec<usize>], point| trees.iter().position(|t| t.contains(&point));
            match (find(&trees, from), find(&trees, to)) {
                (Some(a), Some(b)) if a == b => continue,
                (Some(a), Some(b)) => {
                    let merged = trees.remove(a.max(b));
                    trees[a.min(b)].extend(merged);
                }
                (Some(a), None) => trees[a].push(to),
                (None, Some(b)) => trees[b].push(from),
                (None, None) => trees.push(vec![from, to]),
            }
            vectors.push((from, to));
        }
        let mut seeds = BTreeMap::new();
        for &(node, from, to, axis) in fronts {
            let path = path(&vectors, from, to);
            let mut entries: Sparse = path
                .into_iter()
                .map(|(v, forward)| (3 * v + axis, g.constant(if forward { 1.0 } else { -1.0 })))
                .collect();
            entries.sort_unstable();
            seeds.insert(node, entries);
        }
        let translation_invariant = used.iter().all(|&(_, to)| to != GROUND);
        let vectors = vectors
            .into_iter()
            .map(|(from, to)| {
                let mut ends = vec![(from, true)];
                if to != GROUND {
                    ends.push((to, false));
                }
                ends
            })
            .collect();
        Self { seeds, vectors, components: 3, translation_invariant }
    }
}

/// The edges from `from` to `to` in the forest, with the sense they are walked in: x_from − x_to = Σ ±(edge vectors).
fn path(edges: &[(usize, usize)], from: usize, to: usize) -> Vec<(usize, bool)> {
    fn walk(
        edges: &[(usize, usize)],
        at: usize,
        to: usize,
        came: Option<usize>,
        trail: &mut Vec<(usize, bool)>,
    ) -> bool {
        if at == to {
            return true;
        }
        for (number, &(a, b)) in edges.iter().enumerate() {
            let next = match (a == at, b == at) {
                (true, _) => b,
                (_, true) => a,
                _ => continue,
            };
            if came == Some(number) {
                continue;
            }
            trail.push((number, a == at));
            if walk(edges, next, to, Some(number), trail) {
                return true;
            }
            trail.pop();
        }
        false
    }
    let mut trail = Vec::new();
    let found = walk(edges, from, to, None, &mut trail);
    assert!(found, "compiler bug: the forest spans every difference it was built from");
    trail
}
