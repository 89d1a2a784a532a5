//! Arithmetic operators on numbers, vectors and matrices.

use super::inner_product::inner_product;
use super::polar::recognise_stretch;
use super::{Function, Lowered, Shape, Units};
use crate::graph::{Ending, Form, Graph, NodeId, Op, Origin};

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "+",
        usage: "a + b",
        docs: "Sum of two values of the same shape.",
        shape: same,
        units: Units::Same,
        lower: add,
        accuracy: "",
    },
    Function {
        name: "-",
        usage: "a - b",
        docs: "Difference of two values of the same shape. `x^2 - y^2` of scalars is computed as (x − y)(x + y).",
        shape: same,
        units: Units::Same,
        lower: sub,
        accuracy: "",
    },
    Function { name: "neg", usage: "-a", docs: "Negation.", shape: one, units: Units::First, lower: neg, accuracy: "" },
    Function {
        name: "*",
        usage: "a * b",
        docs: "Product of scalars, matrices, quaternions or dual quaternions, of a matrix and a vector, or of a \
             scalar and any value. For motions, the motion by b, then by a.",
        shape: product,
        units: Units::Product,
        lower: mul,
        accuracy: "",
    },
    Function {
        name: "/",
        usage: "a / b",
        docs: "Division by a scalar.",
        shape: quotient,
        units: Units::Quotient,
        lower: div,
        accuracy: "",
    },
    Function {
        name: "^",
        usage: "a ^ b",
        docs: "Power of a scalar. Integer and half-integer exponents become products and roots. `norm(d)^α` is a \
             robust primitive. `M^(-1)` is the inverse of a matrix.",
        shape: power,
        units: Units::Raised,
        lower: pow,
        accuracy: "norm(d)^α: 3 / 3 / 6",
    },
];

fn same(shapes: &[Shape]) -> Result<Shape, String> {
    match shapes {
        [a, b] if a == b && *a != Shape::Truth => Ok(*a),
        [a, b] => Err(format!("both sides must have the same shape, but the left is {a} and the right is {b}")),
        _ => Err("takes two operands".into()),
    }
}

fn one(shapes: &[Shape]) -> Result<Shape, String> {
    match shapes {
        [Shape::Truth] => Err("a comparison has no negative; swap its sides".into()),
        [a] => Ok(*a),
        _ => Err("takes one operand".into()),
    }
}

fn product(shapes: &[Shape]) -> Result<Shape, String> {
    use Shape::{Matrix, Scalar, Truth, Vector};
    match *shapes {
        [Truth, _] | [_, Truth] => Err("a comparison is not a number; use if … { } else { }".into()),
        [Scalar, other] | [other, Scalar] => Ok(other),
        [Shape::Quat, Shape::Quat] => Ok(Shape::Quat),
        [Shape::DualQuat, Shape::DualQuat] => Ok(Shape::DualQuat),
        [Shape::Motion, Shape::Motion] => Ok(Shape::Motion),
        [Matrix(r, c), Matrix(r2, c2)] if c == r2 => Ok(Matrix(r, c2)),
        [Matrix(r, c), Vector(n)] if c == n => Ok(if r == 1 { Scalar } else { Vector(r) }),
        [Vector(_), Vector(_)] => {
            Err("two vectors have no product `*`; did you mean dot(a, b), cross(a, b) or outer(a, b)?".into())
        }
        [a @ (Matrix(..) | Vector(_)), b @ (Matrix(..) | Vector(_))] => {
            Err(format!("inner sizes must agree, but this is {a} times {b}"))
        }
        [a, b] => Err(format!("{a} and {b} have no product")),
        _ => Err("takes two operands".into()),
    }
}

fn quotient(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Truth, _] => Err("a comparison cannot be divided".into()),
        [a, Shape::Scalar] => Ok(a),
        [_, b] => Err(format!("the divisor must be a scalar, but it is {b}")),
        _ => Err("takes two operands".into()),
    }
}

