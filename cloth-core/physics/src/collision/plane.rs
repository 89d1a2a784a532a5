//! A point in front of a plane that moves.
//!
//! The plane goes through three vertices, which move on straight lines. Its normal N(t) = u(t) × w(t), not normalised,
//! is a polynomial of degree 2 in time, and the height N(t)·(p(t) − a(t)) of a point p one of degree 3. A polynomial is
//! at least as large as the smallest of its Bernstein coefficients, and ‖N(t)‖ at most as large as the largest of its
//! coefficients. So the point stays ℓ in front of the plane if the former is at least ℓ times the latter.

use energy_dsl::Vector3;

use crate::geometry::{add_scaled, cross, dot, norm, subtract};

/// Attempts to find a part of a move that is safe.
const ATTEMPTS: usize = 64;

/// Returns a part of a straight move during which a point keeps a level in front of the plane through three others, on
/// the side where it starts. Returns 0 if it does not do so at the start.
pub(super) fn safe_part(from: &[Vector3<f64>; 4], to: &[Vector3<f64>; 4], level: f64) -> f64 {
    let mut part = 1.0;
    for _ in 0..ATTEMPTS {
        let here = |corner: usize| add_scaled(from[corner], part, subtract(to[corner], from[corner]));
        let end = if part == 1.0 { *to } else { [here(0), here(1), here(2), here(3)] };
        let ([start, least], largest) = heights(from, &end);
        let needed = level * largest;
        if least >= needed {
            return part;
        }
        let shrunk = part * (start - needed) / (start - least);
        let is_smaller = shrunk > 0.0 && shrunk < part;
        if !is_smaller {
            return 0.0;
        }
        part = shrunk * (1.0 - 1e-3);
    }
    0.0
}

/// Returns the height of the point at the start and the smallest coefficient of its height, both times the length of
/// the normal, and the largest length of the normal.
fn heights(from: &[Vector3<f64>; 4], to: &[Vector3<f64>; 4]) -> ([f64; 2], f64) {
    let sides = |[p, a, b, c]: &[Vector3<f64>; 4]| [subtract(*p, *a), subtract(*b, *a), subtract(*c, *a)];
    let ([y0, u0, w0], [y1, u1, w1]) = (sides(from), sides(to));
    let middle = add_scaled(cross(u0, w1), 1.0, cross(u1, w0)).map(|component| 0.5 * component);
    let normals = [cross(u0, w0), middle, cross(u1, w1)];
    let [n0, n1, n2] = normals;
    let heights =
        [dot(n0, y0), (dot(n0, y1) + 2.0 * dot(n1, y0)) / 3.0, (2.0 * dot(n1, y1) + dot(n2, y0)) / 3.0, dot(n2, y1)];
    let side = if heights[0] < 0.0 { -1.0 } else { 1.0 };
    let least = heights.iter().map(|height| side * height).fold(f64::INFINITY, f64::min);
    ([side * heights[0], least], normals.iter().map(|normal| norm(*normal)).fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-1.0..1.0_f64)
    }

    #[test]
    fn a_plane_that_turns_about_the_origin_stops_at_the_point() {
        const LEVEL: f64 = 1e-3;
        let corners = |angle: f64| {
            let (sine, cosine) = angle.sin_cos();
            let turned = |x: f64, y: f64| [1e4 * cosine * x, 1e4 * y, 1e4 * sine * x];
            [[0.5, 0.1, 0.3], turned(1.0, 0.0), turned(-0.5, 0.8), turned(-0.5, -0.8)]
        };
        // The plane rises by 0.01 at the point: it is free to go all the way.
        assert_eq!(safe_part(&corners(0.0), &corners(0.02), LEVEL), 1.0);
        // At 0.5404 the plane reaches the point.
        let part = safe_part(&corners(0.0), &corners(0.6), LEVEL);
        assert!(part > 0.5 && part < 0.9, "{part}");
        assert_eq!(safe_part(&corners(0.55), &corners(0.6), 0.01), 0.0, "too near at the start");
    }

    proptest! {
        /// The point keeps its level at every instant of the part.
        #[test]
        fn no_instant_is_below_the_level(
            from in prop::array::uniform4(vector()), by in prop::array::uniform4(vector()), size in 0.0..2.0_f64,
        ) {
            const LEVEL: f64 = 0.01;
            let to: [Vector3<f64>; 4] = std::array::from_fn(|corner| add_scaled(from[corner], size, by[corner]));
            let part = safe_part(&from, &to, LEVEL);
            let height = |time: f64| {
                let [p, a, b, c]: [Vector3<f64>; 4] =
                    std::array::from_fn(|corner| add_scaled(from[corner], time * size, by[corner]));
                let normal = cross(subtract(b, a), subtract(c, a));
                dot(normal, subtract(p, a)) / norm(normal)
            };
            let side = height(0.0).signum();
            for sample in 0..=20 {
                let time = part * f64::from(sample) / 20.0;
                prop_assert!(part == 0.0 || side * height(time) > LEVEL - 1e-12, "{} at {}", height(time), time);
            }
        }
    }
}
