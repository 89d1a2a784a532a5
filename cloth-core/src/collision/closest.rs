//! Closest points of a point and a triangle, and of two edges (Ericson, "Real-Time Collision Detection", 2005, §5.1).

use energy_dsl::Vector3;

use super::{Pair, PairKind};
use crate::geometry::{add_scaled, cross, dot, norm, subtract};

/// The closest points p and q of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Closest {
    /// The coefficients c with p − q = Σ cᵢ xᵢ. Their sum is 0.
    pub weights: [f64; 4],
    /// ‖p − q‖, in m.
    pub distance: f64,
    /// (p − q)/‖p − q‖; zero if the points coincide.
    pub normal: Vector3<f64>,
}

impl Closest {
    /// Finds the closest points of a pair with these corners.
    pub fn of(pair: &Pair, corners: &[Vector3<f64>; 4]) -> Self {
        let weights = match pair.kind {
            PairKind::PointTriangle => {
                let [p, a, b, c] = *corners;
                let [u, v, w] = on_triangle(p, a, b, c);
                [1.0, -u, -v, -w]
            }
            PairKind::EdgeEdge => {
                let [s, t] = on_segments(*corners);
                [1.0 - s, s, t - 1.0, -t]
            }
        };
        Self::with_weights(weights, pair.first(), corners)
    }

    fn with_weights(weights: [f64; 4], first: usize, corners: &[Vector3<f64>; 4]) -> Self {
        // Differences to one corner lose fewer digits than a sum of positions.
        let origin = corners[first];
        let apart = (0..4).fold([0.0; 3], |sum, i| add_scaled(sum, weights[i], subtract(corners[i], origin)));
        let distance = norm(apart);
        let normal = if distance > 0.0 { apart.map(|component| component / distance) } else { [0.0; 3] };
        Self { weights, distance, normal }
    }
}

/// Barycentric coordinates of the point of a triangle that is closest to p. Exactly zero on the features that the point
/// avoids.
fn on_triangle(p: Vector3<f64>, a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>) -> [f64; 3] {
    let (ab, ac, ap) = (subtract(b, a), subtract(c, a), subtract(p, a));
    let normal = cross(ab, ac);
    if dot(normal, normal) <= 1e-20 * dot(ab, ab) * dot(ac, ac) {
        return on_sides(p, [a, b, c]);
    }
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = subtract(p, b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = fraction(d1, d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let cp = subtract(p, c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = fraction(d2, d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let w = fraction(d4 - d3, (d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - w, w];
    }
    let sum = va + vb + vc;
    let (v, w) = (fraction(vb, sum), fraction(vc, sum));
    [(1.0 - v - w).max(0.0), v, w]
}

/// Barycentric coordinates of the closest point of a triangle without area: that of the nearest side.
fn on_sides(p: Vector3<f64>, corners: [Vector3<f64>; 3]) -> [f64; 3] {
    let of = |side: usize| {
        let ends = [side, (side + 1) % 3];
        let [a, b] = ends.map(|end| corners[end]);
        let (along, to) = (subtract(b, a), subtract(p, a));
        let t = fraction(dot(to, along), dot(along, along));
        let rest = add_scaled(to, -t, along);
        let mut coordinates = [0.0; 3];
        (coordinates[ends[0]], coordinates[ends[1]]) = (1.0 - t, t);
        (dot(rest, rest), coordinates)
    };
    let [first, others @ ..] = [0, 1, 2].map(of);
    others.into_iter().fold(first, |best, other| if other.0 < best.0 { other } else { best }).1
}

/// Parameters of the closest points on the segments from x₀ to x₁ and from x₂ to x₃.
fn on_segments([a, b, c, d]: [Vector3<f64>; 4]) -> [f64; 2] {
    let (u, v, r) = (subtract(b, a), subtract(d, c), subtract(a, c));
    let (uu, vv, uv) = (dot(u, u), dot(v, v), dot(u, v));
    let (ur, vr) = (dot(u, r), dot(v, r));
    let area = uu * vv - uv * uv;
    let mut s = if area > 1e-14 * uu * vv { fraction(uv * vr - ur * vv, area) } else { 0.0 };
    let mut t = (uv * s + vr) / vv;
    // NaN if the second edge has no length.
    let is_after_start = t > 0.0;
    if !is_after_start {
        (t, s) = (0.0, fraction(-ur, uu));
    } else if t >= 1.0 {
        (t, s) = (1.0, fraction(uv - ur, uu));
    }
    [s, t]
}

/// Returns a/b within [0, 1]; 0 if it is undefined.
fn fraction(a: f64, b: f64) -> f64 {
    if a > 0.0 && b > 0.0 { (a / b).min(1.0) } else { 0.0 }
}
