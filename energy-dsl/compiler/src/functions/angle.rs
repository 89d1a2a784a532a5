//! Angles between two vectors, with their own derivatives. Let w = a × b. The part of b̂ orthogonal to â is p = b̂ − c
//! â = (w × a)/(‖a‖²‖b‖); that of â orthogonal to b̂ is q = â − c b̂ = (b × w)/(‖b‖²‖a‖). Neither subtracts nearly
//! equal vectors when a and b align.

use super::length::{Direction, assume_moderate, common_scale, direction};
use super::{Function, Lowered, Shape, Units};
use crate::graph::{Form, Graph, NodeId, Op, Primitive, Product, Rule, upper};
use energy_runtime::Flag;

pub(super) const FUNCTIONS: &[Function] = &[Function {
    name: "angle",
    usage: "angle(a, b)",
    docs: "Unsigned angle between two 3-vectors, atan2(‖a×b‖, a·b). If they are parallel or one is 0, it \
         contributes no derivatives, and they are flagged.",
    shape: two_vectors,
    units: Units::Number,
    lower: angle,
    accuracy: "3 / 4 / 7",
}];

fn two_vectors(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Vector(3), Shape::Vector(3)] => Ok(Shape::Scalar),
        [a, b] => Err(format!("takes two 3-vectors, but these are {a} and {b}")),
        _ => Err(format!("takes two 3-vectors, but got {}", super::arguments(shapes.len()))),
    }
}

/// Returns a × b with each 2×2 determinant rounded about once: high parts, and their errors.
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

/// Returns a × b with each component rounded about once. One of the two products keeps its error (Kahan's method).
pub(super) fn accurate_cross(g: &mut Graph, a: &[NodeId], b: &[NodeId]) -> [NodeId; 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let minus = g.mul(a[k], b[j]);
        let minus_error = g.product_error(a[k], b[j]);
        let high = g.fused_mul_sub(a[j], b[k], minus);
        g.sub(high, minus_error)
    })
}

/// Two directions, and the quantities that their angle needs.
struct Pair {
    a: Direction,
    b: Direction,
    cross: [NodeId; 3],
    dot: NodeId,
    lengths: NodeId,
    degenerate: NodeId,
    arguments: Vec<NodeId>,
}

fn pair(g: &mut Graph, a: &[NodeId], b: &[NodeId]) -> Pair {
    let (a_at, b_at) = (direction(g, a), direction(g, b));
    let cross = accurate_cross(g, &a_at.scaled, &b_at.scaled);
    let dot = g.dot(&a_at.scaled, &b_at.scaled);
    let lengths = g.mul(a_at.length, b_at.length);
    let degenerate = g.or(a_at.zero, b_at.zero);
    let arguments = a.iter().chain(b).copied().collect();
    Pair { a: a_at, b: b_at, cross, dot, lengths, degenerate, arguments }
}

/// Returns the vector whose unit vector has these three components.
fn vector_of_unit(g: &Graph, components: &[NodeId]) -> Option<Vec<NodeId>> {
    let arguments = g.rule(*components.first()?)?.arguments.clone();
    let all = components.len() == 3
        && components.iter().enumerate().all(|(i, &c)| {
            g.rule(c).is_some_and(|r| r.primitive == Primitive::Unit(i as u8) && r.arguments == arguments)
        });
    all.then_some(arguments)
}

/// The cosine c of the angle between a and b, with intermediate results of c and 1 − c; w = a × b. The root in γ = √P/P
/// and the division in 1/P, P = ‖a‖²‖b‖², are independent and overlap; 1/‖a‖² = ‖b‖²/P and 1/‖b‖² = ‖a‖²/P.
struct Aligned {
    a: Vec<NodeId>,
    b: Vec<NodeId>,
    scales: [NodeId; 2],
    cross: [NodeId; 3],
    cosine: NodeId,
    one_minus: NodeId,
    /// γ = 1/(‖a‖‖b‖).
    per_both: NodeId,
    /// 1/‖a‖² and 1/‖b‖².
    per_square: [NodeId; 2],
    degenerate: NodeId,
}

