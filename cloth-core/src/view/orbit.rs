use energy_dsl::Vector3;

use crate::geometry::{cross, dot, norm, subtract};

/// A camera that orbits a point; z is up. Pixels count from the upper left corner of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// The point it looks at, in m.
    pub target: Vector3<f64>,
    /// Distance of the eye from the target, in m.
    pub distance: f64,
    /// Azimuth of the direction from the target to the eye: the angle about z from x, in radians.
    pub azimuth: f64,
    /// Elevation of that direction above the horizon, in radians; never vertical.
    pub elevation: f64,
}

/// A ray from the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Position of the eye, in m.
    pub origin: Vector3<f64>,
    /// Unit direction.
    pub direction: Vector3<f64>,
}

/// A projected point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Position, in pixels.
    pub pixel: [f64; 2],
    /// Depth along the view direction, in m.
    pub depth: f64,
}

impl Orbit {
    /// Vertical angle of view, in radians.
    pub const FIELD_OF_VIEW: f64 = 0.6;
    /// Size of the view over the size of its content.
    const MARGIN: f64 = 1.05;
    /// Largest elevation, in radians.
    const STEEPEST: f64 = 1.55;

    /// Creates a camera that sees all points, from the front and slightly above.
    #[must_use]
    pub fn framing(points: &[Vector3<f64>]) -> Self {
        let bound = |pick: fn(f64, f64) -> f64, start: f64| -> Vector3<f64> {
            std::array::from_fn(|axis| points.iter().map(|p| p[axis]).fold(start, pick))
        };
        let (low, high) = (bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY));
        let target = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
        let radius = (0.5 * norm(subtract(high, low))).max(1e-6);
        let (azimuth, elevation) = ((-1.0_f64).atan2(0.62), 0.24);
        Self { target, distance: Self::MARGIN * radius / (0.5 * Self::FIELD_OF_VIEW).sin(), azimuth, elevation }
    }

    /// Returns the radius, in m, of the ball about the target that [`Self::framing`] would show from here.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.distance * (0.5 * Self::FIELD_OF_VIEW).sin() / Self::MARGIN
    }

    /// Position of the eye, in m.
    #[must_use]
    pub fn eye(&self) -> Vector3<f64> {
        let backward = self.backward();
        std::array::from_fn(|axis| self.target[axis] + self.distance * backward[axis])
    }

    /// Unit vector from the target to the eye.
    fn backward(&self) -> Vector3<f64> {
        let ((s, c), (up, out)) = (self.azimuth.sin_cos(), self.elevation.sin_cos());
        [out * c, out * s, up]
    }

    /// Unit vectors to the right, up, and from the target to the eye.
    #[must_use]
    pub fn axes(&self) -> [Vector3<f64>; 3] {
        let backward = self.backward();
        let (s, c) = self.azimuth.sin_cos();
        let right = [-s, c, 0.0];
        [right, cross(backward, right), backward]
    }

    /// Rotates about the target by a mouse drag, in pixels of a picture of this height.
    pub fn turn(&mut self, drag: [f64; 2], height: f64) {
        let angle = std::f64::consts::PI / height;
        self.azimuth -= drag[0] * angle;
        self.elevation = (self.elevation + drag[1] * angle).clamp(-Self::STEEPEST, Self::STEEPEST);
    }

    /// Translates by a mouse drag; a point at the target's depth follows the mouse.
    pub fn shift(&mut self, drag: [f64; 2], height: f64) {
        let [right, up, _] = self.axes();
        let metre = self.distance / focal_length(height);
        for axis in 0..3 {
            self.target[axis] += metre * (drag[1] * up[axis] - drag[0] * right[axis]);
        }
    }

    /// Moves towards the target by notches of the mouse wheel; away from it if negative.
    pub fn approach(&mut self, notches: f64) {
        self.distance = (self.distance * 0.9_f64.powf(notches)).clamp(1e-4, 1e6);
    }

    /// Projects a point into a picture of this size; `None` if it is behind the eye.
    #[must_use]
    pub fn project(&self, point: Vector3<f64>, size: [f64; 2]) -> Option<Seen> {
        let [right, up, backward] = self.axes();
        let through_pixel = subtract(point, self.eye());
        let depth = -dot(backward, through_pixel);
        let scale = focal_length(size[1]) / depth;
        let pixel = [0.5 * size[0] + scale * dot(right, through_pixel), 0.5 * size[1] - scale * dot(up, through_pixel)];
        (depth > 0.0).then_some(Seen { pixel, depth })
    }

    /// Returns the ray through a pixel.
    #[must_use]
    pub fn ray(&self, pixel: [f64; 2], size: [f64; 2]) -> Ray {
        let through_pixel = self.through_pixel(pixel, size);
        Ray { origin: self.eye(), direction: through_pixel.map(|component| component / norm(through_pixel)) }
    }

    /// Returns the point at this depth under a pixel, in m.
    #[must_use]
    pub fn at_depth(&self, pixel: [f64; 2], depth: f64, size: [f64; 2]) -> Vector3<f64> {
        let (eye, through_pixel) = (self.eye(), self.through_pixel(pixel, size));
        std::array::from_fn(|axis| eye[axis] + depth * through_pixel[axis])
    }

    /// Returns the vector from the eye to the point at depth 1 under a pixel.
    fn through_pixel(&self, pixel: [f64; 2], size: [f64; 2]) -> Vector3<f64> {
        let [right, up, backward] = self.axes();
        let f = focal_length(size[1]);
        let [x, y] = [(pixel[0] - 0.5 * size[0]) / f, (0.5 * size[1] - pixel[1]) / f];
        std::array::from_fn(|axis| x * right[axis] + y * up[axis] - backward[axis])
    }
}

