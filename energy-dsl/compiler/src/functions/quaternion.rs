//! Quaternions (w, x, y, z), dual quaternions (real part, dual part) and twists (rotation vector θ, translation t).
//!
//! A rotation is a unit quaternion q; it takes v to q v q*. A rigid motion is a dual quaternion with a unit real part q
//! and the dual part ½ t q; it takes p to q p q* + t. The exponential of a twist rotates by the angle 2‖θ‖: q = (cos
//! ‖θ‖, θ sin ‖θ‖/‖θ‖).

use super::length::direction;
use super::sinc::{assume_at_most_a_quarter_turn, cos_sqrt, sinc_sqrt};
use super::turned::turn;
use super::{Function, Lowered, Shape, Units};
use crate::graph::{Form, Graph, NodeId, Origin, Primitive, Rule, upper};
use energy_runtime::Flag;

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "quat",
        usage: "quat(w, x, y, z) or quat(w, v)",
        docs: "The quaternion w + x i + y j + z k.",
        shape: quat_shape,
        units: Units::Same,
        lower: |_, a| Lowered { shape: Shape::Quat, parts: joined(a) },
        accuracy: "0",
    },
    Function {
        name: "dual_quat",
        usage: "dual_quat(q, e)",
        docs: "The dual quaternion q + ε e.",
        shape: |s| exactly(s, &[Shape::Quat, Shape::Quat], Shape::DualQuat, "takes two quaternions"),
        units: Units::Parts,
        lower: |_, a| Lowered { shape: Shape::DualQuat, parts: joined(a) },
        accuracy: "0",
    },
    Function {
        name: "twist",
        usage: "twist(θ, t)",
        docs: "The twist of a rotation vector θ and a translation t.",
        shape: |s| exactly(s, &[Shape::Vector(3), Shape::Vector(3)], Shape::Twist, "takes two 3-vectors"),
        units: Units::Parts,
        lower: |_, a| Lowered { shape: Shape::Twist, parts: joined(a) },
        accuracy: "0",
    },
    Function {
        name: "angular",
        usage: "angular(ξ)",
        docs: "The part θ of the twist (θ, t).",
        shape: |s| exactly(s, &[Shape::Twist], Shape::Vector(3), "takes a twist"),
        units: Units::FirstPart,
        lower: |_, a| Lowered::vector(&a[0].parts[..3]),
        accuracy: "0",
    },
    Function {
        name: "linear",
        usage: "linear(ξ)",
        docs: "The part t of the twist (θ, t).",
        shape: |s| exactly(s, &[Shape::Twist], Shape::Vector(3), "takes a twist"),
        units: Units::SecondPart,
        lower: |_, a| Lowered::vector(&a[0].parts[3..]),
        accuracy: "0",
    },
    Function {
        name: "real",
        usage: "real(q)",
        docs: "The real part: a quaternion for a dual quaternion, the scalar w for a quaternion.",
        shape: real_shape,
        units: Units::FirstPart,
        lower: real,
        accuracy: "0",
    },
    Function {
        name: "dual",
        usage: "dual(q)",
        docs: "The dual part of a dual quaternion, as a quaternion.",
        shape: |s| exactly(s, &[Shape::DualQuat], Shape::Quat, "takes a dual quaternion"),
        units: Units::SecondPart,
        lower: |_, a| quaternion(&a[0].parts[4..]),
        accuracy: "0",
    },
    Function {
        name: "imaginary",
        usage: "imaginary(q)",
        docs: "The vector (x, y, z) of a quaternion.",
        shape: |s| exactly(s, &[Shape::Quat], Shape::Vector(3), "takes a quaternion"),
        units: Units::FirstPart,
        lower: |_, a| Lowered::vector(&a[0].parts[1..]),
        accuracy: "0",
    },
    Function {
        name: "conjugate",
        usage: "conjugate(q)",
        docs: "q*, with the vector part negated. For a dual quaternion, this applies to both parts.",
        shape: conjugate_shape,
        units: Units::First,
        lower: conjugate,
        accuracy: "0",
    },
    Function {
        name: "rotate",
        usage: "rotate(q, v)",
        docs: "q v q*: rotates the vector v by a unit quaternion, by the unit real part of a dual quaternion, or by a \
             motion.",
        shape: rotate_shape,
        units: Units::Rotated,
        lower: |g, a| Lowered::vector(rotate(g, turning(&a[0]), &a[1].parts)),
        accuracy: "",
    },
    Function {
        name: "transform",
        usage: "transform(q, p)",
        docs: "Moves the point p: by a motion, or by a dual quaternion with unit real part, which is a rotation by \
             real(q), then a translation by the vector part of 2 dual(q) real(q)*.",
        shape: |s| match *s {
            [Shape::Motion | Shape::DualQuat, Shape::Vector(3)] => Ok(Shape::Vector(3)),
            _ => Err("takes a motion or a dual quaternion, and a 3-vector".into()),
        },
        units: Units::Transformed,
        lower: transform,
        accuracy: "",
    },
    Function {
        name: "rotation",
        usage: "rotation(θ) or rotation(a)",
        docs: "The unit quaternion (cos ‖θ‖, θ sin ‖θ‖/‖θ‖) of half a rotation vector θ: it rotates by 2‖θ‖. Regular \
             at θ = 0. Of a motion a, its rotation.",
        shape: |s| match *s {
            [Shape::Vector(3) | Shape::Motion] => Ok(Shape::Quat),
            _ => Err("takes a 3-vector or a motion".into()),
        },
        units: Units::Orientation,
        lower: |g, a| match a[0].shape {
            Shape::Motion => quaternion(turning(&a[0])),
            _ => quaternion(&rotation(g, &a[0].parts)),
        },
        accuracy: "",
    },
    Function {
        name: "position",
        usage: "position(a)",
        docs: "The position of a motion, where it takes the origin.",
        shape: |s| exactly(s, &[Shape::Motion], Shape::Vector(3), "takes a motion"),
        units: Units::SecondPart,
        lower: |_, a| Lowered::vector(&a[0].parts[..3]),
        accuracy: "0",
    },
    Function {
        name: "rotation_matrix",
        usage: "rotation_matrix(q)",
        docs: "The 3×3 rotation matrix of a unit quaternion.",
        shape: |s| exactly(s, &[Shape::Quat], Shape::Matrix(3, 3), "takes a quaternion"),
        units: Units::Orientation,
        lower: rotation_matrix,
        accuracy: "",
    },
];

