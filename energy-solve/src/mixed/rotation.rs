//! Rotations as unit quaternions w, x, y, z.

use energy_dsl::{Baseline, Block, Number, Vector3};

/// A quaternion w, x, y, z.
pub(super) type Quaternion = [f64; 4];

/// Returns p q, the rotation by q and then by p.
pub(super) fn product([a, b, c, d]: Quaternion, [w, x, y, z]: Quaternion) -> Quaternion {
    [
        a * w - (b * x + c * y + d * z),
        a * x + b * w + (c * z - d * y),
        a * y + c * w + (d * x - b * z),
        a * z + d * w + (b * y - c * x),
    ]
}

/// Returns the inverse of a unit quaternion.
pub(super) fn inverse([w, x, y, z]: Quaternion) -> Quaternion {
    [w, -x, -y, -z]
}

/// Returns the quaternion of unit length in the same direction.
pub(super) fn normalised(q: Quaternion) -> Quaternion {
    let norm = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    q.map(|c| c / norm)
}

/// Returns exp(δ), the rotation by |δ| about δ.
pub(super) fn exponential(delta: Vector3<f64>) -> Quaternion {
    let angle = length(delta);
    let (sine, cosine) = Number::sin_cos::<Baseline>(0.5 * angle);
    // sin(φ/2)/φ tends to ½.
    let factor = if angle > 0.0 { sine / angle } else { 0.5 };
    [cosine, factor * delta[0], factor * delta[1], factor * delta[2]]
}

/// Returns the product of exp(δ) and q, of unit length.
pub(super) fn moved(q: Quaternion, delta: Vector3<f64>) -> Quaternion {
    normalised(product(exponential(delta), q))
}

/// Returns the rotation vector of a unit quaternion, of length π at most.
pub(super) fn logarithm(q: Quaternion) -> Vector3<f64> {
    let [w, x, y, z] = if q[0] < 0.0 { q.map(|c| -c) } else { q };
    let sine = length([x, y, z]);
    // φ/sin(φ/2) tends to 2.
    let factor = if sine > 0.0 { 2.0 * Number::atan2::<Baseline>(sine, w) / sine } else { 2.0 };
    [factor * x, factor * y, factor * z]
}

pub(super) fn length(v: Vector3<f64>) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

/// Returns the rotation matrix of a unit quaternion.
fn matrix([w, x, y, z]: Quaternion) -> Block<f64> {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// Returns R J Rᵀ, a body's inertia tensor in space.
pub(super) fn turned(tensor: &Block<f64>, q: Quaternion) -> Block<f64> {
    let r = matrix(q);
    let half: Block<f64> =
        std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| r[i][k] * tensor[k][j]).sum()));
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| half[i][k] * r[j][k]).sum()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_turn_by_their_length() {
        let q = exponential([0.0, 0.0, std::f64::consts::FRAC_PI_2]);
        let r = matrix(q);
        assert!((r[1][0] - 1.0).abs() < 1e-15 && (r[0][1] + 1.0).abs() < 1e-15 && r[0][0].abs() < 1e-15);
        assert_eq!(exponential([0.0; 3]), [1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn a_logarithm_is_the_shorter_rotation_vector() {
        for delta in [[0.0; 3], [1e-9, 0.0, 2e-9], [0.3, -2.0, 1.0]] {
            for q in [exponential(delta), exponential(delta).map(|c| -c)] {
                let found = logarithm(q);
                assert!((0..3).all(|i| (found[i] - delta[i]).abs() <= 1e-15 * (1.0 + length(delta))), "{found:?}");
            }
        }
    }

    #[test]
    fn the_left_factor_turns_last() {
        let about = |axis: usize| exponential(std::array::from_fn(|i| if i == axis { 1.1 } else { 0.0 }));
        let both = matrix(product(about(2), about(0)));
        let (z, x) = (matrix(about(2)), matrix(about(0)));
        for i in 0..3 {
            for j in 0..3 {
                let expected: f64 = (0..3).map(|k| z[i][k] * x[k][j]).sum();
                assert!((both[i][j] - expected).abs() < 1e-15);
            }
        }
    }
}
