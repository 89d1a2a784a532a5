//! Products, transposes and inverses of vectors and matrices, and their construction.

use super::angle::recognise_cosine;
use super::arithmetic::scaled;
use super::inner_product::inner_product;
use super::inverse;
use super::polar::recognise_stretch_trace;
use super::quaternion::inverse_motion;
use super::rotated::recognise_rotated_product;
use super::spatial_polar::distance_to_rotation;
use super::{Function, Lowered, Shape, Units};
use crate::graph::{Form, Graph, NodeId, Origin};

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "dot",
        usage: "dot(a, b) or a·b",
        docs: "Inner product of two vectors or quaternions; the product of two scalars. `dot(unit(a), unit(b))` is a \
             robust primitive, the cosine between a and b. In `dot(rotate(q, n), transform(q, p) - x)`, p is not \
             rotated, because a rotation preserves n·p.",
        shape: dot_shape,
        units: Units::Scaled,
        lower: dot,
        accuracy: "",
    },
    Function {
        name: "cross",
        usage: "cross(a, b) or a × b",
        docs: "Cross product of two 3-vectors; the product of two scalars.",
        shape: cross_shape,
        units: Units::Scaled,
        lower: cross,
        accuracy: "",
    },
    Function {
        name: "outer",
        usage: "outer(a, b)",
        docs: "Outer product a bᵀ of two vectors.",
        shape: outer_shape,
        units: Units::Scaled,
        lower: outer,
        accuracy: "",
    },
    Function {
        name: "ddot",
        usage: "ddot(A, B)",
        docs: "Inner product of two matrices, Σᵢⱼ Aᵢⱼ Bᵢⱼ = tr AᵀB.",
        shape: ddot_shape,
        units: Units::Scaled,
        lower: dot,
        accuracy: "",
    },
    Function {
        name: "transpose",
        usage: "transpose(A) or Aᵀ",
        docs: "Transpose of a matrix. A vector becomes a row.",
        shape: transpose_shape,
        units: Units::First,
        lower: transpose,
        accuracy: "",
    },
    Function {
        name: "trace",
        usage: "trace(A)",
        docs: "Sum of the diagonal of a square matrix.",
        shape: square_to_scalar,
        units: Units::First,
        lower: trace,
        accuracy: "",
    },
    Function {
        name: "det",
        usage: "det(A)",
        docs: "Determinant of a 2×2, 3×3 or 4×4 matrix. That of `transpose(F) * F` is computed from F without \
               cancellation, as ‖a × b‖² or det(F)².",
        shape: square_to_scalar,
        units: Units::PowerOfSize(0),
        lower: det,
        accuracy: "",
    },
    Function {
        name: "inverse",
        usage: "inverse(A)",
        docs: "Inverse of a 2×2, 3×3 or 4×4 matrix, or of a motion.",
        shape: |shapes| if shapes == [Shape::Motion] { Ok(Shape::Motion) } else { square_to_square(shapes) },
        units: Units::Power(-1.0),
        lower: |g, a| match a[0].shape {
            Shape::Motion => inverse_motion(g, &a[0]),
            _ => inverse(g, a),
        },
        accuracy: "",
    },
    Function {
        name: "adjugate",
        usage: "adjugate(A)",
        docs: "det(A) A⁻¹ of a 2×2, 3×3 or 4×4 matrix, without division. It is exact for integers.",
        shape: square_to_square,
        units: Units::PowerOfSize(-1),
        lower: adjugate,
        accuracy: "",
    },
    Function {
        name: "scaled_det",
        usage: "scaled_det(A)",
        docs: "det(A) times the power of two s = power_of_two(det(A)), so 1 or more and below 2, without unit.",
        shape: square_to_scalar,
        units: Units::Number,
        lower: |g, a| {
            let determinant = det(g, a).node();
            let scale = g.power_of_two_scale(determinant);
            Lowered::scalar(g.mul(determinant, scale))
        },
        accuracy: "",
    },
    Function {
        name: "scaled_adjugate",
        usage: "scaled_adjugate(A)",
        docs: "adjugate(A) times power_of_two(det(A)): A⁻¹ times scaled_det(A), without division. It brings rest \
             shapes of any size near 1, and is exact for integers.",
        shape: square_to_square,
        units: Units::Power(-1.0),
        lower: |g, a| {
            let determinant = det(g, a).node();
            let scale = g.power_of_two_scale(determinant);
            let matrix = adjugate(g, a);
            scaled(g, scale, &matrix)
        },
        accuracy: "",
    },
    Function {
        name: "identity",
        usage: "identity(2) or identity(3)",
        docs: "Identity matrix.",
        shape: identity_shape,
        units: Units::Number,
        lower: identity,
        accuracy: "0",
    },
    Function {
        name: "columns",
        usage: "columns(a, b, …)",
        docs: "The matrix with the given columns.",
        shape: columns_shape,
        units: Units::Same,
        lower: columns,
        accuracy: "0",
    },
    Function {
        name: "[]",
        usage: "v[i], v.x, q.w, M[i][j]",
        docs: "A component of a vector, a row of a matrix or an entry of an array, counted from 0.",
        shape: component_shape,
        units: Units::Component,
        lower: component,
        accuracy: "0",
    },
    Function {
        name: "vector",
        usage: "vector(x, y, …)",
        docs: "The vector with the given components.",
        shape: vector_shape,
        units: Units::Same,
        lower: vector,
        accuracy: "0",
    },
];

