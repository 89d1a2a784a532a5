//! Finds the linear functions of the unknowns through which these enter a formula: differences of points, of angles, ….
//! Their weights are exact, so that the number of independent ones, and invariance under translations, are facts and no
//! estimates.

use std::collections::{BTreeMap, BTreeSet};

use super::local::Order;
use super::unknowns::{Axis, Moving, Unknowns};
use super::weights::{Span, Sum, Weight};
use super::{differentiable, moving_operands};
use crate::graph::{Graph, NodeId, Op};

/// The largest weight of an independent sum in another one. Rounding errors of larger ones would be felt.
const LARGEST: f64 = 100.0;

/// Nodes through which the points enter a formula. Each is one component of a sum of points with constant weights.
#[derive(Default)]
pub(super) struct Front {
    /// The nodes, each with its axis and the weights of the independent sums that it is made of.
    pub(super) nodes: BTreeMap<NodeId, (Axis, Sum)>,
    /// The independent sums of points.
    pub(super) span: Span,
}

impl Front {
    /// Finds the points and the differences of two points that `outputs` are computed from.
    pub(super) fn of_differences(g: &Graph, outputs: &[NodeId], unknowns: &Unknowns, moving: Moving) -> Self {
        let coordinate = |node| unknowns.coordinate(g, node, moving);
        let mut front = Self::default();
        for &output in outputs {
            if let Some((point, axis)) = coordinate(output) {
                front.add(output, axis, &Sum::of(point));
            }
        }
        for node in between(g, outputs) {
            if let Op::Sub(a, b) = g.op(node)
                && let (Some((p, axis)), Some((q, other))) = (coordinate(a), coordinate(b))
                && axis == other
            {
                front.add(node, axis, &Sum::of(p).minus(&Sum::of(q)));
                continue;
            }
            for operand in operands(g, node) {
                if let Some((point, axis)) = coordinate(operand) {
                    front.add(operand, axis, &Sum::of(point));
                }
            }
        }
        front
    }

    /// Finds the last linear functions of points on all paths to `outputs`; `None` if some are almost dependent.
    pub(super) fn of_linear_functions(
        g: &Graph,
        outputs: &[NodeId],
        unknowns: &Unknowns,
        moving: Moving,
    ) -> Option<Self> {
        let mut linear: BTreeMap<NodeId, (Axis, Sum)> = BTreeMap::new();
        let mut front = Self::default();
        for node in between(g, outputs) {
            if let Some(function) = linear_function(g, node, (unknowns, moving), &linear) {
                linear.insert(node, function);
                continue;
            }
            for operand in operands(g, node) {
                if let Some((axis, sum)) = linear.get(&operand) {
                    front.add(operand, *axis, sum);
                }
            }
        }
        for output in outputs {
            if let Some((axis, sum)) = linear.get(output) {
                front.add(*output, *axis, sum);
            }
        }
        front.nodes.values().all(|(_, sum)| sum.largest() <= LARGEST).then_some(front)
    }

    fn add(&mut self, node: NodeId, axis: Axis, sum: &Sum) {
        let in_basis = self.span.in_basis(sum);
        self.nodes.insert(node, (axis, in_basis));
    }
}

/// Returns whether a translation of all points changes nothing that `outputs` are computed from, conditions included,
/// but for rounding errors.
pub(super) fn is_translation_invariant(g: &Graph, outputs: &[NodeId], unknowns: &Unknowns, moving: Moving) -> bool {
    let operands = |node: NodeId| match g.rule(node) {
        Some(rule) => rule.arguments.clone(),
        None if g.op(node).is_constant_in_exact_arithmetic() => Vec::new(),
        None => g.op(node).operands().collect(),
    };
    let cancels = |sum: &Sum| sum.cancels(|unknown| unknowns.translates(unknown));
    let mut seen: BTreeSet<NodeId> = BTreeSet::new();
    let mut stack = outputs.to_vec();
    while let Some(node) = stack.pop() {
        if g.varies(node) && seen.insert(node) {
            stack.extend(operands(node));
        }
    }
    let mut linear: BTreeMap<NodeId, (Axis, Sum)> = BTreeMap::new();
    for node in seen {
        if let Some(function) = linear_function(g, node, (unknowns, moving), &linear) {
            linear.insert(node, function);
        } else if operands(node).iter().filter_map(|operand| linear.get(operand)).any(|(_, sum)| !cancels(sum)) {
            return false;
        }
    }
    outputs.iter().filter_map(|output| linear.get(output)).all(|(_, sum)| cancels(sum))
}

/// Returns the nodes between the points and `outputs` that first or second derivatives pass through.
fn between(g: &Graph, outputs: &[NodeId]) -> BTreeSet<NodeId> {
    [Order::First, Order::Second].into_iter().flat_map(|order| differentiable(g, outputs, order)).collect()
}

/// Returns the operands that first or second derivatives pass through.
fn operands(g: &Graph, node: NodeId) -> BTreeSet<NodeId> {
    [Order::First, Order::Second].into_iter().flat_map(|order| moving_operands(g, node, order)).collect()
}

/// Returns the axis and the weights of a node that is a sum of points along one axis, up to a constant.
fn linear_function(
    g: &Graph,
    node: NodeId,
    (unknowns, moving): (&Unknowns, Moving),
    known: &BTreeMap<NodeId, (Axis, Sum)>,
) -> Option<(Axis, Sum)> {
    if let Some((point, axis)) = unknowns.coordinate(g, node, moving) {
        return Some((axis, Sum::of(point)));
    }
    let constant = |node| g.as_constant(node).and_then(Weight::of);
    let paid = |axis: Axis, sum: Sum| {
        g.budget().spend(sum.len(), 0);
        Some((axis, sum))
    };
    let scaled = |node, factor: Weight| {
        let (axis, sum): &(Axis, Sum) = known.get(&node)?;
        paid(*axis, sum.times(factor))
    };
    let added = |a: NodeId, b: NodeId, sign: Weight| {
        if !g.varies(b) {
            return scaled(a, Weight::ONE);
        }
        if !g.varies(a) {
            return scaled(b, sign);
        }
        let ((axis, a), (other, b)) = (known.get(&a)?, known.get(&b)?);
        if axis == other { paid(*axis, a.plus(sign, b)) } else { None }
    };
    match g.op(node) {
        Op::Neg(a) => scaled(a, Weight::MINUS_ONE),
        Op::Add(a, b) => added(a, b, Weight::ONE),
        Op::Sub(a, b) => added(a, b, Weight::MINUS_ONE),
        Op::Mul(a, b) if g.varies(a) => scaled(a, constant(b)?),
        Op::Mul(a, b) => scaled(b, constant(a)?),
        Op::Div(a, b) => scaled(a, constant(b)?.reciprocal()),
        _ => None,
    }
}
