//! Chooses the route to the derivatives of a routine. All routes are built; the cheapest is kept.

use std::collections::BTreeMap;

use super::coordinates::Coordinates;
use super::local::Order;
use super::{adjoint, cut, forward, is_computed_otherwise};
use crate::graph::{Graph, NodeId, count, ordinary, symmetric_index};
use energy_runtime::OperationCount;

/// U, ∇U and the upper triangle of ∇²U in reduced coordinates.
#[derive(Clone, Debug)]
pub struct SecondOrder {
    /// The energy U.
    pub value: NodeId,
    /// The gradient ∇U.
    pub gradient: Vec<NodeId>,
    /// The upper triangle of ∇²U, row by row.
    pub hessian: Vec<NodeId>,
}

/// A route to derivatives, and its cost.
#[derive(Clone, Copy, Debug)]
pub struct Route {
    /// Name of the route.
    pub name: &'static str,
    /// The numbers where derivatives are gathered, if they are.
    pub gathered_at: Option<usize>,
    /// Operations, including those of the value.
    pub count: OperationCount,
    /// Cost according to [`OperationCount::cost`].
    pub cost: usize,
}

/// The routes to the derivatives of a routine. The first one was chosen.
#[derive(Clone, Debug)]
pub struct Routes {
    /// Name of the routine.
    pub routine: &'static str,
    /// Routes by increasing cost.
    pub list: Vec<Route>,
}

/// A candidate route.
struct Alternative {
    name: &'static str,
    gathered_at: Option<usize>,
    /// Its derivatives.
    nodes: Vec<NodeId>,
    /// Whether it is right everywhere, not only on the ordinary path.
    safe: bool,
}

/// Returns the derivatives by the cheapest route on the ordinary path (the first of equals). If that route is not safe
/// everywhere, the general path uses the cheapest safe one.
fn choose(
    g: &mut Graph,
    routine: &'static str,
    values: &[NodeId],
    alternatives: &[Alternative],
) -> (Vec<NodeId>, Routes) {
    let mut order: Vec<(usize, Route)> = Vec::with_capacity(alternatives.len());
    for (number, alternative) in alternatives.iter().enumerate() {
        let nodes = [values, &alternative.nodes].concat();
        let count = match ordinary(g, &nodes) {
            Some((nodes, guard)) => count(g, &[&nodes[..], &[guard]].concat()),
            // There is only one path, the general one.
            None if !alternative.safe => continue,
            None => count(g, &nodes),
        };
        let (name, gathered_at) = (alternative.name, alternative.gathered_at);
        order.push((number, Route { name, gathered_at, count, cost: count.cost() }));
    }
    order.sort_by_key(|(number, route)| (route.cost, *number));
    let best = &alternatives[order.first().expect("a route exists").0];
    let safe = order.iter().map(|(number, _)| &alternatives[*number]).find(|a| a.safe).expect("one route is safe");
    let cautious = g.cautious();
    let nodes = best.nodes.iter().zip(&safe.nodes).map(|(&best, &safe)| g.select(cautious, safe, best)).collect();
    (nodes, Routes { routine, list: order.into_iter().map(|(_, route)| route).collect() })
}

/// Returns the first and second derivatives of a scalar by the cheapest route.
pub fn second_order(
    g: &mut Graph,
    routine: &'static str,
    value: NodeId,
    coordinates: &Coordinates,
) -> (SecondOrder, Routes) {
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
    let safe = [Order::First, Order::Second].into_iter().all(|order| adjoint::is_safe(g, &[value], order, true));
    let gradients = gradients(g, value, coordinates);
    let forward_hessian = dense(forward::second_derivatives(g, value, coordinates));
    let mut alternatives = Vec::new();
    let mut offer = |name, gradient: &[NodeId], hessian: &[NodeId], safe| {
        alternatives.push(Alternative { name, gathered_at: None, nodes: [gradient, hessian].concat(), safe });
    };
    offer("forward over forward", &gradients.forward, &forward_hessian, true);
    if let Some(gradient) = &gradients.reverse {
        offer("forward over forward, reverse gradient", gradient, &forward_hessian, safe);
    }
    if let Some(entries) = adjoint::second_derivatives(g, &whole, coordinates) {
        let hessian = dense(entries);
        offer("adjoint-weighted, forward gradient", &gradients.forward, &hessian, safe);
        if let Some(gradient) = &gradients.reverse {
            offer("adjoint-weighted, reverse gradient", gradient, &hessian, safe);
        }
    }
    let primitives = cut::primitives(g, value, coordinates).map(|cut| ("gathered at primitives", cut));
    let waists = cut::waists(g, value, coordinates, Order::Second).into_iter();
    let waists = waists.map(|cut| ("gathered at a waist", cut));
    let mut by_cut = cut::ByCut::new(g);
    for (name, cut) in primitives.into_iter().chain(waists) {
        if !by_cut.goes_on(g) {
            break;
        }
        let Some(found) = cut::derivatives(g, value, &cut, coordinates, &mut by_cut) else { continue };
        let (gradient, is_safe) = match &gradients.apart {
            Some((gradient, is_safe)) => (gradient, *is_safe),
            None => (&found.gradient, true),
        };
        let nodes = [&gradient[..], &dense(found.hessian)].concat();
        let (gathered_at, safe) = (Some(cut.len()), found.safe && is_safe);
        alternatives.push(Alternative { name, gathered_at, nodes, safe });
    }
    let (mut gradient, routes) = choose(g, routine, &[value], &alternatives);
    let hessian = gradient.split_off(n);
    (SecondOrder { value, gradient, hessian }, routes)
}