fn exactly(shapes: &[Shape], wanted: &[Shape], result: Shape, expectation: &str) -> Result<Shape, String> {
    if shapes == wanted {
        return Ok(result);
    }
    let found = shapes.iter().map(ToString::to_string).collect::<Vec<_>>().join(" and ");
    Err(format!("{expectation}, but found {}", if found.is_empty() { "nothing" } else { &found }))
}

fn quat_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Scalar, Shape::Scalar, Shape::Scalar, Shape::Scalar] | [Shape::Scalar, Shape::Vector(3)] => {
            Ok(Shape::Quat)
        }
        _ => Err("takes four scalars, or a scalar and a 3-vector".into()),
    }
}

fn real_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::DualQuat] => Ok(Shape::Quat),
        [Shape::Quat] => Ok(Shape::Scalar),
        _ => Err("takes a quaternion or a dual quaternion".into()),
    }
}

fn conjugate_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [q @ (Shape::Quat | Shape::DualQuat)] => Ok(q),
        _ => Err("takes a quaternion or a dual quaternion".into()),
    }
}

fn rotate_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Quat | Shape::DualQuat | Shape::Motion, Shape::Vector(3)] => Ok(Shape::Vector(3)),
        _ => Err("takes a quaternion, a dual quaternion or a motion, and a 3-vector".into()),
    }
}

fn joined(values: &[Lowered]) -> Vec<NodeId> {
    values.iter().flat_map(|v| v.parts.iter().copied()).collect()
}

