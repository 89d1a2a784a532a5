//! Hyperbolic functions, without cancellation at 0.

use super::elementary::one_scalar;
use super::exponential::expm1;
use super::power_series::polynomial;
use super::{Function, Lowered, Units};
use crate::graph::{Form, Graph, NodeId, Primitive, Rule};

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "sinh",
        usage: "sinh(x)",
        docs: "Hyperbolic sine (eˣ − e⁻ˣ)/2, accurate near 0: by its series for |x| < 1. It overflows where \
             e^|x| does.",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(sinh(g, a[0].node())),
        accuracy: "2 / 2 / 2",
    },
    Function {
        name: "cosh",
        usage: "cosh(x)",
        docs: "Hyperbolic cosine (eˣ + e⁻ˣ)/2. It overflows where e^|x| does.",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(cosh(g, a[0].node())),
        accuracy: "2 / 2 / 2",
    },
    Function {
        name: "tanh",
        usage: "tanh(x)",
        docs: "Hyperbolic tangent, accurate near 0 and, with its derivatives, where it tends to ±1.",
        shape: one_scalar,
        units: Units::Plain,
        lower: |g, a| Lowered::scalar(tanh(g, a[0].node())),
        accuracy: "4 / 5 / 7",
    },
];

/// Creates ½ e^|x| and ½ e^(−|x|).
fn half_exponentials(g: &mut Graph, x: NodeId) -> (NodeId, NodeId) {
    let (half, magnitude) = (g.constant(0.5), g.abs(x));
    let grown = g.exp(magnitude);
    let fallen = g.div(half, grown);
    (g.mul(half, grown), fallen)
}

fn sinh_value(g: &mut Graph, x: NodeId) -> NodeId {
    let (grown, fallen) = half_exponentials(g, x);
    let (null, one) = (g.constant(0.0), g.constant(1.0));
    let difference = g.plain_difference(grown, fallen);
    let opposite = g.neg(difference);
    let negative = g.less(x, null);
    let far = g.select(negative, opposite, difference);
    if g.form() == Form::Textbook {
        return far;
    }
    // x + x y (1/3! + y/5! + …) with y = x² < 1.
    let y = g.mul(x, x);
    let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
    let tail = polynomial(g, y, (1..=9).map(|k| 1.0 / factorial(2 * k + 1)).collect());
    let (cube, magnitude) = (g.mul(x, y), g.abs(x));
    let tail = g.mul(cube, tail);
    let series = g.add(x, tail);
    let near = g.less(magnitude, one);
    g.select(near, series, far)
}

fn cosh_value(g: &mut Graph, x: NodeId) -> NodeId {
    let (grown, fallen) = half_exponentials(g, x);
    g.add(grown, fallen)
}

/// Creates sinh x. The first derivative is cosh x, the second sinh x.
fn sinh(g: &mut Graph, x: NodeId) -> NodeId {
    let value = sinh_value(g, x);
    if g.form() == Form::Textbook {
        return value;
    }
    let first = cosh_value(g, x);
    g.add_rule(Rule::smooth(Primitive::HyperbolicSine, vec![x], value, vec![first], vec![value]), &[])
}

/// Creates cosh x. The first derivative is sinh x, the second cosh x.
fn cosh(g: &mut Graph, x: NodeId) -> NodeId {
    let value = cosh_value(g, x);
    if g.form() == Form::Textbook {
        return value;
    }
    let first = sinh_value(g, x);
    g.add_rule(Rule::smooth(Primitive::HyperbolicCosine, vec![x], value, vec![first], vec![value]), &[])
}

/// Creates tanh x = −t/(2 + t) with t = e^(−2|x|) − 1, for x ≥ 0. The first derivative is 4 d/(1 + d)² with
/// d = e^(−2|x|), the second −2 tanh x times the first.
fn tanh(g: &mut Graph, x: NodeId) -> NodeId {
    let (null, one, two, magnitude) = (g.constant(0.0), g.constant(1.0), g.constant(2.0), g.abs(x));
    let minus_two = g.constant(-2.0);
    let exponent = g.mul(minus_two, magnitude);
    let decay = g.exp(exponent);
    let difference = if g.form() == Form::Textbook { g.plain_difference(decay, one) } else { expm1(g, exponent) };
    let denominator = g.add(two, difference);
    let negative_size = g.div(difference, denominator);
    let size = g.neg(negative_size);
    let negative = g.less(x, null);
    let value = g.select(negative, negative_size, size);
    if g.form() == Form::Textbook {
        return value;
    }
    let sum = g.add(one, decay);
    let ratio = g.div(two, sum);
    let square = g.mul(ratio, ratio);
    let first = g.mul(decay, square);
    let second = g.product(None, &[minus_two, value, first]);
    g.add_rule(Rule::smooth(Primitive::HyperbolicTangent, vec![x], value, vec![first], vec![second]), &[])
}
