//! Eigenvalues by cyclic Jacobi rotations (Golub and Van Loan, *Matrix Computations*, §8.5), one matrix per lane.
//!
//! A lane whose matrix is already diagonal is rotated by zero, so that its bits do not depend on other lanes.

use energy_dsl::{Lane, Level, Mask};

use super::{Curvature, Square};

/// Upper limit of the number of sweeps. Convergence is quadratic: 12×12 matrices take six or seven.
const MOST_SWEEPS: usize = 16;

/// Rotations whose angles are computed together.
const TOGETHER: usize = 6;

/// Returns the change of the matrix that changes its eigenvalues, and a mask of the changed lanes. `a` becomes
/// diagonal.
#[inline(always)]
pub(super) fn difference<L: Level, V: Lane<f64>, A: Square<V>>(a: &mut A, curvature: Curvature) -> (A, V::Mask) {
    let (n, zero) = (a.size(), V::splat(0.0));
    let mut vectors = a.zeros();
    for i in 0..n {
        vectors.set(i, i, V::splat(1.0));
    }
    diagonalise::<L, V, A>(a, &mut vectors);
    let mut difference = a.zeros();
    let mut changed = V::Mask::none();
    for k in 0..n {
        let change = curvature.change(a.at(k, k));
        let changes = zero.less(change);
        if !changes.any() {
            continue;
        }
        changed = changed | changes;
        for i in 0..n {
            let scaled = change * vectors.at(k, i);
            for j in i..n {
                difference.set(i, j, scaled.mul_add::<L>(vectors.at(k, j), difference.at(i, j)));
            }
        }
    }
    for i in 0..n {
        for j in 0..i {
            difference.set(i, j, difference.at(j, i));
        }
    }
    (difference, changed)
}

/// Rotates a symmetric matrix until it is diagonal. The rows of `vectors` are rotated too and become the eigenvectors.
///
/// A sweep consists of rounds of rotations without common rows, in the order of a round-robin tournament (Brent and Luk
/// 1985). Computing an angle has a longer latency than applying it, and the angles of a round are independent.
#[inline(always)]
fn diagonalise<L: Level, V: Lane<f64>, A: Square<V>>(a: &mut A, vectors: &mut A) {
    let (n, zero) = (a.size(), V::splat(0.0));
    let mut squares = zero;
    for i in 0..n {
        for j in 0..n {
            squares = squares + a.at(i, j) * a.at(i, j);
        }
    }
    let negligible = squares * V::splat(f64::EPSILON * f64::EPSILON / 16.0);
    for _ in 0..MOST_SWEEPS {
        let mut rotated = V::Mask::none();
        for round in 0..rounds(n) {
            let mut first = 0;
            while first < n / 2 {
                let count = TOGETHER.min(n / 2 - first);
                let mut rotations = [Rotation::none(); TOGETHER];
                for slot in 0..count {
                    let (p, q) = pair(n, round, first + slot);
                    rotations[slot] = Rotation::between::<L>(a.at(p, p), a.at(q, q), a.at(p, q), negligible);
                    rotated = rotated | rotations[slot].active;
                }
                for slot in 0..count {
                    if rotations[slot].active.any() {
                        rotations[slot].apply::<L, A>(pair(n, round, first + slot), a, vectors);
                    }
                }
                first += TOGETHER;
            }
        }
        if !rotated.any() {
            return;
        }
    }
}

/// Returns the number of rounds in which each of n rows meets each other row once.
const fn rounds(n: usize) -> usize {
    n - 1 + n % 2
}

/// Returns the pair of a round. By the circle method, one row stays outside the circle if n is even.
#[inline(always)]
const fn pair(n: usize, round: usize, slot: usize) -> (usize, usize) {
    let (circle, odd) = (rounds(n), n % 2);
    let (p, q) = if odd + slot == 0 {
        (round, circle)
    } else {
        let distance = slot + odd;
        ((round + distance) % circle, (round + circle - distance) % circle)
    };
    if p < q { (p, q) } else { (q, p) }
}

