use energy_dsl::{Lane, Level, Mask};

use super::definite::is_semi_definite;
use super::{Curvature, Orthonormal, add_to, fill_scaled, jacobi, upper_index};

/// Tolerance of the entries that should vanish, relative to the largest entry.
const TOLERANCE: f64 = 1e-10;

/// Projects Hessians that split into an in-plane and an out-of-plane part.
///
/// If rotations and reflections leave a function of two vectors unchanged, as for membranes and hair, a displacement in
/// their plane and one out of it have no mixed second derivative. The 6×6 Hessian then splits into a 2×2 matrix, in
/// which compression shows, and a 4×4 matrix, which is mostly definite. Each open lane is tested for this structure.
///
/// Returns masks of the lanes with this structure and of the changed lanes.
#[inline(always)]
pub(super) fn change<L: Level, V: Lane<f64>>(
    upper: &mut [V],
    curvature: Curvature,
    orthonormal: &Orthonormal,
    [d, e]: [[V; 3]; 2],
    open: V::Mask,
) -> (V::Mask, V::Mask) {
    let normal = [d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2], d[0] * e[1] - d[1] * e[0]];
    let (dd, nn) = (square(d), square(normal));
    let spans = dd.is_moderate(2) & nn.is_moderate(4);
    let one = V::splat(1.0);
    let (per_d, per_n) = (one / dd.sqrt(), one / nn.sqrt());
    let mut frame = [[one; 3]; 3];
    for axis in 0..3 {
        frame[0][axis] = d[axis] * per_d;
        frame[2][axis] = normal[axis] * per_n;
    }
    let [t, _, n] = frame;
    frame[1] = [n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]];

    let mut a = [[one; 6]; 6];
    let scale = fill_scaled(&mut a, upper);
    orthonormal.make_orthonormal(&mut a);
    turn(&mut a, &frame);
    let mut planar = open & spans;
    let tolerance = V::splat(TOLERANCE);
    for out in [2, 5] {
        for within in IN_PLANE {
            planar = planar & a[out][within].abs().less_or_equal(tolerance);
        }
    }
    if !planar.any() {
        return (planar, planar);
    }

    let zero = V::splat(0.0);
    let mut difference = [[zero; 6]; 6];
    let mut out = [[zero; 2]; 2];
    for (i, row) in [2, 5].into_iter().enumerate() {
        for (j, column) in [2, 5].into_iter().enumerate() {
            out[i][j] = a[row][column];
        }
    }
    let (part, mut changed) = jacobi::difference::<L, V, _>(&mut out, curvature);
    for (i, row) in [2, 5].into_iter().enumerate() {
        for (j, column) in [2, 5].into_iter().enumerate() {
            difference[row][column] = part[i][j];
        }
    }

    let mut within = [[zero; 4]; 4];
    let mut within_upper = [zero; 10];
    for i in 0..4 {
        for j in 0..4 {
            within[i][j] = a[IN_PLANE[i]][IN_PLANE[j]];
        }
        for j in i..4 {
            within_upper[upper_index(4, i, j)] = within[i][j];
        }
    }
    let indefinite = planar & !is_semi_definite(&within_upper, 4);
    if indefinite.any() {
        let (part, also) = jacobi::difference::<L, V, _>(&mut within, curvature);
        changed = changed | (also & indefinite);
        for i in 0..4 {
            for j in 0..4 {
                difference[IN_PLANE[i]][IN_PLANE[j]] = V::select(indefinite, part[i][j], zero);
            }
        }
    }
    let changed = changed & planar;
    if changed.any() {
        let back = [
            [frame[0][0], frame[1][0], frame[2][0]],
            [frame[0][1], frame[1][1], frame[2][1]],
            [frame[0][2], frame[1][2], frame[2][2]],
        ];
        turn(&mut difference, &back);
        orthonormal.make_differences(&mut difference);
        add_to(upper, &difference, scale, changed);
    }
    (planar, changed)
}

/// The coordinates in the plane of both vectors.
const IN_PLANE: [usize; 4] = [0, 1, 3, 4];

#[inline(always)]
fn square<V: Lane<f64>>(a: [V; 3]) -> V {
    a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
}

/// A ← R A Rᵀ for a symmetric A, where R acts on both vectors.
#[inline(always)]
fn turn<V: Lane<f64>>(a: &mut [[V; 6]; 6], r: &[[V; 3]; 3]) {
    // Twice A ← (R A)ᵀ.
    for _ in 0..2 {
        let old = *a;
        for vector in 0..2 {
            for axis in 0..3 {
                for column in 0..6 {
                    let first = 3 * vector;
                    a[column][first + axis] = r[axis][0] * old[first][column]
                        + r[axis][1] * old[first + 1][column]
                        + r[axis][2] * old[first + 2][column];
                }
            }
        }
    }
}
