//! Reverse accumulation: derivatives flow back from the outputs.

use std::collections::BTreeMap;

use super::coordinates::Coordinates;
use super::forward::{Sparse, tangents, tangents_by};
use super::local::{Order, local};
use super::outer_products::Summation;
use super::{accumulate, differentiable};
use crate::graph::{Graph, NodeId, Op};

/// Nodes and their weights.
pub(super) type Weighted = BTreeMap<NodeId, NodeId>;

/// Combines Σ weight · output into one weighted node.
pub(super) fn alone(g: &mut Graph, output: NodeId) -> Weighted {
    BTreeMap::from([(output, g.constant(1.0))])
}

/// Returns the derivatives of Σ weight · output with respect to every node that the outputs depend on.
fn adjoints(g: &mut Graph, outputs: &Weighted, coordinates: &Coordinates, order: Order) -> Weighted {
    let mut adjoints = outputs.clone();
    let roots: Vec<NodeId> = outputs.keys().copied().collect();
    let nodes = differentiable(g, &roots, order);
    let contractions = g.contractions_of(|value| nodes.contains(&value) && !coordinates.seeds.contains_key(&value));
    for node in nodes.iter().copied().rev() {
        let contraction = contractions.iter().find(|contraction| contraction.values.contains(&node));
        if let Some((contraction, first)) = contraction.and_then(|known| Some((known, known.first?))) {
            // At the first of the values, the weights of all are known.
            if contraction.values.iter().find(|value| nodes.contains(value)) == Some(&node) {
                let weights = contraction.weights(g, |value| adjoints.get(&value).copied());
                for (&argument, slope) in contraction.arguments.iter().zip(first(g, &contraction.factors, &weights)) {
                    if g.varies(argument) {
                        accumulate(g, &mut adjoints, argument, slope);
                    }
                }
            }
            continue;
        }
        let Some(&weight) = adjoints.get(&node) else { continue };
        if coordinates.seeds.contains_key(&node) {
            continue;
        }
        let local = local(g, node, order);
        for (operand, first) in local.operands.into_iter().zip(local.first) {
            if !g.varies(operand) {
                continue;
            }
            let term = g.product(Some(weight), &first);
            accumulate(g, &mut adjoints, operand, term);
        }
    }
    adjoints
}

/// Returns whether reverse accumulation is right, on the ordinary path or everywhere. Through a selection it multiplies
/// the derivative of the unused branch, which may be infinite, by zero. It is right if the branch is known, or both are
/// constant (a sign).
pub(super) fn is_safe(g: &mut Graph, roots: &[NodeId], order: Order, everywhere: bool) -> bool {
    let nodes = differentiable(g, roots, order);
    nodes.into_iter().all(|node| match g.op(node) {
        Op::Select(_, yes, no) if !g.varies(yes) && !g.varies(no) => true,
        Op::Select(mask, ..) => !everywhere && g.is_decided(mask),
        Op::Min(..) | Op::Max(..) => false,
        _ => true,
    })
}

/// Returns Σ weight · ∇output by reverse accumulation; `None` if that is not safe on the ordinary path.
pub(super) fn gradient(
    g: &mut Graph,
    outputs: &Weighted,
    coordinates: &Coordinates,
    order: Order,
) -> Option<Vec<NodeId>> {
    let roots: Vec<NodeId> = outputs.keys().copied().collect();
    if !is_safe(g, &roots, order, false) {
        return None;
    }
    let adjoints = adjoints(g, outputs, coordinates, order);
    Some(gathered(g, &adjoints, coordinates))
}