fn aligned(g: &mut Graph, a: &[NodeId], b: &[NodeId]) -> Aligned {
    let (null, one) = (g.constant(0.0), g.constant(1.0));
    let scales = [a, b].map(|v| common_scale(g, v));
    let (x, y) = (g.scaled(scales[0], a), g.scaled(scales[1], b));
    let squares = [&x, &y].map(|v| g.sum_of_squares(v));
    let zeros = squares.map(|square| g.equal(square, null));
    for own in 0..2 {
        assume_moderate(g, squares[own], scales[own], zeros[own]);
    }
    let degenerate = g.or(zeros[0], zeros[1]);

    let cross = accurate_cross(g, &x, &y);
    let dot = g.dot(&x, &y);
    let product = g.mul(squares[0], squares[1]);
    let per_product = g.div(one, product);
    let per_product = g.select(degenerate, null, per_product);
    let per_square = [g.mul(squares[1], per_product), g.mul(squares[0], per_product)];
    let lengths = g.sqrt(product);
    let per_both = g.mul(lengths, per_product);
    let cosine = g.mul(dot, per_both);
    // 1 − |c| = ‖w‖²γ/(m + |a·b|) with m = ‖a‖‖b‖. Adding (|a·b| − a·b) γ, which is 0 or 2 |c|, gives 1 − c.
    let size = g.abs(dot);
    let cross_squared = g.sum_of_squares(&cross);
    let numerator = g.mul(cross_squared, per_both);
    let denominator = g.add(lengths, size);
    let quotient = g.div(numerator, denominator);
    let one_minus_size = g.select(degenerate, null, quotient);
    let behind = g.sub(size, dot);
    let behind = g.mul(behind, per_both);
    let one_minus = g.add(one_minus_size, behind);
    Aligned { a: x, b: y, scales, cross, cosine, one_minus, per_both, per_square, degenerate }
}

/// Creates â·b̂ as one primitive.
pub(super) fn recognise_cosine(g: &mut Graph, x: &[NodeId], y: &[NodeId]) -> Option<NodeId> {
    let arguments = [vector_of_unit(g, x)?, vector_of_unit(g, y)?].concat();
    Some(cosine(g, arguments))
}

/// Recognises cos φ of the angle φ between two vectors. Unlike φ, it is smooth where they are aligned.
pub(super) fn recognise_cosine_of_angle(g: &mut Graph, angle: NodeId, _: NodeId) -> Option<NodeId> {
    let arguments = g.rule(angle).filter(|r| r.primitive == Primitive::Angle)?.arguments.clone();
    Some(cosine(g, arguments))
}

/// Creates â·b̂ of the vectors that the arguments list.
fn cosine(g: &mut Graph, arguments: Vec<NodeId>) -> NodeId {
    let at = aligned(g, &arguments[..3], &arguments[3..]);
    let (first, second) = cosine_derivatives(g, &at, false);
    let rule = Rule::factored(Primitive::Cosine, arguments, at.cosine, first, second);
    g.add_rule(rule.flagged(0, Flag::Degenerate, at.degenerate), &[])
}

/// Recognises 1 − â·b̂.
pub(super) fn recognise_one_minus_cosine(g: &mut Graph, one: NodeId, cosine: NodeId) -> Option<NodeId> {
    if !g.is(one, 1.0) {
        return None;
    }
    let arguments = g.rule(cosine).filter(|r| r.primitive == Primitive::Cosine)?.arguments.clone();
    Some(one_minus_cosine(g, arguments))
}

/// Creates 1 − â·b̂ of the vectors that the arguments list.
pub(super) fn one_minus_cosine(g: &mut Graph, arguments: Vec<NodeId>) -> NodeId {
    let at = aligned(g, &arguments[..3], &arguments[3..]);
    let (first, second) = cosine_derivatives(g, &at, true);
    let rule = Rule::factored(Primitive::OneMinusCosine, arguments, at.one_minus, first, second);
    g.add_rule(rule.flagged(0, Flag::Degenerate, at.degenerate), &[])
}

/// Recognises 1 + â·b̂, which is 1 − cos of the angle between a and −b.
pub(super) fn recognise_one_plus_cosine(g: &mut Graph, x: NodeId, y: NodeId) -> Option<NodeId> {
    let (one, cosine) = if g.is(x, 1.0) { (x, y) } else { (y, x) };
    if !g.is(one, 1.0) {
        return None;
    }
    let arguments = g.rule(cosine).filter(|r| r.primitive == Primitive::Cosine)?.arguments.clone();
    let opposite: Vec<NodeId> = arguments[3..].iter().map(|&b| g.neg(b)).collect();
    let opposite = [&arguments[..3], &opposite].concat();
    Some(one_minus_cosine(g, opposite))
}

/// Parts of the derivatives with respect to a, one of the two vectors.
struct Side {
    /// The gradient p.
    gradient: [NodeId; 3],
    /// −a′.
    minus_inverse: Vec<NodeId>,
    /// The vector s of the diagonal block.
    slant: [NodeId; 3],
    /// −1/‖a‖².
    minus_per_square: NodeId,
}

