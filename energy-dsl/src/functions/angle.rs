//! Angles between two vectors, with their own derivatives. With w = a × b, the part of b̂ across â is
//! p = b̂ − c â = (w × a)/(‖a‖²‖b‖), and that of â across b̂ is q = â − c b̂ = (b × w)/(‖b‖²‖a‖): neither subtracts
//! what nearly cancels when the vectors align.

use super::length::{Direction, direction, projector, upper};
use super::{Function, Lowered, Shape};
use crate::graph::{Form, Graph, NodeId, Op, Primitive, Rule};
use crate::runtime::Flag;

pub(super) const FUNCTIONS: &[Function] = &[Function {
    name: "angle",
    usage: "angle(a, b)",
    docs: "Unsigned angle between two 3-vectors, atan2(‖a×b‖, a·b). Where they align, or one is 0, its derivatives are taken as 0 and flagged.",
    shape: two_vectors,
    lower: angle,
    accuracy: "3 / 4 / 7",
}];

fn two_vectors(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Vector(3), Shape::Vector(3)] => Ok(Shape::Scalar),
        [a, b] => Err(format!("takes two 3-vectors, but these are {a} and {b}")),
        _ => Err(format!("takes two 3-vectors, but there are {} arguments", shapes.len())),
    }
}

/// a × b with each 2×2 determinant rounded about once: high parts, and what they lack.
pub(super) fn exact_cross(g: &mut Graph, a: &[NodeId], b: &[NodeId]) -> [(NodeId, NodeId); 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let (plus, minus) = (g.mul(a[j], b[k]), g.mul(a[k], b[j]));
        let (plus_error, minus_error) = (g.product_error(a[j], b[k]), g.product_error(a[k], b[j]));
        let high = g.sub(plus, minus);
        let products = g.sub(plus_error, minus_error);
        let difference = g.difference_error(plus, minus);
        (high, g.add(difference, products))
    })
}

/// a × b, each component to about one rounding.
pub(super) fn accurate_cross(g: &mut Graph, a: &[NodeId], b: &[NodeId]) -> [NodeId; 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let (plus, minus) = (g.mul(a[j], b[k]), g.mul(a[k], b[j]));
        let (plus_error, minus_error) = (g.product_error(a[j], b[k]), g.product_error(a[k], b[j]));
        let high = g.sub(plus, minus);
        let low = g.sub(plus_error, minus_error);
        g.add(high, low)
    })
}

/// Two directions and what both angle functions need of them.
struct Pair {
    a: Direction,
    b: Direction,
    cross: [NodeId; 3],
    dot: NodeId,
    lengths: NodeId,
    cosine: NodeId,
    degenerate: NodeId,
    arguments: Vec<NodeId>,
}

fn pair(g: &mut Graph, a: &[NodeId], b: &[NodeId]) -> Pair {
    let (a_at, b_at) = (direction(g, a), direction(g, b));
    let cross = accurate_cross(g, &a_at.scaled, &b_at.scaled);
    let dot = g.dot(&a_at.scaled, &b_at.scaled);
    let lengths = g.mul(a_at.length, b_at.length);
    let reciprocal = g.mul(a_at.reciprocal, b_at.reciprocal);
    let cosine = g.mul(dot, reciprocal);
    let degenerate = g.or(a_at.zero, b_at.zero);
    let arguments = a.iter().chain(b).copied().collect();
    Pair { a: a_at, b: b_at, cross, dot, lengths, cosine, degenerate, arguments }
}

/// The vector behind three components of its unit vector.
fn vector_of_unit(g: &Graph, components: &[NodeId]) -> Option<Vec<NodeId>> {
    let arguments = g.rule(*components.first()?)?.arguments.clone();
    let all = components.len() == 3
        && components.iter().enumerate().all(|(i, &c)| {
            g.rule(c).is_some_and(|r| r.primitive == Primitive::Unit(i as u8) && r.arguments == arguments)
        });
    all.then_some(arguments)
}

/// â·b̂ as one primitive.
pub(super) fn recognise_cosine(g: &mut Graph, x: &[NodeId], y: &[NodeId]) -> Option<NodeId> {
    let (a, b) = (vector_of_unit(g, x)?, vector_of_unit(g, y)?);
    let pair = pair(g, &a, &b);
    let (first, second) = cosine_derivatives(g, &pair);
    let rule = Rule::smooth(Primitive::Cosine, pair.arguments.clone(), pair.cosine, first, second);
    Some(g.add_rule(rule.flagged(0, Flag::Degenerate, pair.degenerate), &[]))
}

