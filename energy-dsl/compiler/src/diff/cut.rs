//! Second derivatives gathered at a cut. If everything that moves enters U through a few numbers c, then ∇²U = Σ ∂U/∂c
//! ∇²c + Σ (Σ ∂²U/∂c∂c′ ∇c′) ∇cᵀ. There are few derivatives with respect to c, and each ∇c appears in one outer product.
//! The numbers are robust primitives, or the nodes of a narrow part of the graph.

use std::collections::{BTreeMap, BTreeSet};

use super::adjoint::{self, Weighted};
use super::coordinates::Coordinates;
use super::forward::{self, Sparse, combine, tangents};
use super::local::Order;
use super::{accumulate, differentiable, moving_operands};
use crate::graph::{Graph, NodeId, Op, count, ordinary};

/// The fewest nodes of a cut above which other cuts are looked for.
const NESTED: usize = 3;

/// Derivatives gathered at a cut.
pub(super) struct Gathered {
    /// ∇U.
    pub(super) gradient: Vec<NodeId>,
    /// The upper triangle of ∇²U by index.
    pub(super) hessian: BTreeMap<usize, NodeId>,
    /// Whether they are right everywhere, not only on the ordinary path.
    pub(super) safe: bool,
}

/// Returns the derivatives through the nodes of a cut; `None` if that is not right on the ordinary path.
pub(super) fn derivatives(
    g: &mut Graph,
    output: NodeId,
    cut: &[NodeId],
    coordinates: &Coordinates,
) -> Option<Gathered> {
    let n = coordinates.len();
    let Gathered { gradient: slopes, hessian: curvatures, safe } = by_cut(g, output, cut);
    let safe = safe && adjoint::is_safe(g, cut, Order::Second, true);
    let weights: Weighted = cut.iter().copied().zip(slopes).collect();
    let gradient = adjoint::gradient(g, &weights, coordinates, Order::Second)?;
    let mut hessian = adjoint::second_derivatives(g, &weights, coordinates)?;

    let tangents = tangents(g, cut, coordinates, Order::Second);
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
    Some(Gathered { gradient, hessian, safe })
}

/// Returns the derivatives of U with respect to the nodes of the cut. They may be gathered at a cut above.
fn by_cut(g: &mut Graph, output: NodeId, cut: &[NodeId]) -> Gathered {
    let coordinates = Coordinates::of_nodes(g, cut);
    let whole = adjoint::alone(g, output);
    let slopes = adjoint::gradient(g, &whole, &coordinates, Order::Second);
    let curvatures = adjoint::second_derivatives(g, &whole, &coordinates);
    let mut best = match (slopes, curvatures) {
        (Some(gradient), Some(hessian)) => {
            Gathered { gradient, hessian, safe: adjoint::is_safe(g, &[output], Order::Second, true) }
        }
        _ => {
            let gradient = forward::first_derivatives(g, &[output], &coordinates, Order::First).remove(0);
            Gathered { gradient, hessian: forward::second_derivatives(g, output, &coordinates), safe: true }
        }
    };
    if cut.len() < NESTED {
        return best;
    }
    for waist in waists(g, output, &coordinates) {
        if let Some(found) = derivatives(g, output, &waist, &coordinates)
            && found.cost(g) < best.cost(g)
        {
            best = found;
        }
    }
    best
}

impl Gathered {
    fn cost(&self, g: &mut Graph) -> usize {
        let nodes: Vec<NodeId> = self.gradient.iter().chain(self.hessian.values()).copied().collect();
        ordinary(g, &nodes).map_or_else(|| count(g, &nodes), |(nodes, _)| count(g, &nodes)).cost()
    }
}

/// Returns the linear functions of the coordinates that U is computed from, if they are fewer than the coordinates.
fn linear_front(g: &Graph, output: NodeId, coordinates: &Coordinates) -> Option<Vec<NodeId>> {
    let mut linear: BTreeSet<NodeId> = BTreeSet::new();
    let mut front: BTreeSet<NodeId> = BTreeSet::new();
    for node in differentiable(g, &[output], Order::Second) {
        let operands = moving_operands(g, node, Order::Second);
        let moving = || operands.iter().filter(|&&operand| g.varies(operand));
        let is_linear = match g.op(node) {
            Op::Add(..) | Op::Sub(..) | Op::Neg(_) => true,
            Op::Mul(a, b) => !(g.varies(a) && g.varies(b)),
            Op::Div(_, divisor) => !g.varies(divisor),
            _ => false,
        };
        if coordinates.seeds.contains_key(&node) || is_linear && moving().all(|operand| linear.contains(operand)) {
            linear.insert(node);
        } else {
            front.extend(moving().filter(|operand| linear.contains(operand)));
        }
    }
    let is_inner = front.iter().any(|node| !coordinates.seeds.contains_key(node));
    (is_inner && front.len() > 1 && front.len() <= coordinates.len()).then(|| front.into_iter().collect())
}

/// Returns the narrowest parts of the graph between the coordinates and U, of those that are closest to the coordinates:
/// one node, several, and linear functions of the coordinates.
///
/// Each node of a front is replaced by its operands, the last node first, so that any front is a cut.
pub(super) fn waists(g: &Graph, output: NodeId, coordinates: &Coordinates) -> Vec<Vec<NodeId>> {
    let is_inner = |front: &BTreeSet<NodeId>| front.iter().any(|node| !coordinates.seeds.contains_key(node));
    let mut front = BTreeSet::from([output]);
    let (mut single, mut several): (Option<Vec<NodeId>>, Option<Vec<NodeId>>) = (None, None);
    while let Some(last) = front.iter().copied().rfind(|node| !coordinates.seeds.contains_key(node)) {
        front.remove(&last);
        front.extend(moving_operands(g, last, Order::Second).into_iter().filter(|&node| g.varies(node)));
        let size = front.len();
        let narrowest = several.as_ref().map_or(coordinates.len(), |cut| cut.len() + 1);
        match size {
            _ if !is_inner(&front) => {}
            1 => (single, several) = (Some(front.iter().copied().collect()), None),
            _ if size < narrowest => several = Some(front.iter().copied().collect()),
            _ => {}
        }
    }
    let linear = linear_front(g, output, coordinates).filter(|cut| several.as_ref() != Some(cut));
    single.into_iter().chain(several).chain(linear).collect()
}

/// Returns the robust primitives that depend on no other one, if every path from the coordinates to U leads through
/// them.
pub(super) fn primitives(g: &Graph, output: NodeId, coordinates: &Coordinates) -> Option<Vec<NodeId>> {
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
