//! Closest points of a point and a triangle, and of two edges (Ericson, "Real-Time Collision Detection", 2005, §5.1).
//!
//! The formulas have no branches, so that SIMD lanes evaluate many pairs at a time. They use plain sums and products:
//! results have the same bits in any number of lanes.

use energy_dsl::{Lane, Level, Real, Vector3};

use super::{Pair, PairKind};
use crate::geometry::{add_scaled, cross, dot, norm, subtract};

/// The closest points p and q of a pair. `V` is a number, or several of them in lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest<V = f64> {
    /// The coefficients c with p − q = Σ cᵢ xᵢ. Their sum is 0.
    pub weights: [V; 4],
    /// ‖p − q‖, in m.
    pub distance: V,
    /// (p − q)/‖p − q‖; zero if the points coincide.
    pub normal: [V; 3],
    /// The smallest n·(a − b) over the corners a of the first and b of the second feature. To rounding, it is the
    /// distance. It is a lower bound of the distance even if the closest points are not.
    pub separation: V,
}

impl Closest {
    /// Finds the closest points of a pair with these corners.
    pub fn of(pair: &Pair, corners: &[Vector3<f64>; 4]) -> Self {
        Self::between(pair.kind, corners)
    }
}

impl<V: Real> Closest<V> {
    /// Finds the closest points of pairs of one kind with these corners.
    #[inline(always)]
    pub fn between(kind: PairKind, corners: &[[V; 3]; 4]) -> Self {
        let one = V::from_f64(1.0);
        let weights = match kind {
            PairKind::PointTriangle => {
                let [u, v, w] = on_triangle(corners);
                [one, -u, -v, -w]
            }
            PairKind::EdgeEdge => {
                let [s, t] = on_segments(corners);
                [one - s, s, t - one, -t]
            }
        };
        // Differences to one corner lose fewer digits than a sum of positions.
        let origin = corners[kind.first()];
        let zero = V::from_f64(0.0);
        let mut apart = [zero; 3];
        for corner in 0..4 {
            apart = add_scaled(apart, weights[corner], subtract(corners[corner], origin));
        }
        let distance = norm(apart);
        let is_apart = zero.less(distance);
        let [x, y, z] = apart;
        let normal = select(is_apart, &[x / distance, y / distance, z / distance], &[zero; 3]);
        Self { weights, distance, normal, separation: separation(&normal, corners, kind.first()) }
    }
}

/// Gathers the corners of pairs with these vertices.
#[inline(always)]
pub(super) fn corners<L: Level>(x: &[Vector3<f64>], [p, q, r, s]: &[[u32; 16]; 4]) -> [Vector3<L::F64>; 4] {
    [L::F64::gather(x, p), L::F64::gather(x, q), L::F64::gather(x, r), L::F64::gather(x, s)]
}

/// The smallest n·(a − b) over corners a of the first and b of the second feature. For a unit vector n, a lower bound
/// of their distance, to rounding.
#[inline(always)]
pub(super) fn separation<V: Real>(n: &[V; 3], corners: &[[V; 3]; 4], first: usize) -> V {
    let mut least = V::from_f64(f64::INFINITY);
    for a in 0..first {
        for b in first..4 {
            least = least.min(dot(*n, subtract(corners[a], corners[b])));
        }
    }
    least
}

