//! The polar decomposition F = R S, without singular values: its derivatives stay finite where these meet.

use super::length::unit;
use super::linear_algebra::cross;
use super::spatial_polar::{Polar, polar};
use super::{Function, Lowered, Shape, Units};
use crate::graph::{Graph, NodeId, Origin};

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "rotation_of",
        usage: "rotation_of(F)",
        docs: "Rotation R of the polar decomposition F = R S, S symmetric. For a square matrix (2×2 or 3×3), det R = \
             1, and the singular values have the sign of det F on the smallest. Where two of them sum to 0, the result \
             is taken as 0 and flagged; for a 3×3 matrix also where the sum is below 400 roundoffs of the largest. \
             Elsewhere, errors are below 50 u κ with κ = σ₁/(σ₂ + σ₃). For a 3×2 matrix, R has orthonormal columns and \
             S ≥ 0; the result is flagged where the columns are parallel. For a 3×3 matrix, `transpose(R) * F` is S, \
             `ddot(R, F)` is tr S, and `ddot(F - R, F - R)` is the squared distance to R.",
        shape: |shapes| deformation(shapes).map(|_| shapes[0]),
        units: Units::Number,
        lower: |g, a| rotation(g, &a[0]),
        accuracy: "",
    },
    Function {
        name: "stretch_of",
        usage: "stretch_of(F)",
        docs: "Symmetric factor S = RᵀF of the polar decomposition, flagged like `rotation_of`. Its eigenvalues are \
             the signed singular values of F: their sum is trace(S), their product det(S), the sum of their squares \
             ddot(S, S).",
        shape: |shapes| deformation(shapes).map(|columns| Shape::Matrix(columns, columns)),
        units: Units::First,
        lower: |g, a| stretch(g, &a[0]),
        accuracy: "",
    },
];

/// Returns the number of columns.
pub(super) fn deformation(shapes: &[Shape]) -> Result<u8, String> {
    match *shapes {
        [Shape::Matrix(2 | 3, 2)] => Ok(2),
        [Shape::Matrix(3, 3)] => Ok(3),
        [other] => Err(format!("takes a 2×2, 3×2 or 3×3 matrix, but this is {other}")),
        _ => Err(format!("takes one matrix, but got {}", super::arguments(shapes.len()))),
    }
}

fn rotation(g: &mut Graph, f: &Lowered) -> Lowered {
    if f.dimensions() == (3, 3) {
        let Polar { rotation, trace } = polar(g, f);
        g.note_origin(&rotation, Origin::Rotation { trace, matrix: f.parts.clone() });
        return Lowered::matrix(3, 3, rotation);
    }
    let columns = orthonormal_columns(g, f);
    let rows = f.dimensions().0;
    let parts = (0..rows).flat_map(|i| columns.iter().map(move |column| column.parts[i])).collect();
    Lowered::matrix(rows, 2, parts)
}

/// Returns the columns of R.
fn orthonormal_columns(g: &mut Graph, f: &Lowered) -> [Lowered; 2] {
    if f.dimensions().0 == 2 { planar_columns(g, f) } else { spatial_columns(g, f) }
}

/// F + cof F = (σ₁ + σ₂) R for 2×2 matrices: its first column is (F₀₀ + F₁₁, F₁₀ − F₀₁).
fn planar_columns(g: &mut Graph, f: &Lowered) -> [Lowered; 2] {
    let (sum, difference) = (g.add(f.at(0, 0), f.at(1, 1)), g.sub(f.at(1, 0), f.at(0, 1)));
    let first = unit(g, &[Lowered::vector([sum, difference])]);
    let (cosine, sine) = (first.parts[0], first.parts[1]);
    let opposite = g.neg(sine);
    [first, Lowered::vector([opposite, cosine])]
}

/// The same in the plane of both columns, with their normal n: cof F has the columns f₂ × n and n × f₁.
fn spatial_columns(g: &mut Graph, f: &Lowered) -> [Lowered; 2] {
    let [first, second] = columns(f);
    let normal = cross(g, &[first.clone(), second.clone()]);
    let normal = unit(g, &[normal]);
    let cofactors = [cross(g, &[second.clone(), normal.clone()]), cross(g, &[normal, first.clone()])];
    [(first, 0), (second, 1)].map(|(column, number)| {
        let pairs = column.parts.iter().zip(&cofactors[number].parts);
        let sum: Vec<NodeId> = pairs.map(|(&a, &b)| g.add(a, b)).collect();
        unit(g, &[Lowered::vector(sum)])
    })
}

fn columns(f: &Lowered) -> [Lowered; 2] {
    [0, 1].map(|j| Lowered::vector((0..f.dimensions().0).map(|i| f.at(i, j)).collect::<Vec<_>>()))
}

fn stretch(g: &mut Graph, f: &Lowered) -> Lowered {
    if f.dimensions() == (3, 3) {
        let polar = polar(g, f);
        return spatial_stretch(g, f, polar);
    }
    let ([a, b], [r, s]) = (columns(f), orthonormal_columns(g, f));
    let (first, mixed, last) = (g.dot(&r.parts, &a.parts), g.dot(&r.parts, &b.parts), g.dot(&s.parts, &b.parts));
    Lowered::matrix(2, 2, vec![first, mixed, mixed, last])
}

/// Returns tr S if R is the rotation of F.
fn trace_of_stretch(g: &Graph, r: &[NodeId], f: &Lowered) -> Option<NodeId> {
    match g.origin(r) {
        Some(Origin::Rotation { trace, matrix }) if *matrix == f.parts => Some(*trace),
        _ => None,
    }
}

/// Recognises the product RᵀF, which is S.
pub(super) fn recognise_stretch(g: &mut Graph, a: &Lowered, f: &Lowered) -> Option<Lowered> {
    if a.dimensions() != (3, 3) || f.dimensions() != (3, 3) {
        return None;
    }
    let rotation: Vec<NodeId> = (0..9).map(|e| a.at(e % 3, e / 3)).collect();
    let trace = trace_of_stretch(g, &rotation, f)?;
    Some(spatial_stretch(g, f, Polar { rotation, trace }))
}

/// Recognises ⟨R, F⟩, which is tr S.
pub(super) fn recognise_stretch_trace(g: &Graph, r: &Lowered, f: &Lowered) -> Option<Lowered> {
    trace_of_stretch(g, &r.parts, f).map(Lowered::scalar)
}

/// Returns S = RᵀF of a 3×3 matrix, as the mean with its transpose.
fn spatial_stretch(g: &mut Graph, f: &Lowered, Polar { rotation, trace }: Polar) -> Lowered {
    let column = |parts: &[NodeId], j: usize| [parts[j], parts[3 + j], parts[6 + j]];
    let entry = |g: &mut Graph, i: usize, j: usize| g.dot(&column(&rotation, i), &column(&f.parts, j));
    let half = g.constant(0.5);
    let mut parts = vec![half; 9];
    for i in 0..3 {
        parts[4 * i] = entry(g, i, i);
        for j in 0..i {
            let (below, above) = (entry(g, i, j), entry(g, j, i));
            let sum = g.add(below, above);
            parts[3 * i + j] = g.mul(half, sum);
            parts[3 * j + i] = parts[3 * i + j];
        }
    }
    g.note_origin(&parts, Origin::Stretch { trace, matrix: f.parts.clone() });
    Lowered::matrix(3, 3, parts)
}
