use energy_dsl::{Lane, Mask};

use super::{MOST, upper_index};

/// How far below zero, relative to the largest diagonal entry, an eigenvalue counts as zero: at rest a membrane's Hessian is
/// singular, and rounding leaves its zeros on either side.
const TOLERANCE: f64 = 64.0 * f64::EPSILON;

/// Where A + τ I has a factorisation L D Lᵀ with D > 0, so that no eigenvalue of A is below −τ. It costs n³/6 multiplications and n
/// divisions, a small part of finding eigenvalues.
#[inline(always)]
pub(crate) fn is_semi_definite<V: Lane<f64>>(upper: &[V], n: usize) -> V::Mask {
    let zero = V::splat(0.0);
    let mut a = [zero; MOST * (MOST + 1) / 2];
    a[..upper.len()].copy_from_slice(upper);
    let mut largest = zero;
    for i in 0..n {
        largest = largest.max(a[upper_index(n, i, i)].abs());
    }
    // So that the zero matrix passes.
    let shift = (largest * V::splat(TOLERANCE)).max(V::splat(f64::MIN_POSITIVE));
    let mut definite = !V::Mask::none();
    for k in 0..n {
        let pivot = a[upper_index(n, k, k)] + shift;
        definite = definite & zero.less(pivot);
        if !definite.any() {
            return definite;
        }
        let inverse = V::splat(1.0) / pivot;
        for i in k + 1..n {
            let factor = a[upper_index(n, k, i)] * inverse;
            for j in i..n {
                let place = upper_index(n, i, j);
                a[place] = a[place] - factor * a[upper_index(n, k, j)];
            }
        }
    }
    definite
}
