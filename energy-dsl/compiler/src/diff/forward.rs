use std::collections::BTreeMap;

use super::coordinates::Coordinates;
use super::local::{Order, local};
use super::outer_products::{AsTheyCome, Summation};
use super::{accumulate, differentiable};
use crate::graph::{ComputedAs, Graph, NodeId, Op};

/// Dual parts that are not identically zero, by increasing coordinate.
pub type Sparse = Vec<(usize, NodeId)>;

/// Returns Σ factorᵢ · partsᵢ.
pub(super) fn combine(g: &mut Graph, terms: &[(NodeId, &Sparse)]) -> Sparse {
    let mut sums: BTreeMap<usize, NodeId> = BTreeMap::new();
    for &(factor, parts) in terms {
        for &(coordinate, part) in parts {
            let term = g.mul(factor, part);
            accumulate(g, &mut sums, coordinate, term);
        }
    }
    sums.into_iter().filter(|&(_, sum)| !g.is(sum, 0.0)).collect()
}

/// Returns mask ? a : b for each dual part.
fn choose(g: &mut Graph, mask: NodeId, a: &Sparse, b: &Sparse) -> Sparse {
    joined(g, a, b, |g, a, b| g.select(mask, a, b))
}

/// Joins the dual parts of each coordinate.
fn joined(g: &mut Graph, a: &Sparse, b: &Sparse, join: impl Fn(&mut Graph, NodeId, NodeId) -> NodeId) -> Sparse {
    let zero = g.constant(0.0);
    let mut places: Vec<usize> = a.iter().chain(b).map(|&(c, _)| c).collect();
    places.sort_unstable();
    places.dedup();
    let find = |parts: &Sparse, place: usize| parts.iter().find(|&&(c, _)| c == place).map_or(zero, |&(_, n)| n);
    places.into_iter().map(|c| (c, join(g, find(a, c), find(b, c)))).collect()
}

/// Returns the first derivatives of all nodes between the coordinates and `outputs`.
pub(super) fn tangents(
    g: &mut Graph,
    outputs: &[NodeId],
    coordinates: &Coordinates,
    order: Order,
) -> BTreeMap<NodeId, Sparse> {
    tangents_by(g, outputs, coordinates, order, &AsTheyCome::default())
}

/// Returns the same, with sums that are added up in some way.
pub(super) fn tangents_by(
    g: &mut Graph,
    outputs: &[NodeId],
    coordinates: &Coordinates,
    order: Order,
    sums: &impl Summation,
) -> BTreeMap<NodeId, Sparse> {
    let mut tangents: BTreeMap<NodeId, Sparse> = coordinates.seeds.clone();
    for node in differentiable(g, outputs, order) {
        if tangents.contains_key(&node) {
            continue;
        }
        let none = Sparse::new();
        let of = |node| tangents.get(&node).unwrap_or(&none);
        let parts = match (g.op(node), g.computed_as(node)) {
            (Op::Select(mask, a, b), _) => choose(g, mask, of(a), of(b)),
            (_, Some(ComputedAs { computed, defined, slopes: true })) if order == Order::FirstToDifferentiate => {
                joined(g, of(defined), of(computed), |g, x, y| g.compute_as(x, y, false))
            }
            _ => {
                let local = local(g, node, order);
                let factors: Vec<_> = local.first.iter().map(|f| g.product(None, f)).collect();
                let terms: Vec<_> =
                    local.operands.iter().zip(factors).filter_map(|(o, f)| Some((f, tangents.get(o)?))).collect();
                sums.combine(g, &terms)
            }
        };
        tangents.insert(node, parts);
    }
    tangents
}

/// Returns the first derivatives of each output with respect to each coordinate, including zeros. `order` says whether
/// they are differentiated again.
pub fn first_derivatives(
    g: &mut Graph,
    outputs: &[NodeId],
    coordinates: &Coordinates,
    order: Order,
) -> Vec<Vec<NodeId>> {
    let tangents = tangents(g, outputs, coordinates, order);
    let none = Sparse::new();
    outputs.iter().map(|output| dense(g, tangents.get(output).unwrap_or(&none), coordinates.len())).collect()
}

/// Returns dual parts with zeros in between.
pub(super) fn dense(g: &mut Graph, parts: &Sparse, n: usize) -> Vec<NodeId> {
    let mut dense = vec![g.constant(0.0); n];
    for &(c, part) in parts {
        dense[c] = part;
    }
    dense
}

/// Returns the second dual parts: entry (i, j), i ≤ j, at index i·n + j.
pub fn second_derivatives(g: &mut Graph, output: NodeId, coordinates: &Coordinates) -> BTreeMap<usize, NodeId> {
    let n = coordinates.len();
    let tangents = tangents(g, &[output], coordinates, Order::Second);
    let mut curvatures: BTreeMap<NodeId, Sparse> = BTreeMap::new();
    let none = Sparse::new();
    for node in differentiable(g, &[output], Order::Second) {
        if coordinates.seeds.contains_key(&node) {
            continue;
        }
        if let Op::Select(mask, a, b) = g.op(node) {
            let (a, b) = (curvatures.get(&a).unwrap_or(&none), curvatures.get(&b).unwrap_or(&none));
            let parts = choose(g, mask, a, b);
            curvatures.insert(node, parts);
            continue;
        }
        let local = local(g, node, Order::Second);
        let mut own: Vec<(NodeId, Sparse)> = Vec::new();
        for (i, j, products_of) in &local.second {
            let (i, j) = (*i, *j);
            let factor = g.sum_of_products(None, products_of);
            let (a, b) = (&local.operands[i], &local.operands[j]);
            let (Some(a), Some(b)) = (tangents.get(a), tangents.get(b)) else { continue };
            own.push((factor, products(g, a, b, i == j, n)));
        }
        let factors: Vec<_> = local.first.iter().map(|f| g.product(None, f)).collect();
        let chained =
            local.operands.iter().zip(factors).filter_map(|(o, f)| Some((f, curvatures.get(o)?))).collect::<Vec<_>>();
        let terms: Vec<_> = chained.into_iter().chain(own.iter().map(|(f, p)| (*f, p))).collect();
        let parts = combine(g, &terms);
        curvatures.insert(node, parts);
    }
    curvatures.remove(&output).unwrap_or_default().into_iter().collect()
}

/// Returns the upper triangle of a aᵀ, or of a bᵀ + b aᵀ.
pub(super) fn products(g: &mut Graph, a: &Sparse, b: &Sparse, same: bool, n: usize) -> Sparse {
    let mut sums: BTreeMap<usize, NodeId> = BTreeMap::new();
    for &(i, x) in a {
        for &(j, y) in b {
            if same && i > j {
                continue;
            }
            let product = g.mul(x, y);
            match (same, i.cmp(&j)) {
                (false, std::cmp::Ordering::Equal) => {
                    let two = g.constant(2.0);
                    let doubled = g.mul(two, product);
                    accumulate(g, &mut sums, i * n + j, doubled);
                }
                _ => accumulate(g, &mut sums, i.min(j) * n + i.max(j), product),
            }
        }
    }
    sums.into_iter().collect()
}
