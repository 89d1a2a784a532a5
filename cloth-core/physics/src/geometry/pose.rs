use energy_dsl::Vector3;

use super::{cross, dot, norm, subtract};

/// A rigid motion x ↦ R x + t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    rotation: [Vector3<f64>; 3],
    translation: Vector3<f64>,
}

impl Pose {
    /// The motion that leaves every point in place.
    pub const IDENTITY: Self =
        Self { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };

    /// Returns the motion x ↦ R x + t with these rows of R. `None` unless R is a rotation: Rᵀ R = 1 to 1e-9, without a
    /// reflection.
    ///
    /// ```
    /// use cloth_physics::geometry::Pose;
    /// let quarter = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    /// assert_eq!(Pose::new(quarter, [0.0, 0.0, 1.0]).unwrap().transform([1.0, 0.0, 0.0]), [0.0, 1.0, 1.0]);
    /// assert_eq!(Pose::new([[-1.0, 0.0, 0.0], quarter[1], quarter[2]], [0.0; 3]), None);
    /// ```
    #[must_use]
    pub fn new(rotation: [Vector3<f64>; 3], translation: Vector3<f64>) -> Option<Self> {
        let [a, b, c] = rotation;
        let products = [[a, a], [b, b], [c, c], [a, b], [b, c], [a, c]].map(|[p, q]| dot(p, q));
        let is_close = |(product, expected): (f64, f64)| (product - expected).abs() <= 1e-9;
        let is_rotation = products.into_iter().zip([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]).all(is_close);
        let is_right_handed = dot(cross(a, b), c) > 0.0;
        let is_finite = translation.iter().all(|component| component.is_finite());
        (is_rotation && is_right_handed && is_finite).then_some(Self { rotation, translation })
    }

    /// The rows of R.
    #[must_use]
    pub fn rows(&self) -> [Vector3<f64>; 3] {
        self.rotation
    }

    /// t, in m.
    #[must_use]
    pub fn translation(&self) -> Vector3<f64> {
        self.translation
    }

    /// Returns the right-handed rotation by an angle in degrees about an axis through a point (Rodrigues' formula).
    /// Quarter turns are exact up to rounding.
    #[must_use]
    pub fn rotation(axis: Vector3<f64>, degrees: f64, centre: Vector3<f64>) -> Self {
        if degrees == 0.0 {
            return Self::IDENTITY;
        }
        let n = axis.map(|component| component / norm(axis));
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let column = |unit: Vector3<f64>| -> Vector3<f64> {
            let (across, along) = (cross(n, unit), dot(n, unit));
            std::array::from_fn(|i| cosine * unit[i] + sine * across[i] + (1.0 - cosine) * along * n[i])
        };
        let columns = Self::IDENTITY.rotation.map(column);
        let rotation = std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]));
        let rotated = Self { rotation, translation: [0.0; 3] };
        Self { rotation, translation: subtract(centre, rotated.transform(centre)) }
    }

    /// Returns this motion followed by a translation.
    #[must_use]
    pub fn translated(mut self, by: Vector3<f64>) -> Self {
        (0..3).for_each(|axis| self.translation[axis] += by[axis]);
        self
    }

    /// Returns this motion followed by `next`.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let column = |j: usize| next.rotate(std::array::from_fn(|i| self.rotation[i][j]));
        let columns = [0, 1, 2].map(column);
        let rotation = std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]));
        Self { rotation, translation: next.transform(self.translation) }
    }

    /// Transforms a point.
    #[must_use]
    pub fn transform(&self, point: Vector3<f64>) -> Vector3<f64> {
        std::array::from_fn(|i| dot(self.rotation[i], point) + self.translation[i])
    }

    /// Transforms a direction: rotates without translating.
    #[must_use]
    pub fn rotate(&self, direction: Vector3<f64>) -> Vector3<f64> {
        self.rotation.map(|row| dot(row, direction))
    }

    /// Transforms a point by the inverse motion.
    #[must_use]
    pub fn inverse_transform(&self, point: Vector3<f64>) -> Vector3<f64> {
        let offset = subtract(point, self.translation);
        std::array::from_fn(|j| (0..3).map(|i| self.rotation[i][j] * offset[i]).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_undo_themselves_and_keep_distances() {
        let pose = Pose::rotation([1.0, 2.0, -0.5], 77.0, [0.3, 0.2, 0.1]).translated([1.0, -2.0, 3.0]);
        let (p, q) = ([0.4, -0.7, 1.1], [1.4, 0.7, -0.1]);
        let there = pose.transform(p);
        let back = pose.inverse_transform(there);
        assert!(norm(subtract(back, p)) < 1e-14, "{back:?}");
        let apart = norm(subtract(there, pose.transform(q)));
        assert!((apart - norm(subtract(p, q))).abs() < 1e-14);
        assert!(norm(subtract(pose.rotate(subtract(q, p)), subtract(pose.transform(q), there))) < 1e-14);
    }
}
