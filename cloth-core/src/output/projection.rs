use energy_dsl::Vector3;

use crate::geometry::{cross, dot, norm, subtract};

/// A camera that sees a whole set of points: z is up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Camera {
    eye: Vector3<f64>,
    /// Right, down and forward.
    axes: [Vector3<f64>; 3],
    centre: [f64; 2],
    scale: f64,
}

impl Camera {
    /// Looks at the points from `direction` (from them to the eye), filling `fill` of a picture of the given size.
    pub(crate) fn framing(points: &[Vector3<f64>], direction: Vector3<f64>, size: [f64; 2], fill: f64) -> Self {
        let bound = |pick: fn(f64, f64) -> f64, start: f64| -> Vector3<f64> {
            std::array::from_fn(|axis| points.iter().map(|p| p[axis]).fold(start, pick))
        };
        let (low, high) = (bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY));
        let middle: Vector3<f64> = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
        let extent = norm(subtract(high, low)).max(f64::MIN_POSITIVE);
        let backward = direction.map(|component| component / norm(direction));
        let eye = std::array::from_fn(|axis| middle[axis] + 2.2 * extent * backward[axis]);
        let right = cross([0.0, 0.0, 1.0], backward);
        let right = right.map(|component| component / norm(right));
        let down = cross(right, backward);
        let axes = [right, down, backward.map(|component| -component)];
        // Centre and scale what is seen, not the box around it.
        let mut camera = Self { eye, axes, centre: [0.0; 2], scale: 1.0 };
        let seen: Vec<[f64; 2]> = points.iter().map(|p| camera.project(*p).0).collect();
        let range = |axis: usize| {
            let fold = |pick: fn(f64, f64) -> f64, start| seen.iter().map(|p| p[axis]).fold(start, pick);
            (fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY))
        };
        let ranges = [range(0), range(1)];
        let fit = |axis: usize| fill * size[axis] / (ranges[axis].1 - ranges[axis].0).max(f64::MIN_POSITIVE);
        camera.scale = fit(0).min(fit(1));
        camera.centre =
            std::array::from_fn(|axis| 0.5 * size[axis] - camera.scale * 0.5 * (ranges[axis].0 + ranges[axis].1));
        camera
    }

    /// Where a point is seen, in pixels, and how deep it lies, in m.
    pub(crate) fn project(&self, point: Vector3<f64>) -> ([f64; 2], f64) {
        let [right, down, depth] = self.axes.map(|axis| dot(axis, subtract(point, self.eye)));
        let image = [right / depth, down / depth];
        (std::array::from_fn(|axis| self.centre[axis] + self.scale * image[axis]), depth)
    }

    /// The unit vector from a point to the eye.
    pub(crate) fn towards_eye(&self, point: Vector3<f64>) -> Vector3<f64> {
        let way = subtract(self.eye, point);
        way.map(|component| component / norm(way))
    }
}
