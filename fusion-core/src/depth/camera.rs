use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A pinhole camera: x to the right, y down, z into the scene; pixel (u, v) is centred at whole numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Focal lengths, pixels.
    pub fx: f64,
    /// See `fx`.
    pub fy: f64,
    /// The axis, pixels.
    pub cx: f64,
    /// See `cx`.
    pub cy: f64,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
}

impl Camera {
    /// 640 × 480 pixels, f = 525: the usual structured-light camera.
    pub const VGA: Self = Self { fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };

    /// Where a point is seen, in pixels; nothing behind the camera.
    #[must_use]
    pub fn project(&self, p: &Vector3<f64>) -> Option<[f64; 2]> {
        (p.z > 1e-6).then(|| [self.fx * p.x / p.z + self.cx, self.fy * p.y / p.z + self.cy])
    }

    /// The pixel a point is seen in; none outside of the image.
    #[must_use]
    pub fn pixel(&self, p: &Vector3<f64>) -> Option<[usize; 2]> {
        let [u, v] = self.project(p)?.map(|x| (x + 0.5).floor());
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f64 && v < self.height as f64;
        inside.then_some([u as usize, v as usize])
    }

    /// The point that a pixel sees at a depth.
    #[must_use]
    pub fn unproject(&self, [u, v]: [usize; 2], depth: f64) -> Vector3<f64> {
        Vector3::new((u as f64 - self.cx) / self.fx, (v as f64 - self.cy) / self.fy, 1.0) * depth
    }

    /// What is wrong with it, if anything.
    #[must_use]
    pub fn fault(&self) -> Option<&'static str> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        if !(positive(self.fx) && positive(self.fy)) {
            return Some("focal lengths must be above 0");
        }
        if !(self.cx.is_finite() && self.cy.is_finite()) {
            return Some("the axis must be finite");
        }
        (self.width == 0 || self.height == 0).then_some("the image must have pixels")
    }
}
