//! Derivatives that flow back from the outputs.

use std::collections::BTreeMap;

use super::coordinates::Coordinates;
use super::differentiable;
use super::forward::{Sparse, products, tangents};
use super::local::local;
use crate::graph::{Graph, NodeId, Op};

/// Nodes and what each is weighed by.
pub(super) type Weighted = BTreeMap<NodeId, NodeId>;

/// Σ weight · output as one weighted node.
pub(super) fn alone(g: &mut Graph, output: NodeId) -> Weighted {
    BTreeMap::from([(output, g.constant(1.0))])
}

/// Derivatives of Σ weight · output by every node the outputs are made of.
fn adjoints(g: &mut Graph, outputs: &Weighted, coordinates: &Coordinates, second_order: bool) -> Weighted {
    let mut adjoints = outputs.clone();
    let roots: Vec<NodeId> = outputs.keys().copied().collect();
    for node in differentiable(g, &roots, second_order).into_iter().rev() {
        let Some(&weight) = adjoints.get(&node) else { continue };
        if coordinates.seeds.contains_key(&node) {
            continue;
        }
        let local = local(g, node, second_order);
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

/// Whether reverse accumulation is right, on the ordinary path or everywhere. Through a selection it multiplies the derivative of
/// the other branch, which may be infinite, by zero; unless it is known which branch is taken.
pub(super) fn is_safe(g: &mut Graph, roots: &[NodeId], second_order: bool, everywhere: bool) -> bool {
    let nodes = differentiable(g, roots, second_order);
    nodes.into_iter().all(|node| match g.op(node) {
        Op::Select(mask, ..) => !everywhere && g.is_decided(mask),
        Op::Min(..) | Op::Max(..) => false,
        _ => true,
    })
}

/// Σ weight · ∇output by reverse accumulation. `None` where it is not safe on the ordinary path.
pub(super) fn gradient(
    g: &mut Graph,
    outputs: &Weighted,
    coordinates: &Coordinates,
    second_order: bool,
) -> Option<Vec<NodeId>> {
    let roots: Vec<NodeId> = outputs.keys().copied().collect();
    if !is_safe(g, &roots, second_order, false) {
        return None;
    }
    let adjoints = adjoints(g, outputs, coordinates, second_order);
    let mut gradient = vec![g.constant(0.0); coordinates.len()];
    for (node, seeds) in &coordinates.seeds {
        let Some(&weight) = adjoints.get(node) else { continue };
        for &(c, sign) in seeds {
            let term = g.mul(weight, sign);
            gradient[c] = g.add(gradient[c], term);
        }
    }
    Some(gradient)
}

/// Σ weight · ∇²output = Σ over nodes v of the adjoint of v times Σ φ_ab ∇a ∇bᵀ, φ the node's own second derivatives. `None` where
/// it is not safe on the ordinary path.
pub(super) fn second_derivatives(
    g: &mut Graph,
    outputs: &Weighted,
    coordinates: &Coordinates,
) -> Option<BTreeMap<usize, NodeId>> {
    let roots: Vec<NodeId> = outputs.keys().copied().collect();
    if !is_safe(g, &roots, true, false) {
        return None;
    }
    let nodes = differentiable(g, &roots, true);
    let n = coordinates.len();
    let tangents = tangents(g, &roots, coordinates, true);
    let adjoints = adjoints(g, outputs, coordinates, true);
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