fn dot_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Vector(a), Shape::Vector(b)] if a == b => Ok(Shape::Scalar),
        [Shape::Quat, Shape::Quat] | [Shape::Scalar, Shape::Scalar] => Ok(Shape::Scalar),
        [Shape::Scalar, other] | [other, Shape::Scalar] => Ok(other),
        [a, b] => Err(format!("takes two vectors of the same length, but these are {a} and {b}")),
        _ => Err(format!("takes two vectors, but got {}", super::arguments(shapes.len()))),
    }
}

fn cross_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Vector(3), Shape::Vector(3)] => Ok(Shape::Vector(3)),
        [Shape::Scalar, Shape::Scalar] => Ok(Shape::Scalar),
        [Shape::Scalar, other] | [other, Shape::Scalar] => Ok(other),
        [a, b] => Err(format!("takes two 3-vectors, but these are {a} and {b}")),
        _ => Err(format!("takes two 3-vectors, but got {}", super::arguments(shapes.len()))),
    }
}

fn outer_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Vector(a), Shape::Vector(b)] => Ok(Shape::Matrix(a, b)),
        [a, b] => Err(format!("takes two vectors, but these are {a} and {b}")),
        _ => Err(format!("takes two vectors, but got {}", super::arguments(shapes.len()))),
    }
}

fn ddot_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [a @ Shape::Matrix(..), b] if a == b => Ok(Shape::Scalar),
        [a, b] => Err(format!("takes two matrices of the same shape, but these are {a} and {b}")),
        _ => Err(format!("takes two matrices, but got {}", super::arguments(shapes.len()))),
    }
}

fn transpose_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Matrix(r, c)] => Ok(Shape::Matrix(c, r)),
        [Shape::Vector(n)] => Ok(Shape::Matrix(1, n)),
        [other] => Err(format!("takes a matrix or a vector, but this is {other}")),
        _ => Err(format!("takes one matrix, but got {}", super::arguments(shapes.len()))),
    }
}

fn square_to_square(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Matrix(r @ 2..=4, c)] if r == c => Ok(shapes[0]),
        [other] => Err(format!("takes a 2×2, 3×3 or 4×4 matrix, but this is {other}")),
        _ => Err(format!("takes one matrix, but got {}", super::arguments(shapes.len()))),
    }
}

fn square_to_scalar(shapes: &[Shape]) -> Result<Shape, String> {
    square_to_square(shapes).map(|_| Shape::Scalar)
}

/// The checker has expanded `identity(n)` to n numbers; the shape follows from their count.
fn identity_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match shapes.len() {
        n @ 2..=4 => Ok(Shape::Matrix(n as u8, n as u8)),
        _ => Err("takes the number 2, 3 or 4".into()),
    }
}

fn columns_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Vector(n), ref rest @ ..]
            if rest.iter().all(|s| *s == Shape::Vector(n)) && (1..=3).contains(&rest.len()) =>
        {
            Ok(Shape::Matrix(n, rest.len() as u8 + 1))
        }
        _ => Err("takes two to four vectors of the same length".into()),
    }
}

fn vector_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match shapes.len() {
        n @ 2..=4 if shapes.iter().all(|s| *s == Shape::Scalar) => Ok(Shape::Vector(n as u8)),
        _ => Err("takes two to four scalars".into()),
    }
}

/// The checker ensures that the second argument is a constant in range.
fn component_shape(shapes: &[Shape]) -> Result<Shape, String> {
    match *shapes {
        [Shape::Vector(_) | Shape::Quat | Shape::DualQuat | Shape::Twist, Shape::Scalar] => Ok(Shape::Scalar),
        [Shape::Matrix(_, 1), Shape::Scalar] => Ok(Shape::Scalar),
        [Shape::Matrix(_, columns), Shape::Scalar] => Ok(Shape::Vector(columns)),
        _ => Err("is written v[0] or v.x".into()),
    }
}

