//! The singular values σᵢ of a matrix F = Σ σᵢ uᵢ vᵢᵀ, by one-sided Jacobi rotations (Hestenes 1958).
//!
//! Rotations of two columns at a time make all columns of F V orthogonal. Their lengths are the singular values, their
//! directions the uᵢ. Small singular values keep their digits, and any orthogonal vectors do where two are equal.

use super::length::common_scale;
use super::spatial_polar::signed_singular_values;
use super::{Function, Lowered, Shape, Units, polar::deformation};
use crate::graph::{Form, Graph, NodeId, Primitive, Rule, Spectrum};

pub(super) const FUNCTIONS: &[Function] = &[Function {
    name: "singular_values",
    usage: "singular_values(F)",
    docs: "Singular values of a 2×2, 3×2 or 3×3 matrix as a vector, the largest first. For a square matrix, the last \
           one has the sign of det F. Expressions of them alone are differentiated as functions of F: those that are \
           symmetric, such as `s[0]^a + s[1]^a + s[2]^a`, stay smooth where singular values meet. Others have no \
           derivative there and are flagged. So are those at which two sum to 0, or one of a 3×2 matrix is 0, unless \
           the expression is even.",
    shape: |shapes| deformation(shapes).map(Shape::Vector),
    units: Units::First,
    lower: |g, a| singular_values(g, &a[0]),
    accuracy: "",
}];

/// Rounds of rotations before the last one. They converge quadratically; two columns need one.
const ROUNDS: usize = 4;
const ROUNDS_OF_TWO: usize = 1;

fn singular_values(g: &mut Graph, f: &Lowered) -> Lowered {
    if g.form() == Form::Textbook {
        return Lowered::vector(textbook(g, f));
    }
    let (rows, columns) = f.dimensions();
    let at = Decomposition::new(g, f);
    let values: Vec<NodeId> = (0..columns)
        .map(|i| {
            let first = (0..rows * columns).map(|k| vec![at.left[i][k / columns], at.right[i][k % columns]]).collect();
            let rule = Rule {
                second: None,
                ..Rule::factored(singular_value(i), f.parts.clone(), at.values[i], first, vec![])
            };
            g.add_rule(rule, &[])
        })
        .collect();
    let Decomposition { left, right, normal, .. } = at;
    if values.iter().all(|&value| g.rule(value).is_some()) {
        g.note_spectrum(Spectrum { matrix: f.parts.clone(), values: values.clone(), left, right, normal });
    }
    Lowered::vector(values)
}

fn singular_value(i: usize) -> Primitive {
    Primitive::SingularValue(i as u8)
}

/// Returns the closed forms. For two columns a and b, (σ₁ ± σ₂)² = ‖a‖² + ‖b‖² ± 2J, where J is the area, or det F.
fn textbook(g: &mut Graph, f: &Lowered) -> Vec<NodeId> {
    if f.dimensions() == (3, 3) {
        return signed_singular_values(g, &f.parts).to_vec();
    }
    let (rows, two) = (f.dimensions().0, g.constant(2.0));
    let columns = columns(f);
    let square = g.dot(&f.parts, &f.parts);
    let area = if rows == 2 {
        let (plus, minus) = (g.mul(columns[0][0], columns[1][1]), g.mul(columns[0][1], columns[1][0]));
        g.sub(plus, minus)
    } else {
        let normal = g.cross(&columns[0], &columns[1]);
        let square = g.dot(&normal, &normal);
        g.sqrt(square)
    };
    let doubled = g.mul(two, area);
    let (sum, difference) = (g.add(square, doubled), g.sub(square, doubled));
    let (sum, difference) = (g.sqrt(sum), g.sqrt(difference));
    let (larger, smaller) = (g.add(sum, difference), g.sub(sum, difference));
    vec![g.div(larger, two), g.div(smaller, two)]
}

fn columns(f: &Lowered) -> Vec<Vec<NodeId>> {
    let (rows, columns) = f.dimensions();
    (0..columns).map(|j| (0..rows).map(|i| f.at(i, j)).collect()).collect()
}

/// σᵢ, uᵢ and vᵢ.
pub(super) struct Decomposition {
    values: Vec<NodeId>,
    /// The singular values of the matrix times the power of two that scales it.
    pub(super) lengths: Vec<NodeId>,
    pub(super) left: Vec<Vec<NodeId>>,
    pub(super) right: Vec<Vec<NodeId>>,
    /// u₁ × u₂ of a 3×2 matrix.
    normal: Option<Vec<NodeId>>,
}

