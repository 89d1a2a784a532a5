//! The rotation vector of a unit quaternion (w, v): 2 A(w) v with A(w) = acos w / √(1 − w²), w ≥ 0. As a function of w, A
//! is regular at w = 1, where nothing turns: A′ = (w A − 1)/(1 − w²) and A″ = (A + 3 w A′)/(1 − w²). Where these cancel,
//! the power series A = Σ n!/(2n + 1)!! (1 − w)ⁿ is used.

use super::Lowered;
use super::power_series::{Interval, economised, polynomial};
use super::quaternion::is_unit;
use crate::graph::{Form, Graph, NodeId, Origin, Primitive, Rule};

/// Returns the rotation vector. q and −q are the same rotation: the one with w ≥ 0 is used.
pub(super) fn rotation_vector(g: &mut Graph, q: &Lowered) -> Lowered {
    let (w, v) = (q.parts[0], &q.parts[1..]);
    let (null, two) = (g.constant(0.0), g.constant(2.0));
    if g.form() == Form::Textbook {
        let square = g.sum_of_squares(v);
        let sine = g.sqrt(square);
        let tangent = g.div(sine, w);
        let one = g.constant(1.0);
        let half = g.atan2(tangent, one);
        let ratio = g.div(half, sine);
        let factor = g.mul(two, ratio);
        return Lowered::vector(g.scaled(factor, v));
    }
    // Four numbers that move independently leave the unit sphere.
    let is_unit = is_unit(g, &q.parts);
    let (w, two) = if is_unit { (w, two) } else { normalised(g, &q.parts, two) };
    let is_negative = g.less(w, null);
    let opposite = g.neg(w);
    let cosine = g.select(is_negative, opposite, w);
    let ratio = arc_over_sine(g, cosine);
    let double = g.mul(two, ratio);
    let reversed = g.neg(double);
    let factor = g.select(is_negative, reversed, double);
    let vector = g.scaled(factor, v);
    if is_unit {
        g.note_origin(&vector, Origin::RotationVector { cosine, ratio, vector: v.to_vec() });
    }
    Lowered::vector(vector)
}

/// Recognises the squared length of a rotation vector, 4 acos² w = 4 A² ‖v‖². As a function of w alone, its first
/// derivative is −8 A, the second −8 A′.
pub(super) fn recognise_square(g: &mut Graph, vector: &[NodeId]) -> Option<NodeId> {
    let Origin::RotationVector { cosine, ratio, vector } = g.origin(vector)?.clone() else { return None };
    let slope = g.rule(ratio)?.first.first()?.first().copied()?;
    let (four, minus_eight) = (g.constant(4.0), g.constant(-8.0));
    let square = g.sum_of_squares(&vector);
    let value = g.product(None, &[four, ratio, ratio, square]);
    let (first, second) = (g.mul(minus_eight, ratio), g.mul(minus_eight, slope));
    let rule = Rule::smooth(Primitive::SquaredRotation, vec![cosine], value, vec![first], vec![second]);
    Some(g.add_rule(rule, &[]))
}

/// Returns the real part of q/‖q‖, and a number over ‖q‖.
fn normalised(g: &mut Graph, q: &[NodeId], number: NodeId) -> (NodeId, NodeId) {
    let (square, one) = (g.sum_of_squares(q), g.constant(1.0));
    let length = g.sqrt(square);
    let inverse = g.div(one, length);
    (g.mul(q[0], inverse), g.mul(number, inverse))
}

/// Below this 1 − w, the series is shorter than the expressions that it replaces, and A + 3 w A′ cancels.
const SERIES_BELOW: f64 = 0.5;

/// Creates A(w).
fn arc_over_sine(g: &mut Graph, w: NodeId) -> NodeId {
    let (one, two, three, below) = (g.constant(1.0), g.constant(2.0), g.constant(3.0), g.constant(SERIES_BELOW));
    let z = g.sub(one, w);
    let is_near = g.less(z, below);
    // Where the series is used, 1 replaces z in the other forms, so that they stay finite.
    let far = g.select(is_near, one, z);
    let sum = g.sub(two, far);
    let square = g.mul(far, sum);
    let (sine, reciprocal) = (g.sqrt(square), g.div(one, square));
    let near_one = |g: &mut Graph, order: u32, direct: NodeId| {
        let series = polynomial(g, z, coefficients(order));
        g.select(is_near, series, direct)
    };
    let arc = g.atan2(sine, w);
    let direct = g.div(arc, sine);
    let value = near_one(g, 0, direct);
    let product = g.mul(w, value);
    let numerator = g.sub(product, one);
    let direct = g.mul(numerator, reciprocal);
    let first = near_one(g, 1, direct);
    let triple = g.product(None, &[three, w, first]);
    let numerator = g.add(value, triple);
    let direct = g.mul(numerator, reciprocal);
    let second = near_one(g, 2, direct);
    g.add_rule(Rule::smooth(Primitive::ArcOverSine, vec![w], value, vec![first], vec![second]), &[])
}

/// Returns the coefficients of the series of a derivative of A by w.
fn coefficients(order: u32) -> Vec<f64> {
    // (−1)ᵐ (k+1) … (k+m) n!/(2n+1)!! with n = k + m.
    let coefficient = |k: u32| {
        let n = k + order;
        let falling: f64 = (k + 1..=n).map(f64::from).product();
        let quotient: f64 = (1..=n).map(|i| f64::from(i) / f64::from(2 * i + 1)).product();
        (if order.is_multiple_of(2) { 1.0 } else { -1.0 }) * falling * quotient
    };
    economised(coefficient, Interval::FromZero(SERIES_BELOW))
}
