//! Eigenvalues by Jacobi's cyclic rotations (Golub and Van Loan, *Matrix Computations*, §8.5), one matrix a lane. A lane whose
//! matrix is diagonal already is turned by zero: its bits do not depend on its neighbours.

use energy_dsl::{Lane, Level, Mask};

use super::{Curvature, MOST, Square};

/// Sweeps converge quadratically: six or seven do for 12×12 matrices.
const MOST_SWEEPS: usize = 16;

/// By how much a matrix changes when its eigenvalues do, and in which lanes; leaves it diagonal.
#[inline(always)]
pub(super) fn difference<L: Level, V: Lane<f64>, const N: usize>(
    a: &mut Square<V, N>,
    curvature: Curvature,
) -> (Square<V, N>, V::Mask) {
    let zero = V::splat(0.0);
    let mut vectors = [[zero; N]; N];
    for i in 0..N {
        vectors[i][i] = V::splat(1.0);
    }
    diagonalise::<L, V, N>(a, &mut vectors);
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
            let scaled = change * vectors[k][i];
            for j in i..N {
                difference[i][j] = scaled.mul_add::<L>(vectors[k][j], difference[i][j]);
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

/// Rotates a symmetric matrix until it is diagonal; the rows of `vectors` are turned along, and become eigenvectors.
///
/// A sweep goes in rounds, of rotations that have no row in common, in the order of a tournament (Brent and Luk 1985): their angles do not wait for
/// each other, and finding one takes longer than turning by it.
#[inline(always)]
fn diagonalise<L: Level, V: Lane<f64>, const N: usize>(a: &mut Square<V, N>, vectors: &mut Square<V, N>) {
    let zero = V::splat(0.0);
    let mut squares = zero;
    for i in 0..N {
        for j in 0..N {
            squares = squares + a[i][j] * a[i][j];
        }
    }
    let negligible = squares * V::splat(f64::EPSILON * f64::EPSILON / 16.0);
    for _ in 0..MOST_SWEEPS {
        let mut turned = V::Mask::none();
        for round in 0..rounds(N) {
            let mut rotations = [Rotation::none(); MOST / 2];
            for meeting in 0..N / 2 {
                let (p, q) = pair(N, round, meeting);
                rotations[meeting] = Rotation::between::<L>(a[p][p], a[q][q], a[p][q], negligible);
                turned = turned | rotations[meeting].turn;
            }
            for meeting in 0..N / 2 {
                if rotations[meeting].turn.any() {
                    rotations[meeting].apply::<L, N>(pair(N, round, meeting), a, vectors);
                }
            }
        }
        if !turned.any() {
            return;
        }
    }
}

/// Rounds in which each of n meets each other once.
const fn rounds(n: usize) -> usize {
    n - 1 + n % 2
}

/// Who meets in a round: all but one stand in a circle, and those at the same distance on either side of one of them meet; that one meets the one
/// outside, if there is one.
#[inline(always)]
const fn pair(n: usize, round: usize, meeting: usize) -> (usize, usize) {
    let (circle, odd) = (rounds(n), n % 2);
    let (p, q) = if odd + meeting == 0 {
        (round, circle)
    } else {
        let distance = meeting + odd;
        ((round + distance) % circle, (round + circle - distance) % circle)
    };
    if p < q { (p, q) } else { (q, p) }
}

/// A rotation in the plane of two coordinates, p and q, that makes entry (p, q) vanish.
#[derive(Clone, Copy)]
struct Rotation<V: Lane<f64>> {
    /// In which lanes there is something to be turned.
    turn: V::Mask,
    /// tan φ of the smaller angle, zero elsewhere.
    tangent: V,
    /// sin φ.
    sine: V,
    /// tan φ/2.
    half: V,
}

impl<V: Lane<f64>> Rotation<V> {
    /// Nothing is turned.
    #[inline(always)]
    fn none() -> Self {
        let zero = V::splat(0.0);
        Self { turn: V::Mask::none(), tangent: zero, sine: zero, half: zero }
    }

    /// With d and o the differences of the diagonal and twice the entry beside it, h = √(d² + o²) and n = |d| + h, tan φ is o/n up to the sign of d,
    /// and with r = n/cos φ = √(2 h n) all that is needed has the divisor n r (n + r): dividing is what takes longest.
    #[inline(always)]
    fn between<L: Level>(pp: V, qq: V, off: V, negligible: V) -> Self {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let turn = negligible.less(off * off);
        if !turn.any() {
            return Self::none();
        }
        let (d, o) = (qq - pp, off + off);
        let h = d.mul_add::<L>(d, o * o).sqrt();
        let n = d.abs() + h;
        let r = ((h + h) * n).sqrt();
        let n_and_r = n + r;
        // Divided where there is nothing to be turned, zero by zero would be NaN.
        let divisor = V::select(turn, n * r * n_and_r, one);
        let quotient = V::select(d.less(zero), -o, o) / divisor;
        let quotient = V::select(turn, quotient, zero);
        Self { turn, tangent: quotient * (r * n_and_r), sine: quotient * (n * n_and_r), half: quotient * (n * r) }
    }

    /// A ← Rᵀ A R, of which the upper triangle is stored, and V ← Rᵀ V.
    #[inline(always)]
    fn apply<L: Level, const N: usize>(
        &self,
        (p, q): (usize, usize),
        a: &mut Square<V, N>,
        vectors: &mut Square<V, N>,
    ) {
        let (zero, off) = (V::splat(0.0), a[p][q]);
        let shift = V::select(self.turn, self.tangent * off, zero);
        a[p][p] = a[p][p] - shift;
        a[q][q] = a[q][q] + shift;
        a[p][q] = V::select(self.turn, zero, off);
        for k in 0..p {
            (a[k][p], a[k][q]) = self.turned::<L>(a[k][p], a[k][q]);
        }
        for k in p + 1..q {
            (a[p][k], a[k][q]) = self.turned::<L>(a[p][k], a[k][q]);
        }
        for k in q + 1..N {
            (a[p][k], a[q][k]) = self.turned::<L>(a[p][k], a[q][k]);
        }
        for k in 0..N {
            (vectors[p][k], vectors[q][k]) = self.turned::<L>(vectors[p][k], vectors[q][k]);
        }
    }

    /// (g cos φ − h sin φ, h cos φ + g sin φ).
    #[inline(always)]
    fn turned<L: Level>(&self, g: V, h: V) -> (V, V) {
        let less = (-self.sine).mul_add::<L>(g.mul_add::<L>(self.half, h), g);
        (less, self.sine.mul_add::<L>((-self.half).mul_add::<L>(h, g), h))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::{pair, rounds};

    #[test]
    fn in_a_sweep_each_pair_is_turned_once_and_in_a_round_each_row() {
        for n in 2..=12 {
            let mut met = BTreeSet::new();
            for round in 0..rounds(n) {
                let mut rows = BTreeSet::new();
                for meeting in 0..n / 2 {
                    let (p, q) = pair(n, round, meeting);
                    assert!(p < q && q < n, "{p} and {q} of {n}");
                    assert!(rows.insert(p) && rows.insert(q), "round {round} of {n}: {p} or {q} twice");
                    assert!(met.insert((p, q)), "{p} and {q} of {n} twice");
                }
            }
            assert_eq!(met.len(), n * (n - 1) / 2);
        }
    }
}
