//! Second derivatives gathered at a cut. If everything that moves enters U through a few numbers c, then ∇²U = Σ ∂U/∂c
//! ∇²c + Σ (Σ ∂²U/∂c∂c′ ∇c′) ∇cᵀ. There are few derivatives with respect to c, and each ∇c appears in one outer
//! product. The numbers are robust primitives, or the nodes of a narrow part of the graph.

use std::collections::{BTreeMap, BTreeSet};

use super::adjoint::{self, Weighted};
use super::coordinates::Coordinates;
use super::factored::Factored;
use super::forward::{self, Sparse};
use super::linear_part::LinearPart;
use super::local::Order;
use super::outer_products::{AsTheyCome, Summation};
use super::{differentiable, is_computed_otherwise, moving_operands, vertex_cut};
use crate::graph::{Graph, NodeId, count, ordinary};

/// The most nodes of a narrow cut.
pub(super) const NARROW: usize = 3;

/// Derivatives gathered at a cut.
#[derive(Clone)]
pub(super) struct Gathered {
    /// ∇U.
    pub(super) gradient: Vec<NodeId>,
    /// The upper triangle of ∇²U by index.
    pub(super) hessian: BTreeMap<usize, NodeId>,
    /// Whether they are right everywhere, not only on the ordinary path.
    pub(super) safe: bool,
}

/// Derivatives of U with respect to the nodes of cuts.
pub(super) struct ByCut {
    known: BTreeMap<Vec<NodeId>, Gathered>,
    /// The last node of the formula, if common factors are taken out.
    factored: Option<NodeId>,
    /// Steps of the compiler after which no more cuts are looked for.
    last_step: u64,
}

/// Steps of the compiler that are spent on cuts. A formula without order has ever new ones.
const STEPS: u64 = 2_000_000;

impl ByCut {
    pub(super) fn new(g: &Graph, factored: Option<NodeId>) -> Self {
        Self { known: BTreeMap::new(), factored, last_step: g.budget().progress().steps.saturating_add(STEPS) }
    }

    /// Returns whether there are steps left.
    pub(super) fn goes_on(&self, g: &Graph) -> bool {
        g.budget().progress().steps < self.last_step
    }
}

/// Returns the derivatives through the nodes of a cut; `None` if that is not right on the ordinary path. Above the cut,
/// they may be gathered at a waist.
pub(super) fn derivatives(
    g: &mut Graph,
    output: NodeId,
    cut: &[NodeId],
    coordinates: &Coordinates,
    known: &mut ByCut,
    sums: impl Summation,
) -> Option<Gathered> {
    let Gathered { gradient: slopes, hessian: curvatures, safe } = by_cut(g, output, cut, known);
    let safe = safe && adjoint::is_safe(g, cut, Order::Second, true);
    let weights: Weighted = cut.iter().copied().zip(slopes).collect();
    let gradient = adjoint::gradient(g, &weights, coordinates, Order::Second)?;
    let mut sums = adjoint::second_derivatives(g, &weights, coordinates, sums)?;

    let tangents = forward::tangents_by(g, cut, coordinates, Order::Second, &sums);
    sums.next();
    let none = Sparse::new();
    let m = cut.len();
    for (row, node) in cut.iter().enumerate() {
        let terms: Vec<(NodeId, &Sparse)> = (0..m)
            .filter_map(|column| {
                let factor = *curvatures.get(&(row.min(column) * m + row.max(column)))?;
                Some((factor, tangents.get(&cut[column])?))
            })
            .collect();
        let weighted = sums.combine(g, &terms);
        for &(i, x) in &weighted {
            for &(j, y) in tangents.get(node).unwrap_or(&none) {
                if i <= j {
                    sums.add_to_entry(g, (i, j), x, y);
                }
            }
        }
    }
    let weighted = |node: &NodeId| Some((weights[node], tangents.get(node)?));
    let terms: Vec<(NodeId, &Sparse)> = cut.iter().filter_map(weighted).collect();
    let is_tried = known.factored.is_some() && cut.len() <= NARROW;
    let by_tangents = is_tried.then(|| sums.combine(g, &terms));
    let mut found = Gathered { gradient, hessian: sums.entries(g), safe };
    if let Some(by_tangents) = by_tangents {
        // The gradient by the tangents of the outer products.
        let other = Gathered { gradient: forward::dense(g, &by_tangents, coordinates.len()), ..found.clone() };
        if other.cost(g) < found.cost(g) {
            found = other;
        }
    }
    Some(found)
}

/// Returns ∇U through the nodes of a cut of what first derivatives pass through, and whether it is right everywhere;
/// `None` if it is not right on the ordinary path.
pub(super) fn gradient(
    g: &mut Graph,
    output: NodeId,
    cut: &[NodeId],
    coordinates: &Coordinates,
) -> Option<(Vec<NodeId>, bool)> {
    let above = Coordinates::of_nodes(g, cut);
    let whole = adjoint::alone(g, output);
    let (slopes, is_safe) = match adjoint::gradient(g, &whole, &above, Order::First) {
        Some(slopes) => (slopes, adjoint::is_safe(g, &[output], Order::First, true)),
        None => (forward::first_derivatives(g, &[output], &above, Order::First).remove(0), true),
    };
    let weights: Weighted = cut.iter().copied().zip(slopes).collect();
    let gradient = adjoint::gradient(g, &weights, coordinates, Order::First)?;
    Some((gradient, is_safe && adjoint::is_safe(g, cut, Order::First, true)))
}

