//! ln(1 + x), eˣ − 1 and related functions, without cancellation at 0.

use super::elementary::{one_scalar, two_scalars};
use super::power_series::polynomial;
use super::{Function, Lowered, Shape, Units};
use crate::graph::{Form, Graph, NodeId, Op, Primitive, Rule};

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "log",
        usage: "log(x) or log(q)",
        docs: "Natural logarithm, x > 0. `log(1 + x)` is compiled as `log1p(x)`. Of a unit quaternion q, its rotation \
             vector: q turns by the angle |log(q)| ≤ π about it. Regular at the identity. q and −q have the same one; at \
             half a turn its sign jumps, which is flagged.",
        shape: |shapes| if shapes == [Shape::Quat] { Ok(Shape::Vector(3)) } else { one_scalar(shapes) },
        units: Units::Plain,
        lower: |g, a| match a[0].shape {
            Shape::Quat => super::rotation_vector::rotation_vector(g, &a[0]),
            _ => Lowered::scalar(log(g, a[0].node())),
        },
        accuracy: "1",
    },
    Function {
        name: "log1p",
        usage: "log1p(x) or log1p(x, u)",
        docs: "ln(1 + x), x > −1, accurate near 0. Near −1, pass an accurate u = 1 + x as the second argument to \
             avoid cancellation.",
        shape: with_successor,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(of_successor(g, a, log1p, log1p_of)),
        accuracy: "4 / 2 / 4",
    },
    Function {
        name: "log1pmx",
        usage: "log1pmx(x) or log1pmx(x, u)",
        docs: "ln(1 + x) − x, x > −1, accurate near 0, where it is −x²/2. The second argument u = 1 + x is that of \
             `log1p`.",
        shape: with_successor,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(of_successor(g, a, log1pmx, log1pmx_of)),
        accuracy: "8 / 3 / 4",
    },
    Function {
        name: "expm1",
        usage: "expm1(x)",
        docs: "eˣ − 1, accurate near 0. `exp(x) - 1` is compiled to it.",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(expm1(g, a[0].node())),
        accuracy: "4 / 1 / 1",
    },
    Function {
        name: "softplus",
        usage: "softplus(x)",
        docs: "ln(1 + eˣ) = max(x, 0) + log1p(e^(−|x|)), a smooth max(x, 0), without overflow or cancellation.",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(softplus(g, a[0].node())),
        accuracy: "4 / 3 / 5",
    },
];

/// Creates ln x. For 1 + x it is a primitive.
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

