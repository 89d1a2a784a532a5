//! ln(1 + x), eˣ − 1 and their kin, without cancellation at 0.

use super::elementary::one_scalar;
use super::{Function, Lowered};
use crate::graph::{Form, Graph, NodeId, Op, Primitive, Rule};

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "log",
        usage: "log(x)",
        docs: "Natural logarithm, x > 0; `log(1 + x)` is `log1p(x)`.",
        shape: one_scalar,
        lower: |g, a| Lowered::scalar(log(g, a[0].node())),
        accuracy: "1",
    },
    Function {
        name: "log1p",
        usage: "log1p(x)",
        docs: "ln(1 + x), x > −1, without cancellation at 0.",
        shape: one_scalar,
        lower: |g, a| Lowered::scalar(log1p(g, a[0].node())),
        accuracy: "4 / 2 / 4",
    },
    Function {
        name: "expm1",
        usage: "expm1(x)",
        docs: "eˣ − 1, without cancellation at 0; so is `exp(x) - 1`.",
        shape: one_scalar,
        lower: |g, a| Lowered::scalar(expm1(g, a[0].node())),
        accuracy: "4 / 1 / 1",
    },
    Function {
        name: "softplus",
        usage: "softplus(x)",
        docs: "ln(1 + eˣ) = max(x, 0) + log1p(e^(−|x|)), a smooth max(x, 0): no overflow, and no digits lost.",
        shape: one_scalar,
        lower: |g, a| Lowered::scalar(softplus(g, a[0].node())),
        accuracy: "4 / 3 / 5",
    },
];

/// ln x, of 1 + x as a primitive.
fn log(g: &mut Graph, x: NodeId) -> NodeId {
    if g.form() == Form::Robust && g.as_constant(x).is_none() {
        match g.op(x) {
            Op::Add(a, b) if g.is(a, 1.0) => return log1p(g, b),
            Op::Add(a, b) if g.is(b, 1.0) => return log1p(g, a),
            Op::Sub(a, b) if g.is(a, 1.0) => {
                let opposite = g.neg(b);
                return log1p(g, opposite);
            }
            _ => {}
        }
    }
    g.ln(x)
}

/// With u = 1 + x rounded, ln(u) x/(u − 1): the errors of logarithm and quotient undo each other. Where the rounding was exact
/// it is ln u itself.
fn log1p(g: &mut Graph, x: NodeId) -> NodeId {
    let one = g.constant(1.0);
    let u = g.add(one, x);
    let direct = g.ln(u);
    if g.form() == Form::Textbook {
        return direct;
    }
    let back = g.sub(u, one);
    let (exact, tiny) = (g.equal(back, x), g.equal(u, one));
    let ratio = g.div(x, back);
    let corrected = g.mul(direct, ratio);
    let value = g.select(tiny, x, corrected);
    let value = g.select(exact, direct, value);
    let first = g.div(one, u);
    let square = g.mul(first, first);
    let second = g.neg(square);
    g.add_rule(Rule::smooth(Primitive::Log1p, vec![x], value, vec![first], vec![second]), &[])
}

/// With u = eˣ rounded, (u − 1) x/ln u for |x| < 1: again the errors undo each other.
fn expm1(g: &mut Graph, x: NodeId) -> NodeId {
    let u = g.exp(x);
    // Not `sub`, which would come back here.
    let minus_one = g.constant(-1.0);
    let plain = g.add(u, minus_one);
    if g.form() == Form::Textbook {
        return plain;
    }
    let (one, logarithm, magnitude) = (g.constant(1.0), g.ln(u), g.abs(x));
    let ratio = g.div(x, logarithm);
    let corrected = g.mul(plain, ratio);
    let (tiny, moderate) = (g.equal(u, one), g.less(magnitude, one));
    let value = g.select(tiny, x, corrected);
    let value = g.select(moderate, value, plain);
    g.add_rule(Rule::smooth(Primitive::Expm1, vec![x], value, vec![u], vec![u]), &[])
}

/// eˣ − 1 and 1 − eˣ, written so.
pub(super) fn recognise_expm1(g: &mut Graph, a: NodeId, b: NodeId) -> Option<NodeId> {
    match (g.op(a), g.op(b)) {
        (Op::Exp(x), _) if g.is(b, 1.0) => Some(expm1(g, x)),
        (_, Op::Exp(x)) if g.is(a, 1.0) => {
            let opposite = expm1(g, x);
            Some(g.neg(opposite))
        }
        _ => None,
    }
}

/// First derivative 1/(1 + e⁻ˣ), second e^(−|x|)/(1 + e^(−|x|))².
fn softplus(g: &mut Graph, x: NodeId) -> NodeId {
    let (null, one) = (g.constant(0.0), g.constant(1.0));
    if g.form() == Form::Textbook {
        let power = g.exp(x);
        let sum = g.add(one, power);
        return g.ln(sum);
    }
    let magnitude = g.abs(x);
    let opposite = g.neg(magnitude);
    let decay = g.exp(opposite);
    let (positive, tail) = (g.max(null, x), log1p(g, decay));
    let value = g.add(positive, tail);
    let sum = g.add(one, decay);
    let larger = g.div(one, sum);
    let smaller = g.mul(decay, larger);
    let negative = g.less(x, null);
    let first = g.select(negative, smaller, larger);
    let second = g.mul(larger, smaller);
    g.add_rule(Rule::smooth(Primitive::Softplus, vec![x], value, vec![first], vec![second]), &[])
}
