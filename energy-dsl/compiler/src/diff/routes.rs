//! Chooses the route to the derivatives of a routine. All routes are built; the cheapest is kept.

use std::collections::BTreeMap;

use super::coordinates::Coordinates;
use super::cut::{ByCut, Primitives, Width};
use super::factored::Factored;
use super::linear_part::LinearPart;
use super::local::Order;
use super::outer_products::{AsTheyCome, Summation};
use super::{adjoint, cut, differentiable, forward, is_computed_otherwise};
use crate::graph::{DerivativeForms, Graph, NodeId, count, ordinary, symmetric_index};
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Route {
    /// Name of the route.
    pub name: &'static str,
    /// The numbers where derivatives are gathered, if they are.
    pub gathered_at: Option<usize>,
    /// Whether common factors are taken out of sums of products.
    pub factored: bool,
    /// The forms in which rules are differentiated.
    pub forms: DerivativeForms,
    /// Operations, including those of the value.
    pub count: OperationCount,
    /// Cost according to [`OperationCount::cost`].
    pub cost: usize,
}

/// The routes to the derivatives of a routine.
#[derive(Clone, Debug)]
pub struct Routes {
    /// Name of the routine.
    pub routine: &'static str,
    /// The route that was taken, and the others by increasing cost.
    pub list: Vec<Route>,
}

/// A candidate route.
struct Alternative {
    name: &'static str,
    gathered_at: Option<usize>,
    factored: bool,
    forms: DerivativeForms,
    /// Its derivatives.
    nodes: Vec<NodeId>,
    /// Whether it is right everywhere, not only on the ordinary path.
    safe: bool,
}

impl Alternative {
    fn new(g: &Graph, name: &'static str, nodes: Vec<NodeId>, safe: bool) -> Self {
        Self { name, gathered_at: None, factored: false, forms: g.derivative_forms(), nodes, safe }
    }

    /// Takes the derivatives of another route under a mask.
    fn unless(&mut self, g: &mut Graph, mask: NodeId, other: &Self) {
        for (node, &instead) in self.nodes.iter_mut().zip(&other.nodes) {
            *node = g.select(mask, instead, *node);
        }
    }
}

/// Returns the derivatives by the cheapest route on the ordinary path (the first of equals). If that route is not safe
/// everywhere, the general path uses the cheapest safe one. `None` if no route is safe.
fn cheapest(
    g: &mut Graph,
    routine: &'static str,
    values: &[NodeId],
    alternatives: &[Alternative],
) -> Option<(Vec<NodeId>, Routes)> {
    let mut order: Vec<(usize, Route)> = Vec::with_capacity(alternatives.len());
    for (number, alternative) in alternatives.iter().enumerate() {
        let nodes = [values, &alternative.nodes].concat();
        let count = match ordinary(g, &nodes) {
            Some((nodes, guard)) => count(g, &[&nodes[..], &[guard]].concat()),
            // There is only one path, the general one.
            None if !alternative.safe => continue,
            None => count(g, &nodes),
        };
        let &Alternative { name, gathered_at, factored, forms, .. } = alternative;
        order.push((number, Route { name, gathered_at, factored, forms, count, cost: count.cost() }));
    }
    order.sort_by_key(|(number, route)| (route.cost, *number));
    let best = &alternatives[order.first()?.0];
    let safe = order.iter().map(|(number, _)| &alternatives[*number]).find(|a| a.safe)?;
    let cautious = g.cautious();
    let nodes = best.nodes.iter().zip(&safe.nodes).map(|(&best, &safe)| g.select(cautious, safe, best)).collect();
    Some((nodes, Routes { routine, list: order.into_iter().map(|(_, route)| route).collect() }))
}

/// Returns the derivatives by the cheapest of several routes, of which the first is safe.
fn choose(
    g: &mut Graph,
    routine: &'static str,
    values: &[NodeId],
    alternatives: &[Alternative],
) -> (Vec<NodeId>, Routes) {
    cheapest(g, routine, values, alternatives).expect("compiler bug: no route is safe")
}