/// 1 − â·b̂ as one primitive: ‖a×b‖²/(m (m + a·b)), m = ‖a‖‖b‖, where a·b > 0.
pub(crate) fn recognise_one_minus_cosine(g: &mut Graph, one: NodeId, cosine: NodeId) -> Option<NodeId> {
    if !g.is(one, 1.0) {
        return None;
    }
    let arguments = g.rule(cosine).filter(|r| r.primitive == Primitive::Cosine)?.arguments.clone();
    let pair = pair(g, &arguments[..3], &arguments[3..]);
    let zero = g.constant(0.0);
    let numerator = g.sum_of_squares(&pair.cross);
    let sum = g.add(pair.lengths, pair.dot);
    let denominator = g.mul(pair.lengths, sum);
    let small = g.div(numerator, denominator);
    let plain_cosine = g.resolve(pair.cosine);
    let large = g.sub(one, plain_cosine);
    let acute = g.less(zero, pair.dot);
    let value = g.select(acute, small, large);
    let value = g.select(pair.degenerate, zero, value);
    let (first, second) = cosine_derivatives(g, &pair);
    let negated = |g: &mut Graph, list: Vec<NodeId>| list.into_iter().map(|x| g.neg(x)).collect::<Vec<_>>();
    let (first, second) = (negated(g, first), negated(g, second));
    let rule = Rule::smooth(Primitive::OneMinusCosine, arguments, value, first, second);
    Some(g.add_rule(rule.flagged(0, Flag::Degenerate, pair.degenerate), &[]))
}

/// ∇c = (p/‖a‖, q/‖b‖); ∇²c has the blocks −(c P_a + â pᵀ + p âᵀ)/‖a‖², (P_a − p b̂ᵀ)/(‖a‖‖b‖) and the first with a, b swapped.
fn cosine_derivatives(g: &mut Graph, pair: &Pair) -> (Vec<NodeId>, Vec<NodeId>) {
    let (a, b) = (&pair.a, &pair.b);
    let across = |g: &mut Graph, cross: [NodeId; 3], own: &Direction, other: &Direction| {
        let square = g.mul(own.reciprocal, own.reciprocal);
        let factor = g.mul(square, other.reciprocal);
        g.scaled(factor, &cross)
    };
    let w_a = g.cross(&pair.cross, &a.scaled);
    let b_w = g.cross(&b.scaled, &pair.cross);
    let p = across(g, w_a, a, b);
    let q = across(g, b_w, b, a);
    let per_a = g.mul(a.reciprocal, a.scale);
    let per_b = g.mul(b.reciprocal, b.scale);
    let mut first = g.scaled(per_a, &p);
    first.extend(g.scaled(per_b, &q));

    let (squared_a, squared_b, mixed) = (g.mul(per_a, per_a), g.mul(per_b, per_b), g.mul(per_a, per_b));
    let second = upper(6)
        .map(|(i, j)| match (i < 3, j < 3) {
            (true, true) => own_block(g, pair.cosine, &a.unit, &p, squared_a, i, j),
            (false, false) => own_block(g, pair.cosine, &b.unit, &q, squared_b, i - 3, j - 3),
            _ => {
                let projection = projector(g, &a.unit, i, j - 3);
                let product = g.mul(p[i], b.unit[j - 3]);
                let entry = g.sub(projection, product);
                g.mul(mixed, entry)
            }
        })
        .collect();
    (first, second)
}

/// Entry of −(c P + n pᵀ + p nᵀ) · factor.
fn own_block(g: &mut Graph, c: NodeId, n: &[NodeId], p: &[NodeId], factor: NodeId, i: usize, j: usize) -> NodeId {
    let projection = projector(g, n, i, j);
    let symmetric = symmetric_product(g, n, p, i, j);
    let scaled = g.mul(c, projection);
    let entry = g.add(scaled, symmetric);
    let entry = g.mul(factor, entry);
    g.neg(entry)
}

/// Entry of x yᵀ + y xᵀ.
pub(super) fn symmetric_product(g: &mut Graph, x: &[NodeId], y: &[NodeId], i: usize, j: usize) -> NodeId {
    let one = g.mul(x[i], y[j]);
    if i == j {
        let two = g.constant(2.0);
        return g.mul(two, one);
    }
    let other = g.mul(x[j], y[i]);
    g.add(one, other)
}