/// Adds Σ weight · ∇²output to the sums. It is a sum over nodes v: the adjoint of v times Σ φ_ab ∇a ∇bᵀ, where φ are the
/// second derivatives of the operation at v. `None` if that is not safe on the ordinary path.
pub(super) fn second_derivatives<S: Summation>(
    g: &mut Graph,
    outputs: &Weighted,
    coordinates: &Coordinates,
    mut sums: S,
) -> Option<S> {
    let roots: Vec<NodeId> = outputs.keys().copied().collect();
    if !is_safe(g, &roots, Order::Second, false) {
        return None;
    }
    let nodes = differentiable(g, &roots, Order::Second);
    let tangents = tangents_by(g, &roots, coordinates, Order::Second, &sums);
    let adjoints = adjoints(g, outputs, coordinates, Order::Second);
    let none = Sparse::new();
    let contractions = g.contractions_of(|value| nodes.contains(&value) && !coordinates.seeds.contains_key(&value));
    for contraction in &contractions {
        let weights = contraction.weights(g, |value| adjoints.get(&value).copied());
        let entries = (contraction.second)(g, &contraction.factors, &weights);
        let of: Vec<&Sparse> = contraction.arguments.iter().map(|of| tangents.get(of).unwrap_or(&none)).collect();
        sums.next();
        sums.add_form(g, &entries, &of);
    }
    for node in nodes {
        let is_contracted = contractions.iter().any(|contraction| contraction.values.contains(&node));
        if coordinates.seeds.contains_key(&node) || is_contracted {
            continue;
        }
        let Some(&weight) = adjoints.get(&node) else { continue };
        let local = local(g, node, Order::Second);
        sums.next();
        for (i, j, products_of) in local.second {
            let a = tangents.get(&local.operands[i]).unwrap_or(&none);
            let b = tangents.get(&local.operands[j]).unwrap_or(&none);
            let weight = g.sum_of_products(Some(weight), &products_of);
            sums.add(g, weight, (a, b), i == j);
        }
    }
    Some(sums)
}

/// Returns ∇²output · w by second-order reverse accumulation: with each adjoint flows its derivative along w. The
/// direction w is given by its dual part in every coordinate. `None` if that is not safe on the ordinary path.
pub(super) fn hessian_vector(
    g: &mut Graph,
    output: NodeId,
    coordinates: &Coordinates,
    direction: &[NodeId],
) -> Option<Vec<NodeId>> {
    if !is_safe(g, &[output], Order::Second, false) {
        return None;
    }
    let along = coordinates.along(g, direction);
    let rates = tangents(g, &[output], &along, Order::Second);
    let rate = |node: &NodeId| rates.get(node).and_then(|parts| parts.first()).map(|&(_, part)| part);
    let whole = alone(g, output);
    let adjoints = adjoints(g, &whole, coordinates, Order::Second);
    let mut turning: Weighted = BTreeMap::new();
    for node in differentiable(g, &[output], Order::Second).into_iter().rev() {
        if coordinates.seeds.contains_key(&node) {
            continue;
        }
        let Some(&weight) = adjoints.get(&node) else { continue };
        let local = local(g, node, Order::Second);
        for (i, j, products_of) in &local.second {
            let (a, b) = (local.operands[*i], local.operands[*j]);
            let factor = g.sum_of_products(Some(weight), products_of);
            if let Some(rate) = rate(&b) {
                let term = g.mul(factor, rate);
                accumulate(g, &mut turning, a, term);
            }
            if i != j
                && let Some(rate) = rate(&a)
            {
                let term = g.mul(factor, rate);
                accumulate(g, &mut turning, b, term);
            }
        }
        if let Some(&own) = turning.get(&node) {
            for (operand, first) in local.operands.into_iter().zip(local.first) {
                if g.varies(operand) {
                    let term = g.product(Some(own), &first);
                    accumulate(g, &mut turning, operand, term);
                }
            }
        }
    }
    Some(gathered(g, &turning, coordinates))
}

/// Collects what flowed back to the seeds, by coordinate.
fn gathered(g: &mut Graph, adjoints: &Weighted, coordinates: &Coordinates) -> Vec<NodeId> {
    let mut sums = vec![g.constant(0.0); coordinates.len()];
    for (node, seeds) in &coordinates.seeds {
        let Some(&weight) = adjoints.get(node) else { continue };
        for &(c, sign) in seeds {
            let term = g.mul(weight, sign);
            sums[c] = g.add(sums[c], term);
        }
    }
    sums
}
