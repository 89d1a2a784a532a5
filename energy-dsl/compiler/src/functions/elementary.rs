//! Functions of one or two numbers.

use super::{Function, Lowered, Shape, Units};
use crate::graph::{Form, Graph, NodeId, Op, Primitive, Rule};

macro_rules! scalar_function {
    (
        $name:literal, $usage:literal, $docs:literal, $shape:ident, $units:expr, $accuracy:literal,
        |$g:ident, $args:ident| $body:expr
    ) => {
        Function {
            name: $name,
            usage: $usage,
            docs: $docs,
            shape: $shape,
            units: $units,
            lower: |$g, $args| Lowered::scalar($body),
            accuracy: $accuracy,
        }
    };
}

pub(super) const FUNCTIONS: &[Function] = &[
    scalar_function!(
        "sqrt",
        "sqrt(x)",
        "√x, x ≥ 0. The root of `1 - dot(unit(a), unit(b))` or of a multiple is a robust primitive: its derivative \
         at 0 is that of one side, and flagged as a kink.",
        one_scalar,
        Units::Power(0.5),
        "1",
        |g, a| g.sqrt(a[0].node())
    ),
    Function {
        name: "exp",
        usage: "exp(x) or exp(ξ)",
        docs: "eˣ of a scalar. For a twist ξ = (θ, t), the dual quaternion (q, ½ t q) with q = (cos ‖θ‖, θ sin \
             ‖θ‖/‖θ‖): it rotates by 2‖θ‖ about θ and translates by t. Regular at θ = 0.",
        shape: |shapes| if shapes == [Shape::Twist] { Ok(Shape::DualQuat) } else { one_scalar(shapes) },
        units: Units::Exponential,
        lower: |g, a| match a[0].shape {
            Shape::Twist => super::quaternion::exp(g, &a[0]),
            _ => Lowered::scalar(g.exp(a[0].node())),
        },
        accuracy: "1",
    },
    scalar_function!(
        "sin",
        "sin(x)",
        "Sine of an angle in radians. For a dihedral angle or half of one, it is computed without the angle.",
        one_scalar,
        Units::Plain,
        "1",
        |g, a| g.sin(a[0].node())
    ),
    scalar_function!(
        "cos",
        "cos(x)",
        "Cosine of an angle in radians. For a dihedral angle or half of one, it is computed without the angle.",
        one_scalar,
        Units::Plain,
        "1",
        |g, a| g.cos(a[0].node())
    ),
    scalar_function!(
        "sin_half",
        "sin_half(x)",
        "sin(x/2).",
        one_scalar,
        Units::Plain,
        "4 / 5 / 9 for a dihedral angle",
        |g, a| {
            let half = half(g, a[0].node());
            g.sin(half)
        }
    ),
    scalar_function!(
        "cos_half",
        "cos_half(x)",
        "cos(x/2).",
        one_scalar,
        Units::Plain,
        "4 / 5 / 9 for a dihedral angle",
        |g, a| {
            let half = half(g, a[0].node());
            g.cos(half)
        }
    ),
    scalar_function!(
        "atan2",
        "atan2(y, x)",
        "The angle of the point (x, y), in (−π, π]. At the origin it is 0 and flagged.",
        two_scalars,
        Units::Compared,
        "1",
        |g, a| g.atan2(a[0].node(), a[1].node())
    ),
    scalar_function!(
        "abs",
        "abs(x)",
        "Absolute value |x|. At 0, a kink, the derivative is 1.",
        one_scalar,
        Units::First,
        "0",
        |g, a| g.abs(a[0].node())
    ),
    scalar_function!(
        "min",
        "min(a, b, …)",
        "Smallest argument. If two are equal, a kink, the derivative is that of the first.",
        some_scalars,
        Units::Same,
        "0",
        |g, a| fold(g, a, Graph::min)
    ),
    scalar_function!(
        "max",
        "max(a, b, …)",
        "Largest argument. If two are equal, a kink, the derivative is that of the first.",
        some_scalars,
        Units::Same,
        "0",
        |g, a| fold(g, a, Graph::max)
    ),
    scalar_function!(
        "clamp",
        "clamp(x, least, most)",
        "x limited to the range [least, most]: min(max(x, least), most).",
        three_scalars,
        Units::Same,
        "0",
        |g, a| {
            let raised = g.max(a[0].node(), a[1].node());
            g.min(raised, a[2].node())
        }
    ),
    scalar_function!(
        "sign",
        "sign(x)",
        "−1, 0 or 1; 0 is flagged. The derivative is 0.",
        one_scalar,
        Units::Number,
        "0",
        |g, a| sign(g, a[0].node())
    ),
    scalar_function!(
        "power_of_two",
        "power_of_two(x)",
        "The power of two s with 1 ≤ s |x| < 2 (1 if x = 0), in the unit of 1/x. The derivative is taken as 0. \
         Multiplication by s is exact: use it to scale a rest shape near 1 in formulas whose result does not depend \
         on s.",
        one_scalar,
        Units::Power(-1.0),
        "0",
        |g, a| g.power_of_two_scale(a[0].node())
    ),
    scalar_function!(
        "one_minus_cos",
        "one_minus_cos(x)",
        "1 − cos x = 2 sin²(x/2), accurate near 0. `1 - cos(x)` is compiled to it.",
        one_scalar,
        Units::Plain,
        "3 / 2 / 2",
        |g, a| versine(g, a[0].node())
    ),
    scalar_function!(
        "x_minus_sin",
        "x_minus_sin(x)",
        "x − sin x, accurate near 0: by its series for |x| < 1.",
        one_scalar,
        Units::Plain,
        "5 / 2 / 1",
        |g, a| sine_remainder(g, a[0].node())
    ),
];

