//! Stiffness of a contact against rolling.
//!
//! The distance of two features is d(x) = min ‖y(s)‖ over the parameters s of their points, y(s) = Σ cᵢ(s) xᵢ. Let the
//! vertices move along the normal n by δᵢ. The closest points follow the tilt g, gₖ = Σ (∂cᵢ/∂sₖ) δᵢ, and
//!
//! d = d₀ + Σ cᵢ δᵢ − ½ d₀ gᵀ A⁻¹ g,  Aₖₗ = ∂y/∂sₖ · ∂y/∂sₗ.
//!
//! So a contact with the normal force F resists the tilt by the stiffness F d₀ A⁻¹. It does not matter for two layers
//! of cloth. For a ball, d₀ is the distance from its centre: then the closest point moves by many times the
//! displacement, and without this stiffness Newton's method overshoots.
//!
//! The other parts of the curvature of d are smaller by the ratio of an edge to d₀, or negative.

use energy_dsl::Vector3;

use crate::collision::{Closest, Pair, PairKind};
use crate::geometry::{add_scaled, dot, norm, subtract};

/// Tangents whose part across the first is smaller than this part of their length count as parallel to it.
const PARALLEL: f64 = 1e-3;

/// Returns coefficients w such that gᵀ A⁻¹ g is the sum of their (Σ wᵢ δᵢ)². At most two; none where the closest points
/// are corners.
pub(super) fn rolling(pair: &Pair, closest: &Closest, x: &[Vector3<f64>]) -> impl Iterator<Item = [f64; 4]> {
    let corners = pair.corners(x);
    let mut orthonormal: [Option<([f64; 4], Vector3<f64>)>; 2] = [None; 2];
    for (number, (from, to)) in sides(pair.kind, &closest.weights).enumerate() {
        let mut weights = [0.0; 4];
        (weights[from], weights[to]) = (-1.0, 1.0);
        let mut tangent = subtract(corners[to], corners[from]);
        let length = norm(tangent);
        for (other, unit) in orthonormal.iter().flatten() {
            let part = dot(tangent, *unit);
            weights = std::array::from_fn(|corner| weights[corner] - part * other[corner]);
            tangent = add_scaled(tangent, -part, *unit);
        }
        let across = norm(tangent);
        if across > PARALLEL * length {
            let unit = tangent.map(|component| component / across);
            orthonormal[number] = Some((weights.map(|weight| weight / across), unit));
        }
    }
    orthonormal.into_iter().flatten().map(|(weights, _)| weights)
}

/// Returns the sides along which the closest points can move: pairs of corners with both weights.
fn sides(kind: PairKind, weights: &[f64; 4]) -> impl Iterator<Item = (usize, usize)> {
    let all: &[(usize, usize)] = match kind {
        PairKind::PointTriangle => &[(1, 2), (1, 3), (2, 3)],
        PairKind::EdgeEdge => &[(0, 1), (2, 3)],
    };
    let moves = weights.map(|weight| weight != 0.0);
    all.iter().copied().filter(move |(from, to)| moves[*from] && moves[*to]).take(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distance(pair: &Pair, x: &[Vector3<f64>]) -> f64 {
        Closest::of(pair, &pair.corners(x)).distance
    }

    /// The second derivative of the distance for displacements along the normal, by differences.
    fn curvature(pair: &Pair, x: &[Vector3<f64>; 4], along: [f64; 4]) -> f64 {
        let step = 1e-4;
        let normal = Closest::of(pair, &pair.corners(x)).normal;
        let moved =
            |scale: f64| -> Vec<_> { (0..4).map(|i| add_scaled(x[i], scale * step * along[i], normal)).collect() };
        (distance(pair, &moved(1.0)) - 2.0 * distance(pair, x) + distance(pair, &moved(-1.0))) / (step * step)
    }

    #[test]
    fn distances_fall_with_the_square_of_the_tilt() {
        let triangle = Pair { kind: PairKind::PointTriangle, features: [0; 2], vertices: [0, 1, 2, 3] };
        let edges = Pair { kind: PairKind::EdgeEdge, ..triangle };
        let over = |x: f64, y: f64| [[x, y, 2.0], [0.0, 0.0, 0.0], [1.0, 0.2, 0.0], [-0.3, 1.1, 0.0]];
        let crossed = [[-0.4, -0.2, 0.0], [0.7, 0.1, 0.0], [0.1, -0.9, 1.5], [-0.2, 0.8, 1.5]];
        // Inside, on a side, at a corner; two edges.
        for (pair, x, count) in [
            (triangle, over(0.25, 0.4), 2),
            (triangle, over(0.6, -0.3), 1),
            (triangle, over(-1.0, -1.0), 0),
            (edges, crossed, 2),
        ] {
            let closest = Closest::of(&pair, &pair.corners(&x));
            let found: Vec<_> = rolling(&pair, &closest, &x).collect();
            assert_eq!(found.len(), count);
            for along in [[0.0, 1.0, -0.5, 0.3], [0.2, 0.4, 1.0, -0.7], [0.0, 0.3, 0.3, 0.9]] {
                // A displacement of the first feature alone, so that its sign is that of y.
                let along =
                    if pair == edges { [along[1], along[2], 0.0, 0.0] } else { [0.0, along[1], along[2], along[3]] };
                let square = |w: &[f64; 4]| (0..4).map(|i| w[i] * along[i]).sum::<f64>().powi(2);
                let expected = -closest.distance * found.iter().map(square).sum::<f64>();
                let truth = curvature(&pair, &x, along);
                assert!((truth - expected).abs() < 1e-5 * truth.abs().max(1.0), "{truth} {expected}");
            }
        }
    }
}
