//! How inputs move along the increments of unknowns: numbers and points by addition, a rotation q to exp(δ) q.

use energy_dsl::{Declaration, Field, FieldKind, Number};

/// One unknown of a declaration.
pub(crate) struct Unknown<'a> {
    /// Field of the declaration.
    pub(crate) field: &'a Field,
    /// Index of its first number.
    pub(crate) number: usize,
    /// Index of its first increment.
    pub(crate) increment: usize,
}

/// Lists the unknowns of a declaration.
pub(crate) fn unknowns(declaration: &Declaration) -> impl Iterator<Item = Unknown<'_>> {
    let (mut number, mut increment) = (0, 0);
    declaration.points.iter().map(move |field| {
        let unknown = Unknown { field, number, increment };
        number += field.size;
        increment += field.increments();
        unknown
    })
}

/// Lists the rotations of a declaration.
pub(crate) fn rotations(declaration: &Declaration) -> impl Iterator<Item = Unknown<'_>> {
    unknowns(declaration).filter(|unknown| unknown.field.kind == FieldKind::Rotation)
}

/// Moves positions along one increment. Returns the exact size of the step.
pub(crate) fn step(declaration: &Declaration, positions: &mut [f64], increment: usize, size: f64) -> f64 {
    let Some(unknown) = unknowns(declaration).filter(|unknown| unknown.increment <= increment).last() else {
        return size;
    };
    let axis = increment - unknown.increment;
    if unknown.field.kind != FieldKind::Rotation {
        let place = &mut positions[unknown.number + axis];
        let before = *place;
        *place += size;
        return *place - before;
    }
    let (sine, cosine) = (size / 2.0).sin_cos();
    let mut turn = [cosine, 0.0, 0.0, 0.0];
    turn[1 + axis] = sine;
    let q: [f64; 4] = std::array::from_fn(|part| positions[unknown.number + part]);
    positions[unknown.number..unknown.number + 4].copy_from_slice(&product(turn, q));
    size
}

/// Returns the quaternion product a b.
pub(crate) fn product<T: Number>(a: [T; 4], b: [T; 4]) -> [T; 4] {
    let term = |i: usize, j: usize| a[i].clone() * b[j].clone();
    [
        term(0, 0) - term(1, 1) - term(2, 2) - term(3, 3),
        term(0, 1) + term(1, 0) + term(2, 3) - term(3, 2),
        term(0, 2) + term(2, 0) + term(3, 1) - term(1, 3),
        term(0, 3) + term(3, 0) + term(1, 2) - term(2, 1),
    ]
}

/// Scales the rotations among the unknowns to unit length.
pub(crate) fn normalise(declaration: &Declaration, positions: &mut [f64]) {
    normalise_fields(&declaration.points, positions);
}

/// Scales rotations, and those of motions, to unit length.
pub(crate) fn normalise_fields(fields: &[Field], mut numbers: &mut [f64]) {
    for field in fields {
        let (own, others) = numbers.split_at_mut(field.size.min(numbers.len()));
        numbers = others;
        if !matches!(field.kind, FieldKind::Rotation | FieldKind::Motion) {
            continue;
        }
        for entry in own.chunks_exact_mut(field.entry_size()) {
            let q = &mut entry[field.entry_size() - 4..];
            let length = q.iter().map(|part| part * part).sum::<f64>().sqrt();
            if length > 0.0 {
                q.iter_mut().for_each(|part| *part /= length);
            }
        }
    }
}

/// Removes the parts of offsets that would change the length of rotations.
pub(crate) fn along(declaration: &Declaration, positions: &[f64], offsets: &mut [f64]) {
    for rotation in rotations(declaration) {
        let range = rotation.number..rotation.number + 4;
        let (q, offset) = (&positions[range.clone()], &mut offsets[range]);
        let square = q.iter().map(|part| part * part).sum::<f64>();
        let outward = q.iter().zip(&*offset).map(|(q, d)| q * d).sum::<f64>() / square.max(f64::MIN_POSITIVE);
        offset.iter_mut().zip(q).for_each(|(d, q)| *d -= outward * q);
    }
}

/// Replaces derivatives along exp(δ), row by row, by their symmetric part: those of a gradient differ from the Hessian by
/// half of the torque's cross-product matrix.
pub(crate) fn symmetrise(declaration: &Declaration, matrix: &mut [f64]) {
    let n = declaration.increments();
    for rotation in rotations(declaration) {
        for (row, column) in [(0, 1), (0, 2), (1, 2)] {
            let (i, j) = (rotation.increment + row, rotation.increment + column);
            let mean = (matrix[i * n + j] + matrix[j * n + i]) / 2.0;
            (matrix[i * n + j], matrix[j * n + i]) = (mean, mean);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::product;

    #[test]
    fn quaternions_multiply_as_hamilton_says() {
        let unit = |part: usize| std::array::from_fn(|i| f64::from(u8::from(i == part)));
        let [i, j, k]: [[f64; 4]; 3] = [unit(1), unit(2), unit(3)];
        assert_eq!(product(i, j), k);
        assert_eq!(product(j, k), i);
        assert_eq!(product(product(i, j), k), [-1.0, 0.0, 0.0, 0.0]);
    }
}