/// Steps of the compiler for the routes of a routine that may be given up.
pub const ATTEMPT: u64 = 2_000_000;

/// Returns whether a route that is tried in a graph of its own is shorter by a twentieth. What is not taken must not
/// influence which products are fused, and fewer operations are not worth other bits.
pub fn is_worth_taking(cost: usize, instead_of: usize) -> bool {
    20 * cost < 19 * instead_of
}

/// Returns the first and second derivatives of a scalar by the cheapest route.
pub fn second_order(
    g: &mut Graph,
    routine: &'static str,
    value: NodeId,
    coordinates: &Coordinates,
) -> (SecondOrder, Routes) {
    let before = g.clone();
    let moving = differentiable(g, &[value], Order::Second);
    let has_rational = moving.iter().any(|&node| is_rational(g, node));
    let first = DerivativeForms { spelled_out: has_rational, collapsed: false };
    g.differentiate_by(first);
    let alternatives = second_derivatives(g, value, coordinates);
    let (mut nodes, mut routes) = choose(g, routine, &[value], &alternatives);
    g.differentiate_by(DerivativeForms::default());
    let rationals = if has_rational { &[false, true][..] } else { &[false] };
    let collapsed = if moving.iter().any(|&node| g.collapses(node)) { &[false, true][..] } else { &[false] };
    let forms = collapsed
        .iter()
        .flat_map(|&collapsed| rationals.iter().map(move |&spelled_out| DerivativeForms { spelled_out, collapsed }));
    for (forms, kind) in forms.flat_map(|forms| [(forms, Attempt::Factored), (forms, Attempt::AtWideCuts)]) {
        let mut other = before.clone();
        let attempt = || {
            other.differentiate_by(forms);
            let alternatives = kind.routes(&mut other, value, coordinates, forms != first);
            cheapest(&mut other, routine, &[value], &alternatives)
        };
        let Some((Some((others, found)), [steps, bytes])) = before.budget().attempt(ATTEMPT, attempt) else { continue };
        let is_taken = is_worth_taking(found.list[0].cost, routes.list[0].cost);
        let taken = if is_taken { found.list[0] } else { routes.list[0] };
        if is_taken {
            other.differentiate_by(DerivativeForms::default());
            (*g, nodes) = (other, others);
            g.budget().spend(steps, bytes);
        }
        routes.list.extend(found.list);
        routes.list.sort_by_key(|route| (*route != taken, route.cost));
    }
    let hessian = nodes.split_off(coordinates.len());
    (SecondOrder { value, gradient: nodes, hessian }, routes)
}

/// Routes that are tried in a graph of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Attempt {
    /// Common factors are taken out of sums of products.
    Factored,
    /// Derivatives are gathered at cuts that may be as wide as the coordinates.
    AtWideCuts,
}

impl Attempt {
    /// Returns its routes, at least one of which is safe, or none. Where derivatives have other forms than those of the
    /// first routes, these are tried again.
    fn routes(
        self,
        g: &mut Graph,
        value: NodeId,
        coordinates: &Coordinates,
        has_other_forms: bool,
    ) -> Vec<Alternative> {
        let mut list = match self {
            Self::Factored => factored_derivatives(g, value, coordinates),
            Self::AtWideCuts => at_wide_cuts(g, value, coordinates),
        };
        if self == Self::Factored && has_other_forms {
            list.extend(second_derivatives(g, value, coordinates));
        }
        if list.is_empty() {
            return list;
        }
        if g.derivative_forms().collapsed {
            by_vectors_where_lengths_vanish(g, value, coordinates, &mut list);
        }
        if !list.iter().any(|route| route.safe) {
            list.push(safe_everywhere(g, value, coordinates));
        }
        list
    }
}

