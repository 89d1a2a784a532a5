use energy_dsl::Vector3;

use super::{cross, dot, norm, subtract};

/// A rigid motion x ↦ R x + t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    rotation: [Vector3<f64>; 3],
    shift: Vector3<f64>,
}

impl Pose {
    /// The motion that leaves every point in place.
    pub const REST: Self = Self { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], shift: [0.0; 3] };

    /// Returns the right-handed rotation by an angle in degrees about an axis through a point (Rodrigues' formula).
    /// Quarter turns are exact up to rounding.
    #[must_use]
    pub fn turned(axis: Vector3<f64>, degrees: f64, centre: Vector3<f64>) -> Self {
        if degrees == 0.0 {
            return Self::REST;
        }
        let n = axis.map(|component| component / norm(axis));
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let column = |unit: Vector3<f64>| -> Vector3<f64> {
            let (across, along) = (cross(n, unit), dot(n, unit));
            std::array::from_fn(|i| cosine * unit[i] + sine * across[i] + (1.0 - cosine) * along * n[i])
        };
        let columns = Self::REST.rotation.map(column);
        let rotation = std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]));
        let turned = Self { rotation, shift: [0.0; 3] };
        Self { rotation, shift: subtract(centre, turned.applied(centre)) }
    }

    /// Returns this motion followed by a translation.
    #[must_use]
    pub fn shifted(mut self, by: Vector3<f64>) -> Self {
        (0..3).for_each(|axis| self.shift[axis] += by[axis]);
        self
    }

    /// Returns this motion followed by `next`.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let column = |j: usize| next.turned_direction(std::array::from_fn(|i| self.rotation[i][j]));
        let columns = [0, 1, 2].map(column);
        let rotation = std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]));
        Self { rotation, shift: next.applied(self.shift) }
    }

    /// Transforms a point.
    #[must_use]
    pub fn applied(&self, point: Vector3<f64>) -> Vector3<f64> {
        std::array::from_fn(|i| dot(self.rotation[i], point) + self.shift[i])
    }

    /// Transforms a direction: rotates without translating.
    #[must_use]
    pub fn turned_direction(&self, direction: Vector3<f64>) -> Vector3<f64> {
        self.rotation.map(|row| dot(row, direction))
    }

    /// Transforms a point by the inverse motion.
    #[must_use]
    pub fn undone(&self, point: Vector3<f64>) -> Vector3<f64> {
        let way = subtract(point, self.shift);
        std::array::from_fn(|j| (0..3).map(|i| self.rotation[i][j] * way[i]).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_undo_themselves_and_keep_distances() {
        let pose = Pose::turned([1.0, 2.0, -0.5], 77.0, [0.3, 0.2, 0.1]).shifted([1.0, -2.0, 3.0]);
        let (p, q) = ([0.4, -0.7, 1.1], [1.4, 0.7, -0.1]);
        let there = pose.applied(p);
        let back = pose.undone(there);
        assert!(norm(subtract(back, p)) < 1e-14, "{back:?}");
        let apart = norm(subtract(there, pose.applied(q)));
        assert!((apart - norm(subtract(p, q))).abs() < 1e-14);
        assert!(norm(subtract(pose.turned_direction(subtract(q, p)), subtract(pose.applied(q), there))) < 1e-14);
    }
}
