//! Which route to derivatives a routine takes: all are built, the cheapest is kept.

use std::collections::BTreeMap;

use super::coordinates::Coordinates;
use super::{adjoint, cut, forward};
use crate::graph::{Graph, NodeId, count, ordinary, symmetric_index};
use crate::runtime::OperationCount;

/// U, ∇U and the upper triangle of ∇²U in reduced coordinates.
#[derive(Clone, Debug)]
pub struct SecondOrder {
    /// U.
    pub value: NodeId,
    /// ∇U.
    pub gradient: Vec<NodeId>,
    /// ∇²U, upper triangle row by row.
    pub hessian: Vec<NodeId>,
}

/// A way to derivatives, and what it comes to.
#[derive(Clone, Copy, Debug)]
pub struct Route {
    /// What it is called.
    pub name: &'static str,
    /// Its arithmetic, value included.
    pub count: OperationCount,
    /// Its cost by [`OperationCount::cost`].
    pub cost: usize,
}

/// The routes to a routine's derivatives, the chosen one first.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What was planned.
    pub routine: &'static str,
    /// In ascending cost.
    pub routes: Vec<Route>,
}

/// A route's name and all nodes it computes.
type Alternative = (&'static str, Vec<NodeId>);

/// The number of the cheapest alternative (the first of equals) in ordinary configurations, and the comparison.
fn choose(g: &mut Graph, routine: &'static str, alternatives: &[Alternative]) -> (usize, Plan) {
    let mut order: Vec<(usize, Route)> = alternatives
        .iter()
        .enumerate()
        .map(|(number, (name, nodes))| {
            let count = match ordinary(g, nodes) {
                Some((nodes, guard)) => count(g, &[&nodes[..], &[guard]].concat()),
                None => count(g, nodes),
            };
            (number, Route { name, count, cost: count.cost() })
        })
        .collect();
    order.sort_by_key(|(number, route)| (route.cost, *number));
    let chosen = order.first().expect("a route exists").0;
    (chosen, Plan { routine, routes: order.into_iter().map(|(_, route)| route).collect() })
}

/// First and second derivatives of a scalar by the cheapest route.
pub fn second_order(
    g: &mut Graph,
    routine: &'static str,
    value: NodeId,
    coordinates: &Coordinates,
) -> (SecondOrder, Plan) {
    let n = coordinates.len();
    let zero = g.constant(0.0);
    let dense = |entries: BTreeMap<usize, NodeId>| {
        let mut hessian = vec![zero; n * (n + 1) / 2];
        for (place, entry) in entries {
            hessian[symmetric_index(n, place / n, place % n)] = entry;
        }
        hessian
    };
    let whole = adjoint::alone(g, value);
    let forward_gradient = forward::first_derivatives(g, &[value], coordinates).remove(0);
    let reverse_gradient = adjoint::gradient(g, &whole, coordinates, true);
    let forward_hessian = dense(forward::second_derivatives(g, value, coordinates));
    let mut hessians = vec![("forward over forward", forward_hessian)];
    if let Some(entries) = adjoint::second_derivatives(g, &whole, coordinates) {
        hessians.push(("adjoint-weighted", dense(entries)));
    }
    let mut routes = Vec::new();
    for (name, hessian) in hessians {
        routes.push((name, forward_gradient.clone(), hessian.clone()));
        if let Some(gradient) = &reverse_gradient {
            let name = if name == "adjoint-weighted" {
                "adjoint-weighted, reverse gradient"
            } else {
                "forward over forward, reverse gradient"
            };
            routes.push((name, gradient.clone(), hessian));
        }
    }
    if let Some((gradient, entries)) = cut::derivatives(g, value, coordinates) {
        routes.push(("gathered at primitives", gradient, dense(entries)));
    }
    let alternatives: Vec<Alternative> =
        routes.iter().map(|(name, gradient, hessian)| (*name, [&[value], &gradient[..], hessian].concat())).collect();
    let (chosen, plan) = choose(g, routine, &alternatives);
    let (_, gradient, hessian) = routes.swap_remove(chosen);
    (SecondOrder { value, gradient, hessian }, plan)
}

/// First derivatives of each output by the cheaper of the forward and the reverse route; `known` is a further alternative.
pub fn first_order(
    g: &mut Graph,
    routine: &'static str,
    outputs: &[NodeId],
    coordinates: &Coordinates,
    known: Option<Vec<Vec<NodeId>>>,
) -> (Vec<Vec<NodeId>>, Plan) {
    let forward = forward::first_derivatives(g, outputs, coordinates);
    let reverse: Option<Vec<_>> = outputs
        .iter()
        .map(|&output| {
            let whole = adjoint::alone(g, output);
            adjoint::gradient(g, &whole, coordinates, false)
        })
        .collect();
    let mut routes = vec![("forward", forward)];
    routes.extend(reverse.map(|rows| ("reverse", rows)));
    routes.extend(known.map(|rows| ("as with second derivatives", rows)));
    let alternatives: Vec<Alternative> =
        routes.iter().map(|(name, rows)| (*name, [outputs, &rows.concat()].concat())).collect();
    let (chosen, plan) = choose(g, routine, &alternatives);
    (routes.swap_remove(chosen).1, plan)
}
