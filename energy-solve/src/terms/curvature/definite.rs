use energy_dsl::{Lane, Mask};

use super::upper_index;

/// Relative tolerance: an eigenvalue above −τ, with τ this fraction of the largest diagonal entry, counts as
/// non-negative. A membrane at rest has a singular Hessian, and rounding moves its zero eigenvalues to either side.
pub(super) const TOLERANCE: f64 = 64.0 * f64::EPSILON;

/// Returns a mask of the lanes where A + τ I has a factorisation L D Lᵀ with D > 0, so that no eigenvalue of A is below
/// −τ. This takes n³/6 multiplications and n divisions, far less than computing eigenvalues.
#[inline(always)]
pub(crate) fn is_semi_definite<V: Lane<f64>>(upper: &[V], n: usize) -> V::Mask {
    match n {
        3 => has_factors::<V>(&mut [V::splat(0.0); 6], upper, 3),
        4 => has_factors::<V>(&mut [V::splat(0.0); 10], upper, 4),
        6 => has_factors::<V>(&mut [V::splat(0.0); 21], upper, 6),
        9 => has_factors::<V>(&mut [V::splat(0.0); 45], upper, 9),
        12 => has_factors::<V>(&mut [V::splat(0.0); 78], upper, 12),
        _ => has_factors::<V>(&mut vec![V::splat(0.0); upper.len()], upper, n),
    }
}

/// Factorises the n×n matrix with the upper triangle `upper` in `a`.
#[inline(always)]
fn has_factors<V: Lane<f64>>(a: &mut [V], upper: &[V], n: usize) -> V::Mask {
    let zero = V::splat(0.0);
    a.copy_from_slice(&upper[..n * (n + 1) / 2]);
    let at = |i: usize, j: usize| upper_index(n, i, j);
    let mut largest = zero;
    for i in 0..n {
        largest = largest.max(a[at(i, i)].abs());
    }
    // The lower bound lets the zero matrix pass.
    let shift = (largest * V::splat(TOLERANCE)).max(V::splat(f64::MIN_POSITIVE));
    let mut definite = !V::Mask::none();
    for k in 0..n {
        let pivot = a[at(k, k)] + shift;
        definite = definite & zero.less(pivot);
        if !definite.any() {
            return definite;
        }
        let inverse = V::splat(1.0) / pivot;
        for i in k + 1..n {
            let factor = a[at(k, i)] * inverse;
            for j in i..n {
                a[at(i, j)] = a[at(i, j)] - factor * a[at(k, j)];
            }
        }
    }
    definite
}
