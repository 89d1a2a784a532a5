use std::collections::BTreeMap;

use super::differentiable;
use super::forward::Sparse;
use super::local::Order;
use crate::graph::{Graph, Input, NodeId, Op};

/// The inputs that derivatives are taken with respect to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moving {
    /// Positions of points, or unknowns.
    Positions,
    /// Velocities of points.
    Velocities,
}

/// Reduced coordinates: a forest over the points whose edges are the differences that the formula forms. A point used
/// outside of a difference is connected to the ground, so a forest without ground proves translation invariance.
#[derive(Clone, Debug)]
pub struct Coordinates {
    /// Dual parts (±1) of the nodes where differentiation starts.
    pub(super) seeds: BTreeMap<NodeId, Sparse>,
    /// Points of each coordinate vector, with signs. Coordinate c is component c % 3 of vector c / 3.
    pub vectors: Vec<Vec<(usize, bool)>>,
    /// Components of a vector.
    pub components: usize,
    /// Whether every point is used in differences only.
    pub translation_invariant: bool,
}

/// Index of the ground in the forest.
const GROUND: usize = usize::MAX;

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
        let vectors = (0..unknowns).map(|u| vec![(u, true)]).collect();
        Self { seeds, vectors, components: 1, translation_invariant: false }
    }

    /// Creates one coordinate for each node.
    pub fn of_nodes(g: &mut Graph, nodes: &[NodeId]) -> Self {
        let one = g.constant(1.0);
        let seeds = nodes.iter().enumerate().map(|(number, &node)| (node, vec![(number, one)])).collect();
        let vectors = (0..nodes.len()).map(|number| vec![(number, true)]).collect();
        Self { seeds, vectors, components: 1, translation_invariant: false }
    }

    /// Creates a single coordinate, the distance along a direction that is given in these coordinates.
    pub(super) fn along(&self, g: &mut Graph, direction: &[NodeId]) -> Self {
        let mut seeds = BTreeMap::new();
        for (&node, entries) in &self.seeds {
            let parts: Vec<_> = entries.iter().map(|&(c, sign)| g.mul(direction[c], sign)).collect();
            seeds.insert(node, vec![(0, g.sum(parts))]);
        }
        Self { seeds, vectors: vec![vec![(0, true)]], components: 1, translation_invariant: false }
    }

    /// Returns the rates of all coordinates, given the velocities of the points or any other direction.
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

    /// Finds the differences of points that `outputs` depend on.
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
        // Kruskal's algorithm: an edge that joins two trees is a coordinate vector.
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

/// Returns the edges from `from` to `to` in the forest, with directions: x_from − x_to = Σ ±(edge vectors).
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
