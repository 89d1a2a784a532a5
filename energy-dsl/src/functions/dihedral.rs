//! The dihedral angle of a hinge, and its sine and cosine and theirs of its half, with their own derivatives.
//!
//! Points x₁, x₂ are the apexes, x₃x₄ the shared edge; E = x₄ − x₃, a = x₁ − x₃, b = x₂ − x₃, N₁ = E × a, N₂ = −E × b.
//! Flat is 0, sin θ = (n₁ × n₂)·Ê. θ = atan2(−‖E‖ b·(E×a), −(E×a)·(E×b)): the triple product is computed as if in twice
//! the precision, including what rounding the edges lost, so a nearly flat hinge has a relatively exact angle.

use super::angle::{accurate_cross, exact_cross, symmetric_product};
use super::length::{Direction, common_scale, direction_scaled, upper};
use super::{Function, Lowered, Shape};
use crate::graph::{DihedralParts, Form, Graph, NodeId, Primitive, Rule};
use crate::runtime::Flag;

pub(super) const FUNCTIONS: &[Function] = &[Function {
    name: "dihedral",
    usage: "dihedral(x1, x2, x3, x4)",
    docs: "Signed dihedral angle θ in (−π, π] of the triangles x1x3x4 and x2x3x4 over their shared edge x3x4: flat is 0, sin θ = (n₁ × n₂)·Ê, N₁ = E × (x₁ − x₃). Exactly folded is +π. A zero-area triangle has angle 0, derivatives 0, and a flag. Its sine, cosine and those of its half are computed without it.",
    shape: four_points,
    lower: dihedral,
    accuracy: "4 / 5 / 7",
}];

fn four_points(shapes: &[Shape]) -> Result<Shape, String> {
    if shapes.len() == 4 && shapes.iter().all(|s| *s == Shape::Vector(3)) {
        return Ok(Shape::Scalar);
    }
    let found = shapes.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    Err(format!("takes four points: two apexes and the ends of the shared edge, but these are {found}"))
}

fn difference(g: &mut Graph, to: &Lowered, from: &Lowered) -> Vec<NodeId> {
    to.parts.iter().zip(&from.parts).map(|(&x, &y)| g.sub(x, y)).collect()
}

fn dihedral(g: &mut Graph, x: &[Lowered]) -> Lowered {
    let edge = difference(g, &x[3], &x[2]);
    let a = difference(g, &x[0], &x[2]);
    let b = difference(g, &x[1], &x[2]);
    Lowered::scalar(if g.form() == Form::Textbook { textbook(g, &edge, &a, &b) } else { robust(g, &edge, &a, &b) })
}

/// atan2 of the unit normals' cross product along the edge and of their dot product.
fn textbook(g: &mut Graph, edge: &[NodeId], a: &[NodeId], b: &[NodeId]) -> NodeId {
    let unit = |g: &mut Graph, v: &[NodeId]| {
        let square = g.sum_of_squares(v);
        let length = g.sqrt(square);
        v.iter().map(|&x| g.div(x, length)).collect::<Vec<_>>()
    };
    let first = g.cross(edge, a);
    let second = g.cross(b, edge);
    let (n1, n2, e) = (unit(g, &first), unit(g, &second), unit(g, edge));
    let across = g.cross(&n1, &n2);
    let (sine, cosine) = (g.dot(&across, &e), g.dot(&n1, &n2));
    g.atan2(sine, cosine)
}

/// One triangle of the hinge, in scaled lengths.
struct Wing {
    /// Unit normal.
    normal: Vec<NodeId>,
    /// n × Ê, negated for the second triangle.
    tangent: Vec<NodeId>,
    /// 1/height of the apex over the edge, in true lengths; 0 where there is none.
    inverse_height: NodeId,
    /// Where along the edge the apex stands.
    along: NodeId,
}

struct Hinge {
    edge: Direction,
    inverse_edge: NodeId,
    wings: [Wing; 2],
}

