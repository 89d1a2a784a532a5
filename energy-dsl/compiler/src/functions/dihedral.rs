//! The dihedral angle of a hinge, its sine and cosine, and those of half the angle, with their own derivatives.
//!
//! Points x₁ and x₂ are the apexes, x₃x₄ is the shared edge. With E = x₄ − x₃, a = x₁ − x₃, b = x₂ − x₃, N₁ = E × a and
//! N₂ = −E × b, a flat hinge has angle 0 and sin θ = (n₁ × n₂)·Ê.
//!
//! θ = atan2(−‖E‖ b·(E×a), −(E×a)·(E×b)). The triple product is computed as if in doubled precision, with the rounding
//! errors of the edges, so the angle of a nearly flat hinge has a small relative error.

use super::angle::{accurate_cross, exact_cross};
use super::length::{common_scale, direction_scaled};
use super::{Function, Lowered, Shape, Units};
use crate::graph::{DihedralParts, Form, Graph, NodeId, Primitive, Product, Rule, upper};
use energy_runtime::Flag;

pub(super) const FUNCTIONS: &[Function] = &[Function {
    name: "dihedral",
    usage: "dihedral(x1, x2, x3, x4)",
    docs: "Signed dihedral angle θ in (−π, π] between the triangles x1x3x4 and x2x3x4 with the shared edge E = x3x4. \
         It is 0 if flat and +π if exactly folded; sin θ = (n₁ × n₂)·Ê with N₁ = E × (x₁ − x₃). If a triangle has no \
         area, the angle and its derivatives are 0 and flagged. Sine and cosine of θ and of θ/2 are computed without \
         the angle.",
    shape: four_points,
    units: Units::Compared,
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

/// The textbook form: atan2 of the unit normals' cross product along the edge and of their dot product.
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

/// One triangle of the hinge, in scaled lengths, with apex a and normal N = E × a.
struct Wing {
    /// u = ±‖E‖ N/‖N‖², the negative gradient of the angle with respect to the apex.
    slope: Vec<NodeId>,
    /// s = ±t/‖N‖² with t = N × E. The form ‖E‖² (a − τ E) cancels in needle triangles.
    tangent: Vec<NodeId>,
    /// τ = a·E/‖E‖², the position of the apex along the edge.
    along: NodeId,
    /// ½ ‖N‖²/‖E‖⁴.
    aspect: NodeId,
}

fn robust(g: &mut Graph, edge: &[NodeId], a: &[NodeId], b: &[NodeId]) -> NodeId {
    let arguments: Vec<_> = edge.iter().chain(a).chain(b).copied().collect();
    let scale = common_scale(g, &arguments);
    let e = direction_scaled(g, edge, scale);
    let (a_scaled, b_scaled) = (g.scaled(scale, a), g.scaled(scale, b));
    let first = exact_cross(g, &e.scaled, &a_scaled);
    let n1: Vec<_> = first.iter().map(|&(high, low)| g.add(high, low)).collect();
    let n2 = accurate_cross(g, &e.scaled, &b_scaled);

    let volume = triple_product(g, (edge, a, b), (&a_scaled, &b_scaled), scale, &first, (&n1, &n2));
    let (null, one) = (g.constant(0.0), g.constant(1.0));
    let folded = g.dot(&n1, &n2);
    let y = g.mul(e.length, volume);
    // −0 and +0 denote the same fold: +π.
    let y = g.minus_or_plus_zero(y);
    let x = g.neg(folded);
    // ‖N₁‖²‖N₂‖² = x² + y².
    let areas_squared = g.sum_of_squares(&[x, y]);
    let degenerate = g.equal(areas_squared, null);
    let (edge_moderate, areas_moderate) = (g.is_moderate(e.square, 2), g.is_moderate(areas_squared, 8));
    let moderate = g.and(edge_moderate, areas_moderate);
    let never = g.truth(false);
    for (precaution, instead) in [(scale, one), (e.zero, never), (degenerate, never)] {
        g.assume(precaution, instead, moderate);
    }
    let (raw, ordinary) = (g.atan2(y, x), g.moderate_atan2(y, x));
    g.assume(raw, ordinary, moderate);
    let value = g.select(degenerate, null, raw);

    let areas = g.sqrt(areas_squared);
    let [sine, cosine] = [y, x].map(|part| {
        let quotient = g.div(part, areas);
        g.select(degenerate, null, quotient)
    });
    let parts = half_angles(g, sine, cosine, degenerate);

    let half = g.constant(0.5);
    let aspect_unit = g.mul(e.per_square, e.per_square);
    let aspect_unit = g.mul(half, aspect_unit);
    let wing = |g: &mut Graph, normal: &[NodeId], negative: bool, apex: &[NodeId]| {
        let square = g.sum_of_squares(normal);
        let reciprocal = g.div(one, square);
        let reciprocal = g.select(degenerate, null, reciprocal);
        let along = g.dot(apex, &e.scaled);
        let along = g.mul(along, e.per_square);
        let across = g.fused_cross(normal, &e.scaled);
        let tangent = g.scaled(reciprocal, &across);
        let factor = g.mul(e.length, reciprocal);
        let factor = if negative { g.neg(factor) } else { factor };
        Wing { slope: g.scaled(factor, normal), tangent, along, aspect: g.mul(aspect_unit, square) }
    };
    let wings = [wing(g, &n1, false, &a_scaled), wing(g, &n2, true, &b_scaled)];
    let per_edge = g.scaled(e.per_square, &e.scaled);
    let (first, second) = derivatives(g, scale, &per_edge, &wings);
    let mut rule =
        Rule::factored(Primitive::Dihedral, arguments, value, first, second).flagged(0, Flag::Degenerate, degenerate);
    rule.dihedral = Some(parts);
    g.add_rule(rule, &[])
}

/// Returns b·(E×a) of the scaled edges: the determinant in double-double, plus its change by the rounding errors of the
/// edges.
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

/// Returns sin and cos of θ/2 from those of θ, each by the form that does not cancel.
fn half_angles(g: &mut Graph, sine: NodeId, cosine: NodeId, degenerate: NodeId) -> DihedralParts {
    let (null, one, half, two) = (g.constant(0.0), g.constant(1.0), g.constant(0.5), g.constant(2.0));
    let obtuse = g.less(cosine, null);
    let magnitude = g.abs(cosine);
    let sum = g.add(one, magnitude);
    // The larger of the two half-angle functions. The smaller one is |sin θ| / (2 · larger).
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

/// Returns the derivatives, summed over both triangles. For one triangle, over (apex, E) with F = E/‖E‖² and S = u sᵀ +
/// s uᵀ:
///
/// - The gradient is −(u, −τ u).
/// - The Hessian has the blocks S for the apex, u Fᵀ − τ S between edge and apex, and u zᵀ + z uᵀ with z = (τ² +
///   ½‖N‖²/‖E‖⁴) s − τ F for the edge.
///
/// In each product u comes first: weighted, it is part of the gradient, which is computed anyway.
fn derivatives(
    g: &mut Graph,
    scale: NodeId,
    per_edge: &[NodeId],
    wings: &[Wing; 2],
) -> (Vec<Product>, Vec<Vec<Product>>) {
    let minus_scale = g.neg(scale);
    let mut by_edge: [Vec<NodeId>; 3] = Default::default();
    let mut first = vec![Product::new(); 9];
    let mut second = vec![Vec::<Product>::new(); 45];
    let place = |i: usize, j: usize| crate::graph::symmetric_index(9, i, j);
    for (w, wing) in wings.iter().enumerate() {
        let Wing { slope: u, tangent: s, along: tau, aspect } = wing;
        let (apex, minus_tau) = (3 + 3 * w, g.neg(*tau));
        let tau_squared = g.mul(*tau, *tau);
        let bent = g.add(tau_squared, *aspect);
        let z: Vec<_> = (0..3).map(|i| g.difference_of_products([bent, s[i]], [*tau, per_edge[i]])).collect();
        for i in 0..3 {
            first[apex + i] = vec![g.mul(minus_scale, u[i])];
            by_edge[i].push(g.mul(*tau, u[i]));
        }
        // Returns entry (i, j) of u vᵀ + v uᵀ, times the other factors.
        let symmetric = |v: &[NodeId], i: usize, j: usize, more: &[NodeId]| -> [Product; 2] {
            [(i, j), (j, i)].map(|(i, j)| [&[u[i], v[j]], more].concat())
        };
        for (i, j) in upper(3) {
            second[place(apex + i, apex + j)].extend(symmetric(s, i, j, &[]));
            second[place(i, j)].extend(symmetric(&z, i, j, &[]));
        }
        for i in 0..3 {
            for j in 0..3 {
                // Row: component i of the edge. Column: component j of the apex.
                let at = place(i, apex + j);
                second[at].extend(symmetric(s, i.min(j), i.max(j), &[minus_tau]));
                second[at].push(vec![u[i], per_edge[j]]);
            }
        }
    }
    for (i, terms) in by_edge.into_iter().enumerate() {
        let sum = g.accumulate(terms[0], terms[1]);
        first[i] = vec![g.mul(scale, sum)];
    }
    let scale_squared = g.mul(scale, scale);
    second.iter_mut().flatten().for_each(|product| product.push(scale_squared));
    (first, second)
}

/// Recognises the sine of a dihedral angle or of its half.
pub(super) fn recognise_sine(g: &mut Graph, x: NodeId, _: NodeId) -> Option<NodeId> {
    without_angle(g, x, Primitive::DihedralSine)
}

/// Recognises the cosine of a dihedral angle or of its half.
pub(super) fn recognise_cosine(g: &mut Graph, x: NodeId, _: NodeId) -> Option<NodeId> {
    without_angle(g, x, Primitive::DihedralCosine)
}

/// Returns the sine or cosine (`primitive` says which) of a dihedral angle or of its half, computed without the angle.
fn without_angle(g: &mut Graph, x: NodeId, primitive: Primitive) -> Option<NodeId> {
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

/// Recognises sin(θ/2) − sin(y/2) for a dihedral angle θ and a constant y. Near folded, where |sin| > |cos|, the
/// difference is that of the squared cosines over the sum of the sines. The cosines are small there, and so are their
/// rounding errors.
pub(super) fn recognise_sine_difference(g: &mut Graph, sine: NodeId, rest: NodeId) -> Option<NodeId> {
    let rule = g.rule(sine).filter(|r| r.primitive == Primitive::DihedralSineHalf)?.clone();
    let crate::graph::Op::Sin(half_rest) = g.op(rest) else { return None };
    if g.varies(half_rest) {
        return None;
    }
    let parts = g.rule(rule.arguments[0])?.dihedral?;
    let rest_cosine = g.cos(half_rest);
    let direct = g.plain_difference(parts.sine_half, rest);
    let (less, more) = (g.sub(rest_cosine, parts.cosine_half), g.add(rest_cosine, parts.cosine_half));
    let numerator = g.mul(less, more);
    let denominator = g.add(parts.sine_half, rest);
    let quotient = g.div(numerator, denominator);
    let null = g.constant(0.0);
    let (same_side, magnitude) = (g.mul(parts.sine_half, rest), g.abs(parts.sine_half));
    let (same_side, folded) = (g.less(null, same_side), g.less(parts.cosine_half, magnitude));
    let near = g.and(same_side, folded);
    let value = g.select(near, quotient, direct);
    let difference = Rule { primitive: Primitive::DihedralSineDifference, value, ..rule };
    Some(g.add_rule(difference, &[rest]))
}