/// Returns the derivatives of U with respect to the nodes of the cut. They may be gathered at a cut above.
fn by_cut(g: &mut Graph, output: NodeId, cut: &[NodeId], known: &mut ByCut) -> Gathered {
    if let Some(found) = known.known.get(cut) {
        return found.clone();
    }
    let coordinates = Coordinates::of_nodes(g, cut);
    let whole = adjoint::alone(g, output);
    let slopes = adjoint::gradient(g, &whole, &coordinates, Order::Second);
    let curvatures = adjoint::second_derivatives(g, &whole, &coordinates, AsTheyCome::new(coordinates.len()));
    let mut best = match (slopes, curvatures) {
        (Some(gradient), Some(sums)) => {
            let hessian = sums.entries(g);
            Gathered { gradient, hessian, safe: adjoint::is_safe(g, &[output], Order::Second, true) }
        }
        _ => {
            // The derivatives of what is differentiated twice, which is what the cut belongs to.
            let order = if is_computed_otherwise(g, output) { Order::Second } else { Order::First };
            let gradient = forward::first_derivatives(g, &[output], &coordinates, order).remove(0);
            Gathered { gradient, hessian: forward::second_derivatives(g, output, &coordinates), safe: true }
        }
    };
    let is_nested = cut.len() >= NARROW || known.factored.is_some();
    let mut waists =
        if is_nested { waists(g, output, &coordinates, Order::Second, Width::Narrower) } else { Vec::new() };
    if known.factored.is_some() && cut.len() >= NARROW {
        waists.extend(LinearPart::new(g, output, &coordinates, Order::Second).narrowest());
    }
    let mut least = best.cost(g);
    for waist in waists {
        if !known.goes_on(g) {
            break;
        }
        let n = coordinates.len();
        let plain = derivatives(g, output, &waist, &coordinates, known, AsTheyCome::new(n));
        let factored =
            known.factored.and_then(|end| derivatives(g, output, &waist, &coordinates, known, Factored::new(n, end)));
        for found in [plain, factored].into_iter().flatten() {
            let cost = found.cost(g);
            if cost < least {
                (best, least) = (found, cost);
            }
        }
    }
    known.known.insert(cut.to_vec(), best.clone());
    best
}

impl Gathered {
    fn cost(&self, g: &mut Graph) -> usize {
        let nodes: Vec<NodeId> = self.gradient.iter().chain(self.hessian.values()).copied().collect();
        cost(g, &nodes)
    }
}

/// Returns what nodes cost on the ordinary path.
pub(super) fn cost(g: &mut Graph, nodes: &[NodeId]) -> usize {
    ordinary(g, nodes).map_or_else(|| count(g, nodes), |(nodes, _)| count(g, &nodes)).cost()
}

/// Fronts of the graph between U and the coordinates. A node of a front is replaced by its operands once no other node
/// that is above the coordinates uses it, so that any front is a cut.
struct Fronts<'a> {
    g: &'a Graph,
    coordinates: &'a Coordinates,
    /// The derivatives that pass through the graph.
    order: Order,
    front: BTreeSet<NodeId>,
    /// Uses of each node by nodes that were not replaced.
    users: BTreeMap<NodeId, usize>,
}

/// Nodes of a front that are compared, of those that may be replaced.
const COMPARED: usize = 16;

impl<'a> Fronts<'a> {
    fn new(g: &'a Graph, output: NodeId, coordinates: &'a Coordinates, order: Order) -> Self {
        let mut fronts = Self { g, coordinates, order, front: BTreeSet::from([output]), users: BTreeMap::new() };
        for node in differentiable(g, &[output], order) {
            for operand in fronts.operands(node) {
                *fronts.users.entry(operand).or_insert(0) += 1;
            }
        }
        fronts
    }

    /// Returns the moving operands of a node, each once; none of a coordinate.
    fn operands(&self, node: NodeId) -> BTreeSet<NodeId> {
        if self.coordinates.seeds.contains_key(&node) {
            return BTreeSet::new();
        }
        moving_operands(self.g, node, self.order).into_iter().filter(|&operand| self.g.varies(operand)).collect()
    }

    /// Replaces the node whose operands are the fewest that are new, of equals the last one. Returns whether there was
    /// one.
    fn advance(&mut self) -> bool {
        let is_free =
            |node: &&NodeId| !self.coordinates.seeds.contains_key(node) && self.users.get(node).is_none_or(|n| *n == 0);
        let new = |node: &&NodeId| self.operands(**node).difference(&self.front).count();
        let free = self.front.iter().rev().filter(is_free).take(COMPARED);
        let Some(&next) = free.min_by_key(new) else { return false };
        self.front.remove(&next);
        for operand in self.operands(next) {
            *self.users.entry(operand).or_insert(1) -= 1;
            self.front.insert(operand);
        }
        true
    }