fn quaternion(parts: &[NodeId]) -> Lowered {
    Lowered { shape: Shape::Quat, parts: parts.to_vec() }
}

fn real(_: &mut Graph, a: &[Lowered]) -> Lowered {
    match a[0].shape {
        Shape::DualQuat => quaternion(&a[0].parts[..4]),
        _ => Lowered::scalar(a[0].parts[0]),
    }
}

fn conjugate(g: &mut Graph, a: &[Lowered]) -> Lowered {
    let parts: Vec<_> = a[0].parts.iter().enumerate().map(|(i, &p)| if i % 4 == 0 { p } else { g.neg(p) }).collect();
    if is_unit(g, &a[0].parts) {
        g.note_origin(&parts, Origin::UnitQuaternion);
    }
    Lowered { shape: a[0].shape, parts }
}

/// Returns whether a quaternion is known to have length 1.
pub(super) fn is_unit(g: &Graph, q: &[NodeId]) -> bool {
    matches!(g.origin(q), Some(Origin::UnitQuaternion))
}

/// Returns p q = (p₀ q₀ − p·q, p₀ q + q₀ p + p × q).
fn hamilton(g: &mut Graph, p: &[NodeId], q: &[NodeId]) -> Vec<NodeId> {
    let (real, along) = (g.mul(p[0], q[0]), g.dot(&p[1..], &q[1..]));
    let sums: Vec<_> = (1..4).map(|i| g.dot(&[p[0], q[0]], &[q[i], p[i]])).collect();
    let mut product = vec![g.sub(real, along)];
    product.extend(plus_cross(g, &sums, &p[1..], &q[1..]));
    if is_unit(g, p) && is_unit(g, q) {
        g.note_origin(&product, Origin::UnitQuaternion);
    }
    product
}

/// Returns s + a × b, one product at a time, so that each fuses with the sum so far.
fn plus_cross(g: &mut Graph, s: &[NodeId], a: &[NodeId], b: &[NodeId]) -> [NodeId; 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let (plus, minus) = (g.mul(a[j], b[k]), g.mul(a[k], b[j]));
        let sum = g.add(s[i], plus);
        g.sub(sum, minus)
    })
}

/// Returns the product of two quaternions, or of two dual quaternions: p q + ε (p q′ + p′ q).
pub(super) fn product(g: &mut Graph, a: &Lowered, b: &Lowered) -> Lowered {
    let (p, q) = (&a.parts, &b.parts);
    let mut parts = hamilton(g, &p[..4], &q[..4]);
    if a.shape == Shape::DualQuat {
        let (one, other) = (hamilton(g, &p[..4], &q[4..]), hamilton(g, &p[4..], &q[..4]));
        parts.extend(one.into_iter().zip(other).map(|(x, y)| g.add(x, y)));
    }
    Lowered { shape: a.shape, parts }
}

/// Returns v + 2 (w t + u × t) with q = (w, u) and t = u × v.
fn rotate(g: &mut Graph, q: &[NodeId], v: &[NodeId]) -> Vec<NodeId> {
    let rotated = turn(g, q, v).unwrap_or_else(|| rotated(g, q, v));
    g.note_origin(&rotated, Origin::Rotated { quaternion: q.to_vec(), vector: v.to_vec() });
    rotated
}

pub(super) fn rotated(g: &mut Graph, q: &[NodeId], v: &[NodeId]) -> Vec<NodeId> {
    let t = if g.form() == Form::Textbook { g.cross(&q[1..], v) } else { g.fused_cross(&q[1..], v) };
    let (two, along) = (g.constant(2.0), g.scaled(q[0], &t));
    let half = plus_cross(g, &along, &q[1..], &t);
    let added = g.scaled(two, &half);
    v.iter().zip(added).map(|(&v, added)| g.add(v, added)).collect()
}

/// Returns the quaternion that a value rotates by.
fn turning(value: &Lowered) -> &[NodeId] {
    match value.shape {
        Shape::Motion => &value.parts[3..],
        _ => &value.parts[..4],
    }
}