/// Takes derivatives by vectors where the length of one vanishes.
fn by_vectors_where_lengths_vanish(
    g: &mut Graph,
    value: NodeId,
    coordinates: &Coordinates,
    collapsed: &mut Vec<Alternative>,
) {
    g.differentiate_by(DerivativeForms { collapsed: false, ..g.derivative_forms() });
    let by_vectors = safe_everywhere(g, value, coordinates);
    let moving = differentiable(g, &[value], Order::Second);
    let vanishes = g.any_vanishes(moving);
    collapsed.iter_mut().for_each(|route| route.unless(g, vanishes, &by_vectors));
    collapsed.push(by_vectors);
}

const SPELLED_OUT: DerivativeForms = DerivativeForms { spelled_out: true, collapsed: false };

fn is_rational(g: &Graph, node: NodeId) -> bool {
    g.rule(node).is_some_and(|rule| rule.primitive.is_rational())
}

/// Returns a route that is right on the general path, too.
fn safe_everywhere(g: &mut Graph, value: NodeId, coordinates: &Coordinates) -> Alternative {
    let gradient = forward::first_derivatives(g, &[value], coordinates, Order::First).remove(0);
    let entries = forward::second_derivatives(g, value, coordinates);
    let nodes = dense(g, coordinates.len(), &gradient, entries);
    Alternative::new(g, "forward over forward", nodes, true)
}

/// Returns the routes with the derivatives of rational primitives, and those through their values.
fn in_both_spellings(
    g: &mut Graph,
    outputs: &[NodeId],
    routes: impl Fn(&mut Graph) -> Vec<Alternative>,
) -> Vec<Alternative> {
    let mut alternatives = routes(g);
    if differentiable(g, outputs, Order::Second).into_iter().any(|node| is_rational(g, node)) {
        g.differentiate_by(SPELLED_OUT);
        alternatives.extend(routes(g));
        g.differentiate_by(DerivativeForms::default());
    }
    alternatives
}

/// Returns ∇U and the upper triangle of ∇²U, row by row.
fn dense(g: &mut Graph, n: usize, gradient: &[NodeId], entries: BTreeMap<usize, NodeId>) -> Vec<NodeId> {
    let mut hessian = vec![g.constant(0.0); n * (n + 1) / 2];
    for (place, entry) in entries {
        hessian[symmetric_index(n, place / n, place % n)] = entry;
    }
    [gradient, &hessian].concat()
}

/// Returns the routes to the first and second derivatives of a scalar.
fn second_derivatives(g: &mut Graph, value: NodeId, coordinates: &Coordinates) -> Vec<Alternative> {
    let n = coordinates.len();
    let whole = adjoint::alone(g, value);
    let safe = [Order::First, Order::Second].into_iter().all(|order| adjoint::is_safe(g, &[value], order, true));
    let gradients = gradients(g, value, coordinates, Width::Narrower);
    let entries = forward::second_derivatives(g, value, coordinates);
    let mut alternatives = Vec::new();
    let mut offer = |g: &mut Graph, name, gradient: &[NodeId], entries: &BTreeMap<usize, NodeId>, safe| {
        let nodes = dense(g, n, gradient, entries.clone());
        alternatives.push(Alternative::new(g, name, nodes, safe));
    };
    offer(g, "forward over forward", &gradients.forward, &entries, true);
    if let Some(gradient) = &gradients.reverse {
        offer(g, "forward over forward, reverse gradient", gradient, &entries, safe);
    }
    if let Some(sums) = adjoint::second_derivatives(g, &whole, coordinates, AsTheyCome::new(n)) {
        let entries = sums.entries(g);
        offer(g, "adjoint-weighted, forward gradient", &gradients.forward, &entries, safe);
        if let Some(gradient) = &gradients.reverse {
            offer(g, "adjoint-weighted, reverse gradient", gradient, &entries, safe);
        }
    }
    let (cuts, mut by_cut) = (cuts(g, value, coordinates), ByCut::new(g, None));
    let plain = || AsTheyCome::new(n);
    alternatives.extend(gathered(g, value, coordinates, gradients.apart.as_ref(), (&cuts, &mut by_cut), plain));
    alternatives
}