fn dot(g: &mut Graph, a: &[Lowered]) -> Lowered {
    let (x, y) = (&a[0], &a[1]);
    match (x.shape, y.shape) {
        (Shape::Scalar, _) => scaled(g, x.node(), y),
        (_, Shape::Scalar) => scaled(g, y.node(), x),
        _ => {
            if x.parts == y.parts
                && let Some(Origin::Unrotated { matrix } | Origin::Strain { matrix, .. }) = g.origin(&x.parts).cloned()
            {
                return Lowered::scalar(distance_to_rotation(g, &matrix));
            }
            if let Some(trace) = recognise_stretch_trace(g, x, y).or_else(|| recognise_stretch_trace(g, y, x)) {
                return trace;
            }
            let recognised = recognise_cosine(g, &x.parts, &y.parts);
            let recognised = recognised.or_else(|| recognise_rotated_product(g, &x.parts, &y.parts));
            Lowered::scalar(recognised.unwrap_or_else(|| inner_product(g, &x.parts, &y.parts)))
        }
    }
}

pub(super) fn cross(g: &mut Graph, a: &[Lowered]) -> Lowered {
    let (x, y) = (&a[0], &a[1]);
    match (x.shape, y.shape) {
        (Shape::Scalar, _) => scaled(g, x.node(), y),
        (_, Shape::Scalar) => scaled(g, y.node(), x),
        // For needle triangles, each component is rounded about once.
        _ if g.form() == Form::Robust => {
            let components = super::angle::accurate_cross(g, &x.parts, &y.parts);
            g.note_origin(&components, Origin::Cross([x.parts.clone(), y.parts.clone()]));
            Lowered::vector(components)
        }
        _ => Lowered::vector(g.cross(&x.parts, &y.parts)),
    }
}

fn outer(g: &mut Graph, a: &[Lowered]) -> Lowered {
    let mut parts = Vec::new();
    for &x in &a[0].parts {
        parts.extend(g.scaled(x, &a[1].parts));
    }
    Lowered::matrix(a[0].parts.len(), a[1].parts.len(), parts)
}

fn transpose(_: &mut Graph, a: &[Lowered]) -> Lowered {
    let (rows, columns) = a[0].dimensions();
    let parts = (0..columns).flat_map(|j| (0..rows).map(move |i| (i, j))).map(|(i, j)| a[0].at(i, j)).collect();
    Lowered::matrix(columns, rows, parts)
}

fn trace(g: &mut Graph, a: &[Lowered]) -> Lowered {
    match g.origin(&a[0].parts) {
        Some(&Origin::Stretch { trace, .. }) => return Lowered::scalar(trace),
        Some(&Origin::Strain { trace, .. }) => {
            let three = g.constant(3.0);
            return Lowered::scalar(g.sub(trace, three));
        }
        _ => {}
    }
    let n = a[0].dimensions().0;
    let diagonal: Vec<_> = (0..n).map(|i| a[0].at(i, i)).collect();
    Lowered::scalar(g.sum(diagonal))
}

fn minor(g: &mut Graph, m: &Lowered, (i, j): (usize, usize), (k, l): (usize, usize)) -> NodeId {
    let (plus, minus) = (g.mul(m.at(i, k), m.at(j, l)), g.mul(m.at(i, l), m.at(j, k)));
    g.sub(plus, minus)
}

/// Returns the cofactors of a 2×2, 3×3 or 4×4 matrix, row by row.
fn cofactors(g: &mut Graph, m: &Lowered) -> Vec<NodeId> {
    match m.dimensions().0 {
        2 => {
            let (b, c) = (g.neg(m.at(0, 1)), g.neg(m.at(1, 0)));
            return vec![m.at(1, 1), c, b, m.at(0, 0)];
        }
        4 => return cofactors_by_pairs(g, m),
        _ => {}
    }
    let others = |i: usize| ((i + 1) % 3, (i + 2) % 3);
    (0..9).map(|e| minor(g, m, others(e / 3), others(e % 3))).collect()
}

/// The pairs of the numbers 0 to 3.
const PAIRS: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];