/// The first derivatives that go with second ones.
struct Gradients {
    forward: Vec<NodeId>,
    /// By reverse accumulation, if that is right on the ordinary path.
    reverse: Option<Vec<NodeId>>,
    /// The cheapest one, and whether it is right everywhere, if first derivatives are not those of what is
    /// differentiated twice. Otherwise, second derivatives come with their own.
    apart: Option<(Vec<NodeId>, bool)>,
}

fn gradients(g: &mut Graph, value: NodeId, coordinates: &Coordinates) -> Gradients {
    let is_apart = is_computed_otherwise(g, value);
    let order = if is_apart { Order::First } else { Order::Second };
    let forward = forward::first_derivatives(g, &[value], coordinates, Order::First).remove(0);
    let whole = adjoint::alone(g, value);
    let reverse = adjoint::gradient(g, &whole, coordinates, order);
    let apart = is_apart.then(|| {
        let mut list = vec![(forward.clone(), true)];
        list.extend(reverse.clone().map(|gradient| (gradient, adjoint::is_safe(g, &[value], order, true))));
        list.extend(at_waists(g, value, coordinates));
        list.into_iter().min_by_key(|(gradient, _)| cut::cost(g, gradient)).expect("a route exists")
    });
    Gradients { forward, reverse, apart }
}

/// Returns the gradients that are gathered at waists, and whether each is right everywhere.
fn at_waists(g: &mut Graph, value: NodeId, coordinates: &Coordinates) -> Vec<(Vec<NodeId>, bool)> {
    let waists = cut::waists(g, value, coordinates, Order::First);
    waists.into_iter().filter_map(|cut| cut::gradient(g, value, &cut, coordinates)).collect()
}

/// Returns ∇²U · w, where w are the rates of the coordinates, by second-order reverse accumulation or from ∇²U.
pub fn hessian_vector(
    g: &mut Graph,
    routine: &'static str,
    energy: &SecondOrder,
    coordinates: &Coordinates,
) -> (Vec<NodeId>, Routes) {
    let n = coordinates.len();
    let rates = coordinates.rates(g);
    let formed = (0..n)
        .map(|i| {
            let row: Vec<_> = (0..n).map(|j| energy.hessian[symmetric_index(n, i, j)]).collect();
            g.dot(&row, &rates)
        })
        .collect();
    // On the general path the product does what ∇²U does.
    let mut alternatives = vec![Alternative { name: "from the Hessian", gathered_at: None, nodes: formed, safe: true }];
    let safe = adjoint::is_safe(g, &[energy.value], Order::Second, true);
    if let Some(nodes) = adjoint::hessian_vector(g, energy.value, coordinates, &rates) {
        alternatives.push(Alternative { name: "second-order reverse", gathered_at: None, nodes, safe });
    }
    choose(g, routine, &[], &alternatives)
}

/// Returns the first derivatives of each output by the cheapest route: forward, reverse, or the `known` derivatives.
pub fn first_order(
    g: &mut Graph,
    routine: &'static str,
    outputs: &[NodeId],
    coordinates: &Coordinates,
    known: Option<Vec<NodeId>>,
) -> (Vec<Vec<NodeId>>, Routes) {
    let forward = forward::first_derivatives(g, outputs, coordinates, Order::First).concat();
    let mut alternatives = vec![Alternative { name: "forward", gathered_at: None, nodes: forward, safe: true }];
    let safe = adjoint::is_safe(g, outputs, Order::First, true);
    let reverse: Option<Vec<_>> = outputs
        .iter()
        .map(|&output| {
            let whole = adjoint::alone(g, output);
            adjoint::gradient(g, &whole, coordinates, Order::First)
        })
        .collect();
    if let Some(rows) = reverse {
        alternatives.push(Alternative { name: "reverse", gathered_at: None, nodes: rows.concat(), safe });
    }
    if let Some(nodes) = known {
        // The known derivatives handle the general path themselves.
        alternatives.push(Alternative { name: "as with second derivatives", gathered_at: None, nodes, safe: true });
    }
    let (nodes, routes) = choose(g, routine, outputs, &alternatives);
    let n = coordinates.len();
    ((0..outputs.len()).map(|row| nodes[row * n..(row + 1) * n].to_vec()).collect(), routes)
}
