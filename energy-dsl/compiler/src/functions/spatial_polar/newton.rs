//! Newton's method for the rotation R of F = R S.

use super::matrix::{Inverse, Matrix, Vector, inverted, product, symmetric, transposed};
use crate::functions::singular::compensated_dot;
use crate::graph::Graph;

/// Returns R after a step of Newton's method. It turns R by K⁻¹ a with \[a\]ₓ = RᵀF − FᵀR, and makes it orthogonal
/// again.
pub(super) fn polished(g: &mut Graph, r: &Matrix, f: &Matrix) -> Matrix {
    let stretch = product(g, &transposed(r), f);
    let spin = [(2, 1), (0, 2), (1, 0)].map(|(i, j)| g.sub(stretch[i][j], stretch[j][i]));
    let mean = symmetric(g, &stretch);
    let compliance = compliance(g, &mean);
    let zero = g.constant(0.0);
    let singular = g.equal(compliance.determinant, zero);
    let turn: Vector = std::array::from_fn(|i| {
        let numerator = g.dot(&compliance.adjugate[i], &spin);
        let quotient = g.div(numerator, compliance.determinant);
        g.select(singular, zero, quotient)
    });
    // Row by row, R [ω]ₓ is r × ω.
    let turned = r.map(|row| {
        let change = g.cross(&row, &turn);
        std::array::from_fn(|j| g.add(row[j], change[j]))
    });
    // R (3 − RᵀR)/2.
    let gram = product(g, &transposed(&turned), &turned);
    let cubic = product(g, &turned, &gram);
    let (half, three_halves) = (g.constant(0.5), g.constant(1.5));
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let (more, less) = (g.mul(three_halves, turned[i][j]), g.mul(half, cubic[i][j]));
            g.sub(more, less)
        })
    })
}

/// Returns K⁻¹ of K = (tr S) I − S.
pub(super) fn compliance(g: &mut Graph, stretch: &Matrix) -> Inverse {
    let others = |g: &mut Graph, i: usize| g.add(stretch[(i + 1) % 3][(i + 1) % 3], stretch[(i + 2) % 3][(i + 2) % 3]);
    let stiffness = std::array::from_fn(|i| {
        std::array::from_fn(|j| if i == j { others(g, i) } else { g.neg(stretch[i.min(j)][i.max(j)]) })
    });
    inverted(g, &stiffness)
}

/// Returns R after a step of Newton's method, whose errors are nearly those of rounding R. `turn` returns K⁻¹ a. With
/// the error H = (RᵀR − I)/2 of orthogonality, the step is R (I − H + [K⁻¹ a]ₓ) with \[a\]ₓ = M − Mᵀ − (H M − M H) and
/// M = RᵀF. H and M − Mᵀ, which cancel, are computed with twice the digits.
pub(super) fn refined(
    g: &mut Graph,
    r: &Matrix,
    f: &Matrix,
    turn: impl FnOnce(&mut Graph, &Vector) -> Vector,
) -> Matrix {
    let (columns, half, minus_one, one) = (transposed(r), g.constant(0.5), g.constant(-1.0), g.constant(1.0));
    let of_f = transposed(f);
    let negative = columns.map(|column| column.map(|entry| g.neg(entry)));
    let skew = [(2, 1), (0, 2), (1, 0)]
        .map(|(i, j)| compensated_dot(g, &[columns[i], negative[j]].concat(), &[of_f[j], of_f[i]].concat()));
    let error: Matrix = {
        let mut error = [[half; 3]; 3];
        for i in 0..3 {
            for j in 0..=i {
                let (mut a, mut b) = (columns[i].to_vec(), columns[j].to_vec());
                if i == j {
                    a.insert(0, minus_one);
                    b.insert(0, one);
                }
                let sum = compensated_dot(g, &a, &b);
                error[i][j] = g.mul(half, sum);
                error[j][i] = error[i][j];
            }
        }
        error
    };
    let stretch = product(g, &columns, f);
    let stretch = symmetric(g, &stretch);
    let spoilt = product(g, &error, &stretch);
    let places = [(2, 1), (0, 2), (1, 0)];
    let spin: Vector = std::array::from_fn(|k| {
        let (i, j) = places[k];
        let minus = g.sub(spoilt[i][j], spoilt[j][i]);
        g.sub(skew[k], minus)
    });
    let turn = turn(g, &spin);
    r.map(|row| {
        let change = g.cross(&row, &turn);
        std::array::from_fn(|j| {
            let along = g.dot(&row, &error[j]);
            let change = g.sub(change[j], along);
            g.add(row[j], change)
        })
    })
}
