//! The tangent, and the inverse sine, cosine and tangent.

use super::elementary::one_scalar;
use super::{Function, Lowered, Units};
use crate::graph::{Form, Graph, NodeId, Primitive, Rule};
use energy_runtime::Flag;

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "tan",
        usage: "tan(x)",
        docs: "Tangent of an angle in radians.",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(tan(g, a[0].node())),
        accuracy: "3 / 5 / 7",
    },
    Function {
        name: "asin",
        usage: "asin(x)",
        docs: "The angle in [−π/2, π/2] whose sine is x. If |x| > 1, x is clamped and flagged. If |x| ≥ 1, the \
             derivatives are taken as 0 and flagged. `asin(dot(unit(a), unit(b)))`, the angle between a vector and a \
             plane, is compiled without the product.",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(asin(g, a[0].node())),
        accuracy: "3 / 3 / 8",
    },
    Function {
        name: "acos",
        usage: "acos(x)",
        docs: "The angle in [0, π] whose cosine is x, clamped and flagged like `asin`. `acos(dot(unit(a), unit(b)))` \
             is compiled as `angle(a, b)`.",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(acos(g, a[0].node())),
        accuracy: "3 / 3 / 8",
    },
    Function {
        name: "atan",
        usage: "atan(x)",
        docs: "The angle in (−π/2, π/2) whose tangent is x. For a quotient y/x, use `atan2(y, x)`.",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(atan(g, a[0].node())),
        accuracy: "1 / 4 / 6",
    },
];

/// Creates atan x. The first derivative is 1/(1 + x²), the second −2x/(1 + x²)². Beyond ±1 they are computed from 1/x,
/// so that no square overflows.
fn atan(g: &mut Graph, x: NodeId) -> NodeId {
    let one = g.constant(1.0);
    let value = g.atan2(x, one);
    if g.form() == Form::Textbook {
        return value;
    }
    let (minus_two, magnitude, reciprocal) = (g.constant(-2.0), g.abs(x), g.div(one, x));
    let far = g.less(one, magnitude);
    let inner = g.select(far, reciprocal, x);
    let square = g.mul(inner, inner);
    let sum = g.add(one, square);
    let near = g.div(one, sum);
    let across = g.mul(square, near);
    let first = g.select(far, across, near);
    // x/(1 + x²) = r/(1 + r²) with r = 1/x.
    let second = g.product(None, &[minus_two, inner, near, first]);
    g.add_rule(Rule::smooth(Primitive::ArcTangent, vec![x], value, vec![first], vec![second]), &[])
}

/// Creates sin x / cos x. The first derivative is 1/cos² x, the second 2 tan x / cos² x.
fn tan(g: &mut Graph, x: NodeId) -> NodeId {
    let (sine, cosine) = (g.sin(x), g.cos(x));
    let value = g.div(sine, cosine);
    if g.form() == Form::Textbook {
        return value;
    }
    let (one, two) = (g.constant(1.0), g.constant(2.0));
    let reciprocal = g.div(one, cosine);
    let first = g.mul(reciprocal, reciprocal);
    let second = g.product(None, &[two, value, first]);
    g.add_rule(Rule::smooth(Primitive::Tangent, vec![x], value, vec![first], vec![second]), &[])
}

fn acos(g: &mut Graph, x: NodeId) -> NodeId {
    match vectors_of_cosine(g, x) {
        Some(vectors) => super::angle::between(g, &vectors[..3], &vectors[3..]),
        None => arc(g, x, Primitive::ArcCosine),
    }
}

fn asin(g: &mut Graph, x: NodeId) -> NodeId {
    match vectors_of_cosine(g, x) {
        Some(vectors) => super::angle::elevation(g, &vectors[..3], &vectors[3..]),
        None => arc(g, x, Primitive::ArcSine),
    }
}

/// Returns the two vectors of the cosine of an angle.
fn vectors_of_cosine(g: &Graph, x: NodeId) -> Option<Vec<NodeId>> {
    let rule = g.rule(x).filter(|rule| g.form() == Form::Robust && rule.primitive == Primitive::Cosine)?;
    Some(rule.arguments.clone())
}

/// Creates asin x = atan2(x, c) or acos x = atan2(c, x) with c = √((1 − x)(1 + x)). The first derivatives are ±1/c, the
/// second ±x/c³.
fn arc(g: &mut Graph, x: NodeId, primitive: Primitive) -> NodeId {
    let (null, one, minus_one) = (g.constant(0.0), g.constant(1.0), g.constant(-1.0));
    let is_sine = primitive == Primitive::ArcSine;
    let below = g.max(x, minus_one);
    let clamped = g.min(below, one);
    let (left, right) = (g.sub(one, clamped), g.add(one, clamped));
    let square = g.mul(left, right);
    let other = g.sqrt(square);
    let value = if is_sine { g.atan2(clamped, other) } else { g.atan2(other, clamped) };
    if g.form() == Form::Textbook {
        return value;
    }
    let reciprocal = g.div(one, other);
    let end = g.equal(square, null);
    let reciprocal = g.select(end, null, reciprocal);
    let second = g.product(None, &[clamped, reciprocal, reciprocal, reciprocal]);
    let magnitude = g.abs(x);
    let outside = g.less(one, magnitude);
    let (first, second) = if is_sine { (reciprocal, second) } else { (g.neg(reciprocal), g.neg(second)) };
    let rule = Rule::smooth(primitive, vec![x], value, vec![first], vec![second]);
    g.add_rule(rule.flagged(0, Flag::Degenerate, outside).flagged(1, Flag::Degenerate, end), &[])
}