/// Returns the focal length, in pixels.
fn focal_length(height: f64) -> f64 {
    0.5 * height / (0.5 * Orbit::FIELD_OF_VIEW).tan()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [f64; 2] = [800.0, 600.0];

    fn camera() -> Orbit {
        let mut camera = Orbit::framing(&[[-1.0, -0.5, 0.0], [1.0, 0.5, 2.0]]);
        camera.turn([70.0, -33.0], SIZE[1]);
        camera
    }

    #[test]
    fn projection_and_rays_are_inverse() {
        let camera = camera();
        let point = [0.3, -0.2, 1.7];
        let seen = camera.project(point, SIZE).unwrap();
        let back = camera.at_depth(seen.pixel, seen.depth, SIZE);
        assert!(norm(subtract(back, point)) < 1e-12, "{back:?}");
        let Ray { origin, direction } = camera.ray(seen.pixel, SIZE);
        assert!(norm(cross(direction, subtract(point, origin))) < 1e-12);
        assert_eq!(camera.project(camera.target, SIZE).unwrap().pixel.map(f64::round), [400.0, 300.0]);
        let behind = camera.at_depth([1.0, 1.0], -1.0, SIZE);
        assert_eq!(camera.project(behind, SIZE), None);
    }

    #[test]
    fn framed_points_are_in_the_picture() {
        let corners: Vec<Vector3<f64>> =
            (0..8).map(|i| std::array::from_fn(|axis| if i >> axis & 1 == 0 { -1.5 } else { 0.5 })).collect();
        let camera = Orbit::framing(&corners);
        for corner in corners {
            let [x, y] = camera.project(corner, SIZE).unwrap().pixel;
            assert!((0.0..SIZE[0]).contains(&x) && (0.0..SIZE[1]).contains(&y), "{corner:?} at {x} {y}");
        }
    }

    #[test]
    fn the_mouse_turns_shifts_and_approaches() {
        let mut camera = camera();
        let before = camera;
        camera.turn([50.0, 20.0], SIZE[1]);
        assert!((norm(subtract(camera.eye(), camera.target)) - before.distance).abs() < 1e-12);
        assert!(camera.eye()[2] > before.eye()[2], "dragging down lifts the eye");
        camera.turn([0.0, 1e6], SIZE[1]);
        let [right, up, backward] = camera.axes();
        assert!(dot(cross(right, up), backward) > 0.999 && up[2] > 0.0, "upright but no further");
        let mut camera = before;
        let target = camera.target;
        camera.shift([40.0, -25.0], SIZE[1]);
        let [x, y] = camera.project(target, SIZE).unwrap().pixel;
        assert!((x - 440.0).abs() < 1e-9 && (y - 275.0).abs() < 1e-9, "{x} {y}");
        camera.approach(2.0);
        assert!((camera.distance - 0.81 * before.distance).abs() < 1e-12);
    }
}
