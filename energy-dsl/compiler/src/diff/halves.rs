//! Derivatives of inner products in two halves, ∇(x·y) = Σ y ∇x + Σ x ∇y.
//!
//! A sum of outer products w ∇(x·y) ∇(x·y)ᵀ over the entries x·y of a matrix has products of equal halves and of different
//! ones. Apart from each other, they are products of sums: of C = FᵀF with F = D R, (FFᵀ)(RRᵀ) and (FRᵀ)(FRᵀ).

use std::collections::{BTreeMap, BTreeSet};

use super::coordinates::Coordinates;
use super::forward::Sparse;
use super::local::{Local, Order, local};
use super::outer_products::Summation;
use crate::graph::{Graph, NodeId, Op, Primitive};

/// The halves of a node's derivatives.
pub(super) type Halves = [Sparse; 2];

/// Returns the halves of inner products among the nodes, and of linear functions of them.
pub(super) fn halves(
    g: &mut Graph,
    nodes: &BTreeSet<NodeId>,
    tangents: &BTreeMap<NodeId, Sparse>,
    coordinates: &Coordinates,
    sums: &impl Summation,
) -> BTreeMap<NodeId, Halves> {
    let mut halves: BTreeMap<NodeId, Halves> = BTreeMap::new();
    for &node in nodes.iter().filter(|node| !coordinates.seeds.contains_key(node)) {
        let found = if is_inner_product(g, node) {
            let local = local(g, node, Order::Second);
            Some(of_inner_product(g, &local, tangents, sums))
        } else if is_linear(g, node) {
            let local = local(g, node, Order::Second);
            of_linear(g, &local, &halves, sums)
        } else {
            None
        };
        halves.extend(found.map(|found| (node, found)));
    }
    halves
}

pub(super) fn is_inner_product(g: &Graph, node: NodeId) -> bool {
    g.rule(node).is_some_and(|rule| rule.primitive == Primitive::InnerProduct)
}

fn is_linear(g: &Graph, node: NodeId) -> bool {
    match g.op(node) {
        Op::Add(..) | Op::Sub(..) | Op::Neg(_) => true,
        Op::Mul(a, b) => !(g.varies(a) && g.varies(b)),
        Op::Div(_, divisor) => !g.varies(divisor),
        _ => false,
    }
}

/// Returns the derivatives by x and by y. Of ½ x·x, both are half of x ∇x.
fn of_inner_product(
    g: &mut Graph,
    local: &Local,
    tangents: &BTreeMap<NodeId, Sparse>,
    sums: &impl Summation,
) -> Halves {
    let n = local.operands.len();
    let factors: Vec<NodeId> = local.first.iter().map(|factors| g.product(None, factors)).collect();
    let by = |g: &mut Graph, operands: &[NodeId], factors: &[NodeId]| {
        let pairs = operands.iter().zip(factors);
        let terms: Vec<_> = pairs.filter_map(|(operand, &factor)| Some((factor, tangents.get(operand)?))).collect();
        sums.combine(g, &terms)
    };
    let is_square = local.second.iter().all(|(i, j, _)| i == j);
    if is_square {
        let half = g.constant(0.5);
        let factors = g.scaled(half, &factors);
        let half = by(g, &local.operands, &factors);
        return [half.clone(), half];
    }
    let (x, y) = local.operands.split_at(n / 2);
    [by(g, x, &factors[..n / 2]), by(g, y, &factors[n / 2..])]
}

/// Returns the halves of a linear function; `None` if some operand has none.
fn of_linear(g: &mut Graph, local: &Local, known: &BTreeMap<NodeId, Halves>, sums: &impl Summation) -> Option<Halves> {
    let mut terms: Vec<(NodeId, &Halves)> = Vec::new();
    for (operand, factors) in local.operands.iter().zip(&local.first) {
        if g.varies(*operand) {
            terms.push((g.product(None, factors), known.get(operand)?));
        }
    }
    Some([0, 1].map(|half| {
        let terms: Vec<(NodeId, &Sparse)> = terms.iter().map(|(factor, halves)| (*factor, &halves[half])).collect();
        sums.combine(g, &terms)
    }))
}