    fn is_inner(&self) -> bool {
        self.front.iter().any(|node| !self.coordinates.seeds.contains_key(node))
    }
}

/// How many numbers a waist has, at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Width {
    /// Fewer than there are coordinates.
    Narrower,
    /// As many as there are coordinates.
    AsWide,
}

/// The most waists of a formula, but for the linear one.
const MOST_WAISTS: usize = 5;
/// The most products ∇c ∇cᵀ of a waist. More take long to write down.
const MOST_PRODUCTS: usize = 1_000_000;

/// Returns the narrow parts of the graph between the coordinates and U: fronts that are narrower than all that are
/// closer to the coordinates, and linear functions of the coordinates. Of many, it returns those of few nodes and the
/// one that is closest to the coordinates.
pub(super) fn waists(
    g: &Graph,
    output: NodeId,
    coordinates: &Coordinates,
    order: Order,
    width: Width,
) -> Vec<Vec<NodeId>> {
    let narrower = match width {
        // A function of one number may be one of another number.
        Width::Narrower => coordinates.len().saturating_sub(1).max(1),
        Width::AsWide => coordinates.len(),
    };
    let widest = narrower.min(MOST_PRODUCTS / coordinates.len().pow(2).max(1));
    let mut fronts = Fronts::new(g, output, coordinates, order);
    let mut waists: Vec<Vec<NodeId>> = Vec::new();
    while fronts.advance() {
        let size = fronts.front.len();
        if fronts.is_inner() && size <= widest {
            waists.retain(|waist| waist.len() < size);
            waists.push(fronts.front.iter().copied().collect());
        }
    }
    if let Some(last) = waists.len().checked_sub(1).filter(|&last| last >= MOST_WAISTS) {
        waists.swap(MOST_WAISTS - 1, last);
        waists.truncate(MOST_WAISTS);
    }
    let linear = LinearPart::new(g, output, coordinates, order).front().filter(|cut| !waists.contains(cut));
    waists.into_iter().chain(linear).collect()
}

/// The robust primitives that depend on no other one.
pub(super) struct Primitives {
    /// The primitives.
    lowest: BTreeSet<NodeId>,
    /// The nodes by which paths from the coordinates to U lead around them.
    around: BTreeSet<NodeId>,
    /// What the coordinates reach without a primitive, and the primitives, each with its moving operands.
    below: BTreeMap<NodeId, Vec<NodeId>>,
}

impl Primitives {
    /// Finds the primitives of U. `None` if there are fewer than two, or one has no second derivatives.
    pub(super) fn new(g: &Graph, output: NodeId, coordinates: &Coordinates) -> Option<Self> {
        let nodes = differentiable(g, &[output], Order::Second);
        // Nodes that depend on a coordinate, and on some primitive.
        let (mut moving, mut above): (BTreeSet<NodeId>, BTreeSet<NodeId>) = Default::default();
        let mut found = Self { lowest: BTreeSet::new(), around: BTreeSet::new(), below: BTreeMap::new() };
        for &node in &nodes {
            let is_coordinate = coordinates.seeds.contains_key(&node);
            let mut operands = if is_coordinate { Vec::new() } else { moving_operands(g, node, Order::Second) };
            operands.retain(|operand| moving.contains(operand));
            if operands.is_empty() && !is_coordinate {
                continue;
            }
            moving.insert(node);
            let is_primitive = match g.rule(node) {
                Some(rule) if g.collapsed_to(node).is_none() && !g.is_spelled_out(rule) => {
                    rule.second.as_ref()?;
                    true
                }
                _ => false,
            };
            let (fed, others): (Vec<NodeId>, _) = operands.iter().partition(|operand| above.contains(operand));
            if fed.is_empty() {
                found.below.insert(node, operands);
                found.lowest.extend(is_primitive.then_some(node));
            } else {
                found.around.extend(others);
            }
            if is_primitive || !fed.is_empty() {
                above.insert(node);
            }
        }
        (found.lowest.len() > 1 && !found.lowest.contains(&output)).then_some(found)
    }

    /// Returns the primitives, if all paths lead through them and they are not more than the coordinates.
    pub(super) fn alone(&self, coordinates: &Coordinates) -> Option<Vec<NodeId>> {
        let is_cut = self.around.is_empty() && self.lowest.len() <= coordinates.len();
        is_cut.then(|| self.lowest.iter().copied().collect())
    }

    /// Returns the primitives with what leads around them, or the fewest nodes below if these are more than the
    /// coordinates: the sine and the cosine of an angle give way to it.
    pub(super) fn with_others(&self, coordinates: &Coordinates) -> Option<Vec<NodeId>> {
        let all: BTreeSet<NodeId> = self.lowest.union(&self.around).copied().collect();
        let cut = match all.len() <= coordinates.len() {
            true => all.into_iter().collect(),
            false => vertex_cut::narrowest(&all, &self.below),
        };
        cut.iter().any(|node| !coordinates.seeds.contains_key(node)).then_some(cut)
    }
}