/// Creates ln(1 + x) as ln(u) x/(u − 1), where u = 1 + x is rounded: the errors of logarithm and quotient cancel. If u
/// is exact, it is ln u.
pub(super) fn log1p(g: &mut Graph, x: NodeId) -> NodeId {
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

/// The shape rule of x, or of x and 1 + x.
fn with_successor(shapes: &[Shape]) -> Result<Shape, String> {
    match shapes.len() {
        1 => one_scalar(shapes),
        2 => two_scalars(shapes),
        count => Err(format!("takes one or two scalars, but got {}", super::arguments(count))),
    }
}

/// Creates a function of x, from one argument or from two.
fn of_successor(
    g: &mut Graph,
    arguments: &[Lowered],
    of_one: fn(&mut Graph, NodeId) -> NodeId,
    of_two: fn(&mut Graph, NodeId, NodeId) -> NodeId,
) -> NodeId {
    match arguments {
        [x, u] => of_two(g, x.node(), u.node()),
        _ => of_one(g, arguments[0].node()),
    }
}

/// Creates ln u for u = 1 + x, where u and x move together. Near 1, where u has lost digits of x, it uses a series.
fn log1p_of(g: &mut Graph, x: NodeId, u: NodeId) -> NodeId {
    let direct = g.ln(u);
    if g.form() == Form::Textbook {
        return direct;
    }
    let remainder = log1pmx_near_0(g, x);
    let series = g.add(x, remainder);
    let value = near_0(g, x, series, direct);
    let one = g.constant(1.0);
    let first = g.div(one, u);
    let square = g.mul(first, first);
    let second = g.neg(square);
    g.add_rule(Rule::smooth(Primitive::Log1p, vec![x], value, vec![first], vec![second]), &[u])
}

/// Creates ln(1 + x) − x.
pub(super) fn log1pmx(g: &mut Graph, x: NodeId) -> NodeId {
    let (one, logarithm) = (g.constant(1.0), log1p(g, x));
    let u = g.add(one, x);
    let direct = g.sub(logarithm, x);
    log1pmx_rule(g, x, u, direct)
}

/// Creates ln u − x for u = 1 + x, where u and x move together.
fn log1pmx_of(g: &mut Graph, x: NodeId, u: NodeId) -> NodeId {
    let logarithm = g.ln(u);
    let direct = g.sub(logarithm, x);
    log1pmx_rule(g, x, u, direct)
}

/// Uses a series near 0. The derivatives −x/(1 + x) and −1/(1 + x)² do not cancel.
fn log1pmx_rule(g: &mut Graph, x: NodeId, u: NodeId, direct: NodeId) -> NodeId {
    if g.form() == Form::Textbook {
        return direct;
    }
    let series = log1pmx_near_0(g, x);
    let value = near_0(g, x, series, direct);
    let one = g.constant(1.0);
    let reciprocal = g.div(one, u);
    let first = g.mul(x, reciprocal);
    let second = g.mul(reciprocal, reciprocal);
    let (first, second) = (g.neg(first), g.neg(second));
    g.add_rule(Rule::smooth(Primitive::Log1pmx, vec![x], value, vec![first], vec![second]), &[u])
}

/// Selects `series` where |x| < ½.
fn near_0(g: &mut Graph, x: NodeId, series: NodeId, direct: NodeId) -> NodeId {
    let (magnitude, half) = (g.abs(x), g.constant(0.5));
    let near = g.less(magnitude, half);
    g.select(near, series, direct)
}

/// With z = x/(2 + x) and y = z²: ln(1 + x) = 2 artanh z = 2z (1 + y/3 + y²/5 + …) and x − 2z = x z. The difference is
/// z (2y (1/3 + y/5 + …) − x).
fn log1pmx_near_0(g: &mut Graph, x: NodeId) -> NodeId {
    // Adds terms until the next one is below 2⁻⁵⁶ of the first, at the largest y (x = −½).
    const LARGEST: f64 = 1.0 / 9.0;
    let last = (0..).find(|&k| LARGEST.powi(k + 1) * 3.0 / f64::from(2 * k + 5) < 2.0_f64.powi(-56)).unwrap_or(0);
    let two = g.constant(2.0);
    let denominator = g.add(two, x);
    let z = g.div(x, denominator);
    let y = g.mul(z, z);
    let tail = polynomial(g, y, (0..=last).map(|k| 2.0 / f64::from(2 * k + 3)).collect());
    let product = g.mul(y, tail);
    let difference = g.sub(product, x);
    g.mul(z, difference)
}

/// Creates eˣ − 1. For |x| < 1 it is (u − 1) x/ln u with u = eˣ rounded: the errors cancel.
pub(super) fn expm1(g: &mut Graph, x: NodeId) -> NodeId {
    let u = g.exp(x);
    let plain = plain_expm1(g, u);
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

/// Creates u − 1 for u = eˣ. `sub` would recognise it as `expm1` again.
pub(super) fn plain_expm1(g: &mut Graph, u: NodeId) -> NodeId {
    let minus_one = g.constant(-1.0);
    g.add(u, minus_one)
}

/// Recognises eˣ − 1 and 1 − eˣ.
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

/// Creates ln(1 + eˣ). The first derivative is 1/(1 + e⁻ˣ), the second e^(−|x|)/(1 + e^(−|x|))².
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