/// φ = atan2(‖a×b‖, a·b). With ŵ = a×b/‖a×b‖ and m_a = â×ŵ, m_b = ŵ×b̂: ∇φ = (m_a/‖a‖, m_b/‖b‖);
/// ∇²φ = (cot φ ŵŵᵀ − â m_aᵀ − m_a âᵀ)/‖a‖² and likewise for b, −ŵŵᵀ/(sin φ ‖a‖‖b‖) between them.
fn angle(g: &mut Graph, args: &[Lowered]) -> Lowered {
    let (a, b) = (&args[0].parts, &args[1].parts);
    if g.form() == Form::Textbook {
        let cross = g.cross(a, b);
        let square = g.sum_of_squares(&cross);
        let (sine, cosine) = (g.sqrt(square), g.dot(a, b));
        return Lowered::scalar(g.atan2(sine, cosine));
    }
    Lowered::scalar(between(g, a, b))
}

/// The robust form of the angle between two vectors.
pub(super) fn between(g: &mut Graph, a: &[NodeId], b: &[NodeId]) -> NodeId {
    let pair = pair(g, a, b);
    let (null, one) = (g.constant(0.0), g.constant(1.0));
    let w = direction(g, &pair.cross);
    let sine = g.div(w.length, w.scale);
    let raw = g.atan2(sine, pair.dot);
    let value = g.select(pair.degenerate, null, raw);

    let m_a = g.cross(&pair.a.unit, &w.unit);
    let m_b = g.cross(&w.unit, &pair.b.unit);
    let per_a = g.mul(pair.a.reciprocal, pair.a.scale);
    let per_b = g.mul(pair.b.reciprocal, pair.b.scale);
    let mut first = g.scaled(per_a, &m_a);
    first.extend(g.scaled(per_b, &m_b));

    let inverse_sine = g.div(one, sine);
    let inverse_sine = g.select(w.zero, null, inverse_sine);
    let cotangent = g.mul(pair.dot, inverse_sine);
    let cosecant = g.mul(pair.lengths, inverse_sine);
    let (squared_a, squared_b, mixed) = (g.mul(per_a, per_a), g.mul(per_b, per_b), g.mul(per_a, per_b));
    let second = upper(6)
        .map(|(i, j)| {
            let normal = g.mul(w.unit[i % 3], w.unit[j % 3]);
            if (i < 3) != (j < 3) {
                let entry = g.mul(cosecant, normal);
                let entry = g.mul(mixed, entry);
                return g.neg(entry);
            }
            let (n, m, factor) = if i < 3 { (&pair.a.unit, &m_a, squared_a) } else { (&pair.b.unit, &m_b, squared_b) };
            let bending = g.mul(cotangent, normal);
            let tilting = symmetric_product(g, n, m, i % 3, j % 3);
            let entry = g.sub(bending, tilting);
            g.mul(factor, entry)
        })
        .collect();
    let rule = Rule::smooth(Primitive::Angle, pair.arguments.clone(), value, first, second)
        .flagged(0, Flag::Degenerate, pair.degenerate)
        .flagged(1, Flag::Degenerate, w.zero);
    g.add_rule(rule, &[])
}

/// √(c (1 − â·b̂)) with a constant c: v = 0 is the tip of a cone, where derivatives are taken as 0. Of ω = 1 − â·b̂, first
/// derivative c/(2v), second −c²/(4v³).
pub(crate) fn recognise_root(g: &mut Graph, x: NodeId) -> Option<NodeId> {
    let (factor, omega) = match g.op(x) {
        Op::Mul(c, y) if g.as_constant(c).is_some() => (c, y),
        Op::Mul(y, c) => (c, y),
        _ => (g.constant(1.0), x),
    };
    let factor = g.as_constant(factor).filter(|c| *c > 0.0)?;
    g.rule(omega).filter(|r| r.primitive == Primitive::OneMinusCosine)?;
    let (null, one) = (g.constant(0.0), g.constant(1.0));
    let value = g.plain_sqrt(x);
    let tip = g.equal(value, null);
    let reciprocal = g.div(one, value);
    let reciprocal = g.select(tip, null, reciprocal);
    let (half, minus_quarter) = (g.constant(factor / 2.0), g.constant(-factor * factor / 4.0));
    let first = g.mul(half, reciprocal);
    let second = g.product(None, &[minus_quarter, reciprocal, reciprocal, reciprocal]);
    let rule = Rule::smooth(Primitive::RootOneMinusCosine, vec![omega], value, vec![first], vec![second]);
    let factor = g.constant(factor);
    Some(g.add_rule(rule.flagged(1, Flag::Kink, tip), &[factor]))
}
