//! The part of a formula that is linear in its coordinates, and cuts through it.

use std::collections::{BTreeMap, BTreeSet};

use super::coordinates::Coordinates;
use super::local::Order;
use super::{differentiable, moving_operands, vertex_cut};
use crate::graph::{Graph, NodeId};

/// The linear functions of the coordinates in a formula U.
pub(super) struct LinearPart<'a> {
    coordinates: &'a Coordinates,
    /// Each with the moving nodes that it is computed from; none for a coordinate.
    operands: BTreeMap<NodeId, Vec<NodeId>>,
    /// Those that other functions are computed from.
    front: BTreeSet<NodeId>,
}

impl<'a> LinearPart<'a> {
    pub(super) fn new(g: &Graph, output: NodeId, coordinates: &'a Coordinates, order: Order) -> Self {
        let mut part = Self { coordinates, operands: BTreeMap::new(), front: BTreeSet::new() };
        for node in differentiable(g, &[output], order) {
            let mut moving = moving_operands(g, node, order);
            moving.retain(|&operand| g.varies(operand));
            if coordinates.seeds.contains_key(&node) {
                part.operands.insert(node, Vec::new());
            } else if g.is_linear(node) && moving.iter().all(|operand| part.operands.contains_key(operand)) {
                part.operands.insert(node, moving);
            } else {
                part.front.extend(moving.into_iter().filter(|operand| part.operands.contains_key(operand)));
            }
        }
        part
    }

    /// Returns the linear functions that U is computed from, unless they are more than the coordinates.
    pub(super) fn front(&self) -> Option<Vec<NodeId>> {
        self.useful(self.front.iter().copied().collect())
    }

    /// Returns the fewest linear functions through which the coordinates enter, if they are fewer than that: the means
    /// of two sets of points, if U is computed from the differences of these means.
    pub(super) fn narrowest(&self) -> Option<Vec<NodeId>> {
        let cut = vertex_cut::narrowest(&self.front, &self.operands);
        self.useful(cut).filter(|cut| cut.len() < self.front.len())
    }

    fn useful(&self, cut: Vec<NodeId>) -> Option<Vec<NodeId>> {
        let is_inner = cut.iter().any(|node| !self.coordinates.seeds.contains_key(node));
        (is_inner && cut.len() > 1 && cut.len() <= self.coordinates.len()).then_some(cut)
    }
}