/// Returns the inverse of a motion: p ↦ R* (p − x).
pub(super) fn inverse_motion(g: &mut Graph, motion: &Lowered) -> Lowered {
    let back = conjugate(g, &[quaternion(turning(motion))]);
    let turned = rotate(g, &back.parts, &motion.parts[..3]);
    let mut parts: Vec<NodeId> = turned.into_iter().map(|part| g.neg(part)).collect();
    parts.extend(back.parts);
    g.note_origin(&parts, Origin::Inverse { motion: motion.parts.clone() });
    Lowered { shape: Shape::Motion, parts }
}

/// Returns the motion by b, then by a.
pub(super) fn motion_after(g: &mut Graph, a: &Lowered, b: &Lowered) -> Lowered {
    let position = Lowered::vector(&b.parts[..3]);
    let mut parts = transform(g, &[a.clone(), position]).parts;
    parts.extend(hamilton(g, turning(a), turning(b)));
    Lowered { shape: Shape::Motion, parts }
}

/// Rotates, and translates by w e − w′ u + u × e, with the real part (w, u) and twice the dual part, (w′, e).
fn transform(g: &mut Graph, a: &[Lowered]) -> Lowered {
    if let Some(Origin::Inverse { motion }) = g.origin(&a[0].parts).cloned() {
        // R* (p − x): a difference of points that are far away keeps its digits.
        let away: Vec<_> = a[1].parts.iter().zip(&motion[..3]).map(|(&p, &x)| g.sub(p, x)).collect();
        return Lowered::vector(rotate(g, turning(&a[0]), &away));
    }
    if a[0].shape == Shape::Motion {
        let turned = rotate(g, turning(&a[0]), &a[1].parts);
        let moved = a[0].parts[..3].iter().zip(turned).map(|(&x, turned)| g.add(x, turned));
        return Lowered::vector(moved.collect::<Vec<_>>());
    }
    let (q, dual) = a[0].parts.split_at(4);
    let turned = rotated(g, q, &a[1].parts);
    let two = g.constant(2.0);
    let dual = g.scaled(two, dual);
    let moved = plus_translation(g, &turned, q, &dual);
    let origin = Origin::Transformed { quaternion: q.to_vec(), dual, vector: a[1].parts.clone() };
    g.note_origin(&moved, origin);
    Lowered::vector(moved)
}

/// Returns the translation of a dual quaternion, given its real part and twice its dual part.
pub(super) fn translation(g: &mut Graph, q: &[NodeId], dual: &[NodeId]) -> Vec<NodeId> {
    let null = g.constant(0.0);
    plus_translation(g, &[null; 3], q, dual)
}

/// Returns s + w e − w′ u + u × e.
fn plus_translation(g: &mut Graph, s: &[NodeId], q: &[NodeId], dual: &[NodeId]) -> Vec<NodeId> {
    let along: Vec<_> = (0..3)
        .map(|i| {
            let (plus, minus) = (g.mul(q[0], dual[i + 1]), g.mul(dual[0], q[i + 1]));
            let sum = g.add(s[i], plus);
            g.sub(sum, minus)
        })
        .collect();
    plus_cross(g, &along, &q[1..], &dual[1..]).to_vec()
}

fn rotation_matrix(g: &mut Graph, a: &[Lowered]) -> Lowered {
    let (null, one) = (g.constant(0.0), g.constant(1.0));
    let columns: Vec<_> = (0..3)
        .map(|axis| {
            let unit: Vec<_> = (0..3).map(|i| if i == axis { one } else { null }).collect();
            rotate(g, &a[0].parts, &unit)
        })
        .collect();
    Lowered::matrix(3, 3, (0..9).map(|e| columns[e % 3][e / 3]).collect())
}

/// Returns (cos ‖θ‖, θ sin ‖θ‖/‖θ‖).
fn rotation(g: &mut Graph, theta: &[NodeId]) -> Vec<NodeId> {
    let (cosine, sinc) = cosine_and_sinc(g, theta);
    let parts = about(g, cosine, sinc, theta);
    g.note_origin(&parts, Origin::UnitQuaternion);
    parts
}

