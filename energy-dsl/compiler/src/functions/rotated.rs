//! Inner products of rotated vectors. Rotations keep inner products: with a unit quaternion q, (q a q*)·(q b q* + τ −
//! c) = a·b + (q a q*)·(τ − c). So b need not be rotated, nor its rotation differentiated.

use super::inner_product::inner_product;
use super::quaternion::{is_unit, translation};
use crate::graph::{Graph, NodeId, Op, Origin};

/// Recognises the product of a rotated vector with a vector that the same unit quaternion transformed, or with the
/// difference of such a vector and another one.
pub(super) fn recognise_rotated_product(g: &mut Graph, x: &[NodeId], y: &[NodeId]) -> Option<NodeId> {
    with_rotated(g, x, y).or_else(|| with_rotated(g, y, x))
}

fn with_rotated(g: &mut Graph, rotated: &[NodeId], other: &[NodeId]) -> Option<NodeId> {
    let Origin::Rotated { quaternion, vector } = g.origin(rotated)?.clone() else { return None };
    if !is_unit(g, &quaternion) {
        return None;
    }
    if let Some((b, shift)) = moved_by(g, &quaternion, other) {
        return Some(product(g, [&vector, &b], rotated, shift));
    }
    let [minuends, subtrahends] = differences(g, other)?;
    if let Some((b, shift)) = moved_by(g, &quaternion, &minuends) {
        let rest = difference(g, shift, subtrahends);
        return Some(product(g, [&vector, &b], rotated, Some(rest)));
    }
    let (b, shift) = moved_by(g, &quaternion, &subtrahends)?;
    let rest = difference(g, shift, minuends);
    let product = product(g, [&vector, &b], rotated, Some(rest));
    Some(g.neg(product))
}

/// Returns b and τ of q b q* + τ; τ is `None` if nothing is added.
fn moved_by(g: &mut Graph, by: &[NodeId], components: &[NodeId]) -> Option<(Vec<NodeId>, Option<Vec<NodeId>>)> {
    match g.origin(components)?.clone() {
        Origin::Rotated { quaternion, vector } if quaternion == by => Some((vector, None)),
        Origin::Transformed { quaternion, dual, vector } if quaternion == by => {
            Some((vector, Some(translation(g, by, &dual))))
        }
        _ => None,
    }
}

/// Returns a·b + (q a q*)·rest.
fn product(g: &mut Graph, [a, b]: [&[NodeId]; 2], rotated: &[NodeId], rest: Option<Vec<NodeId>>) -> NodeId {
    let kept = inner_product(g, a, b);
    match rest {
        Some(rest) => {
            let along = inner_product(g, rotated, &rest);
            g.add(kept, along)
        }
        None => kept,
    }
}

/// Returns shift − off.
fn difference(g: &mut Graph, shift: Option<Vec<NodeId>>, off: Vec<NodeId>) -> Vec<NodeId> {
    match shift {
        Some(shift) => shift.into_iter().zip(off).map(|(shift, off)| g.sub(shift, off)).collect(),
        None => off.into_iter().map(|off| g.neg(off)).collect(),
    }
}

/// Returns minuends and subtrahends if all components are differences.
fn differences(g: &Graph, components: &[NodeId]) -> Option<[Vec<NodeId>; 2]> {
    let pairs: Option<Vec<_>> = components
        .iter()
        .map(|&component| match g.op(component) {
            Op::Sub(minuend, subtrahend) => Some((minuend, subtrahend)),
            _ => None,
        })
        .collect();
    let (minuends, subtrahends) = pairs?.into_iter().unzip();
    Some([minuends, subtrahends])
}
