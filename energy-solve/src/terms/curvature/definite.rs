use energy_dsl::{Lane, Mask};

use super::{MOST, upper_index};

/// Relative tolerance: an eigenvalue above −τ, with τ this fraction of the largest diagonal entry, counts as
/// non-negative. A membrane at rest has a singular Hessian, and rounding moves its zero eigenvalues to either side.
pub(super) const TOLERANCE: f64 = 64.0 * f64::EPSILON;

/// Returns a mask of the lanes where A + τ I has a factorisation L D Lᵀ with D > 0, so that no eigenvalue of A is below
/// −τ. This takes n³/6 multiplications and n divisions, far less than computing eigenvalues.
#[inline(always)]
pub(crate) fn is_semi_definite<V: Lane<f64>>(upper: &[V], n: usize) -> V::Mask {
    match n {
        3 => is_definite_enough::<V, 3>(upper),
        4 => is_definite_enough::<V, 4>(upper),
        6 => is_definite_enough::<V, 6>(upper),
        9 => is_definite_enough::<V, 9>(upper),
        _ => is_definite_enough::<V, MOST>(upper),
    }
}

#[inline(always)]
fn is_definite_enough<V: Lane<f64>, const N: usize>(upper: &[V]) -> V::Mask {
    let zero = V::splat(0.0);
    let mut a = [[zero; N]; N];
    let mut largest = zero;
    for i in 0..N {
        for j in i..N {
            a[i][j] = upper[upper_index(N, i, j)];
        }
        largest = largest.max(a[i][i].abs());
    }
    // The lower bound lets the zero matrix pass.
    let shift = (largest * V::splat(TOLERANCE)).max(V::splat(f64::MIN_POSITIVE));
    let mut definite = !V::Mask::none();
    for k in 0..N {
        let pivot = a[k][k] + shift;
        definite = definite & zero.less(pivot);
        if !definite.any() {
            return definite;
        }
        let inverse = V::splat(1.0) / pivot;
        for i in k + 1..N {
            let factor = a[k][i] * inverse;
            for j in i..N {
                a[i][j] = a[i][j] - factor * a[k][j];
            }
        }
    }
    definite
}