/// Returns the cofactors of a 4×4 matrix from the twelve 2×2 minors of its upper and lower rows (Laplace).
fn cofactors_by_pairs(g: &mut Graph, m: &Lowered) -> Vec<NodeId> {
    let minors = [(0, 1), (2, 3)].map(|rows| PAIRS.map(|columns| minor(g, m, rows, columns)));
    let mut cofactors = Vec::with_capacity(16);
    for row in 0..4 {
        // Expands the minor without this row along the other row of the same half.
        let (partner, opposite) = (row ^ 1, &minors[1 - row / 2]);
        for column in 0..4 {
            let [a, b, c] = [0, 1, 2, 3].into_iter().filter(|&k| k != column).collect::<Vec<_>>()[..] else {
                unreachable!("compiler bug: three of four columns")
            };
            let pair = |i: usize, j: usize| {
                let place = PAIRS.iter().position(|&pair| pair == (i, j));
                opposite[place.expect("compiler bug: a pair of columns")]
            };
            let (first, second, third) = (
                g.mul(m.at(partner, a), pair(b, c)),
                g.mul(m.at(partner, b), pair(a, c)),
                g.mul(m.at(partner, c), pair(a, b)),
            );
            let outer = g.add(first, third);
            let minor = g.sub(outer, second);
            cofactors.push(if (row + column) % 2 == 0 { minor } else { g.neg(minor) });
        }
    }
    cofactors
}

fn det(g: &mut Graph, a: &[Lowered]) -> Lowered {
    let matrix = match g.origin(&a[0].parts) {
        Some(Origin::Stretch { matrix, .. }) => Lowered { parts: matrix.clone(), ..a[0].clone() },
        _ => a[0].clone(),
    };
    let cofactors = cofactors(g, &matrix);
    Lowered::scalar(determinant(g, &matrix, &cofactors))
}

fn determinant(g: &mut Graph, a: &Lowered, cofactors: &[NodeId]) -> NodeId {
    if let Some(Origin::Gram { columns }) = g.origin(&a.parts).cloned()
        && let Some(determinant) = gram_determinant(g, &columns)
    {
        return determinant;
    }
    let n = a.dimensions().0;
    let value = g.dot(&a.parts[..n], &cofactors[..n]);
    g.note_determinant(value);
    value
}

/// Returns det(FᵀF) without cancellation, ‖a × b‖² or (det F)², for a matrix F with these columns.
fn gram_determinant(g: &mut Graph, columns: &[Vec<NodeId>]) -> Option<NodeId> {
    let vectors: Vec<Lowered> = columns.iter().map(|column| Lowered::vector(column.clone())).collect();
    match (columns.len(), columns[0].len()) {
        (2, 3) => {
            let normal = cross(g, &vectors);
            Some(g.dot(&normal.parts, &normal.parts))
        }
        (n, rows) if n == rows => {
            let matrix = self::columns(g, &vectors);
            let determinant = det(g, &[matrix]).node();
            Some(g.mul(determinant, determinant))
        }
        _ => None,
    }
}

fn inverse(g: &mut Graph, a: &[Lowered]) -> Lowered {
    let n = a[0].dimensions().0;
    let cofactors = cofactors(g, &a[0]);
    let determinant = determinant(g, &a[0], &cofactors);
    let cofactor = |e: usize| cofactors[(e % n) * n + e / n];
    let entries = if inverse::has_primitives(g, &a[0].parts) {
        let one = g.constant(1.0);
        let reciprocal = g.div(one, determinant);
        let entries = (0..n * n).map(|e| g.mul(cofactor(e), reciprocal)).collect();
        inverse::primitives(g, &a[0].parts, entries)
    } else {
        (0..n * n).map(|e| g.div(cofactor(e), determinant)).collect()
    };
    Lowered::matrix(n, n, entries)
}

fn adjugate(g: &mut Graph, a: &[Lowered]) -> Lowered {
    let n = a[0].dimensions().0;
    let cofactors = cofactors(g, &a[0]);
    Lowered::matrix(n, n, (0..n * n).map(|e| cofactors[(e % n) * n + e / n]).collect())
}

fn identity(g: &mut Graph, a: &[Lowered]) -> Lowered {
    let n = a.len();
    let parts = (0..n * n).map(|e| g.constant(f64::from(u8::from(e / n == e % n)))).collect();
    Lowered::matrix(n, n, parts)
}

fn columns(_: &mut Graph, a: &[Lowered]) -> Lowered {
    let rows = a[0].parts.len();
    let parts = (0..rows).flat_map(|i| a.iter().map(move |column| column.parts[i])).collect();
    Lowered::matrix(rows, a.len(), parts)
}

fn vector(_: &mut Graph, a: &[Lowered]) -> Lowered {
    Lowered::vector(a.iter().map(Lowered::node).collect::<Vec<_>>())
}

fn component(g: &mut Graph, a: &[Lowered]) -> Lowered {
    let number = g.as_constant(a[1].node()).expect("compiler bug: indices are constants");
    let number = number as usize;
    match a[0].shape {
        Shape::Matrix(_, columns @ 2..) => {
            let columns = usize::from(columns);
            Lowered::vector(&a[0].parts[number * columns..][..columns])
        }
        _ => Lowered::scalar(a[0].parts[number]),
    }
}
