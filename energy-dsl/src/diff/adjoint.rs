use std::collections::BTreeMap;

use super::coordinates::Coordinates;
use super::differentiable;
use super::forward::{Sparse, products, tangents};
use super::local::local;
use crate::graph::{Graph, NodeId, Op};

/// Derivatives of the output by every node it is made of.
fn adjoints(g: &mut Graph, output: NodeId, coordinates: &Coordinates) -> BTreeMap<NodeId, NodeId> {
    let mut adjoints = BTreeMap::new();
    adjoints.insert(output, g.constant(1.0));
    for node in differentiable(g, &[output], true).into_iter().rev() {
        let Some(&weight) = adjoints.get(&node) else { continue };
        if coordinates.seeds.contains_key(&node) {
            continue;
        }
        let local = local(g, node, true);
        for (operand, first) in local.operands.into_iter().zip(local.first) {
            if !g.varies(operand) {
                continue;
            }
            let term = g.product(Some(weight), &first);
            let sum = match adjoints.get(&operand) {
                Some(&sum) => g.add(sum, term),
                None => term,
            };
            adjoints.insert(operand, sum);
        }
    }
    adjoints
}

/// ∇U by reverse accumulation.
pub(super) fn gradient(g: &mut Graph, output: NodeId, coordinates: &Coordinates) -> Vec<NodeId> {
    let adjoints = adjoints(g, output, coordinates);
    let mut gradient = vec![g.constant(0.0); coordinates.len()];
    for (node, seeds) in &coordinates.seeds {
        let Some(&weight) = adjoints.get(node) else { continue };
        for &(c, sign) in seeds {
            let term = g.mul(weight, sign);
            gradient[c] = g.add(gradient[c], term);
        }
    }
    gradient
}

/// ∇²U = Σ over nodes v of ∂U/∂v Σ φ_ab ∇a ∇bᵀ, φ the node's own second derivatives. `None` where a selection could
/// multiply an infinite branch by zero.
pub(super) fn second_derivatives(
    g: &mut Graph,
    output: NodeId,
    coordinates: &Coordinates,
) -> Option<BTreeMap<usize, NodeId>> {
    let nodes = differentiable(g, &[output], true);
    if nodes.iter().any(|&node| matches!(g.op(node), Op::Select(..) | Op::Min(..) | Op::Max(..))) {
        return None;
    }
    let n = coordinates.len();
    let tangents = tangents(g, &[output], coordinates, true);
    let adjoints = adjoints(g, output, coordinates);
    let mut hessian: BTreeMap<usize, NodeId> = BTreeMap::new();
    let none = Sparse::new();
    for node in nodes {
        if coordinates.seeds.contains_key(&node) {
            continue;
        }
        let Some(&weight) = adjoints.get(&node) else { continue };
        let local = local(g, node, true);
        for (i, j, products_of) in local.second {
            let a = tangents.get(&local.operands[i]).unwrap_or(&none);
            let b = tangents.get(&local.operands[j]).unwrap_or(&none);
            let weight = g.sum_of_products(Some(weight), &products_of);
            // The weight goes into the shorter factor, which is multiplied least often.
            let (shorter, longer) = if a.len() <= b.len() { (a, b) } else { (b, a) };
            let weighted: Sparse = shorter.iter().map(|&(c, part)| (c, g.mul(weight, part))).collect();
            let terms = products(g, &weighted, longer, i == j, n);
            for (place, term) in terms {
                let sum = match hessian.get(&place) {
                    Some(&sum) => g.add(sum, term),
                    None => term,
                };
                hessian.insert(place, sum);
            }
        }
    }
    Some(hessian)
}