fn power(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Scalar, Shape::Scalar] => Ok(Shape::Scalar),
        [Shape::Vector(_), _] => Err("a vector has no power; did you mean norm_squared(a)?".into()),
        [Shape::Matrix(..), _] => Err("a matrix has no power but the inverse, M^(-1) or inverse(M)".into()),
        [a, Shape::Scalar] => Err(format!("the base must be a scalar, but it is {a}")),
        [_, b] => Err(format!("the exponent must be a scalar, but it is {b}")),
        _ => Err("takes two operands".into()),
    }
}

fn by_parts(g: &mut Graph, args: &[Lowered], op: fn(&mut Graph, NodeId, NodeId) -> NodeId) -> Lowered {
    let parts = args[0].parts.iter().zip(&args[1].parts).map(|(&a, &b)| op(g, a, b)).collect();
    Lowered { shape: args[0].shape, parts }
}

/// Returns a + b or a − b. What is a sum of differences of unknowns is computed from these.
fn summed(g: &mut Graph, a: NodeId, b: NodeId, sign: f64) -> NodeId {
    if g.form() == Form::Robust
        && let Some(sum) = g.by_differences(a, b, sign)
    {
        return sum;
    }
    if sign > 0.0 { g.add(a, b) } else { g.sub(a, b) }
}

/// Returns the robust form of an operation on scalars that the user wrote.
fn recognised(g: &mut Graph, ending: Ending, args: &[Lowered]) -> Option<Lowered> {
    let [Lowered { shape: Shape::Scalar, parts: a }, Lowered { shape: Shape::Scalar, parts: b }] = args else {
        return None;
    };
    g.recognised(ending, a[0], b[0]).map(Lowered::scalar)
}

fn add(g: &mut Graph, args: &[Lowered]) -> Lowered {
    recognised(g, Ending::WrittenSum, args).unwrap_or_else(|| by_parts(g, args, |g, a, b| summed(g, a, b, 1.0)))
}

fn sub(g: &mut Graph, args: &[Lowered]) -> Lowered {
    if g.form() == Form::Robust
        && args[0].shape == Shape::Scalar
        && let Some(product) = recognise_squares(g, args[0].node(), args[1].node())
    {
        return Lowered::scalar(product);
    }
    if let Some(recognised) = recognised(g, Ending::WrittenDifference, args) {
        return recognised;
    }
    let difference = by_parts(g, args, |g, a, b| summed(g, a, b, -1.0));
    if matches!(g.origin(&args[1].parts), Some(Origin::Rotation { matrix, .. }) if *matrix == args[0].parts) {
        g.note_origin(&difference.parts, Origin::Unrotated { matrix: args[0].parts.clone() });
    }
    if let Some(Origin::Stretch { trace, matrix }) = g.origin(&args[0].parts).cloned()
        && is_identity(g, &args[1])
    {
        g.note_origin(&difference.parts, Origin::Strain { trace, matrix });
    }
    difference
}

fn is_identity(g: &Graph, a: &Lowered) -> bool {
    let (rows, columns) = a.dimensions();
    (0..rows).all(|i| (0..columns).all(|j| g.is(a.at(i, j), if i == j { 1.0 } else { 0.0 })))
}

/// Recognises x² − y² as (x − y)(x + y). One of the squares may be a constant with an exact root.
fn recognise_squares(g: &mut Graph, a: NodeId, b: NodeId) -> Option<NodeId> {
    let (x, y) = (root_of_square(g, a)?, root_of_square(g, b)?);
    if g.as_constant(a).is_some() && g.as_constant(b).is_some() {
        return None;
    }
    let (difference, sum) = (g.sub(x, y), g.add(x, y));
    Some(g.mul(difference, sum))
}

fn root_of_square(g: &mut Graph, square: NodeId) -> Option<NodeId> {
    if let Some(value) = g.as_constant(square) {
        let root = value.sqrt();
        return (root > 0.0 && root * root == value && root.fract() == 0.0).then(|| g.constant(root));
    }
    match g.op(square) {
        Op::Mul(x, y) if x == y => Some(x),
        _ => None,
    }
}