/// Barycentric coordinates of the point of a triangle that is closest to a point. Exactly zero on the features that the
/// point avoids.
#[inline(always)]
fn on_triangle<V: Real>(corners: &[[V; 3]; 4]) -> [V; 3] {
    let [p, a, b, c] = *corners;
    let (zero, one) = (V::from_f64(0.0), V::from_f64(1.0));
    let (ab, ac) = (subtract(b, a), subtract(c, a));
    let (ap, bp, cp) = (subtract(p, a), subtract(p, b), subtract(p, c));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    let is_negative = |x: V| x.less_or_equal(zero);
    let is_positive = |x: V| zero.less_or_equal(x);

    // The coordinates of b and c are quotients, with the numerators and the denominator of the point's region.
    let is_on_bc = is_negative(va) & d3.less_or_equal(d4) & d6.less_or_equal(d5);
    let is_on_ac = is_negative(vb) & is_positive(d2) & is_negative(d6);
    let is_at_c = is_positive(d6) & d5.less_or_equal(d6);
    let is_on_ab = is_negative(vc) & is_positive(d1) & is_negative(d3);
    let is_at_b = is_positive(d3) & d4.less_or_equal(d3);
    let is_at_a = is_negative(d1) & is_negative(d2);
    let region = [vb, vc, va + vb + vc];
    let region = select(is_on_bc, &[zero, d4 - d3, (d4 - d3) + (d5 - d6)], &region);
    let region = select(is_on_ac, &[zero, d2, d2 - d6], &region);
    let region = select(is_at_c, &[zero, one, one], &region);
    let region = select(is_on_ab, &[d1, zero, d1 - d3], &region);
    let region = select(is_at_b, &[one, zero, one], &region);
    let region = select(is_at_a, &[zero, zero, one], &region);
    let is_beyond_bc = is_on_bc & !(is_on_ac | is_at_c | is_on_ab | is_at_b | is_at_a);
    let [v, w, sum] = region;
    let w = fraction(w, sum);
    let v = V::select(is_beyond_bc, one - w, fraction(v, sum));
    let u = V::select(is_beyond_bc, zero, (one - v - w).max(zero));

    let normal = cross(ab, ac);
    let least = V::from_f64(1e-20) * dot(ab, ab) * dot(ac, ac);
    let is_flat = dot(normal, normal).less_or_equal(least);
    if !energy_dsl::Mask::any(is_flat) {
        return [u, v, w];
    }
    select(is_flat, &on_sides(p, [a, b, c]), &[u, v, w])
}

/// Barycentric coordinates of the closest point of a triangle without area: that of the nearest side.
#[inline(always)]
fn on_sides<V: Real>(p: [V; 3], corners: [[V; 3]; 3]) -> [V; 3] {
    let one = V::from_f64(1.0);
    let (mut least, mut nearest) = (V::from_f64(f64::INFINITY), [V::from_f64(0.0); 3]);
    for start in 0..3 {
        let end = (start + 1) % 3;
        let (along, to) = (subtract(corners[end], corners[start]), subtract(p, corners[start]));
        let t = fraction(dot(to, along), dot(along, along));
        let rest = add_scaled(to, -t, along);
        let square = dot(rest, rest);
        let is_nearer = square.less(least);
        let mut coordinates = [V::from_f64(0.0); 3];
        (coordinates[start], coordinates[end]) = (one - t, t);
        least = V::select(is_nearer, square, least);
        nearest = select(is_nearer, &coordinates, &nearest);
    }
    nearest
}

/// Parameters of the closest points on the segments from x₀ to x₁ and from x₂ to x₃.
#[inline(always)]
fn on_segments<V: Real>(&[a, b, c, d]: &[[V; 3]; 4]) -> [V; 2] {
    let (zero, one) = (V::from_f64(0.0), V::from_f64(1.0));
    let (u, v, r) = (subtract(b, a), subtract(d, c), subtract(a, c));
    let (uu, vv, uv) = (dot(u, u), dot(v, v), dot(u, v));
    let (ur, vr) = (dot(u, r), dot(v, r));
    let area = uu * vv - uv * uv;
    let is_skew = (V::from_f64(1e-14) * uu * vv).less(area);
    let s = V::select(is_skew, fraction(uv * vr - ur * vv, area), zero);
    let t = (uv * s + vr) / vv;
    // NaN if the second edge has no length.
    let is_after_start = zero.less(t);
    let is_at_end = one.less_or_equal(t);
    let at_end = V::select(is_after_start, uv - ur, -ur);
    let s = V::select(is_after_start & !is_at_end, s, fraction(at_end, uu));
    let t = V::select(is_after_start, V::select(is_at_end, one, t), zero);
    [s, t]
}

/// Returns a/b within [0, 1]; 0 if it is undefined.
#[inline(always)]
fn fraction<V: Real>(a: V, b: V) -> V {
    let zero = V::from_f64(0.0);
    V::select(zero.less(a) & zero.less(b), (a / b).min(V::from_f64(1.0)), zero)
}

/// a where the mask holds, b elsewhere.
#[inline(always)]
fn select<V: Real>(mask: V::Mask, a: &[V; 3], b: &[V; 3]) -> [V; 3] {
    [V::select(mask, a[0], b[0]), V::select(mask, a[1], b[1]), V::select(mask, a[2], b[2])]
}
