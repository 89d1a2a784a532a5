use energy_dsl::Vector3;

use crate::geometry::{cross, dot, norm, subtract};

/// A perspective camera that frames a set of points; z is up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Camera {
    eye: Vector3<f64>,
    /// Unit vectors to the right, down and forward.
    axes: [Vector3<f64>; 3],
    centre: [f64; 2],
    scale: f64,
}

/// The part of the floor that a row of pixels shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FloorRow {
    /// Horizontal coordinates at the left edge, in m, and their change per pixel.
    pub start: [f64; 2],
    pub step: [f64; 2],
    /// Size of a pixel across the line of sight, in m.
    pub pixel: f64,
}

impl Camera {
    /// Creates a camera that looks at the points from `direction` (from the points to the eye). They fill the fraction
    /// `fill` of a picture of this size.
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
        // Fit the projections of the points rather than their bounding box.
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

    /// Creates a camera at a place that looks at a point, with this angle between the upper and the lower edge of the
    /// picture, in degrees.
    pub(crate) fn looking(eye: Vector3<f64>, target: Vector3<f64>, angle: f64, size: [f64; 2]) -> Self {
        let backward = subtract(eye, target);
        let backward = backward.map(|component| component / norm(backward));
        // Straight up or down, the second axis is upwards in the picture.
        let up = if backward[2].abs() < 0.9999 { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] };
        let right = cross(up, backward);
        let right = right.map(|component| component / norm(right));
        let axes = [right, cross(right, backward), backward.map(|component| -component)];
        let scale = 0.5 * size[1] / (0.5 * angle.to_radians()).tan();
        Self { eye, axes, centre: size.map(|side| 0.5 * side), scale }
    }

    /// Returns the size in pixels of a length in m at this depth in m.
    pub(crate) fn pixels(&self, length: f64, depth: f64) -> f64 {
        self.scale * length / depth
    }

    /// Returns the position in pixels and the depth in m of a point.
    pub(crate) fn project(&self, point: Vector3<f64>) -> ([f64; 2], f64) {
        let [right, down, depth] = self.axes.map(|axis| dot(axis, subtract(point, self.eye)));
        let image = [right / depth, down / depth];
        (std::array::from_fn(|axis| self.centre[axis] + self.scale * image[axis]), depth)
    }

    /// Returns the floor at a height, as seen from above in a row of pixels of this length; `None` if the row does not
    /// show it. The horizontal axis of the picture is level, so that the depth is the same in the whole row.
    pub(crate) fn floor_row(&self, row: f64, height: f64, length: f64) -> Option<FloorRow> {
        let [right, down, forward] = self.axes;
        let offset = (row - self.centre[1]) / self.scale;
        let fall = -(forward[2] + offset * down[2]);
        let depth = (self.eye[2] - height) / fall;
        let pixel = depth / self.scale;
        if !(self.eye[2] > height && fall > 0.0 && (pixel * length).is_finite()) {
            return None;
        }
        let step = [pixel * right[0], pixel * right[1]];
        let start = [0, 1]
            .map(|axis| self.eye[axis] + depth * (forward[axis] + offset * down[axis]) - self.centre[0] * step[axis]);
        Some(FloorRow { start, step, pixel })
    }

    /// Returns the unit vector from a point to the eye.
    pub(crate) fn towards_eye(&self, point: Vector3<f64>) -> Vector3<f64> {
        let offset = subtract(self.eye, point);
        offset.map(|component| component / norm(offset))
    }
}
