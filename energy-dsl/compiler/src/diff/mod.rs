//! Differentiates nodes of a graph. Derivatives are nodes of the same graph.
//!
//! Inputs are first *reduced*: if points enter only as differences or as other linear functions (`linear.rs`),
//! derivatives are taken with respect to these (`coordinates.rs`). First derivatives flow forward as sparse dual parts
//! (`forward.rs`) or back from the outputs (`adjoint.rs`). Second derivatives flow forward, weighted by adjoints, or
//! are gathered at cuts (`cut.rs`). They are sums of outer products (`outer_products.rs`), whose common factors may be
//! taken out (`factored.rs`). `routes.rs` takes the cheapest route.

mod adjoint;
mod coordinates;
mod cut;
mod dihedral;
mod expand;
mod factored;
mod forward;
mod linear;
mod linear_part;
mod local;
mod outer_products;
mod routes;
mod unknowns;
mod vertex_cut;
mod weights;

pub use coordinates::Coordinates;
pub use dihedral::only_dihedral;
pub use forward::{first_derivatives, second_derivatives};
pub use local::Order;
pub use routes::{ATTEMPT, Route, Routes, SecondOrder, first_order, hessian_vector, is_worth_taking, second_order};
pub use unknowns::{Moving, Unknown, Unknowns, by_increments};

use std::collections::{BTreeMap, BTreeSet};

use crate::graph::{ComputedAs, Graph, NodeId, Op, Rule};

/// Returns the nodes through which `outputs` depend on moving inputs, in topological order.
fn differentiable(graph: &Graph, outputs: &[NodeId], order: Order) -> BTreeSet<NodeId> {
    let mut seen = BTreeSet::new();
    let mut stack: Vec<NodeId> = outputs.to_vec();
    while let Some(node) = stack.pop() {
        if !graph.varies(node) || !seen.insert(node) {
            continue;
        }
        stack.extend(moving_operands(graph, node, order));
    }
    seen
}

/// Returns the nodes that a node is differentiated by. A rule has its arguments, or its value if only that can be
/// differentiated. Masks and rounding errors have no derivatives.
fn moving_operands(graph: &Graph, node: NodeId, order: Order) -> Vec<NodeId> {
    if let Some(ComputedAs { computed, defined, slopes }) = graph.computed_as(node) {
        return match order {
            Order::First if slopes => vec![computed],
            Order::FirstToDifferentiate if slopes => vec![computed, defined],
            _ => vec![defined],
        };
    }
    if let Some(operand) = graph.collapsed_to(node) {
        return vec![operand];
    }
    match graph.rule(node) {
        Some(rule) if is_by_value(graph, rule, order) => vec![rule.value],
        Some(rule) => rule.arguments.clone(),
        None => match graph.op(node) {
            Op::Select(_, yes, no) => vec![yes, no],
            op if op.is_mask() || op.is_constant_in_exact_arithmetic() => Vec::new(),
            op => op.operands().collect(),
        },
    }
}

/// Returns whether the derivatives of a rule are those of its value.
fn is_by_value(graph: &Graph, rule: &Rule, order: Order) -> bool {
    match order {
        Order::First => graph.is_spelled_out(rule),
        Order::FirstToDifferentiate => rule.primitive.is_rational(),
        Order::Second => rule.second.is_none() || graph.is_spelled_out(rule),
    }
}

/// Returns whether first derivatives pass through other nodes than second ones.
fn is_computed_otherwise(graph: &Graph, output: NodeId) -> bool {
    let slopes = |node| graph.computed_as(node).is_some_and(|number| number.slopes);
    differentiable(graph, &[output], Order::First).into_iter().any(slopes)
}

/// Adds a term to the sum at an index.
fn accumulate<P: Ord>(g: &mut Graph, sums: &mut BTreeMap<P, NodeId>, place: P, term: NodeId) {
    g.budget().spend(1, 0);
    let sum = match sums.get(&place) {
        Some(&sum) => g.accumulate(sum, term),
        None => term,
    };
    sums.insert(place, sum);
}
