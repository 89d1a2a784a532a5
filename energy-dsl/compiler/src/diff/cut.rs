//! Second derivatives gathered at a cut. If everything that moves enters U through a few robust primitives c, then ∇²U
//! = Σ ∂U/∂c ∇²c + Σ (Σ ∂²U/∂c∂c′ ∇c′) ∇cᵀ. There are few derivatives with respect to c, and each ∇c appears in one
//! outer product.

use std::collections::{BTreeMap, BTreeSet};

use super::adjoint::{self, Weighted};
use super::coordinates::Coordinates;
use super::forward::{self, Sparse, combine, tangents};
use super::local::Order;
use super::{accumulate, differentiable};
use crate::graph::{Graph, NodeId, Op};

/// ∇U, and the upper triangle of ∇²U by index.
pub(super) type Derivatives = (Vec<NodeId>, BTreeMap<usize, NodeId>);

/// Returns the derivatives through the primitives closest to the coordinates; `None` if these are not a cut, or bring
/// no gain.
pub(super) fn derivatives(g: &mut Graph, output: NodeId, coordinates: &Coordinates) -> Option<Derivatives> {
    let cut = primitives_by_coordinates(g, output, coordinates)?;
    let n = coordinates.len();
    let (slopes, curvatures) = by_cut(g, output, &cut);
    let weights: Weighted = cut.iter().copied().zip(slopes).collect();
    let gradient = adjoint::gradient(g, &weights, coordinates, Order::Second)?;
    let mut hessian = adjoint::second_derivatives(g, &weights, coordinates)?;

    let tangents = tangents(g, &cut, coordinates, Order::Second);
    let none = Sparse::new();
    let m = cut.len();
    for (row, node) in cut.iter().enumerate() {
        let terms: Vec<(NodeId, &Sparse)> = (0..m)
            .filter_map(|column| {
                let factor = *curvatures.get(&(row.min(column) * m + row.max(column)))?;
                Some((factor, tangents.get(&cut[column])?))
            })
            .collect();
        let weighted = combine(g, &terms);
        for &(i, x) in &weighted {
            for &(j, y) in tangents.get(node).unwrap_or(&none) {
                if i <= j {
                    let term = g.mul(x, y);
                    accumulate(g, &mut hessian, i * n + j, term);
                }
            }
        }
    }
    Some((gradient, hessian))
}

/// Returns the first and second derivatives of U with respect to the nodes of the cut.
fn by_cut(g: &mut Graph, output: NodeId, cut: &[NodeId]) -> (Vec<NodeId>, BTreeMap<usize, NodeId>) {
    let coordinates = Coordinates::of_nodes(g, cut);
    let whole = adjoint::alone(g, output);
    let slopes = match adjoint::gradient(g, &whole, &coordinates, Order::Second) {
        Some(slopes) => slopes,
        None => forward::first_derivatives(g, &[output], &coordinates, Order::First).remove(0),
    };
    let curvatures = match adjoint::second_derivatives(g, &whole, &coordinates) {
        Some(curvatures) => curvatures,
        None => forward::second_derivatives(g, output, &coordinates),
    };
    (slopes, curvatures)
}

/// Returns the robust primitives that depend on no other one, if every path from the coordinates to U leads through
/// them.
fn primitives_by_coordinates(g: &Graph, output: NodeId, coordinates: &Coordinates) -> Option<Vec<NodeId>> {
    let nodes = differentiable(g, &[output], Order::Second);
    // Nodes that depend on some primitive.
    let mut above: BTreeSet<NodeId> = BTreeSet::new();
    let mut cut = Vec::new();
    for &node in &nodes {
        let operands: Vec<NodeId> = match g.rule(node) {
            Some(rule) if rule.second.is_some() => rule.arguments.clone(),
            Some(_) => return None,
            None => g.op(node).operands().collect(),
        };
        let fed = operands.iter().any(|o| above.contains(o));
        if matches!(g.op(node), Op::Rule(_)) && !fed {
            cut.push(node);
        }
        if fed || matches!(g.op(node), Op::Rule(_)) {
            above.insert(node);
        }
    }
    // A path around the primitives ends in a node above them that also reads a node below.
    let bypassed = nodes.iter().filter(|&&node| above.contains(&node) && !cut.contains(&node)).any(|&node| {
        let operands: Vec<NodeId> = match g.rule(node) {
            Some(rule) => rule.arguments.clone(),
            None => match g.op(node) {
                Op::Select(_, yes, no) => vec![yes, no],
                op => op.operands().collect(),
            },
        };
        operands.into_iter().any(|o| g.varies(o) && !above.contains(&o))
    });
    let gains = cut.len() > 1 && cut.len() <= coordinates.len() && !cut.contains(&output);
    (above.contains(&output) && !bypassed && gains).then_some(cut)
}