/// Returns the routes on which common factors are taken out of sums of products, and those through the narrowest cut of
/// the linear part.
fn factored_derivatives(g: &mut Graph, value: NodeId, coordinates: &Coordinates) -> Vec<Alternative> {
    let (n, of_formula) = (coordinates.len(), g.last());
    let apart = apart(g, value, coordinates, Width::Narrower);
    let narrowest = LinearPart::new(g, value, coordinates, Order::Second).narrowest();
    let narrowest: Vec<Cut> = narrowest.map(|cut| ("gathered at a waist", cut)).into_iter().collect();
    let all = [cuts(g, value, coordinates), narrowest.clone()].concat();
    let mut by_cut = ByCut::new(g, Some(of_formula));
    let factored = || Factored::new(n, of_formula);
    let list = gathered(g, value, coordinates, apart.as_ref(), (&all, &mut by_cut), factored);
    let mut alternatives: Vec<_> = list.into_iter().map(|route| Alternative { factored: true, ..route }).collect();
    let plain = || AsTheyCome::new(n);
    alternatives.extend(gathered(g, value, coordinates, apart.as_ref(), (&narrowest, &mut by_cut), plain));
    alternatives
}

/// Returns the routes through further cuts, which may be as wide as the coordinates: waists, and primitives with what
/// leads around them. Factors are taken out at narrow ones.
fn at_wide_cuts(g: &mut Graph, value: NodeId, coordinates: &Coordinates) -> Vec<Alternative> {
    let (n, of_formula) = (coordinates.len(), g.last());
    let primitives = Primitives::new(g, value, coordinates).and_then(|primitives| primitives.with_others(coordinates));
    let waists = cut::waists(g, value, coordinates, Order::Second, Width::AsWide);
    let mut cuts: Vec<Cut> = waists.into_iter().map(|cut| ("gathered at a waist", cut)).collect();
    cuts.extend(primitives.map(|cut| ("gathered at primitives", cut)));
    let known = self::cuts(g, value, coordinates);
    cuts.retain(|(_, cut)| known.iter().all(|(_, other)| other != cut));
    if cuts.is_empty() {
        return Vec::new();
    }
    let apart = apart(g, value, coordinates, Width::AsWide);
    let mut by_cut = ByCut::new(g, None);
    let plain = || AsTheyCome::new(n);
    let mut alternatives = gathered(g, value, coordinates, apart.as_ref(), (&cuts, &mut by_cut), plain);
    cuts.retain(|(_, cut)| cut.len() <= cut::NARROW);
    let mut by_cut = ByCut::new(g, Some(of_formula));
    let factored = || Factored::new(n, of_formula);
    let list = gathered(g, value, coordinates, apart.as_ref(), (&cuts, &mut by_cut), factored);
    alternatives.extend(list.into_iter().map(|route| Alternative { factored: true, ..route }));
    alternatives
}

/// Returns the gradient of what first derivatives pass through, if second ones pass through other nodes.
fn apart(g: &mut Graph, value: NodeId, coordinates: &Coordinates, width: Width) -> Option<(Vec<NodeId>, bool)> {
    is_computed_otherwise(g, value).then(|| gradients(g, value, coordinates, width).apart).flatten()
}

