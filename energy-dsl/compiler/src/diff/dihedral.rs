//! Recognises functions of one dihedral angle.

use std::collections::BTreeSet;

use super::coordinates::Coordinates;
use super::local::Order;
use super::moving_operands;
use crate::graph::{Graph, Input, NodeId, Op, Primitive};

/// Returns the points x₁, x₂, x₃ and x₄ of a dihedral angle, if all paths from points to `output` pass through it and
/// the coordinates are its arguments x₄ − x₃, x₁ − x₃ and x₂ − x₃, in this order. `None` for all other functions.
pub fn only_dihedral(g: &Graph, output: NodeId, coordinates: &Coordinates) -> Option<[usize; 4]> {
    let mut angle = None;
    let mut seen = BTreeSet::new();
    let mut stack = vec![output];
    while let Some(node) = stack.pop() {
        if !g.varies(node) || !seen.insert(node) {
            continue;
        }
        if g.rule(node).is_some_and(|rule| rule.primitive == Primitive::Dihedral) {
            if *angle.get_or_insert(node) != node {
                return None;
            }
        } else if matches!(g.op(node), Op::Input(Input::Position(_) | Input::Velocity(_) | Input::Increment(_))) {
            return None;
        } else {
            stack.extend(moving_operands(g, node, Order::Second));
        }
    }
    let arguments = &g.rule(angle?)?.arguments;
    let is_coordinate = |(number, argument): (usize, &NodeId)| match coordinates.seeds.get(argument).map(Vec::as_slice)
    {
        Some(&[(coordinate, sign)]) => coordinate == number && g.is(sign, 1.0),
        _ => false,
    };
    let reduced = arguments.len() == coordinates.len() && arguments.iter().enumerate().all(is_coordinate);
    match coordinates.vectors.iter().map(Vec::as_slice).collect::<Vec<_>>()[..] {
        [&[(x4, 1.0), (x3, -1.0)], &[(x1, 1.0), (a, -1.0)], &[(x2, 1.0), (b, -1.0)]]
            if reduced && a == x3 && b == x3 =>
        {
            Some([x1, x2, x3, x4])
        }
        _ => None,
    }
}
