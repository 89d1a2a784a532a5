//! Differentiates nodes of a graph. Derivatives are nodes of the same graph.
//!
//! Inputs are first *reduced*: if points enter only as differences, derivatives are taken with respect to these
//! (`coordinates.rs`). First derivatives flow forward as sparse dual parts (`forward.rs`) or back from the outputs
//! (`adjoint.rs`). Second derivatives flow forward, weighted by adjoints, or are gathered at a few primitives
//! (`cut.rs`). `plan.rs` takes the cheapest route.

mod adjoint;
mod coordinates;
mod cut;
mod expand;
mod forward;
mod local;
mod plan;

pub use coordinates::{Coordinates, Moving};
pub use forward::{first_derivatives, second_derivatives};
pub use local::Order;
pub use plan::{Plan, SecondOrder, first_order, hessian_vector, second_order};

use std::collections::{BTreeMap, BTreeSet};

use crate::graph::{Graph, NodeId, Op};

/// Returns the nodes through which `outputs` depend on moving inputs, in topological order. A rule leads to its
/// arguments, or to its value if only that can be differentiated. Masks and rounding errors have no derivatives.
fn differentiable(graph: &Graph, outputs: &[NodeId], order: Order) -> BTreeSet<NodeId> {
    let mut seen = BTreeSet::new();
    let mut stack: Vec<NodeId> = outputs.to_vec();
    while let Some(node) = stack.pop() {
        if !graph.varies(node) || !seen.insert(node) {
            continue;
        }
        match graph.rule(node) {
            Some(rule) if order == Order::Second && rule.second.is_none() => stack.push(rule.value),
            Some(rule) => stack.extend(&rule.arguments),
            None => match graph.op(node) {
                Op::Select(_, yes, no) => stack.extend([yes, no]),
                op if op.is_mask() || op.is_constant_in_exact_arithmetic() => {}
                op => stack.extend(op.operands()),
            },
        }
    }
    seen
}

/// Adds a term to the sum at an index.
fn accumulate<P: Ord>(g: &mut Graph, sums: &mut BTreeMap<P, NodeId>, place: P, term: NodeId) {
    let sum = match sums.get(&place) {
        Some(&sum) => g.accumulate(sum, term),
        None => term,
    };
    sums.insert(place, sum);
}