/// A rotation in the plane of coordinates p and q that makes entry (p, q) zero.
#[derive(Clone, Copy)]
struct Rotation<V: Lane<f64>> {
    /// Mask of the lanes to rotate.
    active: V::Mask,
    /// tan φ of the smaller angle; zero in other lanes.
    tangent: V,
    /// sin φ.
    sine: V,
    /// tan φ/2.
    half: V,
}

impl<V: Lane<f64>> Rotation<V> {
    /// Creates a rotation by zero in all lanes.
    #[inline(always)]
    fn none() -> Self {
        let zero = V::splat(0.0);
        Self { active: V::Mask::none(), tangent: zero, sine: zero, half: zero }
    }

    /// Let d be the difference of the diagonal entries, o twice the off-diagonal entry, h = √(d² + o²) and n = |d| + h.
    /// Then tan φ = o/n up to the sign of d. With r = n/cos φ = √(2 h n), all results share the divisor n r (n + r), so
    /// that one division suffices: divisions have the longest latency.
    #[inline(always)]
    fn between<L: Level>(pp: V, qq: V, off: V, negligible: V) -> Self {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let active = negligible.less(off * off);
        if !active.any() {
            return Self::none();
        }
        let (d, o) = (qq - pp, off + off);
        let h = d.mul_add::<L>(d, o * o).sqrt();
        let n = d.abs() + h;
        let r = ((h + h) * n).sqrt();
        let n_and_r = n + r;
        // Avoids 0/0 in lanes without a rotation.
        let divisor = V::select(active, n * r * n_and_r, one);
        let quotient = V::select(d.less(zero), -o, o) / divisor;
        let quotient = V::select(active, quotient, zero);
        Self { active, tangent: quotient * (r * n_and_r), sine: quotient * (n * n_and_r), half: quotient * (n * r) }
    }

    /// A ← Rᵀ A R, of which the upper triangle is stored, and V ← Rᵀ V.
    #[inline(always)]
    fn apply<L: Level, A: Square<V>>(&self, (p, q): (usize, usize), a: &mut A, vectors: &mut A) {
        let (n, zero, off) = (a.size(), V::splat(0.0), a.at(p, q));
        let shift = V::select(self.active, self.tangent * off, zero);
        a.set(p, p, a.at(p, p) - shift);
        a.set(q, q, a.at(q, q) + shift);
        a.set(p, q, V::select(self.active, zero, off));
        for k in 0..p {
            self.rotate::<L, A>(a, (k, p), (k, q));
        }
        for k in p + 1..q {
            self.rotate::<L, A>(a, (p, k), (k, q));
        }
        for k in q + 1..n {
            self.rotate::<L, A>(a, (p, k), (q, k));
        }
        for k in 0..n {
            self.rotate::<L, A>(vectors, (p, k), (q, k));
        }
    }

    /// Rotates two entries.
    #[inline(always)]
    fn rotate<L: Level, A: Square<V>>(&self, a: &mut A, first: (usize, usize), second: (usize, usize)) {
        let (g, h) = self.rotated::<L>(a.at(first.0, first.1), a.at(second.0, second.1));
        a.set(first.0, first.1, g);
        a.set(second.0, second.1, h);
    }

    /// Returns (g cos φ − h sin φ, h cos φ + g sin φ).
    #[inline(always)]
    fn rotated<L: Level>(&self, g: V, h: V) -> (V, V) {
        let less = (-self.sine).mul_add::<L>(g.mul_add::<L>(self.half, h), g);
        (less, self.sine.mul_add::<L>((-self.half).mul_add::<L>(h, g), h))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::{pair, rounds};

    #[test]
    fn a_sweep_rotates_each_pair_once_and_a_round_each_row_once() {
        for n in 2..=12 {
            let mut met = BTreeSet::new();
            for round in 0..rounds(n) {
                let mut rows = BTreeSet::new();
                for slot in 0..n / 2 {
                    let (p, q) = pair(n, round, slot);
                    assert!(p < q && q < n, "{p} and {q} of {n}");
                    assert!(rows.insert(p) && rows.insert(q), "round {round} of {n}: {p} or {q} twice");
                    assert!(met.insert((p, q)), "{p} and {q} of {n} twice");
                }
            }
            assert_eq!(met.len(), n * (n - 1) / 2);
        }
    }
}
