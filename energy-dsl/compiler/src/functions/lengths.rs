//! Recognises ‖a‖‖b‖ ± a·b, the divisor of the curvature of discrete rods 2 a×b/(‖a‖‖b‖ + a·b), and 1 ± a·b/(‖a‖‖b‖).
//! They cancel where a and b are nearly opposite, or parallel. ‖a‖‖b‖ (1 ± cos φ) does not: 1 ± cos φ is a primitive of
//! the angle φ.

use super::angle::one_minus_cosine;
use crate::graph::{Graph, NodeId, Op, Primitive};

/// Recognises ‖a‖‖b‖ + a·b.
pub(super) fn recognise_lengths_plus_dot(g: &mut Graph, x: NodeId, y: NodeId) -> Option<NodeId> {
    lengths_and_dot(g, x, y, false).or_else(|| lengths_and_dot(g, y, x, false))
}

/// Recognises ‖a‖‖b‖ − a·b and a·b − ‖a‖‖b‖.
pub(super) fn recognise_lengths_minus_dot(g: &mut Graph, x: NodeId, y: NodeId) -> Option<NodeId> {
    lengths_and_dot(g, x, y, true).or_else(|| {
        let opposite = lengths_and_dot(g, y, x, true)?;
        Some(g.neg(opposite))
    })
}

/// Recognises 1 + a·b/(‖a‖‖b‖).
pub(super) fn recognise_one_plus_quotient(g: &mut Graph, x: NodeId, y: NodeId) -> Option<NodeId> {
    let quotient = if g.is(x, 1.0) { y } else { x };
    (g.is(x, 1.0) || g.is(y, 1.0)).then(|| one_minus_quotient(g, quotient, false))?
}

/// Recognises 1 − a·b/(‖a‖‖b‖).
pub(super) fn recognise_one_minus_quotient(g: &mut Graph, one: NodeId, quotient: NodeId) -> Option<NodeId> {
    g.is(one, 1.0).then(|| one_minus_quotient(g, quotient, true))?
}

fn one_minus_quotient(g: &mut Graph, quotient: NodeId, negative: bool) -> Option<NodeId> {
    let (quotient, minus) = g.magnitude(quotient);
    let Op::Div(above, below) = g.op(quotient) else { return None };
    // a·b/‖a‖/‖b‖ is the same.
    let (dot, [a, b]) = match (vectors_of_lengths(g, below), g.op(above)) {
        (Some(vectors), _) => (above, vectors),
        (None, Op::Div(dot, first)) => (dot, [vector_of_length(g, first)?, vector_of_length(g, below)?]),
        _ => return None,
    };
    let opposite = is_dot(g, dot, &a, &b)? != minus;
    let arguments = turned(g, [a, b], negative != opposite);
    Some(one_minus_cosine(g, arguments))
}

/// Returns the components of a and b, or of a and −b.
fn turned(g: &mut Graph, [a, b]: [Vec<NodeId>; 2], same: bool) -> Vec<NodeId> {
    let b = if same { b } else { b.iter().map(|&x| g.neg(x)).collect() };
    [a, b].concat()
}

fn lengths_and_dot(g: &mut Graph, lengths: NodeId, dot: NodeId, negative: bool) -> Option<NodeId> {
    let [a, b] = vectors_of_lengths(g, lengths)?;
    let opposite = is_dot(g, dot, &a, &b)?;
    let arguments = turned(g, [a, b], negative != opposite);
    let one_minus = one_minus_cosine(g, arguments);
    Some(g.mul(lengths, one_minus))
}

/// Returns a and b of ‖a‖‖b‖, two different vectors in space.
fn vectors_of_lengths(g: &Graph, product: NodeId) -> Option<[Vec<NodeId>; 2]> {
    let Op::Mul(x, y) = g.op(product) else { return None };
    (x != y).then_some([vector_of_length(g, x)?, vector_of_length(g, y)?])
}

/// Returns the vector in space whose length a node is.
fn vector_of_length(g: &Graph, length: NodeId) -> Option<Vec<NodeId>> {
    let rule = g.rule(length).filter(|rule| rule.primitive == Primitive::Norm)?;
    rule.vector.clone().filter(|vector| vector.len() == 3)
}

/// Returns whether a sum of products is −a·b; `None` if it is neither a·b nor −a·b.
fn is_dot(g: &Graph, sum: NodeId, a: &[NodeId], b: &[NodeId]) -> Option<bool> {
    let mut found = products(g, sum)?;
    let mut expected: Vec<Signed> = Vec::new();
    for (&x, &y) in a.iter().zip(b) {
        if !g.is(x, 0.0) && !g.is(y, 0.0) {
            expected.push(signed_pair(g, x, y));
        }
    }
    found.sort_unstable();
    expected.sort_unstable();
    let opposite = |list: &[Signed]| list.iter().map(|&(minus, x, y)| (!minus, x, y)).collect::<Vec<_>>();
    match () {
        () if expected.is_empty() => None,
        () if found == expected => Some(false),
        () => {
            let mut opposite = opposite(&found);
            opposite.sort_unstable();
            (opposite == expected).then_some(true)
        }
    }
}

/// A product of two numbers: whether it is subtracted, and its factors in order.
type Signed = (bool, NodeId, NodeId);

fn signed_pair(g: &Graph, x: NodeId, y: NodeId) -> Signed {
    let ((x, minus_x), (y, minus_y)) = (g.magnitude(x), g.magnitude(y));
    (minus_x != minus_y, x.min(y), x.max(y))
}

/// Returns the products that a node sums, at most three.
fn products(g: &Graph, sum: NodeId) -> Option<Vec<Signed>> {
    let mut found = Vec::new();
    let mut open = vec![(g.resolve(sum), false)];
    while let Some((node, minus)) = open.pop() {
        match g.op(node) {
            Op::Neg(x) => open.push((g.resolve(x), !minus)),
            Op::Add(x, y) => open.extend([(x, minus), (y, minus)]),
            Op::Sub(x, y) => open.extend([(x, minus), (y, !minus)]),
            Op::Mul(x, y) if found.len() < 3 => {
                let (inner, x, y) = signed_pair(g, x, y);
                found.push((inner != minus, x, y));
            }
            _ => return None,
        }
    }
    Some(found)
}