/// Returns the derivatives of c, or of −c if `negative`, with respect to a and b. Let κ = ±c, μ = ±γ, a′ = a/‖a‖² and
/// b′ = b/‖b‖².
///
/// - The gradient is (p, q) with p = μ w × a′ and q = μ b′ × w.
/// - The diagonal block of a is −κ/‖a‖² I − a′ sᵀ − s a′ᵀ with s = p − ½ κ a′; that of b is analogous.
/// - The mixed block is μ (I − a a′ᵀ) − p b′ᵀ.
///
/// Weighted p and q are part of the gradient, so they are computed anyway.
fn cosine_derivatives(g: &mut Graph, at: &Aligned, negative: bool) -> (Vec<Product>, Vec<Vec<Product>>) {
    let half = g.constant(0.5);
    let [kappa, mixed] = [at.cosine, at.per_both].map(|node| if negative { g.neg(node) } else { node });
    // Scalars come first in the products, so that a weight multiplies a scalar.
    let mut first = Vec::new();
    let mut sides = Vec::new();
    for (own, vector) in [&at.a, &at.b].into_iter().enumerate() {
        let inverse = g.scaled(at.per_square[own], vector);
        let gradient = [0, 1, 2].map(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let [plus, minus] = [(j, k), (k, j)].map(|(j, k)| [at.per_both, at.cross[j], inverse[k]]);
            let turned = (own == 1) != negative;
            let (plus, minus) = if turned { (minus, plus) } else { (plus, minus) };
            g.weighable_difference(&plus, &minus)
        });
        let slant = [0, 1, 2].map(|i| g.weighable_difference(&[gradient[i]], &[kappa, half, inverse[i]]));
        let minus_inverse: Vec<_> = inverse.iter().map(|&x| g.neg(x)).collect();
        first.extend(gradient.map(|p| vec![p, at.scales[own]]));
        sides.push(Side { gradient, minus_inverse, slant, minus_per_square: g.neg(at.per_square[own]) });
    }

    let second = upper(6)
        .map(|(i, j)| {
            let (own, other) = (i / 3, j / 3);
            let (row, column) = (i % 3, j % 3);
            let mut products: Vec<Product> = if own == other {
                let Side { minus_inverse, slant, minus_per_square, .. } = &sides[own];
                // The term of the diagonal comes first: it is computed once, and the others fuse with it.
                let round = (row == column).then(|| vec![kappa, *minus_per_square]);
                let slanted = [vec![slant[row], minus_inverse[column]], vec![slant[column], minus_inverse[row]]];
                round.into_iter().chain(slanted).collect()
            } else {
                let mut products = vec![
                    vec![mixed, at.a[row], sides[0].minus_inverse[column]],
                    vec![sides[0].gradient[row], sides[1].minus_inverse[column]],
                ];
                if row == column {
                    products.push(vec![mixed]);
                }
                products
            };
            let scale = g.mul(at.scales[own], at.scales[other]);
            if !g.is(scale, 1.0) {
                products.iter_mut().for_each(|product| product.push(scale));
            }
            products
        })
        .collect();
    (first, second)
}

/// Returns an entry of x yᵀ + y xᵀ.
pub(super) fn symmetric_product(g: &mut Graph, x: &[NodeId], y: &[NodeId], i: usize, j: usize) -> NodeId {
    let one = g.mul(x[i], y[j]);
    if i == j {
        let two = g.constant(2.0);
        return g.mul(two, one);
    }
    let other = g.mul(x[j], y[i]);
    g.add(one, other)
}

/// φ = atan2(‖a×b‖, a·b). With ŵ = a×b/‖a×b‖, m_a = â×ŵ and m_b = ŵ×b̂: ∇φ = (m_a/‖a‖, m_b/‖b‖). The diagonal block of
/// a is (cot φ ŵŵᵀ − â m_aᵀ − m_a âᵀ)/‖a‖², that of b is analogous, and the mixed block is −ŵŵᵀ/(sin φ ‖a‖‖b‖).
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

/// Creates the robust form of the angle between two vectors.
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

/// Creates asin â·b̂ = π/2 − φ, the angle between one vector and the plane across the other one. It has all its digits
/// where the vectors are orthogonal, and is regular beside them.
pub(super) fn elevation(g: &mut Graph, a: &[NodeId], b: &[NodeId]) -> NodeId {
    let (angle, pair) = (between(g, a, b), pair(g, a, b));
    let (null, minus_one) = (g.constant(0.0), g.constant(-1.0));
    let w = direction(g, &pair.cross);
    let sine = g.div(w.length, w.scale);
    let raw = g.atan2(pair.dot, sine);
    let value = g.select(pair.degenerate, null, raw);
    let rule = Rule::smooth(Primitive::Elevation, vec![angle], value, vec![minus_one], vec![null]);
    g.add_rule(rule.flagged(0, Flag::Degenerate, pair.degenerate), &[])
}

/// Recognises v = √(c (1 − â·b̂)) with a constant c. At v = 0, the tip of a cone, derivatives are taken as 0. With
/// respect to ω = 1 − â·b̂ the first derivative is c/(2v), the second −c²/(4v³).
pub(super) fn recognise_root(g: &mut Graph, x: NodeId, _: NodeId) -> Option<NodeId> {
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
