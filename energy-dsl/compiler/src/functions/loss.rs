//! Robust losses, quadratic near 0 and linear far away.

use super::elementary::two_scalars;
use super::{Function, Lowered, Units};
use crate::graph::{Form, Graph, NodeId, Primitive, Rule};
use energy_runtime::Flag;

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "huber",
        usage: "huber(x, δ)",
        docs: "x²/2 if |x| ≤ δ, else δ (|x| − δ/2), with δ > 0. At |x| = δ the second derivative is the inner one, \
             and flagged.",
        shape: two_scalars,
        units: Units::SquareOfSame,
        lower: |g, a| Lowered::scalar(huber(g, a[0].node(), a[1].node())),
        accuracy: "2 / 0 / 0",
    },
    Function {
        name: "pseudo_huber",
        usage: "pseudo_huber(x, δ)",
        docs: "δ² (√(1 + (x/δ)²) − 1), δ > 0, accurate near 0.",
        shape: two_scalars,
        units: Units::SquareOfSame,
        lower: |g, a| Lowered::scalar(pseudo_huber(g, a[0].node(), a[1].node())),
        accuracy: "4 / 4 / 8",
    },
];

/// Creates c (x − c/2) with c = x clamped to ±δ. The first derivatives are c with respect to x; 0 inside and |x| − δ
/// outside with respect to δ.
fn huber(g: &mut Graph, x: NodeId, delta: NodeId) -> NodeId {
    let (null, one, half) = (g.constant(0.0), g.constant(1.0), g.constant(0.5));
    let magnitude = g.abs(x);
    let inside = g.less_or_equal(magnitude, delta);
    if g.form() == Form::Textbook {
        let (square, halved) = (g.mul(x, x), g.mul(half, delta));
        let (quadratic, excess) = (g.mul(half, square), g.sub(magnitude, halved));
        let linear = g.mul(delta, excess);
        return g.select(inside, quadratic, linear);
    }
    let opposite = g.neg(delta);
    let least = g.max(x, opposite);
    let clamped = g.min(least, delta);
    let halved = g.mul(half, clamped);
    let rest = g.sub(x, halved);
    let value = g.mul(clamped, rest);
    let beyond = g.sub(magnitude, delta);
    let by_delta = g.select(inside, null, beyond);
    let curvature = g.select(inside, one, null);
    let negative = g.less(x, null);
    let minus_one = g.constant(-1.0);
    let sign = g.select(negative, minus_one, one);
    let mixed = g.select(inside, null, sign);
    let softening = g.sub(curvature, one);
    let corner = g.equal(magnitude, delta);
    let second = vec![curvature, mixed, softening];
    let rule = Rule::smooth(Primitive::Huber, vec![x, delta], value, vec![clamped, by_delta], second);
    g.add_rule(rule.flagged(2, Flag::Kink, corner), &[])
}

/// Creates x²/(1 + s) with s = √(1 + (x/δ)²). The first derivative is x/s, the second 1/s³. With a moving threshold the
/// formula is differentiated as written.
fn pseudo_huber(g: &mut Graph, x: NodeId, delta: NodeId) -> NodeId {
    let one = g.constant(1.0);
    let ratio = g.div(x, delta);
    let square = g.mul(ratio, ratio);
    let sum = g.add(one, square);
    let s = g.sqrt(sum);
    if g.form() == Form::Textbook {
        let (area, excess) = (g.mul(delta, delta), g.sub(s, one));
        return g.mul(area, excess);
    }
    let (numerator, denominator) = (g.mul(x, x), g.add(one, s));
    let value = g.div(numerator, denominator);
    if g.varies(delta) {
        return value;
    }
    let reciprocal = g.div(one, s);
    let first = g.mul(x, reciprocal);
    let second = g.product(None, &[reciprocal, reciprocal, reciprocal]);
    g.add_rule(Rule::smooth(Primitive::PseudoHuber, vec![x], value, vec![first], vec![second]), &[delta])
}