/// Returns cos ‖θ‖ and sin ‖θ‖/‖θ‖.
fn cosine_and_sinc(g: &mut Graph, theta: &[NodeId]) -> (NodeId, NodeId) {
    let square = g.sum_of_squares(theta);
    let both = (cos_sqrt(g, square), sinc_sqrt(g, square));
    assume_at_most_a_quarter_turn(g, square);
    both
}

/// Returns (c, s θ).
fn about(g: &mut Graph, c: NodeId, s: NodeId, theta: &[NodeId]) -> Vec<NodeId> {
    let mut parts = vec![c];
    parts.extend(g.scaled(s, theta));
    parts
}

/// Returns the exponential of a twist: the rotation q of θ, and ½ (0, t) q.
pub(super) fn exp(g: &mut Graph, twist: &Lowered) -> Lowered {
    let (theta, t) = twist.parts.split_at(3);
    let (cosine, sinc) = cosine_and_sinc(g, theta);
    let real = about(g, cosine, sinc, theta);
    let parts = with_shift(g, real, t);
    let (turn, shift) = (theta.to_vec(), t.to_vec());
    g.note_origin(&parts[..4], Origin::UnitQuaternion);
    g.note_origin(&parts, Origin::Exponential { cosine, sinc, turn, shift });
    Lowered { shape: Shape::DualQuat, parts }
}

/// Returns w q + ε ½ (0, t) (w q) if `parts` are an exponential q + ε ½ (0, t) q. This takes five products with w
/// instead of eight, and one instead of eight in reverse.
pub(super) fn scaled_exponential(g: &mut Graph, w: NodeId, parts: &[NodeId]) -> Option<Vec<NodeId>> {
    let Origin::Exponential { cosine, sinc, turn, shift } = g.origin(parts)?.clone() else { return None };
    let (cosine, sinc) = (g.mul(w, cosine), g.mul(w, sinc));
    let real = about(g, cosine, sinc, &turn);
    Some(with_shift(g, real, &shift))
}

/// Returns q + ε ½ (0, t) q.
fn with_shift(g: &mut Graph, mut real: Vec<NodeId>, t: &[NodeId]) -> Vec<NodeId> {
    let half = g.constant(0.5);
    let mut halved = vec![g.constant(0.0)];
    halved.extend(g.scaled(half, t));
    let dual = hamilton(g, &halved, &real);
    real.extend(dual);
    real
}

/// Returns a dual quaternion times ρ = 1/‖q‖, where q is its real part. With n = q/‖q‖: ∇ρ = −ρ² n and ∇²ρ = ρ³ (3 n nᵀ
/// − I).
pub(super) fn unit_dual(g: &mut Graph, dual: &Lowered) -> Lowered {
    let q = &dual.parts[..4];
    let reciprocal = if g.form() == Form::Textbook {
        let (one, square) = (g.constant(1.0), g.sum_of_squares(q));
        let norm = g.sqrt(square);
        g.div(one, norm)
    } else {
        let at = direction(g, q);
        let value = g.mul(at.reciprocal, at.scale);
        let square = g.product(None, &[at.scale, at.scale, at.per_square]);
        let slope = g.neg(square);
        let cube = g.mul(slope, value);
        let minus_three = g.constant(-3.0);
        let triple = g.mul(minus_three, cube);
        let first = at.unit.iter().map(|&n| vec![slope, n]).collect();
        let second = upper(4)
            .map(|(i, j)| {
                let along = vec![triple, at.unit[i], at.unit[j]];
                if i == j { vec![along, vec![cube]] } else { vec![along] }
            })
            .collect();
        let rule = Rule::factored(Primitive::ReciprocalNorm, q.to_vec(), value, first, second);
        g.add_rule(rule.flagged(0, Flag::Degenerate, at.zero), &[])
    };
    let parts = g.scaled(reciprocal, &dual.parts);
    g.note_origin(&parts[..4], Origin::UnitQuaternion);
    Lowered { shape: Shape::DualQuat, parts }
}