pub(super) fn one_scalar(shapes: &[Shape]) -> Result<Shape, String> {
    match shapes {
        [Shape::Scalar] => Ok(Shape::Scalar),
        [other] => Err(format!("takes a scalar, but this is {other}")),
        _ => Err(format!("takes one scalar, but got {}", super::arguments(shapes.len()))),
    }
}

pub(super) fn two_scalars(shapes: &[Shape]) -> Result<Shape, String> {
    match shapes {
        [Shape::Scalar, Shape::Scalar] => Ok(Shape::Scalar),
        [a, b] => Err(format!("takes two scalars, but these are {a} and {b}")),
        _ => Err(format!("takes two scalars, but got {}", super::arguments(shapes.len()))),
    }
}

fn some_scalars(shapes: &[Shape]) -> Result<Shape, String> {
    match shapes.iter().find(|s| **s != Shape::Scalar) {
        None if shapes.len() >= 2 => Ok(Shape::Scalar),
        None => Err(format!("takes two or more scalars, but got {}", super::arguments(shapes.len()))),
        Some(other) => Err(format!("takes scalars, but one is {other}")),
    }
}

fn three_scalars(shapes: &[Shape]) -> Result<Shape, String> {
    match shapes {
        [_, _, _] => some_scalars(shapes),
        _ => Err(format!("takes three scalars, but got {}", super::arguments(shapes.len()))),
    }
}

fn fold(g: &mut Graph, numbers: &[Lowered], by: fn(&mut Graph, NodeId, NodeId) -> NodeId) -> NodeId {
    let first = numbers[0].node();
    numbers[1..].iter().fold(first, |found, next| by(g, found, next.node()))
}

fn sign(g: &mut Graph, x: NodeId) -> NodeId {
    let (minus_one, null, one) = (g.constant(-1.0), g.constant(0.0), g.constant(1.0));
    let (negative, positive) = (g.less(x, null), g.less(null, x));
    let right = g.select(positive, one, null);
    g.select(negative, minus_one, right)
}

fn half(g: &mut Graph, x: NodeId) -> NodeId {
    let half = g.constant(0.5);
    g.mul(half, x)
}

/// Recognises 1 − cos x.
pub(super) fn recognise_versine(g: &mut Graph, one: NodeId, cosine: NodeId) -> Option<NodeId> {
    let angle = angle_of_cosine(g, cosine)?;
    g.is(one, 1.0).then(|| versine(g, angle))
}

/// Recognises 1 + cos x.
pub(super) fn recognise_vercosine(g: &mut Graph, x: NodeId, y: NodeId) -> Option<NodeId> {
    let cosine = if g.is(x, 1.0) { y } else { x };
    let angle = angle_of_cosine(g, cosine).filter(|_| g.is(x, 1.0) || g.is(y, 1.0))?;
    Some(vercosine(g, angle))
}

fn angle_of_cosine(g: &Graph, cosine: NodeId) -> Option<NodeId> {
    match g.op(cosine) {
        Op::Cos(angle) => Some(angle),
        _ => g.rule(cosine).filter(|r| r.primitive == Primitive::DihedralCosine)?.arguments.first().copied(),
    }
}

/// Creates 1 + cos x = 2 cos² x/2. The first derivative is −sin x, the second −cos x.
fn vercosine(g: &mut Graph, x: NodeId) -> NodeId {
    let (half, sine, cosine) = (half(g, x), g.sin(x), g.cos(x));
    let cosine_half = g.cos(half);
    let (square, two) = (g.mul(cosine_half, cosine_half), g.constant(2.0));
    let value = g.mul(two, square);
    let derivatives = [sine, cosine].map(|function| g.neg(function));
    let [first, second] = derivatives.map(|entry| vec![entry]);
    g.add_rule(Rule::smooth(Primitive::Vercosine, vec![x], value, first, second), &[])
}

/// Creates 1 − cos x. The first derivative is sin x, the second cos x.
pub(super) fn versine(g: &mut Graph, x: NodeId) -> NodeId {
    let cosine = g.cos(x);
    if g.form() == Form::Textbook {
        let one = g.constant(1.0);
        return g.sub(one, cosine);
    }
    let half = half(g, x);
    let sine_half = g.sin(half);
    let (square, two) = (g.mul(sine_half, sine_half), g.constant(2.0));
    let value = g.mul(two, square);
    let sine = g.sin(x);
    g.add_rule(Rule::smooth(Primitive::Versine, vec![x], value, vec![sine], vec![cosine]), &[])
}

/// Creates x − sin x. The first derivative is 1 − cos x, the second sin x.
pub(super) fn sine_remainder(g: &mut Graph, x: NodeId) -> NodeId {
    let sine = g.sin(x);
    let direct = g.sub(x, sine);
    if g.form() == Form::Textbook {
        return direct;
    }
    // x³/6 (1 − x²/(4·5) (1 − x²/(6·7) (…))): eight terms reach 1e-17 at |x| = 1.
    let (one, square) = (g.constant(1.0), g.mul(x, x));
    let mut series = one;
    for k in (2..=8).rev() {
        let divisor = g.constant(f64::from(2 * k * (2 * k + 1)));
        let ratio = g.div(square, divisor);
        let term = g.mul(ratio, series);
        series = g.sub(one, term);
    }
    let (six, cube) = (g.constant(6.0), g.mul(square, x));
    let leading = g.div(cube, six);
    let small = g.mul(leading, series);
    let magnitude = g.abs(x);
    let near = g.less(magnitude, one);
    let value = g.select(near, small, direct);
    let first = versine(g, x);
    g.add_rule(Rule::smooth(Primitive::SineRemainder, vec![x], value, vec![first], vec![sine]), &[])
}
