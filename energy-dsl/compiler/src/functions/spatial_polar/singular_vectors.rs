//! R from the singular value decomposition F = U Σ Vᵀ, as U Vᵀ, for matrices of any condition.
//!
//! Rotations of Jacobi's method leave the errors of a matrix close to F, which the condition number κ amplifies: those
//! of R are about u κ. Near mirror images they would spoil S, too. So R is refined.

use super::matrix::{Matrix, Vector, transposed};
use super::newton::refined;
use super::{Factors, Lowered};
use crate::functions::singular::Decomposition;
use crate::graph::{Graph, NodeId};

/// Steps of refinement. Each one multiplies the errors of R by about u κ.
const STEPS: usize = 4;
/// Larger corrections of R are errors of σ₂ + σ₃, which is nearly 0.
const LARGEST_TURN: f64 = 0.125;
/// Larger ratios of consecutive corrections are rounding.
const LARGEST_RATIO: f64 = 0.25;
/// If σ₂ + σ₃ is less than this part of σ₁, then R is taken as 0: 490 roundoffs, in double and in single
/// precision, where errors of R reach 0.1.
const LEAST_GAP: (f64, f64) = (5.4e-14, 2.9e-5);

/// Computes R, K⁻¹ and T of a matrix. The mask tells where σ₂ + σ₃ is 0 up to rounding: there, R and K⁻¹ are 0.
pub(super) fn factors(g: &mut Graph, arguments: &[NodeId], f: &Matrix) -> (Factors, NodeId) {
    let matrix = Lowered::matrix(3, 3, arguments.to_vec());
    let Decomposition { lengths, left, right, .. } = Decomposition::new(g, &matrix);
    let (zero, one) = (g.constant(0.0), g.constant(1.0));
    let gap = g.add(lengths[1], lengths[2]);
    let least = g.by_precision(LEAST_GAP.0, LEAST_GAP.1);
    let least = g.mul(least, lengths[0]);
    let singular = g.less_or_equal(gap, least);
    let axes: Matrix = std::array::from_fn(|k| std::array::from_fn(|i| right[k][i]));
    let images: Matrix = std::array::from_fn(|k| std::array::from_fn(|i| left[k][i]));
    // The eigenvalues of K⁻¹: 1/(σⱼ + σₖ).
    let compliances: Vector = std::array::from_fn(|k| {
        let sum = g.add(lengths[(k + 1) % 3], lengths[(k + 2) % 3]);
        let reciprocal = g.div(one, sum);
        g.select(singular, zero, reciprocal)
    });
    let inverse = weighted(g, &axes, &compliances);
    let stretch = weighted(g, &axes, &[lengths[0], lengths[1], lengths[2]]);
    let columns = transposed(&axes);
    let mut rotation = transposed(&images).map(|row| columns.map(|column| g.dot(&row, &column)));
    let largest = g.constant(LARGEST_TURN * LARGEST_TURN);
    let mut before: Option<Vector> = None;
    for _ in 0..STEPS {
        rotation = refined(g, &rotation, f, |g, spin| {
            let along: Vector = std::array::from_fn(|k| {
                let component = g.dot(&axes[k], spin);
                g.mul(compliances[k], component)
            });
            let turn = columns.map(|column| g.dot(&column, &along));
            let turn = match before {
                Some(before) => extrapolated(g, &before, &turn),
                None => turn,
            };
            let square = g.dot(&turn, &turn);
            let is_small = g.less(square, largest);
            let turn = turn.map(|component| g.select(is_small, component, zero));
            before = Some(turn);
            turn
        });
    }
    let rotation = rotation.map(|row| row.map(|entry| g.select(singular, zero, entry)));
    let trace = g.sum(lengths);
    (Factors { rotation, stretch, inverse, trace }, singular)
}

/// Returns the limit of the sum of all further turns. They form a geometric series, whose ratio is the relative error
/// of σ₂ + σ₃ (Aitken's extrapolation).
fn extrapolated(g: &mut Graph, before: &Vector, turn: &Vector) -> Vector {
    let [zero, one, largest] = [0.0, 1.0, LARGEST_RATIO].map(|number| g.constant(number));
    let (along, square) = (g.dot(turn, before), g.dot(before, before));
    let ratio = g.div(along, square);
    let size = g.abs(ratio);
    let converges = g.less(size, largest);
    let ratio = g.select(converges, ratio, zero);
    let rest = g.sub(one, ratio);
    turn.map(|component| g.div(component, rest))
}

/// Returns Σ wₖ vₖ vₖᵀ.
fn weighted(g: &mut Graph, vectors: &Matrix, weights: &Vector) -> Matrix {
    let columns = transposed(vectors);
    let scaled = columns.map(|column| std::array::from_fn::<_, 3, _>(|k| g.mul(column[k], weights[k])));
    let mut result = columns;
    for i in 0..3 {
        for j in 0..=i {
            result[i][j] = g.dot(&scaled[i], &columns[j]);
            result[j][i] = result[i][j];
        }
    }
    result
}