/// A cut, and the name of the route through it.
type Cut = (&'static str, Vec<NodeId>);

fn cuts(g: &Graph, value: NodeId, coordinates: &Coordinates) -> Vec<Cut> {
    let primitives = Primitives::new(g, value, coordinates).and_then(|primitives| primitives.alone(coordinates));
    let waists = cut::waists(g, value, coordinates, Order::Second, Width::Narrower).into_iter();
    let primitives = primitives.into_iter().map(|cut| ("gathered at primitives", cut));
    primitives.chain(waists.map(|cut| ("gathered at a waist", cut))).collect()
}

/// Returns the routes on which derivatives are gathered at cuts, with this gradient if it is that of other nodes.
fn gathered<S: Summation>(
    g: &mut Graph,
    value: NodeId,
    coordinates: &Coordinates,
    apart: Option<&(Vec<NodeId>, bool)>,
    (cuts, by_cut): (&[Cut], &mut ByCut),
    sums: impl Fn() -> S,
) -> Vec<Alternative> {
    let mut alternatives = Vec::new();
    for (name, cut) in cuts {
        if !by_cut.goes_on(g) {
            break;
        }
        let Some(found) = cut::derivatives(g, value, cut, coordinates, by_cut, sums()) else { continue };
        let (gradient, is_safe) = match apart {
            Some((gradient, is_safe)) => (gradient, *is_safe),
            None => (&found.gradient, true),
        };
        let nodes = dense(g, coordinates.len(), gradient, found.hessian);
        let route = Alternative::new(g, name, nodes, found.safe && is_safe);
        alternatives.push(Alternative { gathered_at: Some(cut.len()), ..route });
    }
    alternatives
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

fn gradients(g: &mut Graph, value: NodeId, coordinates: &Coordinates, width: Width) -> Gradients {
    let is_apart = is_computed_otherwise(g, value);
    let order = if is_apart { Order::First } else { Order::Second };
    let forward = forward::first_derivatives(g, &[value], coordinates, Order::First).remove(0);
    let whole = adjoint::alone(g, value);
    let reverse = adjoint::gradient(g, &whole, coordinates, order);
    let apart = is_apart.then(|| {
        let mut list = vec![(forward.clone(), true)];
        list.extend(reverse.clone().map(|gradient| (gradient, adjoint::is_safe(g, &[value], order, true))));
        list.extend(at_waists(g, value, coordinates, width));
        list.into_iter().min_by_key(|(gradient, _)| cut::cost(g, gradient)).expect("a route exists")
    });
    Gradients { forward, reverse, apart }
}

/// Returns the gradients that are gathered at waists, and whether each is right everywhere.
fn at_waists(g: &mut Graph, value: NodeId, coordinates: &Coordinates, width: Width) -> Vec<(Vec<NodeId>, bool)> {
    let waists = cut::waists(g, value, coordinates, Order::First, width);
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
    let mut alternatives = vec![Alternative::new(g, "from the Hessian", formed, true)];
    alternatives.extend(in_both_spellings(g, &[energy.value], |g| {
        let safe = adjoint::is_safe(g, &[energy.value], Order::Second, true);
        let nodes = adjoint::hessian_vector(g, energy.value, coordinates, &rates);
        nodes.map(|nodes| Alternative::new(g, "second-order reverse", nodes, safe)).into_iter().collect()
    }));
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
    let mut alternatives = in_both_spellings(g, outputs, |g| first_derivatives(g, outputs, coordinates));
    if let Some(nodes) = known {
        // The known derivatives handle the general path themselves.
        alternatives.push(Alternative::new(g, "as with second derivatives", nodes, true));
    }
    let (nodes, routes) = choose(g, routine, outputs, &alternatives);
    let n = coordinates.len();
    ((0..outputs.len()).map(|row| nodes[row * n..(row + 1) * n].to_vec()).collect(), routes)
}

/// Returns the routes to the first derivatives of each output.
fn first_derivatives(g: &mut Graph, outputs: &[NodeId], coordinates: &Coordinates) -> Vec<Alternative> {
    let forward = forward::first_derivatives(g, outputs, coordinates, Order::First).concat();
    let mut alternatives = vec![Alternative::new(g, "forward", forward, true)];
    let safe = adjoint::is_safe(g, outputs, Order::First, true);
    let reverse: Option<Vec<_>> = outputs
        .iter()
        .map(|&output| {
            let whole = adjoint::alone(g, output);
            adjoint::gradient(g, &whole, coordinates, Order::First)
        })
        .collect();
    if let Some(rows) = reverse {
        alternatives.push(Alternative::new(g, "reverse", rows.concat(), safe));
    }
    alternatives
}