impl Decomposition {
    pub(super) fn new(g: &mut Graph, f: &Lowered) -> Self {
        let (rows, count) = f.dimensions();
        let scale = common_scale(g, &f.parts);
        let (square, one) = (g.dot(&f.parts, &f.parts), g.constant(1.0));
        let moderate = g.is_moderate(square, 2);
        g.assume(scale, one, moderate);
        let columns = scaled_columns(g, f, scale);
        let rounds = if count == 2 { ROUNDS_OF_TWO } else { ROUNDS };
        let columns = rotated(g, columns, rounds);
        let columns = polished(g, columns, f, scale);
        let columns = rotated(g, columns, 1);
        let columns = sorted(g, columns);
        let images: Vec<&[NodeId]> = columns.iter().map(|column| &column.image[..]).collect();
        let otherwise = axis(g, rows, 0);
        let (first, largest) = direction(g, images[0], &otherwise);
        let mut left = vec![first];
        let mut normal = None;
        let mut lengths = vec![largest];
        if rows == 2 {
            let second = vec![g.neg(left[0][1]), left[0][0]];
            lengths.push(g.dot(&second, images[1]));
            left.push(second);
        } else {
            let across = perpendicular(g, &left[0]);
            let (second, length) = direction(g, images[1], &across);
            lengths.push(length);
            let third = g.cross(&left[0], &second).to_vec();
            left.push(second);
            if count == 3 {
                lengths.push(g.dot(&third, images[2]));
                left.push(third);
            } else {
                normal = Some(third);
            }
        }
        let values = lengths.iter().map(|&length| g.div(length, scale)).collect();
        let right = columns.into_iter().map(|column| column.right).collect();
        Self { values, lengths, left, right, normal }
    }
}

/// A column of F V, and that of V.
#[derive(Clone)]
struct Column {
    image: Vec<NodeId>,
    right: Vec<NodeId>,
}

impl Column {
    fn combine(&self, other: &Self, mut entry: impl FnMut(NodeId, NodeId) -> NodeId) -> Self {
        let mut each = |a: &[NodeId], b: &[NodeId]| a.iter().zip(b).map(|(&a, &b)| entry(a, b)).collect();
        Self { image: each(&self.image, &other.image), right: each(&self.right, &other.right) }
    }
}

fn scaled_columns(g: &mut Graph, f: &Lowered, scale: NodeId) -> Vec<Column> {
    let columns = columns(f);
    let count = columns.len();
    let column =
        |(j, column): (usize, Vec<NodeId>)| Column { image: g.scaled(scale, &column), right: axis(g, count, j) };
    columns.into_iter().enumerate().map(column).collect()
}

/// Returns a column of the unit matrix.
fn axis(g: &mut Graph, size: usize, number: usize) -> Vec<NodeId> {
    (0..size).map(|i| g.constant(if i == number { 1.0 } else { 0.0 })).collect()
}

fn rotated(g: &mut Graph, mut columns: Vec<Column>, rounds: usize) -> Vec<Column> {
    let pairs: &[(usize, usize)] = if columns.len() == 2 { &[(0, 1)] } else { &[(0, 1), (0, 2), (1, 2)] };
    for _ in 0..rounds {
        for &(p, q) in pairs {
            let (a, b) = (columns[p].clone(), columns[q].clone());
            let (cosine, sine) = rotation(g, &a.image, &b.image);
            columns[p] = a.combine(&b, |a, b| {
                let (along, back) = (g.mul(cosine, a), g.mul(sine, b));
                g.sub(along, back)
            });
            columns[q] = a.combine(&b, |a, b| {
                let (turned, along) = (g.mul(sine, a), g.mul(cosine, b));
                g.add(turned, along)
            });
        }
    }
    columns
}

/// Makes V orthogonal again, as V (3 − VᵀV)/2, and computes F V from it with twice the digits. So errors of rotations
/// do not add up, and small singular values are as accurate as large ones.
fn polished(g: &mut Graph, columns: Vec<Column>, f: &Lowered, scale: NodeId) -> Vec<Column> {
    let (half, three) = (g.constant(0.5), g.constant(3.0));
    let (rows, count) = f.dimensions();
    let right: Vec<Vec<NodeId>> = columns.into_iter().map(|column| column.right).collect();
    let matrix = g.scaled(scale, &f.parts);
    let polish = |j: usize| {
        let factors: Vec<NodeId> = (0..count)
            .map(|i| {
                let product = g.dot(&right[i.min(j)], &right[i.max(j)]);
                let difference = if i == j { g.sub(three, product) } else { g.neg(product) };
                g.mul(half, difference)
            })
            .collect();
        let column: Vec<NodeId> = (0..count)
            .map(|k| {
                let row: Vec<NodeId> = right.iter().map(|column| column[k]).collect();
                g.dot(&row, &factors)
            })
            .collect();
        let image = (0..rows).map(|i| compensated_dot(g, &matrix[count * i..count * (i + 1)], &column)).collect();
        Column { image, right: column }
    };
    (0..count).map(polish).collect()
}

