//! Eigenvalues by Jacobi's cyclic rotations (Golub and Van Loan, *Matrix Computations*, §8.5), one matrix a lane. A lane whose
//! matrix is diagonal already is turned by zero: its bits do not depend on its neighbours.

use energy_dsl::{Lane, Mask};

use super::{Curvature, Square};

/// Sweeps converge quadratically: six or seven do for 12×12 matrices.
const MOST_SWEEPS: usize = 16;

/// By how much a matrix changes when its eigenvalues do, and in which lanes; leaves it diagonal.
#[inline(always)]
pub(super) fn difference<V: Lane<f64>, const N: usize>(
    a: &mut Square<V, N>,
    curvature: Curvature,
) -> (Square<V, N>, V::Mask) {
    let zero = V::splat(0.0);
    let mut vectors = [[zero; N]; N];
    for i in 0..N {
        vectors[i][i] = V::splat(1.0);
    }
    diagonalise(a, &mut vectors);
    let mut difference = [[zero; N]; N];
    let mut changed = V::Mask::none();
    for k in 0..N {
        let change = curvature.change(a[k][k]);
        let changes = zero.less(change);
        if !changes.any() {
            continue;
        }
        changed = changed | changes;
        for i in 0..N {
            let scaled = change * vectors[i][k];
            for j in i..N {
                difference[i][j] = difference[i][j] + scaled * vectors[j][k];
            }
        }
    }
    for i in 0..N {
        for j in 0..i {
            difference[i][j] = difference[j][i];
        }
    }
    (difference, changed)
}

/// Rotates a symmetric matrix until it is diagonal; the columns of `vectors` are turned along.
#[inline(always)]
fn diagonalise<V: Lane<f64>, const N: usize>(a: &mut Square<V, N>, vectors: &mut Square<V, N>) {
    let (zero, one) = (V::splat(0.0), V::splat(1.0));
    let mut squares = zero;
    for i in 0..N {
        for j in 0..N {
            squares = squares + a[i][j] * a[i][j];
        }
    }
    let negligible = squares * V::splat(f64::EPSILON * f64::EPSILON / 16.0);
    for _ in 0..MOST_SWEEPS {
        let mut turned = V::Mask::none();
        for p in 0..N {
            for q in p + 1..N {
                let off = a[p][q];
                let turn = negligible.less(off * off);
                if !turn.any() {
                    continue;
                }
                turned = turned | turn;
                // tan φ of the smaller angle, sin φ, and tan φ/2.
                let theta = (a[q][q] - a[p][p]) / (off + off);
                let tangent = one / (theta.abs() + (theta * theta + one).sqrt());
                let tangent = V::select(theta.less(zero), -tangent, tangent);
                let tangent = V::select(turn, tangent, zero);
                let cosine = one / (tangent * tangent + one).sqrt();
                let sine = tangent * cosine;
                let half = sine / (cosine + one);
                let shift = V::select(turn, tangent * off, zero);
                a[p][p] = a[p][p] - shift;
                a[q][q] = a[q][q] + shift;
                a[p][q] = V::select(turn, zero, off);
                a[q][p] = a[p][q];
                for k in 0..N {
                    if k != p && k != q {
                        let (g, h) = (a[k][p], a[k][q]);
                        a[k][p] = g - sine * (h + g * half);
                        a[k][q] = h + sine * (g - h * half);
                        a[p][k] = a[k][p];
                        a[q][k] = a[k][q];
                    }
                    let (g, h) = (vectors[k][p], vectors[k][q]);
                    vectors[k][p] = g - sine * (h + g * half);
                    vectors[k][q] = h + sine * (g - h * half);
                }
            }
        }
        if !turned.any() {
            return;
        }
    }
}