fn robust(g: &mut Graph, edge: &[NodeId], a: &[NodeId], b: &[NodeId]) -> NodeId {
    let arguments: Vec<_> = edge.iter().chain(a).chain(b).copied().collect();
    let scale = common_scale(g, &arguments);
    let e = direction_scaled(g, edge, scale);
    let (a_scaled, b_scaled) = (g.scaled(scale, a), g.scaled(scale, b));
    let first = exact_cross(g, &e.scaled, &a_scaled);
    let n1: Vec<_> = first.iter().map(|&(high, low)| g.add(high, low)).collect();
    let second = accurate_cross(g, &e.scaled, &b_scaled);

    let volume = triple_product(g, (edge, a, b), (&a_scaled, &b_scaled), scale, &first, (&n1, &second));
    let (null, one) = (g.constant(0.0), g.constant(1.0));
    let squares = [g.sum_of_squares(&n1), g.sum_of_squares(&second)];
    let product = g.mul(squares[0], squares[1]);
    let degenerate = g.equal(product, null);
    let folded = g.dot(&n1, &second);
    let y = g.mul(e.length, volume);
    let y = g.neg(y);
    // −0 and +0 are the same fold: +π.
    let flat = g.equal(y, null);
    let y = g.select(flat, null, y);
    let x = g.neg(folded);
    let raw = g.atan2(y, x);
    let value = g.select(degenerate, null, raw);

    let areas = squares.map(|s| g.sqrt(s));
    let reciprocals = areas.map(|area| {
        let reciprocal = g.div(one, area);
        g.select(degenerate, null, reciprocal)
    });
    let both = g.mul(reciprocals[0], reciprocals[1]);
    let (sine, cosine) = (g.mul(y, both), g.mul(x, both));
    let parts = half_angles(g, sine, cosine, degenerate);

    let inverse_edge = g.mul(e.reciprocal, scale);
    let minus_one = g.constant(-1.0);
    let edge_height = g.mul(e.length, scale);
    let wing = |g: &mut Graph, normal: &[NodeId], sign: NodeId, apex: &[NodeId], reciprocal: NodeId| {
        let factor = g.mul(sign, reciprocal);
        let normal = g.scaled(factor, normal);
        let tangent = g.cross(&normal, &e.unit);
        let tangent = g.scaled(sign, &tangent);
        let along = g.dot(apex, &e.unit);
        let along = g.mul(along, e.reciprocal);
        Wing { normal, tangent, inverse_height: g.mul(edge_height, reciprocal), along }
    };
    let wings = [wing(g, &n1, one, &a_scaled, reciprocals[0]), wing(g, &second, minus_one, &b_scaled, reciprocals[1])];
    let hinge = Hinge { edge: e, inverse_edge, wings };
    let (first, second) = derivatives(g, &hinge);
    let mut rule =
        Rule::smooth(Primitive::Dihedral, arguments, value, first, second).flagged(0, Flag::Degenerate, degenerate);
    rule.dihedral = Some(parts);
    g.add_rule(rule, &[])
}

/// b·(E×a) of the scaled edges: the determinant in double-double, and its change by the edges' rounding errors.
fn triple_product(
    g: &mut Graph,
    (edge, a, b): (&[NodeId], &[NodeId], &[NodeId]),
    (a_scaled, b_scaled): (&[NodeId], &[NodeId]),
    scale: NodeId,
    cross: &[(NodeId, NodeId); 3],
    (edge_a, edge_b): (&[NodeId], &[NodeId; 3]),
) -> NodeId {
    let products: Vec<_> = cross.iter().zip(b_scaled).map(|(&(high, _), &x)| g.mul(x, high)).collect();
    let mut errors: Vec<_> = cross.iter().zip(b_scaled).map(|(&(high, _), &x)| g.product_error(x, high)).collect();
    let lows: Vec<_> = cross.iter().map(|&(_, low)| low).collect();
    errors.push(g.dot(&lows, b_scaled));
    errors.push(g.sum_error(products[0], products[1]));
    let sum = g.add(products[0], products[1]);
    errors.push(g.sum_error(sum, products[2]));
    let sum = g.add(sum, products[2]);

    let tails = |g: &mut Graph, v: &[NodeId]| v.iter().map(|&x| g.rounding_tail(x)).collect::<Vec<_>>();
    let (edge_tail, a_tail, b_tail) = (tails(g, edge), tails(g, a), tails(g, b));
    let a_b = g.cross(a_scaled, b_scaled);
    let by_edge = g.dot(&edge_tail, &a_b);
    let by_a = g.dot(&a_tail, edge_b);
    let by_b = g.dot(&b_tail, edge_a);
    let change = g.sub(by_edge, by_a);
    let change = g.add(change, by_b);
    errors.push(g.mul(scale, change));
    let errors = g.sum(errors);
    g.add(sum, errors)
}

/// sin and cos of θ/2 from those of θ: each by whichever form does not cancel.
fn half_angles(g: &mut Graph, sine: NodeId, cosine: NodeId, degenerate: NodeId) -> DihedralParts {
    let (null, one, half, two) = (g.constant(0.0), g.constant(1.0), g.constant(0.5), g.constant(2.0));
    let obtuse = g.less(cosine, null);
    let magnitude = g.abs(cosine);
    let sum = g.add(one, magnitude);
    // The larger of the two halves' functions; the smaller is |sin θ| / (2 · larger).
    let halved = g.mul(half, sum);
    let larger = g.sqrt(halved);
    let doubled = g.mul(two, larger);
    let absolute_sine = g.abs(sine);
    let smaller = g.div(absolute_sine, doubled);
    let magnitude = g.select(obtuse, larger, smaller);
    let negative = g.less(sine, null);
    let opposite = g.neg(magnitude);
    let sine_half = g.select(negative, opposite, magnitude);
    let cosine_half = g.select(obtuse, smaller, larger);
    let cosine_half = g.select(degenerate, null, cosine_half);
    DihedralParts { sine, cosine, sine_half, cosine_half, degenerate }
}