/// Returns Σ aᵢ bᵢ with the rounding errors of products and sums added (Ogita, Rump and Oishi 2005).
pub(super) fn compensated_dot(g: &mut Graph, a: &[NodeId], b: &[NodeId]) -> NodeId {
    let (mut sum, mut error) = (g.constant(0.0), g.constant(0.0));
    for (&a, &b) in a.iter().zip(b) {
        let (product, of_product) = (g.mul(a, b), g.product_error(a, b));
        let of_sum = g.sum_error(sum, product);
        sum = g.add(sum, product);
        let both = g.add(of_product, of_sum);
        error = g.add(error, both);
    }
    g.add(sum, error)
}

/// Returns cos φ and sin φ of the rotation after which a and b are orthogonal. With γ = a·b and δ = ‖b‖² − ‖a‖²,
/// tan φ = 2γ/(δ ± √(δ² + 4γ²)), where the sign is that of δ.
fn rotation(g: &mut Graph, a: &[NodeId], b: &[NodeId]) -> (NodeId, NodeId) {
    let [zero, one, two] = [0.0, 1.0, 2.0].map(|number| g.constant(number));
    let (along, from, to) = (g.dot(a, b), g.dot(a, a), g.dot(b, b));
    let (doubled, difference) = (g.mul(two, along), g.sub(to, from));
    let root = g.sum_of_squares(&[difference, doubled]);
    let root = g.plain_sqrt(root);
    let (more, less) = (g.add(difference, root), g.sub(difference, root));
    let falling = g.precedes(difference, zero);
    let divisor = g.select(falling, less, more);
    let orthogonal = g.equal(divisor, zero);
    let tangent = g.div(doubled, divisor);
    let tangent = g.select(orthogonal, zero, tangent);
    let square = g.mul(tangent, tangent);
    let square = g.add(one, square);
    let secant = g.plain_sqrt(square);
    let cosine = g.div(one, secant);
    (cosine, g.mul(cosine, tangent))
}

/// Sorts columns, the longest first. Of two that change places, one changes its sign, so that det V = 1.
fn sorted(g: &mut Graph, mut columns: Vec<Column>) -> Vec<Column> {
    let mut lengths: Vec<NodeId> = columns.iter().map(|column| g.sum_of_squares(&column.image)).collect();
    let pairs: &[(usize, usize)] = if columns.len() == 2 { &[(0, 1)] } else { &[(0, 1), (1, 2), (0, 1)] };
    for &(p, q) in pairs {
        let (a, b, swapped) = (columns[p].clone(), columns[q].clone(), g.precedes(lengths[p], lengths[q]));
        columns[p] = a.combine(&b, |a, b| g.select(swapped, b, a));
        columns[q] = a.combine(&b, |a, b| {
            let opposite = g.neg(a);
            g.select(swapped, opposite, b)
        });
        let (first, second) = (lengths[p], lengths[q]);
        lengths[p] = g.select(swapped, second, first);
        lengths[q] = g.select(swapped, first, second);
    }
    columns
}

/// Returns direction and length of a vector; the other direction where it is 0.
fn direction(g: &mut Graph, vector: &[NodeId], otherwise: &[NodeId]) -> (Vec<NodeId>, NodeId) {
    let zero = g.constant(0.0);
    let square = g.sum_of_squares(vector);
    let length = g.plain_sqrt(square);
    let vanishes = g.equal(length, zero);
    let entry = |(&entry, &other): (&NodeId, &NodeId)| {
        let quotient = g.div(entry, length);
        g.select(vanishes, other, quotient)
    };
    (vector.iter().zip(otherwise).map(entry).collect(), length)
}

/// Returns a unit vector perpendicular to another one.
fn perpendicular(g: &mut Graph, u: &[NodeId]) -> Vec<NodeId> {
    let (zero, half) = (g.constant(0.0), g.constant(0.5));
    let size = g.abs(u[0]);
    let across = g.precedes(size, half);
    // u × e₁ or u × e₂.
    let (minus_y, minus_z) = (g.neg(u[1]), g.neg(u[2]));
    let candidates = [[zero, u[2], minus_y], [minus_z, zero, u[0]]];
    let vector: Vec<NodeId> = (0..3).map(|i| g.select(across, candidates[0][i], candidates[1][i])).collect();
    let otherwise = axis(g, 3, 1);
    direction(g, &vector, &otherwise).0
}