fn neg(g: &mut Graph, args: &[Lowered]) -> Lowered {
    Lowered { shape: args[0].shape, parts: args[0].parts.iter().map(|&a| g.neg(a)).collect() }
}

fn mul(g: &mut Graph, args: &[Lowered]) -> Lowered {
    let (a, b) = (&args[0], &args[1]);
    match (a.shape, b.shape) {
        (Shape::Scalar, Shape::Scalar) if let Some(quotient) = over_power(g, a, b).or_else(|| over_power(g, b, a)) => {
            quotient
        }
        (Shape::Scalar, _) => scaled(g, a.node(), b),
        (_, Shape::Scalar) => scaled(g, b.node(), a),
        (Shape::Quat | Shape::DualQuat, _) => super::quaternion::product(g, a, b),
        (Shape::Motion, _) => super::quaternion::motion_after(g, a, b),
        _ => {
            if let Some(stretch) = recognise_stretch(g, a, b) {
                return stretch;
            }
            let ((rows, inner), (_, columns)) = (a.dimensions(), b.dimensions());
            let mut parts = Vec::with_capacity(rows * columns);
            for i in 0..rows {
                for j in 0..columns {
                    let row: Vec<_> = (0..inner).map(|k| a.at(i, k)).collect();
                    let column: Vec<_> = (0..inner).map(|k| b.at(k, j)).collect();
                    parts.push(inner_product(g, &row, &column));
                }
            }
            if is_transpose(a, b) {
                let column = |j: usize| (0..inner).map(|i| b.at(i, j)).collect();
                g.note_origin(&parts, Origin::Gram { columns: (0..columns).map(column).collect() });
            }
            if rows == columns && rows == inner && !b.parts.iter().any(|&part| g.varies(part)) {
                g.note_origin(&parts, Origin::Deformed { moving: a.parts.clone(), constant: b.parts.clone() });
            }
            match b.shape {
                Shape::Vector(_) if rows == 1 => Lowered::scalar(parts[0]),
                Shape::Vector(_) => Lowered::vector(parts),
                _ => Lowered::matrix(rows, columns, parts),
            }
        }
    }
}

/// Returns whether a matrix is the transpose of another one.
fn is_transpose(a: &Lowered, b: &Lowered) -> bool {
    let ((rows, columns), Shape::Matrix(..)) = (a.dimensions(), b.shape) else { return false };
    b.dimensions() == (columns, rows) && (0..rows).all(|i| (0..columns).all(|j| a.at(i, j) == b.at(j, i)))
}

/// Recognises a · x⁻ⁿ, which is a quotient.
fn over_power(g: &mut Graph, a: &Lowered, power: &Lowered) -> Option<Lowered> {
    match g.op(power.node()) {
        Op::Div(one, below) if g.is(one, 1.0) => {
            g.recognised(Ending::WrittenQuotient, a.node(), below).map(Lowered::scalar)
        }
        _ => None,
    }
}

/// Returns factor · a.
pub(super) fn scaled(g: &mut Graph, factor: NodeId, a: &Lowered) -> Lowered {
    let parts = super::quaternion::scaled_exponential(g, factor, &a.parts);
    Lowered { shape: a.shape, parts: parts.unwrap_or_else(|| g.scaled(factor, &a.parts)) }
}

fn div(g: &mut Graph, args: &[Lowered]) -> Lowered {
    if let Some(recognised) = recognised(g, Ending::WrittenQuotient, args) {
        return recognised;
    }
    let divisor = args[1].node();
    Lowered { shape: args[0].shape, parts: args[0].parts.iter().map(|&a| g.div(a, divisor)).collect() }
}

fn pow(g: &mut Graph, args: &[Lowered]) -> Lowered {
    Lowered::scalar(g.pow(args[0].node(), args[1].node()))
}