/// Of each triangle, over (apex, E), with c = (1, −τ), δ = (0, 1): gradient −c n/h and Hessian
/// c cᵀ (t nᵀ + n tᵀ)/h² + (c δᵀ Ê nᵀ + δ cᵀ n Êᵀ)/(e h) + ½ δ δᵀ (t nᵀ + n tᵀ)/e². Their sum is θ's.
fn derivatives(g: &mut Graph, hinge: &Hinge) -> (Vec<NodeId>, Vec<NodeId>) {
    let unit = &hinge.edge.unit;
    let half = g.constant(0.5);
    let per_edge_squared = g.mul(hinge.inverse_edge, hinge.inverse_edge);
    let half_per_edge_squared = g.mul(half, per_edge_squared);

    let mut first = vec![g.constant(0.0); 9];
    let mut second = vec![g.constant(0.0); 45];
    let place = |i: usize, j: usize| crate::graph::symmetric_index(9, i, j);
    for (w, wing) in hinge.wings.iter().enumerate() {
        let apex = 3 + 3 * w;
        let per_height_squared = g.mul(wing.inverse_height, wing.inverse_height);
        let mixed = g.mul(hinge.inverse_edge, wing.inverse_height);
        let slope = g.scaled(wing.inverse_height, &wing.normal);
        let tau = wing.along;
        let tau_squared = g.mul(tau, tau);
        for i in 0..3 {
            first[apex + i] = g.neg(slope[i]);
            let by_edge = g.mul(tau, slope[i]);
            first[i] = g.add(first[i], by_edge);
        }
        // c cᵀ/h² + ½ δ δᵀ/e² share the symmetric product; −τ (Ê nᵀ + n Êᵀ)/(e h) is left for the edge block.
        let scaled_tau = g.mul(tau_squared, per_height_squared);
        let edge_factor = g.add(scaled_tau, half_per_edge_squared);
        let tau_per_height = g.mul(tau, per_height_squared);
        let tau_mixed = g.mul(tau, mixed);
        for (i, j) in upper(3) {
            let symmetric = symmetric_product(g, &wing.tangent, &wing.normal, i, j);
            second[place(apex + i, apex + j)] = g.mul(per_height_squared, symmetric);
            let bent = g.mul(edge_factor, symmetric);
            let turned = symmetric_product(g, unit, &wing.normal, i, j);
            let turned = g.mul(tau_mixed, turned);
            let entry = g.sub(bent, turned);
            let at = place(i, j);
            second[at] = g.add(second[at], entry);
        }
        for i in 0..3 {
            for j in 0..3 {
                // Row: component i of the edge; column: component j of the apex.
                let symmetric = symmetric_product(g, &wing.tangent, &wing.normal, i.min(j), i.max(j));
                let bent = g.mul(tau_per_height, symmetric);
                let turned = g.mul(unit[j], wing.normal[i]);
                let turned = g.mul(mixed, turned);
                second[place(i, apex + j)] = g.sub(turned, bent);
            }
        }
    }
    (first, second)
}

/// sin or cos (`primitive` says which) of a dihedral angle or of its half.
pub(crate) fn recognise_dihedral(g: &mut Graph, x: NodeId, primitive: Primitive) -> Option<NodeId> {
    let (angle, halved) = match g.op(x) {
        crate::graph::Op::Mul(c, y) if g.is(c, 0.5) => (y, true),
        _ => (x, false),
    };
    let parts = g.rule(angle)?.dihedral?;
    let is_sine = primitive == Primitive::DihedralSine;
    let (value, derivative, primitive) = match (is_sine, halved) {
        (true, false) => (parts.sine, parts.cosine, primitive),
        (false, false) => (parts.cosine, parts.sine, primitive),
        (true, true) => (parts.sine_half, parts.cosine_half, Primitive::DihedralSineHalf),
        (false, true) => (parts.cosine_half, parts.sine_half, Primitive::DihedralCosineHalf),
    };
    let first = if is_sine { derivative } else { g.neg(derivative) };
    let second = g.neg(value);
    let (half, quarter) = (g.constant(0.5), g.constant(0.25));
    let (first, second) = if halved { (g.mul(half, first), g.mul(quarter, second)) } else { (first, second) };
    let mut rule = Rule::smooth(primitive, vec![angle], value, vec![first], vec![second]);
    rule = rule.flagged(0, Flag::Degenerate, parts.degenerate);
    if primitive == Primitive::DihedralCosineHalf {
        let null = g.constant(0.0);
        let fold = g.equal(value, null);
        rule = rule.flagged(1, Flag::Kink, fold);
    }
    Some(g.add_rule(rule, &[]))
}
